"""Quantities known at some geometries, at any other: a scaling law or an interpolation.

Both work on logarithms, so that products of powers are straight: ln q over ln g. A scaling law is
their least-squares plane, ln q = a + Σ b_i ln(g_i/r_i); an interpolation meets the points, by
thin-plate splines (exact for products of powers) or, where the points fill a grid, linear between
its nodes. Each geometry has its values by itself, whatever others are asked for with it; complex
ones have them too, so that a complex step differentiates a law.
"""

from collections.abc import Mapping
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import Delaunay, QhullError

from dpgcli.arrays import Array, Flags, total
from dpgcli.calibration.choices import GridMethod
from dpgcli.calibration.fits import Fit, Parameter, fit_linear
from dpgcli.calibration.interpolants import Multilinear, ThinPlates
from dpgcli.design.calibrations import Estimate
from dpgcli.errors import FitError
from dpgcli.records import dataclass

HULL_TOLERANCE = 1e-9  # of the ranges: rounding may put the hull's own corners outside it
CONSTANT = "ln(value at reference)"


@dataclass(frozen=True)
class GridPoints:
    """Geometries (point, key), each key of `over` a column, and quantities (point,) by key."""

    over: tuple[str, ...]
    geometry: Array
    quantities: Mapping[str, Array]

    def __post_init__(self) -> None:
        if self.geometry.shape[1:] != (len(self.over),):
            raise ValueError(f"geometry has shape {self.geometry.shape} for {self.over}")
        if not all((v > 0.0).all() for v in (self.geometry, *self.quantities.values())):
            raise ValueError("geometries and quantities are positive")

    @cached_property
    def reference(self) -> Array:
        """The point nearest to the middle, (key,), where a scaling law's errors are small."""
        away = np.log(self.geometry)
        size = np.ptp(away, axis=0)
        away = (away - away.mean(axis=0)) / np.where(size > 0.0, size, 1.0)
        return np.asarray(self.geometry[np.argmin((away**2).sum(axis=1))])

    def without(self, place: int) -> "GridPoints":
        """All points but one."""
        rest = {key: np.delete(values, place) for key, values in self.quantities.items()}
        return GridPoints(self.over, np.delete(self.geometry, place, axis=0), rest)

    def are_inside(self, geometry: Array) -> Flags:
        """Whether geometries (design, key) lie in the convex hull of the points, edges included."""
        scaled, own = self._scaled(np.real(geometry)), self._scaled(self.geometry)
        in_range = ((scaled >= -HULL_TOLERANCE) & (scaled <= own.max(axis=0) + HULL_TOLERANCE)).all(
            axis=1
        )
        if len(self.over) == 1:
            return np.asarray(in_range)
        return np.asarray(in_range & (self._hull.find_simplex(scaled, tol=HULL_TOLERANCE) >= 0))

    def are_among(self, geometry: Array) -> Flags:
        """Whether geometries (design, key) are those of a point, but for rounding."""
        scaled, own = self._scaled(np.real(geometry)), self._scaled(self.geometry)
        found = np.zeros(len(scaled), bool)
        for point in own:
            found |= (np.abs(scaled - point) <= HULL_TOLERANCE).all(axis=1)
        return found

    def _scaled(self, geometry: Array) -> Array:
        """Geometries (design, key) mapped so that the points range from 0 to 1 in each key."""
        size = np.ptp(self.geometry, axis=0)
        return np.asarray((geometry - self.geometry.min(axis=0)) / np.where(size > 0.0, size, 1.0))

    @cached_property
    def _hull(self) -> Any:
        try:
            return Delaunay(self._scaled(self.geometry))
        except (QhullError, ValueError):
            raise FitError(
                f"the points leave no room between them over {', '.join(self.over)}: "
                f"expected at least {len(self.over) + 1} that are not in one line or plane"
            ) from None


