"""Which order of thresholds lets pulses on one line reach a pattern, with units on their own.

Between rigid bars units do not feel each other: each is a hysteron, which snaps where the pressure
rises to u > 0 and resets where it falls to −r < 0. A pulse that rises to p inverts all units with
u ≤ p, one that falls to −q resets all with r ≤ q, and what a unit is in the end is what the last
pulse that moved it made of it.

A unit a is to end inverted and b not, from rest. If b snaps no later than a (u_b ≤ u_a), the pulse
that inverts a for good inverts b as well, and a later one has to reset b and not a: r_b < r_a. So
each such pair needs u_a < u_b or r_b < r_a. That is enough, too. Let the pulse that moves each unit
last be as small as it can be. Then b has to come after a where u_b ≤ u_a, and a after b where
r_a ≤ r_b; there is such an order unless these go round in a circle, a₁, b₁, a₂, …, a₁. Along it
u_b ≤ u_a, hence r_b < r_a by the condition, and the next r_a ≤ r_b: r would fall all the way round.
From any other state one pulse down, below all resets, leads to rest first.
"""

from typing import NamedTuple

import numpy as np

from dpgcli.actuation.alone import Thresholds
from dpgcli.actuation.pressed import TIE
from dpgcli.arrays import Array, Flags, Indices
from dpgcli.design.dimensions import unit_text


class Obstacle(NamedTuple):
    """Units (from 0) on one line in an order that keeps a pattern from being reached.

    `inverted` has to be so and `other` not: it must snap before the other, or reset after it.
    `is_tie` says that both thresholds are the same in both.
    """

    inverted: int
    other: int
    is_tie: bool


def obstacles(alone: Thresholds, line_of: Indices, inverted: Flags) -> list[Obstacle]:
    """Pairs of units of one finger that keep its pulses from a pattern, (unit,).

    >>> alone = Thresholds(np.array([[0.2], [0.1]]), np.array([[-0.1], [-0.1]]), np.array([9.0]))
    >>> obstacles(alone, np.array([0, 0]), np.array([True, False]))
    [Obstacle(inverted=0, other=1, is_tie=False)]
    >>> obstacles(alone, np.array([0, 1]), np.array([True, False]))
    []
    """
    snap, reset = sizes(alone)
    found = []
    for a in np.flatnonzero(inverted):
        for b in np.flatnonzero(~inverted & (line_of == line_of[a])):
            if not (_is_below(snap[a], snap[b]) or _is_below(reset[b], reset[a])):
                is_tie = not (_is_below(snap[b], snap[a]) or _is_below(reset[a], reset[b]))
                found.append(Obstacle(int(a), int(b), is_tie))
    return found


def sizes(alone: Thresholds) -> tuple[Array, Array]:
    """Sizes of snap and reset pressures of the first design, MPa, infinite where there are none."""
    snap, reset = (np.abs(part[:, 0]) for part in (alone.snap, alone.reset))
    return np.nan_to_num(snap, nan=np.inf), np.nan_to_num(reset, nan=np.inf)


def _is_below(one: float, other: float) -> bool:
    """Whether a threshold is smaller, ties aside."""
    return bool(one < (1.0 - TIE) * other)


def needed_order(inverted: Flags, units: Indices) -> str:
    """The order of thresholds that a pattern, (unit,), needs of the units of one line, in words.

    Some of them are inverted in it and some are not.

    >>> needed_order(np.array([True, False, True]), np.arange(3))
    'each of units 1,3 must snap before unit 2, or reset after it'
    """
    ups, downs = units[inverted[units]], units[~inverted[units]]
    one, other = ("each of " * (len(part) > 1) + _named(part) for part in (ups, downs))
    return f"{one} must snap before {other}, or reset after {'it' if len(downs) == 1 else 'that'}"


def _named(units: Indices) -> str:
    return f"unit{'s' * (len(units) > 1)} {unit_text((units + 1).tolist())}"
