"""Arguments of the functions: specs as paths, data or values, settings by key, points, numbers."""

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from datetime import date
from decimal import Decimal
from enum import StrEnum
from fractions import Fraction
from importlib import util
from itertools import islice
from numbers import Integral, Real
from pathlib import Path
from types import NoneType
from typing import Any, TypeAlias, TypeGuard, TypeVar

from pydantic import BaseModel

from dpgcli.design.dimensions import LARGEST, MAX_UNITS, SMALLEST
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

N_COORDINATES = 2
BYTES = (bytes, bytearray, memoryview)  # whose items are numbers of letters
MOST_ITEMS = 10**6  # of a sequence that is handed in
LARGEST_WHOLE = 2**1000  # far beyond any seed
NO_TABLE = (".csv", ".json", ".yaml", ".yml", ".svg", ".png")

E = TypeVar("E", bound=StrEnum)
W = TypeVar("W", int, int | None)
R = TypeVar("R", float, float | None)


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


def each_of(field: str, value: Any) -> tuple[Any, ...]:
    """The items of a sequence; of what is none, such as a text, itself.

    Raises UsageError for more than MOST_ITEMS of them, which may go on without end.

    >>> each_of("only", "abc"), each_of("only", ["a", "b"]), each_of("only", b"ab")
    (('abc',), ('a', 'b'), (b'ab',))
    """
    if isinstance(value, (str, *BYTES)) or not isinstance(value, Iterable):
        return (value,)
    try:
        found = tuple(islice(value, MOST_ITEMS + 1))
    except TypeError:  # an array without axes
        return (value,)
    if len(found) > MOST_ITEMS:
        raise UsageError(Field(field), f": expected at most {MOST_ITEMS:,} items")
    return found


def as_texts(field: str, texts: str | Iterable[str]) -> tuple[str, ...]:
    """Texts; one alone is not a sequence of letters. Raises UsageError for what is none.

    >>> as_texts("only", "abc"), as_texts("only", ["a", "b"])
    (('abc',), ('a', 'b'))
    """
    listed = each_of(field, texts)
    if not all(isinstance(text, str) for text in listed):
        raise UsageError(Field(field), f" {quoted(texts)}: expected a text or several")
    return listed


def path_of(field: str, path: str | os.PathLike[str]) -> Path:
    """The path of a file or folder. Raises UsageError for what is none, or no system can name.

    An empty text is none, though for pathlib it is the current folder.

    >>> path_of("spec", None)
    Traceback (most recent call last):
        ...
    dpgcli.errors.UsageError: spec None: expected a path
    """
    try:
        found = Path(path)
        is_name = b"\0" not in os.fsencode(found) and path != ""
    except (TypeError, UnicodeEncodeError):  # half of a pair in UTF-16
        is_name = False
    if not is_name:
        raise UsageError(Field(field), f" {quoted(path)}: expected a path")
    return found


def files_of(*sources: object) -> tuple[Path, ...]:
    """Those of the sources that are files, wherever the program works by the time of writing."""
    return tuple(Path(s).absolute() for s in sources if isinstance(s, str | os.PathLike))


def check_numbers(**values: float | None) -> None:
    """Raise UsageError for an argument that is no number; none where it is optional.

    >>> check_numbers(tolerance=1e-9, target_error=None)
    """
    for field, value in values.items():
        if value is not None and not is_number(value):
            raise UsageError(Field(field), f" {quoted(value)}: expected a number")


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value is a number, and no whole one that is beyond those with a decimal point.

    >>> is_number(2), is_number(True), is_number("2"), is_number(10**400)
    (True, False, False, False)
    """
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    return not isinstance(value, Integral) or abs(int(value)) <= LARGEST


def check_whole(**values: int | None) -> None:
    """Raise UsageError for an argument that is no whole number; none where it is optional.

    >>> check_whole(jobs=2)
    """
    for field, value in values.items():
        is_whole = isinstance(value, Integral) and not isinstance(value, bool)
        if value is not None and not (is_whole and abs(value) < LARGEST_WHOLE):
            raise UsageError(Field(field), f" {quoted(value)}: expected a whole number")


def whole(field: str, value: W) -> W:
    """A whole number as Python's own, which JSON can say too; raises UsageError for what is none.

    >>> import numpy as np
    >>> whole("top", np.int64(3)), whole("top", None)
    (3, None)
    """
    check_whole(**{field: value})
    return value if value is None else int(value)


def number(field: str, value: R) -> R:
    """A number as Python's own, as `whole`; raises UsageError for what is none."""
    check_numbers(**{field: value})
    return value if value is None else float(value)


