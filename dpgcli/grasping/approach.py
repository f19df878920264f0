"""How fingers come to touch a body: it grows at its place, or moves to it, and units reset.

Contacts close and open on the way without any change of shape. Where a finger loses its balance, a
unit resets (or snaps), exactly at the fold, and the finger goes downhill with the body as it is
there; then the body goes on.
"""

from dataclasses import field, replace
from enum import StrEnum
from typing import Any

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.path import Ends, to_events
from dpgcli.equilibrium.walk import PathEnd, Walk
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.descent import finished, relaxed
from dpgcli.grasping.shapes import ContactShapes
from dpgcli.grasping.ties import tied
from dpgcli.grasping.travels import about_to_change, with_lost_domes
from dpgcli.records import dataclass

DISPLACED = 1e-3  # of a stroke: from a fold to where downhill is told from level
SKIPPED, OVER_KINK = 1e-6, 1e-4  # of the way: beyond a fold; over a kink that no path leads over
MOST_HALTS = 40  # by unit
MOST_KINKS, KINK_ROOM = 8, 1e-3  # kinks one after the other: of the way between two of them
MOST_NEAR = 10  # halts, by unit, as near to each other: contacts that close and open on end
JUMPED = 1e-3  # of a stroke: what is closer has not jumped
MOST_CHANGES, OUT_OF_ORDER = 8, 1e-12  # of contacts in the end; of a stroke
LOOKS, STAGES = 256, 8  # places on a way at which contacts are looked for: before one, and after


class Load(StrEnum):
    """What the load was at which units left their wells, as tables tell it."""

    BODY = ""
    MEETING = " of coming together"
    RELEASE = " of letting go"


@dataclass(frozen=True)
class Reset:
    """Units that left their wells in some lanes: `flipped` (unit, lane) at loads (lane,).

    `push` (cell, lane) are the pushes, N, at the fold; `snapped` are those that are inverted now.
    Where it is pressures that changed, `pressure` (unit, lane), MPa, is that of each unit, and
    `tied` (unit, lane) are those whose thresholds are the same, if there are several. Loads are
    shares `of` what grew: the body, mostly.
    """

    lanes: Indices
    load: Array
    flipped: Flags
    push: Array
    snapped: Flags
    tied: Flags
    pressure: Array | None = None
    of: Load = Load.BODY

    def take(self, index: Indices) -> "Reset":
        """The same of some of the lanes, by their places here."""
        arrays = {key: part for key, part in vars(self).items() if isinstance(part, np.ndarray)}
        parts: dict[str, Any] = {key: part[..., index] for key, part in arrays.items()}
        return replace(self, **parts)

    def take_units(self, units: slice) -> "Reset":
        """The same of some units only."""
        pressure = None if self.pressure is None else self.pressure[units]
        flags = self.flipped, self.snapped, self.tied
        flipped, snapped, tied = (part[units] for part in flags)
        return replace(self, flipped=flipped, snapped=snapped, tied=tied, pressure=pressure)


@dataclass(frozen=True)
class Approach:
    """Where fingers came to rest against bodies, what happened on the way, and how far they came.

    `load` (batch,) is 1 where the body is there in full. `margin` (batch,) is what more of it they
    bear before a unit resets, if that is known: infinite where none does, NaN where the search
    fails. Of fingers that have closed `stops` are where they began, and at each pressure since.
    """

    shapes: ContactShapes
    load: Array
    resets: tuple[Reset, ...]
    margin: Array | None = None
    stops: tuple[ContactShapes, ...] = ()


class Way(StrEnum):
    """How fingers and a body come to touch."""

    PLACE = "place"
    CLOSE = "close"
    INSERT = "insert"


