"""The stages of a routine without feedback, of many fingers at once: each as far as it is checked.

Fingers stay as they are while the gripper moves; as pressures change, the body is kept in its
place. What is told of each stage is a `Grasps`, a row for each lane.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import TypeVar

import numpy as np

from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.pulses import Pulse
from dpgcli.arrays import Array, Codes, Flags, Indices
from dpgcli.design.bodies import Body, at_place
from dpgcli.design.pressure import Pressure
from dpgcli.design.scene import Held, Scene
from dpgcli.grasping.approach import Approach, approach
from dpgcli.grasping.clearance import Clearance, clearance, outlines
from dpgcli.grasping.closing import at_rest, driven, with_reach
from dpgcli.grasping.frames import FingerFrame, frames
from dpgcli.grasping.grasp import described, placed
from dpgcli.grasping.grasped import Grasped, Placed
from dpgcli.grasping.pull import Pulled, borne
from dpgcli.grasping.release import let_go, motion_of, moved_by, turned_by
from dpgcli.grasping.shapes import ContactShapes, Ramp
from dpgcli.grasping.table import Grasps
from dpgcli.grasping.travels import with_reasons
from dpgcli.mechanics.terms import chain_potential
from dpgcli.records import dataclass
from dpgcli.states.certify import Status

AWAY = 1e4  # times the length of a finger: out of everybody's way


@dataclass(frozen=True)
class Task:
    """A gripper under pressure, the body at its place, and from where it comes, `begin` (2,) mm."""

    scene: Scene
    pressed: Pressed
    begin: Array

    @property
    def body(self) -> Body:
        """The body at its place."""
        assert self.scene.body is not None, "a scene with a body"
        return self.scene.body

    @property
    def lines(self) -> Pressure:
        """The lines of pressure."""
        assert self.scene.pressure is not None, "a scene with pressure"
        return self.scene.pressure

    @cached_property
    def frames(self) -> tuple[FingerFrame, ...]:
        """The frames of both fingers."""
        return frames(self.scene.gripper)

    @cached_property
    def is_alike(self) -> bool:
        """Whether both fingers meet the same."""
        return bool(self.body.is_mirrored)

    def centers(self, n_lanes: int) -> Array:
        """The body's place, (2, lane)."""
        return np.repeat(self.body.center[:, None], n_lanes, axis=1)

    def begins(self, n_lanes: int) -> Array:
        """Where it comes from, (2, lane)."""
        return np.repeat(self.begin[:, None], n_lanes, axis=1)

    def pressures(self, sequences: Sequence[Sequence[Pulse]]) -> Array:
        """Pressures of each lane's pulses, there and back, (step, unit, lane), in MPa."""
        line_of = self.lines.line_of
        n_steps = 2 * max(map(len, sequences), default=0)
        steps = np.zeros((n_steps, len(line_of), len(sequences)))
        for lane, pulses in enumerate(sequences):
            for place, pulse in enumerate(pulses):
                steps[2 * place, line_of == pulse.line, lane] = pulse.peak
        return steps


Parts = tuple[Placed, ...]
"""The upper and the lower finger, one and the same where both meet the same."""

T = TypeVar("T")


def _each(parts: Parts, work: Callable[[Placed], T]) -> tuple[T, ...]:
    """Work on every finger; on one, if both are the same."""
    if parts[-1] is parts[0]:
        return (work(parts[0]),) * len(parts)
    return tuple(map(work, parts))


def beside(task: Task, codes: Codes) -> Parts:
    """Fingers in open states, (lane,), with the body at its place: it grows there."""
    parts: list[Placed] = []
    for frame in task.frames:
        if parts and task.is_alike:
            parts.append(parts[0])
            continue
        part = placed(task.scene, chain_potential, task.body, frame, codes)
        parts.append(replace(part, own=with_reach(part.own)))
    return tuple(parts)


def pulsed(
    task: Task, parts: Parts, sequences: Sequence[Sequence[Pulse]], limit: float
) -> tuple[Parts, Array]:
    """The same after pulses, of each lane its own, with the body kept in its place.

    Also how far peaks are from the nearest threshold with the body there, (lane,), as a share of
    the peak: one that was passed, or the next one up to the pressure `limit`, MPa, or where nothing
    is found on the way there; infinite where there are none.
    """
    history = task.pressures(sequences)
    near = np.full(len(sequences), np.inf)
    for peak in history[::2]:
        both = _each(parts, partial(_pulsed, task, peak=peak, limit=limit))
        parts = tuple(part for part, _ in both)
        near = np.min([near, *(own for _, own in both)], axis=0)
    return parts, near


def _pulsed(task: Task, part: Placed, peak: Array, limit: float) -> tuple[Placed, Array]:
    """A finger after a pulse to pressures (unit, lane), and how near these are to thresholds."""
    volumes, size = task.pressed.volumes, np.abs(peak).max(axis=0)
    there = driven(part.own, Approach(part.grown.shapes, part.grown.load, ()), volumes, peak[None])
    near = np.full(len(size), np.inf)
    for told in there.resets:
        near[told.lanes] = 1.0 - told.load  # the last one counts
    further = np.where(size > 0.0, limit / np.where(size > 0.0, size, 1.0) - 1.0, 0.0)
    beyond = replace(part.own, depth=np.zeros(1), ramp=Ramp(volumes, peak, further * peak))
    onwards = approach(beyond, there.shapes, 0.0 * size, 0.0 * size + 1.0, to_reset=True)
    is_lost = there.shapes.is_there & ~onwards.shapes.is_there
    ahead = np.where(is_lost & (size > 0.0), further * onwards.load, np.inf)
    for told in onwards.resets:
        share = further[told.lanes] * told.load
        ahead[told.lanes] = np.minimum(ahead[told.lanes], share)
    back = driven(part.own, there, volumes, 0.0 * peak[None], peak)
    return _with_status(part, at_rest(part.own, back, volumes)), np.minimum(near, ahead)


