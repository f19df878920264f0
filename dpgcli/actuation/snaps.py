"""Snaps: what becomes of fingers where a unit, or a dome that is apart, has lost its place.

They go downhill at that pressure to the next minimum. Newton's steps lead there where the unit goes
alone; where they take others along, or others are near to losing their balance, they may be too
long to tell, and the units are let go slowly instead (`cascades`).
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dpgcli.actuation.cascades import let_go
from dpgcli.actuation.domes import PushingDomes
from dpgcli.actuation.folding import folded
from dpgcli.actuation.pressed import (
    DISPLACED,
    LARGEST_RESIDUAL,
    TIE,
    TOLERANCE,
    Halt,
    Halted,
    Pressed,
    Shapes,
)
from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.newton import minimize

SHORT_STEP = 0.25  # of the step cap, a twentieth of a stroke: no well is stepped over
AHEAD = 20.0  # times as far from folds: by Newton's steps that would take seven of them
NEAR_FOLD = 0.005  # of the stiffness in play; within `TIE` of a fold 0.002 or less is left


class SnapOutcome(NamedTuple):
    """Where fingers halted, with all that is tied there, what they become, and `Halt` codes.

    They have come to rest (`ARRIVED`), fold onto themselves or have no rest.
    """

    halted: Halted
    shapes: Shapes
    ending: Indices


class _Rest(NamedTuple):
    """Minima, the stiffness left there, (batch,), and which are minima."""

    shapes: Shapes
    curvature: Array
    is_there: Flags

    def put(self, lanes: Indices, others: "_Rest", taken: Indices) -> None:
        """Replace some lanes by those at `taken` of others."""
        self.shapes.put(lanes, others.shapes.take_lanes(taken))
        self.curvature[lanes] = others.curvature[taken]
        self.is_there[lanes] = others.is_there[taken]


def after(pressed: Pressed, halted: Halted) -> SnapOutcome:
    """What becomes of shapes that halted, at their pressures.

    Domes that meet or leave their neighbors change nothing else; one that leaves where it cannot
    rest goes back by itself.
    """
    shapes, n = halted.shapes, len(halted.unit)
    is_first = np.arange(pressed.finger.n_units)[:, None] == halted.unit
    meets = (halted.reason == Halt.CONTACT) | (halted.reason == Halt.RELEASE)
    touching = shapes.touching
    if touching is not None:
        touching = touching ^ (is_first & meets)
    falls = np.flatnonzero((halted.reason == Halt.FOLD) | (halted.reason == Halt.ALONE))
    moved = replace(shapes.take_lanes(np.arange(n)), touching=touching)
    if touching is not None:
        moved = _left(pressed, moved, shapes.touching & ~touching)
    ending, tied = np.full(n, Halt.ARRIVED), halted.tied.copy()
    if len(falls):
        alone = (halted.reason == Halt.ALONE) & (is_first | halted.tied)
        start = replace(moved, coordinates=halted.start)
        if shapes.place is not None:
            start = replace(start, place=pressed.lost(shapes, alone))
        own, few = pressed.take_lanes(falls), halted.take_lanes(falls)
        rest, undecided = _decided(own, few, start.take_lanes(falls))
        is_folded = folded(own.coordinates, rest.shapes.coordinates)
        ending[falls] = np.where(is_folded, Halt.FOLDED, Halt.ARRIVED)
        ending[falls[~rest.is_there]] = Halt.FAILED
        tied[:, falls] |= undecided
        moved.put(falls, rest.shapes)
    return SnapOutcome(replace(halted, tied=tied), moved, ending)


def _left(pressed: Pressed, shapes: Shapes, leave: Flags) -> Shapes:
    """Shapes of which some domes leave their neighbors: where these cannot rest they fall back."""
    assert shapes.place is not None, "given beside touching"
    extension = pressed.extensions(shapes.coordinates)
    place = np.where(leave, pressed.fallen_back(extension, shapes.pressure), shapes.place)
    held = replace(shapes, place=np.where(leave, extension, place))
    inverted = _inverted(pressed, held, place, shapes.touching)
    return replace(shapes, inverted=np.where(leave, inverted, shapes.inverted), place=place)


def _inverted(pressed: Pressed, before: Shapes, place: Array, touching: Flags | None) -> Flags:
    """Which domes are inverted that went from shapes to places, mm, (unit, batch).

    One that has left its neighbor and kept its stretch is what it was, however far it withdraws.
    """
    is_beyond, own = place > pressed.units.wells.spring_barrier, pressed.stretches
    if own is None or touching is None:
        return np.asarray(is_beyond)
    keeps = ~touching & (own.of(pressed.places(before)) == own.of(place))
    return np.asarray(is_beyond | (keeps & before.inverted))


def _decided(pressed: Pressed, halted: Halted, start: Shapes) -> tuple[_Rest, Flags]:
    """Minima downhill, and units of which the model does not say if they go along, (unit, batch).

    Those that go at pressures larger by `TIE`, or smaller, and not at the others.
    """
    units = np.arange(pressed.finger.n_units)[:, None]
    ahead = replace(start, coordinates=_ahead(halted, start.coordinates))
    rest = _relaxed(pressed, halted.shapes, ahead, np.zeros(halted.tied.shape, bool))
    left = pressed.left(halted.shapes, rest.shapes)
    others = left & ~halted.tied & (units != halted.unit)
    is_clear = rest.is_there & ~others.any(axis=0) & (rest.curvature >= NEAR_FOLD)
    doubtful, undecided = np.flatnonzero(~is_clear), np.zeros(halted.tied.shape, bool)
    if len(doubtful):
        n, three = len(doubtful), np.tile(doubtful, 3)
        begin = start.take_lanes(three)
        pressure = begin.pressure * (1.0 + TIE * np.array([0.0, 1.0, -1.0]).repeat(n))
        is_alone = halted.reason == Halt.ALONE
        gone = ((units == halted.unit) | (halted.tied & is_alone))[:, three]
        own, before = pressed.take_lanes(three), halted.shapes.take_lanes(three)
        again = _relaxed(own, before, replace(begin, pressure=pressure), gone)
        own, here = pressed.take_lanes(doubtful), again.shapes.take_lanes(np.arange(n))
        for side in (1, 2):
            others_there = again.shapes.take_lanes(side * n + np.arange(n))
            undecided[:, doubtful] |= own.left(here, others_there)
        rest.put(doubtful, again, np.arange(n))
    return rest, undecided & (units != halted.unit)


def _ahead(halted: Halted, start: Array) -> Array:
    """Further along the way on from folds, where no other unit leaves its place there."""
    from_fold = np.where(halted.tied.any(axis=0), 0.0, start - halted.shapes.coordinates)
    return np.asarray(start + (AHEAD - 1.0) * from_fold)


def _relaxed(pressed: Pressed, before: Shapes, shapes: Shapes, gone: Flags) -> _Rest:
    """Go downhill from shapes at their pressures to the next minima, units that are `gone` slowly.

    What is inverted is told by the shapes `before`. Domes that only push and are pushed out of
    their places fall back to the wells before, and the others go on.
    """
    start, slowly, step = pressed.places(shapes), gone.any(axis=0), _downhill_step(pressed)
    n_wells = 1 if pressed.stretches is None else len(pressed.stretches.begins)
    law, begin = pressed.domes(shapes.pressure, start), shapes.coordinates
    for _ in range(pressed.finger.n_units * n_wells + 1):
        coordinates = let_go(pressed, law, begin, gone)
        there = minimize(pressed.with_domes(law), coordinates, TOLERANCE, largest_step=step)
        coordinates = there.coordinates
        extension = place = pressed.extensions(coordinates)
        if not isinstance(law, PushingDomes):
            break
        place, fallen = np.minimum(extension, law.high), extension <= law.low
        if not fallen.any():
            break
        beyond = law.low - DISPLACED * pressed.finger.stroke
        law = pressed.domes(shapes.pressure, np.where(fallen, beyond, place))
        assert isinstance(law, PushingDomes), "as before"
        again = (fallen & (extension <= law.low)).any(axis=0)  # over another top, without a push
        start = np.where(fallen, beyond, np.where(again, start, place))
        begin = np.where(again, shapes.coordinates, coordinates)
        gone = np.where(again, gone | fallen, fallen) & slowly
        if again.any():
            law = pressed.domes(shapes.pressure, start)
    is_there = (there.relative_residual <= LARGEST_RESIDUAL) & (there.curvature > 0.0)
    touching = law.touches(extension) if isinstance(law, PushingDomes) else None
    inverted = _inverted(pressed, before, place, touching)
    found = replace(shapes, coordinates=coordinates, inverted=inverted, touching=touching)
    if touching is not None:
        found = replace(found, place=place)
    return _Rest(found, there.curvature, np.asarray(is_there))


def _downhill_step(pressed: Pressed) -> float:
    """Of the step cap: shorter where curves bend often, or barriers end where domes let go."""
    is_plain = pressed.stretches is None and pressed.finger.law.curve is None
    return 1.0 if is_plain else SHORT_STEP
