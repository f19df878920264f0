"""Where straight units rest: in the straight finger, unless a dome's curve has it elsewhere."""

from dataclasses import replace

import numpy as np

from dpgcli.arrays import Array
from dpgcli.mechanics.finger import Finger
from dpgcli.states.rigid_unit import SHORT_OF_LEVER, rigid_unit
from dpgcli.states.scan import pulls

PLACES = 129  # on the way to where a unit rests, at which its force is looked at
BISECTIONS = 60  # down to rounding
NO_FORCE = 1e-12  # of the forces in play


def straight_rest(finger: Finger, barrier: Array) -> Array:
    """Extension (mm) of the dome of a straight unit at rest between rigid bars, (unit, design).

    It is 0, the straight finger, under most laws. A dome that pulls by a curve of its own travel
    pulls the gap shut, and a spline that bends down at rest opens it. The rest is the first minimum
    downhill from there, up to the `barrier` (mm), or to where the dome itself is at rest.
    """
    nowhere = np.zeros_like(barrier)
    if finger.law.curve is None or not pulls(finger):
        return nowhere
    _, force, stiffness = rigid_unit(finger, nowhere)
    level = NO_FORCE * finger.force_scale
    opens = (force < -level) | ((force <= level) & (stiffness < -level / finger.stroke))
    closes = force > level
    if not (opens | closes).any():
        return nowhere
    shut = np.maximum(-finger.domes.contact, -SHORT_OF_LEVER * 2.0 * finger.segment_height)
    end = np.where(opens, np.maximum(barrier, 0.0), np.where(closes, shut, 0.0))
    return _downhill(finger, end) * (opens | closes)


def _downhill(finger: Finger, end: Array) -> Array:
    """The first place on the way from 0 to some ends where the force turns against it, mm."""
    sign = np.sign(end)
    share = np.linspace(0.0, 1.0, PLACES)[1:, None, None]
    turns = sign * rigid_unit(finger, share * end).force >= 0.0
    turns[-1] = True
    first = turns.argmax(axis=0)
    low, high = first / (PLACES - 1.0), (first + 1.0) / (PLACES - 1.0)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        falls = sign * rigid_unit(finger, middle * end).force < 0.0
        low, high = np.where(falls, middle, low), np.where(falls, high, middle)
    return np.asarray(low * end)


def energy_at_rest(finger: Finger, rest: Array) -> Array:
    """Energy (mJ) of straight units at rest, or of domes that only push, by themselves."""
    if pulls(finger):
        return rigid_unit(finger, rest).energy
    curve = finger.law.curve
    if curve is None:
        return np.zeros_like(rest)
    domes, attached = finger.domes, replace(finger, law=finger.law.pulling)
    return attached.springs(curve.rest * (domes.stroke + domes.contact) - domes.contact).energy
