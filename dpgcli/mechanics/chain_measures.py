"""The measures of a finger's energies in internal coordinates."""

from dataclasses import replace
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Self

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.equilibrium.contracts import Measured, Outer, OwnCoordinate, Pair, Row, take_lanes
from dpgcli.mechanics.chain_geometry import cells, internal, pose_of
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass

RIGID, ELASTIC = ("a", "b"), ("e", "a", "b", "s")
FROM_BASE = ("a", "e", "b", "s")  # what each of them moves lies beyond it


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
    """x or y of the tip, or of the center of the tops T_i by their `shares` (unit, 1 or batch).

    In mm, by all corners and bars: one cell. Each coordinate moves all that lies beyond it; from
    the base on they are a, e, b and s of every unit. With w the shares of what lies beyond,
    M = Σ w p and W = Σ w of it, and R a turn by −1: ∂/∂θ = R (M − W B) for a corner at station B,
    ∂/∂e = W u along the chord and ∂/∂s = w n along the strut. A corner turns the slope of each
    coordinate beyond it, ∂²/∂θ ∂q = R ∂/∂q; what follows a bar only shifts (our derivation).
    """

    n_units: int
    length: Array
    height: Array
    is_rigid: bool
    axis: int
    shares: Array | None = None
    n_cells: int = 1

    @cached_property
    def _letters(self) -> tuple[str, ...]:
        """The coordinates of a unit that it is by, from the lowest row on."""
        return RIGID if self.is_rigid else ELASTIC[:3] if self.shares is None else ELASTIC

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """Rows of a and b of every unit, or of e, a, b and perhaps s."""
        step = len(RIGID if self.is_rigid else ELASTIC)
        places = range(len(self._letters))
        return tuple(Row(1, step * unit + k) for unit in range(self.n_units) for k in places)

    @cached_property
    def _bent(self) -> tuple[tuple[Pair, int], ...]:
        """Pairs of rows whose first, from the base on, is a corner; and the place of the other."""
        names = [(unit, name) for unit in range(self.n_units) for name in self._letters]
        ranks = [(unit, FROM_BASE.index(name)) for unit, name in names]
        found = []
        for pair in combinations_with_replacement(range(len(names)), 2):
            before, beyond = sorted(pair, key=ranks.__getitem__)
            if names[before][1] in RIGID:
                found.append((pair, beyond))
        return tuple(found)

    def __call__(self, coordinates: Array) -> Measured:
        """x or y with its derivatives, (1, batch)."""
        shape = internal(coordinates, self.is_rigid)
        pose = pose_of(shape, self.length)
        bases = np.stack((pose.x, pose.y))
        chord = np.stack((pose.chord_cos, pose.chord_sin))
        normal = np.stack((-np.sin(pose.strut_angle), np.cos(pose.strut_angle)))
        points, shares = bases, np.zeros((self.n_units, 1))
        if self.shares is None:
            shares[-1] = 1.0
        else:
            points, shares = bases + (self.height + shape.strut) * normal, shares + self.shares
        weighed, share = _beyond(shares * points), _beyond(shares)
        before = np.concatenate((np.zeros_like(bases[:, :1]), bases[:, :-1]), axis=1)
        slopes = {
            "e": share * chord,
            "a": _turned(weighed - share * before),
            "b": _turned(weighed - share * bases),
            "s": shares * normal,
        }
        by_row = [slopes[name][:, u] for u in range(self.n_units) for name in self._letters]
        bends = [_turned(slope)[self.axis][None] for slope in by_row]
        entries = {pair: bends[beyond] for pair, beyond in self._bent}
        gradient = tuple(slope[self.axis][None] for slope in by_row)
        return Measured(weighed[self.axis, :1], gradient, None, entries)

    def take_lanes(self, index: Indices) -> Self:
        """The same measure for some lanes of the batch."""
        length, height = (take_lanes(part, index) for part in (self.length, self.height))
        shares = None if self.shares is None else take_lanes(self.shares, index)
        return replace(self, length=length, height=height, shares=shares)


def _beyond(values: Array) -> Array:
    """Sums over each unit and all that lie beyond it; units are on the axis before the last."""
    return np.asarray(np.flip(np.cumsum(np.flip(values, -2), axis=-2), -2))


def _turned(vector: Array) -> Array:
    """A vector, by its first axis, turned by −90°."""
    return np.stack((vector[1], -vector[0]))
