"""Predicted states beside known ones: finite elements or measurements, in their own frame."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.finger import Finger
from dpgcli.states.rungs import DEFAULT_TOLERANCE
from dpgcli.states.solve import Status, Units, certify, reach, solve, tip


@dataclass(frozen=True)
class KnownTips:
    """Tips that are known: patterns, (unit, state), and x, y in mm, (2, state).

    Tip angles (rad) and the time each state took (s), (state,), are NaN where not given.
    """

    patterns: Flags
    position: Array
    angle: Array
    seconds: Array


@dataclass(frozen=True)
class Frame:
    """Where the lattice lies in the data's frame.

    `first_station` is B_0 (mm); `tip` is what the data calls the tip, from the last station B_n,
    along the end phalanx and to its left (mm).
    """

    first_station: tuple[float, float] = (0.0, 0.0)
    tip: tuple[float, float] = (0.0, 0.0)

    def tips(self, pose: Array) -> Array:
        """Tips x, y (mm), (2, state), of lattices whose last station has these poses."""
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        along, left = self.tip
        x = self.first_station[0] + pose[0] + cos * along - sin * left
        y = self.first_station[1] + pose[1] + sin * along + cos * left
        return np.stack((x, y))


STRAIGHT = 1e-2  # of the largest deflection: what moves less is the straight finger


@dataclass(frozen=True)
class Comparison:
    """Predicted tips, in the data's frame, beside known ones, arrays of shape (…, state).

    `predicted` x, y (mm) and angle (rad); `distance` (mm) between the tips, `deflection` (mm) of
    the known tip from where the straight finger's is, `angle` the difference of the angles (rad).
    NaN where the lattice has no such state, or the data no angle.
    """

    status: NDArray[np.uint8]
    predicted: Array
    distance: Array
    deflection: Array
    angle: Array

    @property
    def relative(self) -> Array:
        """Distance over deflection; NaN for a tip that hardly moves."""
        moved = self.deflection > STRAIGHT * self.deflection.max(initial=0.0)
        return np.where(moved, self.distance / np.where(moved, self.deflection, 1.0), np.nan)


def compare(finger: Finger, known: KnownTips, frame: Frame) -> Comparison:
    """Hold the states of one finger against known tips.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> finger = uniform_finger(2, **STUDY)
    >>> straight = np.array([[False], [False]])
    >>> none = np.full(1, np.nan)
    >>> found = compare(finger, KnownTips(straight, np.array([[27.0], [1.0]]), none, none), Frame())
    >>> float(found.distance[0])
    1.0
    """
    units = Units.of(finger)
    batch = solve(units, Chain, known.patterns, DEFAULT_TOLERANCE)
    status = certify(batch, units.wells, DEFAULT_TOLERANCE)
    pose = tip(batch, with_compliance=False).pose
    pose = np.where(status == Status.STABLE, pose, np.nan)
    predicted = frame.tips(pose)
    straight = frame.tips(np.array([reach(finger), [0.0], [0.0]]))
    return Comparison(
        status=status,
        predicted=np.concatenate((predicted, pose[2:])),
        distance=np.hypot(*(predicted - known.position)),
        deflection=np.hypot(*(known.position - straight)),
        angle=np.abs(pose[2] - known.angle),
    )
