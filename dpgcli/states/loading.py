"""Fingers as their dead loads grow: followed from the unloaded state, through units that flip."""

from typing import cast

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.contracts import Measure
from dpgcli.equilibrium.loaded import LoadedPotential, Unchanged
from dpgcli.equilibrium.newton import minimize
from dpgcli.equilibrium.path import LARGEST_STEP, Ends, follow
from dpgcli.equilibrium.walk import PathEnd
from dpgcli.mechanics.coordinates import FingerCoordinates
from dpgcli.mechanics.terms import LOAD, Formulate
from dpgcli.records import dataclass
from dpgcli.states.certify import are_inverted
from dpgcli.states.units import UnitSolutions

SHORT_STEP = 0.25  # of a step, where curves bend often: no fold is stepped over
DISPLACED = 1e-3  # of a stroke: from a fold to where downhill is told from level
BEYOND = 1e-9  # of the load at a fold: just beyond it there is no state
TOLERANCE = 1e-12  # of the forces in play
MOST_FLIPS = 4  # times the number of units


@dataclass(frozen=True)
class Grown:
    """Fingers under their full loads, or as far as that could be followed.

    Coordinates (size, batch); which lanes `arrived`, (batch,). At the first fold on the way a unit
    loses its place: its `unit`, −1 where all are kept, and the `share` of the load, NaN there.
    `inverted` says which units are so beyond the last fold, (unit, batch): their domes go on.
    """

    coordinates: Array
    inverted: Flags
    arrived: Flags
    unit: Indices
    share: Array


def grown(units: UnitSolutions, formulate: Formulate, inverted: Flags, start: Array) -> Grown:
    """Follow unloaded states of patterns, (unit, batch), while their loads grow from nothing.

    `start` has their coordinates, (size, batch). Where a unit loses its place the finger goes
    downhill under that share of the load to its next minimum, and on from there. A dome that only
    pushes and has reset does not act any more, however far loads open its gap.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.terms import chain_potential
    >>> from dpgcli.states.settle import settle
    >>> bare = UnitSolutions.of(uniform_finger(1, **STUDY))
    >>> state = settle(bare, chain_potential, np.array([[True]]), 1e-12)
    >>> loaded = bare.finger.changed(end_moment=np.array([[-50.0]]))  # N mm, closes the gap
    >>> pushed = UnitSolutions.of(loaded)
    >>> way = grown(pushed, chain_potential, state.inverted, state.equilibrium.coordinates)
    >>> way.unit.tolist(), print((50.0 * way.share).round(3))  # N mm at which it resets
    [21.914]
    ([0], None)
    """
    n, n_units = inverted.shape[1], units.finger.n_units
    now, here, load = inverted.copy(), start.copy(), np.zeros(n)
    unit, share = np.full(n, -1), np.full(n, np.nan)
    arrived, lanes = np.zeros(n, bool), np.arange(n)
    for _ in range(MOST_FLIPS * n_units):
        few = units.take_lanes(lanes)
        family = _family(few, formulate, now[:, lanes])
        step = LARGEST_STEP * (SHORT_STEP if units.finger.law.curve is not None else 1.0)
        ends = follow(family, here[:, lanes], load[lanes], np.ones(len(lanes)), step)
        here[:, lanes], load[lanes] = ends.coordinates, ends.load
        arrived[lanes] = ends.outcome == PathEnd.ARRIVED
        folds = ends.outcome == PathEnd.FOLD
        lanes = lanes[folds]
        if not len(lanes):
            break
        is_first = np.isnan(share[lanes])
        unit[lanes] = np.where(is_first, ends.cell[folds], unit[lanes])
        share[lanes] = np.where(is_first, load[lanes], share[lanes])
        here[:, lanes] = _downhill(family.take_lanes(np.flatnonzero(folds)), ends, folds)
        load[lanes] *= 1.0 + BEYOND
        fallen = family.coordinates.take_lanes(np.flatnonzero(folds))
        springs = fallen.springs(here[:, lanes])
        wells = units.take_lanes(lanes).wells
        now[:, lanes] = are_inverted(fallen.finger, springs.extension, wells)
        lanes = lanes[~springs.is_folded]  # no finger takes such a shape, now or later
        if not len(lanes):
            break
    return Grown(here, now, arrived, unit, share)


def _family(
    units: UnitSolutions, formulate: Formulate, inverted: Flags
) -> LoadedPotential[FingerCoordinates, Unchanged]:
    """The energies by the share of the loads that acts."""
    potential = formulate(units.finger.with_domes(inverted))
    (dome,) = (term for term in potential.terms if term.kind == "bistable")
    growing = tuple(term for term in potential.terms if term.kind == LOAD)
    others = tuple(term for term in potential.terms if term.kind not in (LOAD, "bistable"))
    scale = units.finger.stroke, units.holding_stiffness
    law, measure = Unchanged(dome.law), cast("Measure", dome.measure)
    system = potential.coordinates
    return LoadedPotential(system, others, measure, law, measure, *scale, growing)


def _downhill(
    family: LoadedPotential[FingerCoordinates, Unchanged], ends: Ends, folds: Flags
) -> Array:
    """The minima next to folds, just beyond their loads."""
    start = (ends.coordinates + DISPLACED * ends.onward)[:, folds]
    potential = family.at((1.0 + BEYOND) * ends.load[folds])
    return minimize(potential, start, TOLERANCE, largest_step=SHORT_STEP).coordinates
