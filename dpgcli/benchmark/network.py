"""A finger as a spring network, as a user would write it in NumPy from the model's definition.

It shares nothing with `mechanics` but the finger's parameters. Shapes are the free nodes
(B_1x, B_1y, T_1x, T_1y, B_2x, …) in mm.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass


class _Strains(NamedTuple):
    """A shape by its springs.

    Extensions (mm) and lengths (mm) of the spans, (span,), their unit vectors, (span, 2), and
    the angles of the corners from 90° (rad), (corner,).
    """

    extension: Array
    length: Array
    along: Array
    corner: Array


class _Rates(NamedTuple):
    """Derivatives of lengths, (span, 4 n), and of directions and corners (rad/mm) by the nodes."""

    length: Array
    direction: Array
    corner: Array


@dataclass(frozen=True)
class SpringNetwork:
    """A finger as arrays of springs along spans and of torsional springs between spans.

    Spans are the chords, the struts (the clamped one too) and the domes, in this order: their
    vectors are `incidence` (span, free node) times the nodes plus `clamped` (span, 2). Each has
    a spring, E = ½ k x² [1 + β(u² − 2u)] − P x with u = x/d, linear where β = 0, and P the push of
    a pressure on a dome. Corner c is between
    spans `chord[c]` and `strut[c]`, E = ½ k_c a². All in mm, N and rad.
    """

    incidence: Array
    clamped: Array
    rest_length: Array
    stiffness: Array
    softening: Array
    stroke: Array
    push: Array
    chord: Indices
    strut: Indices
    corner_stiffness: Array

    @classmethod
    def of(cls, finger: Finger) -> "SpringNetwork":
        """Lay a finger out; raise ValueError for several designs or rigid bars."""
        values = by_unit(finger)
        n_units, units = finger.n_units, np.arange(finger.n_units)
        length, height = values["segment_length"], values["segment_height"][0]
        n_bars = 2 * n_units + 1
        bar = np.full(n_bars, values["linear_stiffness"][0])
        incidence = _incidence(n_units)
        return cls(
            incidence=incidence[:, 2:],
            clamped=incidence[:, 1:2] * np.array([0.0, height]),  # T_0; B_0 is the origin
            rest_length=np.concatenate((length, np.full(n_units + 1, height), length)),
            stiffness=np.concatenate((bar, values["bistable_stiffness"])),
            softening=np.concatenate((np.zeros(n_bars), 1.0 - values["force_linearity"])),
            stroke=np.concatenate((np.ones(n_bars), values["stroke"])),
            push=np.zeros(n_bars + n_units),
            chord=np.concatenate((units, units)),
            strut=n_units + np.concatenate((units, units + 1)),
            corner_stiffness=np.tile(2.0 * values["hinge_stiffness"], 2),
        )

    def pushed(self, push: Array) -> "SpringNetwork":
        """The same with pushes on its domes, N, (unit,)."""
        bars = np.zeros(len(self.push) - len(push))
        return replace(self, push=np.concatenate((bars, push)))

    def energy(self, nodes: Array) -> float:
        """Energy (mJ) of a shape, (4 n,)."""
        return self._energy(self._strains(nodes))

    def energy_and_gradient(self, nodes: Array) -> tuple[float, Array]:
        """Energy (mJ) and its gradient (N), (4 n,), of a shape, (4 n,)."""
        strains = self._strains(nodes)
        rates = self._rates(strains)
        pull = self._force(strains) @ rates.length
        return self._energy(strains), pull + self._moment(strains) @ rates.corner

    def gradient(self, nodes: Array) -> Array:
        """The energy's gradient (N) alone."""
        return self.energy_and_gradient(nodes)[1]

    def hessian(self, nodes: Array) -> Array:
        """Second derivatives (N/mm), (4 n, 4 n), of the energy of a shape, (4 n,).

        With ℓ and ω the length and direction of a span, ∇²ℓ = ℓ ∇ω ∇ωᵀ and
        ∇²ω = −(∇ℓ ∇ωᵀ + ∇ω ∇ℓᵀ)/ℓ.
        """
        strains = self._strains(nodes)
        length, direction, corner = self._rates(strains)
        mixed = length.T * (self._torque(strains) / strains.length) @ direction
        return np.asarray(
            length.T * self._stiffness(strains) @ length
            + direction.T * (self._force(strains) * strains.length) @ direction
            + corner.T * self.corner_stiffness @ corner
            - (mixed + mixed.T)
        )

    def _strains(self, nodes: Array) -> _Strains:
        vector = self.incidence @ nodes.reshape(-1, 2) + self.clamped
        length = np.hypot(vector[:, 0], vector[:, 1])
        along = vector / length[:, None]
        (cx, cy), (sx, sy) = along[self.chord].T, along[self.strut].T
        corner = np.arctan2(-(cx * sx + cy * sy), cx * sy - cy * sx)
        return _Strains(length - self.rest_length, length, along, corner)

    def _rates(self, strains: _Strains) -> _Rates:
        across = np.stack((-strains.along[:, 1], strains.along[:, 0]), axis=1)
        length, direction = (
            (self.incidence[:, :, None] * vector[:, None]).reshape(len(vector), -1)
            for vector in (strains.along, across / strains.length[:, None])
        )
        return _Rates(length, direction, direction[self.strut] - direction[self.chord])

    def _energy(self, strains: _Strains) -> float:
        x, u = strains.extension, strains.extension / self.stroke
        springs = self.stiffness * x * x * (1.0 + self.softening * u * (u - 2.0))
        stored = 0.5 * float(springs.sum() + self._moment(strains) @ strains.corner)
        return stored - float(self.push @ x)

    def _force(self, strains: _Strains) -> Array:
        x, u = strains.extension, strains.extension / self.stroke
        own = self.stiffness * x * (1.0 + self.softening * u * (2.0 * u - 3.0))
        return np.asarray(own - self.push)

    def _stiffness(self, strains: _Strains) -> Array:
        u = strains.extension / self.stroke
        return np.asarray(self.stiffness * (1.0 + 6.0 * self.softening * u * (u - 1.0)))

    def _moment(self, strains: _Strains) -> Array:
        return np.asarray(self.corner_stiffness * strains.corner)

    def _torque(self, strains: _Strains) -> Array:
        """The moment of the corners on each span, N mm, counterclockwise."""
        moment, n_spans = self._moment(strains), len(strains.length)
        ahead, behind = (np.bincount(at, moment, n_spans) for at in (self.strut, self.chord))
        return np.asarray(ahead - behind, float)


def by_unit(finger: Finger) -> dict[str, Array]:
    """Every parameter of a single elastic finger, (unit,), by its name."""
    if finger.n_designs != 1 or finger.is_rigid:
        bars = "rigid" if finger.is_rigid else "elastic"
        raise ValueError(f"peers take one design with elastic bars, not {finger.n_designs}, {bars}")
    shape = (finger.n_units, 1)
    return {name: np.broadcast_to(v, shape)[:, 0] for name, v in finger.arrays().items()}


def _incidence(n_units: int) -> Array:
    """−1 and 1 at the ends of each span, (span, node), nodes being B_0, T_0, B_1, T_1, ….

    >>> _incidence(1)[1]  # the clamped strut
    array([-1.,  1.,  0.,  0.])
    """
    station, unit = 2 * np.arange(n_units + 1), 2 * np.arange(n_units)
    start = np.concatenate((unit, station, unit + 1))
    stop = np.concatenate((unit + 2, station + 1, unit + 3))
    nodes = np.eye(2 * n_units + 2)
    return nodes[stop] - nodes[start]
