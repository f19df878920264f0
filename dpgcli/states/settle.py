"""From patterns to certified states: guess, minimize, certify."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.newton import minimize
from dpgcli.mechanics.coordinates import FingerPotential, Internal
from dpgcli.mechanics.terms import Formulate
from dpgcli.states.certify import Settled, Status, certified
from dpgcli.states.guess import geometric_guess, stroke_guess
from dpgcli.states.units import UnitSolutions

FINEST_TOLERANCE = 1e-15  # of the forces in play: rounding's
HELD_FROM = (1.0, 0.0)  # strokes: corners open first, or soft bars give way first
STRAIGHT = 0.1  # of the way of the openings: halves of loads that differ by less are alike
UNITS_AT_ONCE = 15_000  # keeps a batch in the processor's second cache; measured


def settle(
    units: UnitSolutions,
    formulate: Formulate,
    inverted: Flags,
    tolerance: float,
    *,
    start: Internal | None = None,
    own: slice = slice(None),
) -> Settled:
    """Find the states of patterns, (unit, batch), and certify each.

    `units` have one design, or one for each lane; `formulate` gives the potential of a finger,
    loads and all. `tolerance` is the largest residual over the forces in play. The search begins
    at the shape `start`, or else at a guess that puts each unit into its own well; what goes
    astray from there between bars that give way is looked for again, with domes held open first.
    Under dead loads a state is what its unloaded state becomes as they grow. `own` are the units
    that must have reached their wells.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.terms import chain_potential
    >>> units = UnitSolutions.of(uniform_finger(2, **STUDY))
    >>> settled = settle(units, chain_potential, np.array([[True, True], [False, True]]), 1e-12)
    >>> [Status(code).text for code in settled.status]
    ['stable', 'stable']
    """
    potential = formulate(units.finger.with_domes(inverted))
    walk = partial(settle_from, units, potential, inverted, tolerance=tolerance, own=own)
    if start is not None:
        return walk(potential.coordinates.of_shape(start))
    guess = potential.coordinates.of_shape(
        geometric_guess(units.finger, inverted, units.first_order)
    )
    if units.finger.is_loaded:
        return _under_load(units, formulate, walk, inverted, guess, tolerance, own)
    settled = walk(guess)
    for strokes in HELD_FROM:
        lanes = _worth_a_search(settled, units)
        if not len(lanes):
            break
        settled = _searched_again(units, formulate, settled, tolerance, own, lanes, strokes)
    return settled


def settle_from(
    units: UnitSolutions,
    potential: FingerPotential,
    inverted: Flags,
    start: Array,
    tolerance: float,
    own: slice = slice(None),
    largest_step: float = 1.0,
) -> Settled:
    """Walk from coordinates, (size, batch), to where the residual is small, and certify.

    Near a fold the tolerance may not do: there the walk goes on to where rounding ends it.
    """
    there = minimize(potential, start, tolerance, largest_step=largest_step)
    settled = certified(units, potential, inverted, there, tolerance, own)
    is_close = there.relative_residual <= tolerance
    lanes = np.flatnonzero(is_close & ~settled.is_balanced)
    if not len(lanes):
        return settled
    here = np.take(there.coordinates, lanes, axis=1)
    further = minimize(potential.take_lanes(lanes), here, FINEST_TOLERANCE)
    there = there.with_lanes(lanes, further, np.arange(len(lanes)))
    return certified(units, potential, inverted, there, tolerance, own)


def _worth_a_search(settled: Settled, units: UnitSolutions) -> Indices:
    """Lanes without a state, if bars give way and every inverted unit may have a second well.

    What is folded in its own wells between stiff bars has no other state.
    """
    is_elsewhere = ((settled.reached != settled.inverted) | settled.strayed).any(axis=0)
    is_missed = is_elsewhere | (settled.status != Status.STABLE)
    if units.finger.is_rigid or not is_missed.any():
        return np.arange(0)
    has_none = (settled.inverted & units.have_no_well).any(axis=0)
    is_no_other = settled.is_folded & ~is_elsewhere & ~units.are_soft.any(axis=0)
    return np.flatnonzero(is_missed & ~has_none & ~is_no_other)


def _searched_again(
    units: UnitSolutions,
    formulate: Formulate,
    settled: Settled,
    tolerance: float,
    own: slice,
    lanes: Indices,
    strokes: float,
) -> Settled:
    """Search some lanes with domes held open until bars and hinges have settled, then let go.

    The domes are pulled open from so many `strokes`. What is let go walks down from beyond its
    well, and meets the well before its barrier. A lane is replaced if that finds its state.
    """
    few, inverted = units.take_lanes(lanes), np.take(settled.inverted, lanes, axis=1)
    held = formulate(few.finger.with_domes_held(inverted))
    guess = held.coordinates.of_shape(stroke_guess(few.finger, inverted, strokes))
    start = minimize(held, guess, tolerance).coordinates
    potential = formulate(few.finger.with_domes(inverted))
    again = settle_from(few, potential, inverted, start, tolerance)
    found = np.flatnonzero(again.status == Status.STABLE)
    if not len(found):
        return settled
    there = settled.equilibrium.with_lanes(lanes[found], again.equilibrium, found)
    return certified(units, settled.potential, settled.inverted, there, tolerance, own)


def _under_load(
    units: UnitSolutions,
    formulate: Formulate,
    walk: Callable[[Array], Settled],
    inverted: Flags,
    guess: Array,
    tolerance: float,
    own: slice,
) -> Settled:
    """What unloaded states become as loads grow, in another pattern perhaps, certified.

    Where openings grow in proportion to the loads Newton's method does; all else is followed, since
    it might step over a fold, or onto another branch. What is lost on the way, as a finger that
    folds onto itself, has no answer. What has no unloaded state is looked for under the full loads.
    The domes that act in the end are those that a way ends with.
    """
    bare = replace(units, finger=units.finger.unloaded)
    begun = settle(bare, formulate, inverted, tolerance, own=own)
    has_begun = begun.status == Status.STABLE
    half = formulate(units.finger.with_share_of_loads(0.5).with_domes(inverted))
    there = minimize(half, begun.equilibrium.coordinates, tolerance).coordinates
    settled = walk(np.where(has_begun, there, guess))
    full = settled.equilibrium.coordinates
    coordinates = settled.potential.coordinates
    ways = (begun.equilibrium.coordinates, there, full)
    is_straight = _are_straight(*(coordinates.springs(x).extension for x in ways))
    is_sure = is_straight & (settled.status == Status.STABLE)
    is_sure |= settled.status == Status.MARGINAL  # next to a fold, or on a saddle: no way on
    lanes = np.flatnonzero(has_begun & ~is_sure)
    if not len(lanes):
        return settled
    from dpgcli.states.loading import grown  # paths, which loads alone need

    few, begins = units.take_lanes(lanes), np.take(inverted, lanes, axis=1)
    way = grown(few, formulate, begins, begun.equilibrium.coordinates[:, lanes])
    potential = formulate(few.finger.with_domes(way.inverted))
    again = settle_from(few, potential, begins, way.coordinates, tolerance, own)
    found = settled.equilibrium.with_lanes(lanes, again.equilibrium, np.arange(len(lanes)))
    domes = inverted.copy()
    domes[:, lanes] = way.inverted
    ended = formulate(units.finger.with_domes(domes))
    settled = certified(units, ended, inverted, found, tolerance, own)
    status = settled.status.copy()
    status[lanes[~way.arrived]] = Status.NOT_CONVERGED  # elsewhere than loads lead to, if anywhere
    return replace(settled, status=status)


def _are_straight(begin: Array, middle: Array, end: Array) -> Flags:
    """Whether openings, (unit, lane), move about as far in the one half of a load as in the other.

    Up to a fold the openings move by as the root of what is left does: 0.41 of the whole way more.
    """
    bend = np.abs(end - 2.0 * middle + begin).max(axis=0)
    return np.asarray(bend <= STRAIGHT * np.abs(end - begin).max(axis=0))


def lanes_at_once(n_units: int) -> int:
    """How many fingers to solve in one batch."""
    return max(UNITS_AT_ONCE // n_units, 256)
