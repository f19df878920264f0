"""How domes answer to pressure, unit by unit: by an effective area, or by their snap pressure."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from dpgcli.design import geometry
from dpgcli.design.calibrations import PUBLISHED, Calibration
from dpgcli.design.dimensions import GivenPressure, Sizes, UnitGroup, unit_range
from dpgcli.design.domes import Domes
from dpgcli.design.fitted import beside_curve
from dpgcli.design.lines import PRESSURE
from dpgcli.design.problems import Issue, Problems
from dpgcli.design.rules import Derivation, Value, all_by, check_possible
from dpgcli.design.scene import ORIGINS, Origin
from dpgcli.design.volumes import area_rule
from dpgcli.text import KeyPath

AREA, SNAP = "effective_area_mm2", "snap_pressure_MPa"
SNAP_PRESSURE = Derivation(
    SNAP,
    ("dome_height_mm", "dome_thickness_mm", "elastic_modulus_MPa"),
    geometry.snap_pressure,
    "E t^2.5 h^1.2 (finite-element scaling)",
    geometry.dome_origin,
)
ASSUMED = "that of finite elements (none is given, nor an area)"
GroupValues = list[tuple[UnitGroup, Value]]
Part = tuple[UnitGroup, Sizes]


def answers_to_pressure(
    given: GivenPressure, domes: Domes, groups: Sequence[UnitGroup], problems: Problems
) -> Mapping[str, GroupValues]:
    """Effective areas (mm²) of all units, or their snap pressures (MPa), by key.

    Empty where `problems` now say why there is neither.
    """
    parts = [part for group in groups for part in _parts(given, group)]
    areas = [*_paths(given, AREA)]
    if areas and (others := [*_paths(given, SNAP)]):
        hint = "the one follows from the other by the dome's snap force"
        for path in others:
            problems.everywhere(Issue(path, f"{AREA} or {SNAP}, not both", "both", hint))
        return {}
    if not areas:
        return {SNAP: [(group, _snap(group, own, domes, problems)) for group, own in parts]}
    if bare := [unit for group, own in parts if AREA not in own for unit in group.units]:
        expected, found = "an area of every unit", f"none of unit {min(bare)}"
        problems.everywhere(Issue((*PRESSURE, AREA), expected, found))
        return {}
    return {AREA: [(group, all_by(own[AREA], Origin.GIVEN, "as given")) for group, own in parts]}


def _parts(given: GivenPressure, group: UnitGroup) -> Iterator[Part]:
    """The units of a group that share what is given of pressure, and that."""
    left = set(group.units)
    for text, own in given.overrides.items():
        units = tuple(unit for unit in unit_range(text) if unit in left)
        left -= {*units}
        if units:
            yield replace(group, units=units), {**given.values, **own}
    if left:
        yield replace(group, units=tuple(sorted(left))), given.values


def _paths(given: GivenPressure, key: str) -> Iterator[KeyPath]:
    """Where a key is given."""
    if key in given.values:
        yield (*PRESSURE, key)
    for units, own in given.overrides.items():
        if key in own:
            yield (*PRESSURE, "overrides", units, key)


def _snap(group: UnitGroup, own: Sizes, domes: Domes, problems: Problems) -> Value:
    """The snap pressure: given, of the dome that was sampled, or assumed."""
    if SNAP in own:
        value = all_by(own[SNAP], Origin.GIVEN, "as given")
    else:
        value = _sampled(group, domes) or _assumed(group)
        check_possible(SNAP_PRESSURE, group, value, problems)
    if shape := area_rule(domes):
        return replace(value, rules=tuple(f"{rule}; {shape}" for rule in value.rules))
    return value


def _sampled(group: UnitGroup, domes: Domes) -> Value | None:
    """That of the law's curve; where the law has none, of the first calibration that knows it."""
    for place, file in enumerate(group.calibrations):
        if domes.calibration is None and file == PUBLISHED:
            return None
        if not isinstance(file, Calibration) or file.curve is None:
            continue
        if file.curve.snap_pressure is not None and domes.calibration in (None, file):
            found = beside_curve(SNAP_PRESSURE, group, file, file.curve.snap_pressure)
            return replace(found, file=place)
    return None


def _assumed(group: UnitGroup) -> Value:
    if not set(SNAP_PRESSURE.needs) <= set(group.geometry):
        number = np.array([geometry.REFERENCE.snap_pressure])
        return all_by(number, Origin.ASSUMED, f"{ASSUMED}, of the study's dome")
    numbers = SNAP_PRESSURE.of(group)
    origin = geometry.dome_origin(*(group.geometry[need] for need in SNAP_PRESSURE.needs))
    beyond = origin == ORIGINS.index(Origin.EXTRAPOLATED)
    rule = f"{ASSUMED}, E t^2.5 h^1.2"
    rules = (rule, f"{rule}, beyond its range")
    assumed = np.array([ORIGINS.index(Origin.ASSUMED)])
    return Value(numbers, assumed, rules, np.asarray(beyond, np.int64))
