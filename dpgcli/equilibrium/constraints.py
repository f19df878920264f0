"""Unilateral constraints g(x) ≥ b on a potential: as energies, exactly, and followed as b changes.

Two ways, for the same minima:

- from afar the augmented Lagrangian, E + Σ (max(0, μ − σ t)² − μ²)/2σ with t = g − b: an energy
  like others, minimized again and again while μ ← max(0, μ − σ t) (Nocedal and Wright, Numerical
  Optimization, 2nd ed., 2006, section 17.3);
- near by the multipliers of a set of active constraints as coordinates: with y = μ/σ the Lagrangian
  is E + Σ ½ σ (t − y)² over active ones − Σ ½ σ y² over all. It is stationary where active t are 0
  and the other y are 0, and its Hessian has one negative pivot for each y where the minimum is one
  on the tangent space (ours; the quadratic term changes nothing there).

So constraints are terms beside others, a measure under a law, and paths know nothing of them.
"""

from dataclasses import field, replace
from functools import cached_property
from typing import Generic, Self

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, total
from dpgcli.equilibrium.contracts import (
    Coordinates,
    Measured,
    OwnCoordinate,
    Response,
    Row,
    System,
    Term,
    WideMeasure,
    WideMeasured,
    take_lanes,
)
from dpgcli.records import dataclass


@dataclass(frozen=True)
class AugmentedContact:
    """The augmented Lagrangian of t = g − b ≥ 0: μ (cell, batch) in N, σ in N/mm, b in mm.

    Of cells that `are_kept`, (cell, 1), it is that of t = 0; b is (batch,) or by cell.

    >>> law = AugmentedContact(np.array([[2.0]]), np.array([[10.0]]), np.zeros(1))
    >>> [float(law(np.array([[gap]])).force[0, 0]) for gap in (-0.1, 0.1, 0.3)]  # N
    [-3.0, -1.0, 0.0]
    """

    multiplier: Array
    stiffness: Array
    bound: Array
    are_kept: Flags = field(default_factory=lambda: np.zeros((1, 1), bool))

    def pushes(self, gap: Array) -> Array:
        """max(0, μ − σ t), N; μ − σ t of cells that are kept."""
        push = self.multiplier - self.stiffness * (gap - self.bound)
        return np.where(self.are_kept, push, np.maximum(0.0, push))

    def __call__(self, scalar: Array) -> Response:
        """Energy, force and stiffness."""
        push = self.pushes(scalar)
        energy = (push * push - self.multiplier * self.multiplier) / (2.0 * self.stiffness)
        acts = (push > 0.0) | self.are_kept
        return Response(energy, 0.0 - push, np.where(acts, self.stiffness, 0.0))

    def take_lanes(self, index: Indices) -> Self:
        """The same law for some lanes of the batch."""
        parts = (self.multiplier, self.stiffness, self.bound)
        multiplier, stiffness, bound = (take_lanes(part, index) for part in parts)
        return type(self)(multiplier, stiffness, bound, self.are_kept)


@dataclass(frozen=True)
class Extended(Generic[System]):
    """Coordinates, and behind them `n` lengths of their own: multipliers y = μ/σ, or motions.

    `length` (mm) is what is large of them, `stiffness` σ (N/mm) what their curvature is measured
    by, both (1, 1 or batch).
    """

    frame: System
    n: int
    length: Array
    stiffness: Array

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return self.frame.size + self.n

    def _with(self, own: Array, values: Array) -> Array:
        batch = np.broadcast_shapes(own.shape[1:], values.shape[1:])
        parts = np.broadcast_to(own, (len(own), *batch)), np.broadcast_to(values, (self.n, *batch))
        return np.concatenate(parts)

    @cached_property
    def force_unit(self) -> Array:
        """1 for lengths."""
        return self._with(self.frame.force_unit, np.ones((1, 1)))

    @cached_property
    def gradient_scale(self) -> Array:
        """σ times what is large of a length, N."""
        return self._with(self.frame.gradient_scale, self.stiffness * self.length)

    @cached_property
    def stiffness_scale(self) -> Array:
        """σ, N/mm."""
        return self._with(self.frame.stiffness_scale, self.stiffness)

    @cached_property
    def step_cap(self) -> Array:
        """What is large of a length, mm."""
        return self._with(self.frame.step_cap, self.length)

    def take_lanes(self, index: Indices) -> Self:
        """The same coordinates for some lanes of the batch."""
        length, stiffness = take_lanes(self.length, index), take_lanes(self.stiffness, index)
        frame = self.frame.take_lanes(index)
        return replace(self, frame=frame, length=length, stiffness=stiffness)

    def moved(self, coordinates: Array, step: Array) -> Array:
        """As in the frame; lengths go straight."""
        size = self.frame.size
        own = self.frame.moved(coordinates[:size], step[:size])
        return np.concatenate((own, coordinates[size:] + step[size:]))


