"""From a spec to a scene: lattice values unit by unit, with the sources they come from."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from dpgcli.arrays import Array
from dpgcli.errors import SpecError
from dpgcli.files.calibration.models import Calibration
from dpgcli.files.places import KeyPath, Place, dotted, located
from dpgcli.files.scene_file.derivations import value_of
from dpgcli.files.scene_file.domes import Domes, domes_of
from dpgcli.files.scene_file.models import MAX_UNITS, UNIT_RANGE, FingerSpec, Spec
from dpgcli.files.scene_file.rules import (
    DERIVATIONS,
    FORCE_LINEARITY,
    LINEAR_STIFFNESS,
    PUBLISHED,
    SEGMENT_HEIGHT,
    STROKE,
    Group,
    Issue,
    Value,
    number,
    sizes_of,
)
from dpgcli.files.scene_file.uncertainty import Share, uncertainty_of
from dpgcli.files.sections import wrong_width
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.laws import PUBLISHED as PUBLISHED_LAW
from dpgcli.mechanics.scene import Gripper, Origin, Scene, Source

SHARED = (SEGMENT_HEIGHT.key, LINEAR_STIFFNESS)  # by all units
NO_BARS = Issue(
    ("finger", LINEAR_STIFFNESS),
    "a stiffness > 0 in N/mm, or .inf",
    "nothing",
    "the study calls the bars nearly rigid: 1.0e4; .inf is rigid",
)


@dataclass
class Resolution:
    """Lattice values by key and units, how domes answer, and the issues met on the way."""

    domes: Domes = field(default_factory=lambda: Domes(PUBLISHED_LAW, DERIVATIONS))
    values: dict[str, list[tuple[Group, Value]]] = field(default_factory=dict)
    issues: list[Issue] = field(default_factory=list)


def issues(spec: Spec) -> list[Issue]:
    """Everything in a spec that is wrong between its keys."""
    return [*range_issues(spec.model_dump()), *_resolved(spec.finger).issues]


def scene_of(spec: Spec) -> Scene:
    """The scene that a spec describes. Raises SpecError, without lines, if keys disagree."""
    resolution = _resolved(spec.finger)
    ranges = range_issues(spec.model_dump()) if spec.finger.overrides else []
    if found := [*ranges, *resolution.issues]:
        place = Place("spec")
        raise SpecError(tuple(located(place, dotted(issue.path), *issue[1:]) for issue in found))
    values = resolution.values
    return Scene(
        finger=_finger(spec.finger, resolution),
        sources=tuple(_sources(spec.finger, values)),
        gripper=_gripper(spec),
        layer_thickness=_given(spec.finger.geometry).get("limiting_layer_thickness_mm"),
        uncertainty=uncertainty_of(_calibrations(spec.finger), _shares(spec.finger, resolution)),
    )


def _gripper(spec: Spec) -> Gripper | None:
    if spec.gripper is None:
        return None
    angle = math.radians(spec.gripper.mounting_angle_deg)
    return Gripper(spec.gripper.base_spacing_mm, angle)


def early_issues(data: Any) -> list[Issue]:
    """What can be said of data whose keys are not all right by themselves."""
    finger = data.get("finger") if isinstance(data, dict) else None
    is_bare = (
        isinstance(finger, dict)
        and finger.get(LINEAR_STIFFNESS) is None
        and finger.get("calibration") in (None, PUBLISHED)
    )
    return [*range_issues(data), *([NO_BARS] if is_bare else [])]


def range_issues(data: Any) -> list[Issue]:
    """Malformed, foreign or overlapping unit ranges of overrides, in data not checked yet."""
    finger = data.get("finger") if isinstance(data, dict) else None
    overrides = finger.get("overrides") if isinstance(finger, dict) else None
    if not isinstance(finger, dict) or not isinstance(overrides, dict):
        return []
    n_units = _unit_count(finger.get("units"))
    found: list[Issue] = []
    taken: dict[int, str] = {}
    for text in map(str, overrides):
        path = ("finger", "overrides", text)
        units = unit_range(text)
        if not units or units[0] < 1 or units[-1] > n_units:
            hint = 'write "4" or "4-5"'
            found.append(Issue(path, f"units within 1-{n_units}", dotted((text,)), hint))
        elif overlap := [taken[unit] for unit in units if unit in taken]:
            expected = "each unit in one override"
            found.append(Issue(path, expected, f"units also in {dotted((overlap[0],))}"))
        else:
            taken.update(dict.fromkeys(units, text))
    return found


def _unit_count(value: object) -> int:
    """The number of units, the largest allowed one as long as it is not known."""
    if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= MAX_UNITS:
        return value
    return MAX_UNITS


def unit_range(text: str) -> tuple[int, ...]:
    """The units that the key of an override names, empty if it names none.

    >>> unit_range("4"), unit_range("4-6"), unit_range("6-4")
    ((4,), (4, 5, 6), ())
    """
    match = UNIT_RANGE.fullmatch(text)
    if match is None:
        return ()
    first = int(match[1])
    return tuple(range(first, int(match[2] or first) + 1))


def _resolved(finger: FingerSpec) -> Resolution:
    resolution = Resolution()
    base = _base(finger)
    resolution.issues += chamber_issues(finger)
    domes = domes_of(finger.law, base.calibrations)
    if isinstance(domes, Issue):
        resolution.issues.append(domes)
        return resolution
    resolution.domes = domes
    resolution.issues += _linearity_issues(finger, domes)
    groups = [group for group in (base, *_overridden(finger, base)) if group.units]
    for derivation in domes.derivations:
        chosen = [base] if derivation is SEGMENT_HEIGHT else groups
        for group in chosen:
            value = value_of(derivation, group, base)
            if isinstance(value, Issue):
                resolution.issues.append(value)
            else:
                resolution.values.setdefault(derivation.key, []).append((group, value))
    bars = _bars(finger, base)
    if isinstance(bars, Issue):
        resolution.issues.append(bars)
    else:
        resolution.values[LINEAR_STIFFNESS] = [(base, bars)]
    return resolution


def _linearity_issues(finger: FingerSpec, domes: Domes) -> Iterator[Issue]:
    """Force linearities beside a law that has none."""
    if FORCE_LINEARITY in domes.derivations:
        return
    given: dict[KeyPath, object] = {("finger", "lattice"): finger.lattice}
    for units, override in (finger.overrides or {}).items():
        given["finger", "overrides", units, "lattice"] = override and override.lattice
    for path, section in given.items():
        linearity = getattr(section, FORCE_LINEARITY.key, None)
        if linearity is not None:
            hint = "the shape of the curve is that of its calibration"
            where = (*path, FORCE_LINEARITY.key)
            yield Issue(where, f"none beside law: {finger.law}", number(linearity), hint)


def _bars(finger: FingerSpec, base: Group) -> Value | Issue:
    """The stiffness of the bars: given, or fitted."""
    if finger.linear_stiffness_N_per_mm is not None:
        return Value(finger.linear_stiffness_N_per_mm, Origin.GIVEN, "as given")
    for place, calibration in enumerate(base.calibrations):
        if isinstance(calibration, Calibration) and (found := calibration.fitted(LINEAR_STIFFNESS)):
            rule = f"from {calibration.file}"
            return Value(found.value, Origin.CALIBRATED, rule, found.standard_error, place)
    return NO_BARS


def _shares(spec: FingerSpec, resolution: Resolution) -> Iterator[Share]:
    """Standard errors of what comes from calibration files, unit by unit."""
    calibrations = _calibrations(spec)
    for key, pairs in resolution.values.items():
        for place in {v.file for _, v in pairs if v.file is not None and v.standard_error}:
            if not resolution.domes.carries(key, calibrations[place]):
                continue
            errors = [
                (group, value._replace(value=value.standard_error or 0.0))
                if value.file == place
                else (group, value._replace(value=0.0))
                for group, value in pairs
            ]
            yield Share(place, key, _column(spec.units, errors))


def _base(finger: FingerSpec) -> Group:
    """The units without an override."""
    taken = {unit for text in finger.overrides or {} for unit in unit_range(text)}
    units = tuple(unit for unit in range(1, finger.units + 1) if unit not in taken)
    sizes, lattice = sizes_of(finger.geometry), _given(finger.lattice)
    return Group(units, _calibrations(finger), sizes, lattice)


def _calibrations(finger: FingerSpec) -> tuple[str | Calibration, ...]:
    """What a spec calibrates by, in its order."""
    said = finger.calibration
    if said is None:
        return ()
    return tuple(said) if isinstance(said, list) else (said,)


def _overridden(finger: FingerSpec, base: Group) -> Iterator[Group]:
    for text, override in (finger.overrides or {}).items():
        own = _given(override and override.geometry)
        lattice = _given(override and override.lattice)
        yield Group(
            unit_range(text),
            base.calibrations,
            {**base.geometry, **own},
            {**base.lattice, **lattice},
            text,
            frozenset(own),
            frozenset(lattice),
        )


def _given(section: Any) -> dict[str, float]:
    """The values that a section of the spec gives."""
    return {} if section is None else {k: v for k, v in vars(section).items() if v is not None}


def chamber_issues(finger: FingerSpec) -> Iterator[Issue]:
    """Contradictions between the widths of the unit cell and of the chamber."""
    if wrong := wrong_width(_given(finger.geometry)):
        yield Issue(("finger", "geometry", wrong[0]), *wrong[1:])


def _finger(spec: FingerSpec, resolution: Resolution) -> Finger:
    none = np.zeros((1, 1))
    columns = {key: _column(spec.units, pairs) for key, pairs in resolution.values.items()}
    domes = resolution.domes
    return Finger(
        spec.units,
        segment_length=columns["segment_length_mm"],
        segment_height=columns["segment_height_mm"],
        stroke=columns["stroke_mm"],
        bistable_stiffness=columns["bistable_stiffness_N_per_mm"],
        force_linearity=columns.get("force_linearity", none),  # curves need none
        hinge_stiffness=columns["hinge_stiffness_N_mm_per_rad"],
        linear_stiffness=columns[LINEAR_STIFFNESS],
        dome_travel=_travels(spec.units, resolution) if domes.travel else none,
        law=domes.law,
    )


def _travels(n_units: int, resolution: Resolution) -> Array:
    """Travels of inverted domes at rest, by the heights of the domes."""
    pairs = [
        (group, value._replace(value=resolution.domes.travel_at(height)))
        for group, value in resolution.values[STROKE.key]
        for height in [group.geometry.get("dome_height_mm")]
    ]
    return _column(n_units, pairs)


def _column(n_units: int, pairs: list[tuple[Group, Value]]) -> Array:
    """Values by unit, shape (units, 1), or (1, 1) where all units share one."""
    if len({value.value for _, value in pairs}) == 1:
        return np.array([[pairs[0][1].value]])
    by_unit = {unit: value.value for group, value in pairs for unit in group.units}
    return np.array([[by_unit[unit]] for unit in range(1, n_units + 1)])


def _sources(spec: FingerSpec, values: dict[str, list[tuple[Group, Value]]]) -> Iterator[Source]:
    """One source for each key and each set of units that got the same value the same way."""
    everyone = tuple(range(1, spec.units + 1))
    for key, pairs in values.items():
        same: dict[Value, tuple[int, ...]] = {}
        for group, value in pairs:
            units = everyone if key in SHARED else group.units
            same[value] = (*same.get(value, ()), *units)
        for value, units in sorted(same.items(), key=lambda item: min(item[1])):
            yield Source(key, _ranges(units), *value[:4])


@cache  # the same few for every design of a sweep
def _ranges(units: tuple[int, ...]) -> str:
    """Units as a spec writes them: `1-3`, `5`, `1-3,5`."""
    runs: list[list[int]] = []
    for unit in sorted(units):
        if runs and unit == runs[-1][-1] + 1:
            runs[-1][1:] = [unit]
        else:
            runs.append([unit])
    return ",".join("-".join(map(str, run)) for run in runs)
