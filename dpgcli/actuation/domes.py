"""Domes under pressure: what they push with, where they touch their neighbors, when they snap."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from dpgcli.actuation.stretches import BISECTIONS, PLACES, Stretches, highest_near, picked
from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.contracts import Measured, Response, ScalarLaw, WideMeasured, take_lanes
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.laws import Dome
from dpgcli.mechanics.pressure import DomeVolumes, PressureWork
from dpgcli.records import dataclass

NEAREST = 1e-15  # of extensions: as near as rounding tells
FEW_PLACES = 64  # on a way of domes by themselves


@dataclass(frozen=True)
class PressedDomes:
    """The law of domes under pressures that change by a load λ: p = p₀ + λ Δp, MPa by unit.

    `pulling` is the law of a dome in touch. `touching` (unit, batch) says which domes are, None
    where all are, whatever happens: those of laws that push and pull. `furthest` (mm) is the
    extension up to which a dome that is apart may go without losing its place.
    """

    finger: Finger
    volumes: DomeVolumes
    pressure: Array
    change: Array
    touching: Flags | None = None
    furthest: Array | None = None

    @property
    def is_smooth(self) -> bool:
        """Curves from points may bend anywhere; the published one bends once."""
        return self.finger.law.curve is None and self.volumes.shape is None

    def at(self, load: Array) -> "DomesAt":
        """The law at a load."""
        work = PressureWork(self.pressures(load), self.volumes, self._domes)
        return DomesAt(self.finger, work, self.touching)

    def pressures(self, load: Array) -> Array:
        """Pressures by unit at a load, MPa."""
        return np.asarray(self.pressure + load * self.change)

    @property
    def _domes(self) -> Dome:
        return self.finger.domes

    def rate(self, scalar: Array, load: Array) -> Array:
        """−A Δp of domes in touch, N per unit of λ."""
        push = self.free_rate(scalar)
        return push if self.touching is None else np.where(self.touching, push, 0.0)

    def free_rate(self, scalar: Array) -> Array:
        """−A Δp of all domes, N per unit of λ."""
        return np.asarray(-self.change * self.volumes.swept(scalar, self._domes).area)

    def free(self, scalar: Array, load: Array) -> Response:
        """Of domes and pressures by themselves, whether in touch or not."""
        return in_touch(
            self.finger, PressureWork(self.pressures(load), self.volumes, self._domes), scalar
        )

    def margin(self, measured: Measured | WideMeasured, load: Array) -> Array | None:
        """Push of domes in touch, and what keeps the others from it, over the forces in play.

        A dome that is apart rests where its own force is zero, before its neighbor; it cannot go
        so far without losing its place where the opening is beyond its `furthest`.
        """
        if self.touching is None:
            return None
        assert self.furthest is not None, "given beside touching"
        scalar = measured.value
        force = self.free(scalar, load).force
        is_away = ~self.touching & (scalar > self.furthest)
        margin = np.where(self.touching, -force, force) / self.finger.force_scale
        return np.where(is_away, np.inf, margin)

    def take_lanes(self, index: Indices) -> Self:
        """The same law for some lanes of the batch."""
        return replace(
            self,
            finger=self.finger.take_lanes(index),
            volumes=self.volumes.take_lanes(index),
            pressure=take_lanes(self.pressure, index),
            change=take_lanes(self.change, index),
            touching=None if self.touching is None else take_lanes(self.touching, index),
            furthest=None if self.furthest is None else take_lanes(self.furthest, index),
        )


@dataclass(frozen=True)
class DomesAt:
    """The law of domes under fixed pressures; only those in touch act."""

    finger: Finger
    work: PressureWork
    touching: Flags | None = None

    def __call__(self, scalar: Array) -> Response:
        """Energy (mJ), force (N) and stiffness (N/mm) by the dome's extension."""
        response = in_touch(self.finger, self.work, scalar)
        if self.touching is None:
            return response
        return Response(*(np.where(self.touching, part, 0.0) for part in response))

    def take_lanes(self, index: Indices) -> Self:
        """The same law for some lanes of the batch."""
        touching = None if self.touching is None else take_lanes(self.touching, index)
        return type(self)(self.finger.take_lanes(index), self.work.take_lanes(index), touching)


@dataclass(frozen=True)
class PushingDomes:
    """Domes that only push, under fixed pressures: each acts between `low` and `high`, mm.

    There it touches its neighbor; at `high` it rests by itself, and below `low` it has been pushed
    back out of its place. The energy is constant beyond both.
    """

    finger: Finger
    work: PressureWork
    low: Array
    high: Array

    def __call__(self, scalar: Array) -> Response:
        """Energy (mJ), force (N) and stiffness (N/mm) by the dome's extension."""
        touches = self.touches(scalar)
        energy, force, stiffness = in_touch(
            self.finger, self.work, np.clip(scalar, self.low, self.high)
        )
        return Response(energy, np.where(touches, force, 0.0), np.where(touches, stiffness, 0.0))

    def touches(self, scalar: Array) -> Flags:
        """Which domes touch their neighbors."""
        return np.asarray((scalar > self.low) & (scalar < self.high))

    def take_lanes(self, index: Indices) -> Self:
        """The same law for some lanes of the batch."""
        low, high = take_lanes(self.low, index), take_lanes(self.high, index)
        return type(self)(self.finger.take_lanes(index), self.work.take_lanes(index), low, high)


def in_touch(finger: Finger, work: PressureWork, extension: Array) -> Response:
    """Of dome and pressure together, the dome in touch with its neighbor."""
    dome, pushed = finger.law.pulling.response(extension, finger.domes), work(extension)
    return Response(*(one + other for one, other in zip(dome, pushed, strict=True)))


