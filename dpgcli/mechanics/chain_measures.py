"""The measures of a finger's energies in internal coordinates."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.equilibrium.contracts import Measured, Outer, OwnCoordinate, Row, take_lanes
from dpgcli.mechanics.chain_geometry import cells, internal, pose_of
from dpgcli.mechanics.finger import Finger

RIGID, ELASTIC = ("a", "b"), ("e", "a", "b", "s")


def own(finger: Finger, name: str) -> OwnCoordinate:
    """The measure that is a coordinate of every unit, by its letter: e, a, b or s.

    Raises ValueError for e and s of rigid bars.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> own(uniform_finger(2, **STUDY), "b")(np.arange(4.0)[:, None]).value.ravel()
    array([1., 3.])
    """
    names = RIGID if finger.is_rigid else ELASTIC
    return OwnCoordinate(Row(len(names), names.index(name)), finger.n_units)


@dataclass(frozen=True)
class Opening:
    """Extension x of every unit's bistable spring, mm.

    ∇²x = ∇w ∇wᵀ/ℓ, w being the motion of its end across the spring, and what the turning of
    struts adds (our derivation). Coordinates are s of the near strut (the unit before), e, a, b
    and s.
    """

    n_cells: int
    length: Array
    height: Array
    is_rigid: bool

    @classmethod
    def of(cls, finger: Finger) -> Self:
        """The openings of a finger."""
        return cls(finger.n_units, finger.segment_length, finger.segment_height, finger.is_rigid)

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """Rows of a and b; or of e, a, b and s, after the previous strut's if there is one."""
        if self.is_rigid:
            return Row(2, 0), Row(2, 1)
        own_rows = tuple(Row(4, k) for k in range(4))
        return own_rows if self.n_cells == 1 else (Row(4, -1), *own_rows)

    def __call__(self, coordinates: Array) -> Measured:
        """x with its derivatives, (unit, batch)."""
        shape = internal(coordinates, self.is_rigid)
        cell = cells(shape, self.length, self.height, self.is_rigid)
        along_near, along_far = cell.near_strut * cell.along_near, cell.far_strut * cell.along_far
        across_near = cell.near_strut * cell.across_near
        across_far = cell.far_strut * cell.across_far
        weight = 1.0 / cell.length
        if self.is_rigid:
            outer = Outer(weight, (across_near, across_far))
            entries = {(0, 0): across_near, (1, 1): -across_far}
            return Measured(cell.extension, (along_near, along_far), outer, entries)
        slopes: tuple[Array, ...] = cell.along_chord, along_near, along_far, cell.across_far
        across: tuple[Array, ...] = cell.across_chord, across_near, across_far, -cell.along_far
        entries = {(1, 1): across_near, (2, 2): -across_far, (2, 3): cell.along_far}
        if self.n_cells > 1:
            slopes, across = (-cell.across_near, *slopes), (cell.along_near, *across)
            entries = {(p + 1, q + 1): entry for (p, q), entry in entries.items()}
            entries[0, 2] = cell.along_near
        return Measured(cell.extension, slopes, Outer(weight, across), entries)

    def take_lanes(self, index: Indices) -> Self:
        """The same measure for some lanes of the batch."""
        length, height = (take_lanes(part, index) for part in (self.length, self.height))
        return replace(self, length=length, height=height)


@dataclass(frozen=True)
class Position:
    """The tip's x or y, mm, by all corners and chords: one cell.

    A corner turns all that lies beyond it by −1 about its station: with R that turn and r the
    tip as seen from the station, ∂/∂θ = R r, ∂²/∂θ_k ∂θ_l = R² r_l = −r_l for l at or beyond k,
    and a chord that lies beyond k has its direction u turned, ∂²/∂θ_k ∂e = R u (our derivation).
    """

    n_units: int
    length: Array
    is_rigid: bool
    axis: int
    n_cells: int = 1

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """Rows of e, a and b of every unit, or of a and b."""
        step, used = (2, (0, 1)) if self.is_rigid else (4, (0, 1, 2))
        return tuple(Row(1, step * unit + k) for unit in range(self.n_units) for k in used)

    def __call__(self, coordinates: Array) -> Measured:
        """x or y with its derivatives, (1, batch)."""
        pose = pose_of(internal(coordinates, self.is_rigid), self.length)
        stations = np.stack((pose.x, pose.y))
        tip = stations[:, -1:]
        away = tip - np.concatenate((np.zeros_like(tip), stations), axis=1)  # from B_0 … B_n
        chord = np.stack((pose.chord_cos, pose.chord_sin))
        parts: list[tuple[bool, int, Array]] = []  # is it a corner, at which station, ∂/∂
        for unit in range(self.n_units):
            if not self.is_rigid:
                parts.append((False, unit, chord[:, unit]))
            parts += [(True, at, _turned(away[:, at])) for at in (unit, unit + 1)]
        entries = {}
        for second, (is_corner, at, slope) in enumerate(parts):
            for first, (is_first_corner, first_at, first_slope) in enumerate(parts[: second + 1]):
                if is_first_corner and first_at <= at:
                    entries[first, second] = _turned(slope)[self.axis][None]
                elif is_corner and at <= first_at:
                    entries[first, second] = _turned(first_slope)[self.axis][None]
        slopes = tuple(slope[self.axis][None] for _, _, slope in parts)
        return Measured(tip[self.axis], slopes, None, entries)

    def take_lanes(self, index: Indices) -> Self:
        """The same measure for some lanes of the batch."""
        return replace(self, length=take_lanes(self.length, index))


def _turned(vector: Array) -> Array:
    """A vector (2, batch) turned by −90°."""
    return np.stack((vector[1], -vector[0]))
