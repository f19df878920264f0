"""Where domes rest by themselves under pressure, whichever of their wells they are in.

A dome alone rests at the extension y where E' = p A, so under the pressure p(y) = E'/A. It is
stable where p(y) rises with y. Such stretches are parted by tops, from which a dome that is blown
up goes on to the next stretch that bears its pressure, and by bottoms, from which one that is
sucked back goes to the one before. The study's dome has two, ground and inverted; a curve with
ripples has more.
"""

from collections.abc import Callable
from typing import Self

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.contracts import take_lanes
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.records import dataclass

BISECTIONS = 60
PLACES = 512  # of a dome's travel, at which its own pressure is looked at
LEVEL = 1e-9  # of the largest pressure: what falls by less from place to place is rounding


@dataclass(frozen=True)
class Stretches:
    """Stretches on which domes rest, arrays (stretch, unit, batch), the nearest to the base first.

    Each `begins` and `ends` at an extension (mm), under the pressures `least` and `most` (MPa): all
    infinite where none is known, and where a dome has fewer stretches than others.
    """

    begins: Array
    ends: Array
    least: Array
    most: Array

    def of(self, place: Array) -> Indices:
        """The stretch of domes that rest at a place, mm, (unit, batch)."""
        return np.asarray((self.ends >= place).argmax(axis=0))

    def beyond(self, place: Array, pressure: Array, goes_up: Flags) -> Indices:
        """The stretch to which domes go from a place at a pressure, up or back."""
        up = ((self.ends > place) & (self.most > pressure)).argmax(axis=0)
        back = ((self.begins < place) & (self.least < pressure))[::-1].argmax(axis=0)
        return np.asarray(np.where(goes_up, up, len(self.begins) - 1 - back))

    def top_before(self, stretch: Indices, pressure: Array) -> Indices:
        """The last stretch before one whose top bears more than a pressure; −1 where none does."""
        number = np.arange(len(self.begins))[:, None, None]
        is_such = (number < stretch) & (self.most > pressure)
        return np.where(is_such.any(axis=0), (number * is_such).max(axis=0), -1)

    def take_lanes(self, index: Indices) -> Self:
        """The same of some lanes of the batch."""
        return type(self)(*(take_lanes(part, index) for part in vars(self).values()))


def picked(parts: Array, stretch: Indices) -> Array:
    """Of parts (stretch, unit, batch) those of one stretch each, (unit, batch)."""
    shape = len(parts), *np.broadcast_shapes(parts.shape[1:], stretch.shape)
    every = np.broadcast_to(parts, shape)
    at = np.broadcast_to(stretch, shape[1:])[None]
    return np.asarray(np.take_along_axis(every, at, axis=0)[0])


def stretches(finger: Finger, volumes: DomeVolumes) -> Stretches:
    """Where the pressure E'/A at which domes alone rest rises with their travel.

    It is looked at from their place in the straight finger to the well without pressure, or to the
    stroke where there is no well; before and beyond it rises.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> found = stretches(uniform_finger(1, **STUDY), DomeVolumes(np.array([[30.0]])))
    >>> found.ends.ravel().round(4), found.most.ravel().round(4)  # E'' = 0 at u = 0.2246
    (array([0.7861,    inf]), array([0.152,   inf]))
    """
    domes = finger.domes
    shape = np.broadcast_shapes(*(np.shape(part) for part in domes), volumes.area.shape)
    start, well = (
        np.broadcast_to(x, shape) for x in (-domes.contact, finger.law.rests(domes).well)
    )
    way = np.where(np.isnan(well), domes.stroke, well) - start

    def pressure(share: Array) -> Array:
        extension = start + share * way
        force = finger.law.pulling.response(extension, domes).force
        return np.asarray(force / volumes.swept(extension, domes).area)

    share = np.linspace(0.0, 1.0, PLACES)[:, None, None]
    rises = _rising(pressure(share))
    nothing, beyond = np.zeros((1, *shape), bool), ~rises[-1:]
    ends = _in_order(np.concatenate([nothing, ~rises[1:] & rises[:-1], nothing]))
    begins = _in_order(np.concatenate([rises[:1], rises[1:] & ~rises[:-1], beyond]))
    top = highest_near(pressure, ends / (PLACES - 1))
    bottom = highest_near(lambda at: -pressure(at), begins / (PLACES - 1))
    least, most = pressure(bottom), pressure(top)
    bottom, top = start + bottom * way, start + top * way
    bottom[0] = np.where(rises[0], -np.inf, bottom[0])
    least[0] = -np.inf
    is_none = np.concatenate([ends, nothing - 1.0]) < 0.0
    return Stretches(
        np.where(begins < 0.0, np.inf, bottom),
        np.where(is_none, np.inf, np.concatenate([top, nothing])),
        np.where(begins < 0.0, np.inf, least),
        np.where(is_none, np.inf, np.concatenate([most, nothing])),
    )


def _rising(pressure: Array) -> Flags:
    """Between which places, the first axis, a pressure rises; where it is level, as before."""
    change = np.diff(pressure, axis=0)
    is_told = np.abs(change) > LEVEL * np.abs(pressure).max(axis=0)
    is_told[0] = True
    number = np.arange(len(change))[:, None, None]
    last = np.maximum.accumulate(np.where(is_told, number, 0), axis=0)
    return np.asarray(np.take_along_axis(change >= 0.0, last, axis=0))


def _in_order(are_there: Flags) -> Array:
    """The places, the first axis, of flags: the first ones, then the second ones; −1 for none."""
    rank = np.cumsum(are_there, axis=0) - 1
    found = np.full((int(rank.max(initial=-1)) + 1, *are_there.shape[1:]), -1.0)
    place = np.nonzero(are_there)
    found[(rank[place], *place[1:])] = place[0]
    return found


def highest_near(function: Callable[[Array], Array], share: Array) -> Array:
    """Where a function of shares is highest around a place of a grid, by golden sections."""
    low, high = (np.clip(share + side / (PLACES - 1), 0.0, 1.0) for side in (-1.0, 1.0))
    ratio = 0.5 * (np.sqrt(5.0) - 1.0)
    for _ in range(BISECTIONS):
        left, right = high - ratio * (high - low), low + ratio * (high - low)
        rises = function(left) < function(right)
        low, high = np.where(rises, left, low), np.where(rises, high, right)
    return np.asarray(0.5 * (low + high))
