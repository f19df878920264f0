"""The spec of a scene: read and checked, turned into a scene, and written for other programs."""

import json
import math
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from dpgcli.files.spec.models import Spec
from dpgcli.files.spec.problems import checked
from dpgcli.files.spec.scenes import scene_of
from dpgcli.files.spec.settings import with_settings
from dpgcli.files.spec.source import read_document

__all__ = ["Spec", "canonical_json", "json_schema", "read_spec", "scene_of", "starter"]


def read_spec(path: str | Path, settings: Sequence[str] = ()) -> Spec:
    """Read and check a spec; "-" reads standard input.

    `settings` are "key.path=value" texts that change the file's data before it is checked.
    Raises SpecError with all problems at once, those of content after those of form are mended.
    """
    return checked(with_settings(read_document(path), settings))


def json_schema() -> dict[str, Any]:
    """The JSON Schema of a spec, for editors."""
    schema = Spec.model_json_schema()
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "dpg spec"}
    return {**schema, **head}


def canonical_json(spec: Spec) -> str:
    """One line of JSON, the same for specs that say the same; infinity is the text ".inf"."""
    plain = _canonical(spec.model_dump(exclude_none=True))
    return json.dumps(plain, sort_keys=True, separators=(",", ":"), allow_nan=False)


def starter() -> str:
    """A commented spec to start from."""
    return resources.files("dpgcli.files.spec").joinpath("starter.yaml").read_text(encoding="utf-8")


def _canonical(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _canonical(item) for key, item in value.items()}
    if isinstance(value, float):
        return ".inf" if math.isinf(value) else value + 0.0
    return value
