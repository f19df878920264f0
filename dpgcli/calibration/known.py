"""States that are known from finite elements or tests, and the lattice's own in their frame."""

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.mechanics.chain_geometry import internal
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.records import dataclass
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Settled, Status
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions


@dataclass(frozen=True)
class KnownStates:
    """Known states, from finite elements or tests; arrays (…, state), NaN if not known.

    `patterns` (unit, state), `tip` x and y (2, state) in mm, by unit (unit, state) the `angles` of
    the phalanges beyond them (rad), their `openings` at the domes' axis (mm) and the `pushes` of
    their domes (N), `seconds` (state,) that each state took, `moments` (state,) the end couple that
    it is under (N mm, 0 where the data name none; a positive one opens the gaps). `shapes` are the
    limiting layer's points from base to tip, (2, point) in mm, by state. `unused` names what else
    the data have, `sha256` is that of their file; `first_station` and `tip_offset` (mm) are a
    `Frame`'s, None where the data do not say them.
    """

    patterns: Flags
    tip: Array
    angles: Array
    openings: Array
    pushes: Array
    seconds: Array
    moments: Array
    shapes: tuple[Array, ...] = ()
    unused: tuple[str, ...] = ()
    sha256: str = ""
    first_station: tuple[float, float] | None = None
    tip_offset: tuple[float, float] | None = None

    def chosen(self, states: Indices) -> "KnownStates":
        """Some of the states."""
        return KnownStates(
            self.patterns[:, states],
            self.tip[:, states],
            self.angles[:, states],
            self.openings[:, states],
            self.pushes[:, states],
            self.seconds[states],
            self.moments[states],
            tuple(self.shapes[state] for state in states) if self.shapes else (),
        )

    @classmethod
    def of_tips(cls, patterns: Flags, tip: Array, tip_angle: Array | None = None) -> "KnownStates":
        """Known states by their tips, (2, state) in mm, and tip angles, (state,) in rad, alone."""
        unknown = np.full(patterns.shape, np.nan)
        angles = unknown.copy()
        if tip_angle is not None:
            angles[-1] = tip_angle
        return cls(patterns, tip, angles, unknown, unknown, unknown[0], np.zeros(patterns.shape[1]))


@dataclass(frozen=True)
class Frame:
    """The position of the lattice in the data's frame.

    `first_station` is B_0 (mm); `tip` is the data's tip as seen from the last station B_n,
    along the end phalanx and to its left (mm).
    """

    first_station: tuple[float, float] = (0.0, 0.0)
    tip: tuple[float, float] = (0.0, 0.0)

    def tips(self, pose: Array) -> Array:
        """Tips x, y (mm), (2, …), of last stations with these poses (3, …), complex ones too.

        >>> Frame((1.0, 0.0), (0.0, -0.5)).tips(np.array([[10.0], [0.0], [0.0]])).ravel().tolist()
        [11.0, -0.5]
        """
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        along, left = self.tip
        x = self.first_station[0] + pose[0] + cos * along - sin * left
        y = self.first_station[1] + pose[1] + sin * along + cos * left
        return np.stack((x, y))


@dataclass(frozen=True)
class LatticeStates:
    """Some states of a finger's lattice, arrays (…, state), NaN for states that do not exist.

    `pose` (3, state) of the last station in the lattice's own frame; `tip` (2, state) and `layer`
    (2, n + 2, state), the layer's line from the first station to the tip, in the data's;
    `angles`, `openings` (with what walls yield) and `pushes` as in `KnownStates`.
    """

    settled: Settled
    pose: Array
    tip: Array
    layer: Array
    angles: Array
    openings: Array
    pushes: Array

    @property
    def status(self) -> NDArray[np.uint8]:
        """`Status` codes, (state,)."""
        return self.settled.status


def lattice_states(
    finger: Finger, patterns: Flags, frame: Frame, moments: Array | float = 0.0
) -> LatticeStates:
    """Solve and certify patterns (unit, state) of one finger, in the frame of some data.

    `moments` (state,) are end couples, N mm; a positive one opens the gaps. The layer's line lies
    as far to the left of the stations as the data's tip does.
    """
    units = UnitSolutions.of(finger.changed(end_moment=np.atleast_2d(moments)))
    settled = settle(units, chain_potential, patterns, DEFAULT_TOLERANCE)
    is_state = settled.status == Status.STABLE
    chain, values = settled.potential.coordinates, settled.equilibrium.coordinates
    shape = internal(chain.without_walls(values), finger.is_rigid)
    turned = -np.cumsum(shape.near_angle + shape.far_angle, axis=0)
    angles = np.where(is_state, turned, np.nan)
    stations = chain.stations(values)
    x, y = (np.where(is_state, nodes, np.nan) for nodes in (stations.base_x, stations.base_y))
    pose = np.stack((x[-1], y[-1], angles[-1]))
    base = np.where(is_state, 0.0, np.nan)[None]
    poses = np.stack([np.concatenate((base, rows)) for rows in (x, y, angles)])
    line = Frame(frame.first_station, (0.0, frame.tip[1])).tips(poses)
    tip = frame.tips(pose)
    openings = chain.springs(values).extension
    pushes = -settled.finger.springs(openings).force
    return LatticeStates(
        settled=settled,
        pose=pose,
        tip=tip,
        layer=np.concatenate((line, tip[:, None]), axis=1),
        angles=angles,
        openings=np.where(is_state, openings, np.nan),
        pushes=np.where(is_state, pushes, np.nan),
    )
