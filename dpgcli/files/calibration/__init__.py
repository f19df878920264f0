"""The calibration file: fitted values with their errors, where they hold and what they come from.

Written by `dpg fit`, read by specs. Keys of values and geometry are those of a spec.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import numpy as np
from pydantic import ValidationError

from dpgcli import __version__
from dpgcli.design.dimensions import AGREEMENT
from dpgcli.errors import Field, FitError, Problem, SpecError, UsageError
from dpgcli.files.calibration.models import (
    Calibration,
    Curve,
    DataFile,
    Fitted,
    Grid,
    Quality,
    ScalingLaw,
    Values,
)
from dpgcli.files.last_line import is_whole_text, sealed
from dpgcli.files.output import Mark, whole_file
from dpgcli.files.places import Location, in_order, located, shown
from dpgcli.files.sections import (
    Geometry,
    Section,
    UnitGeometry,
    expected_of,
    wrong_width,
)
from dpgcli.files.yaml_file import Document, parse_document, parse_value, read_text
from dpgcli.files.yaml_text import yaml_text
from dpgcli.text import KeyPath, dotted, quoted

__all__ = [
    "VERSION",
    "Calibration",
    "Curve",
    "DataFile",
    "Fitted",
    "Grid",
    "Quality",
    "ScalingLaw",
    "Values",
    "calibration_in",
    "calibration_of",
    "geometry_of",
    "made_by",
    "read_calibration",
    "write_calibration",
]

VERSION = 1
SEALED = "SHA-256 in the last line"  # how made_by ends in a file of dpg fit
OTHER_TEXT = (
    "the text of the SHA-256 in its last line",
    "another",
    "damaged or edited: make it again; an edited one has no such line, nor says so in made_by",
)
NO_SEAL = (
    "its SHA-256 in its last line, as dpg fit writes it",
    "none",
    "cut off or edited: make it again; an edited one does not say in made_by that it has the line",
)
MEASURED = ("pressure_MPa", "volume_mm3")  # of a curve, each null where it was not
ROUNDING = 1e-9  # of a correlation: of one that other programs computed, or that was written down
SMALLEST_STEP = 1e-12  # of a curve's travels: below it two points are one
Issue = tuple[KeyPath, str, str]  # key, expected, found


def made_by() -> str:
    """This program and what its fits depend on, as calibration files name them."""
    import scipy

    return f"dpg {__version__}, numpy {np.__version__}, scipy {scipy.__version__}, {SEALED}"


def calibration_of(sections: Mapping[str, Any]) -> Calibration:
    """A calibration with these sections, made by this program."""
    head = {"calibration_version": VERSION, "made_by": made_by()}
    return Calibration.model_validate({**head, **sections})


def write_calibration(path: Path, calibration: Calibration) -> None:
    """Write a calibration, sealed by its last line: the same one gives the same bytes.

    Raises OutputError, and leaves no half-written file whatever happens.
    """
    text = yaml_text(calibration.model_dump(exclude_none=True))
    with whole_file(path, Mark.CALIBRATION) as new:
        new.write_text(sealed(text), encoding="utf-8", newline="\n")


def read_calibration(path: str | Path) -> Calibration:
    """Read and check a calibration. Raises SpecError with every problem and its place.

    Raises UsageError for what is no path.
    What `dpg fit` wrote has its SHA-256 in the last line: values that were cut off would else be
    taken from the next calibration, in silence. Files of an earlier version have none.

    >>> read_calibration("configs/calibration/push_3.5mm.yaml").values.stroke_mm.value
    3.5
    """
    try:
        Path(path)
    except TypeError:
        raise UsageError(f"path {quoted(path)}: expected a path") from None
    file, text = read_text(path)
    is_whole = is_whole_text(text)
    if is_whole is False:
        raise SpecError((located(Location(file), "file", *OTHER_TEXT),))
    found = calibration_in(parse_document(file, text))
    if found.made_by.endswith(SEALED) and not is_whole:
        raise SpecError((located(Location(file), "file", *NO_SEAL),))
    return found


def calibration_in(document: Document) -> Calibration:
    """The calibration in a document. Raises SpecError with every problem and its place."""
    try:
        found = Calibration.model_validate(document.data)
    except ValidationError as error:
        problems = [_problem(document, e) for e in error.errors(include_url=False)]
        raise SpecError(in_order([*document.problems, *problems])) from None
    problems = [document.problem(*i) for i in (*_issues(found), *_order_issues(found, document))]
    empty = (
        path
        for path in document.empty()
        if path[:1] != ("curve",) or not {*path[1:2]} & {*MEASURED}
    )
    problems += [document.problem(path, _expected(path), "nothing") for path in empty]
    if problems or document.problems:
        raise SpecError(in_order([*document.problems, *problems]))
    return found


def geometry_of(settings: Sequence[str], base: Geometry | None = None) -> Geometry:
    """A geometry from "KEY=VALUE" texts, over those of a base.

    Raises SpecError with every problem.
    """
    data: dict[str, Any] = {} if base is None else base.model_dump(exclude_none=True)
    place = Location(Field("geometry"))
    problems: list[Problem] = []
    for text in settings:
        key, equals, value = (part.strip() for part in text.partition("="))
        try:
            data[key] = parse_value(value, place)
        except SpecError as error:
            problems += error.problems
        if not equals or not key:
            problems.append(located(place, "setting", "KEY=VALUE", shown(text)))
    try:
        found = Geometry.model_validate(data)
    except ValidationError as error:
        document = Document(place.file, {}, {})
        located_errors = ({**e, "loc": ("geometry", *e["loc"])} for e in error.errors())
        problems += [_problem(document, e) for e in located_errors]
    else:
        if wrong := wrong_width(found.given()):
            problems.append(located(place, dotted(wrong.path[1:]), *wrong[1:]))
    if problems:
        raise SpecError(in_order(problems))
    return found


def _problem(document: Document, error: Any) -> Problem:
    """One finding of the models as a problem with a place."""
    path: KeyPath = error["loc"]
    if error["type"] == "extra_forbidden":
        section, _ = _model_at(path)
        known = list(section.model_fields)
        close = get_close_matches(str(path[-1]), known, n=1)
        hint = f"did you mean {close[0]}?" if close else "known here: " + ", ".join(known)
        return document.problem(path, "a known key", shown(path[-1]), hint)
    found = "nothing" if error["type"] == "missing" else shown(error["input"])
    return document.problem(path, _expected(path), found)


def _expected(path: KeyPath) -> str:
    """The values that a key can have, in words."""
    section, description = _model_at(path)
    if issubclass(section, Fitted) and path[-1] == "value":
        return expected_of(str(path[-2]))
    return expected_of(str(path[-1])) if issubclass(section, UnitGeometry) else description


def _model_at(path: KeyPath) -> tuple[type[Section], str]:
    """The section that a key path stands in, and what its key describes."""
    section: type[Section] = Calibration
    kind: Any = Calibration
    description = "a section of keys"
    for part in path:
        kind = _bare(kind)
        if not isinstance(kind, type) or not issubclass(kind, Section):
            kind = (get_args(kind) or (kind,))[-1]  # the items of a list or mapping
            continue
        section = kind
        field = section.model_fields.get(str(part))
        if field is None:
            break
        kind, description = field.annotation, field.description or "a section of keys"
    return section, description


def _bare(kind: Any) -> Any:
    """A type without what is said about it, and without None."""
    while get_origin(kind) in (Annotated, Union, UnionType):
        kind = get_args(kind)[0]
    return kind


def _issues(calibration: Calibration) -> Iterator[Issue]:
    """Contradictions between keys that are valid by themselves."""
    if calibration.grid is None and not (calibration.values and calibration.values.given()):
        yield (), "values, a grid or both", "neither"
    if calibration.correlation is not None:
        yield from _correlation_issues(calibration.correlation, list(calibration.uncertain))
    if calibration.curve is not None:
        yield from _curve_issues(calibration.curve)
    if calibration.grid is not None:
        yield from _grid_issues(calibration.grid)


def _correlation_issues(rows: list[list[float]], keys: list[str]) -> Iterator[Issue]:
    path: KeyPath = ("correlation",)
    if len(rows) != len(keys) or any(len(row) != len(keys) for row in rows):
        expected = f"{len(keys)} rows of as many numbers, for {', '.join(keys) or 'no value'}"
        yield path, expected, f"rows of {', '.join(str(len(row)) for row in rows)}"
        return
    matrix = np.array(rows).reshape(len(keys), len(keys))
    off = max(np.ptp([matrix, matrix.T], axis=0).max(initial=0.0), np.ptp([*np.diag(matrix), 1.0]))
    if not off <= ROUNDING:
        yield path, "a symmetric matrix with 1 on its diagonal", "another"
    elif len(keys) and np.linalg.eigvalsh(matrix)[0] < -ROUNDING:
        yield path, "a matrix without negative eigenvalue", "one with"


def _order_issues(calibration: Calibration, document: Document) -> Iterator[Issue]:
    """A correlation counts its rows by the order of the values, which has to be one order."""
    order = list(calibration.uncertain)
    written = [key for key in document.data.get("values") or {} if key in order]
    if calibration.correlation is not None and written != order:
        yield ("values",), f"the order {', '.join(order)} for a correlation", ", ".join(written)


def _curve_issues(curve: Curve) -> Iterator[Issue]:
    path: KeyPath = ("curve", "travel_mm")
    if len(curve.travel_mm) != len(curve.energy_mJ):
        yield path, f"{len(curve.energy_mJ)} numbers, as energies", str(len(curve.travel_mm))
    for key in MEASURED:
        measured = getattr(curve, key)
        if measured is not None and len(measured) != len(curve.travel_mm):
            expected = f"{len(curve.travel_mm)} numbers, as travels"
            yield ("curve", key), expected, str(len(measured))
    travels = np.array(curve.travel_mm)
    least = SMALLEST_STEP * np.ptp(travels)
    for index in np.flatnonzero(np.diff(travels) <= least)[:1].tolist():
        expected = f"more than {travels[index]:g}"
        yield (*path, index + 1), expected, f"{travels[index + 1]:g}"
    last = min(0.0, travels[0])
    for index, (start, end) in enumerate(curve.unsampled_mm):
        place: KeyPath = ("curve", "unsampled_mm", index)
        found = f"{start:g}, {end:g}"
        if not start < end:
            yield place, "the smaller travel first", found
        elif start < last or end > travels[-1]:
            yield place, f"travels from {last:g} to {travels[-1]:g}, gap after gap", found
        elif ((travels > start) & (travels < end)).any():
            yield place, "no travel_mm between the two", found
        last = max(last, end)


def _grid_issues(grid: Grid) -> Iterator[Issue]:
    before: list[Issue] = []
    sizes = {len(values) for values in grid.points.values()}
    if len(sizes) > 1:
        found = " and ".join(map(str, sorted(sizes)))
        before.append((("grid", "points"), "lists of one length", found))
    for index, key in enumerate(grid.over):
        place: KeyPath = ("grid", "over", index)
        if key not in Geometry.model_fields:
            before.append((place, "a key of the geometry section", shown(key)))
        elif key in grid.over[:index]:
            before.append((place, "each key once", f"{key} again"))
        elif key not in grid.points:
            before.append((("grid", "points"), f"a list for {key}", "none"))
    if grid.method != "scaling" and grid.scaling is not None:
        before.append((("grid", "scaling"), "nothing beside another method", "a section"))
    yield from before or _law_issues(grid)


def _law_issues(grid: Grid) -> Iterator[Issue]:
    """Problems of a grid: no interpolation, no law, or laws that its points do not yield."""
    quantities = [key for key in grid.points if key not in grid.over]
    middle = np.array([[np.mean(grid.points[key]) for key in grid.over]])
    points = grid.model_copy().law  # what a grid has computed is no part of its file
    try:
        for key in quantities:
            points.at(key, middle)
    except FitError as error:
        yield ("grid", "points"), f"points for method {grid.method}", str(error)
        return
    for key, law in (grid.scaling or {}).items():
        path: KeyPath = ("grid", "scaling", key)
        if key not in quantities:
            yield path, "a quantity among the points", shown(key)
            continue
        values = points.scaling(key).values
        own = {"at_reference": math.exp(values[0]), **dict(zip(grid.over, values[1:], strict=True))}
        written = {"at_reference": law.at_reference, **law.exponents}
        if set(own) != set(written):
            yield (*path, "exponents"), f"those of {', '.join(grid.over)}", ", ".join(law.exponents)
        elif not np.allclose([written[k] for k in own], list(own.values()), AGREEMENT, AGREEMENT):
            yield path, f"the law of the points: {_listed(own)}", _listed(written)


def _listed(values: Mapping[str, float]) -> str:
    return ", ".join(f"{key} {value:.6g}" for key, value in values.items())
