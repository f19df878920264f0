"""The unstable branches between the stable ones of a way: each beyond the fold of an event."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.travel import MEETINGS, Event, PathPoints, Travel
from dpgcli.arrays import Indices
from dpgcli.equilibrium.beyond import beyond

NEAREST, BESIDE, FURTHEST = 0.01, 0.05, 0.3  # of a stroke: from a fold to where its branch begins


def branches(pressed: Pressed, way: Travel) -> Mapping[int, PathPoints]:
    """The unstable branches beyond folds, by the number of the event, each fold once.

    Domes that lose their places while they are apart leave the finger as it is, and have none.

    >>> from dpgcli.actuation.rest import at_rest
    >>> from dpgcli.actuation.travel import travel
    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.pressure import DomeVolumes
    >>> from dpgcli.states.units import UnitSolutions
    >>> unit = UnitSolutions.of(uniform_finger(1, **STUDY))
    >>> pressed = Pressed(unit, DomeVolumes(np.array([[31.61]])))
    >>> rest, _ = at_rest(pressed, np.array([[False]]))
    >>> way = travel(pressed, rest, np.array([[0.0], [0.16]]), largest_step=0.05)
    >>> pressure = branches(pressed, way)[1].shapes.pressure[0]  # from the snap to the reset
    >>> pressure[[0, -1]].round(3).tolist()
    [0.148, -0.065]
    """
    known: set[bytes] = set()
    found = {}
    for number, event in enumerate(way.events, start=1):
        fold = way.points.shapes.coordinates[:, event.before].tobytes()
        if fold in known or event.kind in MEETINGS.values():
            continue
        known.add(fold)
        branch = _branch(pressed, way.points, event)
        if branch is not None:
            found[number] = branch
    return found


def _branch(pressed: Pressed, points: PathPoints, event: Event) -> PathPoints | None:
    """The branch beyond the fold of an event, if there is one."""
    unit, fold = event.units[0], points.take(np.array([event.before]))
    touching = fold.shapes.touching
    if touching is not None and not touching[unit, 0]:
        return None
    start = _beside(pressed, points, event)
    if not len(start):
        return None
    before = points.take(start)
    family = pressed.family(before.shapes, fold.shapes.pressure)
    value = float(pressed.extensions(fold.shapes.coordinates)[unit, 0])
    branch = beyond(family, before.shapes.coordinates, np.zeros(1), unit, value)
    if not len(branch.load):
        return None
    pressure = before.shapes.pressure
    pressure = pressure + branch.load * (fold.shapes.pressure - pressure)
    along = points.take(np.repeat(start, len(branch.load)))
    shapes = replace(along.shapes, coordinates=branch.coordinates, pressure=pressure)
    shapes = pressed.resting(shapes)
    share = before.share + branch.load * (fold.share - before.share)
    return replace(along, shapes=shapes, share=share)


def _beside(pressed: Pressed, points: PathPoints, event: Event) -> Indices:
    """The place of a stable point at a small distance before the fold of an event, or none.

    In the same step of the history, and after whatever happened last.
    """
    shapes, place, unit = points.shapes, event.before, event.units[0]
    opening = pressed.extensions(shapes.coordinates)[unit]
    stroke = np.broadcast_to(pressed.finger.stroke[:, 0], len(shapes.inverted))[unit]
    distance = np.abs(opening - opening[place]) / stroke
    is_fit = (points.cycle == points.cycle[place]) & (points.step == points.step[place])
    is_fit &= (shapes.inverted == shapes.inverted[:, [place]]).all(axis=0)
    if shapes.touching is not None:
        is_fit &= (shapes.touching == shapes.touching[:, [place]]).all(axis=0)
    is_fit &= (np.arange(len(points)) < place) & (distance >= NEAREST) & (distance <= FURTHEST)
    fit = np.flatnonzero(is_fit)
    return np.asarray(fit[np.abs(distance[fit] - BESIDE).argsort()[:1]])
