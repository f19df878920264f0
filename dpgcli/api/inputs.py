"""Specs as arguments of the functions: paths, data or values, and settings by key."""

import json
import os
from collections.abc import Mapping, Sequence
from datetime import date
from decimal import Decimal
from fractions import Fraction
from numbers import Real
from pathlib import Path
from types import NoneType
from typing import Any, TypeAlias

from pydantic import BaseModel

from dpgcli.api.arguments import as_texts, files_of, path_of, whole
from dpgcli.design.dimensions import MAX_UNITS
from dpgcli.design.scene import Scene
from dpgcli.errors import Field, SpecError, UsageError
from dpgcli.files.access import reading
from dpgcli.files.scene_file import (
    Spec,
    canonical,
    canonical_json,
    checked,
    folder_of,
    scene_of,
    with_files,
)
from dpgcli.files.scene_file.problems import checked_keys
from dpgcli.files.scene_file.settings import with_settings
from dpgcli.files.yaml_file import Document, read_document, without_free_keys
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.text import quoted

Settings: TypeAlias = Mapping[str, object] | Sequence[str] | str
"""Values by dotted key of a spec, or "key=value" texts."""

Texts: TypeAlias = Mapping[str, str] | Sequence[str] | str
"""Texts by name, or "name=text"."""

Place: TypeAlias = Sequence[float] | None
"""Two numbers in mm; None where somebody else says them."""


@dataclass(frozen=True)
class SceneInput:
    """A scene, and the spec that it was read from: none for a value that was handed in.

    `name` is the spec's in messages, `document` what it says, with files by their names,
    which are relative to `folder`; `files` are those that were read.
    """

    name: str
    scene: Scene
    spec: Spec | None = None
    document: Document | None = None
    folder: Path = Path()
    files: tuple[Path, ...] = ()

    @property
    def json(self) -> str:
        """The spec as one line of JSON, as tables keep it."""
        return "{}" if self.spec is None else canonical_json(self.spec)


SpecInput: TypeAlias = str | Path | Mapping[str, Any] | Spec | Scene | Finger | SceneInput
"""A spec's file, its data, as `inverse_design` gives it, or the value that it stands for."""


def scene_input(spec: SpecInput, settings: Settings = ()) -> SceneInput:
    """Read a spec, or take what was read.

    Raises SpecError with all problems of the spec, UsageError for settings beside a value.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> scene_input(uniform_finger(3, **STUDY)).scene.finger.n_units
    3
    """
    if isinstance(spec, SceneInput | Scene | Finger):
        if setting_texts(settings):
            raise UsageError(Field("settings"), " change a spec, not a finger's values")
        if isinstance(spec, SceneInput):
            return spec
        scene = Scene(spec, sources=()) if isinstance(spec, Finger) else spec
        if scene.finger.n_units > MAX_UNITS:
            found = f" of {scene.finger.n_units:,} units: expected at most {MAX_UNITS}"
            raise UsageError(Field("spec"), found)
        return SceneInput("scene", scene)
    if isinstance(spec, Spec):
        spec = spec.model_dump(exclude_none=True)
    if isinstance(spec, Mapping):
        return _scene("spec", _without_files(spec, settings), Path())
    path = path_of("spec", spec)
    document = read_document(spec)
    if "space" in document.data and "finger" not in document.data:
        said = "a spec, with the key finger", "a sweep", "dpg sweep and dpg explain take it"
        raise SpecError((document.problem(("space",), *said),))
    if "targets" in document.data and "finger" not in document.data:
        said = "a spec, with the key finger", "a goal", "dpg design takes it"
        raise SpecError((document.problem(("targets",), *said),))
    return scene_input_in(document, path, settings)


def spec_or_design(spec: SpecInput, design: int | None, settings: Settings = ()) -> SceneInput:
    """A spec as `scene_input` reads it, or the design of this number of a sweep's folder."""
    design = whole("design", design)
    if design is not None:
        from dpgcli.api.designs import design_input  # whatever reads tables

        return design_input(spec, design, settings)
    if isinstance(spec, str | os.PathLike):
        path = path_of("spec", spec)
        with reading(path):
            is_folder = path.is_dir()
        if is_folder:
            raise UsageError(f"{path} is a folder: say which of its designs with ", Field("design"))
    return scene_input(spec, settings)


