"""Paths of equilibria as a load changes, each lane on its own: to a load, to a fold or to an event.

A path is followed by one of the family's scalars q, the one that moves most, or by the load where
that is near its end (`corrector`).

Along the path dλ/dq falls to zero at a fold. It is approached from before, by secants on dλ/dq, so
that cells which reach their folds at the same load do no harm: at a distance of τ scales λ is short
of the fold by ½ τ dλ/dτ, up to terms of order τ³.
"""

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.banded import in_lanes
from dpgcli.equilibrium.contracts import Coordinates
from dpgcli.equilibrium.corrector import TOLERANCE, Corrected, Ways, corrected, motion_by, slope_by
from dpgcli.equilibrium.loaded import LoadedLaw, LoadedPotential, along
from dpgcli.records import dataclass

LARGEST_STEP = 0.1  # of a cell's scale
GROWTH, SHRINKING = 2.0, 0.35
FIRST_STEP = 0.5  # of the step cap: of what moves most, where it is not known how it bends
FURTHEST = 2.5  # steps: what else moves further may have left its branch
FOLD_DISTANCE = 2e-6  # of the scale: what is left of λ is then of order 1e-12
KINK = 1e-2  # of the scale: a contact that slides over a corner moves other cells than before
AT_KINK = 1e-6  # of the load: as near a path comes to a kink beyond which nothing is found
CLOSER = 0.98  # of the estimated distance: the next point is still before the fold
AWAY = 1e-9  # of the forces in play: what is nearer to an event may be at it, rounding aside
SMALLEST_STEP = 1e-9  # of the scale
PLACES = 64  # on a step, at which laws from points are looked at,
GRAZING = 0.03  # of a step that has led beyond an event which may be at its start
SHORTEST, ROUGHLY = 0.05, 0.5  # of a step that went astray; of the way to a fold, points on which
SMALLEST_GUARDED = 1e-3  # of the scale, if it is longer
MAX_STEPS = 600
BY_SECANTS = -2  # instead of a cell: an event is come near to from before

Watch = Callable[[Indices, Array, Array], None]
"""Told lanes, their coordinates (size, lane) and loads (lane,) after each step."""


class PathEnd(IntEnum):
    """How a path ended."""

    ARRIVED = 0
    FOLD = 1
    EVENT = 2
    FAILED = 3


@dataclass(frozen=True)
class Ends:
    """The ends of some paths: coordinates (size, batch), loads (batch,) and outcomes.

    At folds and events `cell` is the one that gave rise to it, −1 elsewhere, and `onward` the
    motion of the coordinates per step of one scale, along the path.
    """

    coordinates: Array
    load: Array
    outcome: Indices
    cell: Indices
    onward: Array

    @classmethod
    def joined(cls, parts: "Sequence[Ends]", size: int) -> "Ends":
        """Several, with the first coordinates only, of which all have so many."""
        rows = {"coordinates": slice(size), "onward": slice(size)}
        return cls(
            *(
                np.concatenate([getattr(p, f.name)[rows.get(f.name, ...)] for p in parts], axis=-1)
                for f in fields(cls)
            )
        )

    def take_lanes(self, lanes: Indices) -> "Ends":
        """Some lanes."""
        return Ends(*(np.take(getattr(self, f.name), lanes, axis=-1) for f in fields(self)))


@dataclass
class Walk:
    """Paths under way: the present point of each, and what is known of the way on.

    `cell` is followed in the direction `sign`; per step of one scale the coordinates move by
    `onward` and the load by `slope`, positive towards its end. `step` is the next one, `last` the
    one before and `last_slope` the slope there, NaN if another cell was followed; `bend` is how
    `onward` changes per step since then, zero if that is not known. Where nothing moves `cell` is
    −1, and steps are of the load itself. `is_beyond` says that the last step that was tried led
    beyond an event; then `meeting` is the cell whose margin vanishes there, to be gone to, −1 if
    there is none, and `BY_SECANTS` where it was not found. `count` is that of steps.
    """

    coordinates: Array
    load: Array
    values: Array
    onward: Array
    slope: Array
    cell: Indices
    sign: Array
    step: Array
    last: Array
    last_slope: Array
    bend: Array
    margin: Array
    is_beyond: Flags
    meeting: Indices
    count: Indices

    def put(self, lanes: Indices, other: "Walk", taken: Flags | Indices) -> None:
        """Replace some lanes by those of another walk."""
        for field in fields(self):
            getattr(self, field.name)[..., lanes] = getattr(other, field.name)[..., taken]

    def resized(self, size: int) -> "Walk":
        """With so many coordinates: those that go, or come, are zero."""
        known = len(self.coordinates)
        if known == size:
            return self
        more = np.zeros((max(size - known, 0), len(self.load)))
        of_size = ("coordinates", "onward", "bend")
        parts = {name: np.concatenate((getattr(self, name)[:size], more)) for name in of_size}
        return replace(self, **parts)

    def only(self, lanes: Indices) -> "Walk":
        """Some lanes."""
        return Walk(*(np.take(getattr(self, f.name), lanes, axis=-1) for f in fields(self)))


