"""Fingers with bodies in their way: contact without friction, exactly complementary.

A body that may move has coordinates of its own, behind those of the fingers that it touches. Where
it does not, fingers know nothing of each other, and each is a scene by itself.

Domes that only push touch their neighbors as fingers touch a body: without pulling, and without
running into them. While pressures change each has its own travel as a coordinate, behind the
body's, with the energy of its curve and its pressure; its neighbor is in its way, one more contact
among those with the body. So domes that leave their neighbors, meet them again, and snap by
themselves are contacts that open and close and folds, as all others are, and a path has one
complementarity for both. (Without a body `actuation` leaves the travels of domes that are apart
out: they do not act on the finger. For the same paths this is the longer way, and the shorter one
for what contacts decide.) Without pressure travels are not needed: an inverted dome acts while it
is in touch, one in its ground state not at all.
"""

from dataclasses import replace

import numpy as np

from dpgcli.actuation.domes import rest_between
from dpgcli.actuation.folding import folded
from dpgcli.arrays import Array, Flags, total
from dpgcli.equilibrium.banded import WIDE
from dpgcli.equilibrium.constraints import (
    ActiveConstraints,
    AugmentedContact,
    Extended,
    Multiplied,
    Slack,
    multiplier_term,
)
from dpgcli.equilibrium.contracts import (
    Coordinates,
    Measure,
    OwnCoordinate,
    Term,
    WideMeasure,
)
from dpgcli.equilibrium.joined import Joined, OfPart, Together, terms_of_part
from dpgcli.equilibrium.loaded import LoadedPotential, ShareOfLaw
from dpgcli.equilibrium.potential import Potential
from dpgcli.grasping.layout import Layout
from dpgcli.grasping.shapes import ContactShapes
from dpgcli.mechanics.coordinates import FingerCoordinates, FingerPotential
from dpgcli.mechanics.mirror import Heights
from dpgcli.mechanics.pressure import PressureWork
from dpgcli.mechanics.terms import (
    DOMES,
    DeadLoad,
    DomeSprings,
    Quadratic,
    springs_merged,
    without_domes,
)
from dpgcli.records import dataclass

ROUNDING = 1e-13  # of the forces in play: a smaller push is none
STIFFER = 20.0  # than the softest unit: what a contact is sought with; more has rounding in it

Constrained = Extended[Coordinates]


