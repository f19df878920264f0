"""A finger in internal coordinates: the default formulation.

Per unit i the unknowns are the chord's extension e, the corner angles a (near station) and
b (far station), and the far strut's extension s: coordinates (e_1, a_1, b_1, s_1, e_2, …) in
mm and rad, batch innermost. With rigid bars only (a_1, b_1, a_2, …) are left. Positive
angles open the dome side. Stiff bars sit on the diagonal of the Hessian, which therefore
keeps its digits at any k_L (our derivation).

With strut lengths S (near) and P (far), z = e + P sin b + S sin a and
v = P cos b − S cos a, the bistable spring has the length ℓ = √((L+z)² + v²) and, without
cancellation, the extension x = (2Lz + z² + v²)/(ℓ + L). τ is its angle to the chord.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Indices, total
from dpgcli.mechanics import laws
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.formulation import CellShape, Internal, Springs, Stations, impossible
from dpgcli.mechanics.terms import Term


def internal(coordinates: Array, is_rigid: bool) -> Internal:
    """Views of the rows of an array over the chain's coordinates; rigid bars have none."""
    if is_rigid:
        rest = np.zeros((1,) * coordinates.ndim)
        return Internal(rest, coordinates[0::2], coordinates[1::2], rest)
    return Internal(*(coordinates[k::4] for k in range(4)))


class Cell(NamedTuple):
    """One unit's bistable spring: its extension and the first derivatives, (unit, batch).

    `along_*` is the unit vector of a bar or strut's motion along the spring, `across_*`
    across it: ∂x/∂e = along_chord, ∂x/∂a = S·along_near, ∂x/∂b = P·along_far,
    ∂x/∂s_near = −across_near, ∂x/∂s_far = across_far.
    """

    extension: Array
    length: Array
    near_strut: Array
    far_strut: Array
    along_chord: Array
    across_chord: Array
    along_near: Array
    across_near: Array
    along_far: Array
    across_far: Array


def cells(finger: Finger, coordinates: Array) -> Cell:
    """Geometry of every unit at `coordinates`, shape (size, batch)."""
    chord, near, far, strut = internal(coordinates, finger.is_rigid)
    length, height = finger.segment_length, finger.segment_height
    far_strut = height + strut
    near_strut = far_strut
    if not finger.is_rigid:
        near_strut = np.empty_like(far_strut)
        near_strut[0] = height[0]  # the base strut is clamped
        near_strut[1:] = far_strut[:-1]
    sin_near, cos_near = np.sin(near), np.cos(near)
    sin_far, cos_far = np.sin(far), np.cos(far)
    z = far_strut * sin_far + near_strut * sin_near
    if not finger.is_rigid:
        z += chord
    v = far_strut * cos_far - near_strut * cos_near
    span = length + z
    spring = np.sqrt(span * span + v * v)
    cos, sin = span / spring, v / spring
    return Cell(
        extension=(z * (length + span) + v * v) / (spring + length),
        length=spring,
        near_strut=near_strut,
        far_strut=far_strut,
        along_chord=cos,
        across_chord=sin,
        along_near=cos * cos_near + sin * sin_near,
        across_near=sin * cos_near - cos * sin_near,
        along_far=cos * cos_far - sin * sin_far,
        across_far=cos * sin_far + sin * cos_far,
    )


