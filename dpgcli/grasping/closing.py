"""Fingers that close on bodies: pressures go through a history with the body there.

Domes snap and reset at folds, as without a body, but those of the finger with its contacts, which
begin and end on the way.
"""

from dataclasses import replace

import numpy as np

from dpgcli.arrays import Array
from dpgcli.design.pressure import History, Pressure
from dpgcli.grasping.approach import Approach, Reset, approach
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.descent import finished
from dpgcli.grasping.shapes import Ramp
from dpgcli.grasping.travels import with_travels, without_travels
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.records import dataclass


@dataclass(frozen=True)
class Closing:
    """Pressures that the lines of each finger go through, from none; domes sweep `volumes`."""

    volumes: DomeVolumes
    pressure: Pressure
    history: History


def closed(own: Obstructed, start: Approach, closing: Closing) -> Approach:
    """Let pressures change beside bodies; what flips is told by pressures."""
    by_unit = closing.history.pressure[:, closing.pressure.line_of]
    return at_rest(own, driven(own, start, closing.volumes, by_unit[..., None]), closing.volumes)


def driven(
    own: Obstructed,
    start: Approach,
    volumes: DomeVolumes,
    pressures: Array,
    begin: Array | None = None,
) -> Approach:
    """The same by pressures on each finger, (step, unit, 1 or lane) in MPa.

    They `begin` at none, unless that is given, and the fingers have come there this way.
    """
    shapes, resets, n = start.shapes, list(start.resets), len(start.load)
    before = 0.0 * pressures[0] if begin is None else begin
    there, stops = replace(own, depth=np.zeros(1)), [shapes]
    if begin is None:
        shapes = with_travels(replace(there, ramp=Ramp(volumes, before, 0.0 * before)), shapes)
    for target in pressures:
        ramp = Ramp(volumes, before, target - before)
        under = replace(there, ramp=ramp)
        came = approach(under, shapes, np.zeros(n), np.ones(n))
        resets += [_told_by_pressure(told, ramp, own.n_fingers) for told in came.resets]
        is_sound = came.shapes.is_there & ~own.are_folded(came.shapes)
        shapes, before = replace(came.shapes, is_there=is_sound), target
        stops.append(shapes)
    return replace(start, shapes=shapes, resets=tuple(resets), stops=tuple(stops))


def at_rest(own: Obstructed, came: Approach, volumes: DomeVolumes) -> Approach:
    """Fingers that have come to no pressure, as states."""
    none = np.zeros((own.units.finger.n_units, 1))
    under = replace(own, ramp=Ramp(volumes, none, none))
    shapes = without_travels(under, came.shapes)
    if under.n_travels:  # as exactly as states are, whose forces in play are without those of domes
        there = finished(own, shapes.coordinates, shapes.inverted, shapes.push, came.load)
        shapes = replace(there, is_there=there.is_there & shapes.is_there)
    return replace(came, shapes=shapes)


def _told_by_pressure(told: Reset, ramp: Ramp, n_fingers: int) -> Reset:
    own = ramp.take_lanes(told.lanes)
    return replace(told, pressure=np.tile(own.begin + told.load * own.change, (n_fingers, 1)))


def with_reach(own: Obstructed) -> Obstructed:
    """Fingers that may close in front of bodies: they touch nothing that is behind their domes."""
    return replace(own, reach=own.behind)


def event_text(told: Reset, place: int, lines: Pressure) -> str:
    """What happened to a lane as pressures changed, by the line of each unit if there are several.

    Such as "snap 1,2 at 0.1495 MPa", or "snap 1 at A 0.15 MPa, reset 4 at B -0.02 MPa".
    """
    assert told.pressure is not None, "pressures changed"
    parts: dict[tuple[str, str], list[str]] = {}
    for unit in np.flatnonzero(told.flipped[:, place]):
        kind = "snap" if told.snapped[unit, place] else "reset"
        line = f"{lines.lines[lines.line_of[unit]]} " if len(lines.lines) > 1 else ""
        at = f"{line}{told.pressure[unit, place]:.6g} MPa"
        parts.setdefault((kind, at), []).append(str(unit + 1))
    return ", ".join(f"{kind} {','.join(units)} at {at}" for (kind, at), units in parts.items())
