"""A dimensionless energy over a dimensionless travel, twice continuously differentiable."""

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dpgcli.arrays import Array
from dpgcli.records import dataclass

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

FEWEST_POINTS = 4
LEVEL = 1e-6  # of k_b: a curve as level is not told from one that is
AT_REST = 1e-6  # of the travels: points as near to rest are not told from it


class Derivatives(NamedTuple):
    """Value, slope and curvature."""

    value: Array
    slope: Array
    bend: Array


@dataclass(frozen=True, eq=False)
class Spline:
    """A cubic spline between `knots` (m,), twice continuously differentiable.

    `coefficients` (4, m + 1) have the highest power first, the pieces before and after included.
    Beyond its ends the spline goes on with the curvature it has there.
    """

    knots: Array
    coefficients: Array

    def __call__(self, travel: Array) -> Derivatives:
        """Value and derivatives at travels of any shape, complex ones too.

        >>> parabola = spline((0.0, 1.0, 2.0, 3.0), (0.0, 1.0, 4.0, 9.0))
        >>> [round(float(part), 9) for part in parabola(np.array(5.0))]  # beyond its end
        [25.0, 10.0, 2.0]
        """
        piece = np.searchsorted(self.knots, np.real(travel), side="right")
        from_start = travel - self.knots[np.maximum(piece - 1, 0)]
        cubic, square, linear, constant = self.coefficients[:, piece]
        return Derivatives(
            ((cubic * from_start + square) * from_start + linear) * from_start + constant,
            (3.0 * cubic * from_start + 2.0 * square) * from_start + linear,
            6.0 * cubic * from_start + 2.0 * square,
        )


@dataclass(frozen=True, eq=False)
class Curve(Spline):
    """A dome's energy by its travel.

    `rests` are the top and the well, where the slope vanishes: the minimum that lies deepest below
    the highest maximum before it, and that maximum; NaN where there is none.
    `branches` are the stretches between the two on which the energy falls, each from its top to its
    well, the last one first. `rest` is the travel of the dome at rest: 0, but the first minimum
    of a spline that bends down there.
    """

    rests: tuple[float, float]
    branches: tuple[tuple[float, float], ...]
    rest: float


@cache  # one curve for all designs that share a calibration
def spline(travel: tuple[float, ...], value: tuple[float, ...]) -> Curve:
    """The C² cubic spline through points of increasing travel.

    Values are counted from rest, at travel 0, and the slope vanishes there: a dome at rest exerts
    no force, and an energy is known but for a constant. Points before rest only tell what the value
    there is. Where all points are beyond it, nothing is known of rest. Raises ValueError for fewer
    than four points from rest on, or travels that do not increase.

    >>> dome = spline((-1.0, 0.0, 1.0, 2.0, 3.0), (101.0, 100.0, 101.0, 104.0, 109.0))
    >>> [round(float(part), 9) for part in dome(np.array(2.0))]
    [4.0, 4.0, 2.0]
    """
    from scipy.interpolate import CubicSpline

    if travel[0] < 0.0 < travel[-1]:
        travel, value = _from_rest(travel, value)
    if len(travel) < FEWEST_POINTS or np.any(np.diff(travel) <= 0.0):
        raise ValueError(f"travel: expected {FEWEST_POINTS} or more increasing values: {travel}")
    starts_at_rest = travel[0] == 0.0
    rest: Any = (1, 0.0) if starts_at_rest else "not-a-knot"
    counted = np.subtract(value, value[0] if starts_at_rest else 0.0)
    cubic = CubicSpline(travel, counted, bc_type=(rest, "not-a-knot"))
    return Curve(np.asarray(travel, float), spline_pieces(cubic), *_rests(cubic), _rest(cubic))


def spline_pieces(cubic: "CubicSpline") -> Array:
    """The coefficients of a spline's pieces, and of the parabolas before and after, (4, m + 1)."""
    ends = [np.array([0.5 * cubic(x, 2), cubic(x, 1), cubic(x)]) for x in cubic.x[[0, -1]]]
    before, after = (np.concatenate(([0.0], end))[:, None] for end in ends)
    return np.concatenate((before, cubic.c, after), axis=1)


