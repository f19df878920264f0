"""Wells and tops of a unit under any law: signs of its force on a grid, then a root of it.

The places of the grid next to which the force turns are moved to where it does, so that a well and
its barrier next to a fold are told apart, however close they are.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.mechanics.finger import Finger
from dpgcli.states.rigid_unit import (
    SHORT_OF_LEVER,
    TurnedUnit,
    rigid_unit,
    single_units,
    tangent_of,
    turned_unit,
)

MIDDLE = 0.75  # in strokes: the vertex of 2u² − 3u, between barrier and well
IN_TOUCH = 0.999  # of a dome's own well: where a dome that only pushes still does
SEARCHED = 512  # places at which the force of a unit is looked at, for any curve
FEWER = 64  # for the polynomial, whose force turns twice
COARSE = 16  # of them, with walls, for which the corners' turn is searched
TANGENTS = 2.0  # times a slope's reach: a stiffness may have a kink in the cell
WIDEST = 1.5  # of the travel to the polynomial's own well: no unit rests beyond
ARRIVED = 1e-15  # of what places are counted by: a smaller step is rounding
ONE = np.ones((1, 1))
BISECTIONS = 53  # of one 64th of the range: down to rounding


class Scan(NamedTuple):
    """What there is of a unit's wells, extensions in mm; see `wells.Wells`."""

    exists: Flags
    extension: Array
    barrier: Array
    from_top: Array
    to_top: Array
    snap_force: Array
    reset_force: Array


class _Profile(NamedTuple):
    """Places along the extension of a unit and its response there, (place, unit, design).

    `by` is what places are counted by: the extension itself, or with walls the tangent of the
    corners' turn.
    """

    by: Array
    places: Array
    energy: Array
    force: Array
    stiffness: Array


def scan(finger: Finger) -> Scan:
    """Find each unit's deepest well beyond its spring's own barrier; `wells` says which counts.

    Wells and tops are those of the dome attached to its neighbor, also where it only pushes: the
    hinge pulls back at every opening, so that the dome pushes wherever the unit rests or turns.
    """
    attached = replace(finger, law=finger.law.pulling)
    rests = finger.law.rests(finger.domes)
    widest, within_reach = _range(finger, rests.well)
    profile = _turned(attached, _profile(attached, widest))
    rises = profile.force >= 0.0
    places = np.arange(len(rises) - 1)[:, None, None]
    is_well, is_top = ~rises[:-1] & rises[1:], rises[:-1] & ~rises[1:]
    before = profile.places[:-1]
    is_well &= (before >= np.maximum(rests.top, 0.0)) & within_reach
    if not pulls(finger):
        is_well &= before < rests.well  # beyond it the dome is not in touch
    at_top = attached.springs(rests.top).energy  # the barrier of a dome that inverts untouched
    untouched = np.where(rests.top < 0.0, at_top, -np.inf)
    # beyond the last place the unit's energy rises on, or bars end it: no well is shallow for that
    highest = np.maximum(np.maximum.accumulate(profile.energy, axis=0), untouched)[:-1]
    well = np.where(is_well, highest - profile.energy[:-1], -np.inf).argmax(axis=0)
    tops = np.where(is_top & (places < well), profile.energy[:-1], -np.inf)
    top = tops.argmax(axis=0)
    is_touching = tops.max(axis=0) > untouched
    exists = np.asarray(is_well.any(axis=0))
    at_well = _turning_point(attached, profile.by, well, rises=True)
    turning = _turning_point(attached, profile.by, top, rises=False)
    turning = np.where(is_touching, turning, _or_zero(rests.top))
    extension = np.where(exists, at_well, opened(finger, widest))
    barrier = np.where(exists, turning, MIDDLE * finger.stroke)
    along = profile.places
    reset = _largest(-profile.force, (along >= barrier) & (along <= extension))
    snap = _largest(profile.force, (along <= barrier) & pulls(finger))
    others = _between(attached, profile.by, (is_well, is_top), well)
    return Scan(exists, extension, barrier, *others, snap, reset)


def pulls(finger: Finger) -> bool:
    """Whether domes act in any state, also where they pull."""
    return finger.law.pulling is finger.law


def opened(finger: Finger, widest: Array) -> Array:
    """Where a search begins in a unit without a second well, mm: open by its stroke.

    A dome that only pushes has to be in touch, or nothing would hold the unit there.
    """
    highest = np.nan if pulls(finger) else finger.law.rests(finger.domes).well
    opening = np.where(np.isnan(highest), finger.stroke, IN_TOUCH * highest)
    return np.asarray(np.minimum(opening, widest))


def _or_zero(top: Array) -> Array:
    return np.where(np.isnan(top), 0.0, np.minimum(top, 0.0))


def _range(finger: Finger, own_well: Array) -> tuple[Array, Flags]:
    """The widest extension to look at (mm), and whether a unit can get there."""
    domes = finger.domes
    whole = domes.stroke + domes.contact
    own = own_well + domes.contact  # a travel; the unit's is shorter
    curve = finger.law.curve
    if curve is None:
        furthest = WIDEST * np.where(np.isnan(own), whole, own)
    else:  # beyond its last point nothing is known, but for a well that is there
        furthest = np.fmax(curve.knots[-1] * whole, own)
    widest = furthest - domes.contact
    if not finger.has_walls:  # walls take the rest
        widest = np.minimum(widest, SHORT_OF_LEVER * 2.0 * finger.segment_height)
    within_reach = widest > 0.0
    return np.where(within_reach, widest, finger.stroke), within_reach


