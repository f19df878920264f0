"""Gaps between the straight sides of a body and the nodes of a face.

With n the outward normal of a plate through P the gap to a node F is n · (F − P): linear in F. It
is that of the plate as long as the node is over it; beyond the ends of the plate it is the gap of
the corner there. In the body a node is behind many plates: it is measured to the nearest of those
that fingers come to from their own side, or around its far end. Nothing of this depends on how the
finger is bent, so that gaps do not jump where it turns.
"""

from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, total
from dpgcli.mechanics.face import FaceShape
from dpgcli.mechanics.obstacle import Obstacle

SLIGHT = 1e-6  # mm: a node so far behind a plate, or beyond its end in a notch, is on it

SIDEWAYS = -0.25  # of n_x + n_y: a plate with more faces up, or away from the base


class PlateGaps(NamedTuple):
    """Of each plate and node: n · (F − P), whether it is over the plate, and n.

    `distance`, `is_over` and `ends`, the number of the point at the nearer end of the plate, are
    (plate, node, batch); `normal` is (2, plate, 1 or batch).
    """

    distance: Array
    is_over: Flags
    ends: Indices
    normal: Array


def plate_gaps(shape: FaceShape, body: Obstacle) -> PlateGaps:
    """The gaps of all plates of a body to the nodes of a face."""
    start, end = body.points[:, body.plates[:, 0]], body.points[:, body.plates[:, 1]]
    side = end - start
    length = np.sqrt(total(side * side))
    along = side / length
    normal = np.stack((along[1], -along[0]))
    away = shape.nodes[:, None] - start[:, :, None]
    share = total(away * along[:, :, None]) / length[:, None]
    distance = total(away * normal[:, :, None])
    slight = np.where(body.is_reentrant, SLIGHT, 0.0)[:, None]
    before = slight[body.plates[:, 0]] / length[:, None]
    after = slight[body.plates[:, 1]] / length[:, None]
    is_beside = (share >= -before) & (share <= 1.0 + after)
    is_over = is_beside & (distance >= -SLIGHT)
    is_on = (is_over & (distance <= SLIGHT)).any(axis=0)
    is_inside = _is_inside(shape.nodes, start, end) & ~is_on
    nearest = _nearest_facing(share, distance, length, shape.turned(normal))
    is_over = np.where(is_inside, nearest, is_over)
    first, last = body.plates[:, 0, None, None], body.plates[:, 1, None, None]
    return PlateGaps(distance, is_over, np.where(share < 0.5, first, last), normal)


def _is_inside(nodes: Array, start: Array, end: Array) -> Flags:
    """Which nodes are in the body: a ray along x meets an odd number of plates, (node, batch)."""
    x, y = nodes[:, None]
    (x0, y0), (x1, y1) = start[:, :, None], end[:, :, None]
    spans = (y0 > y) != (y1 > y)
    rise = np.where(y1 != y0, y1 - y0, 1.0)
    return np.asarray((spans & (x < x0 + (y - y0) * (x1 - x0) / rise)).sum(axis=0) % 2 == 1)


def _nearest_facing(share: Array, distance: Array, length: Array, normal: Array) -> Flags:
    """The nearest plate that a node is behind: one that faces fingers, if any does."""
    beyond = (share - np.clip(share, 0.0, 1.0)) * length[:, None]
    away = np.hypot(distance, beyond)
    is_facing = (normal[0] + normal[1] > SIDEWAYS)[:, None]
    rank = np.where(is_facing, away, away + away.max())
    rank = np.where(distance < 0.0, rank, np.inf)
    return np.asarray(np.arange(len(rank))[:, None, None] == rank.argmin(axis=0))
