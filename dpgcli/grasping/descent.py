"""Downhill to where fingers rest against bodies: by pushes from afar, by contacts near by."""

from dataclasses import replace

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.equilibrium.constraints import AugmentedContact
from dpgcli.equilibrium.corrector import corrected
from dpgcli.equilibrium.newton import minimize
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.shapes import ContactShapes
from dpgcli.mechanics.laws import PushOnly

TOLERANCE = 1e-12  # of the forces in play
CLOSE = 1e-6  # of a stroke: multipliers that change by less have found their set
MOST_UPDATES, MOST_STEPS = 30, 120  # of multipliers; of a descent
STUCK, MOST_STUCK = 1e-8, 4  # of the forces in play; descents that end in a corner
SHORT_STEP = 0.25  # of the step cap, a twentieth of a stroke: no well is stepped over


def relaxed(
    obstructed: Obstructed, start: Array, inverted: Flags, push: Array, load: Array
) -> ContactShapes:
    """Go downhill from coordinates at some loads to the next minima, by short steps.

    Domes that only push and are pushed out of their wells are let go, and the others go on. One
    whose end slips over a body stays there, and is none.
    """
    found = _relaxed(obstructed, start, inverted, push, load)
    for _ in range(obstructed.n_fingers * obstructed.units.finger.n_units):
        fallen = _fallen(obstructed, found)
        lanes = np.flatnonzero(fallen.any(axis=0))
        if not len(lanes):
            break
        few, own = found.take_lanes(lanes), obstructed.take_lanes(lanes)
        left = few.inverted & ~fallen[:, lanes]
        found.put(lanes, _relaxed(own, few.coordinates, left, few.push, load[lanes]))
    return found


def _fallen(obstructed: Obstructed, shapes: ContactShapes) -> Flags:
    if obstructed.n_travels or not isinstance(obstructed.units.finger.law, PushOnly):
        return np.zeros(shapes.inverted.shape, bool)
    return shapes.inverted & ~obstructed.is_open(shapes)


def _relaxed(
    obstructed: Obstructed, start: Array, inverted: Flags, push: Array, load: Array
) -> ContactShapes:
    here, push, lanes = start.copy(), push.copy(), np.arange(start.shape[1])
    found = ContactShapes(here.copy(), push.copy(), push > 0.0, inverted.copy(), lanes < 0)
    n_stuck = np.zeros(len(lanes), int)
    for count in range(MOST_UPDATES):
        own = obstructed.take_lanes(lanes)
        potential = own.pressed(inverted[:, lanes], push[:, lanes], load[lanes])
        there = minimize(potential, here[:, lanes], TOLERANCE, MOST_STEPS, largest_step=SHORT_STEP)
        contact = potential.terms[-1]
        assert isinstance(contact.law, AugmentedContact), "the last term"
        pushed = contact.law.pushes(contact.measure(there.coordinates).value)
        here[:, lanes], push[:, lanes] = there.coordinates, pushed
        near = finished(own, there.coordinates, inverted[:, lanes], pushed, load[lanes])
        away = np.abs(near.coordinates - there.coordinates) / potential.coordinates.step_cap
        is_near = near.is_there & (away.max(axis=0) <= SHORT_STEP)
        is_stuck = ~(there.relative_residual <= STUCK)
        is_slipping = is_stuck & ~is_near & own.are_slipping(there.coordinates, load[lanes])
        near.coordinates[:, is_slipping] = there.coordinates[:, is_slipping]
        near.is_there[is_slipping] = False
        n_stuck = n_stuck + is_stuck
        goes_on = ~is_near & (n_stuck < MOST_STUCK) & (count < MOST_UPDATES - 1) & ~is_slipping
        goes_on &= np.isfinite(there.relative_residual)
        if own.is_free:  # a body that nothing pushes after so many steps has left
            goes_on &= (pushed[: own.n_on_bodies] > 0.0).any(axis=0)
        found.put(lanes[~goes_on], near.take_lanes(np.flatnonzero(~goes_on)))
        lanes, n_stuck = lanes[goes_on], n_stuck[goes_on]
        if not len(lanes):
            break
    return found


def finished(
    obstructed: Obstructed, near: Array, inverted: Flags, push: Array, load: Array
) -> ContactShapes:
    """Equilibria with the active set that pushes say, (cell, batch), from nearby."""
    active = (push > 0.0) | obstructed.are_kept
    family, n = obstructed.family(inverted, active), len(load)
    nothing, free = np.full(n, -1), np.zeros(n)
    begun = ContactShapes(near, push, active, inverted.copy(), np.ones(n, bool))
    guess = obstructed.stacked(begun)
    there = corrected(family, guess, load, nothing, free, max(family.column_depths))
    margin = family.law.margin(there.loaded, load)
    is_there = there.is_fine & (margin >= -CLOSE).all(axis=0)
    found, y = there.coordinates[: len(near)], there.coordinates[len(near) :]
    pushes = obstructed.pushes(active, y)
    return replace(begun, coordinates=found, push=pushes, is_there=is_there)
