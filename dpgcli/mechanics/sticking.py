"""Places of a face that stick to a body: how far each has moved along it.

A place F = (1 − s) F_k + s F_{k+1} of a side, s as it was, has moved by e · (F − P) along e from
where it was, P: linear in the nodes of the face.
"""

from dataclasses import replace
from functools import cached_property
from typing import Self

import numpy as np

from dpgcli.arrays import Array, Indices, total
from dpgcli.equilibrium.contracts import Row, WideMeasured, take_lanes
from dpgcli.mechanics.face import Face, FaceShape
from dpgcli.mechanics.gaps import FaceGaps, nearest
from dpgcli.records import dataclass


@dataclass(frozen=True)
class Sticking:
    """One place of a face: on a `side` (1, batch) at a `share` s, `origin` P and `along` e.

    Both are (2, 1, batch), P in mm. It sticks by `friction` (1, 1 or batch), a coefficient.
    """

    face: Face
    side: Indices
    share: Array
    origin: Array
    along: Array
    friction: Array
    n_cells = 1

    @classmethod
    def of(cls, gaps: FaceGaps, coordinates: Array, push: Array, friction: Array) -> Self:
        """The place where a face is pushed hardest, by pushes (cell, batch), and across the push.

        Each push is at its own place.
        """
        shape, n = gaps.face.shape(coordinates), gaps.face.n_units
        shares = nearest(shape, gaps.obstacle.points).share.reshape(-1, push.shape[1])
        cell = push.argmax(axis=0)[None]
        node, is_node = (cell - len(shares)) % (n + 1), cell >= len(shares)
        side = np.where(is_node, np.minimum(node, n - 1), cell % n)
        of_side = np.take_along_axis(shares, np.minimum(cell, len(shares) - 1), axis=0)
        share = np.where(is_node, node - side, of_side)
        ways = shape.seen(gaps.touches(coordinates).directions)
        way = np.take_along_axis(ways, cell[None], axis=1)
        along = np.stack((-way[1], way[0]))
        found = cls(gaps.face, side, share, np.zeros_like(along), along, friction)
        return replace(found, origin=found._place(shape))

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """All corners and chords."""
        return tuple(Row(0, int(place)) for place in self.face.places)

    def _weights(self, shape: FaceShape) -> Array:
        """Of each node in the place, (node, batch)."""
        nodes = np.arange(len(shape.nodes[0]))[:, None]
        beyond = np.where(nodes == self.side + 1, self.share, 0.0)
        return np.where(nodes == self.side, 1.0 - self.share, beyond)

    def _place(self, shape: FaceShape) -> Array:
        return total(np.moveaxis(shape.nodes * self._weights(shape), 1, 0))[:, None]

    def __call__(self, coordinates: Array) -> WideMeasured:
        """How far the place has moved, with its derivatives, (1, batch)."""
        shape = self.face.shape(coordinates)
        forces = self.along * self._weights(shape)
        value = total((self._place(shape) - self.origin) * self.along)

        def bent(force: Array) -> Array:
            return shape.bent(forces * force)

        gradient = shape.pulled(forces[:, :, None])
        return WideMeasured(value, gradient, bent, np.zeros(value.shape, np.int64))

    def take_lanes(self, index: Indices) -> Self:
        """The same place for some lanes of the batch."""
        parts = (self.share, self.origin, self.along, self.friction)
        own = (take_lanes(part, index) for part in parts)
        return type(self)(self.face.take_lanes(index), take_lanes(self.side, index), *own)
