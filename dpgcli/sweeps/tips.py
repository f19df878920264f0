"""Tips of designs: those that differ, and the hulls around them."""

from collections.abc import Sequence
from dataclasses import field
from typing import Any

import numpy as np

from dpgcli.arrays import Array, Indices, distinct
from dpgcli.records import dataclass

TIPS_PER_LENGTH = 10_000  # tips are told apart on a grid of this many steps a finger's length
CELL_BITS = 21  # for each coordinate of the grid: 100 lengths either way
MOST_OWNERS = 2 ** (63 - 2 * CELL_BITS)  # designs that have room beside both
CELLS_AT_ONCE = 2**20  # gathered before what repeats is dropped


@dataclass
class DistinctTips:
    """Cells of a grid that tips lie in, by design, without what repeats."""

    known: Indices = field(default_factory=lambda: np.zeros(0, np.int64))

    def __post_init__(self) -> None:
        self.waiting: list[Indices] = []

    def add(self, owner: Indices, tips: Array) -> None:
        """Tips (tip, 2) in steps of the grid, and the design of each, below MOST_OWNERS."""
        assert owner.max(initial=0) < MOST_OWNERS, "blocks have fewer designs"
        most = 2.0 ** (CELL_BITS - 1) - 1
        x, y = np.clip(np.rint(tips.T), -most, most).astype(np.int64) + int(most)
        self.waiting.append(distinct((((owner << CELL_BITS) | x) << CELL_BITS) | y))
        if sum(map(len, self.waiting)) > max(CELLS_AT_ONCE, len(self.known)):
            self._join()

    def counts(self, n_designs: int) -> Indices:
        """How many cells each design's tips lie in."""
        self._join()
        return np.bincount(self.known >> (2 * CELL_BITS), minlength=n_designs)

    def _join(self) -> None:
        parts = [part for part in (self.known, *self.waiting) if len(part)]
        if parts:
            self.known = parts[0] if len(parts) == 1 else distinct(np.concatenate(parts))
        self.waiting.clear()


def hulls_of(owner: Indices, points: Array) -> tuple[Indices, Any]:
    """The owners and the convex hull of each one's points (point, 2), at least one point in all.

    Polygons, lines or points, whatever a hull comes to.

    >>> square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
    >>> owners, hulls = hulls_of(np.full(5, 7), square)
    >>> owners.tolist(), hulls[0].area, len(hulls[0].exterior.coords) - 1
    ([7], 1.0, 4)
    """
    import shapely

    order = np.arange(len(owner))
    if (owner[1:] < owner[:-1]).any():
        order = np.argsort(owner, kind="stable")
        owner = owner[order]
    is_first = np.concatenate(([True], owner[1:] != owner[:-1]))
    is_last = np.concatenate((is_first[1:], [True]))
    twice = 1 + (is_first & is_last)  # a line needs two points
    place = np.repeat(np.cumsum(is_first) - 1, twice)
    lines = shapely.linestrings(points[np.repeat(order, twice)], indices=place)
    return owner[is_first], shapely.convex_hull(lines)


def joined(parts: Sequence[tuple[Indices, Any]]) -> tuple[Indices, Any]:
    """The hulls of what lies in hulls of the same owners."""
    import shapely

    owners, points = [], []
    for designs, hulls in parts:
        corners, index = shapely.get_coordinates(hulls, return_index=True)
        owners.append(designs[index])
        points.append(corners)
    return hulls_of(np.concatenate(owners), np.concatenate(points))