def follow(
    family: LoadedPotential[Coordinates, LoadedLaw],
    coordinates: Array,
    load: Array,
    end: Array,
    largest_step: float = LARGEST_STEP,
    watch: Watch | None = None,
) -> Ends:
    """Follow stable equilibria from loads to others, (batch,), as far as they go.

    The paths begin at equilibria, (size, batch), and end at a fold, where the Hessian is singular,
    at an event, where a margin of the law falls to zero, or at the load asked for. `watch` is told
    where they are after each step; one that failed is told as no step.
    """
    nobody = np.arange(len(load))
    return _walked(family, coordinates, load, end, None, nobody, largest_step, watch)[0]


def to_events(
    family: LoadedPotential[Coordinates, LoadedLaw],
    coordinates: Array,
    load: Array,
    end: Array,
    walk: "Walk | None",
    fresh: Indices,
) -> tuple[Ends, "Walk"]:
    """The same, as far as to where some lanes have come to their end or to an event.

    Outcomes of those that are still under way are −1. They go on by their `walk` the next time; the
    `fresh` ones, all of them if there is no walk, begin.
    """
    return _walked(family, coordinates, load, end, walk, fresh, LARGEST_STEP, None, pauses=True)


@in_lanes
def _walked(
    family: LoadedPotential[Coordinates, LoadedLaw],
    coordinates: Array,
    load: Array,
    end: Array,
    walk: "Walk | None",
    fresh: Indices,
    largest_step: float,
    watch: Watch | None,
    *,
    pauses: bool = False,
) -> tuple[Ends, "Walk"]:
    n, depth, towards = len(load), max(family.column_depths), np.sign(end - load)
    ends = Ends(
        coordinates.copy(), load.copy(), np.full(n, -1), np.full(n, -1), np.zeros_like(coordinates)
    )
    if len(fresh):
        own = family if len(fresh) == n else family.take_lanes(fresh)
        begin = coordinates[:, fresh], load[fresh], towards[fresh]
        begun, fine = _begin(own, *begin, depth, largest_step)
        ends.outcome[fresh[~fine]] = PathEnd.FAILED
        ends.outcome[fresh[fine & (towards[fresh] == 0.0)]] = PathEnd.ARRIVED
        if walk is None:
            walk = begun
        else:
            walk.put(fresh, begun, np.arange(len(fresh)))
    assert walk is not None, "some are fresh"
    whole, active, own = walk, np.flatnonzero(ends.outcome < 0), family
    if len(active) < n:
        walk, own = walk.only(active), family.take_lanes(active)
    while len(active):
        ending = _one_step(own, walk, end[active], towards[active], depth, largest_step)
        walk.count += 1
        ending[(ending < 0) & (walk.count >= MAX_STEPS)] = PathEnd.FAILED
        if watch is not None:
            watch(active, walk.coordinates.copy(), walk.load.copy())
        finished = np.flatnonzero(ending >= 0)
        if len(finished):
            _write(ends, active[finished], walk.only(finished), ending[finished])
            keep = np.flatnonzero(ending < 0)
            active, walk, own = active[keep], walk.only(keep), own.take_lanes(keep)
            if pauses and np.isin(ending, (PathEnd.ARRIVED, PathEnd.EVENT)).any():
                break
    if walk is not whole:
        whole.put(active, walk, np.arange(len(active)))
    return ends, whole


