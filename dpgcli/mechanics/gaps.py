"""Gaps between the face of a finger and round bodies, by the finger's coordinates.

Of a body around c with radius r the gap to a side of the face is g − r, with g the distance of c
from that side, positive where c is on the inner side of it. A gap that is measured on one side
follows its nearest place to the next sides while that brings it nearer: sides that lead to the same
place have the same gap. So a body that touches two sides in a corner has two gaps, and one that
slides over a corner keeps its own.

With A and B the ends of a side of length ℓ, t its direction, m its inner normal and c nearest to
A + s ℓ t, ∇g is m at c, −(1 − s) m at A and −s m at B. With w = (m, −m)/ℓ at A and B, which is the
turn of the side, and τ = t at c, −(1 − s) t at A and −s t at B, ∇²g = w τᵀ + τ wᵀ − g w wᵀ. At a
corner w is 0, m points from it to c, and ∇²g = τ τᵀ/g (our derivation).
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, acting, total
from dpgcli.equilibrium.contracts import Row, WideMeasured, take_lanes
from dpgcli.mechanics.face import Face, FaceShape
from dpgcli.mechanics.obstacle import Obstacle
from dpgcli.mechanics.plates import PlateGaps, plate_gaps
from dpgcli.records import dataclass

FAR = 1e9  # mm: of a gap that is another one's
LEVEL = 1e-4  # of the last side: what is so near to level with the finger's end


class Nearest(NamedTuple):
    """Nearest places of sides to bodies, (body, side, batch): numbers of sides, and what is there.

    `place` is the side that the gap of a side has followed its nearest place to; `share` is s there
    if one stays on a side, `normal` m and `along` t are (2, body, side, batch), `distance` is g.
    `is_corner` says that the nearest place of a side is one of its ends.
    """

    place: Indices
    share: Array
    distance: Array
    normal: Array
    along: Array
    length: Array
    is_corner: Flags


class Touches(NamedTuple):
    """Where a body would be touched, mm, and the direction of a push on it: (2, cell, batch)."""

    places: Array
    directions: Array

    @classmethod
    def together(cls, parts: "Sequence[Touches]") -> "Touches":
        """The cells of several, one after the other."""
        return cls(*(np.concatenate(own, axis=1) for own in zip(*parts, strict=True)))


@dataclass(frozen=True)
class FaceGaps:
    """Gaps of a body, cell by cell: all sides of the face for its first point, then the next.

    Behind these are those of its plates: all nodes of the face for the first, then the next. With
    `first` (cell, batch) only one gap of those at one place is there, the others are far away: one
    of the first, or else that of the cell itself. Points that are behind a side by more than the
    `reach` (batch,), mm, are beyond the finger, and far away.
    """

    face: Face
    obstacle: Obstacle
    first: Flags | None = None
    reach: Array | None = None

    @property
    def n_cells(self) -> int:
        """One for each side and point, and for each node and plate."""
        n, body = self.face.n_units, self.obstacle
        return n * len(body.radii) + (n + 1) * len(body.plates)

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """All corners and chords."""
        return tuple(Row(0, int(place)) for place in self.face.places)

    @cached_property
    def phalanges(self) -> Indices:
        """The phalanx that each cell is on, the first is 0, (cell,): a node ends its own."""
        n, body = self.face.n_units, self.obstacle
        of_nodes = np.maximum(np.arange(n + 1) - 1, 0)
        return np.append(
            np.tile(np.arange(n), len(body.radii)), np.tile(of_nodes, len(body.plates))
        )

    def __call__(self, coordinates: Array) -> WideMeasured:
        """g − r with its derivatives, (cell, batch)."""
        shape = self.face.shape(coordinates)
        near = nearest(shape, self.obstacle.points)
        moves = moves_of(shape, near)
        place, own, slope = self._at_points(near), self._own(near), moves.slope
        n_points = len(own)
        pushes: Array | None = None
        if len(self.obstacle.plates):
            plates = plate_gaps(shape, self.obstacle)
            place = np.concatenate((place, self._at_plates(plates, place)))
            own = np.concatenate((own, plates.distance.reshape(-1, coordinates.shape[1])))
            pushes = _pushed(plates)
            slope = np.concatenate((slope, shape.pulled(pushes)), axis=1)
        lanes = np.arange(coordinates.shape[1])
        value, gradient = own[place, lanes], slope[:, place, lanes]
        if self.first is not None:
            is_told = one_at(place, self.first)
            value = np.where(is_told, value, FAR)
        gradient = np.where(value < FAR, gradient, 0.0)

        def bent(force: Array) -> Array:
            is_there = place[:, None] == np.arange(len(own))[:, None]
            by_place = total(np.where(is_there, force[:, None], 0.0))
            result = bent_by(shape, near, moves, by_place[:n_points])
            if pushes is not None:
                result += shape.bent(total(np.moveaxis(pushes * by_place[n_points:], 2, 0)))
            return result

        return WideMeasured(value, gradient, bent, place)

    def _at_points(self, near: Nearest) -> Indices:
        """The place of each side and point, (cell, batch)."""
        n_points, n, batch = near.place.shape
        before = n * np.arange(n_points)[:, None, None]
        return np.asarray((near.place + before).reshape(-1, batch))

    def _own(self, near: Nearest) -> Array:
        """The gap of each side and point, (cell, batch); none where no side can touch."""
        own = near.distance - self.obstacle.radii[:, None]
        own = np.where(self.obstacle.is_reentrant[:, None], FAR, own)
        if self.reach is not None:
            own = np.where(near.distance < -self.reach, FAR, own)
        return np.asarray(own.reshape(-1, own.shape[-1]))

    def _at_plates(self, plates: PlateGaps, at_points: Indices) -> Indices:
        """The place of each node and plate, (cell, batch): beyond its ends that of the corner."""
        n = self.face.n_units
        batch = at_points.shape[1]
        number = len(at_points) + np.arange(plates.distance[..., 0].size)[:, None]
        beside = np.minimum(np.arange(n + 1), n - 1)[:, None]
        at_end = np.take_along_axis(
            at_points, (n * plates.ends + beside).reshape(-1, batch), axis=0
        )
        return np.where(plates.is_over.reshape(-1, batch), number, at_end)

    def touches(self, coordinates: Array) -> Touches:
        """Where the body is touched in each cell that is at its own place, and which way.

        In the finger's frame, of the body as it has turned, but where it was before it moved.
        """
        shape, body = self.face.shape(coordinates), self.obstacle
        near = nearest(shape, body.points)
        of_points = body.points[:, :, None] - body.radii[:, None] * near.normal
        places, ways = ([part.reshape(2, -1, part.shape[-1])] for part in (of_points, near.normal))
        if len(body.plates):
            normal = plate_gaps(shape, body).normal[:, :, None]
            nodes = shape.nodes[:, None]
            shape_of_all = np.broadcast_shapes(normal.shape, nodes.shape)
            for parts, values in ((places, nodes), (ways, -normal)):
                whole = np.broadcast_to(values, shape_of_all)
                parts.append(whole.reshape(2, -1, whole.shape[-1]))
        place, way = (np.concatenate(parts, axis=1) for parts in (places, ways))
        if self.face.pivot is not None:
            center = self.face.pivot.point[:, None]
            place = center + shape.turned(place - center)
        return Touches(place, shape.turned(way))

    def are_slipping(self, coordinates: Array, bound: Array) -> Flags:
        """Whether the finger's end slips over a body that it touches at a bound, (batch,).

        The body is then level with the end, and behind it: beyond the end the gap is the distance
        from it, before it the body is behind the face, and the gap jumps.
        """
        nodes = self.face.shape(coordinates).nodes
        return slipping(nodes, self.obstacle.points, self.obstacle.radii + bound)

    def with_first(self, first: Flags | None) -> Self:
        """The same, but only one gap at each place."""
        return replace(self, first=first)

    def take_lanes(self, index: Indices) -> Self:
        """The same gaps for some lanes of the batch."""
        first = None if self.first is None else take_lanes(self.first, index)
        reach = None if self.reach is None else take_lanes(self.reach, index)
        face, obstacle = self.face.take_lanes(index), self.obstacle.take_lanes(index)
        return type(self)(face, obstacle, first, reach)


def slipping(nodes: Array, points: Array, radii: Array) -> Flags:
    """Whether round bodies, (2, body, batch), slip over the end of a line of nodes, (batch,)."""
    side, away = nodes[:, -1:] - nodes[:, -2:-1], points - nodes[:, -1:]
    length = np.hypot(*side)
    beyond = total(away * side) / length
    is_behind = side[1] * away[0] < side[0] * away[1]
    is_touched = np.hypot(*away) - radii <= LEVEL * length
    return np.asarray(((np.abs(beyond) <= LEVEL * length) & is_behind & is_touched).any(axis=0))


def _pushed(plates: PlateGaps) -> Array:
    """The forces on nodes that make ∇g of each node and plate, (2, node, cell, batch)."""
    n_plates, n_nodes, batch = plates.distance.shape
    forces = np.zeros((2, n_nodes, n_plates, n_nodes, batch))
    nodes = np.arange(n_nodes)
    forces[:, nodes, :, nodes] = plates.normal
    return forces.reshape(2, n_nodes, -1, batch)


def one_at(place: Indices, first: Flags) -> Flags:
    """One cell of each place: the lowest of the first ones there, or its own, (cell, batch)."""
    n = len(place)
    numbers = np.arange(n)[:, None]
    rank = np.where(first, 0, np.where(place == numbers, n, 2 * n)) + numbers
    is_before = (place[:, None] == place[None]) & (rank[None] < rank[:, None])
    return np.asarray(~is_before.any(axis=1))


def nearest(shape: FaceShape, centers: Array, *, has_end: bool = False) -> Nearest:
    """The nearest places of all sides of a face to points (2, point, batch)."""
    start = shape.nodes[:, None, :-1]
    side, away = shape.nodes[:, None, 1:] - start, centers[:, :, None] - start
    length = np.sqrt(total(side * side))
    along = side / length
    inwards = np.stack((along[1], -along[0]))
    raw = total(away * along) / length
    place, n = _followed(raw), raw.shape[1]
    share = np.minimum(np.maximum(raw, 0.0), 1.0)
    is_corner = (raw <= 0.0) | (raw >= 1.0)
    off_line = total(away * inwards)
    if has_end:
        place = _around_end(place, off_line)
    corner = away - share * length * along
    distance = np.sqrt(total(corner * corner))
    is_behind = off_line < 0.0
    is_behind[:, 0] &= raw[:, 0] >= 0.0
    is_behind[:, n - 1] &= raw[:, n - 1] <= 1.0
    sign = np.where(is_behind, -1.0, 1.0)
    signed = np.where(is_corner, sign * distance, off_line)
    is_apart = is_corner & (distance > 0.0)
    outwards = sign / np.where(is_apart, distance, 1.0)
    normal = np.where(is_apart, outwards * corner, inwards)
    tangent = np.stack((-normal[1], normal[0]))
    length = np.broadcast_to(length, raw.shape)
    return Nearest(place, share, signed, normal, tangent, length, is_corner)


def _followed(raw: Array) -> Indices:
    """The sides to which nearest places lead, (body, side, batch), from shares s beyond 0 and 1.

    A corner that is nearest to both its sides belongs to the first of them.
    """
    _, n, batch = raw.shape
    to_next, target = np.zeros(raw.shape, np.int64), np.arange(raw.size).reshape(raw.shape)
    to_next[:, 1:] -= raw[:, 1:] <= 0.0
    to_next[:, :-1] += (raw[:, :-1] >= 1.0) & (raw[:, 1:] > 0.0)
    target += batch * to_next
    for _ in range((n - 1).bit_length()):  # twice as far each time
        target = np.take(target, target)
    return np.asarray(target // batch % n)


def _around_end(place: Indices, off_line: Array) -> Indices:
    """Places with those at the end, where a point that is behind two sides is behind the nearer.

    The last side is about square to the one before: what is just in it is far behind the other.
    """
    last, before = off_line.shape[1] - 1, off_line.shape[1] - 2
    by_face, by_end = off_line[:, before, None], off_line[:, last, None]
    is_at_end = (place == before) & (by_face < 0.0) & (by_end > by_face)
    is_at_face = (place == last) & (by_end < 0.0) & (by_face > by_end)
    at_face = np.where(is_at_face, place[:, before, None], place)
    return np.where(is_at_end, last, at_face)


class Moves(NamedTuple):
    """∇g of every side and body by the coordinates, (row, cell, batch).

    `push` (2, node, cell, batch) are the forces on nodes of which it is made.
    """

    slope: Array
    push: Array


def moves_of(shape: FaceShape, near: Nearest) -> Moves:
    """How the gaps of all sides and points change as the face moves."""
    _, n_bodies, n, batch = near.normal.shape
    normal, share = near.normal.reshape(2, -1, batch), near.share.reshape(-1, batch)
    sides = np.tile(np.arange(n), n_bodies)
    push = _at_ends((share - 1.0) * normal, -share * normal, sides, n)
    return Moves(shape.pulled(push), push)


def turns_of(shape: FaceShape, near: Nearest, cells: Indices) -> tuple[Array, Array]:
    """The w and the τ of some sides and bodies, (cell, 1 or batch): (row, cell, batch)."""
    _, _, n, batch = near.normal.shape
    lanes, number = np.arange(batch), np.arange(len(cells))[:, None]
    normal, along = (v.reshape(2, -1, batch)[:, cells, lanes] for v in (near.normal, near.along))
    parts = (near.share, near.length, near.is_corner)
    share, length, is_corner = (v.reshape(-1, batch)[cells, lanes] for v in parts)
    turn, slid = np.where(is_corner, 0.0, 1.0 / length) * normal, share * along
    forces, sides = np.zeros((2, n + 1, 2 * len(cells), batch)), cells % n
    forces[:, sides, number, lanes], forces[:, sides + 1, number, lanes] = turn, -turn
    number = number + len(cells)
    forces[:, sides, number, lanes] = slid - along
    forces[:, sides + 1, number, lanes] = -slid
    pulled = shape.pulled(forces)
    return pulled[:, : len(cells)], pulled[:, len(cells) :]


def _at_ends(start: Array, end: Array, sides: Indices, n_sides: int) -> Array:
    """Forces on nodes, (2, node, cell, batch), by those at both ends of a side each."""
    forces = np.zeros((2, n_sides + 1, *start.shape[1:]))
    cells = np.arange(len(sides))
    forces[:, sides, cells] = start
    forces[:, sides + 1, cells] = end
    return forces


def bent_by(shape: FaceShape, near: Nearest, moves: Moves, force: Array) -> Array:
    """Σ F ∇²g over places, (row, row, batch), for forces (place, batch)."""
    batch, cells = force.shape[1], acting(force)
    if not len(cells):
        return np.zeros((len(shape.first), len(shape.first), batch))
    result = shape.bent(total(np.moveaxis(moves.push * force, 2, 0)))
    lanes = np.arange(batch)
    force, distance = force[cells, lanes], near.distance.reshape(-1, batch)[cells, lanes]
    is_around = near.is_corner.reshape(-1, batch)[cells, lanes] & (distance != 0.0)
    around = np.where(is_around, force / np.where(is_around, distance, 1.0), 0.0)
    turn, slide = turns_of(shape, near, cells)
    by_side = force * slide - (0.5 * force * distance) * turn
    by_corner = around * slide
    for k in range(len(cells)):  # of sides w (τ − ½ g w)ᵀ F and its mirror image
        mixed = turn[:, None, k] * by_side[:, k]
        result += mixed
        result += np.swapaxes(mixed, 0, 1)
        if is_around[k].any():
            result += by_corner[:, None, k] * slide[:, k]
    return result
