"""Fingers under pressure: followed as it changes, and relaxed where they lose their balance."""

from dataclasses import replace
from enum import IntEnum
from functools import cached_property
from typing import TypeVar

import numpy as np

from dpgcli.actuation.domes import (
    DomesAt,
    PressedDomes,
    PushingDomes,
    limits,
    pushing,
    rest_on,
)
from dpgcli.actuation.folding import folded
from dpgcli.actuation.meeting import about_to_touch, with_touching
from dpgcli.actuation.stretches import Stretches, picked, stretches
from dpgcli.arrays import Array, Flags, Indices
from dpgcli.design.pressure import Pressure
from dpgcli.equilibrium.contracts import ScalarLaw, Term
from dpgcli.equilibrium.loaded import LoadedLaw, LoadedPotential
from dpgcli.equilibrium.newton import minimize
from dpgcli.equilibrium.path import LARGEST_STEP, Ends, Watch, follow
from dpgcli.equilibrium.potential import Potential
from dpgcli.equilibrium.walk import PathEnd
from dpgcli.mechanics.coordinates import FingerCoordinates
from dpgcli.mechanics.curve import Spline
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.laws import PushOnly
from dpgcli.mechanics.pressure import DomeVolumes, PressureWork
from dpgcli.mechanics.terms import chain_potential, springs_merged, without_domes
from dpgcli.records import dataclass
from dpgcli.states.units import UnitSolutions
from dpgcli.states.wells import inverted_wells

Loaded = TypeVar("Loaded", bound=LoadedLaw)

TIE = 1e-6  # of the pressure: thresholds as near are not told apart
LEFT = 0.05  # of a stroke: what has moved further has left its place
DISPLACED = 1e-3  # of a stroke: from a fold to where downhill is told from level
TOLERANCE = 1e-12  # of the forces in play
LARGEST_RESIDUAL = 1e-9  # of the forces in play: more is no equilibrium


class Halt(IntEnum):
    """Why a finger stopped on the way from one pressure to another."""

    ARRIVED = 0
    FOLD = 1
    ALONE = 2  # a dome that is apart has lost its place
    CONTACT = 3
    RELEASE = 4
    FOLDED = 5
    FAILED = 6


@dataclass(frozen=True)
class Shapes:
    """Fingers under pressure, a lane each: coordinates (size, batch), the rest (unit, batch).

    `pressure` in MPa by unit; `inverted` domes; `touching` those in touch with their neighbors,
    None for laws under which all are. `place` (mm) are the extensions at which domes rest that are
    apart from their neighbors, each in a well of its own; of no meaning for those in touch.
    """

    coordinates: Array
    pressure: Array
    inverted: Flags
    touching: Flags | None = None
    place: Array | None = None

    def take_lanes(self, index: Indices) -> "Shapes":
        """Some of them."""
        touching = None if self.touching is None else self.touching[:, index]
        place = None if self.place is None else self.place[:, index]
        which = self.coordinates[:, index], self.pressure[:, index], self.inverted[:, index]
        return Shapes(*which, touching, place)

    def put(self, index: Indices, others: "Shapes") -> None:
        """Replace the lanes at `index`."""
        self.coordinates[:, index], self.pressure[:, index] = others.coordinates, others.pressure
        self.inverted[:, index] = others.inverted
        if self.touching is not None and others.touching is not None:
            self.touching[:, index] = others.touching
        if self.place is not None and others.place is not None:
            self.place[:, index] = others.place


@dataclass(frozen=True)
class Halted:
    """Where fingers stopped: `share` of the way, why (`Halt` codes) and by which unit, or −1.

    `tied` (unit, batch) are other units whose thresholds are the same within `TIE`, and `start` the
    coordinates from which it goes downhill, a little past a fold.
    """

    shapes: Shapes
    share: Array
    reason: Indices
    unit: Indices
    tied: Flags
    start: Array

    def take_lanes(self, index: Indices) -> "Halted":
        """Some of them."""
        return Halted(
            self.shapes.take_lanes(index),
            self.share[index],
            self.reason[index],
            self.unit[index],
            self.tied[:, index],
            self.start[:, index],
        )