def _write(ends: Ends, lanes: Indices, walk: Walk, outcome: Indices) -> None:
    is_special = (outcome == PathEnd.FOLD) | (outcome == PathEnd.EVENT)
    ends.coordinates[:, lanes], ends.load[lanes] = walk.coordinates, walk.load
    ends.outcome[lanes] = outcome
    ends.cell[lanes] = np.where(is_special, walk.cell, -1)
    ends.onward[:, lanes] = walk.onward


def _begin(
    family: LoadedPotential[Coordinates, LoadedLaw],
    coordinates: Array,
    load: Array,
    towards: Array,
    depth: int,
    largest_step: float,
) -> tuple[Walk, Flags]:
    """Walks at their first points, and which of these are stable equilibria."""
    n, nothing = len(load), np.full(len(load), -1)
    free = np.zeros(n)
    here = corrected(family, coordinates, load, nothing, free, depth)
    margin = _margin(family, here)
    walk = Walk(
        here.coordinates, here.load, here.measured.value, np.zeros_like(coordinates),
        free.copy(), nothing, free.copy(), np.full(n, largest_step), free + np.nan, free + np.nan,
        np.zeros_like(coordinates), margin, np.zeros(n, bool), nothing, 0 * nothing,
    )  # fmt: skip
    _turn(family, walk, here, nothing, towards)
    return walk, here.is_fine


def _margin(family: LoadedPotential[Coordinates, LoadedLaw], here: Corrected) -> Array:
    margin = family.law.margin(here.loaded, here.load)
    return np.full(here.loaded.value.shape, np.inf) if margin is None else margin


class _Trial(NamedTuple):
    """A step that was tried: how far, by which cell (−1: by the load), and what there is.

    `slope` is that of the load per step there, `margin` (cell, batch) that to events; `is_meeting`
    says which were to end at one, `is_fine` which are on the same stable branch.
    """

    step: Array
    cell: Indices
    is_last: Flags
    is_meeting: Flags
    there: Corrected
    slope: Array
    margin: Array
    is_fine: Flags


def _one_step(
    family: LoadedPotential[Coordinates, LoadedLaw],
    walk: Walk,
    end: Array,
    towards: Array,
    depth: int,
    largest_step: float,
) -> Indices:
    """Move each walk on by one step, or shorten its step; outcomes of those that end, else −1."""
    ending = np.full(len(end), -1)
    to_fold = _distance(walk.slope, walk.last_slope, walk.last)
    is_before = (end - walk.load) * towards > 0.0  # a step by a cell may have led beyond
    is_fold = (walk.cell >= 0) & (to_fold <= FOLD_DISTANCE) & is_before
    if is_fold.any():
        _land(walk, is_fold, to_fold, towards)
        ending[is_fold] = PathEnd.FOLD
    walk.step = np.where(walk.cell >= 0, np.minimum(walk.step, largest_step), walk.step)
    step = np.minimum(walk.step, np.maximum(CLOSER * to_fold, FOLD_DISTANCE / 4.0))
    is_rough = (step < ROUGHLY * to_fold) & ~walk.is_beyond
    trial = _tried(family, walk, step, end, towards, depth, is_rough)
    step, slope, margin, is_last = trial.step, trial.slope, trial.margin, trial.is_last
    is_beyond = trial.is_fine & ~is_last & (slope <= 0.0)
    dip = _first_dip(family, walk, trial, towards)
    is_over = trial.is_fine & ~is_beyond & (dip < 1.0)
    is_away = walk.margin > AWAY
    meets, crossed = is_away & (np.abs(margin) <= AWAY), _crossed(walk.margin, margin, is_away)
    is_event = trial.is_fine & ~is_beyond & ~is_over & (crossed < 0.0).any(axis=0)
    accepted = trial.is_fine & ~is_beyond & ~is_over & ~is_event & (ending < 0)
    first = 1.0 + crossed.min(axis=0)  # the share of the step up to the first event
    is_bent = walk.is_beyond & (walk.meeting < 0)
    first = np.where(is_bent, CLOSER * first, first)  # margins that bend: from nearer by
    to_root = walk.slope / (walk.slope - slope)
    nearer = 1.0 / np.sqrt(trial.there.astray)  # NaN where there is nothing
    part = np.where(is_over, dip, np.where(is_event, first, _by_guess(trial, nearer)))
    shorter = np.where(is_beyond, CLOSER * to_root, part) * step
    is_kinked = (walk.cell < 0) & _may_kink(family, len(end)) & ~is_event
    is_stuck = ~accepted & (ending < 0) & (shorter < np.where(is_kinked, AT_KINK, SMALLEST_STEP))
    ending[is_stuck] = np.where(walk.cell[is_stuck] >= 0, PathEnd.FOLD, PathEnd.FAILED)
    landed = (accepted & ~is_last & meets.any(axis=0)) | (is_stuck & is_event)
    longer = np.minimum(GROWTH * np.maximum(step, walk.step), largest_step)
    longer = np.fmin(longer, step * nearer)
    walk.step = np.where(accepted, longer, shorter)
    walk.is_beyond = is_event
    by_load = ~trial.is_fine & (ending < 0) & (walk.cell >= 0) & (shorter < KINK)
    by_load &= _may_kink(family, len(end))
    if by_load.any():
        _go_by_load(walk, by_load)
    event_cell = np.where(is_event, crossed, np.where(meets, np.abs(margin), np.inf)).argmin(axis=0)
    walk.meeting = _to_meet(walk, trial, np.where(is_event, event_cell, -1), is_away)
    event = _at_event(family, walk, trial, event_cell) if landed.any() else None
    if accepted.any():
        _move(family, walk, trial, accepted, towards)
    if event is not None:
        moved = accepted & landed
        walk.coordinates = np.where(moved, event.coordinates, walk.coordinates)
        walk.load = np.where(moved, event.load, walk.load)
        walk.cell = np.where(landed, event_cell, walk.cell)
        ending[landed] = PathEnd.EVENT
    ending[accepted & is_last] = PathEnd.ARRIVED
    return ending


