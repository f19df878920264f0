"""What the fingers of many designs do with a body in their way: columns of their states."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Codes, Columns, Indices
from dpgcli.design.bodies import Body, Friction
from dpgcli.design.loads import DOWN
from dpgcli.design.scene import Gripper, Held
from dpgcli.equilibrium.contracts import LaneArray
from dpgcli.grasping.frames import FingerFrame, frames
from dpgcli.grasping.grasp import described, met
from dpgcli.grasping.grasped import Grasped, Placed
from dpgcli.grasping.joining import Joined, joined
from dpgcli.grasping.release import let_go, motion_of, moved_by, turned_by, turns
from dpgcli.grasping.table import ANGLE, BETWEEN, COLUMNS, OF_FRICTION, OF_PAIRS
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status
from dpgcli.states.columns import Column, Group, Kind
from dpgcli.states.patterns import inverted_units, texts
from dpgcli.states.units import UnitSolutions

NAMES = (
    *("pattern_after", "n_contacts", "finger_force_x_N", "finger_force_y_N", "squeeze_N"),
    *(BETWEEN, "max_contact_N", "object_x_mm", "object_y_mm", ANGLE, "penetration_mm"),
)


def grasp_columns(
    *, is_pair: bool, has_friction: bool = False, may_turn: bool = False
) -> tuple[Column, ...]:
    """The columns of states about a body: those of `dpg grasp`, and what became of the grasp.

    >>> [column.name for column in grasp_columns(is_pair=False)][:3]
    ['grasp_status', 'pattern_after', 'n_contacts']
    """
    known = {column.name: column for column in COLUMNS}
    names = (*NAMES, *(OF_FRICTION if has_friction else ()))
    left_out = {*(() if is_pair else OF_PAIRS), *(() if may_turn else (ANGLE,))}
    told = [known[name] for name in names if name not in left_out]
    return (
        Column("grasp_status", "", "status with the body there", Group.GRASP, Kind.STATUS),
        *(
            Column(c.name, c.unit, c.description, Group.GRASP, c.kind, outputs=c.outputs)
            for c in told
        ),
    )


class Encounter(NamedTuple):
    """Units, layers (mm), grippers if any, and bodies that meet, each by lane; how bodies are held.

    Friction, if there is any, is by lane as well, the direction of gravity is one for all. A lane
    is a state of a design.
    """

    units: UnitSolutions
    layer: Array
    gripper: Gripper | None
    body: Body
    held: Held
    friction: Friction | None = None
    gravity: tuple[float, float] = DOWN


def grasp_rows(own: Encounter, codes: Codes) -> Columns:
    """The columns of states (lane,): both fingers of a gripper are in the same one."""
    seen_from = frames(own.gripper)
    parts = [_met(own, frame, codes) for frame in seen_from[:1]]
    motion, rest = motion_of(own.body, own.held, seen_from), None
    every, met = np.arange(len(codes)), list[Joined]()
    if motion is None:
        fingers = [_told(parts[0])]
        for frame in seen_from[1:]:
            part, lower = _lower(own, frame, codes, parts[0], fingers[0])
            parts.append(part)
            fingers.append(lower)
        if len(parts) > 1:
            is_on_axis = np.asarray(own.body.is_mirrored)
            met = list(joined(parts, [every, every], seen_from[0].axis, is_on_axis))
            fingers = [_with_met(finger, met, place) for place, finger in enumerate(fingers)]
        moved, turned = np.zeros((2, len(codes))), np.zeros(len(codes))
    else:
        parts += [_met(own, frame, codes) for frame in seen_from[1:]]
        index = [every] * len(parts)
        found, by, rest = let_go(parts, index, motion, own.held, with_margins=False)
        fingers = [_Finger.of(finger) for finger in found]
        is_held = fingers[0].status == Status.STABLE
        moved = np.where(is_held, moved_by(own.body, own.held, by) + 0.0, np.nan)
        turned = np.where(is_held, turned_by(own.body, own.held, by) + 0.0, np.nan)
    rows = _rows(own, seen_from, fingers, moved, turned)
    if own.friction is None:
        return rows
    from dpgcli.grasping.pull import Pulled, bearing_together, borne

    pulled = Pulled(own.body, own.held, seen_from, own.friction, own.gravity)
    is_there = np.asarray(rows["grasp_status"] == Status.STABLE)
    alone = borne(pulled, parts, [every] * len(parts), rest, is_there)
    columns = bearing_together(pulled, alone, met)
    return {**rows, **columns, "fails_first": columns["fails_first"].astype("S")}


class _Finger(NamedTuple):
    """What is told of a finger, by lane: forces in its own frame."""

    status: NDArray[np.uint8]
    after: Codes
    n_contacts: Indices
    force: Array
    largest: Array
    gap: Array
    between: Array

    @classmethod
    def of(cls, told: Grasped) -> "_Finger":
        n_contacts = np.asarray((told.push > 0.0).sum(axis=0))
        largest, between = told.push.max(axis=0), told.size_between
        return cls(told.status, told.after, n_contacts, told.force, largest, told.gap, between)

    def with_lanes(self, index: Indices, others: "_Finger") -> "_Finger":
        """With those at `index` replaced."""
        return _Finger(
            _put(self.status, index, others.status),
            _put(self.after, index, others.after),
            _put(self.n_contacts, index, others.n_contacts),
            _put(self.force, index, others.force),
            _put(self.largest, index, others.largest),
            _put(self.gap, index, others.gap),
            _put(self.between, index, others.between),
        )


def _put(values: LaneArray, index: Indices, others: LaneArray) -> LaneArray:
    changed = values.copy()
    changed[..., index] = others
    return changed


def _met(own: Encounter, frame: FingerFrame, codes: Codes) -> Placed:
    return met(own.units, chain_potential, own.layer, own.body, frame, codes)


def _told(part: Placed) -> _Finger:
    (told,) = described(part.own, [part.codes], part.grown, part.status, with_margins=False)
    return _Finger.of(told)


def _lower(
    own: Encounter, frame: FingerFrame, codes: Codes, part: Placed, upper: _Finger
) -> tuple[Placed, _Finger]:
    """The lower finger: the upper one's mirror image where the body is on the axis."""
    body = frame.obstacle(own.body)
    part = replace(part, own=replace(part.own, bodies=(body,)))
    off = np.flatnonzero(~own.body.is_mirrored)
    if not len(off):
        return part, upper
    few = own._replace(
        units=own.units.take_lanes(off), layer=own.layer[off], body=own.body.take_lanes(off)
    )
    other = _met(few, frame.take_lanes(off), codes[off])
    return part.with_lanes(off, other), upper.with_lanes(off, _told(other))


