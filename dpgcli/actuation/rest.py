"""Fingers at rest, before any pressure: the stable states that ways begin at and end in."""

from dataclasses import replace

import numpy as np

from dpgcli.actuation.domes import PushingDomes
from dpgcli.actuation.pressed import Pressed, Shapes
from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Settled, Status
from dpgcli.states.settle import settle

CLOSED = 1e-6  # of a stroke: far above any rounding
SAME_SHAPE = 1e-6  # of the largest change of a coordinate in one step: far above any rounding


def at_rest(pressed: Pressed, inverted: Flags) -> tuple[Shapes, Settled]:
    """Shapes of patterns, (unit, batch), without pressure, and what certifies them.

    Only those whose status is stable are states; others begin no way. Domes that only push do not
    act in units that are not inverted, whatever their gaps do: stable states leave them out. Under
    pressure they act, and rest where their own energy says. A state with a gap closed beyond that
    is one of the first model and none of the second: `GAP_CLOSED`. It takes loads that close gaps,
    or hinges that turn each other the other way (κ < 0), and a dome whose energy is not a curve by
    its own travel.

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
    shapes = Shapes(coordinates, np.zeros(inverted.shape), inverted.copy())
    if pressed.stretches is not None:
        shapes = _with_places(pressed, shapes)
        extension = pressed.extensions(shapes.coordinates)
        closed = are_closed(pressed.finger, extension, shapes.inverted).any(axis=0)
        is_closed = (settled.status == Status.STABLE) & closed
        status = np.where(is_closed, Status.GAP_CLOSED, settled.status).astype(np.uint8)
        settled = replace(settled, status=status)
    return shapes, settled


def _with_places(pressed: Pressed, shapes: Shapes) -> Shapes:
    """Shapes without pressure whose inverted domes touch, where gaps are no wider than they reach.

    Loads may open them further. All other domes rest in wells of their own.
    """
    finger = pressed.finger
    extension = pressed.extensions(shapes.coordinates)
    highest = finger.law.touching(finger.domes).highest
    touching = shapes.inverted & (extension <= highest) if finger.is_loaded else shapes.inverted
    place = own_places(pressed, extension, shapes.inverted)
    return replace(shapes, touching=touching.copy(), place=place)


def own_places(pressed: Pressed, extension: Array, inverted: Flags) -> Array:
    """Where domes that only push rest by themselves without pressure, mm, (unit, batch).

    Inverted ones go on to there from the extensions of their units.
    """
    finger = pressed.finger
    highest = finger.law.touching(finger.domes).highest
    begin = np.where(inverted, np.minimum(extension, highest), -finger.domes.contact)
    law = pressed.domes(np.zeros(inverted.shape), begin)
    assert isinstance(law, PushingDomes), "others have no places"
    return law.high


def are_closed(finger: Finger, extension: Array, inverted: Flags) -> Flags:
    """Gaps that are closed beyond the places of domes at rest, (…, unit, batch)."""
    place: Array = -finger.domes.contact - CLOSED * finger.stroke
    return np.asarray(~inverted & (extension < place))


def is_certified(pressed: Pressed, shapes: Shapes) -> Flags:
    """Which shapes without pressure are the certified stable states of their patterns, (batch,)."""
    rest, settled = at_rest(pressed, shapes.inverted)
    return np.asarray((settled.status == Status.STABLE) & is_same(pressed, shapes, rest))


def is_same(pressed: Pressed, shapes: Shapes, others: Shapes) -> Flags:
    """Which shapes are the same as others, (batch,)."""
    away = np.abs(shapes.coordinates - others.coordinates)
    return np.asarray((away <= SAME_SHAPE * pressed.coordinates.step_cap).all(axis=0))
