"""Gaps between domes and the neighbors that they push, for domes with coordinates of their own.

A dome by itself is at an extension y, its travel less that at contact, and its neighbor where the
spring between both would have the extension ξ: it touches where ξ − y = 0, and is never beyond.
"""

from dataclasses import replace
from typing import Self

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.equilibrium.contracts import Measure, Measured, Outer, OwnCoordinate, Row
from dpgcli.records import dataclass


@dataclass(frozen=True)
class DomeGaps:
    """ξ − y of every dome, mm: `extension` ξ by some coordinates, and `own` y behind them.

    >>> from dpgcli.equilibrium.joined import OfPart
    >>> from dpgcli.mechanics.chain import Chain
    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> chain = Chain(uniform_finger(1, **STUDY))  # rigid bars: two corners, and then y
    >>> gaps = DomeGaps(OfPart(chain.dome, 0, 1, 2), OwnCoordinate(Row(1, 2), 1))
    >>> gaps(np.array([[0.0], [0.0], [-2.0]])).value.tolist()
    [[2.0]]
    """

    extension: Measure
    own: OwnCoordinate

    @property
    def n_cells(self) -> int:
        """One for each dome."""
        return self.own.n_cells

    @property
    def rows(self) -> tuple[Row, ...]:
        """Those of the extension, and y."""
        return (*self.extension.rows, *self.own.rows)

    def __call__(self, coordinates: Array) -> Measured:
        """The gaps with their derivatives, (unit, batch): only ξ bends."""
        there = self.extension(coordinates)
        value = there.value - self.own(coordinates).value
        slopes = there.gradient or (np.ones_like(value),)
        outer = there.outer
        if outer is not None:
            outer = Outer(outer.weight, (*outer.vector, np.zeros((1, 1))))
        return Measured(value, (*slopes, -np.ones_like(value)), outer, there.entries)

    def take_lanes(self, index: Indices) -> Self:
        """The same gaps for some lanes of the batch."""
        return replace(self, extension=self.extension.take_lanes(index))
