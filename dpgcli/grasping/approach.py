"""How fingers come to touch a body: it grows at its place, or moves to it, and units reset.

Contacts close and open on the way without any change of shape. Where a finger loses its balance, a
unit resets (or snaps), exactly at the fold, and the finger goes downhill with the body as it is
there; then the body goes on.
"""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.path import Ends, PathEnd, follow
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.descent import finished, relaxed
from dpgcli.grasping.shapes import ContactShapes
from dpgcli.grasping.ties import tied

DISPLACED = 1e-3  # of a stroke: from a fold to where downhill is told from level
SKIPPED, OVER_KINK = 1e-6, 1e-4  # of the way: beyond a fold; over a kink that no path leads over
MOST_HALTS = 40  # by unit
MOST_KINKS, KINK_ROOM = 8, 1e-3  # kinks one after the other: of the way between two of them
MOST_CHANGES, OUT_OF_ORDER = 8, 1e-12  # of contacts in the end; of a stroke
LOOKS, STAGES = 256, 8  # places on a way at which contacts are looked for: before one, and after


@dataclass(frozen=True)
class Reset:
    """Units that left their wells in some lanes: `flipped` (unit, lane) at loads (lane,).

    `push` (cell, lane) are the pushes, N, at the fold; `snapped` are those that are inverted now.
    Where it is pressures that changed, `pressure` (unit, lane), MPa, is that of each unit, and
    `tied` (unit, lane) are those whose thresholds are the same, if there are several. Loads
    `of_release` are shares of letting go.
    """

    lanes: Indices
    load: Array
    flipped: Flags
    push: Array
    snapped: Flags
    tied: Flags
    pressure: Array | None = None
    of_release: bool = False

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

    `load` (batch,) is 1 where the body is there in full.
    """

    shapes: ContactShapes
    load: Array
    resets: tuple[Reset, ...]


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
    obstructed: Obstructed, start: ContactShapes, load: Array, end: Array, *, to_reset: bool = False
) -> Approach:
    """Let bodies grow from one load to another, (batch,), about fingers in balance.

    With `to_reset` only as far as to where a first unit resets or snaps; nowhere beyond where a
    place that sticks begins to slide.
    """
    shapes, here = start.take_lanes(np.arange(len(load))), load.copy()
    resets: list[Reset] = []
    n_kinks, last_kink = np.zeros(len(load), int), np.full(len(load), -np.inf)
    lanes = np.flatnonzero(shapes.is_there & (here < end))
    for _ in range(MOST_HALTS * len(start.inverted)):
        if not len(lanes):
            break
        own = obstructed.take_lanes(lanes)
        few = own.relabeled(shapes.take_lanes(lanes))
        family = own.family(few.inverted, few.active)
        ends = _told(own, few, follow(family, own.stacked(few), here[lanes], end[lanes]))
        moved, flipped, push = _gone_on(own, few, ends, end[lanes])
        here[lanes] = np.minimum(ends.load + _beyond(ends), end[lanes])
        shapes.put(lanes, moved)
        if flipped.any():
            resets.append(_reset(own, few, ends, moved, flipped, push, lanes))
        kinked = lanes[ends.outcome == PathEnd.FAILED]
        is_near = here[kinked] - last_kink[kinked] < KINK_ROOM
        n_kinks[kinked] = np.where(is_near, n_kinks[kinked] + 1, 0)
        last_kink[kinked] = here[kinked]
        shapes.is_there[lanes] &= n_kinks[lanes] < MOST_KINKS  # contacts that close and open on end
        goes_on = shapes.is_there[lanes] & (ends.outcome != PathEnd.ARRIVED)
        goes_on &= (moved.active | ~own.are_kept).all(axis=0)
        lanes = lanes[goes_on & ~(to_reset & flipped.any(axis=0))]
    shapes.is_there[lanes] = False
    _put_right(obstructed, shapes, here)
    return Approach(shapes, here, tuple(resets))


def _reset(
    own: Obstructed,
    before: ContactShapes,
    ends: Ends,
    after: ContactShapes,
    flipped: Flags,
    push: Array,
    lanes: Indices,
) -> Reset:
    """What happened at the ends of paths, with the pushes there, to the `lanes` that flipped."""
    which = np.flatnonzero(flipped.any(axis=0))
    load, cell, flipped = ends.load[which], ends.cell[which], flipped[:, which]
    cell = np.where(cell < len(flipped), cell, -1)  # jaws, not a unit
    snapped, are_tied = flipped & own.is_open(after)[:, which], np.zeros(flipped.shape, bool)
    if own.ramp is not None:
        coordinates = ends.coordinates[: len(before.coordinates)]
        at_fold = replace(before, coordinates=coordinates, push=push).take_lanes(which)
        are_tied = tied(own.take_lanes(which), at_fold, load, cell)
    return Reset(lanes[which], load, flipped, push[:, which], snapped, are_tied)


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
    """The ends of paths: where a gap closes that is another one's it has jumped, as at a kink."""
    place = own.gaps()(ends.coordinates[: len(before.coordinates)]).place
    cell, lanes = np.maximum(ends.cell, 0), np.arange(len(ends.cell))
    is_jump = ~before.active[cell, lanes] & (place[cell, lanes] != cell)
    is_jump &= ends.outcome == PathEnd.EVENT
    return replace(ends, outcome=np.where(is_jump, PathEnd.FAILED, ends.outcome))