def _by_guess(trial: _Trial, nearer: Array) -> Array:
    """The share of a step that led nowhere which is tried next."""
    share = np.fmax(np.fmin(SHRINKING, 0.5 * nearer), SHORTEST)
    return np.where(trial.is_meeting, CLOSER, share)


def _crossed(before: Array, after: Array, is_away: Flags) -> Array:
    """Where margins fell below zero on a step, (cell, batch): shares of it back from its end.

    They are negative, and 0 where none did.
    """
    is_crossed = after < np.where(is_away, -TOLERANCE, -AWAY)
    by_secant = np.where(is_away, after / (before - after), GRAZING - 1.0)
    is_new = np.isinf(before)  # where it began is not known
    return np.where(is_crossed, np.where(is_new, -0.5, by_secant), 0.0)


def _to_meet(walk: Walk, trial: _Trial, cell: Indices, is_away: Flags) -> Indices:
    """The cell whose margin is to be met next, of those that have been crossed, −1 for none."""
    is_lost = trial.is_meeting & ~trial.is_fine
    by_secants = is_lost | (walk.meeting == BY_SECANTS)
    is_met = (cell >= 0) & is_away[np.maximum(cell, 0), np.arange(len(cell))] & ~by_secants
    return np.where(is_met, cell, np.where(by_secants, BY_SECANTS, -1))


def _may_kink(family: LoadedPotential[Coordinates, LoadedLaw], n: int) -> Flags:
    return np.zeros(n, bool) if family.may_kink is None else family.may_kink


def _go_by_load(walk: Walk, which: Flags) -> None:
    """Go on by the load where no step by a cell leads further: beyond a kink it may not move."""
    slope = np.where(which, walk.slope, 1.0)
    walk.cell = np.where(which, -1, walk.cell)
    walk.onward, walk.slope = walk.onward / slope, walk.slope / slope
    walk.step = np.where(which, walk.step * slope, walk.step)
    walk.last_slope = np.where(which, np.nan, walk.last_slope)
    walk.bend = np.where(which, 0.0, walk.bend)