def free_force(finger: Finger, volumes: DomeVolumes, extension: Array, pressure: Array) -> Array:
    """E' − p A (N) of the dome alone; it pushes where that is negative."""
    return in_touch(finger, PressureWork(pressure, volumes, finger.domes), extension).force


def rest_between(finger: Finger, volumes: DomeVolumes, begin: Array, end: Array) -> Flags:
    """Domes that rest by themselves wherever they are between two extensions, (…, unit, batch).

    As far as a number of places tells: the pressure E'/A rises with the extension there. Where they
    begin they may be about to lose their places.
    """
    share = (np.arange(1, FEW_PLACES + 1) / FEW_PLACES).reshape(-1, *(1,) * np.ndim(begin))
    place, domes = begin + share * (end - begin), finger.domes
    dome, swept = finger.law.pulling.response(place, domes), volumes.swept(place, domes)
    rises = dome.stiffness * swept.area > dome.force * swept.widening
    return np.asarray(rises.all(axis=0))


class DomeLimits(NamedTuple):
    """Where domes by themselves lose their places, (unit, batch).

    A ground dome snaps at an extension `peak` (mm) under `snap_pressure` (MPa), an inverted one
    resets at `dip` under `reset_pressure`.
    """

    peak: Array
    dip: Array
    snap_pressure: Array
    reset_pressure: Array


def limits(finger: Finger, volumes: DomeVolumes) -> DomeLimits:
    """The extremes of the pressure E'/A at which a dome alone rests, between its two rests.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> dome = uniform_finger(1, **STUDY)  # E'' = 0 at u = 0.2246
    >>> found = limits(dome, DomeVolumes(np.array([[30.0]])))
    >>> print(found.peak.round(4), found.snap_pressure.round(4))
    [[0.7861]] [[0.152]]
    """
    domes = finger.domes
    shape = np.broadcast_shapes(*(np.shape(part) for part in domes), volumes.area.shape)
    rests = finger.law.rests(domes)
    start = np.broadcast_to(-domes.contact, shape)
    top, well = (np.broadcast_to(rest, shape) for rest in rests)

    def pressure(extension: Array) -> Array:
        dome = finger.law.pulling.response(extension, domes)
        return np.asarray(dome.force / volumes.swept(extension, domes).area)

    peak = _largest(pressure, start, top)
    dip = _largest(lambda extension: -pressure(extension), top, well)
    return DomeLimits(peak, dip, pressure(peak), pressure(dip))


def _largest(function: Callable[[Array], Array], start: Array, end: Array) -> Array:
    """Where a function is largest between two extensions: the best place, then golden sections."""

    def by_share(share: Array) -> Array:
        return function(start + share * (end - start))

    values = by_share(np.linspace(0.0, 1.0, PLACES)[:, None, None])
    best = highest_near(by_share, values.argmax(axis=0) / (PLACES - 1))
    return np.asarray(start + best * (end - start))


def pushing(
    finger: Finger, volumes: DomeVolumes, own: Stretches, pressure: Array, place: Array
) -> PushingDomes:
    """Domes that only push, each where it goes by itself from a place, mm, (unit, batch).

    Those that push there go on to the next place at which they rest, others back to the one before.
    """
    goes_up = free_force(finger, volumes, place, pressure) < 0.0
    stretch = own.beyond(place, pressure, goes_up)
    high = rest_on(finger, volumes, own, pressure, stretch)
    before = own.top_before(stretch, pressure)
    has_top, place_of_top = before >= 0, np.maximum(before, 0)
    bottom, top = picked(own.begins, place_of_top + has_top), picked(own.ends, place_of_top)
    law = DomesAt(finger, PressureWork(pressure, volumes, finger.domes))
    low = _zero(law, np.where(has_top, bottom, 0.0), np.where(has_top, top, 0.0))
    low = np.where(has_top, low, -np.inf)
    return PushingDomes(finger, PressureWork(pressure, volumes, finger.domes), low, high)


def rest_on(
    finger: Finger, volumes: DomeVolumes, own: Stretches, pressure: Array, stretch: Indices
) -> Array:
    """Where domes rest on a stretch of theirs, mm, (unit, batch); its end beyond its pressures."""
    domes = finger.domes
    far = domes.contact + 2.0 * domes.stroke  # beyond all wells, whatever the pressure
    begin = np.maximum(picked(own.begins, stretch), -2.0 * far)
    end = np.minimum(picked(own.ends, stretch), 4.0 * far)
    return _zero(DomesAt(finger, PressureWork(pressure, volumes, domes)), begin, end)


def _zero(law: ScalarLaw, negative: Array, positive: Array) -> Array:
    """Where a force changes sign between two extensions: Newton's steps, within bisections.

    Each lane stops by itself, so that others beside it change no digit.
    """
    nearest = NEAREST * (np.abs(negative) + np.abs(positive))
    place, is_found = 0.5 * (negative + positive), np.zeros(np.shape(nearest), bool)
    for _ in range(BISECTIONS):
        _, force, stiffness = law(place)
        is_negative = force < 0.0
        negative = np.where(is_negative, place, negative)
        positive = np.where(is_negative, positive, place)
        by_newton = place - force / np.where(stiffness != 0.0, stiffness, 1.0)
        is_within = (by_newton - negative) * (by_newton - positive) <= 0.0
        onward = np.where(is_within, by_newton, 0.5 * (negative + positive))
        is_near = np.abs(onward - place) <= nearest
        place = np.where(is_found, place, onward)
        is_found |= is_near
        if is_found.all():
            break
    return place