def _with_status(part: Placed, came: Approach) -> Placed:
    return Placed(part.codes, part.own, came, with_reasons(part.own, came.shapes, part.status))


def some(parts: Parts, index: Indices) -> Parts:
    """The fingers of some lanes, without what happened to them."""

    def taken(part: Placed) -> Placed:
        came = Approach(part.grown.shapes.take_lanes(index), part.grown.load[index], ())
        own = part.own.take_lanes(index)
        return Placed(part.codes[index], own, came, part.status[index])

    return _each(parts, taken)


def kept(task: Task, parts: Parts, centers: Array, turned: Array | float = 0.0) -> Grasps:
    """Fingers with the body kept at `centers`, (2, lane), where it has `turned`, (lane,)."""
    scene = replace(task.scene, held=Held.FIXED, friction=None)
    rows = np.tile(np.arange(centers.shape[1]), (len(parts), 1))
    fingers = _each(parts, _described)
    return Grasps(scene, task.body, task.frames, fingers, rows, centers, turned=turned)


def _described(part: Placed) -> Grasped:
    (told,) = described(part.own, [part.codes], part.grown, part.status, with_margins=False)
    return told


def free(task: Task, codes: Codes, centers: Array) -> Grasps:
    """Fingers in states that nothing touches, the body far from them; told to be at `centers`."""
    away = task.body.center + AWAY * task.scene.finger.straight_length.max() * np.array([1.0, 0.0])
    far = replace(task, scene=replace(task.scene, body=replace(task.body, center=away)))
    return replace(kept(far, beside(far, codes), centers), body=task.body)


def are_touched(found: Grasps) -> Flags:
    """Rows whose body every finger touches."""
    return np.asarray(np.all([(own.push > 0.0).any(axis=0) for own in found.fingers], axis=0))


def way(task: Task, found: Grasps, begin: Array, end: Array) -> Clearance:
    """How near the body comes to the fingers on its way, (2, lane) mm, as they are."""
    finger = task.scene.finger
    height, length = finger.segment_height[0], finger.segment_length[-1]
    around = [
        outlines(own, frame, height, length)
        for own, frame in zip(found.fingers, found.frames, strict=True)
    ]
    body = at_place(task.body, task.body.center, found.turned)
    return clearance(np.concatenate(around), body, begin, end)


def lifted(task: Task, parts: Parts) -> tuple[Grasps, Parts]:
    """What becomes of fingers as the body leaves its support, and of the body; what it bears.

    A body that is fixed stays, and only friction tells. Also the fingers where it then is.
    """
    scene, n = task.scene, len(parts[0].codes)
    lanes = [np.arange(n) for _ in parts]
    motion = motion_of(task.body, scene.held, task.frames)
    if motion is None:
        found, rest, after = kept(task, parts, task.centers(n)), None, parts
    else:
        fingers, motions, rest = let_go(parts, lanes, motion, scene.held, with_margins=False)
        centers = task.centers(n) + moved_by(task.body, scene.held, motions)
        turned = turned_by(task.body, scene.held, motions)
        found = replace(kept(task, parts, centers), fingers=fingers, turned=turned)
        after = _apart(task, parts, found, rest)
    found = replace(found, scene=scene)
    if scene.friction is None:
        return found, after
    pulled = Pulled(task.body, scene.held, task.frames, scene.friction, scene.gravity)
    is_there = found.fingers[0].status == Status.STABLE
    return replace(found, borne=borne(pulled, parts, lanes, rest, is_there)), after


def _apart(task: Task, parts: Parts, found: Grasps, rest: ContactShapes) -> Parts:
    """The fingers of bodies that have moved, each by itself, with the body kept where it is."""
    places = np.where(np.isnan(found.centers), task.body.center[:, None], found.centers)
    body = at_place(task.body, places, np.nan_to_num(found.turned))
    n_units, n_before, after = task.scene.finger.n_units, 0, []
    joint = replace(parts[0].own, bodies=tuple(part.own.bodies[0] for part in parts))
    for finger, (part, frame) in enumerate(zip(parts, found.frames, strict=True)):
        own = replace(part.own, bodies=(frame.obstacle(body),))
        cells = slice(n_before, n_before + own.n_gaps)
        units = slice(finger * n_units, (finger + 1) * n_units)
        shapes = ContactShapes(
            joint.of_finger(rest.coordinates, finger),
            rest.push[cells],
            rest.active[cells],
            rest.inverted[units],
            rest.is_there,
        )
        status = found.fingers[finger].status
        came = Approach(shapes, np.ones(len(status)), ())
        after.append(Placed(part.codes, own, came, status))
        n_before = cells.stop
    return tuple(after)
