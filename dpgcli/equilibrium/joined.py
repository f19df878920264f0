"""Several systems of one size as one: their coordinates interleaved, their measures side by side.

Coordinate i of system p is row n i + p of n systems: a row that is clamped stays below zero, and
rows of a measure keep their stride. What the systems share, such as a contact, is a wide measure.
"""

import itertools
from dataclasses import replace
from functools import cached_property, partial
from typing import Generic, Self, cast

import numpy as np

from dpgcli.arrays import Array, Indices, total
from dpgcli.equilibrium.contracts import (
    Measure,
    Measured,
    Row,
    System,
    Term,
    WideMeasure,
    WideMeasured,
)
from dpgcli.records import dataclass


@dataclass(frozen=True)
class Joined(Generic[System]):
    """The coordinates of several systems of one size, interleaved."""

    parts: tuple[System, ...]

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return sum(part.size for part in self.parts)

    def _interleaved(self, values: list[Array]) -> Array:
        stacked = np.stack(np.broadcast_arrays(*values), axis=1)
        return stacked.reshape(len(stacked) * len(values), *stacked.shape[2:])

    @cached_property
    def force_unit(self) -> Array:
        """Those of the parts."""
        return self._interleaved([part.force_unit for part in self.parts])

    @cached_property
    def gradient_scale(self) -> Array:
        """Those of the parts."""
        return self._interleaved([part.gradient_scale for part in self.parts])

    @cached_property
    def stiffness_scale(self) -> Array:
        """Those of the parts."""
        return self._interleaved([part.stiffness_scale for part in self.parts])

    @cached_property
    def step_cap(self) -> Array:
        """Those of the parts."""
        return self._interleaved([part.step_cap for part in self.parts])

    def part_of(self, values: Array, part: int) -> Array:
        """What belongs to a part of an array (size, …)."""
        return values[part : self.size : len(self.parts)]

    def take_lanes(self, index: Indices) -> Self:
        """The same coordinates for some lanes of the batch."""
        return replace(self, parts=tuple(part.take_lanes(index) for part in self.parts))

    def moved(self, coordinates: Array, step: Array) -> Array:
        """As in each part."""
        moved = [
            part.moved(self.part_of(coordinates, p), self.part_of(step, p))
            for p, part in enumerate(self.parts)
        ]
        return self._interleaved(moved)


@dataclass(frozen=True)
class OfPart:
    """A measure by the coordinates of one of `n_parts`, interleaved in the first `size` rows.

    >>> from dpgcli.equilibrium.contracts import OwnCoordinate
    >>> second = OfPart(OwnCoordinate(Row(1, 0), 2), 1, 2, 4)
    >>> second.rows, second(np.arange(5.0)[:, None]).value.ravel().tolist()
    ((Row(stride=2, offset=1),), [1.0, 3.0])
    """

    measure: Measure
    part: int
    n_parts: int
    size: int

    @property
    def n_cells(self) -> int:
        """That of the measure."""
        return self.measure.n_cells

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """Those of the measure, among all coordinates."""
        n = self.n_parts
        return tuple(Row(n * row.stride, n * row.offset + self.part) for row in self.measure.rows)

    def __call__(self, coordinates: Array) -> Measured:
        """The measure."""
        return self.measure(coordinates[self.part : self.size : self.n_parts])

    def take_lanes(self, index: Indices) -> Self:
        """The same measure for some lanes of the batch."""
        return replace(self, measure=self.measure.take_lanes(index))


@dataclass(frozen=True)
class Together:
    """The cells of several measures, one after the other, by the first `size` coordinates.

    Places of one measure are none of another's.
    """

    measures: tuple[Measure | WideMeasure, ...]
    size: int

    @cached_property
    def n_cells(self) -> int:
        """All cells."""
        return sum(measure.n_cells for measure in self.measures)

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """All coordinates."""
        return tuple(Row(0, place) for place in range(self.size))

    def __call__(self, coordinates: Array) -> WideMeasured:
        """Every measure with its derivatives, (cell, batch)."""
        found = [_widened(measure, coordinates, self.size) for measure in self.measures]
        n_cells = np.cumsum([0, *(measure.n_cells for measure in self.measures)])
        value = np.concatenate([part.value for part in found])
        place = np.concatenate([p.place + n for p, n in zip(found, n_cells, strict=False)])
        gradient = np.concatenate([part.gradient for part in found], axis=1)

        def bent(force: Array) -> Array:
            parts = zip(found, n_cells, n_cells[1:], strict=False)
            return total(np.stack([part.bent(force[a:b]) for part, a, b in parts]))

        return WideMeasured(value, gradient, bent, place)

    def take_lanes(self, index: Indices) -> Self:
        """The same measures for some lanes of the batch."""
        return replace(self, measures=tuple(m.take_lanes(index) for m in self.measures))


def _widened(measure: Measure | WideMeasure, coordinates: Array, size: int) -> WideMeasured:
    """A measure as one by the first `size` coordinates."""
    found, batch = measure(coordinates), coordinates.shape[1]
    gradient = np.zeros((size, measure.n_cells, batch))
    if isinstance(found, WideMeasured):
        rows = np.array([row.offset for row in measure.rows])
        gradient[rows] = found.gradient

        def bent(force: Array) -> Array:
            whole = np.zeros((size, size, batch))
            whole[rows[:, None], rows] = found.bent(force)
            return whole

        return WideMeasured(found.value, gradient, bent, found.place)
    cells = np.arange(measure.n_cells)
    placed = [row.offset + row.stride * cells for row in measure.rows]
    slopes = found.gradient or (np.ones((1, 1)),)
    for rows, slope in zip(placed, slopes, strict=True):
        is_there = rows >= 0
        own = np.broadcast_to(slope, found.value.shape)
        gradient[rows[is_there], cells[is_there]] += own[is_there]
    place = np.broadcast_to(cells[:, None], found.value.shape)
    return WideMeasured(found.value, gradient, partial(_bent, found, placed, size), place)


def _bent(found: Measured, placed: list[Indices], size: int, force: Array) -> Array:
    """Σ F ∇²q of a measure whose coordinates are at these rows, (row, row, batch)."""
    whole = np.zeros((size, size, force.shape[1]))
    for first, second in itertools.combinations_with_replacement(range(len(placed)), 2):
        bend = np.zeros_like(force)
        if found.outer is not None:
            vector = found.outer.vector
            bend = found.outer.weight * vector[first] * vector[second]
        if (first, second) in found.entries:
            bend = bend + found.entries[first, second]
        bend = force * bend
        if not bend.any():
            continue
        rows, columns = placed[first], placed[second]
        is_there = np.flatnonzero((rows >= 0) & (columns >= 0))
        at, to = rows[is_there], columns[is_there]
        whole[at, to] += bend[is_there]
        if first != second:
            whole[to, at] += bend[is_there]
    return whole


def terms_of_part(terms: tuple[Term, ...], part: int, n_parts: int, size: int) -> tuple[Term, ...]:
    """The terms of one of several parts, interleaved in the first `size` rows; none is wide."""
    narrow = ((term, cast("Measure", term.measure)) for term in terms)
    return tuple(
        Term(term.kind, OfPart(measure, part, n_parts, size), term.law) for term, measure in narrow
    )
