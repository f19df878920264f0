"""Constraints on a potential: the Lagrangian with multipliers as coordinates, and its inertia."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.banded import factorize
from dpgcli.equilibrium.constraints import (
    ActiveConstraints,
    AugmentedContact,
    Extended,
    Multiplied,
    Slack,
    multiplier_term,
)
from dpgcli.equilibrium.contracts import (
    Measured,
    OwnCoordinate,
    Response,
    Row,
    Term,
    WideMeasured,
)
from dpgcli.equilibrium.corrector import corrected
from dpgcli.equilibrium.joined import terms_of_part
from dpgcli.equilibrium.loaded import LoadedPotential
from dpgcli.equilibrium.newton import minimize
from dpgcli.equilibrium.potential import Potential

SIGMA = 7.0


@dataclass(frozen=True)
class Quadric:
    """Scalars c + gᵀx + ½ xᵀ A x of all coordinates, A (cell, row, row)."""

    constant: Array
    slope: Array
    bend: Array

    @property
    def n_cells(self) -> int:
        return len(self.constant)

    @property
    def rows(self) -> tuple[Row, ...]:
        return tuple(Row(0, k) for k in range(self.slope.shape[1]))

    def __call__(self, x: Array) -> WideMeasured:
        turned = np.einsum("cij,jb->cib", self.bend, x)
        value = self.constant[:, None] + self.slope @ x + 0.5 * np.einsum("ib,cib->cb", x, turned)
        gradient = np.moveaxis(self.slope[..., None] + turned, 1, 0)
        place = np.broadcast_to(np.arange(self.n_cells)[:, None], value.shape)

        def bent(force: Array) -> Array:
            return np.einsum("cb,cij->ijb", force, self.bend)

        return WideMeasured(value, gradient, bent, place)

    def take_lanes(self, index: Indices) -> "Quadric":
        return self


@dataclass(frozen=True)
class Wells:
    """E = ¼ q⁴ − ½ k q²: convex far out, concave near zero where k is positive."""

    k: float

    def __call__(self, q: Array) -> Response:
        return Response(0.25 * q**4 - 0.5 * self.k * q**2, q**3 - self.k * q, 3 * q**2 - self.k)

    def take_lanes(self, index: Indices) -> "Wells":
        return self


@dataclass(frozen=True)
class Each:
    """Each of the first coordinates, told with its gradient of 1, as paths want it."""

    n_cells: int

    @property
    def rows(self) -> tuple[Row, ...]:
        return (Row(1, 0),)

    def __call__(self, x: Array) -> Measured:
        return Measured(x[: self.n_cells], (np.ones((1, 1)),))

    def take_lanes(self, index: Indices) -> "Each":
        return self


@dataclass(frozen=True)
class Lengths:
    """Coordinates of one scale, moved straight."""

    size: int

    @property
    def force_unit(self) -> Array:
        return np.ones((self.size, 1))

    gradient_scale = stiffness_scale = step_cap = force_unit

    def take_lanes(self, index: Indices) -> "Lengths":
        return self

    def moved(self, coordinates: Array, step: Array) -> Array:
        return coordinates + step


def quadrics(seed: int, size: int, n: int) -> Quadric:
    random = np.random.default_rng(seed)
    bend = random.normal(0.0, 0.3, (n, size, size))
    slope, constant = random.normal(0.0, 1.0, (n, size)), random.normal(0.0, 0.5, n)
    return Quadric(constant, slope, bend + np.swapaxes(bend, 1, 2))


def lagrangian(
    gaps: Quadric, active: Flags, k: float, depth: float = 0.0
) -> LoadedPotential[Any, ActiveConstraints]:
    """Wells in each coordinate under constraints; the load raises bounds by `depth`."""
    size, n = gaps.slope.shape[1], gaps.n_cells
    sigma, large = np.array([[SIGMA]]), np.ones((1, 1))
    system = Extended(Lengths(size), n, large, sigma)
    bare = (Term("wells", OwnCoordinate(Row(1, 0), size), Wells(k)),)
    law = ActiveConstraints(active, sigma, np.array([depth]), large[0])
    terms = (*terms_of_part(bare, 0, 1, size), multiplier_term(system))
    return LoadedPotential(
        system,
        terms,
        Slack(gaps, size, Multiplied.of(np.ones((n, 1), bool))),
        law,
        Each(size),
        np.ones((size, 1)),
        np.ones((size, 1)),
        n_multipliers=n,
    )


@pytest.mark.parametrize("active", [[True, False, True], [False] * 3, [True] * 3])
def test_derivatives_of_the_lagrangian(active: list[bool], dense: Callable[[Array], Array]) -> None:
    gaps = quadrics(1, 4, 3)
    potential = lagrangian(gaps, np.array(active)[:, None], 0.7, 0.4).at(np.array([0.2]))
    x, scale = np.random.default_rng(2).normal(0.0, 0.6, (7, 1)), np.eye(7)[:, :, None]

    def difference(function: Callable[[Array], Array]) -> Array:
        h = 1e-3
        return np.array(
            [
                (8.0 * (function(x + h * e) - function(x - h * e)))
                - (function(x + 2 * h * e) - function(x - 2 * h * e))
                for e in scale
            ]
        ) / (12.0 * h)

    here = potential.evaluate(x)
    slope = difference(lambda at: potential.evaluate(at).energy)
    assert here.gradient == pytest.approx(slope, rel=1e-7, abs=1e-9)
    bend = difference(lambda at: potential.evaluate(at).gradient)[:, :, 0]
    exact, tolerance = dense(here.hessian), 1e-7 * np.abs(bend) + 1e-9
    assert (np.abs(exact - bend) <= tolerance).all()
    assert (np.abs(1.00001 * exact - bend) > tolerance).any(), "an error of 0.001 % is seen"


@pytest.mark.parametrize("k", [-1.0, 0.5, 3.0])
def test_its_energy_is_the_lagrangian_plus_a_square(k: float) -> None:
    """E + Σ_active (½ σ t² − μ t) − Σ_others ½ μ²/σ, term by term from the definition."""
    gaps, active = quadrics(3, 4, 3), np.array([[True], [False], [True]])
    x, y = np.random.default_rng(4).normal(0.0, 0.6, (2, 4, 1))
    y, load, depth = y[:3], 0.3, 0.5
    t = gaps(x).value - (load - 1.0) * depth
    mu = SIGMA * y
    closed = (0.5 * SIGMA * t**2 - mu * t)[active].sum()
    expected = (0.25 * x**4 - 0.5 * k * x**2).sum() + closed - (0.5 * mu**2 / SIGMA)[~active].sum()
    family = lagrangian(gaps, active, k, depth)
    found = family.at(np.array([load])).evaluate(np.vstack((x, y))).energy[0]
    assert found == pytest.approx(expected, rel=1e-12)


class Point(NamedTuple):
    """A random point where the active ones of three constraints are closed, with pushes μ.

    `reduced` are the eigenvalues of the Lagrangian's Hessian on the tangent space, densely.
    """

    gaps: Quadric
    active: Flags
    x: Array
    mu: Array
    reduced: Array


def random_point(seed: int) -> Point:
    random = np.random.default_rng(seed)
    gaps, active = quadrics(seed, 5, 3), random.random((3, 1)) < 0.6
    x, mu = random.normal(0.0, 0.7, (5, 1)), np.where(active, random.uniform(0.1, 2.0, (3, 1)), 0)
    gaps = replace(gaps, constant=gaps.constant - np.where(active, gaps(x).value, 0.0)[:, 0])
    normals = gaps(x).gradient[:, active[:, 0], 0]
    tangent = np.linalg.svd(normals)[0][:, normals.shape[1] :]
    whole = np.diag((3.0 * x**2 - 1.0)[:, 0]) - np.einsum("c,cij->ij", mu[:, 0], gaps.bend)
    return Point(gaps, active, x, mu, np.linalg.eigvalsh(tangent.T @ whole @ tangent))


@pytest.mark.parametrize("seed", range(12))
def test_negative_pivots_are_those_of_multipliers_exactly_at_constrained_minima(
    seed: int, dense: Callable[[Array], Array]
) -> None:
    """By eigenvalues of the whole."""
    point = random_point(seed)
    family = lagrangian(point.gaps, point.active, 1.0)
    found = family.at(np.ones(1)).evaluate(np.vstack((point.x, point.mu / SIGMA)))
    values = np.linalg.eigvalsh(dense(found.hessian))
    assert (values < 0.0).sum() == 3 + (point.reduced < 0.0).sum()
    pivots = factorize(found.hessian, family.column_depths).pivots
    assert (pivots < 0.0).sum() == (values < 0.0).sum()


def test_inertia_is_seen_both_ways() -> None:
    """Of the points above some are minima on their tangent spaces and some are not."""
    kinds = {bool((random_point(seed).reduced > 0.0).all()) for seed in range(12)}
    assert kinds == {True, False}


def half_plane(size: int = 2) -> Quadric:
    """x_0 + x_1 ≥ 3."""
    slope = np.zeros((1, size))
    slope[0, :2] = 1.0
    return Quadric(np.array([-3.0]), slope, np.zeros((1, size, size)))


def test_a_point_of_a_plane_in_closed_form() -> None:
    """E = ¼ Σ q⁴ + ½ Σ q² on x_0 + x_1 ≥ 3: both at 1.5, and μ = 1.5³ + 1.5."""
    family = lagrangian(half_plane(), np.array([[True]]), -1.0)
    nothing, load = np.array([-1]), np.ones(1)
    guess = np.array([[1.4], [1.7], [0.3]])
    found = corrected(family, guess, load, nothing, np.zeros(1), max(family.column_depths))
    assert found.is_fine.all()
    expected = [1.5, 1.5, (1.5**3 + 1.5) / SIGMA]
    assert found.coordinates[:, 0] == pytest.approx(expected, abs=1e-13)
    assert family.law.margin(found.loaded, load)[0, 0] == pytest.approx(expected[2], abs=1e-12)


def test_a_maximum_on_the_tangent_space_is_not_stable() -> None:
    """With k = 9 the same point is a maximum along the line: 3 · 1.5² − 9 < 0."""
    family = lagrangian(half_plane(), np.array([[True]]), 9.0)
    guess = np.array([[1.5], [1.5], [(1.5**3 - 13.5) / SIGMA]])
    nothing, load = np.array([-1]), np.ones(1)
    found = corrected(family, guess, load, nothing, np.zeros(1), max(family.column_depths))
    assert found.coordinates[:2, 0] == pytest.approx([1.5, 1.5])
    assert not found.is_fine.any()


def test_multipliers_found_from_afar() -> None:
    """Updates μ ← max(0, μ − σ t) go to the same μ, at the rate that theory says."""
    potential = Potential(Lengths(2), (Term("wells", OwnCoordinate(Row(1, 0), 2), Wells(-1.0)),))
    push, off, x = np.zeros((1, 1)), [], np.array([[0.1], [0.2]])
    for _ in range(20):
        law = AugmentedContact(push, np.array([[SIGMA]]), np.zeros(1))
        both = Potential(potential.coordinates, (*potential.terms, Term("c", half_plane(), law)))
        x = minimize(both, x, 1e-13).coordinates
        push = law.pushes(half_plane()(x).value)
        off.append(abs(float(push[0, 0]) - 4.875))
    assert off[-1] < 1e-6
    rate = 1.0 / (1.0 + 2.0 * SIGMA / (3.0 * 1.5**2 + 1.0))  # 1/(1 + σ gᵀ H⁻¹ g)
    assert off[6] / off[5] == pytest.approx(rate, rel=1e-3)


def test_bounds_rise_with_the_load() -> None:
    family = lagrangian(half_plane(), np.array([[True]]), -1.0, depth=2.0)
    x = np.array([[0.4], [0.9], [0.1]])
    h, load = 1e-3, np.array([0.3])
    lower, upper = (family.at(load + d).evaluate(x).gradient for d in (-h, h))
    depth = max(family.column_depths)
    free = np.zeros((2, 1)), np.zeros(1)
    rate = family.linearized(x, load, *free, depth).rate
    assert rate == pytest.approx((upper - lower) / (2 * h), rel=1e-9)
    assert np.abs(rate).max() == pytest.approx(2.0 * SIGMA)
    value = family.at(load).terms[-1].law(np.array([[-2.0 * 0.7]])).force
    assert value == pytest.approx(0.0, abs=1e-14), "t = 0 where g − y = (λ − 1) D"


def test_margins_of_places_that_are_shared() -> None:
    """Of cells at one place the first tells its gap; none does where one of them is closed."""
    law = ActiveConstraints(
        np.array([[False], [False], [True], [False]]), np.ones((1, 1)), np.zeros(1), np.array([2.0])
    )

    def margins(place: list[int]) -> list[float]:
        value = np.array([[0.5], [0.5], [-0.3], [0.8]])
        measured = WideMeasured(value, np.zeros((1, 4, 1)), lambda f: f, np.array(place)[:, None])
        found = law.margin(measured, np.ones(1))
        return [float(v) for v in found[:, 0]]

    assert margins([0, 1, 2, 3]) == [0.25, 0.25, 0.15, 0.4]
    assert margins([0, 0, 2, 3]) == [0.25, np.inf, 0.15, 0.4]
    assert margins([0, 1, 2, 2]) == [0.25, 0.25, 0.15, np.inf]


def test_margins_of_what_is_kept_up_to_a_limit() -> None:
    """|y| of the last two, which are kept, is at most a share of the first two, if these act."""
    are_kept = np.array([[False], [False], [True], [True]])
    active = np.array([[True, True], [True, False], [True, True], [True, False]])
    limits = np.zeros((2, 4, 2))
    limits[0, 0], limits[1, :2] = (0.5, 0.2), 0.4
    law = ActiveConstraints(active, np.ones((1, 1)), np.zeros(1), np.array([2.0]), are_kept, limits)
    value = -np.array([[0.6, 0.6], [0.4, 0.4], [-0.5, 0.5], [0.1, 0.1]])  # −y
    measured = WideMeasured(
        value, np.zeros((1, 4, 2)), lambda f: f, np.arange(8).reshape(4, 2) // 2
    )
    found = law.margin(measured, np.ones(2))
    assert found[2] == pytest.approx([0.5 * (0.3 - 0.5), 0.5 * (0.12 - 0.5)])
    assert found[3].tolist() == [pytest.approx(0.5 * (0.4 - 0.1)), np.inf]
    alone = law.take_lanes(np.array([1]))
    few = WideMeasured(value[:, 1:], np.zeros((1, 4, 1)), lambda f: f, np.arange(4)[:, None])
    assert alone.margin(few, np.ones(1))[2:, 0].tolist() == found[2:, 1].tolist()
    without = replace(law, limits=None).margin(measured, np.ones(2))
    assert np.isinf(without[2:]).all()


def test_lanes_taken(dense: Callable[[Array], Array]) -> None:
    sigma, large = np.array([[7.0, 3.0, 5.0]]), np.ones((1, 3))
    gaps, active = quadrics(5, 4, 2), np.array([[True, False, True], [False, True, True]])
    system = Extended(Lengths(4), 2, large, sigma)
    law = ActiveConstraints(active, sigma, np.array([1.0, 2.0, 3.0]), large[0])
    bare = terms_of_part((Term("wells", OwnCoordinate(Row(1, 0), 4), Wells(1.0)),), 0, 1, 4)
    followed, one = Each(4), np.ones((4, 1))
    family = LoadedPotential(
        system,
        (*bare, multiplier_term(system)),
        Slack(gaps, 4, Multiplied.of(np.ones((2, 3), bool))),
        law,
        followed,
        one,
        one,
        n_multipliers=2,
    )
    x, load = np.random.default_rng(6).normal(0.0, 1.0, (6, 3)), np.array([0.1, 0.5, 0.9])
    index = np.array([2, 0])
    every = family.at(load).evaluate(x)
    few = family.take_lanes(index).at(load[index]).evaluate(x[:, index])
    assert few.gradient == pytest.approx(every.gradient[:, index], rel=1e-13)
    assert few.hessian == pytest.approx(every.hessian[..., index], rel=1e-13)
    assert few.energy == pytest.approx(every.energy[index], rel=1e-13)
