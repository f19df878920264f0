"""A body in the way of a finger: points with radii, and straight plates between them."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.equilibrium.contracts import take_lanes


@dataclass(frozen=True)
class Obstacle:
    """In a finger's frame: `points` (2, point, 1 or batch) with `radii` (point, 1 or batch).

    `plates` (plate, 2) are the points that a straight side leads from and to, the body on its left;
    such points have no radius. A disc is one point, a polygon its corners and its sides; mm.
    """

    points: Array
    radii: Array
    plates: Indices = field(default_factory=lambda: np.zeros((0, 2), np.int64))

    def take_lanes(self, index: Indices) -> Self:
        """The bodies of some lanes of the batch."""
        points, radii = take_lanes(self.points, index), take_lanes(self.radii, index)
        return type(self)(points, radii, self.plates)
