"""What fingers go through as pressures change, event by event, and what is left after release."""

from dataclasses import replace

import numpy as np

from dpgcli.actuation.pressed import Halt, Halted, Pressed, Shapes
from dpgcli.actuation.snaps import after
from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.path import LARGEST_STEP
from dpgcli.records import dataclass

EVENTS = (Halt.FOLD, Halt.ALONE, Halt.CONTACT, Halt.RELEASE)
JUMPS = (Halt.FOLD, Halt.ALONE)
UNKNOWN = (Halt.FAILED, Halt.CONTACT, Halt.RELEASE)  # nobody knows how these ways go on
MOST_EVENTS = 64  # for each unit, on one way: curves with many bends have many


@dataclass(frozen=True)
class Events:
    """Events of some lanes, one each, at the same count on their ways.

    `lanes` are places in the batch; `halted` is where each stopped, `after` the shape that it took
    at the same pressure. `is_fine` is false where no equilibrium was found after it.
    """

    lanes: Indices
    halted: Halted
    after: Shapes
    is_fine: Flags

    def take(self, which: Indices) -> "Events":
        """Some of them."""
        return Events(
            self.lanes[which],
            self.halted.take_lanes(which),
            self.after.take_lanes(which),
            self.is_fine[which],
        )

    @property
    def flipped(self) -> Flags:
        """Units that the event inverts or resets, (unit, event)."""
        return np.asarray(self.halted.shapes.inverted ^ self.after.inverted)

    @property
    def are_jumps(self) -> Flags:
        """Those that take a unit to another well, (event,), where it may flip or not.

        A curve with ripples has wells of one digit side by side.
        """
        return np.asarray(np.isin(self.halted.reason, JUMPS) | self.flipped.any(axis=0))


@dataclass(frozen=True)
class Way:
    """The way of some fingers to other pressures: where it ended, why, and the events on it.

    `reason` is `Halt.ARRIVED`, or what the way ended with before.
    """

    shapes: Shapes
    reason: Indices
    events: tuple[Events, ...]


class Journey:
    """Fingers on their ways to other pressures, (unit, batch), each at its own event.

    `ending` are the shapes where they are, `reason` why they halted there last: `Halt` codes.
    """

    def __init__(
        self, pressed: Pressed, shapes: Shapes, target: Array, largest_step: float = LARGEST_STEP
    ) -> None:
        self.ending = _copied(shapes)
        self.reason = np.full(shapes.inverted.shape[1], Halt.FAILED)
        self._own, self._target, self._largest_step = pressed, target, largest_step
        self._lanes, self._shapes = np.arange(len(self.reason)), self.ending

    def next_events(self) -> tuple[Pressed, Events] | None:
        """Follow all to their next events, and past these; None where none has any more."""
        if not len(self._lanes):
            return None
        own, lanes = self._own, self._lanes
        halted = own.followed(self._shapes, self._target[:, lanes], self._largest_step)
        self.reason[lanes] = halted.reason
        self.ending.put(lanes, halted.shapes)
        met = np.flatnonzero(np.isin(halted.reason, EVENTS))
        if not len(met):
            return None
        own, halted, lanes = own.take_lanes(met), halted.take_lanes(met), lanes[met]
        halted, shapes, ending = after(own, halted)
        is_fine = ending == Halt.ARRIVED
        self.reason[lanes] = np.where(is_fine, halted.reason, ending)
        self.ending.put(lanes, shapes)
        self._own, self._lanes, self._shapes = own, lanes, shapes
        self.go_on(is_fine)
        return own, Events(lanes, halted, shapes, is_fine)

    def go_on(self, which: Flags) -> None:
        """Leave all others where they are, by the lanes of the last events or of what is left."""
        kept = np.flatnonzero(which)
        self._own, self._shapes = self._own.take_lanes(kept), self._shapes.take_lanes(kept)
        self._lanes = self._lanes[kept]


def driven(
    pressed: Pressed, shapes: Shapes, target: Array, largest_step: float = LARGEST_STEP
) -> Way:
    """Change the pressures of shapes to others, (unit, batch), through all that happens.

    Each lane has its own events; one that folds onto itself, or of which no equilibrium is found,
    stays there.
    """
    journey = Journey(pressed, shapes, target, largest_step)
    rounds: list[Events] = []
    for _ in range(MOST_EVENTS * pressed.finger.n_units):
        found = journey.next_events()
        if found is None:
            break
        rounds.append(found[1])
    return Way(journey.ending, journey.reason, tuple(rounds))


def released(pressed: Pressed, shapes: Shapes, largest_step: float = LARGEST_STEP) -> Way:
    """Let all pressures go back to zero."""
    return driven(pressed, shapes, np.zeros(shapes.inverted.shape), largest_step)


@dataclass(frozen=True)
class Stair:
    """A step of a staircase: events in which units jump, and what is left after release.

    `rest` are the shapes without pressure; `is_fine` says where there is one.
    """

    events: Events
    rest: Shapes
    is_fine: Flags

    def take(self, which: Indices) -> "Stair":
        """Some of the events."""
        return Stair(self.events.take(which), self.rest.take_lanes(which), self.is_fine[which])


def staircase(
    pressed: Pressed,
    shapes: Shapes,
    target: Array,
    n_stairs: int | None = None,
    largest_step: float = LARGEST_STEP,
) -> tuple[tuple[Stair, ...], Way]:
    """Raise pressures to `target`, (unit, batch), and let them go after each jump on the way.

    Each lane stops after `n_stairs` flips, if that is given. The way is that without release.
    """
    journey = Journey(pressed, shapes, target, largest_step)
    flips = np.zeros(len(journey.reason), int)
    rounds: list[Events] = []
    stairs: list[Stair] = []
    for _ in range(MOST_EVENTS * pressed.finger.n_units):
        found = journey.next_events()
        if found is None:
            break
        own, events = found
        rounds.append(events)
        which = np.flatnonzero(events.are_jumps & events.is_fine)
        if len(which):
            few = events.take(which)
            way = released(own.take_lanes(which), few.after, largest_step)
            stairs.append(Stair(few, way.shapes, way.reason == Halt.ARRIVED))
        flips[events.lanes] += events.flipped.any(axis=0) & events.is_fine
        if n_stairs is not None:
            journey.go_on(flips[events.lanes[events.is_fine]] < n_stairs)
    return tuple(stairs), Way(journey.ending, journey.reason, tuple(rounds))


def _copied(shapes: Shapes) -> Shapes:
    whole = replace(shapes, pressure=shapes.pressure + np.zeros(shapes.inverted.shape))
    return whole.take_lanes(np.arange(shapes.inverted.shape[1]))
