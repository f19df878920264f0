"""From data to a checked spec: every mistake located, worded and given a hint."""

from dataclasses import replace
from difflib import get_close_matches
from typing import Any

from pydantic import ValidationError

from dpgcli.design.bodies import PLACES
from dpgcli.design.dimensions import (
    LARGEST,
    MAX_UNITS,
    SMALLEST,
    STIFFEST,
    unit_of,
    unit_range,
)
from dpgcli.design.loads import DIRECTION
from dpgcli.errors import Problem, SpecError
from dpgcli.files.places import in_order, shown
from dpgcli.files.scene_file import loads, objects
from dpgcli.files.scene_file.models import (
    DataSpec,
    FingerSpec,
    GripperSpec,
    Spec,
    UnitOverride,
)
from dpgcli.files.scene_file.pressure import EXPECTED, PressureSpec, UnitPressure, expected_at
from dpgcli.files.scene_file.scenes import body_issues, early_issues
from dpgcli.files.scene_file.tolerances import Tolerances, beyond
from dpgcli.files.sections import (
    Geometry,
    Lattice,
    Section,
    UnitGeometry,
    UnitLattice,
    expected_of,
    wrong_width,
)
from dpgcli.files.yaml_file import Document
from dpgcli.text import KeyPath, dotted

SECTIONS: dict[KeyPath, type[Section]] = {
    (): Spec,
    ("finger",): FingerSpec,
    ("finger", "geometry"): Geometry,
    ("finger", "lattice"): Lattice,
    ("finger", "overrides", "*"): UnitOverride,
    ("finger", "overrides", "*", "geometry"): UnitGeometry,
    ("finger", "overrides", "*", "lattice"): UnitLattice,
    ("gripper",): GripperSpec,
    ("pressure",): PressureSpec,
    ("pressure", "overrides", "*"): UnitPressure,
    ("loads",): loads.LoadsSpec,
    ("object",): objects.ObjectSpec,
    ("object", "disc"): objects.DiscSpec,
    ("object", "jaws"): objects.JawsSpec,
    ("object", "compliance"): objects.ComplianceSpec,
    ("object", *objects.TABLE): objects.ForceTableSpec,
    ("data",): DataSpec,
    ("uncertainty",): Tolerances,
}

SHARED = {*Geometry.model_fields, *Lattice.model_fields} - {
    *UnitGeometry.model_fields,
    *UnitLattice.model_fields,
}

OWN = {
    "units": f"a whole number from 1 to {MAX_UNITS}",
    "calibration": '"published", "finite_elements", the name of a calibration file, or a list '
    "of these",
    "law": '"published", "tabulated" or "push_only"',
    "mounting_angle_deg": "an angle from -90 to 90 in degrees",
    **dict.fromkeys(DataSpec.model_fields, "two numbers in mm, such as [5.375, -0.75]"),
    "model_error": "a percentage such as 5%, or leave_one_out",
    **EXPECTED,
    **loads.EXPECTED,
    **objects.EXPECTED,
}

HINTS = {
    "units": "a whole number without quotes or decimal point",
    "stroke_mm": "stroke is dome height minus unit separation",
    "linear_stiffness_N_per_mm": "1.0e+4 is assumed where it is left out; .inf is rigid",
    "wall_compliance_mm_per_N": "0 is a rigid wall; those of the study's finger have about 0.8",
    "hinge_coupling_N_mm_per_rad": "0 is none; that of the study's finger is about 1.2",
    "chamber_width_mm": "chamber width is unit cell minus 2 mm",
    "segment_length_mm": "chamber length + 2 dome thickness + unit separation",
    "model_error": "above 0% and at most 100%",
    "segment_height_mm": "half the chamber width + half the limiting layer",
}

CALIBRATION: KeyPath = ("finger", "calibration")
UNCERTAINTY: KeyPath = ("uncertainty",)
OBJECT: KeyPath = ("object",)
TEXTS = ("calibration", "law", "model_error", "held", DIRECTION)
PAIRS = (*DataSpec.model_fields, loads.TIP_FORCE, *objects.LISTS)
MAPPINGS = ("overrides", *EXPECTED)
MOST_SHOWN = 6  # parts of a list
WHOLE = (("data",), ("loads",))  # sections whose values may be lists
BOUNDED = (
    *("units", "force_linearity", "mounting_angle_deg"),
    *(*loads.LoadsSpec.model_fields, *PLACES),
)
OUT_OF_RANGE = f"from {SMALLEST:g} to {LARGEST:g}; {STIFFEST:g} for the linear stiffness"