def moved_in(obstructed: Obstructed, start: ContactShapes) -> Approach:
    """Let a body move to its place as its motion says, from where no finger touches it."""
    met = _share_before_contact(obstructed, start)
    shapes = obstructed.moved_to(start, met)
    came = Approach(shapes, met, ())
    for share in (0.0, *np.arange(1, STAGES + 1) / STAGES):
        end = met + np.maximum(1.0 / LOOKS, share * (1.0 - met))
        onwards = approach(obstructed, came.shapes, came.load, np.minimum(end, 1.0))
        came = Approach(onwards.shapes, onwards.load, (*came.resets, *onwards.resets))
    return came


def _share_before_contact(obstructed: Obstructed, start: ContactShapes) -> Array:
    """The share of its way that a body has come before it touches a finger, (batch,)."""
    share = np.zeros(start.coordinates.shape[1])
    for look in np.arange(1, LOOKS + 1) / LOOKS:
        there = obstructed.moved_to(start, 0.0 * share + look)
        gaps = obstructed.gaps()(there.coordinates).value[: obstructed.n_gaps]
        is_clear = (gaps.min(axis=0) > 0.0) & (share >= look - 1.5 / LOOKS)
        share = np.where(is_clear, look, share)
    return share


def approach(
    obstructed: Obstructed,
    start: ContactShapes,
    load: Array,
    end: Array,
    *,
    to_reset: bool = False,
    unfolded: bool = False,
    beyond: float | None = None,
) -> Approach:
    """Let bodies grow from one load to another, (batch,), about fingers in balance.

    With `to_reset` only as far as to where a first unit resets or snaps; nowhere beyond where a
    place that sticks begins to slide. With a load `beyond` the end they go on to there for their
    margins, in the same batch. On the way to a margin, or if they are to stay `unfolded`, those
    are lost that are folded where something happens.
    """
    came = _Journey.at(
        obstructed, start, load, end, to_reset=to_reset, unfolded=unfolded, beyond=beyond
    )
    while len(came.lanes) or len(came.waiting):
        if 2 * len(came.lanes) > sum(len(lanes) for lanes, *_ in came.waiting):
            came.go_on(obstructed)
        else:
            came.fall(obstructed)
    if beyond is None:
        _put_right(obstructed, came.shapes, came.load)
        return Approach(came.shapes, came.load, tuple(came.resets))
    return Approach(came.arrived, np.minimum(came.load, end), tuple(came.resets), came.margin)


