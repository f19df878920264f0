"""Products of the turns of neighboring hinges: the measure by which one that opens turns the other.

The chamber between two gaps bends where a dome pushes one of them open, so that the other turns,
too. With θ = a + b the turn of a hinge, the sum of its two corners, the energy −κ θ_i θ_{i+1} does
that: a hinge of k_θ at rest turns by κ/k_θ of its neighbor's turn (our derivation).

It takes corners in any coordinates. A product has ∇q = θ' ∇θ + θ ∇θ' and
∇²q = θ' ∇²θ + θ ∇²θ' + ∇θ ∇θ'ᵀ + ∇θ' ∇θᵀ.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.equilibrium.contracts import Measure, Measured, Pair, Row
from dpgcli.records import dataclass


class _Turns(NamedTuple):
    """Turns θ of some hinges, (hinge, batch), with ∇θ and ∇²θ by the offsets of rows."""

    value: Array
    slopes: Mapping[int, Array]
    bends: Mapping[Pair, Array]


@dataclass(frozen=True)
class NeighborTurns:
    """θ_i θ_{i+1} in rad², a cell for each two neighboring hinges, by their two `corners`."""

    corners: tuple[Measure, Measure]

    @property
    def n_cells(self) -> int:
        """One less than there are hinges."""
        return self.corners[0].n_cells - 1

    @cached_property
    def _stride(self) -> int:
        return self.corners[0].rows[0].stride

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """Those of the corners of both hinges."""
        own = {row.offset for corner in self.corners for row in corner.rows}
        both = own | {offset + self._stride for offset in own}
        return tuple(Row(self._stride, offset) for offset in sorted(both))

    def __call__(self, coordinates: Array) -> Measured:
        """The products with their derivatives, (hinge − 1, batch)."""
        turns = self._turns(coordinates)
        first, second = _part(turns, slice(None, -1), 0), _part(turns, slice(1, None), self._stride)
        offsets = [row.offset for row in self.rows]
        gradient: list[Array] = []
        entries: dict[Pair, Array] = {}
        for p, row in enumerate(offsets):
            slope = np.zeros_like(turns.value[1:])
            for one, other in ((first, second), (second, first)):
                if row in one.slopes:
                    slope += other.value * one.slopes[row]
            gradient.append(slope)
            for q in range(p, len(offsets)):
                if (bend := _bend(first, second, (row, offsets[q]))) is not None:
                    entries[p, q] = bend
        return Measured(first.value * second.value, tuple(gradient), None, entries)

    def _turns(self, coordinates: Array) -> _Turns:
        """The sums of the corners of every hinge."""
        measured = [corner(coordinates) for corner in self.corners]
        value = measured[0].value + measured[1].value
        slopes: dict[int, Array] = {}
        bends: dict[Pair, Array] = {}
        for corner, found in zip(self.corners, measured, strict=True):
            rows = [row.offset for row in corner.rows]
            own = found.gradient or (np.ones_like(value),)  # a corner that is a coordinate
            for row, slope in zip(rows, own, strict=True):
                slopes[row] = slopes[row] + slope if row in slopes else slope
            for (p, q), bend in found.entries.items():
                at = rows[p], rows[q]
                bends[at] = bends[at] + bend if at in bends else bend
        return _Turns(value, slopes, bends)

    def take_lanes(self, index: Indices) -> Self:
        """The same measure for some lanes of the batch."""
        near, far = self.corners
        return type(self)((near.take_lanes(index), far.take_lanes(index)))


def _part(turns: _Turns, hinges: slice, shift: int) -> _Turns:
    """Some of the hinges, as seen from the first of a pair: rows are moved by `shift`."""
    slopes = {row + shift: slope[hinges] for row, slope in turns.slopes.items()}
    bends = {(p + shift, q + shift): bend[hinges] for (p, q), bend in turns.bends.items()}
    return _Turns(turns.value[hinges], slopes, bends)


def _bend(first: _Turns, second: _Turns, at: Pair) -> Array | None:
    """An entry of ∇²(θ θ'), None where it is zero."""
    p, q = at
    parts = []
    for one, other in ((first, second), (second, first)):
        if at in one.bends:
            parts.append(other.value * one.bends[at])
        if p in one.slopes and q in other.slopes:
            parts.append(one.slopes[p] * other.slopes[q])
    return sum(parts[1:], start=parts[0]) if parts else None