@dataclass(frozen=True)
class FittedGridLaw:
    """A way between points, for all their quantities."""

    method: GridMethod
    points: GridPoints

    def at(self, key: str, geometry: Array) -> Estimate:
        """A quantity at geometries (design, key), in the order of `points.over`.

        Of a scaling law the error is that of one more point, s √(1 + xᵀ(XᵀX)⁻¹x); of an
        interpolation the root mean square of the leave-one-out errors, the same everywhere. NaN
        where there are too few points to know.

        >>> heights = np.array([[1.0], [2.0], [4.0]])
        >>> points = GridPoints(("dome_height_mm",), heights, {"area": 3.0 * heights[:, 0] ** 2})
        >>> found = FittedGridLaw(GridMethod.SCALING, points).at("area", np.array([[3.0], [8.0]]))
        >>> found.value.round(9).tolist(), found.is_inside.tolist()
        ([27.0, 192.0], [True, False])
        """
        return Estimate(
            self._value(key, geometry),
            self._relative_error(key, geometry),
            self.points.are_inside(geometry),
            self._are_samples(geometry),
        )

    def _are_samples(self, geometry: Array) -> Flags:
        if self.method is GridMethod.INTERPOLATION:
            return self.points.are_among(geometry)
        return np.zeros(len(geometry), bool)

    def scaling(self, key: str) -> Fit:
        """The scaling law of one quantity: ln of its value at the reference, then exponents.

        Raises FitError where the points cannot tell exponents apart.
        """
        return self._scalings[key]

    @cached_property
    def _scalings(self) -> dict[str, Fit]:
        design = self._design(self.points.geometry)
        terms = [Parameter(name, 0.0) for name in (CONSTANT, *self.points.over)]
        known = self.points.quantities.items()
        return {key: fit_linear(terms, design, np.log(values)) for key, values in known}

    def leave_one_out(self, key: str) -> tuple[float, float]:
        """Largest and root mean square relative error of each point from the others.

        NaN where the others are too few. Without one of its points a grid over several keys is
        none any more: thin-plate splines then take its place.
        """
        errors = self._left_out[key]
        return float(np.abs(errors).max()), float(np.sqrt(np.mean(errors**2)))

    @cached_property
    def _left_out(self) -> dict[str, Array]:
        """Relative errors (point,) by key."""
        known, geometry = self.points.quantities, self.points.geometry
        errors = {key: np.full(len(geometry), np.nan) for key in known}
        for place in range(len(geometry)):
            rest = FittedGridLaw(self.method, self.points.without(place))
            with suppress(FitError):  # too few to go without one
                for key, values in known.items():
                    guess = rest._value(key, geometry[place : place + 1])
                    errors[key][place] = guess[0] / values[place] - 1.0
        return errors

    def _value(self, key: str, geometry: Array) -> Array:
        if self.method is GridMethod.SCALING:
            terms = self.scaling(key).values[:, None] * self._design(geometry).T
            return np.asarray(np.exp(total(terms)))
        return np.asarray(np.exp(self._interpolants[key](np.log(geometry))))

    def _relative_error(self, key: str, geometry: Array) -> Array:
        if self.method is GridMethod.INTERPOLATION:
            return np.full(len(geometry), self.leave_one_out(key)[1])
        found, terms = self.scaling(key), self._design(np.real(geometry)).T
        n_spare = found.n_points - len(found.values)
        noise = (found.residuals**2).sum() / n_spare if n_spare else np.nan
        spread = total(found.covariance[:, :, None] * terms[:, None])
        return np.asarray(np.sqrt(noise + total(spread * terms)))

    @cached_property
    def _interpolants(self) -> dict[str, Multilinear | ThinPlates]:
        known = self.points.quantities.items()
        return {key: _interpolant(self.points, np.log(values)) for key, values in known}

    def _design(self, geometry: Array) -> Array:
        logs = np.log(geometry / self.points.reference)
        return np.concatenate((np.ones((len(logs), 1)), logs), axis=1)


def _interpolant(points: GridPoints, logs: Array) -> Multilinear | ThinPlates:
    """A function of ln geometry (design, key) through the points."""
    axes = [np.unique(column) for column in points.geometry.T]
    if np.prod([len(axis) for axis in axes]) == len(logs) and min(map(len, axes)) > 1:
        order = np.lexsort(points.geometry.T[::-1])
        shape = tuple(len(axis) for axis in axes)
        nodes = tuple(np.log(axis) for axis in axes)
        return Multilinear(nodes, logs[order].reshape(shape))
    try:
        return ThinPlates.through(np.log(points.geometry), logs)
    except np.linalg.LinAlgError:
        raise FitError(
            f"no interpolation over {', '.join(points.over)} through {len(logs)} points: expected "
            f"at least {len(points.over) + 1} that are not in one line or plane"
        ) from None