def _with_met(finger: _Finger, met: Sequence[Joined], place: int) -> _Finger:
    """With what has become of fingers that overlapped."""
    for some in met:
        finger = finger.with_lanes(some.rows, _Finger.of(some.fingers[place]))
    return finger


def _rows(
    own: Encounter,
    seen_from: Sequence[FingerFrame],
    fingers: Sequence[_Finger],
    moved: Array,
    turned: Array,
) -> Columns:
    status = np.max([finger.status for finger in fingers], axis=0)
    is_there = status == Status.STABLE
    forces = [frame.outside(f.force) for frame, f in zip(seen_from, fingers, strict=True)]

    def known(values: Array) -> Array:
        return np.where(is_there, values + 0.0, np.nan)  # no negative zero

    n_units = own.units.finger.n_units
    place = own.body.center + moved
    rows: Columns = {
        "grasp_status": status,
        "pattern_after": np.where(is_there, _after(fingers, n_units), b""),
        "n_contacts": np.where(is_there, sum(finger.n_contacts for finger in fingers), 0),
        "finger_force_x_N": known(forces[0][0]),
        "finger_force_y_N": known(forces[0][1]),
        "squeeze_N": known(0.5 * (forces[-1][1] - forces[0][1])),
        BETWEEN: known(fingers[0].between if own.held is Held.FIXED else np.nan + moved[0]),
        "max_contact_N": known(np.max([finger.largest for finger in fingers], axis=0)),
        "object_x_mm": place[0],
        "object_y_mm": place[1],
        ANGLE: np.degrees(turned),
        "penetration_mm": known(np.max([np.maximum(0.0, -f.gap) for f in fingers], axis=0)),
    }
    may_turn = turns(own.body, own.held)
    columns = grasp_columns(is_pair=len(fingers) > 1, may_turn=may_turn)
    return {column.name: rows[column.name] for column in columns}


def _after(fingers: Sequence[_Finger], n_units: int) -> NDArray[np.bytes_]:
    """Patterns, upper/lower where they differ."""
    upper, *others = (texts(inverted_units(finger.after, n_units)) for finger in fingers)
    for lower in others:
        both = np.char.add(np.char.add(upper, b"/"), lower)
        return np.where(upper == lower, upper, both)
    return upper
