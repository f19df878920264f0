"""A dimensionless energy over a dimensionless travel, twice continuously differentiable."""

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dpgcli.arrays import Array

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

FEWEST_POINTS = 4


class Derivatives(NamedTuple):
    """Value, slope and curvature."""

    value: Array
    slope: Array
    bend: Array


@dataclass(frozen=True, eq=False)
class Curve:
    """A cubic spline between `knots` (m,).

    `coefficients` (4, m + 1) have the highest power first, the pieces before and after included.
    Beyond its ends the spline goes on with the curvature it has there. `rests` are the top and
    the well, where the slope vanishes: the last minimum and the maximum before it, NaN where
    there is none.
    """

    knots: Array
    coefficients: Array
    rests: tuple[float, float]

    def __call__(self, travel: Array) -> Derivatives:
        """Value and derivatives at travels of any shape, complex ones too.

        >>> parabola = spline((0.0, 1.0, 2.0, 3.0), (0.0, 1.0, 4.0, 9.0))
        >>> [float(part) for part in parabola(np.array(5.0))]  # beyond its end
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


@cache  # one curve for all designs that share a calibration
def spline(travel: tuple[float, ...], value: tuple[float, ...]) -> Curve:
    """The C² cubic spline through points of increasing travel.

    Where the first point is rest, at travel 0, the slope vanishes there: a dome at rest exerts
    no force. Raises ValueError for fewer than four points or travels that do not increase.
    """
    from scipy.interpolate import CubicSpline

    if len(travel) < FEWEST_POINTS or np.any(np.diff(travel) <= 0.0):
        raise ValueError(f"travel: expected {FEWEST_POINTS} or more increasing values: {travel}")
    rest: Any = (1, 0.0) if travel[0] == 0.0 else "not-a-knot"
    cubic = CubicSpline(travel, value, bc_type=(rest, "not-a-knot"))
    ends = [np.array([0.5 * cubic(x, 2), cubic(x, 1), cubic(x)]) for x in (travel[0], travel[-1])]
    before, after = (np.concatenate(([0.0], end))[:, None] for end in ends)
    coefficients = np.concatenate((before, cubic.c, after), axis=1)
    return Curve(np.asarray(travel, float), coefficients, _rests(cubic))


def _rests(cubic: "CubicSpline") -> tuple[float, float]:
    roots = [float(root) for root in cubic.derivative().roots(extrapolate=False)]
    wells = [root for root in roots if root > 0.0 and cubic(root, 2) > 0.0]
    if not wells:
        return np.nan, np.nan
    tops = [root for root in roots if 0.0 < root < wells[-1] and cubic(root, 2) < 0.0]
    return (tops[-1], wells[-1]) if tops else (np.nan, np.nan)
