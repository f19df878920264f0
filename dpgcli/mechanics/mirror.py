"""Gaps between the two fingers of a gripper, whose frames are mirror images of each other.

Fingers that stay mirror images meet in the axis: the gap of a node of the face is its height over
it. Others meet where a node of one comes to a side of the other: such gaps are those of `gaps` to
points that move. A point c = S F is the mirror image of the other finger's node F in the axis, so
that beside what `gaps` says, ∇g has S m and τ has S t at F (our derivation).
"""

from dataclasses import replace
from functools import cached_property
from typing import Protocol, Self

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, total
from dpgcli.equilibrium.contracts import Row, WideMeasured, take_lanes
from dpgcli.mechanics.face import Face, FaceShape
from dpgcli.mechanics.gaps import (
    FAR,
    Nearest,
    Touches,
    bent_by,
    moves_of,
    nearest,
    one_at,
    slipping,
    turns_of,
)
from dpgcli.records import dataclass


@dataclass(frozen=True)
class Axis:
    """A line in a finger's frame: n · F + o is the height of F over it, mm.

    `normal` n (2, 1 or batch) has no dimension, `offset` o is (1 or batch,).

    >>> axis = Axis(np.array([[0.0], [1.0]]), np.array([30.0]))  # 30 mm below the finger's base
    >>> point = np.array([[40.0], [-25.0]])
    >>> axis.height(point).tolist(), axis.mirrored(point).ravel().tolist()
    ([5.0], [40.0, -35.0])
    """

    normal: Array
    offset: Array

    def _beside(self, points: Array) -> Array:
        """n as one of points, (2, …, batch)."""
        return self.normal.reshape(2, *(1 for _ in points.shape[1:-1]), -1)

    def height(self, points: Array) -> Array:
        """Heights of points, (2, …, batch)."""
        return total(self._beside(points) * points) + self.offset

    def turned(self, ways: Array) -> Array:
        """Mirror images of directions, (2, …, batch)."""
        normal = self._beside(ways)
        return ways - 2.0 * total(normal * ways) * normal

    def mirrored(self, points: Array) -> Array:
        """Mirror images of points, (2, …, batch)."""
        return points - 2.0 * self.height(points) * self._beside(points)

    def take_lanes(self, index: Indices) -> Self:
        """That of some lanes."""
        return type(self)(take_lanes(self.normal, index), take_lanes(self.offset, index))


@dataclass(frozen=True)
class Heights:
    """Heights of the nodes of a face over a line, from the first one that moves: gaps to it."""

    face: Face
    axis: Axis

    @property
    def n_cells(self) -> int:
        """One for each node, but the clamped one."""
        return self.face.n_sides

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """All corners and chords."""
        return tuple(Row(0, int(place)) for place in self.face.places)

    @cached_property
    def phalanges(self) -> Indices:
        """The phalanx that each node ends, the first is 0, (cell,)."""
        return np.minimum(np.arange(self.n_cells), self.face.n_units - 1)

    def __call__(self, coordinates: Array) -> WideMeasured:
        """Heights with their derivatives, (cell, batch)."""
        shape = self.face.shape(coordinates)
        value = self.axis.height(shape.nodes)[1:]
        gradient = shape.pulled(self._pushes(shape))

        def bent(force: Array) -> Array:
            clamped = np.zeros((1, force.shape[1]))
            return shape.bent(self.axis.normal[:, None] * np.concatenate((clamped, force)))

        place = np.broadcast_to(np.arange(self.n_cells)[:, None], value.shape)
        return WideMeasured(value, gradient, bent, place)

    def _pushes(self, shape: FaceShape) -> Array:
        """The forces on nodes that make ∇g, (2, node, cell, batch)."""
        _, n_nodes, batch = shape.nodes.shape
        forces = np.zeros((2, n_nodes, n_nodes - 1, batch))
        cells = np.arange(n_nodes - 1)
        forces[:, cells + 1, cells] = self.axis.normal[:, None]
        return forces

    def touches(self, coordinates: Array) -> Touches:
        """Where the line would be touched in each cell, and which way: (2, cell, batch)."""
        places = self.face.shape(coordinates).nodes[:, 1:]
        return Touches(places, np.broadcast_to(-self.axis.normal[:, None], places.shape))

    def with_first(self, first: Flags | None) -> Self:
        """Itself: each place has one gap."""
        return self

    def take_lanes(self, index: Indices) -> Self:
        """The same for some lanes of the batch."""
        return type(self)(self.face.take_lanes(index), self.axis.take_lanes(index))


