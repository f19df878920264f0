"""Which rule gives a lattice value to a group of units, and what speaks against it.

A value of the lattice section is taken as it is, but where the geometry fixes it too both must
agree. The spring constants that are left out come from the published calibration, scaled to the
geometry, or from the first calibration file that has them, if the spec asks for it: a calibrated
value never moves silently to a dome or hinge other than its own.
"""

from dpgcli.files.calibration.models import Calibration
from dpgcli.files.scene_file.fitted import from_file
from dpgcli.files.scene_file.rules import (
    FORCE_LINEARITY,
    PUBLISHED,
    Derivation,
    Group,
    Issue,
    Value,
    agree,
    listed,
    missing_from,
    number,
    possible,
)
from dpgcli.mechanics.scene import Origin


def value_of(derivation: Derivation, group: Group, base: Group) -> Value | Issue:
    """The lattice value of a group of units, or why there is none."""
    if derivation.key in group.lattice:
        return _given_value(derivation, group, base)
    for place, calibration in enumerate(group.calibrations):
        if calibration == PUBLISHED and derivation.origin is not None:
            return _derived_value(derivation, group)
        if not isinstance(calibration, Calibration) or calibration is derivation.not_from:
            continue
        value = from_file(derivation, group, calibration)
        if isinstance(value, Value):
            value = value._replace(file=place)
        if value is not None:
            return value
    if derivation.origin is not None:
        return _uncalibrated(derivation, group)
    return _derived_value(derivation, group)


def _derived_value(derivation: Derivation, group: Group) -> Value | Issue:
    """A value by the rule, if the geometry is there."""
    missing = [need for need in derivation.needs if need not in group.geometry]
    if missing:
        return missing_from(derivation, group, missing)
    derived = _derived(derivation, group)
    if wrong := possible(derivation, group, derived):
        return wrong
    if derivation.origin is None:
        return Value(derived, Origin.DERIVED, derivation.rule)
    origin = derivation.origin(*_dimensions(derivation, group))
    return Value(derived, origin, _calibration_rule(derivation, origin))


def _given_value(derivation: Derivation, group: Group, base: Group) -> Value | Issue:
    """A value from the lattice section, if nothing in the geometry speaks against it."""
    given = group.lattice[derivation.key]
    is_checked = derivation.origin is None and set(derivation.needs) <= set(group.geometry)
    if not is_checked:
        changed = _changed(derivation, group, base)
        return _moved(derivation, group, given, changed) if changed else _as_given(given)
    derived = _derived(derivation, group)
    if wrong := possible(derivation, group, derived):
        return wrong
    if not agree(given, derived):
        return _disagreement(derivation, group, given, derived)
    return _as_given(given)


def _as_given(value: float) -> Value:
    return Value(value, Origin.GIVEN, "as given")


def _changed(derivation: Derivation, group: Group, base: Group) -> list[str]:
    """Dimensions that an override changes under a value given for the whole finger."""
    if derivation is FORCE_LINEARITY or derivation.key in group.own_lattice:
        return []
    return [n for n in derivation.needs if group.geometry.get(n) != base.geometry.get(n)]


def _dimensions(derivation: Derivation, group: Group) -> list[float]:
    return [group.geometry[need] for need in derivation.needs]


def _derived(derivation: Derivation, group: Group) -> float:
    return derivation.value(*_dimensions(derivation, group))


def _calibration_rule(derivation: Derivation, origin: Origin) -> str:
    if origin is Origin.CALIBRATED:
        return "published value at the reference geometry"
    beyond = ", beyond its range" if origin is Origin.EXTRAPOLATED else ""
    return f"published value, {derivation.rule}{beyond}"


def _uncalibrated(derivation: Derivation, group: Group) -> Issue:
    return Issue(
        group.path("lattice", derivation.key),
        "a value, or a calibration to take it from",
        "neither",
        "give it, calibrate by a file that has it, or set calibration: published with "
        f"{listed(derivation.needs)}",
    )


def _disagreement(derivation: Derivation, group: Group, given: float, derived: float) -> Issue:
    changed = [need for need in derivation.needs if need in group.own_geometry]
    path = group.path("lattice", derivation.key)
    if changed and derivation.key not in group.own_lattice:
        path = group.path("geometry", changed[0])
    found = f"{derivation.key} = {number(given)}"
    return Issue(path, f"{number(derived)} as the geometry has it", found, derivation.rule)


def _moved(derivation: Derivation, group: Group, given: float, changed: list[str]) -> Issue:
    """A spring constant measured at one geometry that would be used at another."""
    return Issue(
        ("finger", "overrides", str(group.override), "lattice", derivation.key),
        f"a value of its own for units with another {listed(tuple(changed))}",
        f"only {number(given)} of the whole finger",
        "give it here, or leave it to a calibration everywhere",
    )
