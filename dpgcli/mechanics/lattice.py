"""A finger in node coordinates: the study's own form, kept as the reference.

The coordinates are the positions (B_1x, B_1y, T_1x, T_1y, B_2x, …) in mm, batch innermost;
B_0 = (0, 0) and T_0 = (0, H) are clamped. Every energy is a function of a cell's four
vectors: its chord c = B_i − B_{i-1}, its top t = T_i − T_{i-1} and its struts p = T_{i-1} −
B_{i-1} (near) and q = T_i − B_i (far). Derivatives are taken by these vectors and then
spread over the nodes whose differences they are (our derivation).

Positions in doubles resolve a stiff bar's force only down to about k_L ε times the finger's
length (`Lattice.rounding_floor`); `mechanics.chain` has no such floor.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Indices, total
from dpgcli.mechanics import laws
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.formulation import CellShape, Internal, Springs, Stations, impossible
from dpgcli.mechanics.terms import Term

FINEST_TOLERANCE = 1e-12  # the relative residual that `Lattice.gradient_scale` keeps in reach
ROUNDING_STEPS = 2.0  # of k_L ε (finger's length); see `Lattice.rounding_floor`


class Vectors(NamedTuple):
    """The vectors c, t, p and q of every cell in mm, each (2, unit, batch)."""

    chord: Array
    top: Array
    near: Array
    far: Array


class _Ends(NamedTuple):
    """The x rows of the nodes that a vector joins, counted from B_i's; negative: station i−1."""

    start: int
    stop: int


_CHORD, _TOP, _NEAR, _FAR = _Ends(-4, 0), _Ends(-2, 2), _Ends(-4, -2), _Ends(0, 2)


def vectors(finger: Finger, coordinates: Array) -> Vectors:
    """Every cell's vectors at `coordinates`, shape (size, batch)."""
    nodes = np.zeros((finger.n_units + 1, 2, 2, coordinates.shape[1]))
    nodes[0, 1, 1] = finger.segment_height[0]
    nodes[1:] = coordinates.reshape(nodes[1:].shape)
    base, top = nodes.transpose(1, 2, 0, 3)
    strut = top - base
    return Vectors(np.diff(base, axis=1), np.diff(top, axis=1), strut[:, :-1], strut[:, 1:])


def _dot(first: Array, second: Array) -> Array:
    return np.asarray(first[0] * second[0] + first[1] * second[1])


def _cross(first: Array, second: Array) -> Array:
    return np.asarray(first[0] * second[1] - first[1] * second[0])


def _outer(first: Array, second: Array) -> Array:
    return np.asarray(first[:, None] * second[None])


def _left(vector: Array) -> Array:
    """The vector turned by +90°."""
    return np.stack((-vector[1], vector[0]))


def _extension(vector: Array, rest: Array, axis: int) -> Array:
    """|v| − r as ((v∥ − r)(v∥ + r) + v⊥²)/(|v| + r), with v∥ along the straight finger's `axis`.

    Exact to rounding where the bar lies as in the straight finger.
    """
    along, across = vector[axis], vector[1 - axis]
    length = np.sqrt(along * along + across * across)
    return np.asarray(((along - rest) * (along + rest) + across * across) / (length + rest))


def _swung(vector: Array, change: Array) -> Array:
    """A vector turned and stretched at the rates of a change of it, (2, unit, batch)."""
    squared = _dot(vector, vector)
    turn, stretch = _cross(vector, change) / squared, 1.0 + _dot(vector, change) / squared
    return stretch * (np.cos(turn) * vector + np.sin(turn) * _left(vector))


class _Derivatives(NamedTuple):
    """Gradient (2, unit, batch) and Hessian (2, 2, unit, batch) of a scalar by one vector."""

    slope: Array
    bend: Array


def _stretch(response: laws.SpringResponse, vector: Array) -> _Derivatives:
    """Of a spring's energy: F n and K n nᵀ + (F/ℓ) m mᵀ, n along the spring and m across."""
    length = np.sqrt(_dot(vector, vector))
    along = vector / length
    across = _left(along)
    stiffening = response.stiffness * _outer(along, along)
    return _Derivatives(
        response.force * along, stiffening + response.force / length * _outer(across, across)
    )


def _turn(vector: Array) -> _Derivatives:
    """Of the direction θ = atan2(v_y, v_x): g = m/|v|, and −(g hᵀ + h gᵀ) with h = n/|v|."""
    radial = vector / _dot(vector, vector)
    slope = _left(radial)
    mixed = _outer(slope, radial)
    return _Derivatives(slope, -(mixed + mixed.swapaxes(0, 1)))


def _add(target: Array, row: int, values: Array) -> None:
    """Add one value per unit, (unit, batch), at a row counted from B_i's; the base has none."""
    clamped = 1 if row < 0 else 0
    stations = target.reshape(-1, 4, target.shape[1])
    stations[: len(values) - clamped, row] += values[clamped:]


