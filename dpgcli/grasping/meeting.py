"""Fingers of a gripper that meet: they touch each other.

Their bases come together along y, from where the fingers just touch to their spacing: that is the
load. Without a body they are free before. With one each has taken hold of it as if it were alone,
and keeps it at its place before its base as they come together: in the end it is one. Two in one
state stay mirror images of each other, and each meets the axis as a fixed line. That such a pair
does not give way to one side either is looked at behind that: nodes that touch keep each other from
sliding, as any friction does where nothing yet pulls along the axis. Of other pairs both fingers
are unknown, and slide along each other without friction.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Codes, Flags, distinct
from dpgcli.design.scene import Scene
from dpgcli.equilibrium.contracts import Term
from dpgcli.equilibrium.loaded import Holding
from dpgcli.equilibrium.newton import looked_at
from dpgcli.equilibrium.potential import Potential
from dpgcli.grasping.approach import Approach
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.costs import PAIR_LANE
from dpgcli.grasping.frames import FingerFrame, frames
from dpgcli.grasping.grasp import BLOCK, MARGIN_TO, blocks, described, grown, told
from dpgcli.grasping.grasped import Grasped, Placed
from dpgcli.grasping.shapes import Motion, with_lost
from dpgcli.mechanics.face import Face
from dpgcli.mechanics.gaps import Touches
from dpgcli.mechanics.mirror import Axis, Heights
from dpgcli.mechanics.terms import DeadLoad, Formulate
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import MARGINAL_CURVATURE, Status
from dpgcli.states.patterns import inverted_units
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions


def meeting(
    scene: Scene, formulate: Formulate, pairs: Sequence[Codes]
) -> tuple[tuple[Grasped, Grasped], NDArray[np.int64]]:
    """Upper and lower fingers in these states, (row,) each, that come together.

    Also which of their lanes are those of each row, (finger, row). Pairs that are mirror images of
    each other are solved once. Raises ValueError for a scene without the thickness of its layer.
    """
    if scene.layer_thickness is None:
        raise ValueError("the face of a finger needs the thickness of its layer")
    units, thickness = UnitSolutions.of(scene.finger), np.reshape(scene.layer_thickness, (1, -1))
    given = units, formulate, thickness
    seen_from = frames(scene.gripper)
    states = distinct(np.concatenate(list(pairs)))
    first, second = (np.searchsorted(states, codes) for codes in pairs)
    key = np.minimum(first, second) * len(states) + np.maximum(first, second)
    is_alike, is_swapped = np.asarray(first == second), np.asarray(first > second)
    alike, others = distinct(key[is_alike]), distinct(key[~is_alike])
    parts = [_mirrored(*given, seen_from[0], states[alike // len(states)])] if len(alike) else []
    for some in pair_blocks(len(others), scene.finger.n_units):
        codes = [states[place] for place in divmod(others[some], len(states))]
        parts.append(_met(*given, seen_from, codes))
    lanes = np.where(
        is_alike, np.searchsorted(alike, key), len(alike) + np.searchsorted(others, key)
    )
    upper, lower = (Grasped.joined(own) for own in zip(*parts, strict=True))
    if is_swapped.any():
        lanes = np.where(is_swapped, lanes + len(upper.code), lanes)
        mirrored = [lower, _swapped(upper)], [upper, _swapped(lower)]
        lower, upper = (Grasped.joined(own) for own in mirrored)
    return (upper, lower), np.stack((lanes, lanes))


def _swapped(found: Grasped) -> Grasped:
    """A finger as the other one of the mirrored pair: its sides are those of the other cells."""
    half = len(found.push) // 2
    touches = Touches(*(np.roll(part, half, axis=1) for part in found.touches))
    return replace(found, push=np.roll(found.push, half, axis=0), touches=touches)


def pair_blocks(n_pairs: int, n_units: int) -> list[slice]:
    """Pairs that are worked on at once, so that these take no more than BLOCK bytes."""
    size = max(BLOCK // (PAIR_LANE * n_units**3), 1)
    return [slice(first, min(first + size, n_pairs)) for first in range(0, n_pairs, size)]


def _mirrored(
    units: UnitSolutions, formulate: Formulate, thickness: Array, frame: FingerFrame, codes: Codes
) -> tuple[Grasped, Grasped]:
    """Fingers in these states, each of which meets its mirror image, as those of pairs."""
    pattern = inverted_units(codes, units.finger.n_units)
    parts = []
    for some in blocks(len(codes), units.finger.n_units):
        free = settle(units, formulate, pattern[:, some], DEFAULT_TOLERANCE)
        own = Obstructed(units, formulate, thickness, (), np.zeros(1))
        own = replace(own, axis=frame.axis, is_mirrored=True)
        x = free.equilibrium.coordinates
        own = replace(own, apart=beyond_axis(own, x))
        is_stable = np.asarray(free.status == Status.STABLE)
        came = grown(own, x, pattern[:, some], is_stable, MARGIN_TO)
        status = with_lost(free.status, came.shapes.is_there)
        parts.append(bearing_sideways(told(Placed(codes[some], own, came, status)), own, came))
    return _as_of_pairs(Grasped.joined(parts))


def beyond_axis(own: Obstructed, coordinates: Array) -> Array:
    """How far fingers that are mirrored reach beyond the axis, mm, (lane,): at least 0."""
    heights = own.contacts[-1]
    assert isinstance(heights, Heights), "a finger and its mirror image"
    return np.asarray(np.maximum(0.0, -heights(coordinates).value.min(axis=0)))


def bearing_sideways(found: Grasped, own: Obstructed, came: Approach) -> Grasped:
    """The same, marginal where a finger gives way with its mirror image to one side."""
    gives_way = (found.status == Status.STABLE) & ~_bears_sideways(own, came)
    return replace(found, status=np.where(gives_way, np.uint8(Status.MARGINAL), found.status))


def _bears_sideways(own: Obstructed, came: Approach) -> Flags:
    """Which fingers do not give way with their mirror images to one side, (batch,).

    Such a motion is the opposite of its mirror image. It moves nodes that touch along the axis in
    opposite directions, which they keep each other from, and off the axis together, so that heights
    count with their pushes as in the mirrored state. So do gaps to a body.
    """
    shapes, heights = came.shapes, own.contacts[-1]
    assert isinstance(heights, Heights), "a finger and its mirror image"
    x, n = shapes.coordinates, own.n_on_bodies
    push = own.without_rounding(shapes.push[n:])
    normal = heights.axis.normal
    along = replace(heights, axis=Axis(np.stack((normal[1], -normal[0])), np.zeros(1)))
    keeping = Holding(None, np.where(push > 0.0, own.stiffness, 0.0), along(x).value)
    bare = own.bare(shapes.inverted, came.load)
    if n:
        bare = replace(own, axis=None).pressed(shapes.inverted, shapes.push[:n], came.load)
    pressed = Term("contact", heights, DeadLoad(push)), Term("stick", along, keeping)
    sideways = Potential(bare.coordinates, (*bare.terms, *pressed))
    return np.asarray(looked_at(sideways, x).curvature > MARGINAL_CURVATURE)


def _as_of_pairs(found: Grasped) -> tuple[Grasped, Grasped]:
    """What touches the axis as touches of the upper finger's nodes and the lower one's sides."""
    n_sides, n_units = len(found.push), len(found.nodes.base_x)
    nodes = np.arange(1, n_sides + 1)
    n_cells = n_sides * (n_sides + 1)  # of each finger's sides and the other's nodes
    cells = n_cells + nodes * n_sides + nodes - 1

    def spread(values: Array) -> Array:
        whole = np.zeros((*values.shape[:-2], 2 * n_cells, values.shape[-1]))
        whole[..., cells, :] = values
        return whole

    touches = Touches(*(spread(part) for part in found.touches))
    placed = replace(found, push=spread(found.push), touches=touches)
    sides = np.minimum(np.arange(n_cells) % n_sides, n_units - 1)
    of_nodes = np.clip(np.arange(n_cells) // n_sides - 1, 0, n_units - 1)
    upper, lower = (np.concatenate(own) for own in ((sides, of_nodes), (of_nodes, sides)))
    return replace(placed, phalanges=upper), replace(placed, phalanges=lower)


def _met(
    units: UnitSolutions,
    formulate: Formulate,
    thickness: Array,
    seen_from: Sequence[FingerFrame],
    codes: Sequence[Codes],
) -> tuple[Grasped, Grasped]:
    """Upper and lower fingers in these states, (row,) each, that come together."""
    finger, n_rows = units.finger, len(codes[0])
    needed = distinct(np.concatenate(list(codes)))
    free = settle(units, formulate, inverted_units(needed, finger.n_units), DEFAULT_TOLERANCE)
    lanes = [np.searchsorted(needed, own) for own in codes]
    x = np.stack([free.equilibrium.coordinates[:, own] for own in lanes], axis=1)
    x = x.reshape(-1, n_rows)
    pattern = np.concatenate([inverted_units(own, finger.n_units) for own in codes])
    axis = seen_from[0].axis
    own = Obstructed(units, formulate, thickness, (), np.zeros(1), axis=axis)
    face = Face.of(free.potential.coordinates, thickness).with_end()
    nodes = face.shape(free.equilibrium.coordinates).nodes
    travel = way_of(*(along_axis(axis, nodes[..., own]) for own in lanes))
    status = np.max([free.status[own] for own in lanes], axis=0)
    coming = apart(own, travel)
    came = coming_together(coming, x, pattern, status, MARGIN_TO)
    upper, lower = described(coming, codes, came, with_lost(status, came.shapes.is_there))
    return upper, lower


def apart(own: Obstructed, travel: Array) -> Obstructed:
    """Two fingers whose bases come together by a travel, (lane,) mm."""
    assert own.axis is not None, "they meet"
    half = 0.5 * own.axis.normal[:, None]
    motion = Motion((half, half), travel=travel[None], is_of_bases=True)
    return replace(own, depth=np.zeros(1), motion=motion)


def coming_together(
    coming: Obstructed,
    x: Array,
    pattern: Flags,
    status: NDArray[np.uint8],
    beyond: float | None,
    push: Array | None = None,
) -> Approach:
    """How fingers in balance do so, from coordinates (size, lane) of both and pushes of a body."""
    assert coming.motion is not None and coming.motion.travel is not None, "they come"
    start = np.concatenate((x, -coming.motion.travel))
    return grown(coming, start, pattern, np.asarray(status == Status.STABLE), beyond, push)


def along_axis(axis: Axis, nodes: Array) -> Array:
    """Places along the axis and heights over it, (2, node, lane), of a finger's nodes."""
    x, y = axis.normal
    return np.stack((y * nodes[0] - x * nodes[1], axis.height(nodes)))


def way_of(upper: Array, lower: Array) -> Array:
    """How far apart bases are moved for fingers just to touch, mm, (lane,): at least 0.

    Of places along the axis and heights of their nodes, (2, node, lane): a node of one touches a
    side of the other that faces it.
    """
    depth = np.zeros(upper.shape[2])
    for nodes, sides in ((upper, lower), (lower, upper)):
        start, side = sides[:, None, :-1], np.diff(sides, axis=1)[:, None]
        away = nodes[0][:, None] - start[0]
        is_over = (away >= 0.0) & (away <= side[0]) & (side[0] > 0.0)
        share = away / np.where(is_over, side[0], 1.0)
        height = nodes[1][:, None] + start[1] + share * side[1]
        depth = np.maximum(depth, np.where(is_over, -height, 0.0).max(axis=(0, 1)))
    return depth
