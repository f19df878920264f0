"""Which rule gives a lattice value to a group of units, and what speaks against it.

A value of the lattice section is taken as it is, but where the geometry fixes it too both must
agree. The spring constants that are left out come from the published calibration, scaled to the
geometry, and only if the spec asks for it: a calibrated value never moves silently to a dome or
hinge other than its own.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dpgcli.files.calibration.models import Calibration
from dpgcli.files.places import KeyPath
from dpgcli.files.sections import LARGEST, SMALLEST, Geometry
from dpgcli.mechanics import geometry
from dpgcli.mechanics.scene import Origin

AGREEMENT = 1e-6
PUBLISHED = "published"
LINEAR_STIFFNESS = "linear_stiffness_N_per_mm"


class Issue(NamedTuple):
    """A mistake between keys: the key to look at, and the words of a problem."""

    path: KeyPath
    expected: str
    found: str
    hint: str = ""


class Value(NamedTuple):
    """A lattice value of some units, how it came about, and its standard error if one is known.

    `file` is the place of the calibration file that it comes from, in the spec's list of them.
    """

    value: float
    origin: Origin
    rule: str
    standard_error: float | None = None
    file: int | None = None


@dataclass(frozen=True)
class Derivation:
    """How geometry yields one lattice value; `origin` only where a calibration is behind it.

    `is_fitted` says whether a calibration file may give the value instead.
    """

    key: str
    needs: tuple[str, ...]
    value: Callable[..., float]
    rule: str
    origin: Callable[..., Origin] | None = None
    is_fitted: bool = True


SEGMENT_LENGTH = Derivation(
    "segment_length_mm",
    ("chamber_length_mm", "dome_thickness_mm", "unit_separation_mm"),
    geometry.segment_length,
    "chamber length + 2 dome thickness + unit separation (inferred rule)",
)
SEGMENT_HEIGHT = Derivation(
    "segment_height_mm",
    ("chamber_width_mm", "limiting_layer_thickness_mm"),
    geometry.segment_height,
    "chamber width / 2 + limiting layer thickness / 2 (inferred rule)",
)
STROKE = Derivation(
    "stroke_mm",
    ("dome_height_mm", "unit_separation_mm"),
    geometry.stroke,
    "dome height - unit separation (published rule)",
)
BISTABLE_STIFFNESS = Derivation(
    "bistable_stiffness_N_per_mm",
    ("dome_height_mm", "dome_thickness_mm", "elastic_modulus_MPa"),
    geometry.bistable_stiffness,
    "E t^2.8 h^-0.25 (finite-element scaling)",
    geometry.dome_origin,
)
FORCE_LINEARITY = Derivation(
    "force_linearity",
    ("dome_height_mm", "dome_thickness_mm"),
    lambda dome_height, dome_thickness: geometry.FORCE_LINEARITY,
    "kept constant (finite-element scaling)",
    geometry.dome_origin,
)
HINGE_STIFFNESS = Derivation(
    "hinge_stiffness_N_mm_per_rad",
    (
        "elastic_modulus_MPa",
        "channel_width_mm",
        "limiting_layer_thickness_mm",
        "unit_separation_mm",
    ),
    geometry.hinge_stiffness,
    "E W_ch t_L^3 / s (inferred scaling)",
    geometry.hinge_origin,
)
DERIVATIONS = (
    SEGMENT_LENGTH,
    SEGMENT_HEIGHT,
    STROKE,
    BISTABLE_STIFFNESS,
    FORCE_LINEARITY,
    HINGE_STIFFNESS,
)


@dataclass(frozen=True)
class Group:
    """Units that share all values: what the spec gives them, and which of it an override gave."""

    units: tuple[int, ...]
    calibrations: tuple[str | Calibration, ...]
    geometry: Mapping[str, float]
    lattice: Mapping[str, float]
    override: str | None = None
    own_geometry: frozenset[str] = frozenset()
    own_lattice: frozenset[str] = frozenset()

    def path(self, section: str, key: str) -> KeyPath:
        """Where the spec sets, or would set, a value of these units."""
        own = self.own_geometry if section == "geometry" else self.own_lattice
        if self.override is not None and key in own:
            return ("finger", "overrides", self.override, section, key)
        return ("finger", section, key)


def value_of(derivation: Derivation, group: Group, base: Group) -> Value | Issue:
    """The lattice value of a group of units, or why there is none."""
    if derivation.key in group.lattice:
        return _given_value(derivation, group, base)
    for place, calibration in enumerate(group.calibrations):
        if calibration == PUBLISHED and derivation.origin is not None:
            return _derived_value(derivation, group)
        if not isinstance(calibration, Calibration) or not derivation.is_fitted:
            continue
        value = _from_file(derivation, group, calibration)
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
        return _missing(derivation, group, missing)
    derived = _derived(derivation, group)
    if not SMALLEST <= derived <= LARGEST and derivation is not FORCE_LINEARITY:
        return _impossible(derivation, group, derived)
    if derivation.origin is None:
        return Value(derived, Origin.DERIVED, derivation.rule)
    origin = derivation.origin(*_dimensions(derivation, group))
    return Value(derived, origin, _calibration_rule(derivation, origin))


def _from_file(
    derivation: Derivation, group: Group, calibration: Calibration
) -> Value | Issue | None:
    """A calibrated value, brought to the geometry; None if the file has none."""
    if found := calibration.fitted(derivation.key):
        base = Value(found.value, Origin.CALIBRATED, found.verb, found.standard_error)
        return _brought(derivation, group, calibration, base, ())
    grid = calibration.grid
    if grid is None or not grid.has(derivation.key):
        return None
    if missing := [key for key in grid.over if key not in group.geometry]:
        why = f"{calibration.file} is over {listed(grid.over)}"
        return _missing(derivation, group, missing, why)
    here = np.array([[group.geometry[key] for key in grid.over]])
    estimate = grid.law.at(derivation.key, here)
    value, error = float(estimate.value[0]), float(estimate.relative_error[0])
    is_scaling = grid.method == "scaling"
    origin = Origin.SCALED if is_scaling else Origin.INTERPOLATED
    if not estimate.is_inside[0]:
        origin = Origin.EXTRAPOLATED
    how = "scaling law over" if is_scaling else "interpolated over"
    base = Value(
        value,
        origin,
        f"{how} {listed(grid.over)}",
        value * error if math.isfinite(error) else None,
    )
    return _brought(derivation, group, calibration, base, tuple(grid.over))


def _brought(
    derivation: Derivation,
    group: Group,
    calibration: Calibration,
    base: Value,
    over: tuple[str, ...],
) -> Value | Issue:
    """A file's value, scaled by the rule where dimensions that it is not over are others."""
    name = f"{base.rule}, {calibration.file}"
    own = sizes_of(calibration.geometry) | {k: group.geometry[k] for k in over}
    here = {need: group.geometry[need] for need in derivation.needs if need in group.geometry}
    if unknown := [need for need in here if need not in own]:
        rule = f"{name}, which does not state its {listed(unknown)}"
        return base._replace(origin=Origin.EXTRAPOLATED, rule=rule)
    changed = [need for need, size in here.items() if not agree(size, own[need])]
    if not changed:
        return base._replace(rule=name)
    if missing := [need for need in derivation.needs if need not in own]:
        rule = f"{name}, which does not state its {listed(missing)} to scale by"
        return base._replace(origin=Origin.EXTRAPOLATED, rule=rule)
    there = [own[need] for need in derivation.needs]
    factor = derivation.value(*(here.get(need, own[need]) for need in derivation.needs))
    factor /= derivation.value(*there)
    if not SMALLEST <= factor <= LARGEST:
        return _impossible(derivation, group, base.value * factor)
    origin = _graver(base.origin, Origin.SCALED)
    if derivation.origin is geometry.dome_origin:
        origin = _graver(origin, geometry.dome_origin(*_dome(own | here)))
    error = None if base.standard_error is None else base.standard_error * factor
    return Value(base.value * factor, origin, f"{name}, {derivation.rule}", error)


