"""Bodies that are pulled along gravity while their fingers stick to them: what comes first.

The pull that friction bears is that of `payload`. On the way there a unit may reset. Fingers are
followed: each sticks to the body at the place that it presses hardest, and its other places slide.
What held the body lets go first, and friction takes over; then the pull grows. The body moves with
its fingers as they give way, and turns if it is one that does when it is free.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dpgcli.arrays import Array, Columns, Flags, Indices
from dpgcli.design.bodies import Body, Friction
from dpgcli.design.scene import Held
from dpgcli.grasping.approach import Approach, approach
from dpgcli.grasping.closing import Closing, with_reach
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.frames import FingerFrame
from dpgcli.grasping.grasped import Placed
from dpgcli.grasping.joining import Joined
from dpgcli.grasping.payload import Contacts, payloads
from dpgcli.grasping.release import LANES, WAYS, motion_of, opened_by, released, together
from dpgcli.grasping.shapes import ContactShapes
from dpgcli.mechanics.sticking import Sticking
from dpgcli.records import dataclass
from dpgcli.states.certify import Status

SLIP, RESET, NONE = "slip", "reset", "none"


@dataclass(frozen=True)
class Pulled:
    """Bodies that are pulled on, how they were held, the frames of their fingers, and friction.

    One for all lanes or one for each; gravity is one for all.
    """

    body: Body
    held: Held
    frames: tuple[FingerFrame, ...]
    friction: Friction
    gravity: tuple[float, float]

    def take_lanes(self, index: Indices) -> "Pulled":
        """Those of some lanes."""
        frames = tuple(frame.take_lanes(index) for frame in self.frames)
        body, friction = self.body.take_lanes(index), self.friction.take_lanes(index)
        return Pulled(body, self.held, frames, friction, self.gravity)

    def columns(self, own: Obstructed, shapes: ContactShapes, is_there: Flags) -> Columns:
        """What fingers at rest bear, and what fails first, (lane,); the body may have moved.

        Up to the weight of the body, if its mass is known: one that is borne leaves nothing to
        fail. What is not there bears nothing that is known; nor where the search fails.
        """
        payload = np.full(len(is_there), np.nan)
        failing = np.where(is_there, SLIP, "").astype("U5")
        lanes = np.flatnonzero(is_there)
        if not len(lanes):
            return {"payload_N": payload, "fails_first": failing}
        few, rest = own.take_lanes(lanes), shapes.take_lanes(lanes)
        slip, share, is_reset = self.take_lanes(lanes)._borne(few, rest)
        payload[lanes] = slip * np.minimum(share, 1.0)
        failing[lanes[is_reset]] = RESET
        failing[np.isnan(payload)] = ""
        if self.friction.weight is not None:
            failing[payload >= self.friction.weight] = NONE
        return {"payload_N": payload, "fails_first": failing}

    def _borne(self, own: Obstructed, shapes: ContactShapes) -> tuple[Array, Array, Flags]:
        """The pull that the forces of the grasp bear, N, the share of it up to which fingers hold.

        And which of them then reset; all (lane,).
        """
        contacts = self._contacts(own, shapes)
        slip = payloads(Contacts.joined(contacts), self.friction.coefficient, self.gravity)
        is_touched = np.all([(part.push > 0.0).any(axis=0) for part in contacts], axis=0)
        slip = np.where(is_touched, slip, 0.0)  # one finger of two lets the body go
        share, is_reset = np.full(len(slip), np.inf), np.zeros(len(slip), bool)
        lanes = np.flatnonzero(slip > 0.0)
        if len(lanes):
            few, rest = self._free(own.take_lanes(lanes), shapes.take_lanes(lanes), lanes)
            motion = few.motion
            assert motion is not None, "a body that may move"
            pull = np.zeros((motion.n, len(lanes)))
            pull[motion.ways] = np.multiply.outer(self.gravity, slip[lanes])
            friction = np.broadcast_to(self.friction.coefficient, len(slip))[lanes]
            share[lanes], is_reset[lanes] = followed(few, rest, friction, pull)
        return slip, share, is_reset

    def _contacts(self, own: Obstructed, shapes: ContactShapes) -> list[Contacts]:
        """Where each finger pushes, counted from the middle of the body."""
        here, middle = own.relabeled(shapes), self.body.middle.reshape(2, -1)
        motions, n = shapes.coordinates[own.n_own :], shapes.coordinates.shape[1]
        opened = opened_by(self.body, motions) if len(motions) else np.zeros(n)
        pairs = zip(self.frames, own.each(own.without_rounding(here.push)), strict=True)
        return [
            Contacts.of(push, gaps.touches(here.coordinates)).about(frame, middle, opened)
            for frame, (gaps, push) in pairs
        ]

    def _free(
        self, own: Obstructed, shapes: ContactShapes, lanes: Indices
    ) -> tuple[Obstructed, ContactShapes]:
        """The same fingers, with a body that may move along x and y, and turn if it is one to."""
        if self.held is Held.FREE:
            return own, shapes
        few, n_ways = self.take_lanes(lanes), WAYS[self.held].shape[1]
        motion = motion_of(few.body, Held.FREE, few.frames)
        assert motion is not None, "a body that may move"
        fingers, moved, others = np.split(shapes.coordinates, [own.n_own, own.n_own + n_ways])
        still = np.zeros((motion.n - len(moved) - len(others), len(lanes)))
        first = motion.ways.start
        parts = (fingers, still[:first], moved, still[first:], others)
        return replace(own, motion=motion), replace(shapes, coordinates=np.concatenate(parts))


def borne(
    pulled: Pulled,
    parts: Sequence[Placed],
    lanes: Sequence[Indices],
    rest: ContactShapes | None,
    is_there: Flags,
    closing: Closing | None = None,
) -> Columns:
    """The columns of fingers, those at `lanes` of each part, at rest about a body.

    In the shapes where it has been let go of, or as they were placed or have closed.
    """
    found: list[Columns] = []
    for at in range(0, max(len(is_there), 1), LANES):
        index = np.arange(at, min(at + LANES, len(is_there)))
        few = pulled.take_lanes(index)
        motion = motion_of(few.body, few.held, few.frames)
        own, shapes = together(parts, [own[index] for own in lanes], motion)
        own = own if closing is None else with_reach(own)
        shapes = shapes if rest is None else rest.take_lanes(index)
        found.append(few.columns(own, shapes, is_there[index]))
    return {name: np.concatenate([part[name] for part in found]) for name in found[0]}


def bearing_together(pulled: Pulled, known: Columns, met: Sequence[Joined]) -> Columns:
    """The columns of rows with those of fingers that touch each other as well.

    Of mirrored pairs that touch the body it is not known: what pulls on them need not be mirrored.
    """
    columns = {name: values.copy() for name, values in known.items()}
    for some in met:
        is_there = np.asarray(some.fingers[0].status == Status.STABLE)
        for at in range(0, len(some.rows), LANES):
            index = np.arange(at, min(at + LANES, len(some.rows)))
            few = some.take(index)
            told = _together(pulled.take_lanes(few.rows), few, is_there[index])
            for name, values in told.items():
                columns[name][few.rows] = values
    return columns


def _together(pulled: Pulled, met: Joined, is_there: Flags) -> Columns:
    if not met.own.is_mirrored:
        return pulled.columns(met.own, met.shapes, is_there)
    is_known = is_there & ~(met.fingers[0].push > 0.0).any(axis=0)
    payload = np.where(is_known, 0.0, np.nan)
    return {"payload_N": payload, "fails_first": np.where(is_known, SLIP, "")}


def followed(
    own: Obstructed, shapes: ContactShapes, friction: Array, pull: Array
) -> tuple[Array, Flags]:
    """The share of a pull, (motion, lane) N, up to which fingers hold, and which then reset.

    Both (lane,). Others slip there; the share is infinite where they hold, NaN where the search
    fails on the way. All fingers touch the body, which may move, with `friction` (lane,).
    """
    stuck, begun = _stuck(own, shapes, friction)
    freed = released(stuck, begun)
    is_lost = np.isfinite(_reset_at(freed)) | ~_stick(stuck, freed, 1.0)
    stands = freed.shapes.is_there & ~is_lost
    assert stuck.motion is not None, "a body that may move"
    pulled = replace(stuck, motion=replace(stuck.motion, hold=-pull))  # beyond 1 it pulls
    once = np.ones(pull.shape[1])
    begin = replace(freed.shapes, is_there=stands)
    came = approach(pulled, begin, once, 2.0 * once, to_reset=True, unfolded=True)
    reset_at = _reset_at(came)
    slips_at = np.where(_stick(stuck, came, 2.0), np.inf, came.load)
    is_known = is_lost | np.isfinite(reset_at) | (stands & came.shapes.is_there)
    share = np.where(is_lost, 0.0, np.minimum(reset_at, slips_at) - 1.0)
    is_reset = np.isfinite(np.where(is_lost, _reset_at(freed), reset_at))
    return np.where(is_known, share, np.nan), is_reset


def _reset_at(came: Approach) -> Array:
    """The load at which the first unit of each lane resets, infinite where none does."""
    load = np.full(len(came.load), np.inf)
    for reset in came.resets:
        load[reset.lanes] = np.minimum(load[reset.lanes], reset.load)
    return load


def _stick(stuck: Obstructed, came: Approach, end: float) -> Flags:
    """Which lanes all places stick in, up to a load; one that ends before has slipped, or reset."""
    sticks = (came.shapes.active | ~stuck.are_kept).all(axis=0)
    return np.asarray(sticks & (came.load >= end))


def _stuck(
    own: Obstructed, shapes: ContactShapes, friction: Array
) -> tuple[Obstructed, ContactShapes]:
    """Fingers that stick to their body, and their shapes."""
    here, places = own.relabeled(shapes), []
    for gaps, push in own.each(own.without_rounding(here.push)):
        places.append(Sticking.of(gaps, here.coordinates, push, friction[None]))
    nothing = np.zeros((len(places), here.push.shape[1]))
    active = np.concatenate((here.active, nothing == 0.0))
    push = np.concatenate((here.push, nothing))
    stuck = replace(own, depth=np.zeros(1), sticking=tuple(places))
    return stuck, replace(here, push=push, active=active)
