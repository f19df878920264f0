"""Which rule gives a lattice value to a group of units, and what speaks against it.

A value of the lattice section is taken as it is, but where the geometry fixes it too both must
agree. The spring constants that are left out come from the published calibration, scaled to the
geometry, or from the first calibration file that has them, if the spec asks for it: a calibrated
value never moves silently to a dome or hinge other than its own.
"""

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.design.calibrations import PUBLISHED, Calibration
from dpgcli.design.dimensions import UnitGroup, agree
from dpgcli.design.fitted import from_file
from dpgcli.design.problems import Issue, Problems, number, of_design
from dpgcli.design.rules import (
    FORCE_LINEARITY,
    Derivation,
    Value,
    all_by,
    check_possible,
    listed,
    missing_from,
)
from dpgcli.design.scene import ORIGINS, Origin


def value_of(
    derivation: Derivation, group: UnitGroup, base: UnitGroup, problems: Problems
) -> Value | None:
    """The lattice value of a group of units; None where, for all designs, there is none.

    Where some designs have none their numbers make no sense; `problems` have them.
    """
    if derivation.key in group.lattice:
        return _given_value(derivation, group, base, problems)
    for place, calibration in enumerate(group.calibrations):
        if calibration == PUBLISHED and derivation.origin is not None:
            return _derived_value(derivation, group, problems)
        if not isinstance(calibration, Calibration):
            continue
        if any(calibration is other for other in derivation.not_from):
            continue
        if calibration.has(derivation.key):
            return from_file(derivation, group, calibration, place, problems)
    if derivation.origin is not None:
        problems.everywhere(_uncalibrated(derivation, group))
        return None
    return _derived_value(derivation, group, problems)


def _derived_value(derivation: Derivation, group: UnitGroup, problems: Problems) -> Value | None:
    """A value by the rule, if the geometry is there."""
    missing = [need for need in derivation.needs if need not in group.geometry]
    if missing:
        problems.everywhere(missing_from(derivation, group, missing))
        return None
    value = _derived(derivation, group)
    check_possible(derivation, group, value, problems)
    if derivation.origin is None:
        return value
    origin = derivation.origin(*(group.geometry[need] for need in derivation.needs))
    rules = tuple(_calibration_rule(derivation, origin) for origin in ORIGINS)
    return Value(value.numbers, origin, rules, origin)


def _derived(derivation: Derivation, group: UnitGroup) -> Value:
    return all_by(derivation.of(group), Origin.DERIVED, derivation.rule)


def _given_value(
    derivation: Derivation, group: UnitGroup, base: UnitGroup, problems: Problems
) -> Value:
    """A value from the lattice section; noted is what in the geometry speaks against it."""
    given = group.lattice[derivation.key]
    is_checked = derivation.origin is None and set(derivation.needs) <= set(group.geometry)
    if not is_checked:
        _check_unmoved(derivation, group, base, given, problems)
        return all_by(given, Origin.GIVEN, "as given")
    derived = _derived(derivation, group)
    is_possible = check_possible(derivation, group, derived, problems)
    problems.add(
        is_possible & ~agree(given, derived.numbers),
        lambda design: _disagreement(
            derivation, group, of_design(given, design), of_design(derived.numbers, design)
        ),
    )
    return all_by(given, Origin.GIVEN, "as given")


def _check_unmoved(
    derivation: Derivation, group: UnitGroup, base: UnitGroup, given: Array, problems: Problems
) -> None:
    """Note where an override changes dimensions under a value given for the whole finger."""
    if derivation is FORCE_LINEARITY or derivation.key in group.own_lattice:
        return
    differs = {need: _differs(group, base, need) for need in derivation.needs}

    def issue(design: int) -> Issue:
        changed = [need for need, where in differs.items() if of_design(where, design)]
        return _moved(derivation, group, of_design(given, design), changed)

    problems.add(np.any(np.broadcast_arrays(*differs.values()), axis=0), issue)


def _differs(group: UnitGroup, base: UnitGroup, need: str) -> Flags:
    """Where a dimension of a group is another than that of the finger."""
    own, general = group.geometry.get(need), base.geometry.get(need)
    if own is None or general is None:
        return np.array([own is not general])
    return np.asarray(own != general)


def _calibration_rule(derivation: Derivation, origin: Origin) -> str:
    if origin is Origin.CALIBRATED:
        return "published value at the reference geometry"
    beyond = ", beyond its range" if origin is Origin.EXTRAPOLATED else ""
    return f"published value, {derivation.rule}{beyond}"


def _uncalibrated(derivation: Derivation, group: UnitGroup) -> Issue:
    return Issue(
        group.path("lattice", derivation.key),
        "a value, or a calibration to take it from",
        "neither",
        "give it, calibrate by a file that has it, or set calibration: published with "
        f"{listed(derivation.needs)}",
    )


def _disagreement(derivation: Derivation, group: UnitGroup, given: float, derived: float) -> Issue:
    changed = [need for need in derivation.needs if need in group.own_geometry]
    path = group.path("lattice", derivation.key)
    if changed and derivation.key not in group.own_lattice:
        path = group.path("geometry", changed[0])
    found = f"{derivation.key} = {number(given)}"
    return Issue(path, f"{number(derived)} as the geometry has it", found, derivation.rule)


def _moved(derivation: Derivation, group: UnitGroup, given: float, changed: list[str]) -> Issue:
    """A spring constant measured at one geometry that would be used at another."""
    return Issue(
        ("finger", "overrides", str(group.override), "lattice", derivation.key),
        f"a value of its own for units with another {listed(changed)}",
        f"only {number(given)} of the whole finger",
        "give it here, or leave it to a calibration everywhere",
    )