def _tried(
    family: LoadedPotential[Coordinates, LoadedLaw],
    walk: Walk,
    step: Array,
    end: Array,
    towards: Array,
    depth: int,
    is_rough: Flags,
) -> _Trial:
    """Try a step of each walk along its cell, or to the end of its load where that is nearer."""
    to_end = np.where(walk.slope > 0.0, (end - walk.load) * towards / walk.slope, 0.0)
    is_last = to_end <= step
    step = np.where(is_last, to_end, step)
    cell = np.where(is_last, -1, walk.cell)
    way = np.where(is_last, _along_bend(walk, (end - walk.load) * towards), step)
    guess = family.coordinates.moved(walk.coordinates, (walk.onward + 0.5 * way * walk.bend) * way)
    rise = (walk.slope + 0.5 * way * _slope_bend(walk)) * way
    load = np.where(is_last, end, walk.load + towards * rise)
    place = np.maximum(walk.cell, 0), np.arange(len(end))
    scale = np.broadcast_to(family.scale, walk.values.shape)
    target = walk.values[place] + walk.sign * step * scale[place]
    is_meeting = ~is_last & (walk.meeting >= 0)
    ways = Ways(is_rough & ~is_last & ~is_meeting, np.where(is_meeting, walk.meeting, -1))
    there = corrected(family, guess, load, cell, target, depth, ways)
    by_cell = ((there.measured.value - walk.values) / scale)[place] * walk.sign
    came = np.where(cell >= 0, by_cell, (there.load - walk.load) * towards)
    moved = np.abs((there.measured.value - walk.values) / scale).max(axis=0)
    nearest = np.where(_may_kink(family, len(end)), KINK, FOLD_DISTANCE)
    is_fine = there.is_fine & (moved <= FURTHEST * np.maximum(np.abs(step), nearest))
    is_fine &= ~is_meeting | ((came > 0.0) & (came <= FURTHEST * step))
    step = np.where(is_meeting & is_fine, came, step)
    slope = slope_by(family, there, cell) * walk.sign * towards
    return _Trial(step, cell, is_last, is_meeting, there, slope, _margin(family, there), is_fine)


def _slope_bend(walk: Walk) -> Array:
    """How the slope changes per step since the last point, zero if that is not known."""
    bend = (walk.slope - walk.last_slope) / walk.last
    return np.where(np.isfinite(bend), bend, 0.0)


def _along_bend(walk: Walk, rise: Array) -> Array:
    """Steps to where the load has risen by so much: τ dλ/dτ + ½ τ² d²λ/dτ², or the first alone."""
    square = walk.slope**2 + 2.0 * _slope_bend(walk) * rise
    rate = np.where(square > 0.0, 0.5 * (walk.slope + np.sqrt(np.abs(square))), walk.slope)
    return np.where(rate > 0.0, rise / rate, 0.0)


def _move(
    family: LoadedPotential[Coordinates, LoadedLaw],
    walk: Walk,
    trial: _Trial,
    which: Flags,
    towards: Array,
) -> None:
    """Go to the points that were tried, and look on from there."""
    there, unknown = trial.there, np.where(trial.is_last, np.nan, 0.0)
    new = replace(
        walk,
        coordinates=there.coordinates,
        load=there.load,
        values=there.measured.value,
        last=trial.step + unknown,
        last_slope=walk.slope + unknown,
        margin=trial.margin,
    )
    new.meeting = np.full(len(walk.load), -1)
    _turn(family, new, there, trial.cell, towards)
    is_known = np.isfinite(new.last_slope) & (new.sign == walk.sign) & family.law.is_smooth
    new.bend = np.where(is_known, (new.onward - walk.onward) / trial.step, 0.0)
    walk.put(np.flatnonzero(which), new, which)


def _first_dip(
    family: LoadedPotential[Coordinates, LoadedLaw], walk: Walk, trial: _Trial, towards: Array
) -> Array:
    """The share of a step at which λ would first turn back, by the law alone; 1 where nowhere.

    So that no step leads over a fold to where the path rises again. What else is stiff beside the
    law is taken as it is here: K + R + ∂F/∂λ dλ/dq = 0.
    """
    if family.law.is_smooth:
        return np.ones(len(towards))
    place = np.maximum(walk.cell, 0), np.arange(len(towards))
    scale = np.broadcast_to(family.scale, walk.values.shape)[place]
    share = np.linspace(0.0, 1.0, PLACES)[:, None, None]
    way = trial.there.measured.value - walk.values
    between = walk.values + share * way
    here, there = (family.law.at(load)(between).stiffness for load in (walk.load, trial.there.load))
    stiffness = (here + share * (there - here))[:, *place]
    rate = family.law.rate(between, walk.load)[:, *place]
    slope = towards * walk.slope / (walk.sign * scale)
    turns = (stiffness - stiffness[0] - rate[0] * slope) / -rate / slope <= 0.0
    turns[0], turns[-1] = False, True
    is_told = (walk.cell >= 0) & (np.abs(way[place]) > SMALLEST_GUARDED * scale)
    return np.where(is_told, turns.argmax(axis=0) / (PLACES - 1), 1.0)


