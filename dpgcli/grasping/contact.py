"""Fingers with round bodies in their way: contact without friction, exactly complementary."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, total
from dpgcli.equilibrium.constraints import (
    ActiveConstraints,
    AugmentedContact,
    Leading,
    Slack,
    WithMultipliers,
    leading_terms,
    multiplier_term,
)
from dpgcli.equilibrium.contracts import Term, take_lanes
from dpgcli.equilibrium.corrector import corrected
from dpgcli.equilibrium.loaded import LoadedPotential
from dpgcli.equilibrium.newton import minimize
from dpgcli.equilibrium.potential import Potential
from dpgcli.mechanics.coordinates import FingerCoordinates, FingerPotential
from dpgcli.mechanics.face import Face
from dpgcli.mechanics.gaps import FaceGaps
from dpgcli.mechanics.laws import PushOnly
from dpgcli.mechanics.obstacle import Obstacle
from dpgcli.mechanics.terms import Formulate
from dpgcli.states.units import UnitSolutions

STIFFER = 20.0  # than the softest unit: what a contact is sought with; more has rounding in it
TOLERANCE = 1e-12  # of the forces in play
CLOSE = 1e-6  # of a stroke: multipliers that change by less have found their set
MOST_UPDATES, MOST_STEPS = 30, 120  # of multipliers; of a descent
SHORT_STEP = 0.25  # of the step cap, a twentieth of a stroke: no well is stepped over

Constrained = WithMultipliers[FingerCoordinates]


@dataclass(frozen=True)
class ContactShapes:
    """Shapes against bodies, a lane each: coordinates (size, batch) and pushes (cell, batch), N.

    `inverted` (unit, batch) are the domes that act as inverted ones, `active` (cell, batch) the
    gaps that are closed. `is_there` says which are equilibria, (batch,).
    """

    coordinates: Array
    push: Array
    active: Flags
    inverted: Flags
    is_there: Flags

    def put(self, index: Indices, others: "ContactShapes") -> None:
        """Replace the lanes at `index`."""
        for name, values in vars(self).items():
            values[..., index] = getattr(others, name)

    def take_lanes(self, index: Indices) -> "ContactShapes":
        """Some of them."""
        return ContactShapes(*(np.take(values, index, axis=-1) for values in vars(self).values()))


@dataclass(frozen=True)
class Obstructed:
    """Fingers with bodies in their way: one design and body, or one for each lane.

    `thickness` (1, 1 or batch) is that of the layer, mm. Bodies may stand in the way by less than
    they will: by b = (λ − 1) D with a load λ, `depth` D (batch,) in mm.
    """

    units: UnitSolutions
    formulate: Formulate
    thickness: Array
    obstacle: Obstacle
    depth: Array

    @property
    def stiffness(self) -> Array:
        """σ, N/mm, (1, 1 or design)."""
        ground = np.zeros((self.units.finger.n_units, 1), bool)
        finger = self.units.finger.with_domes(ground)
        return np.asarray(STIFFER * (finger.force_scale / finger.stroke).min(axis=0)[None])

    @property
    def large(self) -> Array:
        """The smallest stroke, mm, (1, 1 or design)."""
        return np.asarray(self.units.finger.stroke.min(axis=0)[None])

    def take_lanes(self, index: Indices) -> "Obstructed":
        """Some of the fingers."""
        thickness, depth = take_lanes(self.thickness, index), take_lanes(self.depth, index)
        units, obstacle = self.units.take_lanes(index), self.obstacle.take_lanes(index)
        return Obstructed(units, self.formulate, thickness, obstacle, depth)

    @cached_property
    def face(self) -> Face:
        """The face of the fingers."""
        return Face.of(self.formulate(self.units.finger).coordinates, self.thickness)

    def gaps(self, first: Flags | None = None) -> FaceGaps:
        """Gaps to the bodies in full; at each place only one, if it is said which come first."""
        return FaceGaps(self.face, self.obstacle, first)

    def bound(self, load: Array) -> Array:
        """b = (λ − 1) D, mm."""
        return (load - 1.0) * self.depth

    def potential(self, inverted: Flags) -> FingerPotential:
        """The energy without contact."""
        return self.formulate(self.units.finger.with_domes(inverted))

    def pressed(self, inverted: Flags, push: Array, load: Array) -> FingerPotential:
        """The augmented Lagrangian for some pushes, (cell, batch), N."""
        bare = self.potential(inverted)
        law = AugmentedContact(push, self.stiffness, self.bound(load))
        contact = Term("contact", self.gaps(push > 0.0), law)
        return Potential(bare.coordinates, (*bare.terms, contact))

    def family(
        self, inverted: Flags, active: Flags
    ) -> LoadedPotential[Constrained, ActiveConstraints]:
        """The Lagrangians of active contacts, (cell, batch), by the load."""
        bare = self.potential(inverted)
        size, finger = bare.coordinates.size, self.units.finger
        gaps = self.gaps()
        system = WithMultipliers(bare.coordinates, gaps.n_cells, self.large, self.stiffness)
        law = ActiveConstraints(active, self.stiffness, self.depth, self.large[0])
        terms = (*leading_terms(bare.terms, size), multiplier_term(system))
        dome, slack = Leading(bare.coordinates.dome, size), Slack(gaps, size)
        scale, stiffness = finger.stroke, self.units.holding_stiffness
        return LoadedPotential(
            system, terms, slack, law, dome, scale, stiffness, n_multipliers=gaps.n_cells
        )

    def relabeled(self, shapes: ContactShapes) -> ContactShapes:
        """Shapes with each contact counted as that of the side to which it has come."""
        place = self.gaps()(shapes.coordinates).place
        is_there = place[:, None] == np.arange(len(place))[:, None]
        active = (is_there & shapes.active[:, None]).any(axis=0)
        push = total(np.where(is_there, shapes.push[:, None], 0.0))
        return replace(shapes, active=active, push=push)

    def stacked(self, shapes: ContactShapes) -> Array:
        """Coordinates and multipliers y = μ/σ of shapes."""
        return np.concatenate((shapes.coordinates, shapes.push / self.stiffness))

    def relaxed(self, start: Array, inverted: Flags, push: Array, load: Array) -> ContactShapes:
        """Go downhill from coordinates at some loads to the next minima, by short steps.

        Domes that only push and are pushed out of their wells are let go, and the others go on.
        """
        found = self._relaxed(start, inverted, push, load)
        for _ in range(self.units.finger.n_units):
            fallen = self._fallen(found)
            lanes = np.flatnonzero(fallen.any(axis=0))
            if not len(lanes):
                break
            few, own = found.take_lanes(lanes), self.take_lanes(lanes)
            left = few.inverted & ~fallen[:, lanes]
            found.put(lanes, own._relaxed(few.coordinates, left, few.push, load[lanes]))
        return found

    def _fallen(self, shapes: ContactShapes) -> Flags:
        if not isinstance(self.units.finger.law, PushOnly):
            return np.zeros(shapes.inverted.shape, bool)
        return shapes.inverted & ~self.is_open(shapes)

    def is_open(self, shapes: ContactShapes) -> Flags:
        """Which units are beyond their barriers, (unit, batch)."""
        springs = self.potential(shapes.inverted).coordinates.springs(shapes.coordinates)
        return np.asarray(springs.extension > self.units.wells.spring_barrier)

    def _relaxed(self, start: Array, inverted: Flags, push: Array, load: Array) -> ContactShapes:
        here, push, lanes = start.copy(), push.copy(), np.arange(start.shape[1])
        for _ in range(MOST_UPDATES):
            own = self.take_lanes(lanes)
            potential = own.pressed(inverted[:, lanes], push[:, lanes], load[lanes])
            there = minimize(
                potential, here[:, lanes], TOLERANCE, MOST_STEPS, largest_step=SHORT_STEP
            )
            contact = potential.terms[-1]
            assert isinstance(contact.law, AugmentedContact), "the last term"
            pushed = contact.law.pushes(contact.measure(there.coordinates).value)
            change = np.abs(pushed - push[:, lanes]).max(axis=0) / (own.stiffness * own.large)[0]
            here[:, lanes], push[:, lanes] = there.coordinates, pushed
            lanes = lanes[change > CLOSE]
            if not len(lanes):
                break
        return self.finished(here, inverted, push, load)

    def finished(self, near: Array, inverted: Flags, push: Array, load: Array) -> ContactShapes:
        """Equilibria with the active set that pushes say, (cell, batch), from nearby."""
        active = push > 0.0
        family, n = self.family(inverted, active), len(load)
        nothing, free = np.full(n, -1), np.zeros(n)
        guess = np.concatenate((near, push / self.stiffness))
        there = corrected(family, guess, load, nothing, free, max(family.column_depths))
        size = len(near)
        y = there.coordinates[size:]
        margin = family.law.margin(there.loaded, load)
        is_there = there.is_fine & (margin >= -CLOSE).all(axis=0)
        pushes = np.where(active, y * self.stiffness, 0.0)
        return ContactShapes(there.coordinates[:size], pushes, active, inverted.copy(), is_there)