@dataclass
class _Journey:
    """Fingers and bodies under way, by lane: at `load`, to an `end`; `lanes` are those that go on.

    Their `walk` has come so far, unless they are `fresh`. Those that have lost their balance are
    `waiting` for each other, to fall together: how they `stopped`, and with which pushes. `n_halts`
    counts halts, `n_kinks` and `n_near` kinks and halts that are near to the ones before. With a
    load `beyond` shapes at the end are `arrived`, and those beyond it `are_beyond` to a first
    reset.
    """

    shapes: ContactShapes
    load: Array
    end: Array
    lanes: Indices
    fresh: Flags
    n_halts: Indices
    n_kinks: Indices
    last_kink: Array
    n_near: Indices
    to_reset: bool
    unfolded: bool
    beyond: float | None
    arrived: ContactShapes
    are_beyond: Flags
    margin: Array
    walk: Walk | None = None
    resets: list[Reset] = field(default_factory=list)
    waiting: list[tuple[Indices, Ends, Array]] = field(default_factory=list)

    @classmethod
    def at(
        cls,
        obstructed: Obstructed,
        start: ContactShapes,
        load: Array,
        end: Array,
        *,
        to_reset: bool,
        unfolded: bool,
        beyond: float | None,
    ) -> "_Journey":
        """Before the first step."""
        n = len(load)
        shapes, arrived = (start.take_lanes(np.arange(n)) for _ in range(2))
        lanes, none = np.flatnonzero(shapes.is_there & (load < end)), np.zeros(n, int)
        arrived.is_there[lanes] = False
        counts = none.copy(), none.copy(), np.full(n, -np.inf), none.copy()
        unknown = np.full(n, np.nan)
        return cls(
            shapes, load.copy(), end.copy(), lanes, none == 0, *counts, to_reset,
            unfolded, beyond, arrived, none > 0, unknown,
        )  # fmt: skip

    def go_on(self, obstructed: Obstructed) -> None:
        """Go on to where some lanes halt."""
        lanes, shapes = self.lanes, self.shapes
        own = obstructed if len(lanes) == len(self.load) else obstructed.take_lanes(lanes)
        few = shapes.take_lanes(lanes)
        fresh = np.flatnonzero(self.fresh[lanes])
        if len(fresh):
            begun = own.take_lanes(fresh)
            again = begun.relabeled(few.take_lanes(fresh))
            if own.n_travels:
                again = about_to_change(begun, again, self.load[lanes[fresh]])
            few.put(fresh, again)
            shapes.put(lanes, few)
        family, stacked = own.family(few.inverted, few.active), own.stacked(few)
        walk = self.walk and self.walk.resized(len(stacked))
        args = self.load[lanes], self.end[lanes], walk and walk.only(lanes), fresh
        ends, gone = to_events(family, stacked, *args)
        if walk is None:
            walk = gone.only(np.zeros(len(self.load), int))
        walk.put(lanes, gone, np.arange(len(lanes)))
        self.walk, self.fresh[lanes] = walk, False
        halted = np.flatnonzero(ends.outcome >= 0)
        self.lanes = lanes[ends.outcome < 0]
        if len(halted):
            self._halt(obstructed, lanes[halted], few.take_lanes(halted), ends.take_lanes(halted))

    def _halt(self, obstructed: Obstructed, lanes: Indices, few: ContactShapes, ends: Ends) -> None:
        """Change contacts where paths have ended; let those wait that have lost their balance."""
        own = obstructed.take_lanes(lanes)
        ends = _told(own, few, ends)
        moved = _at_ends(own, few, ends)
        is_watched = self.unfolded | self.are_beyond[lanes]
        if is_watched.any():
            moved.is_there[is_watched & own.are_folded(moved)] = False
        self.shapes.put(lanes, moved)
        self.load[lanes] = np.where(moved.is_there, self.load[lanes], ends.load)
        falls = np.flatnonzero(moved.is_there & (_beyond(ends) > 0.0))
        goes = np.flatnonzero(moved.is_there & (_beyond(ends) == 0.0))
        if len(falls):
            self.waiting.append((lanes[falls], ends.take_lanes(falls), moved.push[:, falls]))
        nothing = np.zeros((len(few.inverted), len(goes)), bool)
        self._leave(obstructed, lanes[goes], ends.take_lanes(goes), nothing)

    def fall(self, obstructed: Obstructed) -> None:
        """Let all lanes fall that have lost their balance."""
        parts, size = self.waiting, len(self.shapes.coordinates)
        self.waiting = []
        lanes = np.concatenate([lanes for lanes, *_ in parts])
        ends = Ends.joined([ends for _, ends, _ in parts], size)
        order = np.argsort(lanes)
        lanes, ends = lanes[order], ends.take_lanes(order)
        own, begun = obstructed.take_lanes(lanes), self.shapes.take_lanes(lanes)
        there = _fallen(own, begun, ends, np.minimum(ends.load + _beyond(ends), self.end[lanes]))
        flipped = own.is_open(begun) ^ own.is_open(there)
        self.shapes.put(lanes, there)
        if flipped.any():
            self._tell(_reset(own, begun, ends, there, flipped, lanes))
        self._leave(obstructed, lanes, ends, flipped)

    def _leave(self, obstructed: Obstructed, lanes: Indices, ends: Ends, flipped: Flags) -> None:
        """Decide which lanes go on from a halt."""
        shapes, own = self.shapes, obstructed.are_kept
        self._count(lanes, ends)
        shapes.is_there[lanes] &= self.n_halts[lanes] < MOST_HALTS * len(shapes.inverted)
        shapes.is_there[lanes] &= self.n_kinks[lanes] < MOST_KINKS
        shapes.is_there[lanes] &= self.n_near[lanes] < MOST_NEAR * len(shapes.inverted)
        is_done = ends.outcome == PathEnd.ARRIVED
        goes_on = shapes.is_there[lanes] & ~is_done
        goes_on &= (shapes.active[:, lanes] | ~own).all(axis=0)
        goes_on &= ~((self.to_reset | self.are_beyond[lanes]) & flipped.any(axis=0))
        if self.beyond is not None and is_done.any():
            goes_on[is_done] = self._set_out(obstructed, lanes[is_done])
        self.fresh[lanes] = True
        self.lanes = np.sort(np.append(self.lanes, lanes[goes_on]))

    def _count(self, lanes: Indices, ends: Ends) -> None:
        """Move the loads on, and count halts that are near to those before."""
        load = np.minimum(ends.load + _beyond(ends), self.end[lanes])
        is_near = np.abs(load - self.load[lanes]) < KINK_ROOM
        self.n_halts[lanes] += 1
        self.n_near[lanes] = np.where(is_near, self.n_near[lanes] + 1, 0)
        self.load[lanes] = load
        kinked = lanes[ends.outcome == PathEnd.FAILED]
        is_near = self.load[kinked] - self.last_kink[kinked] < KINK_ROOM
        self.n_kinks[kinked] = np.where(is_near, self.n_kinks[kinked] + 1, 0)
        self.last_kink[kinked] = self.load[kinked]

    def _tell(self, reset: Reset) -> None:
        """Keep what happened on the way to the end; beyond it it is what ends a margin."""
        is_late = self.are_beyond[reset.lanes]
        late, before = np.flatnonzero(is_late), np.flatnonzero(~is_late)
        self.margin[reset.lanes[late]] = reset.load[late] - 1.0
        if len(before):
            self.resets.append(reset.take(before))

    def _set_out(self, obstructed: Obstructed, lanes: Indices) -> Flags:
        """Lanes that have come to the end go on beyond it: which of them."""
        assert self.beyond is not None, "they go on"
        is_late = self.are_beyond[lanes]
        self.margin[lanes[is_late]] = np.inf
        new = lanes[~is_late]
        few = self.shapes.take_lanes(new)
        if len(new):
            _put_right(obstructed.take_lanes(new), few, self.load[new])
        self.shapes.put(new, few)
        self.arrived.put(new, few)
        self.are_beyond[new], self.end[new] = True, self.beyond
        self.n_halts[new], self.n_near[new] = 0, 0
        self.n_kinks[new], self.last_kink[new] = 0, -np.inf
        return ~is_late & self.shapes.is_there[lanes]


