"""The parts of an energy: measures (scalars of a shape), laws and coordinates; terms add up.

A term is a measure times a law. The measure gives a scalar q for each of its cells, with ∇q
and ∇²q by the few coordinates that q depends on; the law gives energy, force and stiffness of
that scalar. Neither knows the other, nor the solver either of them. What a scene does not
need is no term, rather than one that is multiplied by zero.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol, Self, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Indices
from dpgcli.records import dataclass

Pair = tuple[int, int]
LaneArray = TypeVar("LaneArray", bound=NDArray[Any])


class Response(NamedTuple):
    """Energy E(q) of a law, its first and its second derivative by q; arrays like q's."""

    energy: Array
    force: Array
    stiffness: Array


class Row(NamedTuple):
    """The rows of one of a measure's coordinates: for cell c, row `offset + stride · c`.

    With a negative offset the first cell has none: its coordinate is clamped.
    """

    stride: int
    offset: int


class Outer(NamedTuple):
    """A part w v vᵀ of ∇²q: the weight (cell, batch) and v by the measure's coordinates."""

    weight: Array
    vector: tuple[Array, ...]


class Measured(NamedTuple):
    """A scalar q of every cell, (cell, batch), and its derivatives by the measure's coordinates.

    `gradient` has one array for each of the coordinates; ∇²q is the sum of `outer`, if there is
    one, and of single entries by pairs of coordinates (first ≤ second; each stands for its mirror
    image as well). A measure that is a coordinate itself has a gradient of 1: then `gradient` is
    empty.
    """

    value: Array
    gradient: tuple[Array, ...] = ()
    outer: Outer | None = None
    entries: Mapping[Pair, Array] = MappingProxyType({})


class Measure(Protocol):
    """A scalar of a shape, q, in some coordinates: one for each of `n_cells` cells.

    `rows` says by which coordinates it is, from the lowest row to the highest.
    """

    @property
    def n_cells(self) -> int: ...
    @property
    def rows(self) -> tuple[Row, ...]: ...

    def __call__(self, coordinates: Array) -> Measured:
        """q and its derivatives at coordinates of shape (size, batch)."""

    def take_lanes(self, index: Indices) -> Self:
        """The same measure for some lanes of the batch."""


class WideMeasured(NamedTuple):
    """Scalars that depend on many coordinates, all cells on the same.

    `value` (cell, batch), `gradient` (row, cell, batch); `bent` gives Σ F ∇²q over cells, (row,
    row, batch), for forces F (cell, batch). `place` (cell, batch) numbers the places of a shape
    where q is measured: cells of one place have the same q.
    """

    value: Array
    gradient: Array
    bent: Callable[[Array], Array]
    place: Indices


class WideMeasure(Protocol):
    """A measure each of whose cells depends on the same many coordinates: rows of stride 0."""

    @property
    def n_cells(self) -> int: ...
    @property
    def rows(self) -> tuple[Row, ...]: ...

    def __call__(self, coordinates: Array) -> WideMeasured:
        """q and its derivatives at coordinates of shape (size, batch)."""

    def take_lanes(self, index: Indices) -> Self:
        """The same measure for some lanes of the batch."""


class ScalarLaw(Protocol):
    """A scalar's energy, with the constants of every cell and lane."""

    def __call__(self, scalar: Array) -> Response:
        """Energy, force and stiffness at q, (cell, batch)."""

    def take_lanes(self, index: Indices) -> Self:
        """The same law for some lanes of the batch."""


@dataclass(frozen=True)
class Term:
    """A measure under a law, Σ E(q) over cells; energies are listed by `kind`.

    >>> from dpgcli.mechanics.terms import Quadratic
    >>> spring = Term("spring", OwnCoordinate(Row(1, 0), 1), Quadratic(np.array([[3.0]])))
    >>> float(spring.law(spring.measure(np.array([[2.0]])).value).energy[0, 0])  # ½ k q²
    6.0
    """

    kind: str
    measure: Measure | WideMeasure
    law: ScalarLaw

    def take_lanes(self, index: Indices) -> "Term":
        """The same term for some lanes of the batch."""
        return Term(self.kind, self.measure.take_lanes(index), self.law.take_lanes(index))


@dataclass(frozen=True)
class OwnCoordinate:
    """The measure that is one of the coordinates themselves, in each of some cells."""

    row: Row
    n_cells: int

    @property
    def rows(self) -> tuple[Row, ...]:
        """The one coordinate."""
        return (self.row,)

    def __call__(self, coordinates: Array) -> Measured:
        """The coordinate, a view."""
        return Measured(coordinates[self.row.offset :: self.row.stride][: self.n_cells])

    def take_lanes(self, index: Indices) -> Self:
        """Itself: nothing in it is by lane."""
        return self


class Coordinates(Protocol):
    """A system of coordinates (size, batch): number, scales, and the update by a step.

    `force_unit` (size, batch or 1) turns a component of the gradient into a force in N: 1 for a
    length, a lever for an angle. `gradient_scale` is the force in play at each coordinate, in the
    gradient's own unit, `stiffness_scale` the stiffness that a coordinate's curvature is measured
    by, and `step_cap` the largest change of a coordinate that one step may make.
    """

    @property
    def size(self) -> int: ...
    @property
    def force_unit(self) -> Array: ...
    @property
    def gradient_scale(self) -> Array: ...
    @property
    def stiffness_scale(self) -> Array: ...
    @property
    def step_cap(self) -> Array: ...

    def take_lanes(self, index: Indices) -> Self:
        """The same coordinates for some lanes of the batch."""

    def moved(self, coordinates: Array, step: Array) -> Array:
        """The coordinates after a step: their sum, or a curved update that strains bars less."""


System = TypeVar("System", bound=Coordinates, covariant=True)


def take_lanes(values: LaneArray, index: Indices) -> LaneArray:
    """The lanes of an array (…, batch) at `index`; an array with one lane for all stays.

    >>> take_lanes(np.array([[1.0, 2.0, 3.0]]), np.array([2, 0]))
    array([[3., 1.]])
    """
    return values if values.shape[-1] == 1 else cast("LaneArray", np.take(values, index, axis=-1))
