"""A finger in node coordinates: the study's own form, kept as the reference.

The coordinates are the positions (B_1x, B_1y, T_1x, T_1y, B_2x, …) in mm, batch innermost;
B_0 = (0, 0) and T_0 = (0, H) are clamped. Every energy is a function of a cell's four
vectors: its chord c = B_i − B_{i-1}, its top t = T_i − T_{i-1} and its struts p = T_{i-1} −
B_{i-1} (near) and q = T_i − B_i (far).

Positions in doubles resolve a stiff bar's force only down to about k_L ε times the finger's
length (`Lattice.rounding_floor`); `mechanics.chain` has no such floor.
"""

from functools import cached_property

import numpy as np

from dpgcli.arrays import Array, Indices, total
from dpgcli.equilibrium.contracts import OwnCoordinate, Row
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.coordinates import CellShape, Internal, Springs, Stations, impossible
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.lattice_geometry import (
    Vectors,
    corners,
    cross,
    dot,
    extension,
    left,
    swung,
    vectors,
)
from dpgcli.mechanics.lattice_measures import Center, Corner, Extension
from dpgcli.records import dataclass

FINEST_TOLERANCE = 1e-12  # the relative residual that `Lattice.gradient_scale` keeps in reach
ROUNDING_STEPS = 2.0  # of k_L ε (finger's length); see `Lattice.rounding_floor`