@dataclass(frozen=True)
class Slack:
    """g − y of every constraint, with g by the first `size` coordinates and y behind them.

    Lane by lane y are those of the constraints in `multiplied`, and 0 of the others.
    """

    gaps: WideMeasure
    size: int
    multiplied: "Multiplied"

    @property
    def n_cells(self) -> int:
        """One for each constraint."""
        return self.gaps.n_cells

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """Those of the gaps and of the multipliers."""
        return (*self.gaps.rows, *(Row(0, self.size + k) for k in range(self.multiplied.n)))

    @cached_property
    def _by_multiplier(self) -> Array:
        """−1 where a multiplier is a constraint's, (multiplier, cell, batch)."""
        return np.where(self.multiplied.are_of(self.n_cells), -1.0, 0.0)

    def __call__(self, coordinates: Array) -> WideMeasured:
        """g − y with its derivatives, (cell, batch)."""
        gaps = self.gaps(coordinates[: self.size])
        n, n_rows, batch = self.multiplied.n, len(self.gaps.rows), coordinates.shape[1]
        own = np.broadcast_to(self._by_multiplier, (n, self.n_cells, batch))

        def bent(force: Array) -> Array:
            whole = np.zeros((n_rows + n, n_rows + n, batch))
            whole[:n_rows, :n_rows] = gaps.bent(force)
            return whole

        value = gaps.value + total(self._by_multiplier * coordinates[self.size :, None])
        return WideMeasured(value, np.concatenate((gaps.gradient, own)), bent, gaps.place)

    def take_lanes(self, index: Indices) -> Self:
        """The same measure for some lanes of the batch."""
        gaps, multiplied = self.gaps.take_lanes(index), self.multiplied.take_lanes(index)
        return replace(self, gaps=gaps, multiplied=multiplied)


@dataclass(frozen=True)
class Multiplied:
    """The constraints that have multipliers: by `cells` (multiplier, batch), −1 for none.

    There are as many multipliers as the lane with most active constraints needs, and at least as
    many as are asked for, if there are so many constraints.

    >>> own = Multiplied.of(np.array([[False, True], [True, False], [True, False]]))
    >>> own.cells.tolist(), own.spread(np.array([[5.0, 6.0], [7.0, 0.0]]), 3).tolist()
    ([[1, 0], [2, -1]], [[0.0, 6.0], [5.0, 0.0], [7.0, 0.0]])
    """

    cells: Indices

    @classmethod
    def of(cls, active: Flags, least: int = 1) -> Self:
        """Those that are active, (cell, batch)."""
        n = max(1, least, int(active.sum(axis=0).max(initial=0)))
        first = np.argsort(~active, axis=0, kind="stable")[:n]
        return cls(np.where(np.take_along_axis(active, first, axis=0), first, -1))

    @property
    def n(self) -> int:
        """Number of multipliers."""
        return len(self.cells)

    def are_of(self, n_cells: int) -> Flags:
        """Which constraint each is of, (multiplier, cell, batch)."""
        return np.asarray(self.cells[:, None] == np.arange(n_cells)[:, None])

    def spread(self, values: Array, n_cells: int) -> Array:
        """Values by multiplier, (multiplier, batch), as those of constraints, (cell, batch)."""
        return total(np.where(self.are_of(n_cells), values[:, None], 0.0))

    def taken(self, values: Array) -> Array:
        """Values of constraints, (cell, batch), by multiplier."""
        found = np.take_along_axis(values, np.maximum(self.cells, 0), axis=0)
        return np.where(self.cells >= 0, found, 0.0)

    def take_lanes(self, index: Indices) -> Self:
        """Those of some lanes."""
        return type(self)(take_lanes(self.cells, index))


