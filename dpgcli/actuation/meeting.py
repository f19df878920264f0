"""Domes that rest against their neighbors without a push: which go on in touch, and which apart.

At such a place both laws hold (`equilibrium.beginning`). With the rate r of a dome's free force,
E' − p A at its neighbor's place, r ≤ 0 in touch and r ≥ 0 apart. What the others do is in that
rate: bars and hinges between the units move a neighbor away, or towards a dome whose own pressure
does not change.
"""

from dataclasses import replace

import numpy as np

from dpgcli.actuation.domes import PressedDomes
from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.beginning import NO_RATE, about_to_act
from dpgcli.equilibrium.corrector import corrected
from dpgcli.equilibrium.loaded import LoadedPotential, along
from dpgcli.equilibrium.walk import AWAY
from dpgcli.mechanics.coordinates import FingerCoordinates

PressedFamily = LoadedPotential[FingerCoordinates, PressedDomes]


def about_to_touch(family: PressedFamily, coordinates: Array) -> Flags | None:
    """Which domes are in touch as the load begins to rise, (unit, batch); None where all are.

    Others than those between both remain as they are.
    """
    law = family.law
    if law.touching is None:
        return None

    def are_wrong(lanes: Indices, touching: Flags) -> Flags:
        return _wrong(family.take_lanes(lanes), coordinates[:, lanes], touching)

    is_level = _level(law, family.measure(coordinates).value)
    return about_to_act(law.touching, is_level, are_wrong)


def with_touching(family: PressedFamily, touching: Flags | None) -> PressedFamily:
    """The same energies with these domes in touch."""
    return replace(family, law=replace(family.law, touching=touching))


def _level(law: PressedDomes, value: Array) -> Flags:
    """Domes whose own rest is where their neighbors are, within rounding."""
    free = law.free(value, np.zeros(value.shape[1]))
    is_rest = (np.abs(free.force) <= AWAY * law.finger.force_scale) & (free.stiffness > 0.0)
    assert law.touching is not None and law.furthest is not None, "domes that can be apart"
    return np.asarray(is_rest & (law.touching | (value <= law.furthest)))


def _wrong(family: PressedFamily, coordinates: Array, touching: Flags) -> Flags:
    """Domes that would pull in touch, or apart run into their neighbors, (unit, batch).

    None where the finger loses its balance with these in touch: that is for its path to tell.
    """
    there, none = with_touching(family, touching), np.full(touching.shape[1], -1)
    nothing, depth = np.zeros(len(none)), max(family.column_depths)
    here = corrected(there, coordinates, nothing, none, nothing, depth)
    value = here.measured.value
    moved = along(there.measure.rows, here.measured, here.along_load)
    by_neighbor = family.law.free(value, nothing).stiffness * moved
    by_pressure = family.law.free_rate(value)
    rate = by_neighbor + by_pressure
    least = NO_RATE * (np.abs(by_neighbor) + np.abs(by_pressure)).max(axis=0)
    is_wrong = np.where(touching, rate > least, rate < -least)
    return np.asarray(is_wrong & here.is_fine)
