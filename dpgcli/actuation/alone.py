"""Units by themselves under pressure: where each snaps and resets, and how far a search has to go.

A unit by itself is a finger of one unit, with its bars and walls; its thresholds are found as those
of any finger are.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dpgcli.actuation.domes import limits
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.staircase import staircase
from dpgcli.arrays import Array
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.states.certify import Status
from dpgcli.states.units import UnitSolutions

BEYOND = 4.0  # times what a dome and its hinge bear: further than any threshold of a unit
REACH = 2.0  # times the largest threshold of a unit alone: how far pressures go


class Thresholds(NamedTuple):
    """Pressures (MPa) at which units by themselves snap and reset, (unit, design).

    NaN where a unit does not up to `furthest` (design,): it has but one state, or it folds onto
    itself before.
    """

    snap: Array
    reset: Array
    furthest: Array

    @property
    def reach(self) -> Array:
        """How far pressures on the whole finger go, MPa, (design,)."""
        sizes = np.fmax(np.abs(self.snap), np.abs(self.reset))
        largest = np.fmax.reduce(sizes, axis=0)
        return np.asarray(np.where(np.isnan(largest), self.furthest, REACH * largest))


def thresholds_alone(pressed: Pressed) -> Thresholds:
    """Snap and reset pressures of each unit of some designs by itself.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> finger = uniform_finger(2, **STUDY)
    >>> pressed = Pressed(UnitSolutions.of(finger), DomeVolumes(np.array([[31.61]])))
    >>> found = thresholds_alone(pressed)
    >>> found.snap.round(4).tolist(), found.reset.round(4).tolist()
    ([[0.1495], [0.1495]], [[-0.065], [-0.065]])
    """
    alone, shape = _alone(pressed)
    n = shape[0] * shape[1]
    inverted = np.repeat([False, True], n)[None]
    lanes = np.tile(np.arange(n), 2)
    both = alone.take_lanes(lanes)
    shapes, settled = at_rest(both, inverted)
    furthest = _furthest(alone)
    target = np.where(inverted, -1.0, 1.0) * np.take(furthest, lanes, axis=1)
    begins = np.flatnonzero(settled.status == Status.STABLE)
    stairs, _ = staircase(both.take_lanes(begins), shapes.take_lanes(begins), target[:, begins], 1)
    found = np.full(2 * n, np.nan)
    for stair in stairs:
        events = stair.events.take(np.flatnonzero(stair.events.flipped[0]))
        found[begins[events.lanes]] = events.halted.shapes.pressure[0]
    units = (pressed.finger.n_units, shape[1])
    snap, reset = (np.broadcast_to(part, units) for part in found.reshape(2, *shape))
    return Thresholds(snap, reset, furthest.reshape(shape).max(axis=0))


def _alone(pressed: Pressed) -> tuple[Pressed, tuple[int, int]]:
    """Fingers of one unit, a lane for each unit and design, and how many of both are different.

    The loads of a finger are not those of its units: they have none.
    """
    finger, volumes = pressed.finger.unloaded, pressed.volumes
    arrays = {**finger.arrays(), **finger.conditions(), "area": volumes.area}
    shapes = [array.shape for array in arrays.values()]
    n_units, n_designs = np.broadcast_shapes(*shapes)

    def lanes(array: Array) -> Array:
        return np.broadcast_to(array, (n_units, n_designs)).reshape(1, -1)

    area = lanes(arrays.pop("area"))
    units = {name: lanes(array) for name, array in arrays.items()}
    one = replace(finger, n_units=1, **units)  # type: ignore[arg-type]  # all arrays
    return Pressed(UnitSolutions.of(one), DomeVolumes(area, volumes.shape)), (n_units, n_designs)


def _furthest(alone: Pressed) -> Array:
    """A pressure beyond all thresholds of a unit, MPa, (1, lane)."""
    finger = alone.finger
    own = limits(finger, alone.volumes)
    dome = np.fmax(np.abs(own.snap_pressure), np.abs(own.reset_pressure))
    hinge = finger.force_scale / alone.volumes.area
    return np.asarray(np.broadcast_to(BEYOND * np.fmax(dome, hinge), (1, alone.finger.n_designs)))
