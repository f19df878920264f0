"""Functions through points at any place, complex ones too, each place by itself to the last bit.

scipy's interpolators take real places only, and their sums depend on how many there are.
"""

from collections.abc import Sequence
from itertools import product

import numpy as np

from dpgcli.arrays import Array, total
from dpgcli.records import dataclass


@dataclass(frozen=True)
class ThinPlates:
    """Thin-plate splines f = Σ w r² ln r + a plane through points (Duchon).

    `points` (point, key), the `weights` of points and plane, and the middle and half the range of
    the points, by which the plane counts.
    """

    points: Array
    weights: Array
    middle: Array
    half_range: Array

    @classmethod
    def through(cls, points: Array, values: Array) -> "ThinPlates":
        """The spline through values (point,) at points (point, key).

        Raises LinAlgError where the points fix no plane.

        >>> points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
        >>> plane = ThinPlates.through(points, 1.0 + points @ [2.0, 3.0])
        >>> plane(np.array([[0.5, 0.5], [2.0, 0.0]])).round(12)
        array([3.5, 5. ])
        """
        low, high = points.min(axis=0), points.max(axis=0)
        middle, half_range = 0.5 * (high + low), 0.5 * (high - low)
        half_range = np.where(half_range > 0.0, half_range, 1.0)
        n_plane = 1 + points.shape[1]
        unweighted = cls(points, np.zeros(0), middle, half_range)
        shapes = unweighted._shapes(points)
        if len(points) < n_plane or np.linalg.matrix_rank(shapes[-n_plane:]) < n_plane:
            raise np.linalg.LinAlgError("the points fix no plane")
        system = np.zeros((len(shapes), len(shapes)))
        system[: len(points)] = shapes.T
        system[len(points) :, : len(points)] = shapes[-n_plane:]
        weights = np.linalg.solve(system, np.concatenate((values, np.zeros(n_plane))))
        return cls(points, weights, middle, half_range)

    def __call__(self, places: Array) -> Array:
        """Values at places (place, key)."""
        return total(self.weights[:, None] * self._shapes(places))

    def _shapes(self, places: Array) -> Array:
        """r² ln r from each point, then 1 and the keys of the plane; (shape, place)."""
        squares = total(
            np.stack(
                [
                    (places[:, key] - self.points[:, key, None]) ** 2
                    for key in range(places.shape[1])
                ]
            )
        )
        bumps = np.zeros_like(squares)
        apart = squares != 0.0
        bumps[apart] = 0.5 * squares[apart] * np.log(squares[apart])
        plane = ((places - self.middle) / self.half_range).T
        return np.concatenate((bumps, np.ones((1, len(places))), plane))


@dataclass(frozen=True)
class Multilinear:
    """Linear between the nodes of a grid in each key, and beyond its ends as in its last cells.

    `axes` are the nodes by key, `values` an array over all of them.
    """

    axes: Sequence[Array]
    values: Array

    def __call__(self, places: Array) -> Array:
        """Values at places (place, key).

        >>> plane = Multilinear(([0.0, 1.0], [0.0, 2.0]), np.array([[0.0, 2.0], [1.0, 3.0]]))
        >>> plane(np.array([[0.5, 1.0], [2.0, 0.0]]))
        array([1.5, 2. ])
        """
        cells, shares = [], []
        for axis, place in zip(map(np.asarray, self.axes), places.T, strict=True):
            cell = np.searchsorted(axis, np.real(place), side="right") - 1
            cell = np.clip(cell, 0, len(axis) - 2)
            cells.append(cell)
            shares.append((place - axis[cell]) / (axis[cell + 1] - axis[cell]))
        parts = []
        for corner in product((0, 1), repeat=len(cells)):
            part = self.values[tuple(c + end for c, end in zip(cells, corner, strict=True))]
            for share, end in zip(shares, corner, strict=True):
                part = part * (share if end else 1.0 - share)
            parts.append(part)
        return total(np.stack(parts))
