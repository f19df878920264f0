"""Domes by themselves beside bodies: how ways under pressure begin, change contacts and end.

Such domes are those that only push, as long as pressures change; see `contact`.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dpgcli.actuation.domes import in_touch
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.rest import are_closed, own_places
from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.beginning import NO_RATE, about_to_act
from dpgcli.equilibrium.corrector import corrected
from dpgcli.equilibrium.loaded import along
from dpgcli.equilibrium.path import Ends
from dpgcli.equilibrium.walk import AWAY, PathEnd
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.descent import finished
from dpgcli.grasping.shapes import ContactShapes, with_lost
from dpgcli.mechanics.laws import PushOnly
from dpgcli.mechanics.pressure import PressureWork
from dpgcli.states.certify import Status


def with_travels(own: Obstructed, shapes: ContactShapes) -> ContactShapes:
    """Shapes without pressure as those of domes by themselves, where these have coordinates.

    Inverted domes touch neighbors that are no further away than they reach; others are at rest.
    """
    if not own.n_travels:
        return shapes
    assert own.ramp is not None, "domes have coordinates while pressures change"
    finger, pressed = own.units.finger, Pressed(own.units, own.ramp.volumes)
    extension, inverted = _extensions(own, shapes), _by_finger(own, shapes.inverted)
    fingers = zip(extension, inverted, strict=True)
    rest = np.stack([own_places(pressed, *of_finger) for of_finger in fingers])
    place = np.minimum(rest, extension)
    push = -finger.law.pulling.response(place, finger.domes).force
    push = np.where(extension < rest, push, 0.0).reshape(shapes.inverted.shape)
    coordinates = np.concatenate((shapes.coordinates, place.reshape(push.shape)))
    pushes, begin = np.concatenate((shapes.push, push)), np.zeros(len(shapes.is_there))
    found = finished(own, coordinates, shapes.inverted, pushes, begin)
    is_there = found.is_there & shapes.is_there & ~have_closed(own, shapes)
    return replace(found, is_there=is_there)


def without_travels(own: Obstructed, shapes: ContactShapes) -> ContactShapes:
    """Shapes without pressure as those of states, in which only inverted domes act.

    Where another one does, in a gap that is closed beyond its place, there is none.
    """
    if not own.n_travels:
        return shapes
    cells, size = slice(own.n_gaps), len(shapes.coordinates) - own.n_travels
    inverted = own.is_open(shapes)
    found = ContactShapes(
        shapes.coordinates[:size],
        shapes.push[cells],
        shapes.active[cells],
        inverted,
        shapes.is_there,
    )
    return replace(found, is_there=found.is_there & ~have_closed(own, found))


def have_closed(own: Obstructed, shapes: ContactShapes) -> Flags:
    """Shapes with a gap that is closed beyond the place of its dome, which is at rest, (batch,)."""
    inverted = _by_finger(own, shapes.inverted)
    closed = are_closed(own.units.finger, _extensions(own, shapes), inverted)
    return np.asarray(closed.any(axis=(0, 1)))


def with_reasons(
    own: Obstructed, shapes: ContactShapes, status: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Statuses, (batch,), of which those that are stable and lost as pressures change say why."""
    known = with_lost(status, shapes.is_there)
    if not isinstance(own.units.finger.law, PushOnly):
        return known
    have_lost = (known != status) & have_closed(own, shapes)
    return np.where(have_lost, np.uint8(Status.GAP_CLOSED), known)


def about_to_change(own: Obstructed, shapes: ContactShapes, load: Array) -> ContactShapes:
    """Shapes with the contacts that are closed as their loads begin to rise."""
    family = own.family(shapes.inverted, shapes.active)
    margin = family.law.margin(family.measure(own.stacked(shapes)), load)

    def are_wrong(lanes: Indices, active: Flags) -> Flags:
        few = replace(shapes.take_lanes(lanes), active=active)
        return _are_wrong(own.take_lanes(lanes), few, load[lanes])

    is_level = (np.abs(margin) <= AWAY) & shapes.is_there
    active = about_to_act(shapes.active, is_level, are_wrong)
    return replace(shapes, active=active, push=np.where(active, shapes.push, 0.0))


def _are_wrong(own: Obstructed, shapes: ContactShapes, load: Array) -> Flags:
    """Contacts whose pushes would become pulls, or whose gaps penetrations, (cell, batch).

    None where the fingers lose their balance with these closed: that is for their paths to tell.
    """
    family = own.family(shapes.inverted, shapes.active)
    none, depth = np.full(len(load), -1), max(family.column_depths)
    here = corrected(family, own.stacked(shapes), load, none, 0.0 * load, depth)
    rate = along(family.measure.rows, here.loaded, here.along_load) - family.law.depth
    least = NO_RATE * np.abs(rate).max(axis=0)
    is_wrong = np.where(shapes.active, rate > least, rate < -least)
    return np.asarray(is_wrong & here.is_fine)


def with_lost_domes(own: Obstructed, before: ContactShapes, ends: Ends) -> Ends:
    """The ends of paths: domes that leave their neighbors where they cannot rest are at folds.

    They go back by themselves.
    """
    if not own.n_travels:
        return ends
    assert own.ramp is not None, "domes have coordinates while pressures change"
    finger, lanes = own.units.finger, np.arange(len(ends.cell))
    pressure = own.ramp.begin + ends.load * own.ramp.change
    work = PressureWork(pressure, own.ramp.volumes, finger.domes)
    place = np.stack([travel(ends.coordinates).value for travel in own.travels])
    stiffness = in_touch(finger, work, place).stiffness.reshape(own.n_travels, -1)
    unit = ends.cell - own.n_gaps
    is_dome = (unit >= 0) & (unit < own.n_travels) & (ends.outcome == PathEnd.EVENT)
    leaves = is_dome & before.active[ends.cell, lanes]
    lost = np.flatnonzero(leaves & (stiffness[np.where(is_dome, unit, 0), lanes] <= 0.0))
    if not len(lost):
        return ends
    outcome, cell, onward = ends.outcome.copy(), ends.cell.copy(), ends.onward.copy()
    outcome[lost], cell[lost], onward[:, lost] = PathEnd.FOLD, unit[lost], 0.0
    stroke = np.broadcast_to(finger.stroke, place.shape).reshape(own.n_travels, -1)
    row = own.travels[0].row.offset + unit[lost]
    onward[row, lost] = -stroke[unit[lost], lost]
    return replace(ends, outcome=outcome, cell=cell, onward=onward)


def _by_finger(own: Obstructed, values: Flags) -> Flags:
    """Values by unit, (unit, batch), as those of each finger, (finger, unit, batch)."""
    return values.reshape(own.n_fingers, -1, values.shape[1])


def _extensions(own: Obstructed, shapes: ContactShapes) -> Array:
    """Extensions of the domes' springs, as their neighbors are, mm, (finger, unit, batch)."""
    alone = own.formulate(own.units.finger).coordinates
    fingers = (own.of_finger(shapes.coordinates, finger) for finger in range(own.n_fingers))
    return np.stack([alone.dome(finger).value for finger in fingers])
