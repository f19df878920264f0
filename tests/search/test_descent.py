"""Batched least squares in a box, beside SciPy's, which take one problem at a time."""

import numpy as np
import pytest
from scipy.optimize import least_squares, lsq_linear

from dpgcli.arrays import Array, Indices
from dpgcli.search.descent import Descent, Residuals, descend, held


def ended(problem: "Problem", start: Array) -> Descent:
    *_, (descent, _) = descend(problem, start)
    return descent


class Problem:
    """r = b + A x + ½ c (x · x), of each lane its own."""

    def __init__(self, seed: int, n_parts: int, size: int, n_lanes: int, bend: float) -> None:
        random = np.random.default_rng(seed)
        self.matrix = random.normal(size=(n_parts, size, n_lanes))
        self.offset = random.normal(size=(n_parts, n_lanes))
        self.bend = bend * random.normal(size=(n_parts, n_lanes))

    def __call__(self, points: Array, lanes: Indices) -> Residuals:
        matrix, bend = self.matrix[..., lanes], self.bend[:, lanes]
        squares = (points**2).sum(axis=0)
        values = self.offset[:, lanes] + (matrix * points).sum(axis=1) + 0.5 * bend * squares
        return Residuals(values, matrix + bend[:, None] * points)

    def alone(self, lane: int, start: Array) -> float:
        """The least sum of squares that SciPy finds."""
        lanes = np.array([lane])
        found = least_squares(
            lambda x: self(x[:, None], lanes).values[:, 0],
            np.clip(start, 1e-3, 1.0 - 1e-3),
            lambda x: self(x[:, None], lanes).slopes[..., 0],
            bounds=(0.0, 1.0),
            xtol=1e-14,
            ftol=1e-14,
            gtol=1e-14,
        )
        return float(2.0 * found.cost)


def test_linear_problems_end_where_scipy_has_the_least() -> None:
    problem = Problem(1, 6, 4, 20, 0.0)
    descent = ended(problem, np.full((4, 20), 0.5))
    for lane in range(20):
        found = lsq_linear(
            problem.matrix[..., lane], -problem.offset[:, lane], (0.0, 1.0), tol=1e-14
        )
        assert descent.points[:, lane] == pytest.approx(found.x, abs=1e-7)
    assert held(descent.points, descent.gradient).any()  # some end at a bound


@pytest.mark.parametrize(("n_parts", "size"), [(6, 3), (2, 5), (3, 3)])
def test_bent_problems_end_no_higher_than_scipy_does(n_parts: int, size: int) -> None:
    start = np.random.default_rng(3).random((size, 12))
    problem = Problem(2, n_parts, size, 12, 0.5)
    descent = ended(problem, start)
    assert descent.is_done.all()
    for lane in range(12):
        least = problem.alone(lane, start[:, lane])
        assert descent.misfits[lane] ** 2 <= least * (1.0 + 1e-6) + 1e-12


def test_what_can_be_met_is_met_to_rounding_in_a_few_steps() -> None:
    """Where more can vary than is asked for, too; convergence is quadratic."""
    start = np.random.default_rng(3).random((5, 40))
    problem = Problem(5, 2, 5, 40, 0.3)
    wanted = np.random.default_rng(4).random((5, 40))
    problem.offset -= problem(wanted, np.arange(40)).values
    steps = list(descend(problem, start))
    descent = steps[-1][0]
    assert (descent.misfits < 1e-11).mean() > 0.9
    assert len(steps) < 20


def test_lanes_do_not_touch_each_other() -> None:
    start = np.random.default_rng(3).random((4, 9))
    problem = Problem(2, 6, 4, 9, 0.5)
    together = ended(problem, start).points

    def alone(points: Array, lanes: Indices) -> Residuals:
        return problem(points, lanes + 5)

    *_, (descent, _) = descend(alone, start[:, 5:6])
    assert descent.points[:, 0] == pytest.approx(together[:, 5], abs=1e-12)


def test_steps_to_where_there_is_nothing_are_shortened() -> None:
    """r = 10 x − 9, and nothing beyond 0.8; a start where there is nothing stays there."""

    def evaluate(points: Array, lanes: Indices) -> Residuals:
        values = np.where(points > 0.8, np.nan, 10.0 * points - 9.0)
        return Residuals(values, np.full((1, 1, len(lanes)), 10.0))

    descent = ended(evaluate, np.array([[0.1, 0.9]]))  # type: ignore[arg-type]
    assert 0.79 < descent.points[0, 0] <= 0.8
    assert np.isnan(descent.misfits[1])
    assert descent.points[0, 1] == 0.9
    assert descent.is_done.all()


def test_who_may_not_go_on_stays_where_he_is() -> None:
    problem = Problem(2, 6, 4, 9, 0.5)
    steps = list(descend(problem, np.full((4, 9), 0.5), lambda: False))
    assert len(steps) == 1
    assert not steps[0][0].is_done.any()
