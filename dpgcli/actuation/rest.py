"""Fingers at rest, before any pressure: the stable states that ways begin at and end in."""

import numpy as np

from dpgcli.actuation.pressed import Pressed, Shapes
from dpgcli.arrays import Flags
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Settled, Status
from dpgcli.states.settle import settle

SAME_SHAPE = 1e-6  # of the largest change of a coordinate in one step: far above any rounding


def at_rest(pressed: Pressed, inverted: Flags) -> tuple[Shapes, Settled]:
    """Shapes of patterns, (unit, batch), without pressure, and what certifies them.

    Only those whose status is stable are states; others begin no way.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.pressure import DomeVolumes
    >>> from dpgcli.states.units import UnitSolutions
    >>> units = UnitSolutions.of(uniform_finger(2, **STUDY))
    >>> pressed = Pressed(units, DomeVolumes(np.array([[31.61]])))
    >>> shapes, settled = at_rest(pressed, np.array([[True], [False]]))
    >>> shapes.pressure.tolist(), settled.status.tolist()
    ([[0.0], [0.0]], [0])
    """
    settled = settle(pressed.units, chain_potential, inverted, DEFAULT_TOLERANCE)
    coordinates = settled.equilibrium.coordinates
    touching, finger = None if pressed.limits is None else inverted.copy(), pressed.finger
    if touching is not None and finger.is_loaded:  # a gap may be open further than a dome reaches
        touching &= pressed.extensions(coordinates) <= finger.law.touching(finger.domes).highest
    return Shapes(coordinates, np.zeros(inverted.shape), inverted.copy(), touching), settled


def is_certified(pressed: Pressed, shapes: Shapes) -> Flags:
    """Which shapes without pressure are the certified stable states of their patterns, (batch,)."""
    rest, settled = at_rest(pressed, shapes.inverted)
    return np.asarray((settled.status == Status.STABLE) & is_same(pressed, shapes, rest))


def is_same(pressed: Pressed, shapes: Shapes, others: Shapes) -> Flags:
    """Which shapes are the same as others, (batch,)."""
    away = np.abs(shapes.coordinates - others.coordinates)
    return np.asarray((away <= SAME_SHAPE * pressed.coordinates.step_cap).all(axis=0))