@dataclass(frozen=True)
class Obstructed(Layout):
    """Fingers with bodies in their way: their energies, with contact and without."""

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

    def potentials(self, inverted: Flags) -> tuple[FingerPotential, ...]:
        """The energies of the fingers without contact, and without domes that are by themselves."""
        n = self.units.finger.n_units
        if self.n_travels:
            return (without_domes(self.formulate(self.units.finger)),) * self.n_fingers
        parts = inverted.reshape(self.n_fingers, n, -1)
        return tuple(self.formulate(self.units.finger.with_domes(part)) for part in parts)

    def bare(self, inverted: Flags, load: Array) -> Potential[Coordinates]:
        """The energy without contact: of fingers, pressures and what the body's motion costs."""
        own = self.potentials(inverted)
        if self.motion is None and self.ramp is None and len(own) == 1:
            alone = own[0]
            return Potential(alone.coordinates, springs_merged(alone.coordinates, alone.terms))
        terms = self._terms_of(own)
        grown = (replace(term, law=ShareOfLaw(term.law, load)) for term in self._growing_of(own))
        return Potential(self._system(own), (*terms, *grown))

    def _system(self, own: tuple[FingerPotential, ...]) -> Coordinates:
        """The coordinates of fingers, body and domes."""
        if self.motion is None and not self.n_travels and len(own) == 1:
            return own[0].coordinates
        joined = Joined[FingerCoordinates](tuple(potential.coordinates for potential in own))
        system: Coordinates = joined
        if self.motion is not None:
            soft = self.stiffness / STIFFER
            system = Extended[Coordinates](joined, self.motion.n, self.large, soft)
        if self.n_travels:
            finger = self.units.finger
            scales = 0.2 * finger.stroke, finger.force_scale / finger.stroke
            length, stiffness = map(self._by_finger, scales)
            system = Extended[Coordinates](system, self.n_travels, length, stiffness)
        return system

    def _terms_of(self, own: tuple[FingerPotential, ...]) -> tuple[Term, ...]:
        """The terms of fingers and body that do not know the load."""
        n, size = len(own), self.n_own
        merged = [springs_merged(alone.coordinates, alone.terms) for alone in own]
        terms = [terms_of_part(alone, finger, n, size) for finger, alone in enumerate(merged)]
        resistance = None if self.motion is None else self.motion.resistance
        resisting = () if resistance is None else (Term("body", self._opening, resistance),)
        holding = self._holding(1.0)
        pressing = () if self.ramp is None else self._pressing(own, self.ramp.begin)
        finger = self.units.finger
        law = DomeSprings(finger.law.pulling, finger.domes)
        domes = (Term("domes", travel, law) for travel in self.travels)
        return (*(term for part in terms for term in part), *domes, *resisting, *holding, *pressing)

    def _growing_of(self, own: tuple[FingerPotential, ...]) -> tuple[Term, ...]:
        """The terms of which the load is the share that acts.

        What held the body lets go, and pressures change.
        """
        pressing = () if self.ramp is None else self._pressing(own, self.ramp.change)
        return (*self._holding(-1.0), *pressing)

    def _holding(self, share: float) -> tuple[Term, ...]:
        """A share of what keeps the body where it is: forces, and a spring where it turns."""
        if self.motion is None or self.motion.hold is None:
            return ()
        force = Term("hold", self._motions, DeadLoad(share * self.motion.hold))
        spring = self.motion.spring
        if spring is None:
            return (force,)
        return force, Term("hold", self._motions, Quadratic(share * spring))

    def _pressing(self, own: tuple[FingerPotential, ...], pressure: Array) -> tuple[Term, ...]:
        """The work of pressures, (unit, 1) in MPa, on the domes of every finger."""
        assert self.ramp is not None, "volumes are known"
        work = PressureWork(pressure, self.ramp.volumes, self.units.finger.domes)
        return tuple(Term("pressure", dome, work) for dome in self._domes_of(own))

    def _domes_of(self, own: tuple[FingerPotential, ...]) -> tuple[OfPart | OwnCoordinate, ...]:
        """What pressures move of each finger: extensions of the domes' springs, or their own."""
        return self.travels or self._extensions(own)

    def pressed(self, inverted: Flags, push: Array, load: Array) -> Potential[Coordinates]:
        """The augmented Lagrangian for some pushes, (cell, batch), N."""
        bare = self.bare(inverted, load)
        law = AugmentedContact(push, self.stiffness, self.bound(load), self.are_kept)
        contact = Term("contact", self.gaps(push > 0.0), law)
        return Potential(bare.coordinates, (*bare.terms, contact))

    def family(
        self, inverted: Flags, active: Flags
    ) -> LoadedPotential[Constrained, ActiveConstraints]:
        """The Lagrangians of active contacts, (cell, batch), by the load."""
        own = self.potentials(inverted)
        frame = self._system(own)
        gaps, multiplied = self.gaps(), self._multiplied(active)
        system = Extended(frame, multiplied.n, self.large, self.stiffness)
        law = ActiveConstraints(
            active, self.stiffness, self._deep, self.large[0], self.are_kept, self._limits
        )
        bare = self._terms_of(own)
        of_springs = (term.measure for term in bare if term.kind == DOMES)
        domes: tuple[Measure | WideMeasure, ...] = self.travels or tuple(of_springs)
        beside = np.concatenate((active[: self.n_gaps], active[self.n_gaps + self.n_travels :]))
        return LoadedPotential(
            system,
            (*bare, multiplier_term(system)),
            Slack(gaps, frame.size, multiplied),
            law,
            *self._followed(domes),
            self._growing_of(own),
            n_multipliers=multiplied.n,
            may_kink=np.asarray(beside.any(axis=0)),
        )

    def _followed(
        self, domes: tuple[Measure | WideMeasure, ...]
    ) -> tuple[Measure | WideMeasure, Array, Array]:
        """By what paths are followed, its scale and what holds it: by domes.

        And by how far jaws have opened, where their own force may turn back: no path by domes sees
        how far one step takes them.
        """
        scale = self._by_finger(self.units.finger.stroke)
        stiffness = self._by_finger(self.units.holding_stiffness)
        softening = None if self.motion is None else self.motion.softening
        if softening is None:
            size = self._n_frame if self.n_travels else self.n_own
            return domes[0] if len(domes) == 1 else Together(domes, size), scale, stiffness
        every = Together((*domes, self._opening), self._n_frame)
        both = (scale, softening.scale), (stiffness, softening.stiffness)
        scale, stiffness = (_with_row(values, value) for values, value in both)
        return every, scale, stiffness

    def _multiplied(self, active: Flags) -> Multiplied:
        """Multipliers of active contacts, so many that no batch decides how sums are ordered."""
        return Multiplied.of(active, WIDE + 2 - self._n_frame)

    def _by_finger(self, values: Array) -> Array:
        """Values of each unit, (unit, …), for all fingers."""
        n = self.units.finger.n_units
        whole = np.broadcast_to(values, (n, values.shape[1]))
        return np.tile(whole, (self.n_fingers, 1)) if self.n_fingers > 1 else values

    def moved_to(self, shapes: ContactShapes, load: Array) -> ContactShapes:
        """Shapes with the body where its motion has it at a load; the fingers stay."""
        assert self.motion is not None and self.motion.travel is not None, "it is moved"
        coordinates = shapes.coordinates.copy()
        coordinates[self.n_own :] = (load - 1.0) * self.motion.travel
        return replace(shapes, coordinates=coordinates)

    def at_rest(self, shapes: ContactShapes) -> ContactShapes:
        """Shapes of fingers whose body has come to its place, as those of one that stays there."""
        cells = slice(self.n_gaps)
        coordinates, push = shapes.coordinates[: self.n_own], shapes.push[cells]
        return replace(shapes, coordinates=coordinates, push=push, active=shapes.active[cells])

    def relabeled(self, shapes: ContactShapes) -> ContactShapes:
        """Shapes with each contact counted as that of the side to which it has come."""
        place = self.gaps()(shapes.coordinates).place
        is_there = place[:, None] == np.arange(len(place))[:, None]
        active = (is_there & shapes.active[:, None]).any(axis=0)
        push = total(np.where(is_there, shapes.push[:, None], 0.0))
        return replace(shapes, active=active, push=push)

    def stacked(self, shapes: ContactShapes) -> Array:
        """Coordinates and multipliers y = μ/σ of shapes."""
        y = self._multiplied(shapes.active).taken(shapes.push / self.stiffness)
        return np.concatenate((shapes.coordinates, y))

    def pushes(self, active: Flags, multipliers: Array) -> Array:
        """The pushes of contacts, (cell, batch), that have these multipliers first, N."""
        own = self._multiplied(active)
        return own.spread(multipliers[: own.n] * self.stiffness, len(active))

    def without_rounding(self, push: Array) -> Array:
        """Pushes, (cell, batch), N, but for those that are rounding only: zero."""
        least = ROUNDING * self.units.finger.force_scale.min(axis=0)
        return np.where(push > least, push, 0.0)

    def are_slipping(self, coordinates: Array, load: Array) -> Flags:
        """Whether the end of a finger slips over the body, (batch,)."""
        bound, slips = (load - 1.0) * self.depth, np.zeros(len(load), bool)
        for gaps in self.contacts:
            if not isinstance(gaps, Heights):
                slips |= gaps.are_slipping(coordinates, bound)
        return slips

    def are_folded(self, shapes: ContactShapes) -> Flags:
        """Lanes in which a finger has folded onto itself, (batch,)."""
        found = np.zeros(shapes.coordinates.shape[1], bool)
        for finger, potential in enumerate(self.potentials(shapes.inverted)):
            mine = self.of_finger(shapes.coordinates, finger)
            found |= folded(potential.coordinates, mine)
        return found

    def is_open(self, shapes: ContactShapes) -> Flags:
        """Which units are in their inverted wells, (unit, batch).

        Domes by themselves that have left their neighbors also where they have withdrawn behind
        their units' barriers, as long as they have not lost their places. Where a gap closes under
        their pushes until it is shut, that is the barrier: they lose their places exactly there.
        """
        if self.ramp is not None and self.n_travels:
            barrier = self.units.wells.spring_barrier - ROUNDING * self.units.finger.stroke
            place = np.stack([travel(shapes.coordinates).value for travel in self.travels])
            apart = ~shapes.active[self.n_gaps : self.n_gaps + self.n_travels].reshape(place.shape)
            keeps = rest_between(self.units.finger, self.ramp.volumes, place, barrier)
            return np.asarray((place > barrier) | (apart & keeps)).reshape(self.n_travels, -1)
        own = []
        for finger, potential in enumerate(self.potentials(shapes.inverted)):
            springs = potential.coordinates.springs(self.of_finger(shapes.coordinates, finger))
            acts = potential.coordinates.finger.acting > 0.0  # others only have a wide gap
            own.append((springs.extension > self.units.wells.spring_barrier) & acts)
        return np.concatenate(own)


def _with_row(values: Array, value: float) -> Array:
    """Values by row, (row, …), and one more row of a single value."""
    return np.concatenate((values, np.full((1, *values.shape[1:]), value)))