def _add_slope(gradient: Array, ends: _Ends, slope: Array) -> None:
    """Spread the gradient by one vector over its two nodes."""
    for axis in (0, 1):
        _add(gradient, ends.start + axis, -slope[axis])
        _add(gradient, ends.stop + axis, slope[axis])


def _add_bend(hessian: Array, first: _Ends, second: _Ends, bend: Array) -> None:
    """Spread the second derivatives by two vectors, (2, 2, unit, batch), over their nodes.

    A mixed block stands for itself and for its transpose.
    """
    mixed = first != second
    for (end, row), (other, column) in product(enumerate(first), enumerate(second)):
        for p, q in product((0, 1), repeat=2):
            depth, start = abs(row + p - column - q), min(row + p, column + q)
            above_diagonal = row + p < column + q
            if depth >= len(hessian) or (above_diagonal and not mixed):
                continue  # between clamped nodes of a single unit, or a mirror image
            values = bend[p, q] if end == other else -bend[p, q]
            _add(hessian[depth], start, 2.0 * values if mixed and depth == 0 else values)


@dataclass(frozen=True)
class BistableSprings:
    """The domes, between T_{i-1} and T_i, with rest length L."""

    finger: Finger
    kind: str = "bistable"

    def add_to(self, coordinates: Array, gradient: Array, hessian: Array) -> Array:
        finger = self.finger
        top = vectors(finger, coordinates).top
        response = finger.springs(_extension(top, finger.segment_length, 0))
        slope, bend = _stretch(response, top)
        _add_slope(gradient, _TOP, slope)
        _add_bend(hessian, _TOP, _TOP, bend)
        return total(response.energy)


class Corners(NamedTuple):
    """Corner angles at the near and far station in rad, (unit, batch), positive when open."""

    near: Array
    far: Array


def corners(cell: Vectors) -> Corners:
    """a = ∠p − ∠c − π/2 and b = ∠c + π/2 − ∠q, from products that vanish at rest."""
    chord, near, far = cell.chord, cell.near, cell.far
    return Corners(
        np.arctan2(-_dot(chord, near), _cross(chord, near)),
        np.arctan2(_dot(chord, far), _cross(chord, far)),
    )


@dataclass(frozen=True)
class Hinges:
    """Two corners per unit, each of stiffness k_c = 2 k_θ: E = ½ k_c (a² + b²)."""

    finger: Finger
    kind: str = "hinge"

    def add_to(self, coordinates: Array, gradient: Array, hessian: Array) -> Array:
        cell = vectors(self.finger, coordinates)
        corner = 2.0 * self.finger.hinge_stiffness
        near, far = (laws.quadratic(angle, corner) for angle in corners(cell))
        turns = {
            _CHORD: (_turn(cell.chord), far.force - near.force, near.stiffness + far.stiffness),
            _NEAR: (_turn(cell.near), near.force, near.stiffness),
            _FAR: (_turn(cell.far), -far.force, far.stiffness),
        }
        for ends, (turn, moment, stiffness) in turns.items():
            _add_slope(gradient, ends, moment * turn.slope)
            bend = stiffness * _outer(turn.slope, turn.slope) + moment * turn.bend
            _add_bend(hessian, ends, ends, bend)
        chord = turns[_CHORD][0].slope
        for strut in (_NEAR, _FAR):
            turn, _, stiffness = turns[strut]
            _add_bend(hessian, strut, _CHORD, -stiffness * _outer(turn.slope, chord))
        return total(near.energy) + total(far.energy)


@dataclass(frozen=True)
class Bars:
    """Chords of rest length L and struts of rest length H, nearly rigid: E = ½ k_L e²."""

    finger: Finger
    kind: str = "bar"

    def add_to(self, coordinates: Array, gradient: Array, hessian: Array) -> Array:
        finger = self.finger
        cell = vectors(finger, coordinates)
        chord = _extension(cell.chord, finger.segment_length, 0)
        strut = _extension(cell.far, finger.segment_height, 1)
        energy = np.zeros(1)
        for ends, vector, extension in ((_CHORD, cell.chord, chord), (_FAR, cell.far, strut)):
            response = laws.quadratic(extension, finger.linear_stiffness)
            slope, bend = _stretch(response, vector)
            _add_slope(gradient, ends, slope)
            _add_bend(hessian, ends, ends, bend)
            energy = energy + total(response.energy)
        return energy