def _from_rest(
    travel: tuple[float, ...], value: tuple[float, ...]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Points from rest on, the value at rest by a spline through all."""
    from scipy.interpolate import CubicSpline

    at_rest = float(CubicSpline(travel, value)(0.0))
    is_beyond = np.array(travel) > AT_REST * np.ptp(travel)
    beyond, values = (np.array(part)[is_beyond].tolist() for part in (travel, value))
    return (0.0, *beyond), (at_rest, *values)


def bridged(travel: Array, value: Array, gaps: Sequence[Sequence[float]]) -> tuple[Array, Array]:
    """Points with some more in gaps, where the pieces beside a gap go on with their curvature.

    Each piece goes on as far as it is long, at most through a third of the gap, by the parabola of
    its nearest third (assumed: nothing is known there). Without these points a spline bends over
    the whole gap, and takes the pieces' ends along. The last piece goes on beyond its end too, if
    it stiffens: the curvature of a spline at the very end is that of the last points' noise.

    >>> travel = np.array([0.0, 1.0, 2.0, 3.0, 9.0, 10.0, 11.0, 12.0])
    >>> more, value = bridged(travel, travel**2, [(3.0, 9.0)])
    >>> more[4:7].round(2).tolist(), np.abs(value - more**2).max() < 1e-12
    ([3.67, 4.33, 5.0], np.True_)
    >>> more[-3:].tolist()
    [13.0, 14.0, 15.0]
    """
    if not gaps:
        return travel, value
    edges = [travel[0], *(end for gap in gaps for end in gap), travel[-1]]
    travels, values = [travel], [value]
    for piece in range(0, len(edges), 2):
        own = (travel >= edges[piece]) & (travel <= edges[piece + 1])
        if own.sum() < FEWEST_POINTS:
            continue
        first, last = travel[own].min(), travel[own].max()
        for end, sign, gap in ((first, -1.0, piece // 2 - 1), (last, 1.0, piece // 2)):
            if gap < 0:
                continue
            is_inner = gap < len(gaps)
            room = (gaps[gap][1] - gaps[gap][0]) / 3.0 if is_inner else np.inf
            beyond = sign * min(last - first, room) * np.array([1.0, 2.0, 3.0]) / 3.0
            slope, bend = _parabola(travel[own] - end, value[own])
            if is_inner or bend > 0.0:
                near = value[own][np.abs(travel[own] - end).argmin()]
                travels.append(end + beyond)
                values.append(near + slope * beyond + bend * beyond**2)
    order = np.argsort(np.concatenate(travels))
    return np.concatenate(travels)[order], np.concatenate(values)[order]


def _parabola(travel: Array, value: Array) -> tuple[float, float]:
    """Slope and half the curvature at travel 0, an end of a piece, by its nearest third."""
    nearest = np.argsort(np.abs(travel))[: max(FEWEST_POINTS, len(travel) // 3)]
    rise = value[nearest] - value[nearest[0]]
    slope, bend = np.linalg.lstsq(
        np.stack((travel[nearest], travel[nearest] ** 2), axis=1), rise, rcond=None
    )[0]
    return float(slope), float(bend)


def _rest(cubic: "CubicSpline") -> float:
    """The first minimum downhill from travel 0, on the way open: 0 unless it bends down there."""
    bend = cubic.derivative(2)
    if bend(0.0) >= -LEVEL:
        return 0.0
    roots = cubic.derivative().roots(extrapolate=False)
    return float(np.min(roots[(roots > 0.0) & (bend(roots) > 0.0)], initial=np.inf))


def _rests(
    cubic: "CubicSpline",
) -> tuple[tuple[float, float], tuple[tuple[float, float], ...]]:
    """The highest top before the deepest well, and that well: the deepest below all tops before it.

    Then what lies between the two: the branches, from the last to the first. What comes after a
    well counts for nothing: a curve may end anywhere, and its spline may turn over there.
    """
    slope, bend = cubic.derivative(), cubic.derivative(2)
    roots = np.array([root for root in slope.roots(extrapolate=False) if root > 0.0])
    tops, wells = (roots[sign * bend(roots) > 0.0] for sign in (-1.0, 1.0))
    wells = wells[wells > np.min(tops, initial=np.inf)]
    if not len(wells):
        return (np.nan, np.nan), ((np.nan, np.nan),)
    depths = [cubic(tops[tops < well]).max() - cubic(well) for well in wells]
    well = float(wells[np.argmax(depths)])
    before = tops[tops < well]
    top = float(before[np.argmax(cubic(before))])
    lesser = wells[(wells > top) & (wells < well)]
    ends = (well, *map(float, lesser[::-1]))
    return (top, well), tuple((float(before[before < end].max()), end) for end in ends)