def scene_input_in(document: Document, path: Path, settings: Settings = ()) -> SceneInput:
    """The same, of a document that was read from this path."""
    said = with_settings(document, setting_texts(settings))
    return _scene(str(path), said, folder_of(path), path)


def _scene(name: str, said: Document, folder: Path, *own: Path) -> SceneInput:
    whole = with_files(said, folder)
    spec = checked(whole)
    return SceneInput(name, scene_of(spec), spec, said, folder, files_of(*own, *whole.files))


def keys_of(spec: str | Path | Mapping[str, Any], settings: Settings = ()) -> Spec:
    """A spec key by key, as `files.scene_file.read_keys`: calibrations need not exist yet."""
    if isinstance(spec, Mapping):
        return checked_keys(_without_files(spec, settings))
    path = path_of("spec", spec)
    return checked_keys(with_settings(read_document(path), setting_texts(settings)))


def spec_document(data: Mapping[str, Any], settings: Settings = ()) -> Document:
    """The data of a spec, as `settings` change it, with what the files hold that it names."""
    return with_files(_without_files(data, settings), Path())


def _without_files(data: Mapping[str, Any], settings: Settings) -> Document:
    own = without_free_keys(plain(data))
    return with_settings(Document("spec", own, {}), setting_texts(settings))


def setting_texts(settings: Settings, field: str = "settings") -> tuple[str, ...]:
    """Settings as "key=value" texts.

    >>> setting_texts({"finger.units": 3, "finger.linear_stiffness_N_per_mm": float("inf")})
    ('finger.units=3', 'finger.linear_stiffness_N_per_mm=".inf"')
    """
    if not isinstance(settings, Mapping):
        return as_texts(field, settings)
    values = by_text(field, settings)
    return tuple(f"{key}={json.dumps(canonical(plain(values[key])))}" for key in values)


def by_text(what: str, given: Mapping[Any, Any]) -> dict[str, Any]:
    """What is given by keys that are texts, or numbers in their place, as 2 of a unit.

    Raises UsageError for two keys that are one text, as in a file they would be.

    >>> by_text("overrides", {2: "a", "3": "b"})
    {'2': 'a', '3': 'b'}
    """
    texts: dict[str, Any] = {}
    for key, value in given.items():
        try:
            text = str(key)
        except ValueError:  # a number of more than 4,300 digits
            raise UsageError(Field(what), f": {quoted(key)} is no key") from None
        if text in texts:
            raise UsageError(Field(what), f": {text} is there twice, as {key!r} as well")
        texts[text] = value
    return texts


def plain(value: Any) -> Any:
    """Data as a YAML file would hold them: calibrations as sections, NumPy's numbers as Python's.

    Raises UsageError for what no such file holds.

    >>> import numpy as np
    >>> plain({"finger": {"units": np.int64(3), "calibration": ("published",)}})
    {'finger': {'units': 3, 'calibration': ['published']}}
    """
    try:
        return _plain(value)
    except RecursionError:
        raise UsageError("a spec is nested too deeply, or holds itself") from None


def _plain(value: Any) -> Any:
    if isinstance(value, BaseModel):
        return value.model_dump(exclude_none=True)
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in by_text("spec", value).items()}
    if isinstance(value, list | tuple | range):
        return [_plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Decimal | Fraction | int):
        return _number(value)
    listed = getattr(value, "tolist", None)  # of NumPy's scalars and arrays, and of series
    if listed is None and not isinstance(value, str | Real | date | NoneType):
        raise UsageError(f"a spec has no {type(value).__name__}: expected numbers and texts")
    return value if listed is None else _plain(listed())


def _number(value: Decimal | Fraction | int) -> float | int:
    """A number as a file can hold it, those of a database included."""
    try:
        json.dumps(number := value if isinstance(value, int) else float(value))
    except (OverflowError, ValueError):  # beyond double precision; digits; a signaling NaN
        raise UsageError(f"a spec has no such number: {quoted(value)}") from None
    return number
