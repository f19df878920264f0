"""What a table's metadata say of the scene that its rows are of."""

import hashlib
import json

from dpgcli.design.scene import Scene
from dpgcli.files.scene_file import spelled


def scene_metadata(scene: Scene, spec_json: str) -> dict[str, str]:
    """The spec and its hash, the law, the origin of each value, and the model's error."""
    return {
        "dpg.spec": spec_json,
        "dpg.spec_sha256": hashlib.sha256(spec_json.encode()).hexdigest(),
        "dpg.law": scene.finger.law.description,
        "dpg.sources": json.dumps(
            [[s.key, s.units, spelled(s.value), s.origin, s.rule] for s in scene.sources]
        ),
        "dpg.model_error": scene.model_error.text,
    }