@dataclass(frozen=True)
class BistableSprings:
    """The domes. Hessian K ∇x ∇xᵀ + (F/ℓ) ∇w ∇wᵀ + F ∇²-part, with w across the spring."""

    finger: Finger
    kind: str = "bistable"

    def add_to(self, coordinates: Array, gradient: Array, hessian: Array) -> Array:
        finger = self.finger
        cell = cells(finger, coordinates)
        energy, force, stiffness = finger.springs(cell.extension)
        along = {
            "a": cell.near_strut * cell.along_near,
            "b": cell.far_strut * cell.along_far,
        }
        across = {
            "a": cell.near_strut * cell.across_near,
            "b": cell.far_strut * cell.across_far,
        }
        # second derivatives of x beyond the two outer products
        bend = {"aa": across["a"], "bb": -across["b"]}
        if not finger.is_rigid:
            along |= {"e": cell.along_chord, "s": cell.across_far}
            across |= {"e": cell.across_chord, "s": -cell.along_far}
            bend["bs"] = cell.along_far
        if not finger.is_rigid and finger.n_units > 1:
            along["near"] = -cell.across_near
            across["near"] = cell.along_near
            bend["neara"] = cell.along_near
        rows = _rows(finger.is_rigid)
        tension = force / cell.length
        stretched = {name: stiffness * slope for name, slope in along.items()}
        turned = {name: tension * slope for name, slope in across.items()}
        order = sorted(along, key=lambda name: rows[name].offset)
        entry, part = np.empty_like(force), np.empty_like(force)
        for position, p in enumerate(order):
            _add(gradient, rows[p], np.multiply(force, along[p], out=entry))
            for q in order[position:]:
                np.multiply(stretched[p], along[q], out=entry)
                entry += np.multiply(turned[p], across[q], out=part)
                if p + q in bend:
                    entry += np.multiply(force, bend[p + q], out=part)
                _add(hessian[rows[q].offset - rows[p].offset], rows[p], entry)
        return total(energy)


class _Row(NamedTuple):
    """Where a unit's local coordinate stands: row stride·i + offset; offset −1: unit i−1's."""

    stride: int
    offset: int


def _rows(is_rigid: bool) -> dict[str, _Row]:
    if is_rigid:
        return {"a": _Row(2, 0), "b": _Row(2, 1)}
    return {name: _Row(4, k - 1) for k, name in enumerate(("near", "e", "a", "b", "s"))}


def _add(target: Array, row: _Row, values: Array) -> None:
    if row.offset < 0:  # the base strut has no row
        target[row.stride + row.offset :: row.stride][: len(values) - 1] += values[1:]
    else:
        target[row.offset :: row.stride] += values


@dataclass(frozen=True)
class Hinges:
    """Two corners per unit, each of stiffness k_c = 2 k_θ: E = ½ k_c (a² + b²)."""

    finger: Finger
    kind: str = "hinge"

    def add_to(self, coordinates: Array, gradient: Array, hessian: Array) -> Array:
        near_row, far_row = (_rows(self.finger.is_rigid)[name] for name in "ab")
        corner = 2.0 * self.finger.hinge_stiffness
        _, near, far, _ = internal(coordinates, self.finger.is_rigid)
        energies = []
        for row, angle in ((near_row, near), (far_row, far)):
            response = laws.quadratic(angle, corner)
            gradient[row.offset :: row.stride] += response.force
            hessian[0, row.offset :: row.stride] += response.stiffness
            energies.append(total(response.energy))
        return energies[0] + energies[1]


@dataclass(frozen=True)
class Bars:
    """Chords and struts, nearly rigid: E = ½ k_L (e² + s²)."""

    finger: Finger
    kind: str = "bar"

    def add_to(self, coordinates: Array, gradient: Array, hessian: Array) -> Array:
        energies = []
        for first in (0, 3):
            response = laws.quadratic(coordinates[first::4], self.finger.linear_stiffness)
            gradient[first::4] += response.force
            hessian[0, first::4] += response.stiffness
            energies.append(total(response.energy))
        return energies[0] + energies[1]


