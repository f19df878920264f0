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

from collections.abc import Iterator
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from dpgcli.actuation.domes import rest_between
from dpgcli.arrays import Array, Flags, Indices, total
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
    Row,
    Term,
    WideMeasure,
    take_lanes,
)
from dpgcli.equilibrium.joined import Joined, OfPart, Together, terms_of_part
from dpgcli.equilibrium.loaded import LoadedPotential, ShareOfLaw
from dpgcli.equilibrium.potential import Potential
from dpgcli.grasping.shapes import ContactShapes, Motion, Ramp
from dpgcli.mechanics.coordinates import FingerCoordinates, FingerPotential
from dpgcli.mechanics.dome_gaps import DomeGaps
from dpgcli.mechanics.face import Face
from dpgcli.mechanics.gaps import FaceGaps
from dpgcli.mechanics.laws import PushOnly
from dpgcli.mechanics.mirror import Axis, Heights, NodeGaps, OfNodes, Touching
from dpgcli.mechanics.obstacle import Obstacle
from dpgcli.mechanics.pressure import PressureWork
from dpgcli.mechanics.sticking import Sticking
from dpgcli.mechanics.terms import (
    DeadLoad,
    DomeSprings,
    Formulate,
    Quadratic,
    without_domes,
)
from dpgcli.records import dataclass
from dpgcli.states.units import UnitSolutions

ROUNDING = 1e-13  # of the forces in play: a smaller push is none
STIFFER = 20.0  # than the softest unit: what a contact is sought with; more has rounding in it

Constrained = Extended[Coordinates]


