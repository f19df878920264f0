"""Barriers of states: the energy that each unit needs to flip, and which unit needs least."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags, Indices, distinct
from dpgcli.mechanics.terms import Formulate
from dpgcli.records import dataclass
from dpgcli.states.certify import Settled
from dpgcli.states.flips import Flips
from dpgcli.states.patterns import codes_of, inverted_units
from dpgcli.states.saddles import SaddleStatus, is_state, saddles
from dpgcli.states.units import UnitSolutions

TIE = 1e-6  # of a barrier: those as near are not told apart


@dataclass(frozen=True)
class Barriers:
    """What units have to get over to flip, (unit, state): to reset if they are inverted, or snap.

    `energy` (mJ) is that of the saddle less that of the state, NaN where none is certified;
    `status` holds `SaddleStatus` codes.
    """

    energy: Array
    status: NDArray[np.uint8]

    @property
    def n_not_found(self) -> Indices:
        """Saddles by state that exist but were not found."""
        return np.asarray((self.status == SaddleStatus.NOT_FOUND).sum(axis=0))

    @cached_property
    def least(self) -> Array:
        """The smallest barrier of each state, mJ; NaN where one is not known, or none is there."""
        known = np.where(np.isnan(self.energy), np.inf, self.energy).min(axis=0)
        return np.where((self.n_not_found > 0) | np.isinf(known), np.nan, known)

    @property
    def least_robust(self) -> NDArray[np.str_]:
        """The unit of the smallest barrier of each state, as text; all of them if they tie."""
        ties = self.energy <= (1.0 + TIE) * self.least
        return np.array([",".join(map(str, np.flatnonzero(own) + 1)) for own in ties.T], str)


def barriers(
    units: UnitSolutions, formulate: Formulate, settled: Settled, tolerance: float
) -> Barriers:
    """The barriers of each unit in each state.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.terms import chain_potential
    >>> from dpgcli.states.settle import settle
    >>> units = UnitSolutions.of(uniform_finger(1, **STUDY))
    >>> both = settle(units, chain_potential, np.array([[False, True]]), 1e-12)
    >>> print(barriers(units, chain_potential, both, 1e-12).energy.round(8))  # to snap, to reset
    [[6.03823327 1.67687439]]
    """
    found = Barriers(
        np.full(settled.inverted.shape, np.nan),
        np.full(settled.inverted.shape, SaddleStatus.NO_NEIGHBOR, np.uint8),
    )
    states = np.flatnonzero(is_state(settled))
    if not len(states):
        return found
    flips, places = _flips(
        units.take_lanes(states), formulate, settled.inverted[:, states], tolerance
    )
    at = saddles(flips)
    found.energy[:, states] = at.energy[places] - settled.equilibrium.energy[states]
    found.status[:, states] = at.status[places]
    return found


def _flips(
    units: UnitSolutions, formulate: Formulate, inverted: Flags, tolerance: float
) -> tuple[Flips, Indices]:
    """The flips of all units in some states, and the place of each among them, (unit, state)."""
    n, n_states = inverted.shape
    bits = np.uint64(1) << np.arange(n - 1, -1, -1, dtype=np.uint64)
    lower = codes_of(inverted) & ~bits[:, None]
    if units.finger.n_designs == 1:  # states share the saddle between them
        each = [distinct(row) for row in lower]
        counts = [len(codes) for codes in each]
        own = np.stack([np.searchsorted(*pair) for pair in zip(each, lower, strict=True)])
        places, lower = own + np.cumsum([0, *counts[:-1]])[:, None], np.concatenate(each)
    else:
        counts, places = [n_states] * n, np.arange(n * n_states).reshape(n, n_states)
        units, lower = units.take_lanes(np.tile(np.arange(n_states), n)), lower.ravel()
    unit = np.repeat(np.arange(n), counts)
    return Flips(units, formulate, inverted_units(lower, n), unit, tolerance), places