def _reset(
    own: Obstructed,
    at_fold: ContactShapes,
    ends: Ends,
    after: ContactShapes,
    flipped: Flags,
    lanes: Indices,
) -> Reset:
    """What happened at the ends of paths to the `lanes` that flipped."""
    which = np.flatnonzero(flipped.any(axis=0))
    load, cell, flipped = ends.load[which], ends.cell[which], flipped[:, which]
    cell = np.where(cell < len(flipped), cell, -1)  # jaws, not a unit
    snapped, are_tied = flipped & own.is_open(after)[:, which], np.zeros(flipped.shape, bool)
    before = at_fold.take_lanes(which)
    if own.ramp is not None:
        are_tied = tied(own.take_lanes(which), before, load, cell)
    return Reset(lanes[which], load, flipped, before.push, snapped, are_tied)


def _put_right(obstructed: Obstructed, shapes: ContactShapes, load: Array) -> None:
    """Change contacts that closed or opened too near to others to be told apart on the way.

    Late ones penetrate, others pull.
    """
    for _ in range(MOST_CHANGES):
        family = obstructed.family(shapes.inverted, shapes.active)
        measured = family.measure(obstructed.stacked(shapes))
        is_wrong = family.law.margin(measured, load) < -OUT_OF_ORDER
        pulls = shapes.active & (obstructed.without_rounding(-shapes.push) > 0.0)
        is_wrong |= pulls & ~obstructed.are_kept
        lanes = np.flatnonzero(shapes.is_there & is_wrong.any(axis=0))
        if not len(lanes):
            break
        few, own = shapes.take_lanes(lanes), obstructed.take_lanes(lanes)
        begun = np.where(few.active, few.push, own.stiffness * own.large)
        push = np.where(few.active ^ is_wrong[:, lanes], begun, 0.0)
        shapes.put(lanes, finished(own, few.coordinates, few.inverted, push, load[lanes]))