def checked(document: Document) -> Spec:
    """The spec in a document. Raises SpecError with every problem of the document.

    Rules between keys are applied once each key by itself is right.
    """
    spec, problems = _validated(document)
    problems = [*document.problems, *problems]
    if spec is None or problems:
        found = early_issues(document.data)
    else:
        found = [*spec.resolution.problems.of(0), *body_issues(spec.object)]
    problems += [document.problem(*issue) for issue in found]
    if spec is None or problems:
        own_first = sorted(problems, key=lambda problem: problem.file != document.file)
        raise SpecError(in_order(own_first))
    return spec


def checked_object(document: Document) -> objects.ObjectSpec:
    """The body in a document of its own, with the keys of a spec's object. Raises SpecError."""
    inner = replace(
        document,
        data={"object": document.data},
        places={(*OBJECT, *path): place for path, place in document.places.items()},
    )
    problems = list(document.problems)
    try:
        found = objects.ObjectSpec.model_validate(document.data)
        problems += [inner.problem(*issue) for issue in body_issues(found)]
    except ValidationError as error:
        told = error.errors(include_url=False)
        problems += [_problem(inner, {**e, "loc": (*OBJECT, *e["loc"])}) for e in told]
    if problems:
        raise SpecError(in_order([_in_own_file(p, document) for p in problems]))
    return found


def _in_own_file(problem: Problem, document: Document) -> Problem:
    """A problem of a body with its key as the document has it; in settings it stands in full."""
    is_own = problem.file == document.file
    return replace(problem, key=problem.key.removeprefix("object.")) if is_own else problem


def checked_keys(document: Document) -> Spec:
    """The spec in a document, each of whose keys is right by itself; raises SpecError.

    Of the rules between keys, those of the geometry alone hold.
    """
    spec, problems = _validated(document)
    if spec is not None and spec.finger.geometry is not None:
        wrong = wrong_width(spec.finger.geometry.given())
        problems = [] if wrong is None else [document.problem(*wrong)]
    if spec is None or problems or document.problems:
        raise SpecError(in_order([*document.problems, *problems]))
    return spec


def _validated(document: Document) -> tuple[Spec | None, list[Problem]]:
    """The spec if each key is right; what the reader reported already is not reported again."""
    try:
        return Spec.model_validate(document.data), []
    except ValidationError as error:
        known = {(p.line, p.column, p.key) for p in document.problems}
        found = [_problem(document, e) for e in error.errors(include_url=False)]
        return None, [p for p in found if (p.line, p.column, p.key) not in known]


def _problem(document: Document, error: Any) -> Problem:
    """One finding of the models as a problem with a place."""
    path: KeyPath = error["loc"]
    if path[:2] == CALIBRATION:  # once, not once for each kind of value it may be
        path = CALIBRATION
        error = {**error, "type": "", "input": _at(document.data, path)}
    is_whole = path[:1] in WHOLE or path[:2] == (*OBJECT, objects.PLACE)
    is_said = error["type"] not in ("extra_forbidden", "missing")
    if is_whole and is_said and len(path) > 1:
        path = path[:2]  # of the value, not of one of its numbers
        error = {**error, "type": "", "input": _at(document.data, path)}
    if error["type"] == "extra_forbidden":
        return document.problem(path, *_unknown(path))
    key = str(path[-1]) if path else "document"
    show = _shown if path[:1] in (*WHOLE, OBJECT) else shown
    found = "nothing" if error["type"] == "missing" else show(error["input"])
    is_worded = path[:-1] == UNCERTAINTY or bool(_expected_at(path))
    hint = ("" if is_worded else _hint(key, error)) or beyond(error["input"])
    return document.problem(path, _expected(path), found, hint)