@dataclass(frozen=True)
class Obstructed:
    """Fingers with bodies in their way: one design and body, or one for each lane.

    There are as many fingers to a lane as there are `bodies`: what the body is in the frame of
    each. Fingers that meet each other have an `axis`, in which their frames are mirror images: two
    of them do, with or without a body, and one alone that `is_mirrored` meets its mirror image
    there. Arrays by unit are those of the first finger, then of the next; so are those by cell.
    Coordinates are interleaved (`equilibrium.joined`), those of the `motion` behind them, then
    those of domes by themselves. Cells are gaps to bodies, then those between fingers, then those
    between domes and neighbors, then what is prescribed.

    `thickness` (1, 1 or batch) is that of the layer, mm. Bodies may stand in the way by less than
    they will: by b = (λ − 1) D with a load λ, `depth` D (batch,) in mm; and mirror images may come
    to the axis, from `apart` (batch,), mm, beyond it. A `ramp` changes the
    pressures on their domes by the load; without it there are none. Points of bodies deeper behind
    a face than the `reach` (batch,), mm, are beyond the finger. Places that are `sticking` to a
    body that is there in full do not slide along it.
    """

    units: UnitSolutions
    formulate: Formulate
    thickness: Array
    bodies: tuple[Obstacle, ...]
    depth: Array
    motion: Motion | None = None
    ramp: Ramp | None = None
    reach: Array | None = None
    sticking: tuple[Sticking, ...] = ()
    axis: Axis | None = None
    is_mirrored: bool = False
    apart: Array = field(default_factory=lambda: np.zeros(1))

    @property
    def n_fingers(self) -> int:
        """Fingers to a lane."""
        return 1 if self.is_mirrored else len(self.bodies) or 2

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
        bodies = tuple(body.take_lanes(index) for body in self.bodies)
        motion = self.motion and self.motion.take_lanes(index)
        ramp = self.ramp and self.ramp.take_lanes(index)
        reach = None if self.reach is None else take_lanes(self.reach, index)
        units = self.units.take_lanes(index)
        sticking = tuple(place.take_lanes(index) for place in self.sticking)
        bare = Obstructed(units, self.formulate, thickness, bodies, depth, motion, ramp, reach)
        axis, apart = self.axis and self.axis.take_lanes(index), take_lanes(self.apart, index)
        meeting = replace(bare, axis=axis, is_mirrored=self.is_mirrored, apart=apart)
        return replace(meeting, sticking=sticking)

    def of_finger(self, values: Array, finger: int) -> Array:
        """What belongs to a finger of coordinates (size, …)."""
        return values[finger : self.n_own : self.n_fingers]

    @cached_property
    def n_own(self) -> int:
        """Coordinates of all fingers."""
        return self.n_fingers * self.formulate(self.units.finger).coordinates.size

    @cached_property
    def _still(self) -> tuple[Face, ...]:
        """The faces of the fingers."""
        alone = Face.of(self.formulate(self.units.finger).coordinates, self.thickness)
        n = self.n_fingers
        return tuple(replace(alone, places=n * alone.places + finger) for finger in range(n))

    @cached_property
    def _moving(self) -> tuple[Face, ...]:
        """The same as what moves sees them."""
        if self.motion is None:
            return self._still
        own = np.arange(self.n_own, self.n_own + self.motion.n)
        motion, pairs = self.motion, enumerate(self._still)
        return tuple(
            face.seen_from(motion.directions[finger], own, motion.pivot_of(finger))
            for finger, face in pairs
        )

    @property
    def faces(self) -> tuple[Face, ...]:
        """The faces of the fingers, as the body sees them."""
        return self._still if self._moves_bases else self._moving

    @property
    def _moves_bases(self) -> bool:
        return self.motion is not None and self.motion.is_of_bases

    @cached_property
    def contacts(self) -> tuple[FaceGaps | Heights | NodeGaps, ...]:
        """The gaps of each finger to its body, and behind them those between fingers."""
        return (*self.on_bodies, *self._between)

    @cached_property
    def on_bodies(self) -> tuple[FaceGaps, ...]:
        """The gaps of each finger to its body."""
        pairs = zip(self.faces, self.bodies, strict=False)  # there may be no body
        return tuple(FaceGaps(face, body, reach=self.reach) for face, body in pairs)

    @cached_property
    def _between(self) -> tuple[Heights | NodeGaps, ...]:
        """The gaps between fingers that meet."""
        if self.axis is None:
            return ()
        faces = self._moving if self._moves_bases else self._still
        if self.is_mirrored:
            return (Heights(faces[0].with_end(), self.axis),)
        upper, lower = (face.with_end() for face in faces)
        told = self.axis, self.n_own + self._n_motions, self.behind
        return NodeGaps(upper, lower, *told, True), NodeGaps(lower, upper, *told, False)

    @property
    def behind(self) -> Array:
        """How far behind the face the domes reach, mm, (1 or batch,)."""
        height = self.units.finger.segment_height.max(axis=0)
        return np.asarray(height + 0.5 * self.thickness[0])

    def seen_by(self, finger: int) -> Iterator[tuple[slice, Touching]]:
        """The cells that a finger has a part in, and what it touches there."""
        n_before = 0
        for number, gaps in enumerate(self.contacts):
            cells = slice(n_before, n_before + gaps.n_cells)
            if number % self.n_fingers == finger:
                yield cells, gaps
            elif isinstance(gaps, NodeGaps):
                yield cells, OfNodes(gaps)
            n_before = cells.stop

    def gaps(self, first: Flags | None = None) -> WideMeasure:
        """Gaps to the bodies in full; at each place only one, if it is said which come first.

        Behind them what is prescribed: motions, and places that stick.
        """
        gaps: list[WideMeasure] = []
        for bare in self.contacts:
            n = sum(measure.n_cells for measure in gaps)
            gaps.append(bare.with_first(None if first is None else first[n : n + bare.n_cells]))
        if self.motion is None and not self.n_travels and len(gaps) == 1:
            return gaps[0]
        return Together((*gaps, *self._dome_gaps, *self._prescribed), self._n_frame)

    def each(self, push: Array) -> Iterator[tuple[FaceGaps, Array]]:
        """The gaps of each finger to its body, and what belongs to them of pushes (cell, …)."""
        n_before = 0
        for gaps in self.on_bodies:
            yield gaps, push[n_before : n_before + gaps.n_cells]
            n_before += gaps.n_cells

    @property
    def _n_motions(self) -> int:
        return 0 if self.motion is None else self.motion.n

    @cached_property
    def n_travels(self) -> int:
        """Domes with coordinates of their own: those that only push, while pressures change."""
        has_own = self.ramp is not None and isinstance(self.units.finger.law, PushOnly)
        return self.n_fingers * self.units.finger.n_units if has_own else 0

    @property
    def _n_frame(self) -> int:
        """Coordinates of fingers, body and domes."""
        return self.n_own + self._n_motions + self.n_travels

    @property
    def travels(self) -> tuple[OwnCoordinate, ...]:
        """Where the domes of each finger are by themselves, as extensions of their springs, mm."""
        n, first = self.units.finger.n_units, self.n_own + self._n_motions
        places = range(first, first + self.n_travels, n)
        return tuple(OwnCoordinate(Row(1, place), n) for place in places)

    @cached_property
    def _dome_gaps(self) -> tuple[DomeGaps, ...]:
        """Those of each finger between domes by themselves and their neighbors."""
        if not self.n_travels:
            return ()
        own = (self.formulate(self.units.finger),) * self.n_fingers
        pairs = zip(self._extensions(own), self.travels, strict=True)
        return tuple(DomeGaps(extension, travel) for extension, travel in pairs)

    @property
    def _motions(self) -> OwnCoordinate:
        return OwnCoordinate(Row(1, self.n_own), self._n_motions)

    @property
    def _opening(self) -> OwnCoordinate:
        """The last of the motions, which a body may resist."""
        return OwnCoordinate(Row(1, self.n_own + self._n_motions - 1), 1)

    @property
    def _prescribed(self) -> tuple[OwnCoordinate | Sticking, ...]:
        is_told = self.motion is not None and self.motion.travel is not None
        return (*((self._motions,) if is_told else ()), *self.sticking)

    @property
    def is_free(self) -> bool:
        """Whether nothing but the fingers keeps the body where it is."""
        motion = self.motion
        return motion is not None and motion.travel is None and motion.resistance is None

    @cached_property
    def n_gaps(self) -> int:
        """Cells that are gaps."""
        return sum(gaps.n_cells for gaps in self.contacts)

    @cached_property
    def n_on_bodies(self) -> int:
        """Those of them, the first ones, that are gaps to bodies."""
        return sum(gaps.n_cells for gaps in self.on_bodies)

    @cached_property
    def are_kept(self) -> Flags:
        """Cells that are no gaps, (cell, 1)."""
        n_others = sum(measure.n_cells for measure in self._prescribed)
        n_contacts = self.n_gaps + self.n_travels
        return (np.arange(n_contacts + n_others) >= n_contacts)[:, None]

    @property
    def _deep(self) -> Array:
        """D of every cell, (…, batch)."""
        is_told = self.motion is not None and self.motion.travel is not None
        if self.axis is None and not is_told:
            return self.depth
        n_between = self.n_gaps - self.n_on_bodies
        travel = np.zeros((0, 1)) if self.motion is None else self.motion.travel
        deep = [(self.n_on_bodies, self.depth), (n_between, self.apart)]
        deep += [] if travel is None else [(len(travel), travel)]
        deep.append((len(self.sticking), np.zeros(1)))
        n_lanes = max(own.shape[-1] for _, own in deep)
        return np.concatenate([np.broadcast_to(own, (n, n_lanes)) for n, own in deep])

    @property
    def _limits(self) -> Array | None:
        """How much of its finger's pushes a place that sticks bears, (place, cell, 1 or lane)."""
        if not self.sticking:
            return None
        n_lanes = max(place.friction.shape[1] for place in self.sticking)
        limits, n_before = np.zeros((len(self.sticking), len(self.are_kept), n_lanes)), 0
        for finger, (place, gaps) in enumerate(zip(self.sticking, self.on_bodies, strict=True)):
            limits[finger, n_before : n_before + gaps.n_cells] = place.friction
            n_before += gaps.n_cells
        return limits

    def bound(self, load: Array) -> Array:
        """b = (λ − 1) D, mm."""
        return (load - 1.0) * self._deep

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
            return own[0]
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
        terms = self._terms_of(own)
        grown = (replace(term, law=ShareOfLaw(term.law, load)) for term in self._growing_of(own))
        return Potential(system, (*terms, *grown))

    def _terms_of(self, own: tuple[FingerPotential, ...]) -> tuple[Term, ...]:
        """The terms of fingers and body that do not know the load."""
        n, size = len(own), self.n_own
        terms = [terms_of_part(alone.terms, finger, n, size) for finger, alone in enumerate(own)]
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

    def _extensions(self, own: tuple[FingerPotential, ...]) -> tuple[OfPart, ...]:
        """Extensions of the domes' springs of each finger."""
        n, size = len(own), self.n_own
        return tuple(
            OfPart(alone.coordinates.dome, place, n, size) for place, alone in enumerate(own)
        )

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
        frame = self.bare(inverted, np.zeros(1)).coordinates
        gaps, multiplied = self.gaps(), self._multiplied(active)
        system = Extended(frame, multiplied.n, self.large, self.stiffness)
        law = ActiveConstraints(
            active, self.stiffness, self._deep, self.large[0], self.are_kept, self._limits
        )
        terms = (*self._terms_of(own), multiplier_term(system))
        beside = np.concatenate((active[: self.n_gaps], active[self.n_gaps + self.n_travels :]))
        return LoadedPotential(
            system,
            terms,
            Slack(gaps, frame.size, multiplied),
            law,
            *self._followed(self._domes_of(own)),
            self._growing_of(own),
            n_multipliers=multiplied.n,
            may_kink=np.asarray(beside.any(axis=0)),
        )

    def _followed(
        self, domes: tuple[OfPart | OwnCoordinate, ...]
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
