"""Derivatives of certified states by their finger's values, dq/dp = −H⁻¹ ∂g/∂p.

The Hessian H is factorized at the state already. The derivative of the gradient g by a value p
comes from a complex step: Im g(q; p + ih)/h with h = 1e-100 (Squire and Trapp, SIAM Review 40,
1998, 110). It is exact to rounding: nothing is subtracted, nothing cancels, and every law and
every value is covered by the one formula that states are solved with.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from dpgcli.arrays import COMPLEX_STEP, Array
from dpgcli.equilibrium.banded import backward, forward
from dpgcli.equilibrium.contracts import Response
from dpgcli.mechanics.chain_geometry import internal
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.laws import Attached, Dome, DomeLaw, Rests
from dpgcli.mechanics.terms import chain_potential
from dpgcli.records import dataclass
from dpgcli.states.certify import Settled

Direction = Mapping[str, Array]


@dataclass(frozen=True)
class Sensitivities:
    """Derivatives by a step along each direction, arrays of shape (…, direction, batch).

    `pose` (3, …) of tip x, y (mm) and angle (rad), `strut_angles` (unit, …) of all stations (rad),
    `openings` (unit, …) at the domes' axis (mm), with what walls yield, and `pushes` (unit, …) of
    the domes (N), `energy` (mJ) of the state, each per unit of the direction.
    """

    pose: Array
    strut_angles: Array
    openings: Array
    pushes: Array
    energy: Array


class Softened(Attached):
    """A law beside a wall of a compliance c so small that its square does not count, (unit, batch).

    In series they have the least E + w²/(2c) over what the wall yields, E − ½ c F² to first order.
    A complex step from a rigid wall needs it: √(c k_b), by which `walls` count, has no slope there.
    """

    description = "softened domes"
    curve = None

    def __init__(self, law: DomeLaw, compliance: Array) -> None:
        self.law = law
        self.pulling = law.pulling
        self.compliance = compliance

    def response(self, extension: Array, dome: Dome) -> Response:
        """Energy and force to first order in c; the stiffness is that of the dome.

        >>> from dpgcli.mechanics.laws import PUBLISHED
        >>> spring = Dome(np.array(2.0), np.array(1.0), np.array(1.0), np.array(0.0))  # α = 1
        >>> float(Softened(PUBLISHED, np.array(1e-3)).response(np.array(3.0), spring).force)
        5.988
        """
        energy, force, stiffness = self.law.response(extension, dome)
        yielded = self.compliance * force
        return Response(energy - 0.5 * yielded * force, force - yielded * stiffness, stiffness)

    def rests(self, dome: Dome) -> Rests:
        """Those of the dome: without force no wall yields."""
        return self.law.rests(dome)


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
    return Sensitivities(*(np.stack(parts, axis=-2) for parts in zip(*found, strict=True)))


def _along(settled: Settled, direction: Direction) -> tuple[Array, ...]:
    equilibrium = settled.equilibrium
    coordinates = equilibrium.coordinates
    here = cast("Array", coordinates + 0j)
    finger, softened = _moved(settled, direction)
    moved = chain_potential(finger)
    with np.errstate(divide="ignore", invalid="ignore"):  # lanes that are no states
        evaluated = moved.evaluate(here)
        energy = np.sum(evaluated.energies, axis=0)  # the state's own change costs nothing
        forces = evaluated.gradient.imag / COMPLEX_STEP
        change = forward(equilibrium.factorization, -forces)
        change /= equilibrium.factorization.pivots
        change = backward(equilibrium.factorization, change)
        stepped = here + 1j * COMPLEX_STEP * change
        stations = moved.coordinates.stations(stepped)
        shape = internal(moved.coordinates.without_walls(change), settled.finger.is_rigid)
        turns = -np.cumsum(shape.near_angle + shape.far_angle, axis=0)
        extension = moved.coordinates.springs(stepped).extension
        push = -finger.springs(extension).force
        opening = extension + softened * push  # the dome's, and what a rigid wall begins to yield
    x, y = (nodes[-1].imag / COMPLEX_STEP for nodes in (stations.base_x, stations.base_y))
    further = (part.imag / COMPLEX_STEP for part in (opening, push, energy))
    return np.stack((x, y, turns[-1])), turns, *further


def _moved(settled: Settled, direction: Direction) -> tuple[Finger, Array]:
    """The finger an imaginary step along a direction, and the compliance that rigid walls get."""
    finger = settled.finger
    steps = {name: 1j * COMPLEX_STEP * rate for name, rate in direction.items()}
    rigid = finger.wall_compliance == 0.0
    softened = rigid * steps.get("wall_compliance", np.zeros((1, 1)))
    if softened.any():
        finger = replace(finger, law=Softened(finger.law, softened))
        steps["wall_compliance"] = ~rigid * steps["wall_compliance"]
    moved = {name: getattr(finger, name) + step for name, step in steps.items()}
    return finger.changed(**moved), softened