def _shown(value: Any) -> str:
    """A value as messages show it; the parts of a short list, too."""
    if isinstance(value, list) and len(value) <= MOST_SHOWN and list not in map(type, value):
        return f"[{', '.join(map(shown, value))}]"
    return shown(value)


def _at(data: Any, path: KeyPath) -> Any:
    for part in path:
        data = data[part]
    return data


def _expected(path: KeyPath) -> str:
    key = str(path[-1]) if path else "document"
    if path[:-1] == UNCERTAINTY:
        return f"a standard uncertainty >= 0 in {unit_of(key) or 'its unit'}, or one such as 10%"
    if worded := _expected_at(path):
        return worded
    if _pattern(path) in SECTIONS or key == "overrides":
        return "a section of keys"
    return OWN.get(key, expected_of(key))


def _expected_at(path: KeyPath) -> str:
    """What is expected at a place that says more than its key; empty elsewhere."""
    return expected_at(path) or objects.expected_at(path[1:] if path[:1] == OBJECT else ())


def _hint(key: str, error: Any) -> str:
    """Hints, by the kind of mistake before the kind of key."""
    value = error["input"]
    if error["type"] == "model_type":
        return "keys below it, indented"
    if isinstance(value, str) and key not in (*MAPPINGS, *TEXTS, *PAIRS):
        return "a plain number such as 6.5 or 1.0e+4: no quotes, no unit"
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if is_number and value > 0 and key not in (*BOUNDED, *MAPPINGS, *TEXTS, *PAIRS):
        return OUT_OF_RANGE
    return HINTS.get(key, "")


def unknown_key(path: KeyPath) -> tuple[str, str, str] | None:
    """Expected, found and hint if no spec can have a number at this path."""
    is_of_units = path[1:2] == ("overrides",) and len(path) > 2
    if is_of_units and min(unit_range(str(path[2])), default=0) < 1:
        return "units such as 4 or 4-5", dotted(path), "count from the base"
    if path[:1] == UNCERTAINTY:
        return "a key that designs can differ in", dotted(path), "the tables have no uncertainties"
    parent, pattern = _pattern(path[:-1]), _pattern(path)
    if pattern in SECTIONS or str(path[-1]) in (*MAPPINGS, *TEXTS, *PAIRS):
        return "the key of a number", dotted(path), "name the number itself"
    if parent not in SECTIONS:
        known = [dotted((*p, name)) for p, m in SECTIONS.items() for name in m.model_fields]
        units = str(path[2]) if len(path) > 2 else "*"
        close = get_close_matches(dotted(path), [k.replace("*", units) for k in known], n=1)
        return "a known key", dotted(path), f"did you mean {close[0]}?" if close else ""
    if str(path[-1]) not in SECTIONS[parent].model_fields:
        return _unknown(path)
    return None


def _unknown(path: KeyPath) -> tuple[str, str, str]:
    """Expected, found and hint for a key that is not known where it stands."""
    key, parent = str(path[-1]), _pattern(path[:-1])
    known = list(SECTIONS[parent].model_fields)
    if "overrides" in parent and key in SHARED:
        why = "segment height is shared by neighboring units: set it for the whole finger"
        return "keys that may differ between units", dotted((key,)), why
    return "a known key", dotted((key,)), _nearest(key, known)


def _nearest(key: str, known: list[str]) -> str:
    """The key that was probably meant: here, else elsewhere, else all that are known here."""
    elsewhere = {
        name: dotted((*section, name))
        for section, model in reversed(SECTIONS.items())
        if "*" not in section
        for name in model.model_fields
    }
    if key in elsewhere:
        at_the_top = f"{key} stands at the top of a spec, in no section"
        return at_the_top if elsewhere[key] == key else f"did you mean {elsewhere[key]}?"
    if close := get_close_matches(key, known, n=1):
        return f"did you mean {close[0]}?"
    if close := get_close_matches(key, list(elsewhere), n=1):
        return f"did you mean {elsewhere[close[0]]}?"
    return "known here: " + ", ".join(known)


def _pattern(path: KeyPath) -> KeyPath:
    """A key path with `*` for the units of an override."""
    if path[1:2] == ("overrides",) and len(path) > 2:
        return (*path[:2], "*", *path[3:])
    return path