@dataclass(frozen=True)
class Chain:
    """The potential of an unloaded finger in internal coordinates (`terms.Potential`)."""

    finger: Finger

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        finger = self.finger
        hinges = (Hinges(finger),) if finger.hinge_stiffness.any() else ()
        bars = () if finger.is_rigid else (Bars(finger),)
        return (BistableSprings(finger), *hinges, *bars)

    @cached_property
    def reach(self) -> tuple[int, ...]:
        n = self.finger.n_units
        if self.finger.is_rigid:
            return (1, 0) * n
        return (3, 2, 1, 4) * (n - 1) + (3, 2, 1, 0)

    def _rowwise(self, length: Array, angle: Array) -> Array:
        """Spread one value for lengths and one for angles over the coordinates."""
        length, angle = np.broadcast_arrays(length, angle)
        names = (angle, angle) if self.finger.is_rigid else (length, angle, angle, length)
        stacked = np.stack(np.broadcast_arrays(*names), axis=1)
        stacked = np.broadcast_to(stacked, (self.finger.n_units, *stacked.shape[1:]))
        return stacked.reshape(-1, stacked.shape[2])

    @cached_property
    def force_unit(self) -> Array:
        height = self.finger.segment_height
        return self._rowwise(np.ones_like(height), height)

    @cached_property
    def gradient_scale(self) -> Array:
        scale = self.finger.force_scale
        shared = scale.copy()  # a strut feels the stronger of its two units
        shared[:-1] = np.maximum(scale[:-1], scale[1:])
        return self._rowwise(shared, scale * self.finger.segment_height)

    @cached_property
    def stiffness_scale(self) -> Array:
        finger = self.finger
        soft = finger.force_scale / finger.stroke
        stiff = soft if finger.is_rigid else soft + finger.linear_stiffness
        return self._rowwise(stiff, soft * finger.segment_height**2)

    @cached_property
    def step_cap(self) -> Array:
        stroke = 0.2 * self.finger.stroke
        return self._rowwise(stroke, np.minimum(stroke / self.finger.segment_height, 0.3))

    def designs(self, index: Indices) -> "Chain":
        return Chain(self.finger.designs(index))

    def moved(self, coordinates: Array, step: Array) -> Array:
        return coordinates + step

    def coordinates(self, shape: Internal) -> Array:
        finger = self.finger
        rows = shape[1:3] if finger.is_rigid else shape
        batch = np.broadcast_shapes(*(row.shape for row in rows))[1]
        coordinates = np.empty((finger.n_units, len(rows), batch))
        for place, row in enumerate(rows):
            coordinates[:, place] = row
        return coordinates.reshape(-1, batch)

    def openings(self, coordinates: Array) -> Array:
        return self.springs(coordinates).extension

    def springs(self, coordinates: Array) -> Springs:
        cell = cells(self.finger, coordinates)
        chord, near, far, _ = internal(coordinates, self.finger.is_rigid)
        length = self.finger.segment_length + chord
        levers = cell.near_strut * cell.along_near, cell.far_strut * cell.along_far
        shape = CellShape(length, cell.far_strut, near, far, *levers)
        return Springs(cell.extension, impossible(shape), np.stack(levers))

    def corner_moments(self, coordinates: Array, gradient: Array) -> Array:
        _, near, far, _ = internal(gradient, self.finger.is_rigid)
        return np.stack((near, far))

    def stations(self, coordinates: Array) -> Stations:
        pose = _pose(self.finger, coordinates)
        reach = self.finger.segment_height + internal(coordinates, self.finger.is_rigid).strut
        return Stations(
            pose.x,
            pose.y,
            pose.x - reach * np.sin(pose.strut_angle),
            pose.y + reach * np.cos(pose.strut_angle),
        )

    def tip(self, coordinates: Array) -> tuple[Array, Array]:
        pose = _pose(self.finger, coordinates)
        tip = np.stack((pose.x[-1], pose.y[-1], pose.strut_angle[-1]))
        jacobian = np.zeros((len(self.reach), 3, coordinates.shape[1]))
        chord, near, far, _ = internal(jacobian, self.finger.is_rigid)
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
        finger = self.finger
        n, batch = finger.n_units, coordinates.shape[1]
        pose, nodes = _pose(finger, coordinates), self.stations(coordinates)
        x0 = np.concatenate((np.zeros((1, batch)), pose.x))
        y0 = np.concatenate((np.zeros((1, batch)), pose.y))
        jacobian = np.zeros((len(self.reach), n, 4, batch))
        chord, near, far, strut = internal(jacobian, finger.is_rigid)
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
        return jacobian.reshape(len(self.reach), 4 * n, batch)


class _Pose(NamedTuple):
    """Where the stations B_i and the bars point, each (unit, batch)."""

    x: Array
    y: Array
    chord_cos: Array
    chord_sin: Array
    strut_angle: Array


def _pose(finger: Finger, coordinates: Array) -> _Pose:
    chord, near, far, _ = internal(coordinates, finger.is_rigid)
    turned = np.cumsum(near + far, axis=0)
    direction = far - turned
    cos, sin = np.cos(direction), np.sin(direction)
    length = finger.segment_length + chord
    x, y = np.cumsum(length * cos, axis=0), np.cumsum(length * sin, axis=0)
    return _Pose(x, y, cos, sin, 0.0 - turned)  # no negative zero
