"""The inner face of a finger, by its chain's coordinates: where it touches what it holds.

The face is the polyline through F_0 … F_n. F_k lies on the line of strut k, half the layer's
thickness t inside B_k: F_k = B_k − (t/2)(−sin τ_k, cos τ_k). There is a side for each phalanx, and
corners stay joined however the finger bends (our choice; for equal corner angles sides are parallel
to the chords).

Between fingers their ends count as well: `with_end` adds the side along the last strut from F_n to
the dome axis, as long as the strut is at rest.

A body that moves by q along D moves the finger by −q D as the body sees it: such coordinates are
rows before all others, each like a chord's extension at the base. One that turns about a point C
turns the finger about C the other way: a row before these, like a corner's at C, but that it is the
way r of a point of the body, by the angle r/R.

A corner turns all that lies beyond it by −1 about its station P, so that ∂F/∂θ = R (F − P) with
R (x, y) = (y, −x); a chord's extension moves all beyond along its direction u. Of coordinates p
before q along the chain ∂²F/∂p ∂q = R ∂F/∂q if p is a corner, and 0 if it is a chord (our
derivation).
"""

from dataclasses import field, replace
from functools import cache
from typing import NamedTuple, Self

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, rotated, total
from dpgcli.equilibrium.contracts import take_lanes
from dpgcli.mechanics.chain_geometry import pose_of
from dpgcli.mechanics.coordinates import FingerCoordinates, Internal
from dpgcli.records import dataclass


class Pivot(NamedTuple):
    """A point C that a body turns about, (2, 1 or batch), and R, (1 or batch,): angles are r/R.

    In the finger's frame, in mm; R is negative where angles are those of a mirrored frame.
    """

    point: Array
    radius: Array

    def take_lanes(self, index: Indices) -> "Pivot":
        """That of some lanes."""
        return Pivot(*(take_lanes(part, index) for part in self))


class FaceShape(NamedTuple):
    """Nodes F_0 … F_n of a face, mm, (2, node, batch), and how they move.

    By row, coordinates in their order along the chain: the first node that one moves, whether it is
    a corner, and P of a corner or u of a chord, (2, row, batch). A body that sees them has turned
    by an `angle`, (batch,), if it may: the first row, of which a mm is so much, `rate` (1 or
    batch,).
    """

    nodes: Array
    first: Indices
    is_corner: Flags
    origin: Array
    angle: Array | None = None
    rate: Array | None = None

    def pulled(self, forces: Array) -> Array:
        """Σ f · ∂F over nodes, (row, cell, batch), for forces f (2, node, cell, batch)."""
        x, y = self.nodes[:, :, None]
        of_nodes = np.empty((3, *forces.shape[1:]))
        of_nodes[:2], of_nodes[2] = forces, forces[0] * y - forces[1] * x
        beyond = np.cumsum(of_nodes[:, ::-1], axis=1)[:, len(x) - 1 - self.first]
        is_corner, (at_x, at_y) = self.is_corner[:, None], self.origin
        way_x, way_y = np.where(is_corner, -at_y, at_x), np.where(is_corner, at_x, at_y)
        result: Array = beyond[0] * way_x[:, None]
        result += beyond[1] * way_y[:, None]
        result += np.where(is_corner[:, None], beyond[2], 0.0)
        if self.rate is not None:
            result[0] *= self.rate
        return result

    def bent(self, forces: Array) -> Array:
        """Σ f · ∂²F over nodes, (row, row, batch), for forces f (2, node, batch)."""
        turned = np.empty_like(forces)  # f · R v = (Rᵀ f) · v
        np.negative(forces[1], out=turned[0])
        turned[1] = forces[0]
        by_later = self.pulled(turned[:, :, None])[:, 0]
        earlier, later = _pairs(len(self.first))
        result = by_later[later]
        result[~self.is_corner[earlier]] = 0.0
        if self.rate is not None:
            result[0] *= self.rate
            result[1:, 0] *= self.rate
        return result

    def turned(self, ways: Array) -> Array:
        """Directions that the body sees, (2, …, batch), as they are in the finger's frame."""
        return ways if self.angle is None else rotated(ways, self.angle)

    def seen(self, ways: Array) -> Array:
        """Directions of the finger's frame, (2, …, 1 or batch), as the body sees them."""
        return ways if self.angle is None else rotated(ways, -self.angle)


@cache  # the same few for every batch
def _moves(n_units: int, n_motions: int, turns: bool, is_rigid: bool) -> tuple[Indices, Flags]:
    """The first node that each row of a face moves, and whether the row is a corner."""
    kinds = [True, True] if is_rigid else [True, False, True]
    first = np.repeat(np.arange(1, n_units + 1), len(kinds))
    base = np.zeros(n_motions, np.int64)
    is_corner = np.append(base < turns, np.tile(np.array(kinds), n_units))
    is_corner[1:n_motions] = False
    return np.append(base, first), is_corner


@cache  # the same few for every batch
def _pairs(n_rows: int) -> tuple[Indices, Indices]:
    """The earlier and the later of two rows, (row, row)."""
    rows = np.arange(n_rows)
    return np.minimum.outer(rows, rows), np.maximum.outer(rows, rows)