def _gone_on(
    own: Obstructed, before: ContactShapes, ends: Ends, end: Array
) -> tuple[ContactShapes, Flags, Array]:
    """The shapes with which paths go on, units that flipped where they ended, and pushes there."""
    size = len(before.coordinates)
    coordinates, y = ends.coordinates[:size], ends.coordinates[size:]
    active, n = before.active.copy(), len(ends.load)
    events = np.flatnonzero(ends.outcome == PathEnd.EVENT)
    active[ends.cell[events], events] ^= True
    push = own.pushes(before.active, y)
    as_found = own.are_kept | (ends.outcome == PathEnd.ARRIVED)  # one that pulls is to be seen
    push = np.where(as_found, push, np.where(active, np.maximum(push, 0.0), 0.0))
    at_fold = push.copy()
    moved = ContactShapes(
        coordinates.copy(), push, active, before.inverted.copy(), np.ones(n, bool)
    )
    flipped = np.zeros(before.inverted.shape, bool)
    falls = np.flatnonzero(_beyond(ends) > 0.0)
    if len(falls):
        few, begun = own.take_lanes(falls), moved.take_lanes(falls)
        is_fold = ends.outcome[falls] == PathEnd.FOLD
        further = np.where(is_fold, DISPLACED * ends.onward[:size, falls], 0.0)
        beyond = np.minimum((ends.load + _beyond(ends))[falls], end[falls])
        there = relaxed(few, begun.coordinates + further, begun.inverted, begun.push, beyond)
        lost = np.flatnonzero(~there.is_there & ~few.are_slipping(there.coordinates, beyond))
        if len(lost):  # pushes of contacts that the fall has left lead nowhere
            own_, anew = few.take_lanes(lost), there.take_lanes(lost)
            args = anew.coordinates, anew.inverted, 0.0 * anew.push, beyond[lost]
            there.put(lost, relaxed(own_, *args))
        flipped[:, falls] = few.is_open(begun) ^ few.is_open(there)
        moved.put(falls, there)
    return moved, flipped, at_fold


def _beyond(ends: Ends) -> Array:
    """How far beyond the ends of paths to go on: over folds, and kinks of laws or contacts."""
    is_fold, is_kink = ends.outcome == PathEnd.FOLD, ends.outcome == PathEnd.FAILED
    return np.where(is_fold, SKIPPED, np.where(is_kink, OVER_KINK, 0.0))
