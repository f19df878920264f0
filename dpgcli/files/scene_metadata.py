"""What a table's metadata say of the scene that its rows are of."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from dpgcli.design.pressure import History, Pressure
from dpgcli.design.scene import Scene
from dpgcli.files.scene_file import spelled


def chosen_metadata(chosen: Mapping[str, Any]) -> dict[str, str]:
    """What was chosen beside the spec, by name: texts as they are, else JSON.

    >>> chosen_metadata({"start": "011", "gaps_mm": [10.0, 40.0]})
    {'dpg.start': '011', 'dpg.gaps_mm': '[10.0, 40.0]'}
    """
    return {
        f"dpg.{name}": value if isinstance(value, str) else json.dumps(value, allow_nan=False)
        for name, value in chosen.items()
    }


def told_history(pressure: Pressure, history: History) -> dict[str, Any]:
    """Pressures of each line by step, in plain values."""
    columns = history.pressure.T.tolist()
    told: dict[str, Any] = {"history_MPa": dict(zip(pressure.lines, columns, strict=True))}
    return told if history.time is None else {**told, "history_s": history.time.tolist()}


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