@dataclass(frozen=True)
class Lattice:
    """The potential of an unloaded finger in node coordinates (`formulation.Formulation`).

    Raises ValueError for a finger of rigid bars: what is infinitely stiff has no energy here.
    """

    finger: Finger

    def __post_init__(self) -> None:
        if self.finger.is_rigid:
            raise ValueError("linear_stiffness is infinite: the lattice needs elastic bars")

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        finger = self.finger
        hinges = (Hinges(finger),) if finger.hinge_stiffness.any() else ()
        return (BistableSprings(finger), *hinges, Bars(finger))

    @cached_property
    def reach(self) -> tuple[int, ...]:
        """Corners tie B_{i-1} to T_i; without them elimination still ties T_{i-1} to B_i."""
        inner = (7, 6, 5, 4) if self.finger.hinge_stiffness.any() else (5, 4, 5, 4)
        return inner * (self.finger.n_units - 1) + (3, 2, 1, 0)

    def _distances(self) -> Array:
        """How far the stations reach from the base, Σ L + H in mm, shape (unit, designs)."""
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
        return np.ones((4 * self.finger.n_units, 1))

    @cached_property
    def rounding_floor(self) -> Array:
        """Where the residual stops falling, N, shape (1, designs): 2 k_L ε (Σ L + H).

        A position is stored to within ε/2 of itself, a bar's extension is the difference of
        two, and up to three bars meet at a node. Measured at equilibria of 1 to 40 units
        with k_L from 1e3 to 1e9 N/mm: Newton's iterates stay below half of it.
        """
        rounding = ROUNDING_STEPS * np.finfo(float).eps * self._distances()[-1:]
        return np.asarray(self.finger.linear_stiffness * rounding)

    @cached_property
    def gradient_scale(self) -> Array:
        """The stronger unit's forces at a node, and what keeps `FINEST_TOLERANCE` in reach."""
        scale = self.finger.force_scale
        shared = scale.copy()
        shared[:-1] = np.maximum(scale[:-1], scale[1:])
        return self._rowwise(shared + self.rounding_floor / FINEST_TOLERANCE)

    @cached_property
    def stiffness_scale(self) -> Array:
        """Of the springs and hinges, k_b + k_θ/H²: what a soft direction is measured by."""
        return self._rowwise(self.finger.force_scale / self.finger.stroke)

    @cached_property
    def step_cap(self) -> Array:
        """What a turn of the whole finger by 0.2 d/H, at most 0.3 rad, moves a node by."""
        turn = np.minimum(0.2 * self.finger.stroke / self.finger.segment_height, 0.3)
        return self._rowwise(turn * self._distances())

    def designs(self, index: Indices) -> "Lattice":
        return Lattice(self.finger.designs(index))

    def moved(self, coordinates: Array, step: Array) -> Array:
        """Turn and stretch bars by the step's linear rates, from the base on.

        Nodes that went straight would stretch every bar that turns, by the square of the
        turn, and a stiff bar would then allow tiny steps only.
        """
        before = vectors(self.finger, coordinates)
        change = vectors(self.finger, step)
        base = np.cumsum(_swung(before.chord, change.chord), axis=1)
        top = base + _swung(before.far, change.far)
        return np.stack((*base, *top), axis=1).reshape(coordinates.shape)

    def coordinates(self, shape: Internal) -> Array:
        chain = Chain(self.finger)
        stations = chain.stations(chain.coordinates(shape))
        nodes = np.stack(np.broadcast_arrays(*stations), axis=1)
        return nodes.reshape(-1, nodes.shape[2])

    def openings(self, coordinates: Array) -> Array:
        return self.springs(coordinates).extension

    def springs(self, coordinates: Array) -> Springs:
        cell = vectors(self.finger, coordinates)
        along = cell.top / np.hypot(*cell.top)
        levers = _cross(along, cell.near), _cross(along, cell.far)
        shape = CellShape(np.hypot(*cell.chord), np.hypot(*cell.far), *corners(cell), *levers)
        extension = _extension(cell.top, self.finger.segment_length, 0)
        return Springs(extension, impossible(shape), np.stack(levers))

    def corner_moments(self, coordinates: Array, gradient: Array) -> Array:
        base, top = coordinates.reshape(-1, 2, 2, coordinates.shape[1]).transpose(1, 2, 0, 3)
        on_base, on_top = gradient.reshape(-1, 2, 2, gradient.shape[1]).transpose(1, 2, 0, 3)
        own = _cross(top - base, on_top)  # of each station's strut, about the station
        beyond = np.cumsum((on_base + on_top)[:, ::-1], axis=1)[:, ::-1]
        # about the station before: beyond it all forces act at the next station, as it were
        chord = np.diff(base, axis=1, prepend=0.0)
        about_near = np.cumsum((own + _cross(chord, beyond))[::-1], axis=0)[::-1]
        about_far = about_near - _cross(chord, beyond)
        return -np.stack((about_near, about_far))

    def stations(self, coordinates: Array) -> Stations:
        return Stations(*(coordinates[k::4] for k in range(4)))

    def tip(self, coordinates: Array) -> tuple[Array, Array]:
        cell = vectors(self.finger, coordinates)
        near, far = corners(cell)  # their sum counts full turns, an angle of the strut would not
        tip = np.stack((coordinates[-4], coordinates[-3], -total(near + far)))
        jacobian = np.zeros((len(coordinates), 3, coordinates.shape[1]))
        jacobian[-4, 0] = jacobian[-3, 1] = 1.0
        turn = _turn(cell.far[:, -1]).slope
        jacobian[-4:-2, 2], jacobian[-2:, 2] = -turn, turn
        return tip, jacobian

    def station_jacobian(self, coordinates: Array) -> Array:
        size, batch = coordinates.shape
        return np.repeat(np.eye(size)[:, :, None], batch, axis=2)