def _profile(finger: Finger, widest: Array) -> _Profile:
    searched = FEWER if finger.law.curve is None else SEARCHED
    share = np.linspace(0.0, 1.0, (COARSE if finger.has_walls else searched) + 1)
    by = widest * share[:, None, None]
    if finger.has_walls:
        by = _refined(tangent_of(finger, by), searched // COARSE)
    places, (energy, force, stiffness), _ = _at(finger, by, finger.has_walls)
    by, places = (np.broadcast_to(part, force.shape) for part in (by, places))
    return _Profile(by, places, energy, force, stiffness)


def _refined(places: Array, parts: int) -> Array:
    """Places, the first axis, with each cell between them divided into equal parts."""
    between = np.linspace(0.0, 1.0, parts, endpoint=False)[:, None, None]
    cells = places[:-1, None] + between * np.diff(places, axis=0)[:, None]
    return np.concatenate((cells.reshape(-1, *places.shape[1:]), places[-1:]))


def _at(finger: Finger, by: Array, is_turn: bool) -> TurnedUnit:
    """Units by what a profile counts its places by."""
    return turned_unit(finger, by) if is_turn else TurnedUnit(by, rigid_unit(finger, by), ONE)


def _turned(finger: Finger, profile: _Profile) -> _Profile:
    """The profile with the end of a cell moved to where the force turns in it, if that may matter.

    It does where the force keeps its sign at both ends but may lose it between: next to a fold.
    """
    cell, unit, design = np.nonzero(_may_hide_two_roots(profile))
    if not len(cell):
        return profile
    flat, (_, designs) = single_units(finger)
    few = flat.take_lanes(unit * designs + design)
    low, high = (profile.by[cell + k, unit, design][None] for k in (0, 1))
    begins = profile.stiffness[cell, unit, design] >= 0.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        is_before = (_at(few, middle, finger.has_walls).response.stiffness >= 0.0) == begins
        low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
    place, response, _ = _at(few, low, finger.has_walls)
    by, places, energy, force = (np.array(part) for part in profile[:-1])
    moved = (low, place, response.energy, response.force)
    for own, new in zip((by, places, energy, force), moved, strict=True):
        own[cell + 1, unit, design] = new[0]
    return _Profile(by, places, energy, force, profile.stiffness)


def _may_hide_two_roots(profile: _Profile) -> Flags:
    """Cells between whose ends the force turns, may vanish by its tangents, and has one sign."""
    first, second = (profile.stiffness[:-1], profile.stiffness[1:])
    before, after = profile.force[:-1], profile.force[1:]
    width = TANGENTS * np.diff(profile.places, axis=0)
    is_least = (before >= 0.0) & (after >= 0.0) & (first < 0.0) & (second >= 0.0)
    is_largest = (before < 0.0) & (after < 0.0) & (first >= 0.0) & (second < 0.0)
    reaches = (np.abs(before) <= width * np.abs(first)) & (np.abs(after) <= width * np.abs(second))
    hides = (is_least | is_largest) & reaches
    hides[-1] = False  # the last place stays
    return np.asarray(hides)


def _between(
    finger: Finger, by: Array, turns: tuple[Flags, Flags], well: Indices
) -> tuple[Array, Array]:
    """The tops beside a well that part it from others, ∓ infinity where there is no other."""
    is_well, is_top = turns
    index = np.arange(len(is_well))[:, None, None]
    lower, upper = np.full(well.shape, -np.inf), np.full(well.shape, np.inf)
    has_lesser = (is_well & (index < well)).any(axis=0)
    if has_lesser.any():
        last = np.where(is_top & (index < well), index, 0).max(axis=0)
        lower = np.where(has_lesser, _turning_point(finger, by, last, rises=False), lower)
    has_further = (is_well & (index > well)).any(axis=0)
    if has_further.any():
        first = (is_top & (index > well)).argmax(axis=0)
        upper = np.where(has_further, _turning_point(finger, by, first, rises=False), upper)
    return lower, upper


def _largest(values: Array, at: Flags) -> Array:
    """The largest of some values by unit, (place, unit, design); infinite where there are none."""
    return np.where(at.any(axis=0), np.where(at, values, -np.inf).max(axis=0), np.inf)


def _turning_point(finger: Finger, by: Array, index: Indices, *, rises: bool) -> Array:
    """The extension (mm) at which the force changes its sign between a place and the next.

    By Newton's method within what is known to be before it and behind, else by bisection.
    """
    low, high = (np.take_along_axis(by, (index + k)[None], axis=0)[0] for k in (0, 1))
    here, is_running = 0.5 * (low + high), np.ones(low.shape, bool)
    for _ in range(BISECTIONS):
        at = _at(finger, here, finger.has_walls)
        is_beyond = (at.response.force >= 0.0) == rises
        low, high = np.where(is_beyond, low, here), np.where(is_beyond, here, high)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            step = at.response.force / (at.response.stiffness * at.rate)
        is_running &= ~(np.abs(step) <= ARRIVED * here)  # what has arrived stays
        if not is_running.any():
            break
        further = here - step
        is_inside = (further > low) & (further < high)
        here = np.where(is_running, np.where(is_inside, further, 0.5 * (low + high)), here)
    return np.asarray(_at(finger, here, finger.has_walls).extension)
