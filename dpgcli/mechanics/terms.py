"""A finger's energy as terms, measure × law, in either system of coordinates."""

from collections.abc import Callable
from typing import Self

import numpy as np

from dpgcli.arrays import Array, Indices, total
from dpgcli.equilibrium.contracts import OwnCoordinate, Response, Row, Term, take_lanes
from dpgcli.equilibrium.potential import Potential
from dpgcli.mechanics import laws
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.coordinates import FingerCoordinates, FingerPotential
from dpgcli.mechanics.finger import GRAVITY, Finger
from dpgcli.records import dataclass

Formulate = Callable[[Finger], FingerPotential]
DOMES, LOAD = "bistable", "load"  # the kinds of the terms of domes, and of dead loads


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


@dataclass(frozen=True)
class DeadLoad:
    """A load that stays as it is, E = −F q; F of shape (1 or cell, 1 or batch)."""

    force: Array

    def __call__(self, scalar: Array) -> Response:
        """Energy, force and stiffness."""
        return Response(-self.force * scalar, 0.0 * scalar - self.force, 0.0 * scalar)

    def take_lanes(self, index: Indices) -> Self:
        """The same load for some lanes of the batch."""
        return type(self)(take_lanes(self.force, index))


def finger_terms(coordinates: FingerCoordinates) -> tuple[Term, ...]:
    """The terms of a finger: domes; walls; two corners per hinge, each of 2 k_θ; bars; loads.

    Rigid walls, hinges without stiffness or coupling, rigid bars and loads of zero are no terms.
    Two springs of 2 k_θ in series are the hinge's k_θ.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> [term.kind for term in finger_terms(Chain(uniform_finger(1, **STUDY)))]  # rigid bars
    ['bistable', 'hinge', 'hinge']
    """
    finger = coordinates.finger
    corner, bar = Quadratic(2.0 * finger.hinge_stiffness), Quadratic(finger.linear_stiffness)
    hinges = coordinates.corners if "hinge_stiffness" in finger.parts else ()
    domes, wall = DomeSprings(finger.law, finger.domes), Quadratic(finger.bistable_stiffness)
    return (
        Term(DOMES, coordinates.dome, domes),
        *(Term("wall", yielding, wall) for yielding in coordinates.walls),
        *(Term("hinge", angle, corner) for angle in hinges),
        *_couplings(coordinates),
        *(Term("bar", extension, bar) for extension in coordinates.bars),
        *_loads(coordinates),
    )


def _couplings(coordinates: FingerCoordinates) -> tuple[Term, ...]:
    """The term −κ θ_i θ_{i+1} of neighboring hinges, if they have one."""
    finger = coordinates.finger
    if not finger.is_coupled:
        return ()
    from dpgcli.mechanics.neighbors import NeighborTurns  # that few fingers need

    turns = NeighborTurns(coordinates.corners)
    return (Term("hinge coupling", turns, DeadLoad(finger.hinge_coupling)),)


def _loads(coordinates: FingerCoordinates) -> tuple[Term, ...]:
    """The terms of the dead loads, each along its axis, as far as there are any.

    Those of an end moment M are −M by the sum of corners, the end's turn.
    """
    finger = coordinates.finger
    moment = finger.end_moment
    turning = coordinates.corners if "end_moment" in finger.parts else ()
    loads = [(angle, moment) for angle in turning]
    for axis, name in enumerate(("tip_force_x", "tip_force_y")):
        if name in finger.parts:
            loads.append((coordinates.position(axis), getattr(finger, name)))
    if "unit_weight" in finger.parts:
        shape = (finger.n_units, finger.unit_weight.shape[1])
        weights = np.broadcast_to(finger.unit_weight, shape)
        whole = total(weights)[None]
        shares = weights / np.where(whole != 0.0, whole, 1.0)
        for axis, name in enumerate(GRAVITY):
            if name in finger.parts:
                loads.append((coordinates.center(axis, shares), whole * getattr(finger, name)))
    return tuple(Term(LOAD, measure, DeadLoad(force)) for measure, force in loads)


def without_domes(potential: FingerPotential) -> FingerPotential:
    """The energy of all but the domes.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> without_domes(chain_potential(uniform_finger(1, **STUDY))).kinds
    ('hinge',)
    """
    others = tuple(term for term in potential.terms if term.kind != "bistable")
    return Potential(potential.coordinates, others)


def springs_merged(system: FingerCoordinates, terms: tuple[Term, ...]) -> tuple[Term, ...]:
    """The same energy, with the springs of single coordinates as one term that is ahead of others.

    >>> import numpy as np
    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> chain = Chain(uniform_finger(2, **STUDY))
    >>> [term.kind for term in springs_merged(chain, finger_terms(chain))]
    ['springs', 'bistable']
    """
    stiffness, others = np.zeros((system.size, 1)), []
    for term in terms:
        measure, law = term.measure, term.law
        if isinstance(measure, OwnCoordinate) and isinstance(law, Quadratic):
            rows = slice(measure.row.offset, None, measure.row.stride)
            stiffness = stiffness + np.zeros(law.stiffness.shape[1])
            stiffness[rows][: measure.n_cells] += law.stiffness
        else:
            others.append(term)
    every = OwnCoordinate(Row(1, 0), system.size)
    return Term("springs", every, Quadratic(stiffness)), *others


def chain_potential(finger: Finger) -> FingerPotential:
    """The energy of a finger in internal coordinates, the default.

    >>> import numpy as np
    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> potential = chain_potential(uniform_finger(1, **STUDY, linear_stiffness=1e4))
    >>> potential.kinds, potential.coordinates.size
    (('bistable', 'hinge', 'bar'), 4)
    """
    return _potential(Chain(finger))


def lattice_potential(finger: Finger) -> FingerPotential:
    """The energy of a finger in node coordinates; raises ValueError for rigid bars.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> lattice_potential(uniform_finger(2, **STUDY, linear_stiffness=1e4)).coordinates.size
    8
    """
    from dpgcli.mechanics.lattice import Lattice  # the chain is what is used

    return _potential(Lattice(finger))


def _potential(frame: FingerCoordinates) -> FingerPotential:
    """The energy in these coordinates, and in those of walls that give way, if there are any."""
    if not frame.finger.has_walls:
        return Potential(frame, finger_terms(frame))
    from dpgcli.mechanics.walls import Walled

    return Potential(walled := Walled(frame), finger_terms(walled))