@dataclass(frozen=True)
class Pressed:
    """Fingers whose domes are under pressure: one design, or one for each lane."""

    units: UnitSolutions
    volumes: DomeVolumes

    @classmethod
    def of(cls, units: UnitSolutions, pressure: Pressure) -> "Pressed":
        """Fingers of one design, or of one for each lane, under the pressure of their scene.

        Where the area of domes is not given, a dome with a curve of its own snaps under the snap
        pressure by itself; one whose travel is the opening does so with its hinge, between rigid
        bars: A = F/p with F the largest force that the unit bears.

        >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
        >>> units, line = UnitSolutions.of(uniform_finger(1, **STUDY)), np.zeros(1, int)
        >>> given = Pressure(("A",), line, None, snap_pressure=np.array([[0.1495]]))
        >>> print(Pressed.of(units, given).volumes.area.round(2))  # mm²
        [[31.61]]
        """
        area = pressure.effective_area
        if area is None:
            assert pressure.snap_pressure is not None, "one of the two is known"
            area = _borne(units, pressure.shape) / pressure.snap_pressure
        return cls(units, DomeVolumes(area, pressure.shape))

    @property
    def finger(self) -> Finger:
        """The fingers."""
        return self.units.finger

    @property
    def stretches(self) -> Stretches | None:
        """Where domes by themselves rest; None for those that always act."""
        return self._wells if isinstance(self.finger.law, PushOnly) else None

    @cached_property
    def _wells(self) -> Stretches | None:
        """The same; None for those that have no more than two wells, and always act."""
        law = self.finger.law
        has_two = law.curve is None and not isinstance(law, PushOnly)
        return None if has_two else stretches(self.finger, self.volumes)

    def take_lanes(self, index: Indices) -> "Pressed":
        """The fingers of some lanes; what paths need of designs is found once, before."""
        _ = self.units.holding_stiffness
        taken = Pressed(self.units.take_lanes(index), self.volumes.take_lanes(index))
        wells = self._wells
        taken.__dict__["_wells"] = None if wells is None else wells.take_lanes(index)
        return taken

    @cached_property
    def _bare(self) -> Potential[FingerCoordinates]:
        """The energy without domes."""
        bare = without_domes(chain_potential(self.finger))
        return Potential(bare.coordinates, springs_merged(bare.coordinates, bare.terms))

    def family(
        self, shapes: Shapes, target: Array
    ) -> LoadedPotential[FingerCoordinates, PressedDomes]:
        """The energies on the way from the pressures of shapes to others, (unit, batch)."""
        law = PressedDomes(self.finger, self.volumes, shapes.pressure, target - shapes.pressure)
        if self.stretches is not None:
            assert shapes.place is not None, "given beside touching"
            furthest = picked(self.stretches.ends, self.stretches.of(shapes.place))
            law = replace(law, touching=shapes.touching, furthest=furthest)
        return self.loaded(law)

    def loaded(self, law: Loaded) -> LoadedPotential[FingerCoordinates, Loaded]:
        """The energies with domes of a law that changes with a load."""
        bare = self._bare
        coordinates = bare.coordinates
        dome, scale, stiffness = coordinates.dome, self.finger.stroke, self.units.holding_stiffness
        return LoadedPotential(coordinates, bare.terms, dome, law, dome, scale, stiffness)

    def domes(self, pressure: Array, place: Array | None = None) -> DomesAt | PushingDomes:
        """The law of the domes under fixed pressures, from their places where they only push."""
        if self.stretches is None:
            return DomesAt(self.finger, PressureWork(pressure, self.volumes, self.finger.domes))
        assert place is not None, "domes that only push are somewhere"
        return pushing(self.finger, self.volumes, self.stretches, pressure, place)

    def as_touching(self, shapes: Shapes) -> Potential[FingerCoordinates]:
        """The energy less the work of the pressures, each dome in touch or not as it is."""
        work = PressureWork(shapes.pressure, self.volumes, self.finger.domes)
        return self.with_domes(DomesAt(self.finger, work, shapes.touching))

    def with_domes(self, law: ScalarLaw) -> Potential[FingerCoordinates]:
        """The energy with domes of some law."""
        bare = self._bare
        dome = Term("domes", bare.coordinates.dome, law)
        return Potential(bare.coordinates, (*bare.terms, dome))

    @property
    def coordinates(self) -> FingerCoordinates:
        """The system of coordinates of shapes."""
        return self._bare.coordinates

    def extensions(self, coordinates: Array) -> Array:
        """Extensions of the domes' springs, mm, (unit, batch)."""
        return self.coordinates.dome(coordinates).value

    def travels(self, shapes: Shapes) -> Array:
        """Travels of the domes' poles, mm, (unit, batch): apart from their neighbors, their own."""
        return self.places(shapes) + self.finger.domes.contact

    def places(self, shapes: Shapes) -> Array:
        """Extensions at which domes are, mm, (unit, batch), in touch those of their units."""
        extension = self.extensions(shapes.coordinates)
        if shapes.touching is None or shapes.place is None:
            return extension
        return np.where(shapes.touching, extension, shapes.place)

    def resting(self, shapes: Shapes) -> Shapes:
        """Shapes whose domes that are apart have gone along with their pressures.

        Each has kept its stretch: beyond the pressures of that it is at its end.
        """
        own = self.stretches
        if own is None or shapes.place is None:
            return shapes
        stretch = own.of(shapes.place)
        place = rest_on(self.finger, self.volumes, own, shapes.pressure, stretch)
        return replace(shapes, place=place)

    def energy(self, shapes: Shapes) -> Array:
        """Energy less the work of the pressures, mJ, (batch,)."""
        return self.with_domes(self._domes_of(shapes)).evaluate(shapes.coordinates).energy

    def left(self, before: Shapes, after: Shapes) -> Flags:
        """Units that go to another well from some shapes to others, (unit, batch).

        They flip, or their domes go to another stretch of a curve with ripples, further than others
        move beside them.
        """
        flipped = before.inverted ^ after.inverted
        if self._wells is None:
            return flipped
        one, other = self.places(before), self.places(after)
        is_far = np.abs(one - other) > LEFT * self.finger.stroke
        is_other = self._wells.of(one) != self._wells.of(other)
        return np.asarray(flipped | (is_far & is_other))

    def fallen_back(self, place: Array, pressure: Array) -> Array:
        """Where domes rest that nothing holds at a place any more, mm, (unit, batch)."""
        own = self.stretches
        assert own is not None, "others have no places"
        stretch = own.beyond(place, pressure, np.zeros(place.shape, bool))
        return rest_on(self.finger, self.volumes, own, pressure, stretch)

    def lost(self, shapes: Shapes, which: Flags) -> Array:
        """Places of domes, mm, (unit, batch), these half-way from their stretches to the next.

        Their pressures are at what their stretches bear, at most or at least.
        """
        own = self.stretches
        assert own is not None and shapes.place is not None, "others have no places"
        stretch, last = own.of(shapes.place), len(own.begins) - 1
        to_most, to_least = (
            np.abs(shapes.pressure - picked(part, stretch)) for part in (own.most, own.least)
        )
        before = np.where(to_most < to_least, stretch, np.maximum(stretch - 1, 0))
        between = picked(own.ends, before) + picked(own.begins, np.minimum(before + 1, last))
        return np.where(which, 0.5 * between, shapes.place)

    def _domes_of(self, shapes: Shapes) -> DomesAt | PushingDomes:
        """The law of domes where they are: in touch, or at rest in their places."""
        work = PressureWork(shapes.pressure, self.volumes, self.finger.domes)
        if shapes.touching is None or shapes.place is None:
            return DomesAt(self.finger, work)
        low, high = (np.where(shapes.touching, end, shapes.place) for end in (-np.inf, np.inf))
        return PushingDomes(self.finger, work, low, high)

    def followed(
        self,
        shapes: Shapes,
        target: Array,
        largest_step: float = LARGEST_STEP,
        watch: Watch | None = None,
    ) -> Halted:
        """Follow shapes towards other pressures, (unit, batch), until something happens.

        `watch` is told what is on the way, with shares of it as loads.
        """
        if shapes.place is not None:
            shapes = replace(shapes, place=self.places(shapes))
        family = self.family(shapes, target)
        touching = about_to_touch(family, shapes.coordinates)
        shapes, family = replace(shapes, touching=touching), with_touching(family, touching)
        end, alone = self._lost_alone(shapes, target)
        ends = follow(family, shapes.coordinates, np.zeros(len(end)), end, largest_step, watch)
        pressure = shapes.pressure + ends.load * (target - shapes.pressure)
        there = self.resting(replace(shapes, coordinates=ends.coordinates, pressure=pressure))
        is_alone = (ends.outcome == PathEnd.ARRIVED) & alone.any(axis=0)
        unit = np.where(is_alone, alone.argmax(axis=0), ends.cell)
        start, left = self._past(family, ends, target - shapes.pressure)
        tied = np.where(is_alone, alone, left) | self._meeting(family, ends)
        tied &= np.arange(len(left))[:, None] != unit
        reason = _reasons(ends, shapes.touching)
        reason = np.where(is_alone, Halt.ALONE, reason)
        is_folded = folded(family.coordinates, ends.coordinates)
        reason = np.where(is_folded, Halt.FOLDED, reason)
        return Halted(there, ends.load, reason, unit, tied, start)

    def _past(
        self, family: LoadedPotential[FingerCoordinates, PressedDomes], ends: Ends, change: Array
    ) -> tuple[Array, Flags]:
        """Coordinates a little past folds, and units that lose their balance within `TIE` as well.

        The unit that is the first is held where it is, while the pressure rises by so much; what
        leaves its place then is tied with it.
        """
        start, left = ends.coordinates.copy(), np.zeros(change.shape, bool)
        folds = np.flatnonzero(ends.outcome == PathEnd.FOLD)
        if not len(folds):
            return start, left
        few, cell = family.take_lanes(folds), ends.cell[folds]
        here, lanes = start[:, folds], np.arange(len(folds))
        values = few.followed(here).value
        if len(values) > 1:
            own = change[cell, folds]
            at_fold = few.law.pressures(ends.load[folds])[cell, lanes]
            further = TIE * np.abs(at_fold) / np.where(own != 0.0, np.abs(own), np.inf)
            held = (np.arange(len(values))[:, None] == cell) * few.stiffness
            potential = few.held(ends.load[folds] + further, held, values[cell, lanes])
            here = minimize(potential, here, TOLERANCE).coordinates
            left[:, folds] = np.abs(few.followed(here).value - values) > LEFT * few.scale
        start[:, folds] = here + DISPLACED * ends.onward[:, folds]
        return start, left

    def _meeting(
        self, family: LoadedPotential[FingerCoordinates, PressedDomes], ends: Ends
    ) -> Flags:
        """Domes that meet or leave their neighbors where one does, within `TIE` of the pressure."""
        law = family.law
        if law.touching is None:
            return np.zeros((self.finger.n_units, len(ends.load)), bool)
        margin = law.margin(family.followed(ends.coordinates), ends.load)
        assert margin is not None, "domes that touch can be apart"
        push = np.abs(law.pressures(ends.load)) * self.volumes.area / self.finger.force_scale
        is_alike = law.touching == law.touching[ends.cell, np.arange(len(ends.cell))]
        near = np.abs(margin) <= TIE * push + LARGEST_RESIDUAL
        return np.asarray(near & is_alike & (ends.outcome == PathEnd.EVENT))

    def _lost_alone(self, shapes: Shapes, target: Array) -> tuple[Array, Flags]:
        """The share of the way at which the first dome that is apart loses its place, at most 1.

        And which those are, the first and what is tied with it.
        """
        n = shapes.inverted.shape[1]
        own = self.stretches
        if own is None or shapes.touching is None or shapes.place is None:
            return np.ones(n), np.zeros_like(shapes.inverted)
        change, stretch = target - shapes.pressure, own.of(shapes.place)
        limit = np.where(change < 0.0, picked(own.least, stretch), picked(own.most, stretch))
        is_towards = ~shapes.touching & (change != 0.0) & np.isfinite(limit)
        way, limit = np.where(is_towards, change, 1.0), np.where(is_towards, limit, 0.0)
        share = np.where(is_towards, np.maximum((limit - shapes.pressure) / way, 0.0), np.inf)
        first = np.minimum(share.min(axis=0), 1.0)
        near = np.abs((share - first) * way) <= TIE * np.abs(limit)
        return first, np.asarray(is_towards & (share <= 1.0) & near)


def _borne(units: UnitSolutions, shape: Spline | None) -> Array:
    """The force (N) over which a snap pressure gives the effective area, (unit, design)."""
    finger = units.finger
    if finger.law.curve is not None:
        return limits(finger, DomeVolumes(np.ones((1, 1)), shape)).snap_pressure
    return inverted_wells(replace(finger, law=finger.law.pulling)).snap_force


def _reasons(ends: Ends, touching: Flags | None) -> Indices:
    """`Halt` codes of the ends of paths."""
    lanes = np.arange(len(ends.load))
    reasons = np.array([Halt.ARRIVED, Halt.FOLD, Halt.CONTACT, Halt.FAILED])[ends.outcome]
    if touching is not None:
        releases = touching[np.maximum(ends.cell, 0), lanes] & (reasons == Halt.CONTACT)
        reasons = np.where(releases, Halt.RELEASE, reasons)
    return np.asarray(reasons)
