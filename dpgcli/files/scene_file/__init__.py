"""The spec of a scene: read and checked, turned into a scene, and written for other programs."""

import json
import math
import re
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from dpgcli.design.calibrations import PUBLISHED
from dpgcli.errors import SpecError
from dpgcli.files.scene_file.histories import with_history
from dpgcli.files.scene_file.models import Spec
from dpgcli.files.scene_file.problems import checked, checked_keys
from dpgcli.files.scene_file.scenes import scene_of
from dpgcli.files.scene_file.settings import changed, with_settings
from dpgcli.files.yaml_file import FREE, Document, read_document

__all__ = [
    "Spec",
    "canonical",
    "canonical_json",
    "checked",
    "folder_of",
    "json_schema",
    "read_keys",
    "read_scene",
    "read_spec",
    "reason_against",
    "scene_in",
    "scene_of",
    "spelled",
    "starter",
    "with_files",
]

GRIPPER = re.compile(r"^( *)# (?=gripper:|base_spacing_mm:|mounting_angle_deg:)", re.MULTILINE)


def read_spec(path: str | Path, settings: Sequence[str] = ()) -> Spec:
    """Read and check a spec; "-" reads standard input.

    `settings` are "key.path=value" texts that change the file's data before it is checked.
    Raises SpecError with all problems at once, those of content after those of form are mended.
    """
    return checked(read_scene(path, settings))


def read_keys(path: str | Path, settings: Sequence[str] = ()) -> Spec:
    """Read a spec key by key: rules between keys wait, and calibrations need not exist yet.

    For what comes before them in the making: finite elements, fits. Raises SpecError.
    """
    return checked_keys(with_settings(read_document(path), settings))


def read_scene(path: str | Path, settings: Sequence[str] = ()) -> Document:
    """The data of a spec, as `settings` change it, with the content of the files it names."""
    return scene_in(read_document(path), path, settings)


def scene_in(document: Document, path: str | Path, settings: Sequence[str] = ()) -> Document:
    """The same, of a document that was read from this path."""
    return with_files(with_settings(document, settings), folder_of(path))


def with_files(document: Document, folder: Path) -> Document:
    """The document with what the files hold that it names, calibrations, histories and forces.

    Names are relative to the spec's folder.
    """
    finger = document.data.get("finger")
    said = finger.get("calibration") if isinstance(finger, dict) else None
    if said is not None and said != PUBLISHED:
        from dpgcli.files.scene_file.references import with_calibrations

        document = with_calibrations(document, said, folder)
    document = with_history(document, folder)
    if "object" in document.data:
        from dpgcli.files.scene_file.forces import with_forces

        document = with_forces(document, folder)
    return document


def folder_of(path: str | Path) -> Path:
    """What names of files in a spec are relative to; standard input has no folder."""
    return Path() if str(path) == "-" else Path(path).parent


def reason_against(data: Mapping[str, Any], changes: Mapping[str, float]) -> str:
    """The problems of a spec's plain data once some keys ("a.b.c") are changed, in one line."""
    try:
        checked(changed(Document("design", dict(data), {}), changes))
    except SpecError as error:
        return "; ".join(problem.statement for problem in error.problems)
    raise ValueError(f"nothing is wrong with {changes}")


def json_schema() -> dict[str, Any]:
    """The JSON Schema of a spec, for editors."""
    schema = Spec.model_json_schema()
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "dpg spec"}
    return {**schema, **head, "patternProperties": {f"^{FREE}": {}}}


def canonical_json(spec: Spec) -> str:
    """One line of JSON, the same for specs that say the same; infinity is the text ".inf"."""
    plain = canonical(spec.model_dump(exclude_none=True))
    return json.dumps(plain, sort_keys=True, separators=(",", ":"), allow_nan=False)


def starter(*, has_gripper: bool = False) -> str:
    """A commented spec to start from: of a finger, or of a gripper of two."""
    resource = resources.files("dpgcli.files.scene_file").joinpath("starter.yaml")
    text = resource.read_text(encoding="utf-8")
    return GRIPPER.sub(r"\1", text) if has_gripper else text


def canonical(value: Any) -> Any:
    """Data as strict JSON can say them: infinity is the text ".inf", negative zero is zero."""
    if isinstance(value, dict):
        return {key: canonical(item) for key, item in value.items()}
    if isinstance(value, list):
        return [canonical(item) for item in value]
    return spelled(value) if isinstance(value, float) else value


def spelled(value: float) -> float | str:
    """A number as JSON can say it: infinity is the text ".inf" or "-.inf", as in a spec."""
    return str(value).replace("inf", ".inf") if math.isinf(value) else value + 0.0
