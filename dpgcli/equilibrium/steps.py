"""One step of each walk along its path: tried, shortened where it led astray, and taken."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.contracts import Coordinates
from dpgcli.equilibrium.corrector import TOLERANCE, Corrected, Ways, corrected, motion_by, slope_by
from dpgcli.equilibrium.loaded import LoadedLaw, LoadedPotential
from dpgcli.equilibrium.walk import (
    AWAY,
    BY_SECANTS,
    UNFORESEEN,
    PathEnd,
    Walk,
    along_bend,
    distance_to_fold,
    go_by_load,
    land,
    margin_of,
    may_kink,
    slope_bend,
    to_events_ahead,
    turn,
)

GROWTH, SHRINKING = 2.0, 0.35
FURTHEST = 2.5  # steps: what else moves further may have left its branch
FOLD_DISTANCE = 2e-6  # of the scale: what is left of λ is then of order 1e-12
KINK = 1e-2  # of the scale: a contact that slides over a corner moves other cells than before
AT_KINK = 1e-6  # of the load: as near a path comes to a kink beyond which nothing is found
CLOSER = 0.98  # of the estimated distance: the next point is still before the fold
SMALLEST_STEP = 1e-9  # of the scale
PLACES = 64  # on a step, at which laws from points are looked at,
GRAZING = 0.03  # of a step that has led beyond an event which may be at its start
SHORTEST, ROUGHLY = 0.05, 0.5  # of a step that went astray; of the way to a fold, points on which
SMALLEST_GUARDED = 1e-3  # of the scale, if it is longer


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


def one_step(
    family: LoadedPotential[Coordinates, LoadedLaw],
    walk: Walk,
    end: Array,
    towards: Array,
    depth: int,
    largest_step: float,
) -> Indices:
    """Move each walk on by one step, or shorten its step; outcomes of those that end, else −1.

    Where some have come to a fold these alone are moved.
    """
    ending = np.full(len(end), -1)
    to_fold = distance_to_fold(walk.slope, walk.last_slope, walk.last)
    is_fold = _have_folded(walk, to_fold, (end - walk.load) * towards)
    if is_fold.any():
        land(walk, is_fold, to_fold, towards)
        return np.where(is_fold, PathEnd.FOLD, -1)
    walk.step = np.where(walk.cell >= 0, np.minimum(walk.step, largest_step), walk.step)
    step = np.minimum(walk.step, np.maximum(CLOSER * to_fold, FOLD_DISTANCE / 4.0))
    usual, step = step, _to_foreseen(family, walk, step)
    trial = _tried(family, walk, step, end, towards, depth, _rough(family, walk, step, to_fold))
    step, slope, margin, is_last = trial.step, trial.slope, trial.margin, trial.is_last
    is_beyond = trial.is_fine & ~is_last & (slope <= 0.0)
    dip = _first_dip(family, walk, trial, towards)
    is_over = trial.is_fine & ~is_beyond & (dip < 1.0)
    is_away = walk.margin > AWAY
    meets, crossed = is_away & (np.abs(margin) <= AWAY), _crossed(walk.margin, margin, is_away)
    is_event = trial.is_fine & ~is_beyond & ~is_over & (crossed < 0.0).any(axis=0)
    accepted = trial.is_fine & ~is_beyond & ~is_over & ~is_event
    first = 1.0 + crossed.min(axis=0)  # the share of the step up to the first event
    is_bent = walk.is_beyond & (walk.meeting < 0)
    first = np.where(is_bent, CLOSER * first, first)  # margins that bend: from nearer by
    to_root = walk.slope / (walk.slope - slope)
    nearer = 1.0 / np.sqrt(trial.there.astray)  # NaN where there is nothing
    part = np.where(is_over, dip, np.where(is_event, first, _by_guess(trial, nearer)))
    shorter = np.where(is_beyond, CLOSER * to_root, part) * step
    is_unforeseen = trial.is_meeting & ~trial.is_fine & ~walk.is_beyond
    shorter = np.where(is_unforeseen, usual, shorter)
    is_kinked = (walk.cell < 0) & may_kink(family, len(end)) & ~is_event
    is_stuck = ~accepted & (shorter < np.where(is_kinked, AT_KINK, SMALLEST_STEP))
    ending[is_stuck] = np.where(walk.cell[is_stuck] >= 0, PathEnd.FOLD, PathEnd.FAILED)
    is_within = (trial.there.load - end) * towards <= 0.0  # what is met beyond the end is not met
    landed = (accepted & ~is_last & is_within & meets.any(axis=0)) | (is_stuck & is_event)
    walk.step = np.where(accepted, _longer(walk, step, step * nearer, largest_step), shorter)
    by_load = ~trial.is_fine & ~is_unforeseen & (ending < 0) & (walk.cell >= 0) & (shorter < KINK)
    if (by_load & may_kink(family, len(end))).any():
        go_by_load(walk, by_load & may_kink(family, len(end)))
    event_cell = np.where(is_event, crossed, np.where(meets, np.abs(margin), np.inf)).argmin(axis=0)
    walk.meeting = _to_meet(family, walk, trial, np.where(is_event, event_cell, -1), is_away)
    walk.is_beyond = is_event
    event = _at_event(family, walk, trial, event_cell) if landed.any() else None
    if accepted.any():
        _move(family, walk, trial, accepted, towards)
    if event is not None:
        _put_at(walk, event, accepted & landed)
        walk.cell = np.where(landed, event_cell, walk.cell)
        ending[landed] = PathEnd.EVENT
    ending[accepted & is_last] = PathEnd.ARRIVED
    return ending


def _have_folded(walk: Walk, to_fold: Array, left: Array) -> Flags:
    """Which are at their folds; not those that a step by a cell has led beyond the end."""
    return (walk.cell >= 0) & (to_fold <= FOLD_DISTANCE) & (left > 0.0)


def _longer(walk: Walk, step: Array, by_guess: Array, largest_step: float) -> Array:
    """Steps after those that were taken: as long as guesses are good, and the largest."""
    return np.fmin(np.minimum(GROWTH * np.maximum(step, walk.step), largest_step), by_guess)


def _to_foreseen(family: LoadedPotential[Coordinates, LoadedLaw], walk: Walk, step: Array) -> Array:
    """Steps no longer than to where a margin would vanish as it falls here: that is to be met."""
    if family.may_kink is None:
        return step
    ahead = to_events_ahead(walk)
    first = ahead.min(axis=0)
    is_foreseen = (walk.meeting == -1) & np.isfinite(first) & (first <= step)
    walk.meeting = np.where(is_foreseen, ahead.argmin(axis=0), walk.meeting)
    return np.where(is_foreseen, first, step)


def _rough(
    family: LoadedPotential[Coordinates, LoadedLaw], walk: Walk, step: Array, to_fold: Array
) -> Flags:
    """Which points need not be exact: among contacts, well before folds and events.

    Those under pressure are told of, each of them.
    """
    is_on_the_way = (step < ROUGHLY * to_fold) & ~walk.is_beyond
    return is_on_the_way & (family.may_kink is not None)


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


def _to_meet(
    family: LoadedPotential[Coordinates, LoadedLaw],
    walk: Walk,
    trial: _Trial,
    cell: Indices,
    is_away: Flags,
) -> Indices:
    """The cell whose margin is to be met next, of those that have been crossed, −1 for none.

    Newton's method meets contacts; margins of other laws, which have kinks of their own, are come
    near to by secants.
    """
    if family.may_kink is None:
        return np.full(len(cell), BY_SECANTS)
    is_lost = trial.is_meeting & ~trial.is_fine
    by_secants = (is_lost & walk.is_beyond) | (walk.meeting == BY_SECANTS)
    is_met = (cell >= 0) & is_away[np.maximum(cell, 0), np.arange(len(cell))] & ~by_secants
    is_unforeseen = is_lost | (walk.meeting == UNFORESEEN)
    other = np.where(by_secants, BY_SECANTS, np.where(is_unforeseen, UNFORESEEN, -1))
    return np.where(is_met, cell, other)


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
    way = np.where(is_last, along_bend(walk, (end - walk.load) * towards), step)
    guess = family.coordinates.moved(walk.coordinates, (walk.onward + 0.5 * way * walk.bend) * way)
    rise = (walk.slope + 0.5 * way * slope_bend(walk)) * way
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
    nearest = np.where(may_kink(family, len(end)), KINK, FOLD_DISTANCE)
    is_fine = there.is_fine & (moved <= FURTHEST * np.maximum(np.abs(step), nearest))
    is_within = (came > 0.0) & (came <= FURTHEST * step) & ((there.load - end) * towards <= 0.0)
    is_fine &= ~is_meeting | is_within
    step = np.where(is_meeting & is_fine, came, step)
    slope = slope_by(family, there, cell) * walk.sign * towards
    return _Trial(step, cell, is_last, is_meeting, there, slope, margin_of(family, there), is_fine)


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
    turn(family, new, there, trial.cell, towards)
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


def _put_at(walk: Walk, place: _Place, which: Flags) -> None:
    walk.coordinates = np.where(which, place.coordinates, walk.coordinates)
    walk.load = np.where(which, place.load, walk.load)


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
