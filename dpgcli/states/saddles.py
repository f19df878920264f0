"""Saddles over which single units flip: the passes between a finger's stable states.

The saddle between a state and its neighbor, in which one unit is flipped, has one direction of
negative curvature. Newton's method on the gradient finds it from the shape in which a spring holds
that unit's dome at its barrier. It is certified: one negative pivot, and small steps both ways
along its direction go downhill to the two states.

A dome that only pushes may be apart from its neighbor at the top of its own curve: then it goes
over that top alone, and the finger stands as if the unit were in its ground state. Else it has to
push its neighbor on to where the finger's pull and its push balance (our derivation).
"""

from dataclasses import replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.banded import backward
from dpgcli.equilibrium.newton import Equilibrium, stationary
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.states.certify import MARGINAL_CURVATURE, Settled, Status
from dpgcli.states.flips import Flips, held, held_path
from dpgcli.states.guess import geometric_guess
from dpgcli.states.rigid_unit import tangent_of
from dpgcli.states.scan import pulls
from dpgcli.states.settle import lanes_at_once

NEAR = 1e-3  # of the step cap: two searches that end as near have found the same state
PLACES = 1024  # of a dome's travel before its top, at which it is looked at for ripples
HELD_AT = 32  # openings between two states at which a saddle that was missed is looked for
DOWNHILL_STEP = 0.25  # of the step cap: no valley of a steep curve is stepped over
ASIDE = 0.1  # of the step cap: from a saddle to where downhill is told from level


class SaddleStatus(IntEnum):
    """What was found between two patterns."""

    CERTIFIED = 0
    NO_NEIGHBOR = 1
    NOT_FOUND = 2

    @property
    def text(self) -> str:
        """The word in tables, such as `not_found`."""
        return self.name.lower()


@dataclass(frozen=True)
class Saddles:
    """The saddle of each flip, arrays (…, lane): energy in mJ, NaN where none is certified.

    `status` holds `SaddleStatus` codes. `is_apart` says that the dome is alone at its top.
    """

    energy: Array
    coordinates: Array
    status: NDArray[np.uint8]
    is_apart: Flags

    @classmethod
    def none(cls, size: int, n: int) -> "Saddles":
        """As if no unit had a neighbor to flip to."""
        status = np.full(n, SaddleStatus.NO_NEIGHBOR, np.uint8)
        return cls(np.full(n, np.nan), np.full((size, n), np.nan), status, np.zeros(n, bool))

    def take(self, lanes: Indices) -> "Saddles":
        """Some of them."""
        arrays = self.energy[lanes], self.coordinates[:, lanes]
        return Saddles(*arrays, self.status[lanes], self.is_apart[lanes])

    def put(self, lanes: Indices, others: "Saddles") -> None:
        """Replace some lanes."""
        self.energy[lanes], self.coordinates[:, lanes] = others.energy, others.coordinates
        self.status[lanes], self.is_apart[lanes] = others.status, others.is_apart


def saddles(flips: Flips) -> Saddles:
    """Find and certify the saddle of each flip, a batch at a time.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.terms import chain_potential
    >>> from dpgcli.states.units import UnitSolutions
    >>> units = UnitSolutions.of(uniform_finger(1, **STUDY))
    >>> flip = Flips(units, chain_potential, np.array([[False]]), np.array([0]), 1e-12)
    >>> print(saddles(flip).energy.round(8))  # mJ
    [6.03823327]
    """
    n, size = len(flips.unit), flips.potential.coordinates.size
    found, at_once = Saddles.none(size, n), lanes_at_once(len(flips.lower))
    for first in range(0, n, at_once):
        lanes = np.arange(first, min(first + at_once, n))
        found.put(lanes, _saddles(flips.take(lanes)))
    return found


def _saddles(flips: Flips) -> Saddles:
    found = Saddles.none(flips.potential.coordinates.size, len(flips.unit))
    lanes = np.flatnonzero(flips.of_unit(~flips.units.have_no_well))
    if len(lanes) and not pulls(flips.units.finger):
        alone, which = _alone(flips.take(lanes))
        found.put(lanes[which], alone)
        lanes = np.delete(lanes, which)
    if len(lanes):
        few = flips.take(lanes)
        found.put(lanes, _certified(few, _at_barrier(few)))
    missed = np.flatnonzero(found.status == SaddleStatus.NOT_FOUND)
    if len(missed):
        found.put(missed, _searched_again(flips.take(missed), found.take(missed)))
    return found


def is_state(settled: Settled) -> Flags:
    """Which are equilibria of their patterns, certified or marginal."""
    return np.asarray((settled.status == Status.STABLE) | (settled.status == Status.MARGINAL))


def _alone(flips: Flips) -> tuple[Saddles, Indices]:
    """Domes that only push and are apart from their neighbors at their tops; which those are."""
    ground = flips.settled(flips.lower)
    finger = flips.units.finger
    top = flips.of_unit(finger.law.rests(finger.domes).top)
    lanes = np.flatnonzero(flips.extension(ground.equilibrium.coordinates) > top)
    start = ground.equilibrium.coordinates[:, lanes]
    if not len(lanes):
        return Saddles.none(len(start), 0), lanes
    few = flips.take(lanes)
    energy = ground.equilibrium.energy + flips.own_energy(top)
    is_fine = _are_same(few.settled_from(few.upper, start), few.settled(few.upper))
    is_fine &= is_state(ground)[lanes] & _has_one_top(finger)
    return _judged(energy[lanes], start, is_fine, is_apart=True), lanes