@dataclass(frozen=True)
class Lattice:
    """Node coordinates of a finger (`coordinates.FingerCoordinates`).

    Raises ValueError for a finger of rigid bars: what is infinitely stiff has no energy here.
    """

    finger: Finger

    def __post_init__(self) -> None:
        if self.finger.is_rigid:
            raise ValueError("linear_stiffness is infinite: the lattice needs elastic bars")

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return 4 * self.finger.n_units

    def _extension(self, name: str, axis: int, rest: Array) -> Extension:
        return Extension(name, axis, rest, self.finger.segment_height, self.finger.n_units)

    @cached_property
    def opening(self) -> Extension:
        """Extension x of every bistable spring, between T_{i-1} and T_i with rest length L."""
        return self._extension("top", 0, self.finger.segment_length)

    @property
    def dome(self) -> Extension:
        """The opening: walls are rigid."""
        return self.opening

    @property
    def walls(self) -> tuple[()]:
        """None: walls are rigid."""
        return ()

    @cached_property
    def corners(self) -> tuple[Corner, Corner]:
        """The corner angles, rad."""
        height, n_units = self.finger.segment_height, self.finger.n_units
        return Corner(True, height, n_units), Corner(False, height, n_units)

    @cached_property
    def bars(self) -> tuple[Extension, Extension]:
        """The extensions of chords of rest length L and of far struts of rest length H, mm."""
        finger = self.finger
        chord = self._extension("chord", 0, finger.segment_length)
        return chord, self._extension("far", 1, finger.segment_height)

    def position(self, axis: int) -> OwnCoordinate:
        """The tip's x (axis 0) or y (axis 1), mm: a coordinate."""
        return OwnCoordinate(Row(self.size, self.size - 4 + axis), 1)

    def center(self, axis: int, shares: Array) -> Center:
        """The x or y of the center of the tops by their shares, mm."""
        return Center(shares, axis, self.finger.n_units)

    def _vectors(self, coordinates: Array) -> Vectors:
        return vectors(coordinates, self.finger.segment_height)

    def _distances(self) -> Array:
        """Largest distance of the stations from the base, Σ L + H, mm, shape (unit, designs)."""
        finger = self.finger
        lengths = finger.segment_length
        lengths = np.broadcast_to(lengths, (finger.n_units, lengths.shape[1]))
        return np.asarray(np.cumsum(lengths, axis=0) + finger.segment_height)

    def _rowwise(self, values: Array) -> Array:
        """Repeat one value per unit, (1 or unit, designs), for the unit's four coordinates."""
        spread = np.broadcast_to(values, (self.finger.n_units, values.shape[1]))
        return np.repeat(spread, 4, axis=0)

    @cached_property
    def force_unit(self) -> Array:
        """1: all coordinates are lengths."""
        return np.ones((self.size, 1))

    @cached_property
    def rounding_floor(self) -> Array:
        """The rounding floor of the residual, 2 k_L ε (Σ L + H), N, shape (1, designs).

        A position is stored to within ε/2 of itself, a bar's extension is the difference of
        two, and up to three bars meet at a node. Measured at equilibria of 1 to 40 units
        with k_L from 1e3 to 1e9 N/mm: Newton's iterates stay below half of it.
        """
        rounding = ROUNDING_STEPS * np.finfo(float).eps * self._distances()[-1:]
        return np.asarray(self.finger.linear_stiffness * rounding)

    @cached_property
    def gradient_scale(self) -> Array:
        """Forces in play at a node, N: the stronger unit's, plus the floor over `FINEST_TOLERANCE`.

        The second part keeps a relative residual of `FINEST_TOLERANCE` attainable.
        """
        scale = self.finger.force_scale
        shared = scale.copy()
        shared[:-1] = np.maximum(scale[:-1], scale[1:])
        return self._rowwise(shared + self.rounding_floor / FINEST_TOLERANCE)

    @cached_property
    def stiffness_scale(self) -> Array:
        """Stiffness of the soft directions, k_b + k_θ/H², N/mm, by which pivots are judged."""
        return self._rowwise(self.finger.force_scale / self.finger.stroke)

    @cached_property
    def step_cap(self) -> Array:
        """The motion of a node, mm, by a turn of the whole finger by 0.2 d/H, at most 0.3 rad."""
        turn = np.minimum(0.2 * self.finger.stroke / self.finger.segment_height, 0.3)
        return self._rowwise(turn * self._distances())

    def take_lanes(self, index: Indices) -> "Lattice":
        """The lattices of some lanes of the batch."""
        return Lattice(self.finger.take_lanes(index))

    def moved(self, coordinates: Array, step: Array) -> Array:
        """Turn and stretch bars by the step's linear rates, from the base on.

        Nodes that went straight would stretch every bar that turns, by the square of the
        turn, and a stiff bar would then allow tiny steps only.
        """
        before = self._vectors(coordinates)
        change = self._vectors(step)
        base = np.cumsum(swung(before.chord, change.chord), axis=1)
        top = base + swung(before.far, change.far)
        return np.stack((*base, *top), axis=1).reshape(coordinates.shape)

    def of_shape(self, shape: Internal) -> Array:
        """The node positions of a shape, mm, (size, batch)."""
        chain = Chain(self.finger)
        stations = chain.stations(chain.of_shape(shape))
        nodes = np.stack(np.broadcast_arrays(*stations), axis=1)
        return nodes.reshape(self.size, nodes.shape[2])

    def without_walls(self, values: Array) -> Array:
        """All rows: walls are rigid."""
        return values

    def openings(self, coordinates: Array) -> Array:
        """Extension x = |t| − L of every bistable spring, mm, (unit, batch)."""
        return extension(self._vectors(coordinates).top, self.finger.segment_length, 0)

    def springs(self, coordinates: Array) -> Springs:
        """Extensions, impossible shapes, and the levers n × p and n × q, n along the spring."""
        cell = self._vectors(coordinates)
        along = cell.top / np.hypot(*cell.top)
        levers = cross(along, cell.near), cross(along, cell.far)
        shape = CellShape(np.hypot(*cell.chord), np.hypot(*cell.far), *corners(cell), *levers)
        return Springs(self.openings(coordinates), impossible(shape), np.stack(levers))

    def corner_moments(self, coordinates: Array, gradient: Array) -> Array:
        """Moments of the forces on all nodes that a corner turns (our derivation)."""
        n = self.finger.n_units
        base, top = coordinates.reshape(n, 2, 2, coordinates.shape[1]).transpose(1, 2, 0, 3)
        on_base, on_top = gradient.reshape(n, 2, 2, gradient.shape[1]).transpose(1, 2, 0, 3)
        own = cross(top - base, on_top)  # of each station's strut, about the station
        beyond = np.cumsum((on_base + on_top)[:, ::-1], axis=1)[:, ::-1]
        # about the station before: beyond it all forces act at the next station, as it were
        chord = np.diff(base, axis=1, prepend=0.0)
        about_near = np.cumsum((own + cross(chord, beyond))[::-1], axis=0)[::-1]
        about_far = about_near - cross(chord, beyond)
        return -np.stack((about_near, about_far))

    def stations(self, coordinates: Array) -> Stations:
        """The node positions, mm: views of the coordinates."""
        return Stations(*(coordinates[k::4] for k in range(4)))

    def tip(self, coordinates: Array) -> tuple[Array, Array]:
        """Tip x, y (mm) and angle −Σ (a + b), (3, batch), and their Jacobian, (size, 3, batch)."""
        cell = self._vectors(coordinates)
        near, far = corners(cell)  # their sum counts full turns, an angle of the strut would not
        tip = np.stack((coordinates[-4], coordinates[-3], -total(near + far)))
        jacobian = np.zeros((len(coordinates), 3, coordinates.shape[1]))
        jacobian[-4, 0] = jacobian[-3, 1] = 1.0
        last = cell.far[:, -1]
        turn = left(last / dot(last, last))
        jacobian[-4:-2, 2], jacobian[-2:, 2] = -turn, turn
        return tip, jacobian

    def station_jacobian(self, coordinates: Array) -> Array:
        """The unit matrix: nodes are the coordinates, (size, size, batch)."""
        size, batch = coordinates.shape
        return np.repeat(np.eye(size)[:, :, None], batch, axis=2)
