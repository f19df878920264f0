"""The way of one finger through a history of pressures: what happens on it, and its points."""

from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum

import numpy as np

from dpgcli.actuation.folding import folded
from dpgcli.actuation.pressed import Halt, Halted, Pressed, Shapes
from dpgcli.actuation.snaps import after
from dpgcli.actuation.staircase import EVENTS, MOST_EVENTS
from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.path import LARGEST_STEP
from dpgcli.records import dataclass

HALVINGS = 20  # of the way to where a finger folds onto itself


class EventKind(StrEnum):
    """What an event is, by the unit that gives rise to it."""

    SNAP = "snap"
    RESET = "reset"
    CONTACT = "contact"
    RELEASE = "release"


MEETINGS = {Halt.CONTACT: EventKind.CONTACT, Halt.RELEASE: EventKind.RELEASE}


@dataclass(frozen=True)
class Event:
    """Something that happened to a finger, at once.

    `units` (from 0) are those that go to another well, the one that gives rise to it first; `tied`
    are others whose threshold is the same as its. `before` and `after` are places among the points
    of the way; `released` is the energy (mJ) that is lost.
    """

    kind: EventKind
    units: tuple[int, ...]
    tied: tuple[int, ...]
    before: int
    after: int
    released: float


@dataclass(frozen=True)
class PathPoints:
    """Points of a way in their order: shapes, and where in the history they are, (point,).

    Cycles and steps count from 1; a point is on the way to its step's pressures, and has gone a
    share of that.
    """

    shapes: Shapes
    cycle: Indices
    step: Indices
    share: Array

    def __len__(self) -> int:
        return len(self.cycle)

    def take(self, index: Indices) -> "PathPoints":
        """Some of them."""
        shapes = self.shapes.take_lanes(index)
        return PathPoints(shapes, self.cycle[index], self.step[index], self.share[index])


@dataclass(frozen=True)
class Travel:
    """The way of a finger as far as it went.

    `holds` are the places of the points at which steps ended, in their order. `reason` is
    `Halt.ARRIVED`, or why it went no further than to the `pressure` (MPa, by unit). `folded` are
    the units inverted in the shape that it would snap to there, if that is what folds.
    """

    points: PathPoints
    events: tuple[Event, ...]
    holds: tuple[int, ...]
    reason: Halt
    pressure: Array
    folded: Flags | None = None

    @property
    def final(self) -> Shapes:
        """The last shape, one lane."""
        return self.points.shapes.take_lanes(np.array([len(self.points) - 1]))


def travel(
    pressed: Pressed,
    start: Shapes,
    history: Array,
    n_cycles: int = 1,
    largest_step: float = LARGEST_STEP,
) -> Travel:
    """Follow a finger from its shape at rest through pressures, (step, unit), so many times.

    Once a cycle begins in the very shape, to the last bit, in which another one began, the rest is
    known: it is what has been before.

    >>> from dpgcli.actuation.rest import at_rest
    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.pressure import DomeVolumes
    >>> from dpgcli.states.units import UnitSolutions
    >>> unit = UnitSolutions.of(uniform_finger(1, **STUDY))
    >>> pressed = Pressed(unit, DomeVolumes(np.array([[31.61]])))
    >>> rest, _ = at_rest(pressed, np.array([[False]]))
    >>> way = travel(pressed, rest, np.array([[0.0], [0.16], [-0.08]]))
    >>> [(event.kind.value, event.units) for event in way.events]
    [('snap', (0,)), ('reset', (0,))]
    """
    traveler = _Traveler(pressed, start, largest_step)
    begun: dict[bytes, int] = {}
    for cycle in range(1, n_cycles + 1):
        traveler.begin()
        period = cycle - begun.setdefault(_bits(traveler.here), cycle)
        if period:
            traveler.repeat(cycle, period)
            continue
        for step, target in enumerate(history, start=1):
            traveler.go(cycle, step, target[:, None])
            if traveler.reason is not Halt.ARRIVED:
                return traveler.travel
    return traveler.travel