def _has_one_top(finger: Finger) -> bool:
    """Whether domes by themselves go from their tops to their two rests, and to no ripple."""
    curve = finger.law.curve
    if curve is None:
        return True
    before = np.linspace(0.0, curve.rests[0], PLACES)[1:-1]
    return len(curve.branches) == 1 and bool((curve(before).slope > 0.0).all())


def _judged(energy: Array, coordinates: Array, is_fine: Flags, *, is_apart: bool) -> Saddles:
    status = np.where(is_fine, SaddleStatus.CERTIFIED, SaddleStatus.NOT_FOUND).astype(np.uint8)
    where = np.where(is_fine, coordinates, np.nan)
    return Saddles(np.where(is_fine, energy, np.nan), where, status, np.full(len(status), is_apart))


def _at_barrier(flips: Flips) -> Array:
    """Coordinates with the dome that flips held at its barrier between rigid bars."""
    units = flips.units
    barrier, finger = units.wells.barrier, units.finger
    angle = np.arctan(tangent_of(finger, barrier))
    wall = barrier - 2.0 * finger.segment_height * np.sin(angle)
    guess = geometric_guess(finger, flips.lower, units.first_order)
    near, far, yielded = (
        np.where(flips.is_flipping, own, rest)
        for own, rest in ((angle, guess.near_angle), (angle, guess.far_angle), (wall, guess.wall))
    )
    shape = guess._replace(near_angle=near, far_angle=far, wall=yielded)
    start = flips.potential.coordinates.of_shape(shape)
    return held(flips, start, flips.of_unit(barrier))


def _certified(flips: Flips, start: Array) -> Saddles:
    """The saddles next to some coordinates, if they part the two states."""
    there = stationary(flips.potential, start, flips.tolerance)
    pivots = there.factorization.pivots / flips.potential.coordinates.stiffness_scale
    is_saddle = (pivots < 0.0).sum(axis=0) == 1
    is_saddle &= np.abs(pivots).min(axis=0) > MARGINAL_CURVATURE
    is_saddle &= there.relative_residual <= flips.tolerance
    is_saddle &= ~flips.potential.coordinates.springs(there.coordinates).is_folded
    is_saddle &= pulls(flips.units.finger) or _has_one_top(flips.units.finger)
    lanes = np.flatnonzero(is_saddle)
    is_saddle[lanes] = _parts(flips.take(lanes), there, lanes)
    return _judged(there.energy, there.coordinates, is_saddle, is_apart=False)


def _parts(flips: Flips, there: Equilibrium, lanes: Indices) -> Flags:
    """Whether it goes down to the one state and to the other from saddles at some lanes.

    With the negative pivot d in row p, the vector v of Lᵀv = e_p has vᵀHv = d.
    """
    if not len(lanes):
        return np.zeros(0, bool)
    factors, own = there.factorization, flips.potential.coordinates
    taken = replace(factors, lower=factors.lower[..., lanes], pivots=factors.pivots[:, lanes])
    here = there.coordinates[:, lanes]
    aside = backward(taken, (taken.pivots < 0.0).astype(float))
    aside *= ASIDE / np.abs(aside / own.step_cap).max(axis=0)
    opened, closed = own.moved(here, aside), own.moved(here, -aside)
    is_open = flips.extension(opened) > flips.extension(closed)
    low, high = np.where(is_open, closed, opened), np.where(is_open, opened, closed)
    both = flips.take(np.tile(np.arange(len(lanes)), 2))
    patterns = np.concatenate((flips.lower, flips.upper), axis=1)
    ends = both.settled_from(patterns, np.concatenate((low, high), axis=1), DOWNHILL_STEP)
    return np.asarray(_are_same(ends, both.settled(patterns)).reshape(2, -1).all(axis=0))


def _are_same(ends: Settled, states: Settled) -> Flags:
    """Whether searches ended in the states of their patterns, and not in ripples beside them."""
    away = ends.equilibrium.coordinates - states.equilibrium.coordinates
    is_near = np.abs(away / states.potential.coordinates.step_cap).max(axis=0) <= NEAR
    return np.asarray(is_state(ends) & is_state(states) & is_near)


def _searched_again(flips: Flips, found: Saddles) -> Saddles:
    """Saddles that were missed, from the highest place on the way along the held dome.

    Where there is no neighbor there is no saddle to it.
    """
    before, after = flips.settled(flips.lower), flips.settled(flips.upper)
    exists = is_state(before) & is_state(after)
    found.status[~exists] = SaddleStatus.NO_NEIGHBOR
    lanes = np.flatnonzero(exists & ~found.is_apart)
    if len(lanes):
        few = flips.take(lanes)
        first, last = (each.equilibrium.coordinates[:, lanes] for each in (before, after))
        path = held_path(few, first, last, np.linspace(0.0, 1.0, HELD_AT + 1)[1:-1])
        highest = path.energy.argmax(axis=0), np.arange(len(lanes))
        start = path.coordinates[:, *highest]
        found.put(lanes, _certified(few, start))
    return found
