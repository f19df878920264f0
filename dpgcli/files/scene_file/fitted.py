"""Values that calibration files give, brought to the geometry of some units."""

import math
from collections.abc import Mapping

import numpy as np

from dpgcli.files.calibration.models import Calibration
from dpgcli.files.scene_file.rules import (
    Derivation,
    Group,
    Issue,
    Value,
    agree,
    listed,
    missing_from,
    possible,
    sizes_of,
)
from dpgcli.mechanics import geometry
from dpgcli.mechanics.scene import Origin


def from_file(
    derivation: Derivation, group: Group, calibration: Calibration
) -> Value | Issue | None:
    """A calibrated value, brought to the geometry; None if the file has none."""
    value = _in_file(derivation, group, calibration)
    if not isinstance(value, Value):
        return value
    return possible(derivation, group, value.value, value.rule) or value


def _in_file(
    derivation: Derivation, group: Group, calibration: Calibration
) -> Value | Issue | None:
    if found := calibration.fitted(derivation.key):
        base = Value(found.value, Origin.CALIBRATED, "from", found.standard_error)
        return _brought(derivation, group, calibration, base, ())
    grid = calibration.grid
    if grid is None or not grid.has(derivation.key):
        return None
    if missing := [key for key in grid.over if key not in group.geometry]:
        why = f"{calibration.file} is over {listed(grid.over)}"
        return missing_from(derivation, group, missing, why)
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
        f"{how} {listed(grid.over)},",
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
    name = f"{base.rule} {calibration.file}"
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
    there = derivation.value(*(own[need] for need in derivation.needs))
    if possible(derivation, group, there):
        rule = f"{name}, whose geometry has no such value to scale by"
        return base._replace(origin=Origin.EXTRAPOLATED, rule=rule)
    factor = derivation.value(*(here.get(need, own[need]) for need in derivation.needs)) / there
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
