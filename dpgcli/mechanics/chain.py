"""A finger in internal coordinates: the default formulation.

Per unit i the unknowns are the chord's extension e, the corner angles a (near station) and
b (far station), and the far strut's extension s: coordinates (e_1, a_1, b_1, s_1, e_2, …) in
mm and rad, batch innermost. With rigid bars only (a_1, b_1, a_2, …) are left. Positive
angles open the dome side. Stiff bars sit on the diagonal of the Hessian, which therefore
keeps its digits at any k_L (our derivation).
"""

from dataclasses import replace
from functools import cached_property

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.equilibrium.contracts import OwnCoordinate
from dpgcli.mechanics.chain_geometry import Cell, Pose, cells, internal, pose_of
from dpgcli.mechanics.chain_measures import ELASTIC, RIGID, Opening, Position, own
from dpgcli.mechanics.coordinates import CellShape, Internal, Springs, Stations, impossible
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass


@dataclass(frozen=True)
class Chain:
    """Internal coordinates of a finger (`coordinates.FingerCoordinates`)."""

    finger: Finger

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(RIGID if self.finger.is_rigid else ELASTIC) * self.finger.n_units

    @cached_property
    def opening(self) -> Opening:
        """Extension x of every bistable spring, mm."""
        return Opening.of(self.finger)

    @property
    def dome(self) -> Opening:
        """The opening: walls are rigid."""
        return self.opening

    @property
    def walls(self) -> tuple[()]:
        """None: walls are rigid."""
        return ()

    @property
    def corners(self) -> tuple[OwnCoordinate, OwnCoordinate]:
        """The corner angles a and b, rad."""
        return own(self.finger, "a"), own(self.finger, "b")

    @property
    def bars(self) -> tuple[OwnCoordinate, ...]:
        """The extensions e and s of chords and far struts, mm."""
        return () if self.finger.is_rigid else (own(self.finger, "e"), own(self.finger, "s"))

    def position(self, axis: int) -> Position:
        """The tip's x (axis 0) or y (axis 1), mm."""
        finger = self.finger
        lengths = finger.segment_length, finger.segment_height
        return Position(finger.n_units, *lengths, finger.is_rigid, axis)

    def center(self, axis: int, shares: Array) -> Position:
        """The x or y of the center of the tops by their shares, mm."""
        return replace(self.position(axis), shares=shares)

    def _rowwise(self, length: Array, angle: Array) -> Array:
        """Spread one value for lengths and one for angles over the coordinates."""
        length, angle = np.broadcast_arrays(length, angle)
        names = (angle, angle) if self.finger.is_rigid else (length, angle, angle, length)
        stacked = np.stack(np.broadcast_arrays(*names), axis=1)
        stacked = np.broadcast_to(stacked, (self.finger.n_units, *stacked.shape[1:]))
        return stacked.reshape(self.size, stacked.shape[2])

    @cached_property
    def force_unit(self) -> Array:
        """1 for lengths, H (mm) for angles, (size, batch or 1)."""
        height = self.finger.segment_height
        return self._rowwise(np.ones_like(height), height)

    @cached_property
    def gradient_scale(self) -> Array:
        """Forces in play: N for lengths, N mm for angles; a strut feels the stronger unit."""
        scale = self.finger.force_scale
        shared = scale.copy()  # a strut feels the stronger of its two units
        shared[:-1] = np.maximum(scale[:-1], scale[1:])
        return self._rowwise(shared, scale * self.finger.segment_height)

    @cached_property
    def stiffness_scale(self) -> Array:
        """k_b + k_θ/H² plus k_L for lengths, N/mm; (k_b + k_θ/H²) H² for angles, N mm/rad."""
        finger = self.finger
        soft = finger.force_scale / finger.stroke
        stiff = soft if finger.is_rigid else soft + finger.linear_stiffness
        return self._rowwise(stiff, soft * finger.segment_height**2)

    @cached_property
    def step_cap(self) -> Array:
        """0.2 d for lengths, mm; 0.2 d/H, at most 0.3 rad, for angles."""
        stroke = 0.2 * self.finger.stroke
        return self._rowwise(stroke, np.minimum(stroke / self.finger.segment_height, 0.3))

    def take_lanes(self, index: Indices) -> "Chain":
        """The chains of some lanes of the batch."""
        return Chain(self.finger.take_lanes(index))

    def moved(self, coordinates: Array, step: Array) -> Array:
        """Coordinates + step: bars are coordinates themselves, so that no step strains them."""
        return coordinates + step

    def of_shape(self, shape: Internal) -> Array:
        """The coordinates (e_1, a_1, b_1, s_1, …) of a shape, (size, batch)."""
        finger = self.finger
        rows = shape[1:3] if finger.is_rigid else shape[:4]
        batch = np.broadcast_shapes(*(row.shape for row in rows))[1]
        coordinates = np.empty((finger.n_units, len(rows), batch))
        for place, row in enumerate(rows):
            coordinates[:, place] = row
        return coordinates.reshape(finger.n_units * len(rows), batch)

    def _shape(self, coordinates: Array) -> Internal:
        return internal(coordinates, self.finger.is_rigid)

    def _cells(self, coordinates: Array) -> Cell:
        finger = self.finger
        shape = self._shape(coordinates)
        return cells(shape, finger.segment_length, finger.segment_height, finger.is_rigid)

    def _pose(self, coordinates: Array) -> Pose:
        return pose_of(self._shape(coordinates), self.finger.segment_length)

    def without_walls(self, values: Array) -> Array:
        """All rows: walls are rigid."""
        return values

    def openings(self, coordinates: Array) -> Array:
        """Extension x of every bistable spring, mm, (unit, batch)."""
        return self._cells(coordinates).extension

    def springs(self, coordinates: Array) -> Springs:
        """Extensions, impossible shapes, and the levers ∂x/∂a and ∂x/∂b."""
        cell, shape = self._cells(coordinates), self._shape(coordinates)
        length = self.finger.segment_length + shape.chord
        levers = cell.near_strut * cell.along_near, cell.far_strut * cell.along_far
        angles = shape.near_angle, shape.far_angle
        is_impossible = impossible(CellShape(length, cell.far_strut, *angles, *levers))
        return Springs(cell.extension, is_impossible, np.stack(levers))

    def corner_moments(self, coordinates: Array, gradient: Array) -> Array:
        """∂E/∂a and ∂E/∂b: corners are coordinates themselves."""
        moments = internal(gradient, self.finger.is_rigid)
        return np.stack((moments.near_angle, moments.far_angle))

    def stations(self, coordinates: Array) -> Stations:
        """T_i = B_i + (H + s_i) (−sin τ_i, cos τ_i), mm, with τ_i the angle of strut i."""
        pose = self._pose(coordinates)
        strut = self.finger.segment_height + self._shape(coordinates).strut
        return Stations(
            pose.x,
            pose.y,
            pose.x - strut * np.sin(pose.strut_angle),
            pose.y + strut * np.cos(pose.strut_angle),
        )

    def tip(self, coordinates: Array) -> tuple[Array, Array]:
        """Tip x, y (mm) and angle −Σ (a + b), (3, batch), and their Jacobian, (size, 3, batch).

        >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
        >>> chain = Chain(uniform_finger(1, **STUDY))
        >>> pose, _ = chain.tip(np.array([[0.5 * np.pi], [0.0]]))  # the near corner by 90°
        >>> pose.ravel().round(4)
        array([  0.    , -13.5   ,  -1.5708])
        """
        pose = self._pose(coordinates)
        tip = np.stack((pose.x[-1], pose.y[-1], pose.strut_angle[-1]))
        jacobian = np.zeros((self.size, 3, coordinates.shape[1]))
        chord, near, far, *_ = internal(jacobian, self.finger.is_rigid)
        for angle in (near, far):  # an opening corner turns all that lies beyond it by −1
            angle[:, 2] = -1.0
        np.subtract(pose.y[-1], pose.y, out=far[:, 0])
        np.subtract(pose.x, pose.x[-1], out=far[:, 1])
        near[1:, :2] = far[:-1, :2]
        near[0, 0], near[0, 1] = pose.y[-1], -pose.x[-1]
        if not self.finger.is_rigid:
            chord[:, 0], chord[:, 1] = pose.chord_cos, pose.chord_sin
        return tip, jacobian

    def station_jacobian(self, coordinates: Array) -> Array:
        """Derivatives of all node positions, (size, 4 n, batch); corners turn all beyond them."""
        finger = self.finger
        n, batch = finger.n_units, coordinates.shape[1]
        pose, nodes = self._pose(coordinates), self.stations(coordinates)
        x0 = np.concatenate((np.zeros((1, batch)), pose.x))
        y0 = np.concatenate((np.zeros((1, batch)), pose.y))
        jacobian = np.zeros((self.size, n, 4, batch))
        chord, near, far, strut, _ = internal(jacobian, finger.is_rigid)
        for j in range(n):
            for k, angle in ((j, near), (j + 1, far)):  # turning about station k
                angle[j, j:, 0], angle[j, j:, 1] = (
                    nodes.base_y[j:] - y0[k],
                    x0[k] - nodes.base_x[j:],
                )
                angle[j, j:, 2], angle[j, j:, 3] = nodes.top_y[j:] - y0[k], x0[k] - nodes.top_x[j:]
            if not finger.is_rigid:
                chord[j, j:, 0::2], chord[j, j:, 1::2] = pose.chord_cos[j], pose.chord_sin[j]
                strut[j, j, 2] = -np.sin(pose.strut_angle[j])
                strut[j, j, 3] = np.cos(pose.strut_angle[j])
        return jacobian.reshape(self.size, 4 * n, batch)
