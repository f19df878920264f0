"""The measures of a finger's energies in node coordinates.

Every measure is a function of vectors between nodes: derivatives are taken by the vectors and
spread over the nodes whose differences they are (our derivation).
"""

from dataclasses import replace
from itertools import product
from typing import Self

import numpy as np

from dpgcli.arrays import Array, Indices, total
from dpgcli.equilibrium.contracts import Measured, Outer, Row, take_lanes
from dpgcli.mechanics.lattice_geometry import Vectors, corners, dot, extension, left, vectors
from dpgcli.records import dataclass

BASE_BEFORE, TOP_BEFORE, BASE, TOP = -4, -2, 0, 2  # rows of x, counted from B_i's
ENDS = {
    "chord": (BASE_BEFORE, BASE),
    "top": (TOP_BEFORE, TOP),
    "near": (BASE_BEFORE, TOP_BEFORE),
    "far": (BASE, TOP),
}


def _rows(nodes: tuple[int, ...]) -> tuple[Row, ...]:
    return tuple(Row(4, node + axis) for node in nodes for axis in (0, 1))


@dataclass(frozen=True)
class Extension:
    """The extension of a vector of every cell, |v| − r in mm.

    Its gradient is n along the vector, ∇² is m mᵀ/|v| with m across it. In the straight finger
    the vector lies along `axis`.
    """

    name: str
    axis: int
    rest: Array
    height: Array
    n_cells: int

    @property
    def rows(self) -> tuple[Row, ...]:
        """Rows of the nodes that the vector joins."""
        return _rows(ENDS[self.name])

    def __call__(self, coordinates: Array) -> Measured:
        """|v| − r with its derivatives, (unit, batch)."""
        vector: Array = getattr(vectors(coordinates, self.height), self.name)
        length = np.sqrt(dot(vector, vector))
        along = vector / length
        across = left(along)
        return Measured(
            extension(vector, self.rest, self.axis),
            (*-along, *along),
            Outer(1.0 / length, (*-across, *across)),
        )

    def take_lanes(self, index: Indices) -> Self:
        """The same measure for some lanes of the batch."""
        rest, height = (take_lanes(part, index) for part in (self.rest, self.height))
        return replace(self, rest=rest, height=height)


@dataclass(frozen=True)
class Corner:
    """The angle of every cell's near or far corner, rad: a = ∠p − ∠c − π/2, b = ∠c + π/2 − ∠q.

    Of the direction of a vector the gradient is g = m/|v|, ∇² is −(g hᵀ + h gᵀ) with h = n/|v|.
    """

    is_near: bool
    height: Array
    n_cells: int

    @property
    def _nodes(self) -> tuple[int, ...]:
        return (BASE_BEFORE, TOP_BEFORE, BASE) if self.is_near else (BASE_BEFORE, BASE, TOP)

    @property
    def rows(self) -> tuple[Row, ...]:
        """Rows of the nodes of the chord and the strut."""
        return _rows(self._nodes)

    def __call__(self, coordinates: Array) -> Measured:
        """The angle with its derivatives, (unit, batch)."""
        cell = vectors(coordinates, self.height)
        turns = self._turns(cell)
        slopes = np.zeros((len(self._nodes), *cell.chord.shape), coordinates.dtype)
        blocks: dict[tuple[int, int], Array] = {}
        for name, sign, vector in turns:
            radial = vector / dot(vector, vector)
            slope = left(radial)
            mixed = slope[:, None] * radial[None]
            bend = -sign * (mixed + mixed.swapaxes(0, 1))
            ends = [
                (self._nodes.index(node), end)
                for node, end in zip(ENDS[name], (-1.0, 1.0), strict=True)
            ]
            for node, end in ends:
                slopes[node] += sign * end * slope
            for (first, start), (second, stop) in product(ends, repeat=2):
                if first <= second:
                    block = start * stop * bend
                    known = blocks.get((first, second))
                    blocks[first, second] = block if known is None else known + block
        entries = {
            (2 * first + p, 2 * second + q): block[p, q]
            for (first, second), block in blocks.items()
            for p, q in product((0, 1), repeat=2)
            if (first, p) <= (second, q)
        }
        near, far = corners(cell)
        gradient = tuple(slopes.reshape(2 * len(slopes), *slopes.shape[2:]))
        return Measured(near if self.is_near else far, gradient, None, entries)

    def _turns(self, cell: Vectors) -> tuple[tuple[str, float, Array], ...]:
        """The directions that the angle is the difference of, with their signs."""
        if self.is_near:
            return ("near", 1.0, cell.near), ("chord", -1.0, cell.chord)
        return ("chord", 1.0, cell.chord), ("far", -1.0, cell.far)

    def take_lanes(self, index: Indices) -> Self:
        """The same measure for some lanes of the batch."""
        return replace(self, height=take_lanes(self.height, index))


@dataclass(frozen=True)
class Center:
    """x or y of the center of the tops T_i by their `shares` (unit, 1 or batch), mm: one cell."""

    shares: Array
    axis: int
    n_units: int
    n_cells: int = 1

    @property
    def rows(self) -> tuple[Row, ...]:
        """Rows of the tops."""
        return tuple(Row(1, 4 * unit + TOP + self.axis) for unit in range(self.n_units))

    def __call__(self, coordinates: Array) -> Measured:
        """x or y with its derivatives, (1, batch): it is linear."""
        tops = coordinates[TOP + self.axis :: 4]
        shares = np.broadcast_to(self.shares, tops.shape)
        return Measured(total(shares * tops)[None], tuple(share[None] for share in shares))

    def take_lanes(self, index: Indices) -> Self:
        """The same measure for some lanes of the batch."""
        return replace(self, shares=take_lanes(self.shares, index))
