"""Potentials that change with a load: fixed terms, one law on a measure that may know the load, and
terms that grow with it.

What a path of equilibria needs beside gradient and Hessian is ∂g/∂λ, and scalars by which it can be
followed where the load turns back: those of the measure.
"""

from dataclasses import replace
from functools import cached_property
from typing import Generic, NamedTuple, Protocol, Self, TypeVar

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, total
from dpgcli.equilibrium.contracts import (
    Measure,
    Measured,
    Response,
    Row,
    ScalarLaw,
    System,
    Term,
    WideMeasure,
    WideMeasured,
    take_lanes,
)
from dpgcli.equilibrium.potential import Potential, add, assemble, widely
from dpgcli.records import dataclass

Law = TypeVar("Law", bound="LoadedLaw", covariant=True)


class LoadedLaw(Protocol):
    """The energy of a scalar under a load λ, (batch,): arrays (…, cell, batch)."""

    @property
    def is_smooth(self) -> bool:
        """Whether its force bends so little that no step of a path leads over a fold and back."""

    def at(self, load: Array) -> ScalarLaw:
        """The law under a load."""

    def rate(self, scalar: Array, load: Array) -> Array:
        """∂F/∂λ."""

    def margin(self, measured: Measured | WideMeasured, load: Array) -> Array | None:
        """How far each cell is from where another law begins, at least 0; None if none does."""

    def take_lanes(self, index: Indices) -> Self:
        """The same law for some lanes of the batch."""


@dataclass(frozen=True)
class Holding:
    """A law, if any, and a spring of stiffness k towards a target on the same scalar.

    `stiffness` (cell, batch) is zero where nothing is held; `target` is (batch,) or by cell.
    """

    law: ScalarLaw | None
    stiffness: Array
    target: Array

    def __call__(self, scalar: Array) -> Response:
        """Energy, force and stiffness of both."""
        away = scalar - self.target
        pull = self.stiffness * away
        if self.law is None:
            return Response(0.5 * pull * away, pull, self.stiffness)
        energy, force, stiffness = self.law(scalar)
        return Response(energy + 0.5 * pull * away, force + pull, stiffness + self.stiffness)

    def take_lanes(self, index: Indices) -> Self:
        """The same for some lanes of the batch."""
        parts = take_lanes(self.stiffness, index), take_lanes(self.target, index)
        return type(self)(self.law and self.law.take_lanes(index), *parts)


@dataclass(frozen=True)
class Unchanged:
    """A law that knows no load (`LoadedLaw`)."""

    law: ScalarLaw
    is_smooth = True  # what bends more is for short steps

    def at(self, load: Array) -> ScalarLaw:
        """The law."""
        return self.law

    def rate(self, scalar: Array, load: Array) -> Array:
        """Zero."""
        return np.zeros_like(scalar)

    def margin(self, measured: Measured | WideMeasured, load: Array) -> None:
        """No other law begins."""

    def take_lanes(self, index: Indices) -> Self:
        """The same for some lanes of the batch."""
        return type(self)(self.law.take_lanes(index))


@dataclass(frozen=True)
class ShareOfLaw:
    """A share, (batch,), of a law."""

    law: ScalarLaw
    share: Array

    def __call__(self, scalar: Array) -> Response:
        """Energy, force and stiffness, each by the share."""
        return Response(*(self.share * part for part in self.law(scalar)))

    def take_lanes(self, index: Indices) -> Self:
        """The same for some lanes of the batch."""
        return type(self)(self.law.take_lanes(index), take_lanes(self.share, index))


class Linearized(NamedTuple):
    """Gradient, band of the Hessian and ∂g/∂λ; the followed and the loaded measure."""

    gradient: Array
    hessian: Array
    rate: Array
    followed: Measured | WideMeasured
    loaded: Measured | WideMeasured


