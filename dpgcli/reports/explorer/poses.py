"""Shapes of all states of many designs from those of few: one unit's pose after the other.

Where units hardly act on each other, a state is a chain of units at rest and inverted units, and
the states with none and with one inverted unit say how each of them leads from its station to the
next. That they do is not taken for granted: `deviation` compares with all states. It is not zero,
since bars give way a little and carry the force of a unit into its neighbors.
"""

from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.reports.outlines import Points

AGREEMENT = 1e-3  # of the length, and of the largest energy: below all that a drawing shows


class StateTips(NamedTuple):
    """Tips x + iy (mm), their angles (rad) and energies (mJ) of all states, (design, state).

    The states are in the order of their patterns, 1 for inverted, as binary numbers; NaN where a
    state is not stable.
    """

    tip: Points
    angle: Array
    energy: Array


class UnitPoses(NamedTuple):
    """Where the next station is from the one before, and turned by how much, (design, unit).

    At rest `length` (mm) ahead; inverted `offset` (mm), ahead + i up, and `turn` (rad), with
    `energy` (mJ) more; all units at rest have `rest_energy` (design, 1).
    """

    length: Array
    offset: Points
    turn: Array
    energy: Array
    rest_energy: Array


def unit_poses(tips: StateTips, length: Array) -> UnitPoses:
    """The poses that tips have, of units of a length (design, unit) at rest.

    >>> turned = np.exp(-0.1j)
    >>> tips = np.array([[3, 2 + turned, 1 + 2 * turned, 1 + turned + turned**2]])
    >>> angle = np.array([[0.0, -0.1, -0.1, -0.2]])
    >>> poses = unit_poses(StateTips(tips, angle, -angle), np.array([[1.0, 2.0]]))
    >>> bool(np.isclose(poses.offset[0, 0], 1.0)), poses.turn.tolist()
    (True, [[-0.1, -0.1]])
    """
    alone = 2 ** np.arange(length.shape[1])[::-1]
    end = np.cumsum(length, axis=1)
    turn, rest = tips.angle[:, alone], tips.energy[:, :1]
    behind = end[:, -1:] - end
    offset = tips.tip[:, alone] - (end - length) - np.exp(1j * turn) * behind
    return UnitPoses(length, offset, turn, tips.energy[:, alone] - rest, rest)


def composed(poses: UnitPoses) -> StateTips:
    """The tips of all states that the poses make."""
    inverted = _patterns(poses.length.shape[1])
    tip: Points = np.zeros((len(poses.length), len(inverted)), np.complex128)
    angle = np.zeros(tip.shape)
    energy = np.repeat(poses.rest_energy, len(inverted), axis=1)
    for unit, is_inverted in enumerate(inverted.T):
        offset, length = poses.offset[:, [unit]], poses.length[:, [unit]]
        tip = tip + np.exp(1j * angle) * np.where(is_inverted, offset, length)
        angle = angle + np.where(is_inverted, poses.turn[:, [unit]], 0.0)
        energy = energy + np.where(is_inverted, poses.energy[:, [unit]], 0.0)
    return StateTips(tip, angle, energy)


class Deviation(NamedTuple):
    """How far composed states are from those of the tables, at most, (design,): mm, rad, mJ."""

    tip: Array
    angle: Array
    energy: Array


def deviation(poses: UnitPoses, tips: StateTips) -> Deviation:
    """The largest over all stable states; NaN where a pose is not known, as of a missing state."""
    is_stable = ~np.isnan(tips.tip)
    off = (np.abs(a - b) for a, b in zip(composed(poses), tips, strict=True))
    return Deviation(*(np.max(e, axis=1, initial=0.0, where=is_stable) for e in off))


def are_composed(poses: UnitPoses, tips: StateTips, found: Deviation) -> Flags:
    """Of which designs all stable states are composed of units by themselves, (design,)."""
    energy = np.max(np.abs(tips.energy), axis=1, initial=0.0, where=~np.isnan(tips.energy))
    return np.asarray(
        (found.tip <= AGREEMENT * poses.length.sum(axis=1))
        & (found.angle <= AGREEMENT)
        & (found.energy <= AGREEMENT * energy)
    )


def _patterns(n_units: int) -> Flags:
    """Whether each unit is inverted, (state, unit)."""
    codes: Indices = np.arange(2**n_units)
    return (codes[:, None] >> np.arange(n_units)[::-1] & 1).astype(bool)
