"""Walls that give way under a dome's push: one more coordinate for each unit.

The chambers' walls yield by w = c_w P under a push P. In series with the dome,
E = E_dome(x + w) + w²/(2 c_w) with x the opening that the lattice sees. The coordinate is
v = w/r with r = √(c_w k_b), in mm: E = E_dome(x + r v) + ½ k_b v². So nothing is divided by c_w,
and a unit whose walls are rigid keeps v = 0 by itself (our derivation).

Any system of coordinates takes walls: v comes first among the coordinates of its unit, and the
measures of the others only see their rows moved.
"""

from dataclasses import replace
from functools import cached_property
from typing import Self

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.equilibrium.contracts import (
    Measure,
    Measured,
    Outer,
    OwnCoordinate,
    Row,
    take_lanes,
)
from dpgcli.mechanics.coordinates import FingerCoordinates, Internal, Springs, Stations
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass


@dataclass(frozen=True)
class Beside:
    """A measure in coordinates among which walls have theirs: `width` others for each unit."""

    measure: Measure
    width: int

    @property
    def n_cells(self) -> int:
        """That of the measure."""
        return self.measure.n_cells

    @property
    def rows(self) -> tuple[Row, ...]:
        """Rows moved: every unit has one more before its own."""
        return tuple(self._moved(row) for row in self.measure.rows)

    def _moved(self, row: Row) -> Row:
        units, rest = divmod(row.offset, self.width)
        stride = row.stride // self.width * (self.width + 1) if self.n_cells > 1 else row.stride
        return Row(stride, units * (self.width + 1) + rest + 1)

    def __call__(self, coordinates: Array) -> Measured:
        """The measure, by the coordinates that are not walls'."""
        return self.measure(without_walls(coordinates, self.width))

    def take_lanes(self, index: Indices) -> Self:
        """The same measure for some lanes of the batch."""
        return replace(self, measure=self.measure.take_lanes(index))


@dataclass(frozen=True)
class DomeExtension:
    """Extension of every dome's own spring, x + r v in mm: the opening and what the wall yields."""

    opening: Beside
    ratio: Array

    @property
    def n_cells(self) -> int:
        """One for each unit."""
        return self.opening.n_cells

    @property
    def _place(self) -> int:
        """How many rows of the opening stand before the wall's: those of the unit before."""
        return sum(row.offset < 0 for row in self.opening.rows)

    @property
    def rows(self) -> tuple[Row, ...]:
        """Those of the opening, and the wall's own."""
        rows, place = self.opening.rows, self._place
        return (*rows[:place], Row(self.opening.width + 1, 0), *rows[place:])

    def __call__(self, coordinates: Array) -> Measured:
        """x + r v with its derivatives, (unit, batch): only x bends."""
        opening, place = self.opening(coordinates), self._place
        yielded = self.ratio * coordinates[0 :: self.opening.width + 1]
        slope = np.broadcast_to(self.ratio, opening.value.shape)
        gradient = (*opening.gradient[:place], slope, *opening.gradient[place:])
        outer = opening.outer
        if outer is not None:
            still = np.zeros((1, 1))
            outer = Outer(outer.weight, (*outer.vector[:place], still, *outer.vector[place:]))
        entries = {
            (p + (p >= place), q + (q >= place)): entry for (p, q), entry in opening.entries.items()
        }
        return Measured(opening.value + yielded, gradient, outer, entries)

    def take_lanes(self, index: Indices) -> Self:
        """The same measure for some lanes of the batch."""
        ratio = take_lanes(self.ratio, index)
        return replace(self, opening=self.opening.take_lanes(index), ratio=ratio)


def without_walls(values: Array, width: int) -> Array:
    """Rows of an array (size, …) that are not walls', `width` for each unit.

    >>> without_walls(np.array([[9.0], [1.0], [2.0], [9.0], [3.0], [4.0]]), 2).ravel()
    array([1., 2., 3., 4.])
    """
    n_units = len(values) // (width + 1)  # told, as the batch may be empty
    by_unit = values.reshape(n_units, width + 1, *values.shape[1:])
    return by_unit[:, 1:].reshape(n_units * width, *values.shape[1:])


def with_walls(walls: Array, others: Array, width: int) -> Array:
    """Rows of walls (unit, …) before those of the others, `width` for each unit.

    >>> others = np.array([[1.0], [2.0], [3.0], [4.0]])
    >>> with_walls(np.zeros((2, 1)), others, 2).ravel()
    array([0., 1., 2., 0., 3., 4.])
    """
    n_units = len(others) // width  # told, as the batch may be empty
    by_unit = others.reshape(n_units, width, *others.shape[1:])
    walls = np.broadcast_to(walls, by_unit[:, 0].shape)[:, None]
    rows = np.concatenate((walls, by_unit), axis=1)
    return rows.reshape(n_units * (width + 1), *others.shape[1:])