@dataclass(frozen=True)
class LoadedPotential(Generic[System, Law]):
    """Potentials by a load: `terms` that do not feel it, and a `measure` under a loaded `law`.

    Of the terms in `growing` the load is the share that acts. Paths are followed by the scalars
    `followed`. `scale` (cell, 1 or batch) is the measure of a large change of each, `stiffness`
    (same shape) that of a spring which keeps a cell where it is, however its own law softens. A
    minimum has as many negative pivots as there are multipliers. Lanes that `may_kink`, (batch,),
    are those with constraints that may slide over corners, None where there are none.
    """

    coordinates: System
    terms: tuple[Term, ...]
    measure: Measure | WideMeasure
    law: Law
    followed: Measure | WideMeasure
    scale: Array
    stiffness: Array
    growing: tuple[Term, ...] = ()
    n_multipliers: int = 0
    may_kink: Flags | None = None

    def take_lanes(self, index: Indices) -> "LoadedPotential[System, Law]":
        """The same potential for some lanes of the batch."""
        followed = self.followed.take_lanes(index)

        def taken(term: Term) -> Term:
            law = term.law.take_lanes(index)
            is_followed = term.measure is self.followed
            measure = followed if is_followed else term.measure.take_lanes(index)
            return Term(term.kind, measure, law)

        return LoadedPotential(
            self.coordinates.take_lanes(index),
            tuple(taken(term) for term in self.terms),
            followed if self.is_by_load else self.measure.take_lanes(index),
            self.law.take_lanes(index),
            followed,
            take_lanes(self.scale, index),
            take_lanes(self.stiffness, index),
            tuple(term.take_lanes(index) for term in self.growing),
            self.n_multipliers,
            None if self.may_kink is None else take_lanes(self.may_kink, index),
        )

    @property
    def is_by_load(self) -> bool:
        """Whether paths are followed by the very scalars that are loaded."""
        return self.followed is self.measure

    def at(self, load: Array) -> Potential[System]:
        """The potential under a load, (batch,)."""
        return self._with(self.law.at(load), load)

    def held(self, load: Array, stiffness: Array, target: Array) -> Potential[System]:
        """The same, with springs of some stiffness (cell, batch) towards a target (batch,)."""
        if self.is_by_load:
            return self._with(Holding(self.law.at(load), stiffness, target), load)
        hold = Term("hold", self.followed, Holding(None, stiffness, target))
        return self._with(self.law.at(load), load, hold)

    def _with(self, law: ScalarLaw, load: Array, *others: Term) -> Potential[System]:
        loaded = self._loaded(law)
        return Potential(self.coordinates, (*self.terms, loaded, *self._grown(load), *others))

    def _loaded(self, law: ScalarLaw) -> Term:
        return Term("loaded", self.measure, law)

    def _grown(self, load: Array) -> tuple[Term, ...]:
        return tuple(replace(term, law=ShareOfLaw(term.law, load)) for term in self.growing)

    @cached_property
    def column_depths(self) -> tuple[int, ...]:
        """The depth to which each column of the Hessian may be nonzero."""
        return self.at(np.zeros(1)).column_depths

    def linearized(
        self, coordinates: Array, load: Array, stiffness: Array, target: Array, depth: int
    ) -> Linearized:
        """Derivatives at coordinates, (size, batch), with cells held as in `held`.

        Where the target is NaN cells are held where they are.
        """
        gradient = np.zeros_like(coordinates)
        hessian = np.zeros((depth + 1, *coordinates.shape))
        loaded, followed = self.looked_at(coordinates)
        target, is_held = np.where(np.isnan(target), followed.value, target), False
        for term in (*self.terms, *self._grown(load), self._loaded(self.law.at(load))):
            measure, law = term.measure, term.law
            if measure is self.followed:
                law, is_held = law if is_held else Holding(law, stiffness, target), True
                measured = followed
            else:
                measured = loaded if measure is self.measure else measure(coordinates)
            assemble(measure.rows, measured, law(measured.value), gradient, hessian)
        if not is_held:
            hold = Holding(None, stiffness, target)
            assemble(self.followed.rows, followed, hold(followed.value), gradient, hessian)
        rate = spread(self.measure.rows, loaded, self.law.rate(loaded.value, load), gradient)
        for term in self.growing:
            at = term.measure(coordinates)
            rate += spread(term.measure.rows, at, term.law(at.value).force, gradient)
        return Linearized(gradient, hessian, rate, followed, loaded)

    def looked_at(
        self, coordinates: Array
    ) -> tuple[Measured | WideMeasured, Measured | WideMeasured]:
        """The loaded and the followed measure."""
        followed = self.followed(coordinates)
        return followed if self.is_by_load else self.measure(coordinates), followed


def spread(
    rows: tuple[Row, ...], measured: Measured | WideMeasured, weights: Array, like: Array
) -> Array:
    """Σ w ∇q over cells, (size, batch), for weights (cell, batch)."""
    result = np.zeros_like(like)
    if isinstance(measured, WideMeasured):
        result[[row.offset for row in rows]] = widely(measured, weights)
        return result
    if not measured.gradient:
        add(result, rows[0], weights)
        return result
    for row, slope in zip(rows, measured.gradient, strict=True):
        add(result, row, weights * slope)
    return result


def along(rows: tuple[Row, ...], measured: Measured | WideMeasured, direction: Array) -> Array:
    """∇q · v of every cell, (cell, batch), for a direction v, (size, batch)."""
    if isinstance(measured, WideMeasured):
        return total(measured.gradient * direction[[row.offset for row in rows]][:, None])
    parts, slopes = [], measured.gradient or (np.ones((1, 1)),)
    for row, slope in zip(rows, slopes, strict=True):
        clamped = 1 if row.offset < 0 else 0
        taken = direction[row.offset + clamped * row.stride :: row.stride]
        part = np.zeros(measured.value.shape)
        n_cells = len(part) - clamped
        part[clamped:] = (slope * np.ones_like(part))[clamped:] * taken[:n_cells]
        parts.append(part)
    return total(np.stack(parts))
