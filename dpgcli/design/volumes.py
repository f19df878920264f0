"""The volume beside a dome by its travel, from the pressures or volumes of its calibration."""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array
from dpgcli.design.calibrations import Calibration, DomeCurve
from dpgcli.design.domes import Domes
from dpgcli.design.rules import BISTABLE_STIFFNESS, STROKE
from dpgcli.mechanics.curve import FEWEST_POINTS, Curve, Spline
from dpgcli.mechanics.pressure import volume_shape

NEXT_TO_NOTHING = 0.1  # of a branch's largest pressure: below it E'/p is noise over noise
PER_STEP = 8  # points between two samples, at which E'/p keeps to the pressures that were measured
SAID = {
    "volume": "area dV/du on the branches of its curve",
    "pressure": "area E'/p on the branches of its curve",
}
BETWEEN = "monotone between them, the pressure below its limit (assumed)"
N_BETWEEN = 200  # points in the stretch behind the way from rest
FALLS = 0.05  # of the limit pressure, over that stretch


class Sampled(NamedTuple):
    """Areas dV/du (mm²) and the dome's forces E' (N) at travels (mm), (point,)."""

    travel: Array
    area: Array
    force: Array


def area_rule(domes: Domes) -> str:
    """Where the area by travel is from, in words; empty where it is the same all the way."""
    curve = None if domes.calibration is None else domes.calibration.curve
    known = [] if curve is None else [name for name in SAID if getattr(curve, name) is not None]
    return f"{SAID[known[0]]}, {BETWEEN}" if known else ""


def swept_shape(domes: Domes) -> Spline | None:
    """The volume v over the travel u/D, v' = 1 at the limit point of the way from rest.

    The area is dV/du where volumes were measured, else E'(u)/p(u), on each sampled branch; it goes
    on beyond a branch as at its end, and monotonically to the next one (assumed); behind the way
    from rest it is as large as it takes for the dome to bear no more there than it did before it
    snapped. None where neither is known on the way from rest.
    """
    file, law = domes.calibration, domes.law.curve
    if file is None or file.curve is None or law is None or not area_rule(domes):
        return None
    full, force_unit = _scales(domes, file, file.curve)
    parts = [*_branches(file.curve, law, full, force_unit)]
    if not parts:
        return None
    travel, area, force = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    rises = (travel < law.rests[0] * full) & (force > 0.0)
    if not rises.any():
        return None
    limit = int(np.argmax(np.where(rises, force / area, -np.inf)))
    n_before = len(parts[0].travel)
    if len(parts) > 1 and limit < n_before:
        ends = slice(n_before - 1, n_before + 1)
        between = np.linspace(travel[n_before - 1], travel[n_before], N_BETWEEN)[1:-1]
        needed = force_unit * law(between / full).slope * area[limit] / force[limit]
        borne = _borne(between, travel[ends], area[ends], needed)
        travel, area = (np.insert(a, n_before, b) for a, b in ((travel, between), (area, borne)))
    if travel[0] > 0.0:
        travel, area = np.append(0.0, travel), np.append(area[0], area)
        limit += 1
    return volume_shape(tuple((travel / full).tolist()), tuple((area / area[limit]).tolist()))


def _borne(between: Array, travel: Array, area: Array, needed: Array) -> Array:
    """Areas between two branches: monotone, but where E' needs more at the limit pressure."""
    from scipy.interpolate import PchipInterpolator

    falling = 1.0 - FALLS * (between - travel[0]) / (travel[1] - travel[0])
    smooth = PchipInterpolator([*travel], [*area])(between)
    return np.asarray(np.maximum(smooth, needed / falling))


def _scales(domes: Domes, file: Calibration, curve: DomeCurve) -> tuple[float, float]:
    """Travel D (mm) and force (N) by which the law's curve is measured; see `domes`."""
    stiffness, stroke = (file.values[key].value for key in (BISTABLE_STIFFNESS.key, STROKE.key))
    if domes.travel:
        return domes.travel, stiffness * domes.travel
    full = stroke / curve.opening_per_travel
    return full, stiffness * stroke**2 / full


def _branches(curve: DomeCurve, law: Curve, full: float, force_unit: float) -> Iterator[Sampled]:
    """What is known on each stretch of the travel that was sampled, from rest on."""
    travel = np.array(curve.travel)
    volume, pressure = (_numbers(v, len(travel)) for v in (curve.volume, curve.pressure))
    ends = [0.0, *(end for gap in curve.gaps for end in gap), np.inf]
    for start, end in zip(ends[::2], ends[1::2], strict=True):
        own = (travel >= start) & (travel <= end)
        if own.sum() < 2:
            continue
        fine = np.unique([np.linspace(a, b, PER_STEP + 1) for a, b in pairwise(travel[own])])
        force = force_unit * law(fine / full).slope
        area = _area(travel[own], volume[own], pressure[own], fine, force)
        if (is_known := np.isfinite(area) & (area > 0.0)).any():
            held = np.interp(fine, fine[is_known], area[is_known])  # constant beyond both ends
            yield Sampled(fine, held, force)


def _numbers(values: object, n_points: int) -> Array:
    return np.full(n_points, np.nan) if values is None else np.array(values, float)


def _area(travel: Array, volume: Array, pressure: Array, fine: Array, force: Array) -> Array:
    """Areas at fine travels of a branch; NaN where they are not known."""
    from scipy.interpolate import CubicSpline, PchipInterpolator

    for values, is_volume in ((volume, True), (pressure, False)):
        known = np.isfinite(values)
        if known.sum() < FEWEST_POINTS:
            continue
        if is_volume:
            area = np.asarray(CubicSpline(travel[known], values[known])(fine, 1))
            if (area > 0.0).any():
                return area
            continue
        push = PchipInterpolator(travel[known], values[known])(fine)
        is_large = np.abs(push) > NEXT_TO_NOTHING * np.abs(push).max()
        return np.where(is_large, force / np.where(is_large, push, 1.0), np.nan)
    return np.full(len(fine), np.nan)