def _told(own: Obstructed, before: ContactShapes, ends: Ends) -> Ends:
    """The ends of paths: gaps that close while they are another one's, or wide, have jumped.

    As at a kink. No contact is to be made of a wide one: a body that has gone past a finger's end
    is all at once behind the finger.
    """
    coordinates = ends.coordinates[: len(before.coordinates)]
    measured, bound = own.gaps()(coordinates), own.bound(ends.load)
    cell, lanes = np.maximum(ends.cell, 0), np.arange(len(ends.cell))
    is_wide = np.abs(measured.value - bound)[cell, lanes] > JUMPED * own.large[0]
    is_wide &= cell < own.n_gaps
    is_jump = ~before.active[cell, lanes] & (is_wide | (measured.place[cell, lanes] != cell))
    is_jump &= ends.outcome == PathEnd.EVENT
    ends = replace(ends, outcome=np.where(is_jump, PathEnd.FAILED, ends.outcome))
    return with_lost_domes(own, before, ends)


def _at_ends(own: Obstructed, before: ContactShapes, ends: Ends) -> ContactShapes:
    """The shapes at the ends of paths, with contacts that have closed or opened there."""
    size = len(before.coordinates)
    coordinates, y = ends.coordinates[:size], ends.coordinates[size:]
    active, n = before.active.copy(), len(ends.load)
    events = np.flatnonzero(ends.outcome == PathEnd.EVENT)
    active[ends.cell[events], events] ^= True
    push = own.pushes(before.active, y)
    as_found = own.are_kept | (ends.outcome == PathEnd.ARRIVED)  # one that pulls is to be seen
    push = np.where(as_found, push, np.where(active, np.maximum(push, 0.0), 0.0))
    return ContactShapes(coordinates.copy(), push, active, before.inverted.copy(), np.ones(n, bool))


def _fallen(own: Obstructed, begun: ContactShapes, ends: Ends, load: Array) -> ContactShapes:
    """Where those come to rest, at loads (batch,), that have lost their balance."""
    is_fold = ends.outcome == PathEnd.FOLD
    further = np.where(is_fold, DISPLACED * ends.onward, 0.0)
    if own.motion is not None and own.motion.pivots:  # on edge: to which side no model says
        further[own.n_own] = np.where(is_fold, further[own.n_own], DISPLACED * own.large[0])
    there = relaxed(own, begun.coordinates + further, begun.inverted, begun.push, load)
    lost = np.flatnonzero(~there.is_there & ~own.are_slipping(there.coordinates, load))
    if len(lost):  # pushes of contacts that the fall has left lead nowhere
        few, anew = own.take_lanes(lost), there.take_lanes(lost)
        args = anew.coordinates, anew.inverted, 0.0 * anew.push, load[lost]
        there.put(lost, relaxed(few, *args))
    return there


def _beyond(ends: Ends) -> Array:
    """How far beyond the ends of paths to go on: over folds, and kinks of laws or contacts."""
    is_fold, is_kink = ends.outcome == PathEnd.FOLD, ends.outcome == PathEnd.FAILED
    return np.where(is_fold, SKIPPED, np.where(is_kink, OVER_KINK, 0.0))