def _bits(shapes: Shapes) -> bytes:
    parts = (
        *(shapes.coordinates, shapes.pressure, shapes.inverted),
        *(shapes.touching, shapes.place),
    )
    return b"".join(part.tobytes() for part in parts if part is not None)


class _Traveler:
    """A finger under way: where it is, and the points and events that lie behind it."""

    def __init__(self, pressed: Pressed, start: Shapes, largest_step: float) -> None:
        self.pressed, self.here, self.largest_step = pressed, start, largest_step
        self.reason, self.pressure = Halt.ARRIVED, start.pressure[:, 0]
        self.folded: Flags | None = None
        self.place, self.share = (1, 1), 0.0  # cycle and step; how much of it is done
        self.behind: list[PathPoints] = []
        self.n_points = 0
        self.events: list[Event] = []
        self.holds: list[int] = []
        self.marks: list[tuple[int, list[int]]] = []  # what lay behind as cycles began
        self._pass(start, np.zeros(1))

    @property
    def travel(self) -> Travel:
        """What lies behind."""
        points = joined(self.behind)
        lists = tuple(self.events), tuple(self.holds)
        return Travel(points, *lists, self.reason, self.pressure, self.folded)

    def begin(self) -> None:
        """Begin a cycle."""
        lists = self.behind, self.events, self.holds
        self.marks.append((self.n_points, [len(part) for part in lists]))

    def repeat(self, cycle: int, period: int) -> None:
        """Do what was done so many cycles ago; that ended where that one did."""
        points, starts = self.marks[cycle - 1 - period]
        _, stops = self.marks[cycle - period]
        shift = self.n_points - points
        behind, events, holds = (slice(*ends) for ends in zip(starts, stops, strict=True))
        again = [replace(part, cycle=0 * part.cycle + cycle) for part in self.behind[behind]]
        self.events += [
            replace(event, before=event.before + shift, after=event.after + shift)
            for event in self.events[events]
        ]
        self.holds += [hold + shift for hold in self.holds[holds]]
        self.behind += again
        self.n_points += sum(map(len, again))
        self.here = again[-1].shapes.take_lanes(np.array([len(again[-1]) - 1]))

    def go(self, cycle: int, step: int, target: Array) -> None:
        """Go to pressures, (unit, 1), through all that happens, or as far as that is possible."""
        self.place, self.share = (cycle, step), 0.0
        for _ in range(MOST_EVENTS * self.pressed.finger.n_units):
            halted = self._follow(target)
            if self.reason is Halt.ARRIVED:
                self.holds.append(self.n_points - 1)
            if self.reason not in EVENTS:
                return
            self._go_through(halted)
            if self.reason is not Halt.ARRIVED:
                return
        self.reason = Halt.FAILED

    def _follow(self, target: Array) -> Halted:
        """Follow the finger to where it halts next."""
        start, shares, passed = self.here, [0.0], [self.here.coordinates]

        def watch(_: Indices, coordinates: Array, share: Array) -> None:
            if share[0] > shares[-1]:  # it may stay where it was
                shares.append(float(share[0]))
                passed.append(coordinates)

        halted = self.pressed.followed(start, target, self.largest_step, watch)
        inner = [place for place, share in enumerate(shares) if 0.0 < share < halted.share[0]]
        share = np.array([shares[place] for place in inner])
        n = np.zeros(len(inner), int)
        way = replace(
            halted.shapes.take_lanes(n),
            coordinates=np.concatenate([start.coordinates[:, :0], *(passed[i] for i in inner)], 1),
            pressure=start.pressure + share * (target - start.pressure),
        )
        way = self.pressed.resting(way)
        done = self.share
        self.reason, self.pressure = Halt(halted.reason[0]), halted.shapes.pressure[:, 0]
        if self._pass(way, done + share * (1.0 - done)):
            self.share = done + float(halted.share[0]) * (1.0 - done)
            if self.reason is not Halt.FAILED:
                self._pass(halted.shapes, np.array([self.share]))
        return halted

    def _go_through(self, halted: Halted) -> None:
        """Go on from an event to what becomes of the finger there."""
        halted, shapes, ending = after(self.pressed, halted)
        self.reason = Halt(ending[0])
        if self.reason is Halt.ARRIVED:
            event = replace(self._event(halted, shapes), before=self.n_points - 1)
            self._pass(shapes, np.array([self.share]))
            self.events.append(replace(event, after=self.n_points - 1))
        elif self.reason is Halt.FOLDED:
            self.folded = shapes.inverted[:, 0]

    def _event(self, halted: Halted, after: Shapes) -> Event:
        """What happened, its points aside. Of tied units none is the first but by its number."""
        pressed, before = self.pressed, halted.shapes
        first, reason = int(halted.unit[0]), Halt(halted.reason[0])
        flipped = pressed.left(before, after)[:, 0]
        alike = sorted({first, *np.flatnonzero(halted.tied[:, 0]).tolist()})
        order = [*alike, *(unit for unit in range(len(flipped)) if unit not in alike)]
        units = tuple(unit for unit in order if flipped[unit]) or (alike[0],)
        rises = pressed.travels(after)[units[0], 0] > pressed.travels(before)[units[0], 0]
        kind = MEETINGS.get(reason, EventKind.SNAP if rises else EventKind.RESET)
        tied = tuple(unit for unit in alike if unit != units[0] and len(alike) > 1)
        released = 0.0 if reason in MEETINGS else pressed.energy(before) - pressed.energy(after)
        return Event(kind, units, tied, 0, 0, float(np.squeeze(released)))

    def _pass(self, shapes: Shapes, share: Array) -> bool:
        """Leave points behind; no further than to where the finger folds onto itself, if it does.

        Whether it does not.
        """
        if not len(share):
            return True
        is_folded = folded(self.pressed.coordinates, shapes.coordinates)
        n = int(is_folded.argmax()) if is_folded.any() else len(share)
        cycle, step = (np.full(len(share), count) for count in self.place)
        points = PathPoints(shapes, cycle, step, share).take(np.arange(n))
        self.behind.append(points)
        self.n_points += n
        if n:
            self.here = points.shapes.take_lanes(np.array([n - 1]))
        if is_folded.any():
            self.reason, self.pressure = Halt.FOLDED, self._fold(shapes.pressure[:, n : n + 1])
        return not is_folded.any()

    def _fold(self, beyond: Array) -> Array:
        """The pressures, (unit,), at which the finger begins to fold onto itself; by halving."""
        here = self.here
        for _ in range(HALVINGS):
            middle = 0.5 * (here.pressure + beyond)
            halted = self.pressed.followed(here, middle, self.largest_step)
            is_well = Halt(halted.reason[0]) is Halt.ARRIVED
            if is_well and not folded(self.pressed.coordinates, halted.shapes.coordinates)[0]:
                here = halted.shapes
            else:
                beyond = middle
        return beyond[:, 0]


def joined(parts: Sequence[PathPoints]) -> PathPoints:
    """Points one after the other."""
    touching = [part.shapes.touching for part in parts if part.shapes.touching is not None]
    place = [part.shapes.place for part in parts if part.shapes.place is not None]
    shapes = Shapes(
        np.concatenate([part.shapes.coordinates for part in parts], axis=1),
        np.concatenate([part.shapes.pressure for part in parts], axis=1),
        np.concatenate([part.shapes.inverted for part in parts], axis=1),
        np.concatenate(touching, axis=1) if touching else None,
        np.concatenate(place, axis=1) if place else None,
    )
    return PathPoints(
        shapes,
        np.concatenate([part.cycle for part in parts]),
        np.concatenate([part.step for part in parts]),
        np.concatenate([part.share for part in parts]),
    )
