"""The energy along a way from state to state, over the saddles between them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array
from dpgcli.mechanics.terms import Formulate
from dpgcli.records import dataclass
from dpgcli.states.barriers import Barriers, barriers
from dpgcli.states.certify import Settled
from dpgcli.states.flips import Flips, held_path
from dpgcli.states.patterns import inverted_units
from dpgcli.states.saddles import Saddles, saddles
from dpgcli.states.scan import pulls
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions

SHARES = np.linspace(0.0, 1.0, 33)  # of a dome's travel between a state and a saddle


@dataclass(frozen=True)
class BarrierGraph:
    """All 2^n states of a finger, in the order of their codes, and the barriers between them."""

    units: UnitSolutions
    formulate: Formulate
    states: Settled
    barriers: Barriers
    tolerance: float

    @classmethod
    def of(cls, units: UnitSolutions, formulate: Formulate, tolerance: float) -> "BarrierGraph":
        """The graph of a finger of one design.

        >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
        >>> from dpgcli.mechanics.terms import chain_potential
        >>> units = UnitSolutions.of(uniform_finger(2, **STUDY))
        >>> graph = BarrierGraph.of(units, chain_potential, 1e-12)
        >>> print(graph.along(0b00, [1, 0]).barrier.round(6))  # mJ
        [6.038233 6.038233]
        """
        n_units = units.finger.n_units
        patterns = inverted_units(np.arange(2**n_units, dtype=np.uint64), n_units)
        states = settle(units, formulate, patterns, tolerance)
        over = barriers(units, formulate, states, tolerance)
        return cls(units, formulate, states, over, tolerance)

    def along(self, start: int, units: Sequence[int]) -> "Landscape":
        """The way from a state, by its code, on which these units flip one after the other."""
        n_units = self.units.finger.n_units
        unit = np.array(units, int)
        bits = 1 << (n_units - 1 - unit)
        codes = np.bitwise_xor.accumulate(np.concatenate(([start], bits)))
        patterns = inverted_units(codes.astype(np.uint64), n_units)
        states = settle(self.units, self.formulate, patterns, self.tolerance)
        lower = patterns[:, :-1] & patterns[:, 1:]
        flips = Flips(self.units, self.formulate, lower, unit, self.tolerance)
        return Landscape(states, flips, saddles(flips))


@dataclass(frozen=True)
class PathStretch:
    """The energy (mJ) by the travel (mm) of the dome that flips, on the way of one flip."""

    travel: Array
    energy: Array


@dataclass(frozen=True)
class Landscape:
    """A way of single flips: its states, one more than flips, and the saddles between them."""

    states: Settled
    flips: Flips
    saddles: Saddles

    @property
    def energy(self) -> Array:
        """Of the states, mJ."""
        return self.states.equilibrium.energy

    @property
    def barrier(self) -> Array:
        """From each state to the saddle behind it, mJ, (flip,)."""
        return self.saddles.energy - self.energy[:-1]

    @property
    def saddle_names(self) -> NDArray[np.str_]:
        """Patterns with ? where a unit flips, such as 1?0."""
        digits = self.flips.lower.astype(int).astype(str)
        return np.array(
            ["".join(own) for own in np.where(self.flips.is_flipping, "?", digits).T], str
        )

    def stretches(self) -> tuple[PathStretch, ...]:
        """The energy on the way of each flip, with the dome that flips held wherever it is."""
        if not len(self.flips.unit):
            return ()
        travel, energy = self._from_ground()
        snaps = self.states.inverted[self.flips.unit, np.arange(1, len(self.energy))]
        found = []
        for lane, snap in enumerate(snaps):
            way = slice(None) if snap else slice(None, None, -1)
            moved = np.abs(travel[way, lane] - travel[way, lane][0])
            found.append(PathStretch(moved, energy[way, lane]))
        return tuple(found)

    def _from_ground(self) -> tuple[Array, Array]:
        """Travels (mm) and energies (mJ), (place, flip), on the way to the inverted dome."""
        flips, at = self.flips, self.states.equilibrium.coordinates
        first_is_lower = (self.states.inverted[:, :-1] == flips.lower).all(axis=0)
        lower = np.where(first_is_lower, at[:, :-1], at[:, 1:])
        upper = np.where(first_is_lower, at[:, 1:], at[:, :-1])
        rising = held_path(flips, lower, self.saddles.coordinates, SHARES)
        falling = held_path(flips, self.saddles.coordinates, upper, SHARES[1:])
        parts = [(part.extension, part.energy) for part in (rising, falling)]
        if not pulls(flips.units.finger):
            energy = np.where(first_is_lower, self.energy[:-1], self.energy[1:])
            parts.insert(0, self._alone(flips.extension(lower), energy))
        travel, energy = (np.concatenate(part) for part in zip(*parts, strict=True))
        return travel, energy

    def _alone(self, touch: Array, energy: Array) -> tuple[Array, Array]:
        """The same, of a dome on the way to its neighbor, in whose ground state it has `energy`."""
        flips, domes = self.flips, self.flips.units.finger.domes
        rest, top = (
            flips.of_unit(part)
            for part in (-domes.contact, flips.units.finger.law.rests(domes).top)
        )
        middle = np.where(self.saddles.is_apart, top, 0.5 * (rest + touch))
        share = SHARES[:, None]
        before, behind = rest + share * (middle - rest), middle + share * (touch - middle)
        extension = np.concatenate((before, behind[1:]))
        return extension, np.stack([energy + flips.own_energy(row) for row in extension])