@dataclass(frozen=True)
class ActiveConstraints:
    """½ σ (t − y)² of active constraints, as their bounds b = (λ − 1) D change with a load λ.

    `active` (cell, batch), `stiffness` σ (1, 1 or batch) in N/mm, `depth` D (…, batch) in mm and
    what is `large` of a gap (batch,), mm. Cells that `are_kept`, (cell, 1), stay active whatever
    the sign of y; with `limits` (kept cell, cell, 1 or batch) up to |y| = Σ limit · y of all.
    """

    active: Flags
    stiffness: Array
    depth: Array
    large: Array
    are_kept: Flags = field(default_factory=lambda: np.zeros((1, 1), bool))
    limits: Array | None = None

    @property
    def is_smooth(self) -> bool:
        """A law that is linear."""
        return True

    def at(self, load: Array) -> "ActiveAt":
        """The law at a load."""
        return ActiveAt(np.where(self.active, self.stiffness, 0.0), (load - 1.0) * self.depth)

    def rate(self, scalar: Array, load: Array) -> Array:
        """−σ D of active constraints, N per unit of λ."""
        return np.where(self.active, -self.stiffness * self.depth, 0.0 * scalar)

    def margin(self, measured: Measured | WideMeasured, load: Array) -> Array:
        """y of active constraints and t of the others, over what is large.

        Infinite for t at a place that an active constraint is at, or that is another one's own, and
        for cells that are kept: with limits how far active ones are from these.
        """
        assert isinstance(measured, WideMeasured), "places are known"
        slack = measured.value - (load - 1.0) * self.depth
        place, numbers = measured.place, np.arange(len(slack))
        is_same = place[:, None] == place[None]
        is_held = (is_same & self.active[None]).any(axis=1)
        is_elsewhere = place != numbers[:, None]
        other = np.where(is_held | is_elsewhere, np.inf, slack)
        margin = np.where(self.active, -slack, other) / self.large
        margin = np.where(self.are_kept, np.inf, margin)
        if self.limits is not None:
            y, kept = np.where(self.active, -slack, 0.0), np.flatnonzero(self.are_kept)
            most = total(np.moveaxis(self.limits * y, 1, 0))
            left = np.where(self.active[kept], most - np.abs(y[kept]), np.inf)
            margin[kept] = left / self.large
        return margin

    def take_lanes(self, index: Indices) -> Self:
        """The same law for some lanes of the batch."""
        parts = (self.stiffness, self.depth, self.large)
        stiffness, depth, large = (take_lanes(part, index) for part in parts)
        active = take_lanes(self.active, index)
        limits = None if self.limits is None else take_lanes(self.limits, index)
        return type(self)(active, stiffness, depth, large, self.are_kept, limits)


@dataclass(frozen=True)
class ActiveAt:
    """½ σ (q − b)², with σ (cell, batch) of 0 where it does not act."""

    stiffness: Array
    bound: Array

    def __call__(self, scalar: Array) -> Response:
        """Energy, force and stiffness."""
        away = scalar - self.bound
        pull = self.stiffness * away
        return Response(0.5 * pull * away, pull, self.stiffness)

    def take_lanes(self, index: Indices) -> Self:
        """The same law for some lanes of the batch."""
        return type(self)(take_lanes(self.stiffness, index), take_lanes(self.bound, index))


@dataclass(frozen=True)
class Stiffened:
    """−½ σ y² of multipliers."""

    stiffness: Array

    def __call__(self, scalar: Array) -> Response:
        """Energy, force and stiffness."""
        push = -self.stiffness * scalar
        return Response(0.5 * push * scalar, push, -self.stiffness + 0.0 * scalar)

    def take_lanes(self, index: Indices) -> Self:
        """The same law for some lanes of the batch."""
        return type(self)(take_lanes(self.stiffness, index))


def multiplier_term(system: Extended[Coordinates]) -> Term:
    """The term −½ σ y² of the multipliers."""
    own = OwnCoordinate(Row(1, system.frame.size), system.n)
    return Term("multipliers", own, Stiffened(system.stiffness))