@dataclass(frozen=True)
class Face:
    """The face of fingers in some coordinates; lengths in mm, (1 or unit, 1 or batch).

    `places` are the rows of a body's motions, if it has any, and of e, a and b of each unit among
    all coordinates (a, e, b in the order of the chain; rigid bars have no e). A body moves along
    `directions`, (2, motion, 1 or batch), in the finger's frame, and turns about a `pivot`, if it
    does: the first of the rows. `has_end` says whether the last strut, of the `height` H at rest,
    is a side.
    """

    length: Array
    half_thickness: Array
    height: Array
    n_units: int
    is_rigid: bool
    places: Indices
    directions: Array = field(default_factory=lambda: np.zeros((2, 0, 1)))
    pivot: Pivot | None = None
    has_end: bool = False

    @classmethod
    def of(cls, coordinates: FingerCoordinates, thickness: Array) -> Self:
        """The face of a finger whose layer is so thick, mm, (1, 1 or batch).

        >>> from dpgcli.mechanics.chain import Chain
        >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
        >>> chain = Chain(uniform_finger(2, **STUDY))
        >>> face = Face.of(chain, np.array([[1.5]]))
        >>> face.shape(np.zeros((4, 1))).nodes[..., 0].tolist()  # a straight finger
        [[0.0, 13.5, 27.0], [-0.75, -0.75, -0.75]]
        """
        finger = coordinates.finger
        rows = coordinates.without_walls(np.arange(float(coordinates.size))[:, None]).astype(int)
        order = [0, 1] if finger.is_rigid else [1, 0, 2]
        places = rows.reshape(finger.n_units, -1)[:, order].ravel()
        lengths = finger.segment_length, 0.5 * thickness, finger.segment_height
        return cls(*lengths, finger.n_units, finger.is_rigid, places)

    def with_end(self) -> Self:
        """The face, and the end of the finger behind it."""
        return replace(self, has_end=True)

    @property
    def n_sides(self) -> int:
        """One for each phalanx, and the end."""
        return self.n_units + self.has_end

    def seen_from(self, directions: Array, places: Indices, pivot: Pivot | None = None) -> Self:
        """As a body sees it that moves along `directions` by the coordinates at `places`.

        With a pivot it turns, by the first of them.
        """
        places = np.append(places, self.places)
        return replace(self, directions=directions, pivot=pivot, places=places)

    @property
    def _n_motions(self) -> int:
        return int(self.directions.shape[1]) + (self.pivot is not None)

    def shape(self, coordinates: Array) -> FaceShape:
        """The face at coordinates, (size, batch)."""
        n, n_motions = self.n_units, self._n_motions
        rows = coordinates[self.places[n_motions:]].reshape(n, -1, coordinates.shape[1])
        chord = np.zeros((1, 1)) if self.is_rigid else rows[:, 1]
        pose = pose_of(Internal(chord, rows[:, 0], rows[:, -1], chord), self.length)
        whole = np.zeros((3, n + 1, coordinates.shape[1]))
        whole[0, 1:], whole[1, 1:], whole[2, 1:] = pose.x, pose.y, pose.strut_angle
        stations, angle = whole[:2], whole[2]
        ways = self.directions
        if ways.shape[1]:
            moved = ways * coordinates[self.places[n_motions - ways.shape[1] : n_motions]]
            stations = stations - total(np.moveaxis(moved, 1, 0))[:, None]
        inwards = np.stack((np.sin(angle), -np.cos(angle)))
        pivots = [stations[:, :-1], stations[:, 1:]]
        if not self.is_rigid:
            pivots.insert(1, np.stack((pose.chord_cos, pose.chord_sin)))
        origin = np.stack(pivots, axis=2).reshape(2, -1, coordinates.shape[1])
        if ways.shape[1]:
            away = np.broadcast_to(-ways, (*ways.shape[:2], coordinates.shape[1]))
            origin = np.concatenate((away, origin), axis=1)
        nodes = stations + self.half_thickness * inwards
        if self.has_end:
            top = stations[:, -1:] - self.height[-1:] * inwards[:, -1:]
            nodes = np.concatenate((nodes, top), axis=1)
        moves = _moves(n, n_motions, self.pivot is not None, self.is_rigid)
        shape = FaceShape(nodes, *moves, origin)
        return shape if self.pivot is None else self._turned(shape, coordinates[self.places[0]])

    def _turned(self, shape: FaceShape, way: Array) -> FaceShape:
        """The face as a body sees it that a point has gone so far in, (batch,) mm, by turning."""
        assert self.pivot is not None, "a body that turns"
        angle, center = way / self.pivot.radius, self.pivot.point[:, None]
        is_point = shape.is_corner[1:, None]
        from_center = np.where(is_point, shape.origin - center, shape.origin)
        seen = rotated(from_center, -angle)
        origin = np.where(is_point, seen + center, seen)
        own = np.broadcast_to(center, (2, 1, len(way)))
        return shape._replace(
            nodes=center + rotated(shape.nodes - center, -angle),
            origin=np.concatenate((own, origin), axis=1),
            angle=angle,
            rate=1.0 / self.pivot.radius,
        )

    def take_lanes(self, index: Indices) -> Self:
        """The faces of some lanes of the batch."""
        parts = (self.length, self.half_thickness, self.height, self.directions)
        length, half, height, along = (take_lanes(part, index) for part in parts)
        own = replace(self, length=length, half_thickness=half, height=height, directions=along)
        return replace(own, pivot=self.pivot and self.pivot.take_lanes(index))
