"""Values that calibration files give, brought to the geometry of some units."""

from dataclasses import replace

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.design import geometry
from dpgcli.design.calibrations import Calibration, Grid
from dpgcli.design.dimensions import UnitGroup, agree, sizes_of
from dpgcli.design.problems import Problems
from dpgcli.design.rules import Derivation, Value, all_by, check_possible, listed, missing_from
from dpgcli.design.scene import ORIGINS, Origin


def from_file(
    derivation: Derivation,
    group: UnitGroup,
    calibration: Calibration,
    file: int,
    problems: Problems,
) -> Value | None:
    """A value that a calibration has, brought to the geometry; None where it cannot be."""
    base = _fitted(derivation, calibration)
    over: tuple[str, ...] = ()
    if base is None:
        grid = calibration.grid
        assert grid is not None, "the calibration has the value"
        over = grid.over
        if missing := [key for key in over if key not in group.geometry]:
            why = f"{calibration.source} is over {listed(over)}"
            problems.everywhere(missing_from(derivation, group, missing, why))
            return None
        base = _from_grid(derivation, group, grid)
    value = _brought(derivation, group, calibration, base, over)
    check_possible(derivation, group, value, problems)
    return replace(value, file=file)


def beside_curve(
    derivation: Derivation, group: UnitGroup, calibration: Calibration, number: float
) -> Value:
    """A number that a calibration has beside its curve, brought to the geometry."""
    base = all_by(np.array([number]), Origin.CALIBRATED, "from")
    return _brought(derivation, group, calibration, base, ())


def _fitted(derivation: Derivation, calibration: Calibration) -> Value | None:
    found = calibration.values.get(derivation.key)
    if found is None:
        return None
    base = all_by(np.array([found.value]), Origin.CALIBRATED, "from")
    if found.standard_error is None:
        return base
    return replace(base, standard_error=np.array([found.standard_error]))


def _from_grid(derivation: Derivation, group: UnitGroup, grid: Grid) -> Value:
    columns = np.broadcast_arrays(*(group.geometry[key] for key in grid.over))
    estimate = grid.law.at(derivation.key, np.stack(columns, axis=1))
    error = np.real(estimate.value) * estimate.relative_error
    known = Origin.SCALED if grid.is_scaling else Origin.INTERPOLATED
    how = "scaling law over" if grid.is_scaling else "interpolated over"
    beyond, known_place = ORIGINS.index(Origin.EXTRAPOLATED), ORIGINS.index(known)
    return Value(
        estimate.value,
        np.where(estimate.is_inside, known_place, beyond),
        (f"{how} {listed(grid.over)},", f"at a point over {listed(grid.over)},"),
        estimate.is_sample.astype(np.int64),
        error if np.isfinite(estimate.relative_error).all() else None,
    )


def _brought(
    derivation: Derivation,
    group: UnitGroup,
    calibration: Calibration,
    base: Value,
    over: tuple[str, ...],
) -> Value:
    """A file's value, scaled by the rule where dimensions that it is not over are others."""
    names = tuple(f"{rule} {calibration.source}" for rule in base.rules)
    name = names[0]
    own = sizes_of({key: np.array([size]) for key, size in calibration.geometry.items()})
    own |= {key: group.geometry[key] for key in over}
    here = {need: group.geometry[need] for need in derivation.needs if need in group.geometry}
    everywhere = np.ones(1, bool)
    if unknown := [need for need in here if need not in own]:
        rule = f"{name}, which does not state its {listed(unknown)}"
        return _beyond(replace(base, rules=names), everywhere, rule)
    moved = np.any(np.broadcast_arrays(*(_differs(s, own[n]) for n, s in here.items())), axis=0)
    value = replace(base, rules=names)
    if not moved.any():
        return value
    if missing := [need for need in derivation.needs if need not in own]:
        return _beyond(
            value, moved, f"{name}, which does not state its {listed(missing)} to scale by"
        )
    return _scaled(derivation, value, moved, own, here)


def _differs(here: Array, own: Array) -> Flags:
    """Where a dimension is not that of the fit, or is a complex step away from it."""
    return np.asarray(~agree(here, own) | (np.imag(here) != 0.0))


def _scaled(
    derivation: Derivation,
    value: Value,
    moved: Flags,
    own: dict[str, Array],
    here: dict[str, Array],
) -> Value:
    """The value where it was `moved` from its own sizes to others, by the ratio of the rule."""
    name = value.rules[0]
    with np.errstate(all="ignore"):
        there = derivation.value(*(own[need] for need in derivation.needs))
        at_sizes = derivation.value(*(here.get(need, own[need]) for need in derivation.needs))
        factor = at_sizes / there
    is_scaled = moved & derivation.allows(there)
    factor = np.where(is_scaled, factor, 1.0)
    origin = np.maximum(value.origin, ORIGINS.index(Origin.SCALED))
    if derivation.origin is geometry.dome_origin:
        sizes = own | here
        dome = geometry.dome_origin(sizes["dome_height_mm"], sizes["dome_thickness_mm"])
        origin = np.maximum(origin, dome)
    error = value.standard_error
    scaled = Value(
        value.numbers * factor,
        np.where(is_scaled, origin, value.origin),
        (*value.rules, f"{name}, {derivation.rule}"),
        np.where(is_scaled, len(value.rules), value.rule),
        None if error is None else error * np.real(factor),
    )
    rule = f"{name}, whose geometry has no such value to scale by"
    return _beyond(scaled, moved & ~is_scaled, rule)


def _beyond(value: Value, where: Flags, rule: str) -> Value:
    """The value, taken as it is `where` it is not known to hold."""
    extrapolated: Indices = np.array(ORIGINS.index(Origin.EXTRAPOLATED))
    return replace(
        value,
        origin=np.where(where, extrapolated, value.origin),
        rules=(*value.rules, rule),
        rule=np.where(where, len(value.rules), value.rule),
    )
