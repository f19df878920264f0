"""A body in the way of a finger: points with radii, and straight plates between them."""

from dataclasses import field
from functools import cached_property
from typing import Self

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.contracts import take_lanes
from dpgcli.records import dataclass

STRAIGHT = 1e-12  # the sine of the turn in the middle of a straight side


@dataclass(frozen=True)
class Obstacle:
    """In a finger's frame: `points` (2, point, 1 or batch) with `radii` (point, 1 or batch), mm.

    `plates` (plate, 2) are the points that a straight side leads from and to, the body on its left;
    they go all around the body, and their points have no radius. A disc is one point.

    >>> square = Obstacle.polygon(np.array([[0.0, 4.0, 4.0, 0.0], [0.0, 0.0, 4.0, 4.0]]))
    >>> square.plates.tolist(), square.is_reentrant.any()
    ([[0, 1], [1, 2], [2, 3], [3, 0]], np.False_)
    """

    points: Array
    radii: Array
    plates: Indices = field(default_factory=lambda: np.zeros((0, 2), np.int64))

    @classmethod
    def disc(cls, center: Array, radius: float | Array) -> Self:
        """A disc about a center (2,), or one for each lane, (2, batch)."""
        return cls(center.reshape(2, 1, -1), np.reshape(radius, (1, -1)))

    @classmethod
    def polygon(cls, corners: Array) -> Self:
        """A polygon by its corners (2, corner), or (2, corner, batch), one way round or the other.

        Corners in the middle of a straight side are left out; those of a batch are of one kind.
        """
        corners = corners.reshape(*corners.shape[:2], -1)
        onwards = np.roll(corners, -1, axis=1) - corners
        before = np.roll(onwards, 1, axis=1)
        turn = before[0] * onwards[1] - before[1] * onwards[0]
        is_turn = (np.abs(turn) > STRAIGHT * np.hypot(*before) * np.hypot(*onwards)).any(axis=1)
        x, y = around = corners[:, is_turn]
        if (x * np.roll(y, -1, axis=0) - np.roll(x, -1, axis=0) * y)[:, 0].sum() < 0.0:
            around = around[:, ::-1]
        number = np.arange(around.shape[1])
        plates = np.stack((number, np.roll(number, -1)), axis=1)
        return cls(around, np.zeros((len(number), 1)), plates)

    @cached_property
    def is_reentrant(self) -> Flags:
        """The corners that a straight line cannot touch, (point, 1 or batch)."""
        reentrant = np.zeros(self.points.shape[1:], bool)
        if len(self.plates):
            side = self.points[:, self.plates[:, 1]] - self.points[:, self.plates[:, 0]]
            before = np.empty_like(side)
            before[:, np.argsort(self.plates[:, 0])] = side[:, np.argsort(self.plates[:, 1])]
            turn = before[0] * side[1] - before[1] * side[0]
            reentrant[self.plates[:, 0]] = turn < 0.0
        return reentrant

    def take_lanes(self, index: Indices) -> Self:
        """The bodies of some lanes of the batch."""
        points, radii = take_lanes(self.points, index), take_lanes(self.radii, index)
        return type(self)(points, radii, self.plates)
