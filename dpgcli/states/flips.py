"""Single units that flip, and the way of a dome that is held at any place between two states."""

from dataclasses import replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.loaded import Holding
from dpgcli.equilibrium.newton import minimize
from dpgcli.mechanics.coordinates import FingerPotential
from dpgcli.mechanics.terms import Formulate
from dpgcli.records import dataclass
from dpgcli.states.certify import Settled
from dpgcli.states.scan import pulls
from dpgcli.states.settle import settle, settle_from
from dpgcli.states.units import UnitSolutions

Entry = TypeVar("Entry", bound=np.generic)


@dataclass(frozen=True)
class Flips:
    """Units that flip, one in each lane: in the pattern `lower`, (unit, lane), it is not inverted.

    `units` have one design, or one for each lane; `tolerance` is over the forces in play.
    """

    units: UnitSolutions
    formulate: Formulate
    lower: Flags
    unit: Indices
    tolerance: float

    @cached_property
    def is_flipping(self) -> Flags:
        """Which unit flips, (unit, lane)."""
        return np.asarray(np.arange(len(self.lower))[:, None] == self.unit)

    @cached_property
    def upper(self) -> Flags:
        """The patterns with the unit inverted."""
        return np.asarray(self.lower | self.is_flipping)

    @cached_property
    def potential(self) -> FingerPotential:
        """The energy with the dome that flips in touch, or about to be."""
        return self.formulate(self.units.finger.with_domes(self.upper))

    def of_unit(self, values: NDArray[Entry]) -> NDArray[Entry]:
        """Values by unit, (1 or unit, 1 or lane), of the unit that flips, (lane,)."""
        return np.asarray(np.broadcast_to(values, self.lower.shape)[self.unit, self._lanes])

    @property
    def _lanes(self) -> Indices:
        return np.arange(len(self.unit))

    def extension(self, coordinates: Array) -> Array:
        """Of the spring of the dome that flips, mm, (lane,)."""
        return self.of_unit(self.potential.coordinates.springs(coordinates).extension)

    def own_energy(self, extension: Array) -> Array:
        """Of the dome that flips, by the extension of its spring, attached to nothing: mJ."""
        finger = self.units.finger
        return self.of_unit(finger.law.pulling.response(extension, finger.domes).energy)

    def take(self, index: Indices) -> "Flips":
        """Some of them; one may repeat."""
        units = self.units.take_lanes(index)
        return replace(self, units=units, lower=self.lower[:, index], unit=self.unit[index])

    def settled(self, inverted: Flags) -> Settled:
        """The states of patterns, those before or after the flip."""
        return settle(self.units, self.formulate, inverted, self.tolerance)

    def settled_from(self, inverted: Flags, start: Array, step: float = 1.0) -> Settled:
        """The states that lie downhill from coordinates, with the dome that flips about to act."""
        way = self.units, self.potential, inverted, start, self.tolerance
        return settle_from(*way, largest_step=step)


def held(flips: Flips, start: Array, target: Array) -> Array:
    """Coordinates, (size, lane), at the least energy with each dome that flips held by a spring.

    The spring pulls its extension towards `target` (mm); where it comes to rest beside that is a
    minimum over all else as well.
    """
    stiffness = np.where(flips.is_flipping, flips.units.holding_stiffness, 0.0)
    terms = (
        replace(term, law=Holding(term.law, stiffness, target)) if term.kind == "bistable" else term
        for term in flips.potential.terms
    )
    potential = replace(flips.potential, terms=tuple(terms))
    return minimize(potential, start, flips.tolerance).coordinates


@dataclass(frozen=True)
class HeldPath:
    """Places between two shapes, at each of which the dome that flips is held.

    Extensions of its spring (mm) and energies (mJ), (place, lane); coordinates (size, place, lane).
    """

    extension: Array
    energy: Array
    coordinates: Array


def held_path(flips: Flips, first: Array, last: Array, shares: Array) -> HeldPath:
    """The least energies with the dome held at shares, (place,), of the way between two shapes.

    A dome that only pushes is in touch all the way to its own well, and stays in that.
    """
    n = len(flips.unit)
    many = flips.take(np.tile(np.arange(n), len(shares)))
    share = np.repeat(shares, n)
    start, end = (np.tile(coordinates, len(shares)) for coordinates in (first, last))
    target = (1.0 - share) * many.extension(start) + share * many.extension(end)
    there = held(many, (1.0 - share) * start + share * end, target)
    extension, energy = many.extension(there), many.potential.evaluate(there).energy
    finger = many.units.finger
    if not pulls(finger):
        acting = finger.law.response(extension, finger.domes).energy
        extension = np.minimum(extension, many.of_unit(finger.law.touching(finger.domes).highest))
        energy = energy - many.of_unit(acting) + many.own_energy(extension)
    shape = (len(shares), n)
    return HeldPath(extension.reshape(shape), energy.reshape(shape), there.reshape(-1, *shape))
