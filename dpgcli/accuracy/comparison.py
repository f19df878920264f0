"""Predicted states beside known ones: finite elements or measurements, in their own frame."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.finger import Finger
from dpgcli.states.columns import Column, Group, Kind
from dpgcli.states.patterns import texts
from dpgcli.states.rows import Columns
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

    `predicted` x, y (mm) and angle (rad); `layer` the nodes of the limiting layer, x and y in mm,
    (2, n + 1, state); `distance` (mm) between the tips, `deflection` (mm) of
    the known tip from where the straight finger's is, `angle` the difference of the angles (rad).
    NaN where the lattice has no such state, or the data no angle.
    """

    status: NDArray[np.uint8]
    predicted: Array
    layer: Array
    distance: Array
    deflection: Array
    angle: Array

    @property
    def relative(self) -> Array:
        """Distance over deflection; NaN for a tip that hardly moves."""
        moved = self.deflection > STRAIGHT * self.deflection.max(initial=0.0)
        return np.where(moved, self.distance / np.where(moved, self.deflection, 1.0), np.nan)


def _number(name: str, unit: str, description: str) -> Column:
    return Column(name, unit, description, Group.STATES)


COLUMNS = (
    Column("pattern", "", "activation pattern", Group.STATES, Kind.PATTERN),
    Column("status", "", "stable where certified, else why not", Group.STATES, Kind.STATUS),
    _number("tip_x_mm", "mm", "predicted tip"),
    _number("tip_y_mm", "mm", "predicted tip"),
    _number("known_x_mm", "mm", "known tip"),
    _number("known_y_mm", "mm", "known tip"),
    _number("error_mm", "mm", "distance between the two"),
    _number("error_percent", "%", "the same over the deflection of the known tip"),
    _number("angle_error_rad", "rad", "difference of the tip angles"),
)


def rows(known: KnownTips, found: Comparison) -> Columns:
    """Columns of `COLUMNS` by name."""
    return {
        "pattern": texts(known.patterns),
        "status": found.status,
        "tip_x_mm": found.predicted[0],
        "tip_y_mm": found.predicted[1],
        "known_x_mm": known.position[0],
        "known_y_mm": known.position[1],
        "error_mm": found.distance,
        "error_percent": 100.0 * found.relative,
        "angle_error_rad": found.angle,
    }


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
    stations = batch.formulation.stations(batch.equilibrium.coordinates)
    layer = np.stack((stations.base_x, stations.base_y))
    layer = np.concatenate((np.zeros_like(layer[:, :1]), layer), axis=1)
    straight = frame.tips(np.array([reach(finger), [0.0], [0.0]]))
    return Comparison(
        status=status,
        predicted=np.concatenate((predicted, pose[2:])),
        layer=layer + np.reshape(frame.first_station, (2, 1, 1)),
        distance=np.hypot(*(predicted - known.position)),
        deflection=np.hypot(*(known.position - straight)),
        angle=np.abs(pose[2] - known.angle),
    )
