"""How near bodies that move along a straight line come to fingers that stay as they are.

A finger is the outlines of its chambers, side by side: from the inner face to twice the height of
the domes' axis above it, the end phalanx half a segment long. What a body sweeps is the union of
what its sides sweep and of the body where it begins; of a disc it is a line with the disc's radius.
So the least gap of a whole way is a distance of polygons, exact, and it only falls as the way gets
longer: where a body first meets a finger is found by halving (our derivation).
"""

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags
from dpgcli.design.bodies import Body, Disc
from dpgcli.grasping.frames import FingerFrame
from dpgcli.grasping.grasped import Grasped

Outlines = NDArray[np.object_]
HALVINGS = 50


class Clearance(NamedTuple):
    """The least gap on a way, mm, and the share of it at which a body meets a finger, (lane,).

    Where it does the gap is 0; where it does not the share is 1. Of fingers that are not there the
    gap is not known, NaN, and bodies come no part of the way.
    """

    gap: Array
    share: Array

    @property
    def is_clear(self) -> Flags:
        """Where nothing is in the way."""
        return np.asarray(self.gap > 0.0)


def outlines(own: Grasped, frame: FingerFrame, height: Array, length: Array) -> Outlines:
    """The outlines of a finger's phalanges in the gripper's frame, (phalanx, lane).

    `height` is that of the domes' axis, `length` that of the last segment, mm, (1,). None are those
    of fingers that are not there.
    """
    nodes = own.nodes
    base = np.stack((nodes.base_x, nodes.base_y))
    away = np.stack((nodes.top_x, nodes.top_y)) - base
    upright = away / np.hypot(*away)
    first = np.broadcast_to(np.array([0.0, 1.0])[:, None, None], upright[:, :1].shape)
    upright = np.concatenate((first, upright), axis=1)
    along = np.stack((upright[1, -1:], -upright[0, -1:]))
    face = np.concatenate((own.face, own.face[:, -1:] + 0.5 * length * along), axis=1)
    upright = np.concatenate((upright, upright[:, -1:]), axis=1)
    roof = face + 2.0 * height * upright
    around = np.stack((face[:, :-1], face[:, 1:], roof[:, 1:], roof[:, :-1]), axis=3)
    corners = np.moveaxis(frame.placed(around), 0, -1)
    found = np.full(corners.shape[:2], None, object)
    is_there = np.isfinite(corners).all(axis=(0, 2, 3))
    found[:, is_there] = shapely.polygons(corners[:, is_there])
    return found


def clearance(around: Outlines, body: Body, begin: Array, end: Array) -> Clearance:
    """The way of a body from one place of its reference point to another, (2, lane), mm.

    `around` (phalanx, lane) are outlines of all fingers.

    >>> wall = shapely.box(np.array([[0.0]]), 10.0, 80.0, 30.0)
    >>> disc = Disc(np.array([40.0, 0.0]), 8.0)
    >>> found = clearance(wall, disc, np.array([[90.0], [0.0]]), np.array([[40.0], [0.0]]))
    >>> found.gap.tolist(), found.share.tolist()
    ([2.0], [1.0])
    """
    gap = np.maximum(_least(around, body, begin, end), 0.0)
    low, high = np.zeros(len(gap)), np.ones(len(gap))
    lanes = np.flatnonzero(gap == 0.0)
    if len(lanes):
        few, start, way = around[:, lanes], begin[:, lanes], (end - begin)[:, lanes]
        for _ in range(HALVINGS):
            middle = 0.5 * (low[lanes] + high[lanes])
            is_met = _least(few, body, start, start + middle * way) <= 0.0
            low[lanes] = np.where(is_met, low[lanes], middle)
            high[lanes] = np.where(is_met, middle, high[lanes])
        is_met = _least(few, body, start, start) <= 0.0
        high[lanes] = np.where(is_met, 0.0, high[lanes])
    return Clearance(gap, np.where(np.isnan(gap), 0.0, high))


def _least(around: Outlines, body: Body, begin: Array, end: Array) -> Array:
    """The least distance of outlines from what a body sweeps, less than zero within a disc."""
    if isinstance(body, Disc):
        ways = shapely.linestrings(np.stack((begin, end), axis=-1).transpose(1, 2, 0))
        nearest = shapely.distance(around, ways).min(axis=0)
        return np.asarray(nearest - body.radius)
    corners = body.corners.reshape(2, body.corners.shape[1], -1) - body.center[:, None, None]
    corners = corners + begin[:, None]
    sides = np.stack((corners, np.roll(corners, -1, axis=1)), axis=-1)
    swept = np.concatenate((sides, sides + (end - begin)[:, None, :, None]), axis=-1)
    hulls = shapely.convex_hull(shapely.multipoints(np.moveaxis(swept, 0, -1)))
    start = shapely.polygons(corners.transpose(2, 1, 0))
    parts = np.concatenate((hulls, start[None]))
    return np.asarray(shapely.distance(around[:, None], parts).min(axis=(0, 1)))
