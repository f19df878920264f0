"""A finger's energy as terms, measure × law, in either system of coordinates."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

from dpgcli.arrays import Array, Indices
from dpgcli.equilibrium.contracts import Response, Term, take_lanes
from dpgcli.equilibrium.potential import Potential
from dpgcli.mechanics import laws
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.coordinates import FingerCoordinates, FingerPotential
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.lattice import Lattice
from dpgcli.mechanics.walls import Walled

Formulate = Callable[[Finger], FingerPotential]


@dataclass(frozen=True)
class DomeSprings:
    """The law of domes with the constants of some fingers' domes, by extension (mm)."""

    law: laws.DomeLaw
    domes: laws.Dome

    def __call__(self, scalar: Array) -> Response:
        """Energy (mJ), force (N) and stiffness (N/mm)."""
        return self.law.response(scalar, self.domes)

    def take_lanes(self, index: Indices) -> Self:
        """The same law for some lanes of the batch."""
        return type(self)(self.law, laws.Dome(*(take_lanes(part, index) for part in self.domes)))


@dataclass(frozen=True)
class Quadratic:
    """A linear or torsional spring, E = ½ k q²; k of shape (1 or cell, 1 or batch)."""

    stiffness: Array

    def __call__(self, scalar: Array) -> Response:
        """Energy, force and stiffness."""
        return laws.quadratic(scalar, self.stiffness)

    def take_lanes(self, index: Indices) -> Self:
        """The same law for some lanes of the batch."""
        return type(self)(take_lanes(self.stiffness, index))


def spring_terms(coordinates: FingerCoordinates) -> tuple[Term, ...]:
    """The terms of a finger's springs: domes; walls; two corners per hinge, each of 2 k_θ; bars.

    Rigid walls, hinges without stiffness, and rigid bars are no terms. Two springs of 2 k_θ in
    series are the hinge's k_θ.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> [term.kind for term in spring_terms(Chain(uniform_finger(1, **STUDY)))]  # rigid bars
    ['bistable', 'hinge', 'hinge']
    """
    finger = coordinates.finger
    corner, bar = Quadratic(2.0 * finger.hinge_stiffness), Quadratic(finger.linear_stiffness)
    hinges = coordinates.corners if finger.hinge_stiffness.any() else ()
    domes, wall = DomeSprings(finger.law, finger.domes), Quadratic(finger.bistable_stiffness)
    return (
        Term("bistable", coordinates.dome, domes),
        *(Term("wall", yielding, wall) for yielding in coordinates.walls),
        *(Term("hinge", angle, corner) for angle in hinges),
        *(Term("bar", extension, bar) for extension in coordinates.bars),
    )


def chain_potential(finger: Finger) -> FingerPotential:
    """The energy of an unloaded finger in internal coordinates, the default.

    >>> import numpy as np
    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> potential = chain_potential(uniform_finger(1, **STUDY, linear_stiffness=1e4))
    >>> potential.kinds, potential.coordinates.size
    (('bistable', 'hinge', 'bar'), 4)
    """
    return _potential(Chain(finger))


def lattice_potential(finger: Finger) -> FingerPotential:
    """The energy of an unloaded finger in node coordinates; raises ValueError for rigid bars.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> lattice_potential(uniform_finger(2, **STUDY, linear_stiffness=1e4)).coordinates.size
    8
    """
    return _potential(Lattice(finger))


def _potential(frame: FingerCoordinates) -> FingerPotential:
    """The energy in these coordinates, and in those of walls that give way, if there are any."""
    coordinates = Walled(frame) if frame.finger.has_walls else frame
    return Potential(coordinates, spring_terms(coordinates))
