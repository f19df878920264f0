"""The potential: coordinates and the terms handed to it, assembled into gradient and Hessian."""

from functools import cache, cached_property
from typing import Generic

import numpy as np

from dpgcli.arrays import Array, Indices, acting, total
from dpgcli.equilibrium.contracts import (
    Measured,
    Response,
    Row,
    System,
    Term,
    WideMeasured,
)
from dpgcli.records import dataclass

RowsOfCells = tuple[tuple[tuple[Row, ...], int], ...]  # rows and number of cells of each measure


@dataclass(frozen=True)
class Evaluation:
    """An energy with its derivatives: `energies` term by term, each of shape (batch,).

    `gradient` has the shape (size, batch), `hessian` is a band of `equilibrium.banded`.
    """

    energies: tuple[Array, ...]
    gradient: Array
    hessian: Array

    @property
    def energy(self) -> Array:
        """The sum over terms, (batch,)."""
        first, *rest = self.energies
        return sum(rest, start=first)


@dataclass(frozen=True)
class Potential(Generic[System]):
    """A sum of terms over one system of coordinates.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.terms import chain_potential
    >>> potential = chain_potential(uniform_finger(2, **STUDY))
    >>> potential.kinds, potential.column_depths
    (('bistable', 'hinge'), (1, 0, 1, 0))
    >>> float(potential.evaluate(np.zeros((4, 1))).energy[0])  # mJ, of the straight finger
    0.0
    """

    coordinates: System
    terms: tuple[Term, ...]

    @cached_property
    def column_depths(self) -> tuple[int, ...]:
        """The depth to which each column of the Hessian, and of L, may be nonzero."""
        cells = tuple((term.measure.rows, term.measure.n_cells) for term in self.terms)
        return _column_depths(self.coordinates.size, cells)

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of its terms, each once."""
        return tuple(dict.fromkeys(term.kind for term in self.terms))

    def is_separable(self, shared: slice) -> bool:
        """Whether it is the sum of two potentials that share the coordinates in these rows only.

        No term then couples a coordinate before these rows with one behind them.

        >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
        >>> from dpgcli.mechanics.terms import chain_potential
        >>> chain = chain_potential(uniform_finger(2, **STUDY, linear_stiffness=1e4))
        >>> chain.is_separable(slice(3, 4)), chain.is_separable(slice(2, 3))
        (True, False)

        RowsOfCells share their struts (row 3 is s_1), but not their corners (row 2 is b_1).
        """
        return not any(
            min(rows) < shared.start and max(rows) >= shared.stop
            for term in self.terms
            for rows in _rows_by_cell(term.measure.rows, term.measure.n_cells)
        )

    def take_lanes(self, index: Indices) -> "Potential[System]":
        """The same potential for some lanes of the batch."""
        taken = tuple(term.take_lanes(index) for term in self.terms)
        return Potential(self.coordinates.take_lanes(index), taken)

    def evaluate(self, coordinates: Array) -> Evaluation:
        """Σ E, Σ F ∇q and Σ K ∇q ∇qᵀ + F ∇²q over terms at `coordinates`, shape (size, batch).

        Complex coordinates are allowed: the derivatives by complex steps need them.
        """
        gradient = np.zeros_like(coordinates)
        bandwidth = max(self.column_depths)
        hessian = np.zeros((bandwidth + 1, *coordinates.shape), coordinates.dtype)
        energies = []
        for term in self.terms:
            measured = term.measure(coordinates)
            response = term.law(measured.value)
            energies.append(total(response.energy))
            assemble(term.measure.rows, measured, response, gradient, hessian)
        return Evaluation(tuple(energies), gradient, hessian)

    def by_kind(self, energies: tuple[Array, ...]) -> dict[str, Array]:
        """Energies of the terms, (batch,) each, added up by kind."""
        added: dict[str, Array] = {}
        for term, energy in zip(self.terms, energies, strict=True):
            added[term.kind] = added[term.kind] + energy if term.kind in added else energy
        return added


def assemble(
    rows: tuple[Row, ...],
    q: Measured | WideMeasured,
    response: Response,
    gradient: Array,
    hessian: Array,
) -> None:
    """Add F ∇q to the gradient and K ∇q ∇qᵀ + F ∇²q to the band of the Hessian."""
    if isinstance(q, WideMeasured):
        _assemble_wide(rows, q, response, gradient, hessian)
        return
    if not q.gradient:
        add(gradient, rows[0], response.force)
        add(hessian[0], rows[0], np.broadcast_to(response.stiffness, response.force.shape))
        return
    force = response.force
    if q.outer is None and not response.stiffness.any():
        _assemble_load(rows, q, force, gradient, hessian)
        return
    stiff = [response.stiffness * slope for slope in q.gradient]
    across, turned = q.outer.vector if q.outer else (), []
    if q.outer:
        tension = force * q.outer.weight
        turned = [tension * component for component in across]
    entry, part = np.empty_like(force), np.empty_like(force)
    for first, slope in enumerate(q.gradient):
        add(gradient, rows[first], np.multiply(force, slope, out=entry))
        for second in range(first, len(rows)):
            depth = rows[second].offset - rows[first].offset
            if depth >= len(hessian):
                continue  # between clamped nodes of a single unit
            np.multiply(stiff[first], q.gradient[second], out=entry)
            if turned:
                entry += np.multiply(turned[first], across[second], out=part)
            if (first, second) in q.entries:
                entry += np.multiply(force, q.entries[first, second], out=part)
            add(hessian[depth], rows[first], entry)


def _assemble_wide(
    rows: tuple[Row, ...], q: WideMeasured, response: Response, gradient: Array, hessian: Array
) -> None:
    """The same for all cells at once: each has all rows."""
    first, second, low, depth = _pairs(places := tuple(row.offset for row in rows))
    gradient[list(places)] += widely(q, response.force)
    bend = q.bent(response.force)[first, second]
    cells, lanes = acting(response.stiffness), np.arange(gradient.shape[1])
    stiffness, slopes = response.stiffness[cells, lanes], q.gradient[:, cells, lanes]
    stiff = stiffness * slopes
    for k in range(len(cells)):
        bend += stiff[first, k] * slopes[second, k]
    hessian[depth, low] += bend


@cache  # the same few for every batch
def _pairs(places: tuple[int, ...]) -> tuple[Indices, Indices, Indices, Indices]:
    """All pairs of places by their numbers, and where a band has each: column and depth."""
    first, second = np.triu_indices(len(places))
    own, other = np.array(places)[first], np.array(places)[second]
    return first, second, np.minimum(own, other), np.abs(other - own)


def widely(q: WideMeasured, weights: Array) -> Array:
    """Σ w ∇q over cells, (row, batch), for weights (cell, batch)."""
    return total(np.moveaxis(q.gradient * weights, 1, 0))


def _assemble_load(
    rows: tuple[Row, ...], q: Measured, force: Array, gradient: Array, hessian: Array
) -> None:
    """The same of a law without stiffness: only what bends counts."""
    for row, slope in zip(rows, q.gradient, strict=True):
        add(gradient, row, force * slope)
    for (first, second), bend in q.entries.items():
        depth = rows[second].offset - rows[first].offset
        if depth < len(hessian):
            add(hessian[depth], rows[first], force * bend)


def add(target: Array, row: Row, values: Array) -> None:
    """Add one value per cell, (cell, batch), to a row each; a clamped cell has none."""
    first, stride = row.offset, row.stride
    if first < 0:
        first, values = first + stride, values[1:]
    rows = target[first : first + stride * len(values) : stride]
    rows += values


def _rows_by_cell(rows: tuple[Row, ...], n_cells: int) -> list[list[int]]:
    placed = [[row.offset + row.stride * cell for row in rows] for cell in range(n_cells)]
    return [[row for row in cell if row >= 0] for cell in placed]


@cache  # the same few for every batch
def _column_depths(size: int, cells: RowsOfCells) -> tuple[int, ...]:
    """Depths of the Hessian's columns: the maximum over terms, and the fill-in of elimination."""
    depths = [0] * size
    for rows, n_cells in cells:
        for placed in _rows_by_cell(rows, n_cells):
            for row in placed:
                depths[row] = max(depths[row], max(placed) - row)
    for column in range(size):
        for below in range(1, depths[column] + 1):
            depths[column + below] = max(depths[column + below], depths[column] - below)
    return tuple(depths)
