"""Cascades: units that have lost their places go one by one, so slowly that no step counts.

One goes, kept by a spring whose end moves on with it, while all others are at rest beside it. Where
one of these loses its balance, at a fold, it goes next, and the first waits where it is. Each goes
to where its spring is slack; the energy falls all the way. So folds decide what goes along, and
these are found to the last digits, however long the steps are between them.
"""

from dataclasses import replace
from typing import Self

import numpy as np

from dpgcli.actuation.pressed import DISPLACED, LARGEST_RESIDUAL, TOLERANCE, Pressed
from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.contracts import Measured, ScalarLaw, WideMeasured, take_lanes
from dpgcli.equilibrium.loaded import Holding
from dpgcli.equilibrium.newton import minimize
from dpgcli.equilibrium.path import LARGEST_STEP, Ends, follow
from dpgcli.equilibrium.walk import PathEnd
from dpgcli.records import dataclass

FURTHEST = 10.0  # strokes: no unit goes as far
SHORTER = 0.1  # of a step, where curves bend often: no well of theirs is stepped over
MOST_TURNS = 16  # for each unit: how often one goes on


@dataclass(frozen=True)
class HeldDomes:
    """Domes under fixed pressures, some kept where they are by springs, (unit, batch).

    `place` (mm) are the ends of the springs; their `stiffness` is 0 where there is none. That of
    the unit that is `going` moves by the load, mm, in the direction `sign` (batch,). `force_scale`
    (N) are the forces in play.
    """

    law: ScalarLaw
    stiffness: Array
    place: Array
    going: Flags
    sign: Array
    force_scale: Array
    is_smooth: bool = True  # a bend so short that a step leads over it changes no end

    def at(self, load: Array) -> Holding:
        """The law once the spring has moved so far."""
        return Holding(self.law, self.stiffness, self.place + self.going * load)

    def rate(self, scalar: Array, load: Array) -> Array:
        """Minus the stiffness of the spring that moves."""
        return np.asarray(-self.stiffness * self.going)

    def margin(self, measured: Measured | WideMeasured, load: Array) -> Array:
        """What the unit that goes pulls at its spring with, over the forces in play."""
        pull = self.stiffness * (measured.value - self.place - load) / self.force_scale
        return np.where(self.going, self.sign * pull, np.inf)

    def take_lanes(self, index: Indices) -> Self:
        """The same law for some lanes of the batch."""
        return replace(
            self,
            law=self.law.take_lanes(index),
            stiffness=take_lanes(self.stiffness, index),
            place=take_lanes(self.place, index),
            going=take_lanes(self.going, index),
            sign=take_lanes(self.sign, index),
            force_scale=take_lanes(self.force_scale, index),
        )


def let_go(pressed: Pressed, law: ScalarLaw, start: Array, gone: Flags) -> Array:
    """Where fingers are, (size, batch), once their units `gone` (unit, batch) have been let go.

    `law` is that of their domes. Those without a way to rest stay where they start.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.pressure import DomeVolumes
    >>> from dpgcli.states.units import UnitSolutions
    >>> unit = UnitSolutions.of(uniform_finger(1, **STUDY))
    >>> pressed = Pressed(unit, DomeVolumes(np.array([[31.61]])))
    >>> law = pressed.domes(np.zeros((1, 1)))
    >>> beyond = np.full((2, 1), 0.1)  # rad, corners: the unit is open by 2.15 mm
    >>> there = let_go(pressed, law, beyond, np.ones((1, 1), bool))
    >>> print(pressed.extensions(there).round(6))  # mm, its inverted well
    [[3.245015]]
    """
    cascade = _Cascade(pressed, law, start, gone)
    for _ in range(MOST_TURNS * pressed.finger.n_units):
        if not cascade.turn():
            break
    is_at_rest = ~cascade.order.any(axis=0)
    return np.where(is_at_rest, cascade.coordinates, start)


class _Cascade:
    """Fingers whose units go: where they are, and in which `order` units came, 0 for those at rest.

    The one that came last goes. `place` are the ends of the springs, mm.
    """

    def __init__(self, pressed: Pressed, law: ScalarLaw, start: Array, gone: Flags) -> None:
        self.pressed, self.law = pressed, law
        self.coordinates, self.place = start.copy(), pressed.extensions(start)
        self.order = np.cumsum(gone, axis=0) * gone
        self.lanes = np.arange(start.shape[1])  # under way

    def turn(self) -> bool:
        """Let the last units go on, to rest or to where others lose their balance; if any do."""
        self.lanes = self.lanes[self.order[:, self.lanes].any(axis=0)]
        if not len(self.lanes):
            return False
        own, load = self.pressed.take_lanes(self.lanes), np.zeros(len(self.lanes))
        unit, each = self.order[:, self.lanes].argmax(axis=0), np.arange(len(self.lanes))
        law = self._held(own, unit)
        held = own.loaded(law).at(load)
        start = minimize(held, self.coordinates[:, self.lanes], TOLERANCE).coordinates
        pull = law.margin(own.coordinates.dome(start), load)[unit, each]
        sign = np.where(np.abs(pull) > LARGEST_RESIDUAL, np.sign(pull), 0.0)
        end = sign * FURTHEST * np.broadcast_to(own.finger.stroke, law.place.shape)[unit, each]
        step = LARGEST_STEP * (1.0 if own.finger.law.curve is None else SHORTER)
        ends = follow(own.loaded(replace(law, sign=sign)), start, load, end, step)
        self._go_on(own, unit, ends, sign == 0.0)
        return True

    def _held(self, own: Pressed, unit: Indices) -> HeldDomes:
        """The law of the domes of the lanes under way, of which this unit goes."""
        order = self.order[:, self.lanes]
        return HeldDomes(
            self.law.take_lanes(self.lanes),
            np.where(order > 0, own.units.holding_stiffness, 0.0),
            self.place[:, self.lanes],
            np.arange(len(order))[:, None] == unit,
            np.ones(len(unit)),
            np.broadcast_to(own.finger.force_scale, order.shape),
        )

    def _go_on(self, own: Pressed, unit: Indices, ends: Ends, is_slack: Flags) -> None:
        """Go on from the ends of paths: a unit is at rest, or another one goes next."""
        lanes, is_fold = self.lanes, ends.outcome == PathEnd.FOLD
        is_at_rest = is_slack | (ends.outcome == PathEnd.EVENT)
        beyond = ends.coordinates + np.where(is_fold, DISPLACED * ends.onward, 0.0)
        self.coordinates[:, lanes] = beyond
        self.place[unit, lanes] += ends.load
        self.order[unit[is_at_rest], lanes[is_at_rest]] = 0
        cell, folds = ends.cell[is_fold], lanes[is_fold]
        self.place[cell, folds] = own.extensions(beyond)[cell, np.flatnonzero(is_fold)]
        self.order[cell, folds] = self.order[:, folds].max(axis=0) + 1
        self.lanes = lanes[is_fold | is_at_rest]