def check_callable(**values: object) -> None:
    """Raise UsageError for an argument that cannot be called, before any work.

    >>> check_callable(watch=print)
    """
    for field, value in values.items():
        if not callable(value):
            raise UsageError(Field(field), f" {quoted(value)}: expected a function")


def check_texts(**values: str | None) -> None:
    """Raise UsageError for an argument that is no text; none where it is optional.

    >>> check_texts(formulation="chain", shard=None)
    """
    for field, value in values.items():
        if value is not None and not isinstance(value, str):
            raise UsageError(Field(field), f" {quoted(value)}: expected a text")


def check_flags(**values: bool) -> None:
    """Raise UsageError for an argument that is neither True nor False.

    >>> check_flags(restart=False)
    """
    for field, value in values.items():
        if not isinstance(value, bool):
            raise UsageError(Field(field), f" {quoted(value)}: expected True or False")


def point(field: str, place: Sequence[float]) -> tuple[float, float]:
    """A place in some data, mm. Raises UsageError for what is not two numbers.

    >>> point("first_station", [5.375, -0.75])
    (5.375, -0.75)
    """
    is_listed = isinstance(place, Sequence) or hasattr(place, "tolist")  # no set, and no table
    parts = each_of(field, place) if is_listed else ()
    numbers = [float(part) for part in parts if is_number(part) and abs(part) <= LARGEST]
    if not len(numbers) == len(parts) == N_COORDINATES:
        raise UsageError(
            Field(field), f" {quoted(place)}: expected two numbers in mm, such as 5.375, -0.75"
        )
    return numbers[0], numbers[1]


def figure_path(path: str | Path) -> Path:
    """The path of a figure. Raises UsageError for a suffix that cannot be drawn."""
    figure = path_of("path", path)
    if figure.suffix.lower() not in (".svg", ".png"):
        raise UsageError(f"path {path}: expected a name that ends in .svg or .png")
    check_installed("a figure", "matplotlib")
    return figure


def table_path(path: str | Path) -> Path:
    """The path of a Parquet file. Raises UsageError for a suffix that says something else."""
    table = path_of("path", path)
    if table.suffix.lower() in NO_TABLE:
        raise UsageError(f"path {path}: writes Parquet, give a name that ends in .parquet")
    return table


def check_installed(what: str, package: str) -> None:
    """Raise UsageError if what is asked for needs a package that is not there."""
    if util.find_spec(package) is None:
        raise UsageError(f"{what} needs {package}: pip install {package}")


def check_positive(field: str, value: float | None) -> None:
    """Raise UsageError for a number, if there is one, that is not above zero or out of reach."""
    check_numbers(**{field: value})
    if value is not None and not SMALLEST <= value <= LARGEST:
        found = f"{value:g}" if isinstance(value, float) else quoted(value)
        expected = f"expected a number > 0, from {SMALLEST:g} to {LARGEST:g}"
        raise UsageError(Field(field), f" {found}: {expected}")


def chosen(kind: type[E], field: str, value: str) -> E:
    """A member of an enumeration by its text. Raises UsageError for another text."""
    try:
        return kind(value if isinstance(value, str) else quoted(value))
    except ValueError:
        known = ", ".join(map(str, kind))
        raise UsageError(Field(field), f" {quoted(value)}: expected {known}") from None