def _graver(first: Origin, second: Origin) -> Origin:
    """The one to trust less."""
    return max(first, second, key=list(Origin).index)


def _dome(sizes: Mapping[str, float]) -> tuple[float, float]:
    return sizes["dome_height_mm"], sizes["dome_thickness_mm"]


def sizes_of(section: Geometry | None) -> dict[str, float]:
    """The dimensions that a geometry gives, the chamber's width from the unit cell if need be."""
    given = {} if section is None else {k: v for k, v in vars(section).items() if v is not None}
    if "chamber_width_mm" not in given and "unit_cell_mm" in given:
        given["chamber_width_mm"] = geometry.chamber_width(given["unit_cell_mm"])
    return given


def _given_value(derivation: Derivation, group: Group, base: Group) -> Value | Issue:
    """A value from the lattice section, if nothing in the geometry speaks against it."""
    given = group.lattice[derivation.key]
    is_checked = derivation.origin is None and set(derivation.needs) <= set(group.geometry)
    if not is_checked:
        changed = _changed(derivation, group, base)
        return _moved(derivation, group, given, changed) if changed else _as_given(given)
    derived = _derived(derivation, group)
    if derivation is STROKE and derived <= 0:
        return _impossible(derivation, group, derived)
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


def _missing(
    derivation: Derivation, group: Group, missing: list[str], why: str | None = None
) -> Issue:
    return Issue(
        group.path("lattice", derivation.key),
        f"a value, or geometry with {listed(missing if why else derivation.needs)}",
        f"no {listed(missing)}",
        why or derivation.rule,
    )


def _impossible(derivation: Derivation, group: Group, derived: float) -> Issue:
    """A derived value that no finger can have."""
    needs = [need for need in derivation.needs if need in group.own_geometry]
    path = group.path("geometry", (needs or derivation.needs)[0])
    found = f"{derivation.key} = {number(derived)}"
    if derivation is STROKE and derived <= 0:
        hint = "the dome never reaches its neighbor"
        return Issue(path, "a dome height > the unit separation", found, hint)
    return Issue(path, f"a derived value from {SMALLEST:g} to {LARGEST:g}", found, derivation.rule)


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


def agree(given: float, derived: float) -> bool:
    """Whether a given value is the derived one, but for rounding by people."""
    return math.isclose(given, derived, rel_tol=AGREEMENT)


def number(value: float) -> str:
    """A number as messages show it."""
    return f"{value:.10g}"


def listed(keys: tuple[str, ...] | list[str]) -> str:
    """Keys of the geometry section as messages list them."""
    named = ["chamber_width_mm or unit_cell_mm" if k == "chamber_width_mm" else k for k in keys]
    return ", ".join(named)