@dataclass(frozen=True)
class NodeGaps:
    """Gaps of the sides of a `face` to the nodes of the `other` finger's.

    Cell by cell all sides for the first node, then the next; both by the first `size` coordinates.
    Nodes behind a side by more than the `reach` (batch,), mm, are beyond the finger. Two nodes have
    one distance: unless it `has_corners` those next to a corner are far away. `first` as in
    `FaceGaps`.
    """

    face: Face
    other: Face
    axis: Axis
    size: int
    reach: Array
    has_corners: bool
    first: Flags | None = None

    @property
    def n_cells(self) -> int:
        """One for each side and node."""
        return self.face.n_sides * (self.other.n_sides + 1)

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """All coordinates."""
        return tuple(Row(0, place) for place in range(self.size))

    @cached_property
    def phalanges(self) -> Indices:
        """The phalanx that the side of each cell is on, the first is 0, (cell,)."""
        sides = np.minimum(np.arange(self.face.n_sides), self.face.n_units - 1)
        return np.tile(sides, self.other.n_sides + 1)

    @cached_property
    def nodes(self) -> Indices:
        """The other's node in each cell, (cell,)."""
        return np.repeat(np.arange(self.other.n_sides + 1), self.face.n_sides)

    def _nearest(self, shape: FaceShape, others: FaceShape) -> Nearest:
        return nearest(shape, self.axis.mirrored(others.nodes), has_end=True)

    def __call__(self, coordinates: Array) -> WideMeasured:
        """g with its derivatives, (cell, batch)."""
        shape, others = self.face.shape(coordinates), self.other.shape(coordinates)
        near = self._nearest(shape, others)
        batch, n = coordinates.shape[1], self.n_cells
        place = near.place + self.face.n_sides * np.arange(n // self.face.n_sides)[:, None, None]
        place = place.reshape(n, batch)
        is_far = near.distance < -self.reach
        if not self.has_corners:
            is_far = is_far | near.is_corner
        own = np.where(is_far, FAR, near.distance).reshape(n, batch)
        value = np.take_along_axis(own, place, axis=0)
        if self.first is not None:
            value = np.where(one_at(place, self.first), value, FAR)
        moved = moves_of(shape, near)
        pull = self._pull(others)
        normal = self.axis.turned(near.normal.reshape(2, n, batch))
        slope = np.zeros((self.size, n, batch))
        slope[self.face.places] = moved.slope
        slope[self.other.places] += total(normal[:, None] * pull)
        gradient = np.take_along_axis(slope, place[None], axis=1)
        gradient = np.where(value < FAR, gradient, 0.0)

        def bent(force: Array) -> Array:
            by_place = np.zeros((n, batch))
            np.add.at(by_place, (place, np.arange(batch)), force)
            result = np.zeros((self.size, self.size, batch))
            rows, columns = self.face.places, self.other.places
            result[rows[:, None], rows] = bent_by(shape, near, moved, by_place)
            pushed = (normal * by_place).reshape(2, -1, self.face.n_sides, batch)
            result[columns[:, None], columns] += others.bent(pushed.sum(axis=2))
            mixed, own = self._mixed(shape, near, pull, by_place)
            result[rows[:, None], columns] += mixed
            result[columns[:, None], rows] += np.swapaxes(mixed, 0, 1)
            result[columns[:, None], columns] += own
            return result

        return WideMeasured(value, gradient, bent, place)

    def _pull(self, others: FaceShape) -> Array:
        """How the other's node of each cell moves, ∂F along x and y: (2, row, cell, batch)."""
        _, n, batch = others.nodes.shape
        forces = np.zeros((2, n, 2, n, batch))
        axes, nodes = np.arange(2)[:, None], np.arange(n)
        forces[axes, nodes, axes, nodes] = 1.0
        pulled = others.pulled(forces.reshape(2, n, 2 * n, batch))
        by_axis = pulled.reshape(len(pulled), 2, n, batch)
        return np.moveaxis(by_axis, 1, 0)[:, :, self.nodes]

    def _mixed(
        self, shape: FaceShape, near: Nearest, pull: Array, force: Array
    ) -> tuple[Array, Array]:
        """Σ F ∇²g by a face's row and one of the other's, and by two of the other's that is new."""
        batch = force.shape[1]
        along = self.axis.turned(near.along.reshape(2, self.n_cells, batch))
        distance, is_corner = (part.reshape(-1, batch) for part in (near.distance, near.is_corner))
        safe = np.where(distance != 0.0, distance, 1.0)
        around = np.where(is_corner & (distance != 0.0), force / safe, 0.0)
        n_rows, n_columns = len(self.face.places), len(self.other.places)
        mixed, own = np.zeros((n_rows, n_columns, batch)), np.zeros((n_columns, n_columns, batch))
        cells = np.flatnonzero(force.any(axis=1))
        turn, slide = turns_of(shape, near, cells[:, None])
        for place, cell in enumerate(cells):
            tau = total(along[:, None, cell] * pull[:, :, cell])
            by_side = force[cell] * turn[:, place] + around[cell] * slide[:, place]
            mixed += by_side[:, None] * tau
            own += (around[cell] * tau)[:, None] * tau
        return mixed, own

    def touches(self, coordinates: Array) -> Touches:
        """Where nodes touch, in the face's frame, and which way they are pushed."""
        shape, others = self.face.shape(coordinates), self.other.shape(coordinates)
        near = self._nearest(shape, others)
        places = self.axis.mirrored(others.nodes)[:, self.nodes]
        return Touches(places, near.normal.reshape(places.shape))

    def are_slipping(self, coordinates: Array, bound: Array) -> Flags:
        """Whether a node slips over the end of the finger, (batch,): level with it, and behind."""
        shape, others = self.face.shape(coordinates), self.other.shape(coordinates)
        return slipping(shape.nodes, self.axis.mirrored(others.nodes), self.reach)

    def with_first(self, first: Flags | None) -> Self:
        """The same, but only one gap at each place."""
        return replace(self, first=first)

    def take_lanes(self, index: Indices) -> Self:
        """The same gaps for some lanes of the batch."""
        face, other = self.face.take_lanes(index), self.other.take_lanes(index)
        axis, reach = self.axis.take_lanes(index), take_lanes(self.reach, index)
        first = None if self.first is None else take_lanes(self.first, index)
        return replace(self, face=face, other=other, axis=axis, reach=reach, first=first)


class Touching(Protocol):
    """What a finger may touch, cell by cell."""

    @property
    def phalanges(self) -> Indices: ...

    def touches(self, coordinates: Array) -> Touches:
        """Where it would be touched in the finger's frame, and which way: (2, cell, batch)."""


@dataclass(frozen=True)
class OfNodes:
    """The same touches, as those of the finger whose nodes they are."""

    gaps: NodeGaps

    @property
    def phalanges(self) -> Indices:
        """The phalanx that the node of each cell ends, the first is 0, (cell,)."""
        return np.clip(self.gaps.nodes - 1, 0, self.gaps.other.n_units - 1)

    def touches(self, coordinates: Array) -> Touches:
        """Where the nodes are, in their finger's frame, and which way they push."""
        places, ways = self.gaps.touches(coordinates)
        return Touches(self.gaps.axis.mirrored(places), -self.gaps.axis.turned(ways))
