"""Derivatives of certified states by their finger's values, dq/dp = −H⁻¹ ∂g/∂p.

The Hessian H is factorized at the state already. The derivative of the gradient g by a value p
comes from a complex step: Im g(q; p + ih)/h with h = 1e-100 (Squire and Trapp, SIAM Review 40,
1998, 110). It is exact to rounding: nothing is subtracted, nothing cancels, and every law and
every value is covered by the one formula that states are solved with.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from dpgcli.arrays import COMPLEX_STEP, Array
from dpgcli.equilibrium.banded import backward, forward
from dpgcli.mechanics.chain_geometry import internal
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Settled

Direction = Mapping[str, Array]


@dataclass(frozen=True)
class Sensitivities:
    """Derivatives by a step along each direction, arrays of shape (…, direction, batch).

    `pose` (3, …) of tip x, y (mm) and angle (rad), and `strut_angles` (unit, …) of all stations
    (rad), each per unit of the direction.
    """

    pose: Array
    strut_angles: Array


def sensitivities(settled: Settled, directions: Sequence[Direction]) -> Sensitivities:
    """Derivatives of states by changes of their finger.

    `settled` is in the chain's coordinates; a direction gives the rates of change of some of the
    finger's arrays by name, each (1 or unit, 1 or design).

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.states.settle import settle
    >>> from dpgcli.states.units import UnitSolutions
    >>> units = UnitSolutions.of(uniform_finger(1, **STUDY))
    >>> settled = settle(units, chain_potential, np.array([[True]]), 1e-12)
    >>> found = sensitivities(settled, [{"segment_length": np.ones((1, 1))}])
    >>> print(abs(found.pose[2]).round(12))  # turning does not depend on L in the rigid limit
    [[0.]]
    """
    found = [_along(settled, direction) for direction in directions]
    return Sensitivities(*(np.stack(parts, axis=1) for parts in zip(*found, strict=True)))


def _along(settled: Settled, direction: Direction) -> tuple[Array, ...]:
    equilibrium = settled.equilibrium
    coordinates = equilibrium.coordinates
    here = cast("Array", coordinates + 0j)
    moved = chain_potential(_moved(settled, direction))
    with np.errstate(divide="ignore", invalid="ignore"):  # lanes that are no states
        forces = moved.evaluate(here).gradient.imag / COMPLEX_STEP
        change = forward(equilibrium.factorization, -forces)
        change /= equilibrium.factorization.pivots
        change = backward(equilibrium.factorization, change)
        stepped = here + 1j * COMPLEX_STEP * change
        stations = moved.coordinates.stations(stepped)
        shape = internal(moved.coordinates.without_walls(change), settled.finger.is_rigid)
        turns = -np.cumsum(shape.near_angle + shape.far_angle, axis=0)
    x, y = (nodes[-1].imag / COMPLEX_STEP for nodes in (stations.base_x, stations.base_y))
    return np.stack((x, y, turns[-1])), turns


def _moved(settled: Settled, direction: Direction) -> Finger:
    """The finger an imaginary step along a direction."""
    finger = settled.finger
    rates = direction.items()
    return finger.changed(**{n: getattr(finger, n) + 1j * COMPLEX_STEP * rate for n, rate in rates})