@dataclass(frozen=True)
class Walled:
    """Coordinates of a finger with walls: those of `frame`, without them, and a v for each unit."""

    frame: FingerCoordinates

    @property
    def finger(self) -> Finger:
        """The finger, walls and all."""
        return self.frame.finger

    @property
    def width(self) -> int:
        """Coordinates of a unit besides its wall's."""
        return self.frame.size // self.finger.n_units

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return self.frame.size + self.finger.n_units

    def _beside(self, measure: Measure) -> Beside:
        return Beside(measure, self.width)

    def _seen(self, measure: Measure) -> Measure:
        """A measure among walls: one of the coordinates stays one."""
        beside = self._beside(measure)
        own = isinstance(measure, OwnCoordinate)
        return OwnCoordinate(beside.rows[0], measure.n_cells) if own else beside

    @cached_property
    def opening(self) -> Beside:
        """Extension x between a unit's tops, mm."""
        return self._beside(self.frame.opening)

    @cached_property
    def dome(self) -> DomeExtension:
        """Extension x + w of every dome's spring, mm."""
        return DomeExtension(self.opening, self.finger.wall_ratio)

    @property
    def walls(self) -> tuple[OwnCoordinate]:
        """The coordinate v of every wall, mm."""
        return (OwnCoordinate(Row(self.width + 1, 0), self.finger.n_units),)

    @property
    def corners(self) -> tuple[Measure, Measure]:
        """Those of the frame."""
        near, far = self.frame.corners
        return self._seen(near), self._seen(far)

    @property
    def bars(self) -> tuple[Measure, ...]:
        """Those of the frame."""
        return tuple(map(self._seen, self.frame.bars))

    def position(self, axis: int) -> Measure:
        """The tip's x (axis 0) or y (axis 1), mm."""
        return self._beside(self.frame.position(axis))

    def center(self, axis: int, shares: Array) -> Measure:
        """The x or y of the center of the tops by their shares, mm."""
        return self._beside(self.frame.center(axis, shares))

    def _with(self, walls: Array, others: Array) -> Array:
        walls, lanes = np.broadcast_arrays(walls, np.empty((1, others.shape[1])))
        others = np.broadcast_to(others, (len(others), lanes.shape[1]))
        return with_walls(walls, others, self.width)

    @cached_property
    def force_unit(self) -> Array:
        """1 + r for walls: the gradient by v is r times a force where walls are soft."""
        return self._with(1.0 + self.finger.wall_ratio, self.frame.force_unit)

    @cached_property
    def gradient_scale(self) -> Array:
        """Forces in play; of walls (1 + r) times the unit's, N."""
        own = (1.0 + self.finger.wall_ratio) * self.finger.force_scale
        return self._with(own, self.frame.gradient_scale)

    @cached_property
    def stiffness_scale(self) -> Array:
        """k_b (1 + r²) for walls, N/mm: the wall's own stiffness and the dome's."""
        own = self.finger.bistable_stiffness * (1.0 + self.finger.wall_ratio**2)
        return self._with(own, self.frame.stiffness_scale)

    @cached_property
    def step_cap(self) -> Array:
        """0.2 d of the dome's extension, and of v, mm."""
        own = 0.2 * self.finger.stroke / np.maximum(self.finger.wall_ratio, 1.0)
        return self._with(own, self.frame.step_cap)

    def take_lanes(self, index: Indices) -> "Walled":
        """The same coordinates for some lanes of the batch."""
        return Walled(self.frame.take_lanes(index))

    def moved(self, coordinates: Array, step: Array) -> Array:
        """As in the frame; v goes straight."""
        others = self.frame.moved(self.without_walls(coordinates), self.without_walls(step))
        step_of_walls = step[0 :: self.width + 1]
        return with_walls(coordinates[0 :: self.width + 1] + step_of_walls, others, self.width)

    def of_shape(self, shape: Internal) -> Array:
        """The coordinates of a shape, v from what each wall yields, (size, batch)."""
        ratio = self.finger.wall_ratio
        safe = np.where(ratio > 0.0, ratio, 1.0)
        walls = np.where(ratio > 0.0, shape.wall / safe, 0.0)
        others = self.frame.of_shape(shape)
        walls = np.broadcast_to(walls, np.broadcast_shapes(walls.shape, (1, others.shape[1])))
        others = np.broadcast_to(others, (len(others), walls.shape[1]))
        return with_walls(walls, others, self.width)

    def without_walls(self, values: Array) -> Array:
        """Rows of the frame's coordinates."""
        return without_walls(values, self.width)

    def openings(self, coordinates: Array) -> Array:
        """Openings x that the lattice sees, mm, (unit, batch)."""
        return self.frame.openings(self.without_walls(coordinates))

    def yielded(self, coordinates: Array) -> Array:
        """How far each wall gives way, w = r v, mm, (unit, batch)."""
        return np.asarray(self.finger.wall_ratio * coordinates[0 :: self.width + 1])

    def springs(self, coordinates: Array) -> Springs:
        """Extensions x + w of the domes; shapes and levers are the frame's."""
        springs = self.frame.springs(self.without_walls(coordinates))
        return springs._replace(extension=springs.extension + self.yielded(coordinates))

    def corner_moments(self, coordinates: Array, gradient: Array) -> Array:
        """Those of the frame: a wall turns nothing."""
        return self.frame.corner_moments(
            self.without_walls(coordinates), self.without_walls(gradient)
        )

    def stations(self, coordinates: Array) -> Stations:
        """Those of the frame."""
        return self.frame.stations(self.without_walls(coordinates))

    def tip(self, coordinates: Array) -> tuple[Array, Array]:
        """That of the frame; no wall moves it by itself."""
        pose, jacobian = self.frame.tip(self.without_walls(coordinates))
        return pose, with_walls(np.zeros((1, 1, 1)), jacobian, self.width)

    def station_jacobian(self, coordinates: Array) -> Array:
        """That of the frame; no wall moves a node by itself."""
        jacobian = self.frame.station_jacobian(self.without_walls(coordinates))
        return with_walls(np.zeros((1, 1, 1)), jacobian, self.width)
