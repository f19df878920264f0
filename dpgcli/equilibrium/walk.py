"""Walks along paths: where each of them is, and what is known of the way on."""

from dataclasses import fields, replace
from enum import IntEnum

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.contracts import Coordinates
from dpgcli.equilibrium.corrector import Corrected, margin_rate, motion_by
from dpgcli.equilibrium.loaded import LoadedLaw, LoadedPotential, along
from dpgcli.records import dataclass

AWAY = 1e-9  # of the forces in play: what is nearer to an event may be at it, rounding aside
FIRST_STEP = 0.5  # of the step cap: of what moves most, where it is not known how it bends
BY_SECANTS = -2  # instead of a cell: an event is come near to from before
UNFORESEEN = -3  # the same: the one that was foreseen is not there


class PathEnd(IntEnum):
    """How a path ended."""

    ARRIVED = 0
    FOLD = 1
    EVENT = 2
    FAILED = 3


@dataclass
class Walk:
    """Paths under way: the present point of each, and what is known of the way on.

    `cell` is followed in the direction `sign`; per step of one scale the coordinates move by
    `onward` and the load by `slope`, positive towards its end. `step` is the next one, `last` the
    one before and `last_slope` the slope there, NaN if another cell was followed; `bend` is how
    `onward` changes per step since then, zero if that is not known. Where nothing moves `cell` is
    −1, and steps are of the load itself. `margin` (cell, batch) is that to events, and `falling` by
    how much less it becomes per step. `is_beyond` says that the last step that was tried led
    beyond an event; then `meeting` is the cell whose margin vanishes there, to be gone to, −1 if
    there is none, `BY_SECANTS` where it was not found, and `UNFORESEEN` where none was to be found
    that seemed to be ahead. `count` is that of steps.
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
    falling: Array
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


def margin_of(family: LoadedPotential[Coordinates, LoadedLaw], here: Corrected) -> Array:
    """Margins to events at some points, (cell, batch); infinite where the law knows none."""
    margin = family.law.margin(here.loaded, here.load)
    return np.full(here.loaded.value.shape, np.inf) if margin is None else margin


def to_events_ahead(walk: Walk) -> Array:
    """Steps to where margins vanish that fall as here, (cell, batch); infinite for others."""
    falls = (walk.falling > 0.0) & (walk.margin > AWAY)
    return np.where(falls, walk.margin / np.where(falls, walk.falling, 1.0), np.inf)


def may_kink(family: LoadedPotential[Coordinates, LoadedLaw], n: int) -> Flags:
    """Which of n lanes may have a kink on the way, where a contact slides over a corner."""
    return np.zeros(n, bool) if family.may_kink is None else family.may_kink


def go_by_load(walk: Walk, which: Flags) -> None:
    """Go on by the load where no step by a cell leads further: beyond a kink it may not move."""
    slope = np.where(which, walk.slope, 1.0)
    walk.cell = np.where(which, -1, walk.cell)
    walk.onward, walk.slope = walk.onward / slope, walk.slope / slope
    walk.step = np.where(which, walk.step * slope, walk.step)
    walk.last_slope = np.where(which, np.nan, walk.last_slope)
    walk.bend = np.where(which, 0.0, walk.bend)
    walk.falling = walk.falling / slope


def slope_bend(walk: Walk) -> Array:
    """How the slope changes per step since the last point, zero if that is not known."""
    bend = (walk.slope - walk.last_slope) / walk.last
    return np.where(np.isfinite(bend), bend, 0.0)


def along_bend(walk: Walk, rise: Array) -> Array:
    """Steps to where the load has risen by so much: τ dλ/dτ + ½ τ² d²λ/dτ², or the first alone."""
    square = walk.slope**2 + 2.0 * slope_bend(walk) * rise
    rate = np.where(square > 0.0, 0.5 * (walk.slope + np.sqrt(np.abs(square))), walk.slope)
    return np.where(rate > 0.0, rise / rate, 0.0)


def distance_to_fold(slope: Array, last_slope: Array, last: Array) -> Array:
    """Steps to where the slope vanishes, by the secant through the last point and this one."""
    falls = last_slope > slope
    distance = slope * last / np.where(falls, last_slope - slope, 1.0)
    return np.where(falls, distance, np.inf)


def land(walk: Walk, which: Flags, distance: Array, towards: Array) -> None:
    """Go the rest of the way to folds: λ there is ½ τ dλ/dτ further."""
    rest = np.where(which, distance, 0.0)
    walk.coordinates = walk.coordinates + walk.onward * rest
    walk.load = walk.load + towards * 0.5 * walk.slope * rest


def turn(
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
    if family.may_kink is not None:
        walk.falling = -margin_rate(family, here.loaded, here.load, onward, towards * walk.slope)


def _furthest(family: LoadedPotential[Coordinates, LoadedLaw], motion: Array) -> Array:
    """How far the coordinate moves that moves furthest, in step caps, (batch,)."""
    return np.asarray(np.abs(motion / family.coordinates.step_cap).max(axis=0))
