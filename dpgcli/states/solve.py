"""From patterns to equilibria: minimize from each pattern's guess."""

from collections.abc import Callable

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.newton import minimize
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.formulation import Formulation
from dpgcli.states.certify import Batch, Status, batch_at, certify
from dpgcli.states.guess import geometric_guess, stroke_guess
from dpgcli.states.units import Units

FINEST_TOLERANCE = 1e-15  # of the forces in play: rounding's
UNITS_AT_ONCE = 15_000  # keeps a batch in the processor's second cache; measured


def solve(
    units: Units,
    formulate: Callable[[Finger], Formulation],
    inverted: Flags,
    tolerance: float,
    *,
    strokes: float | None = None,
) -> Batch:
    """Minimize from each pattern's geometric guess; what was found is yet to be certified.

    `inverted` has shape (unit, batch); the finger has one design, or one for each lane.
    The guess puts each unit into its own rigid well, or opens it by `strokes` strokes. What soft
    bars let go astray from there is looked for once more, with domes held open first.
    """
    formulation = formulate(units.finger.with_pattern(inverted))
    if strokes is not None:
        guess = stroke_guess(units.finger, inverted, strokes)
        return search(units, formulation, inverted, formulation.coordinates(guess), tolerance)
    guess = geometric_guess(units.finger, inverted, units.first_order)
    batch = search(units, formulation, inverted, formulation.coordinates(guess), tolerance)
    soft = units.are_soft.any(axis=0)
    if not soft.any():
        return batch
    missed = certify(batch, units, tolerance) != Status.STABLE
    lanes = np.flatnonzero(missed & soft)
    return _searched_again(units, formulate, batch, tolerance, lanes) if len(lanes) else batch


def search(
    units: Units, formulation: Formulation, inverted: Flags, start: Array, tolerance: float
) -> Batch:
    """Walk from coordinates, (size, batch), and see which wells the units end in.

    Near a fold the tolerance may not do: there the walk goes on to where rounding ends it.
    """
    batch = batch_at(units, formulation, inverted, minimize(formulation, start, tolerance))
    is_close = batch.equilibrium.relative_residual <= tolerance
    lanes = np.flatnonzero(is_close & ~batch.is_balanced)
    if not len(lanes):
        return batch
    few = formulation.designs(lanes)
    here = np.take(batch.equilibrium.coordinates, lanes, axis=1)
    further = minimize(few, here, FINEST_TOLERANCE)
    everywhere = np.arange(len(lanes))
    equilibrium = batch.equilibrium.with_lanes(lanes, further, everywhere)
    return batch_at(units, formulation, inverted, equilibrium)


def _searched_again(
    units: Units,
    formulate: Callable[[Finger], Formulation],
    batch: Batch,
    tolerance: float,
    lanes: Indices,
) -> Batch:
    """Search some lanes with domes held open until bars and hinges have settled, then let go.

    What is let go walks down from beyond its well, and meets the well before its barrier. A lane
    is replaced if that finds its state.
    """
    few, inverted = units.designs(lanes), np.take(batch.inverted, lanes, axis=1)
    guess = stroke_guess(few.finger, inverted, 1.0)
    held = formulate(few.finger.with_domes_held(inverted))
    settled = minimize(held, held.coordinates(guess), tolerance).coordinates
    formulation = formulate(few.finger.with_pattern(inverted))
    again = search(few, formulation, inverted, settled, tolerance)
    found = np.flatnonzero(certify(again, few, tolerance) == Status.STABLE)
    if not len(found):
        return batch
    equilibrium = batch.equilibrium.with_lanes(lanes[found], again.equilibrium, found)
    return batch_at(units, batch.formulation, batch.inverted, equilibrium)


def lanes_at_once(n_units: int) -> int:
    """How many fingers to solve in one batch."""
    return max(UNITS_AT_ONCE // n_units, 256)
