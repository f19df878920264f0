"""Fingers that overlap about a body come together from where they just touch: see `meeting`.

Each has met the body as if it were alone. Where the two do not overlap then, that is all. Where
they do, their bases come together, and they touch the body and each other: only these pay. So it is
with fingers that close: those that overlap before, or where a pressure is reached, close once more,
from where they come together.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Codes, Flags, Indices, distinct
from dpgcli.design.scene import Scene
from dpgcli.grasping.approach import Approach, Load
from dpgcli.grasping.closing import Closing, closed
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.frames import frames
from dpgcli.grasping.grasp import blocks, described, grown
from dpgcli.grasping.grasped import Grasped, Placed, resets_of
from dpgcli.grasping.meeting import (
    along_axis,
    apart,
    bearing_sideways,
    beyond_axis,
    coming_together,
    pair_blocks,
    way_of,
)
from dpgcli.grasping.release import together
from dpgcli.grasping.shapes import ContactShapes, with_lost
from dpgcli.grasping.travels import with_reasons
from dpgcli.mechanics.face import Face
from dpgcli.mechanics.mirror import Axis
from dpgcli.mechanics.terms import Formulate
from dpgcli.records import dataclass
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Status
from dpgcli.states.patterns import inverted_units
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions

OVERLAP = 3e-10  # of a stroke: what is less is a touch
ROWS = 2**12  # that are looked at at once


@dataclass(frozen=True)
class Joined:
    """Fingers that have come together: those of some `rows`, with what they are in the end.

    `own` and `shapes` are those of both, or of one of two that are mirror images. `touched` (row,)
    says which have touched the body.
    """

    rows: Indices
    fingers: tuple[Grasped, Grasped]
    own: Obstructed
    shapes: ContactShapes
    touched: Flags

    def take(self, index: Indices) -> "Joined":
        """Some of the rows, by their places here."""
        upper, lower = (finger.take_lanes(index) for finger in self.fingers)
        own, shapes = self.own.take_lanes(index), self.shapes.take_lanes(index)
        return Joined(self.rows[index], (upper, lower), own, shapes, self.touched[index])


def joined(
    parts: Sequence[Placed],
    lanes: Sequence[Indices],
    axis: Axis,
    is_on_axis: Flags,
    closing: Closing | None = None,
) -> Iterator[Joined]:
    """The rows whose fingers overlap about their body, come together: those at `lanes` of parts.

    Two in one state are mirror images if the body is on the axis, or as long as neither touches it.
    Then they close, if the parts have.
    """
    n_units = parts[0].own.units.finger.n_units
    ways = list(zip(*map(_ways, parts), strict=True))
    parts = ways[0]
    codes = [part.codes[index] for part, index in zip(parts, lanes, strict=True)]
    touched = [
        _are_touched(part)[index] for way in ways for part, index in zip(way, lanes, strict=True)
    ]
    is_alike = (codes[0] == codes[1]) & (is_on_axis | ~np.any(touched, axis=0))
    overlaps = [_overlap(way, lanes, axis, is_alike) for way in ways]
    travel, is_met = overlaps[0], np.max(overlaps, axis=0) > 0.0
    others, alike = is_met & ~is_alike, np.flatnonzero(is_met & is_alike)
    for some in blocks(len(alike), n_units) if len(alike) else ():
        rows = alike[some]
        own = axis.take_lanes(rows)
        met = _mirrored(parts[0], lanes[0][rows], own, rows, closing)
        is_off = ~np.broadcast_to(is_on_axis, len(travel))[rows]
        if is_off.any():
            also = _mirrored(parts[1], lanes[1][rows], own, rows, closing)
            is_left = is_off & (met.touched | also.touched)
            others[rows[is_left]] = True
            both = replace(met, fingers=(met.fingers[0], also.fingers[0]))
            met = both.take(np.flatnonzero(~is_left))
        yield met
    rest = np.flatnonzero(others)
    for some in pair_blocks(len(rest), n_units):
        rows = rest[some]
        few = [index[rows] for index in lanes]
        yield _paired(parts, few, axis.take_lanes(rows), rows, travel[rows], closing)


def _ways(part: Placed) -> list[Placed]:
    """Fingers as they met the body and, if they have closed since, at each pressure."""
    came = part.grown
    resets = tuple(reset for reset in came.resets if reset.pressure is None)
    return [
        replace(
            part,
            grown=Approach(shapes, came.load, resets),
            status=np.where(shapes.is_there, np.uint8(Status.STABLE), part.status),
        )
        if came.stops
        else part
        for shapes in came.stops or (came.shapes,)
    ]


def _are_touched(part: Placed) -> Flags:
    """Which lanes touch their body."""
    return _touching(part.own, part.grown.shapes)


def _touching(own: Obstructed, shapes: ContactShapes) -> Flags:
    push = own.without_rounding(shapes.push[: own.n_on_bodies])
    return np.asarray((push > 0.0).any(axis=0))


def _overlap(
    parts: Sequence[Placed], lanes: Sequence[Indices], axis: Axis, is_alike: Flags
) -> Array:
    """How far apart bases are moved for fingers just to touch, mm, (row,).

    0 where they do not overlap, or are not at rest. Rows that are alike are mirrored pairs.
    """
    nodes = [_ended(part) for part in parts]
    travel, stroke = np.zeros(len(is_alike)), parts[0].own.large[0]
    if len(stroke) > 1:
        stroke = stroke[lanes[0]]
    for first in range(0, len(travel), ROWS):
        rows = np.arange(first, min(first + ROWS, len(travel)))
        own = axis.take_lanes(rows)
        upper, lower = (
            along_axis(own, at[..., index[rows]]) for at, index in zip(nodes, lanes, strict=True)
        )
        beyond = -2.0 * upper[1].min(axis=0)
        travel[rows] = np.where(is_alike[rows], beyond, way_of(upper, lower))
    each = [part.status[index] == Status.STABLE for part, index in zip(parts, lanes, strict=True)]
    return np.where(np.all(each, axis=0) & (travel > OVERLAP * stroke), travel, 0.0)


def n_overlapping(scene: Scene, formulate: Formulate, pairs: Sequence[Codes]) -> int:
    """How many pairs, but for mirrored ones, have free fingers that reach past each other.

    States of the upper and the lower finger, (row,) each: about so many come together.
    """
    assert scene.layer_thickness is not None and scene.body is not None, "faces, and a body"
    needed = distinct(np.concatenate(list(pairs)))
    pattern = inverted_units(needed, scene.finger.n_units)
    free = settle(UnitSolutions.of(scene.finger), formulate, pattern, DEFAULT_TOLERANCE)
    face = Face.of(free.potential.coordinates, np.reshape(scene.layer_thickness, (1, -1)))
    nodes = face.with_end().shape(free.equilibrium.coordinates).nodes
    lowest = frames(scene.gripper)[0].axis.height(nodes).min(axis=0)
    upper, lower = (lowest[np.searchsorted(needed, codes)] for codes in pairs)
    is_alike = (pairs[0] == pairs[1]) & bool(scene.body.is_mirrored)
    least = OVERLAP * scene.finger.stroke.min()
    return int(((upper + lower < -least) & ~is_alike).sum())


def _ended(part: Placed) -> Array:
    """The nodes of faces and ends, (2, node, lane), mm."""
    return part.own.faces[0].with_end().shape(part.grown.shapes.coordinates).nodes


def _mirrored(
    part: Placed, lanes: Indices, axis: Axis, rows: Indices, closing: Closing | None
) -> Joined:
    """Those that are mirror images: each comes to the axis."""
    shapes, status = part.grown.shapes.take_lanes(lanes), part.status[lanes]
    own = replace(part.own.take_lanes(lanes), axis=axis, is_mirrored=True)
    x = shapes.coordinates
    coming = replace(own, depth=np.zeros(1), apart=beyond_axis(own, x))
    came = grown(coming, x, shapes.inverted, status == Status.STABLE, None, shapes.push)
    rest, status = _closed(own, _told(came, came.shapes), status, closing)
    (found,) = described(own, [part.codes[lanes]], rest, status)
    found = bearing_sideways(found, own, rest)
    found = replace(found, resets=(*resets_of(part.grown.resets, lanes), *found.resets))
    return _joined(rows, (found, found), own, rest)


def _paired(
    parts: Sequence[Placed],
    lanes: Sequence[Indices],
    axis: Axis,
    rows: Indices,
    travel: Array,
    closing: Closing | None,
) -> Joined:
    """Others: both fingers are unknown."""
    bare, start = together(parts, lanes, None)
    own = replace(bare, axis=axis)
    status = np.max([part.status[i] for part, i in zip(parts, lanes, strict=True)], axis=0)
    coming = apart(own, travel)
    came = coming_together(coming, start.coordinates, start.inverted, status, None, start.push)
    rest = _told(came, coming.at_rest(came.shapes))
    rest, status = _closed(own, rest, status, closing)
    codes = [part.codes[index] for part, index in zip(parts, lanes, strict=True)]
    fingers = described(own, codes, rest, status)
    upper, lower = (
        replace(finger, resets=(*resets_of(part.grown.resets, index), *finger.resets))
        for finger, part, index in zip(fingers, parts, lanes, strict=True)
    )
    return _joined(rows, (upper, lower), own, rest)


def _closed(
    own: Obstructed, rest: Approach, status: NDArray[np.uint8], closing: Closing | None
) -> tuple[Approach, NDArray[np.uint8]]:
    """What becomes of fingers that have come together, as pressures change; nothing without."""
    if closing is None:
        return rest, with_lost(status, rest.shapes.is_there)
    came = closed(own, rest, closing)
    return came, with_reasons(own, came.shapes, status)


def _joined(
    rows: Indices, fingers: tuple[Grasped, Grasped], own: Obstructed, rest: Approach
) -> Joined:
    touched = np.any([_touching(own, shapes) for shapes in (rest.shapes, *rest.stops)], axis=0)
    return Joined(rows, fingers, own, rest.shapes, touched)


def _told(came: Approach, shapes: ContactShapes) -> Approach:
    """What happened as bases came together, with the body in full."""
    resets = tuple(replace(reset, of=Load.MEETING) for reset in came.resets)
    return Approach(shapes, 0.0 * came.load + 1.0, resets)
