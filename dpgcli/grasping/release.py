"""Bodies that may move: let go of where they were placed, they go where forces on them balance.

The body has grown about the fingers while it was kept in its place. What keeps it is a force on
each of its motions; as that goes to nothing the body and its fingers move on, and units reset as
they must. A body that no finger keeps from moving on leaves them: there is no rest.

Polygons that are free turn, about the center of their area. Most of them are on edge before a
second place of a finger supports them, and mere forces would not keep them: of these bodies springs
do so too, and go to nothing as the forces do.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Indices, rotated
from dpgcli.design.bodies import Body, Jaws, Polygon, gives_way
from dpgcli.design.scene import Held
from dpgcli.grasping.approach import Approach, Load, approach
from dpgcli.grasping.closing import Closing, closed, with_reach
from dpgcli.grasping.contact import STIFFER, Obstructed
from dpgcli.grasping.frames import FingerFrame
from dpgcli.grasping.grasp import described
from dpgcli.grasping.grasped import Grasped, Placed, resets_of
from dpgcli.grasping.shapes import ContactShapes, Motion
from dpgcli.grasping.travels import with_reasons
from dpgcli.mechanics.aperture import KeptApart
from dpgcli.mechanics.face import Pivot
from dpgcli.mechanics.terms import Quadratic
from dpgcli.states.certify import Status

LANES = 1024  # at a time: each takes the squares of its coordinates a few times over
WAYS = {  # of a body's motions
    Held.FIXED: np.zeros((2, 0)),
    Held.GUIDED: np.array([[1.0], [0.0]]),
    Held.FREE: np.eye(2),
}


def motion_of(body: Body, held: Held, frames: Sequence[FingerFrame]) -> Motion | None:
    """How a body may move that is held so, in the frames of its fingers; None if it may not.

    The aperture of jaws that give way is the last of the motions: each plate goes half of it.
    """
    ways, resistance = WAYS[held][..., None], None
    pivots: tuple[Pivot, ...] = ()
    if turns(body, held):
        pivots = tuple(_pivot(body, frame) for frame in frames)
    apart = np.zeros((2, 0, 1))
    if isinstance(body, Jaws) and gives_way(body):
        apart = np.array([0.0, 0.5])[:, None, None]
        resistance = _resistance(body)
    if not ways.size and not apart.size:
        return None
    along = (np.concatenate((ways, frame.side * apart), axis=1) for frame in frames)
    told = zip(frames, along, strict=True)
    return Motion(tuple(frame.along(own) for frame, own in told), resistance, pivots=pivots)


def turns(body: Body | None, held: Held) -> TypeGuard[Polygon]:
    """Whether a body that is held so turns: a disc does so without a change, jaws do not."""
    return isinstance(body, Polygon) and held is Held.FREE


def _pivot(body: Polygon, frame: FingerFrame) -> Pivot:
    """The center of area, about which the furthest corner goes as far as a motion says."""
    point = frame.inside(body.middle).reshape(2, -1)
    return Pivot(point, np.array([frame.side * body.outer_radius]))


def _resistance(jaws: Jaws) -> Quadratic | KeptApart:
    """What opening jaws costs, by how far they are from their gap."""
    if jaws.curve is not None:
        return KeptApart(jaws.curve, np.reshape(jaws.gap, -1))
    assert jaws.stiffness is not None, "jaws that give way"
    return Quadratic(np.reshape(jaws.stiffness, (1, -1)))


def moved_by(body: Body, held: Held, motions: Array) -> Array:
    """How far reference points have moved, (2, lane), by motions, (motion, lane); mm."""
    ways, first = WAYS[held], int(turns(body, held))
    moved = np.asarray(ways @ motions[first : first + ways.shape[1]])
    if not first:
        return moved
    arm = (body.center - body.middle).reshape(2, -1)
    return moved + rotated(arm, turned_by(body, held, motions)) - arm


def turned_by(body: Body, held: Held, motions: Array) -> Array:
    """By which angles bodies have turned, (lane,), rad, counterclockwise."""
    return np.asarray(motions[0] / (body.outer_radius if turns(body, held) else np.inf))


def opened_by(body: Body, motions: Array) -> Array:
    """How far jaws have opened, (lane,), mm; other bodies, and rigid ones, do not."""
    return np.asarray(motions[-1] if gives_way(body) else 0.0 * motions[-1])


def let_go(
    parts: Sequence[Placed],
    lanes: Sequence[Indices],
    motion: Motion,
    held: Held,
    closing: Closing | None = None,
    *,
    with_margins: bool = True,
) -> tuple[tuple[Grasped, ...], Array, ContactShapes]:
    """Fingers at `lanes` of each part with a body between them that is let go of.

    On jaws that give way they close before that, if a closing is given. Also how far the bodies
    have moved, (motion, lane), mm, and the shapes of all of a lane. The motion is one for all, or
    by lane. A body that is not fixed, and that nothing touches, is not held.
    """
    n = len(lanes[0])
    chunks = []
    for at in range(0, max(n, 1), LANES):
        some = [index[at : at + LANES] for index in lanes]
        own = motion.take_lanes(np.arange(at, at + len(some[0])))
        chunks.append(_let_go(parts, some, own, held, closing, with_margins=with_margins))
    fingers = tuple(Grasped.joined(own) for own in zip(*(f for f, *_ in chunks), strict=True))
    moved = np.concatenate([by for _, by, _ in chunks], axis=1)
    return fingers, moved, ContactShapes.joined([shapes for *_, shapes in chunks])


def _let_go(
    parts: Sequence[Placed],
    lanes: Sequence[Indices],
    motion: Motion,
    held: Held,
    closing: Closing | None,
    *,
    with_margins: bool,
) -> tuple[tuple[Grasped, ...], Array, ContactShapes]:
    own, start = together(parts, lanes, motion if closing is None else _of_jaws(motion))
    gone = released(own, start)
    if closing is not None:
        own, gone = _closed_on_jaws(own, gone, motion, closing)
    codes = [part.codes[index] for part, index in zip(parts, lanes, strict=True)]
    before = [part.status[index] for part, index in zip(parts, lanes, strict=True)]
    status = np.max(before, axis=0)
    is_there, lost = gone.shapes.is_there, Status.NOT_CONVERGED
    if held is not Held.FIXED:
        is_there, lost = _is_held(own, gone.shapes), Status.NOT_HELD
    elif closing is not None:
        status = with_reasons(own, gone.shapes, status)
    is_lost = (status == Status.STABLE) & ~is_there
    status = np.where(is_lost, np.uint8(lost), status)
    is_beyond = _are_beyond(motion, gone.shapes.coordinates[own.n_own :])
    status = np.where((status == Status.STABLE) & is_beyond, np.uint8(Status.BEYOND_TABLE), status)
    if closing is None:  # of bodies that have got away there is where they were let go of
        away = np.flatnonzero(status == Status.NOT_HELD)
        gone.shapes.put(away, start.take_lanes(away))
    fingers = described(own, codes, gone, status, with_margins=with_margins)
    events = [resets_of(part.grown.resets, index) for part, index in zip(parts, lanes, strict=True)]
    told = zip(fingers, events, strict=True)
    fingers = tuple(replace(finger, resets=(*before, *finger.resets)) for finger, before in told)
    return fingers, gone.shapes.coordinates[own.n_own :], gone.shapes


def _of_jaws(motion: Motion) -> Motion:
    """The aperture alone, the last of the motions."""
    return replace(motion, directions=tuple(along[:, -1:] for along in motion.directions))


def _closed_on_jaws(
    own: Obstructed, beside: Approach, motion: Motion, closing: Closing
) -> tuple[Obstructed, Approach]:
    """Fingers closed on jaws that give way all the while, and then are let go of."""
    own = with_reach(own)
    came = closed(own, beside, closing)
    if motion.n == 1:
        return own, came
    fingers, aperture = np.split(came.shapes.coordinates, [own.n_own])
    kept = np.zeros((motion.n - 1, fingers.shape[1]))
    shapes = replace(came.shapes, coordinates=np.concatenate((fingers, kept, aperture)))
    own = replace(own, motion=motion)
    gone = released(own, shapes)
    return own, replace(gone, resets=(*came.resets, *gone.resets))


def _are_beyond(motion: Motion, moved: Array) -> NDArray[np.bool_]:
    """Which jaws are at an aperture beyond those of their table, by (motion, lane), mm.

    Or would be there without a push: no spec has such a gap, but a design of a sweep may.
    """
    law = motion.resistance
    if not isinstance(law, KeptApart):
        return np.zeros(moved.shape[1], bool)
    return np.asarray(law.curve.is_beyond(law.rest + moved[-1]) | law.curve.is_beyond(law.rest))


def _is_held(own: Obstructed, shapes: ContactShapes) -> NDArray[np.bool_]:
    """Which bodies are at rest, and touched at all."""
    push = own.without_rounding(shapes.push[: own.n_on_bodies])
    return np.asarray(shapes.is_there & (push > 0.0).any(axis=0))


def together(
    parts: Sequence[Placed], lanes: Sequence[Indices], motion: Motion | None
) -> tuple[Obstructed, ContactShapes]:
    """The fingers of a lane as one, with a body that may move: those at `lanes` of each part."""
    few = [part.grown.shapes.take_lanes(index) for part, index in zip(parts, lanes, strict=True)]
    alone = [part.own.take_lanes(index) for part, index in zip(parts, lanes, strict=True)]
    bodies = tuple(own.bodies[0] for own in alone)
    n = len(lanes[0])
    depth = np.max([np.broadcast_to(own.depth, n) for own in alone], axis=0)  # one for all, or not
    own = replace(alone[0], bodies=bodies, depth=depth, motion=motion)
    coordinates = np.stack([shapes.coordinates for shapes in few], axis=1).reshape(-1, n)
    shapes = ContactShapes(
        np.concatenate((coordinates, np.zeros((0 if motion is None else motion.n, n)))),
        np.concatenate([shapes.push for shapes in few]),
        np.concatenate([shapes.active for shapes in few]),
        np.concatenate([shapes.inverted for shapes in few]),
        np.all([shapes.is_there for shapes in few], axis=0),
    )
    return own, shapes


def released(own: Obstructed, shapes: ContactShapes) -> Approach:
    """Let go of bodies that were kept where they are."""
    assert own.motion is not None, "a body that may move"
    begin = np.zeros(shapes.coordinates.shape[1])
    potential = own.pressed(shapes.inverted, shapes.push, begin + 1.0)
    kept = potential.evaluate(shapes.coordinates).gradient[own.n_own :]
    spring = own.stiffness / STIFFER if own.motion.pivots else None
    motion = replace(own.motion, hold=kept, spring=spring)
    keeping = replace(own, depth=np.zeros(1), motion=motion)
    gone = approach(keeping, shapes, begin, begin + 1.0)
    return replace(gone, resets=tuple(replace(own, of=Load.RELEASE) for own in gone.resets))