class _Place(NamedTuple):
    """Coordinates and loads."""

    coordinates: Array
    load: Array


def _at_event(
    family: LoadedPotential[Coordinates, LoadedLaw], walk: Walk, trial: _Trial, cell: Indices
) -> _Place:
    """Where the margins of cells vanish, by secants: near to the points that were tried."""
    lanes = np.arange(len(cell))
    there, margin, before = trial.there, trial.margin[cell, lanes], walk.margin[cell, lanes]
    is_near = np.isfinite(before) & (before > 2.0 * np.abs(margin))
    share = np.where(is_near, margin, 0.0) / np.where(is_near, before - margin, 1.0)
    followed = np.maximum(trial.cell, 0), lanes
    by_cell = (there.measured.value - walk.values)[followed]
    rest = share * np.where(trial.cell >= 0, by_cell, there.load - walk.load)
    motion, by = motion_by(family, there, trial.cell)
    return _Place(there.coordinates + motion * rest, there.load + by * rest)


def _distance(slope: Array, last_slope: Array, last: Array) -> Array:
    """Steps to where the slope vanishes, by the secant through the last point and this one."""
    falls = last_slope > slope
    distance = slope * last / np.where(falls, last_slope - slope, 1.0)
    return np.where(falls, distance, np.inf)


def _land(walk: Walk, which: Flags, distance: Array, towards: Array) -> None:
    """Go the rest of the way to folds: λ there is ½ τ dλ/dτ further."""
    rest = np.where(which, distance, 0.0)
    walk.coordinates = walk.coordinates + walk.onward * rest
    walk.load = walk.load + towards * 0.5 * walk.slope * rest


def _turn(
    family: LoadedPotential[Coordinates, LoadedLaw],
    walk: Walk,
    here: Corrected,
    cell: Indices,
    towards: Array,
) -> None:
    """Decide which cell to follow from these points on, and how coordinates and load move.

    The cell that moves most; the one so far, unless another moves half as much again.
    """
    motion, by = motion_by(family, here, cell)
    is_held = cell >= 0
    rows, measured = family.followed.rows, here.measured
    rates = along(rows, measured, motion) / family.scale
    size = np.abs(rates)
    chosen = size.argmax(axis=0)
    lanes = np.arange(len(cell))
    keeps = is_held & (size[chosen, lanes] <= 1.5 * size[np.maximum(cell, 0), lanes])
    chosen = np.where(keeps, cell, chosen)
    rate = rates[chosen, lanes]
    moves = rate != 0.0
    forwards = np.sign(by) * towards
    walk.cell = np.where(moves, chosen, -1)
    walk.sign = np.sign(rate) * forwards
    per_step = np.where(moves, forwards / np.abs(np.where(moves, rate, 1.0)), 0.0)
    onward, is_other = motion * per_step, walk.cell != cell
    before, after = (_furthest(family, v) for v in (walk.onward, onward))
    as_far = np.where(before > 0.0, walk.step * before, FIRST_STEP) / after
    step = np.where(is_other, as_far, walk.step)
    walk.step = np.where(moves, step, np.inf)  # to the end, or to an event
    walk.onward = onward
    walk.slope = np.where(moves, np.abs(by * per_step), 1.0)
    walk.last_slope = np.where(is_other, np.nan, walk.last_slope)


def _furthest(family: LoadedPotential[Coordinates, LoadedLaw], motion: Array) -> Array:
    """How far the coordinate moves that moves furthest, in step caps, (batch,)."""
    return np.asarray(np.abs(motion / family.coordinates.step_cap).max(axis=0))
