"""Optima under constraints: known fronts and optima, rules without slopes, many in lockstep."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from dpgcli.arrays import Array, Indices
from dpgcli.search import constrained
from dpgcli.search.constrained import Local, Scalar, descend_within, last_that_hold, simplex
from dpgcli.search.designs import Designs, best_of
from dpgcli.search.goal import Goal
from dpgcli.search.lockstep import Ask, in_lockstep
from dpgcli.search.maps import MapEvaluation
from dpgcli.search.search import Limits, search
from dpgcli.sweeps.pressures import PressedDesigns

Make = Callable[..., Goal]
HEIGHT, SEPARATION = "finger.geometry.dome_height_mm", "finger.geometry.unit_separation_mm"
TWO = f"vary: {{{HEIGHT}: {{from: 4.5, to: 7.5}}, {SEPARATION}: {{from: 2, to: 4}}}}\n"


def toy(points: Array, _: Indices) -> Sequence[Local]:
    """f = |x − a|² and |x − b|² with a = (0.2, 0.5), b = (0.8, 0.5); x₂ >= 0.7."""
    found = []
    for x in points.T:
        away = [x - [0.2, 0.5], x - [0.8, 0.5]]
        objectives = np.array([each @ each for each in away])
        found.append(
            Local(objectives, 2.0 * np.array(away), np.array([x[1] - 0.7]), np.array([[0.0, 1.0]]))
        )
    return found


def test_a_convex_toy_has_its_known_front() -> None:
    """It is the line x₂ = 0.7 between the places of both optima, evenly reached."""
    scalars = [Scalar(weights, np.full(2, 0.04)) for weights in simplex(2)]
    starts = np.random.default_rng(1).random((2, len(scalars)))
    ends = descend_within(toy, starts, scalars, np.ones(1))
    assert ends[1] == pytest.approx(0.7, abs=3e-6)
    assert (np.diff(ends[0]) < 0.0).all()
    for x, scalar in zip(ends[0], scalars, strict=True):
        first, second = (x - 0.2) ** 2, (x - 0.8) ** 2  # above the ideal point
        assert scalar.weights[0] * first == pytest.approx(scalar.weights[1] * second, rel=1e-4)


def test_one_objective_alone_has_its_optimum() -> None:
    starts = np.random.default_rng(1).random((2, 3))
    for place, x in enumerate((0.2, 0.8)):
        scalars = [Scalar(np.eye(2)[place], np.zeros(2))] * 3
        ends = descend_within(toy, starts, scalars, np.ones(1))
        assert ends == pytest.approx(np.tile([[x], [0.7]], 3), abs=3e-6)


def test_searches_turn_around_where_there_is_nothing() -> None:
    def evaluate(points: Array, numbers: Indices) -> Sequence[Local]:
        return [
            each if x[0] < 0.6 else Local(*(np.full(part.shape, np.nan) for part in each))
            for x, each in zip(points.T, toy(points, numbers), strict=True)
        ]

    one = [Scalar(np.array([0.0, 1.0]), np.zeros(2))]
    ends = descend_within(evaluate, np.array([[0.3], [0.9]]), one, np.ones(1))
    assert 0.3 < ends[0, 0] < 0.6


def test_weights_are_spread_over_the_simplex() -> None:
    for n in (2, 3, 4):
        weights = np.array(simplex(n))
        assert weights.sum(axis=1) == pytest.approx(1.0)
        assert weights.min() > 0.0
        assert np.unique(weights.round(9), axis=0).shape == weights.shape


def test_rules_without_slopes_hold_at_the_last_point_on_the_way() -> None:
    starts, ends = np.array([[0.0, 0.0, 0.9]]), np.array([[1.0, 0.2, 1.0]])
    found = last_that_hold(lambda points: points[0] <= 0.4, starts, ends)
    assert found[0] == pytest.approx([0.4, 0.2, 0.9], abs=3e-4)
    assert (found[0, :2] <= 0.4).all()


def test_points_are_answered_in_one_batch_in_the_order_of_searches() -> None:
    batches: list[list[int]] = []

    def run(number: int, ask: Ask[float]) -> float:
        return sum(ask(np.array([float(number)])) for _ in range(number))

    def evaluate(points: Array, numbers: Indices) -> list[float]:
        batches.append(numbers.tolist())
        assert points[0].tolist() == numbers.tolist()
        return [*(10.0 * points[0])]

    assert in_lockstep(run, 4, evaluate) == [0.0, 10.0, 40.0, 90.0]
    assert batches == [[1, 2, 3], [2, 3], [3]]


def test_what_goes_wrong_in_a_batch_or_a_search_ends_all() -> None:
    def run(number: int, ask: Ask[float]) -> float:
        if number == 1:
            raise ArithmeticError
        return ask(np.zeros(1))

    with pytest.raises(ArithmeticError):
        in_lockstep(run, 3, lambda _, numbers: [0.0] * len(numbers))
    with pytest.raises(ZeroDivisionError):
        in_lockstep(lambda _, ask: ask(np.zeros(1)), 3, lambda *_: [1.0 / 0.0])


def test_whoever_is_stopped_while_searches_begin_waits_for_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As by Ctrl-C: those that have begun would wait for their answers without end."""
    submit, begun = ThreadPoolExecutor.submit, []

    def stopping(self: ThreadPoolExecutor, *arguments: Any) -> Any:
        begun.append(arguments[-1])
        if len(begun) == 3:
            raise KeyboardInterrupt
        return submit(self, *arguments)

    monkeypatch.setattr(ThreadPoolExecutor, "submit", stopping)
    with pytest.raises(KeyboardInterrupt):
        in_lockstep(lambda _, ask: ask(np.zeros(1)), 4, lambda _, numbers: [0.0] * len(numbers))
    assert begun == [0, 1, 2]


def test_margins_and_slopes_of_maps_are_those_of_sweeps(goal: Make) -> None:
    """The same numbers as a sweep has, slopes as differences of them, and names that are keys."""
    made = goal(TWO + "constraints: [min_barrier_mJ > 1, dome_height_mm - unit_separation_mm > 2]\n"
                "minimize: [reach_min_mm]\nmaximize: [unit_separation_mm]")  # fmt: skip
    evaluation = MapEvaluation(made)
    point = np.array([[0.3], [0.6]])
    maps = evaluation(made.values({}, point))
    height, separation = (made.values({}, point)[key][0] for key in (HEIGHT, SEPARATION))
    assert maps.margins[1, 0] == pytest.approx(height - separation - 2.0)
    assert maps.margin_slopes[1, :, 0] == pytest.approx([3.0, -2.0])
    assert maps.objectives[1, 0] == -separation
    assert maps.objective_slopes[1, :, 0] == pytest.approx([0.0, -2.0])
    known = [evaluation.columns(made.values({}, point + h))["reach_min_mm"][0]
             for h in np.array([[[1e-3], [0.0]], [[-1e-3], [0.0]]])]  # fmt: skip
    assert maps.objective_slopes[0, 0, 0] == pytest.approx((known[0] - known[1]) / 2e-3, rel=1e-4)


def test_a_constraint_is_active_at_the_optimum_and_holds(goal: Make) -> None:
    """The lowest dome whose barrier is large enough, as bisection finds it."""
    made = goal(f"vary: {{{HEIGHT}: {{from: 4.5, to: 7.5}}}}\nconstraints: [min_barrier_mJ > 1]\n"
                "minimize: [dome_height_mm]")  # fmt: skip
    found = search(made).best
    assert found.hold[:, 0].all()
    low, high = 4.5, 7.5
    for _ in range(40):
        middle = 0.5 * (low + high)
        barrier = MapEvaluation(made).columns({HEIGHT: np.array([middle])})["min_barrier_mJ"][0]
        low, high = (low, middle) if barrier > 1.0 else (middle, high)
    assert made.values({}, found.points)[HEIGHT][0] == pytest.approx(high, rel=1e-5)


@pytest.mark.slow
def test_with_targets_objectives_use_their_tolerance(goal: Make) -> None:
    target = "targets: [{pattern: '11100', quantity: tip, value: [52, -38], tolerance_mm: 0.5}]\n"
    met = search(goal(TWO + target)).best
    less = search(goal(TWO + target + "minimize: [dome_height_mm]")).best
    assert met.misfits[0] < 1e-9
    assert less.misses(goal(TWO + target))[0, 0] == pytest.approx(1.0, abs=1e-5)
    assert less.misses(goal(TWO + target))[0, 0] <= 1.0
    assert less.points[0, 0] < met.points[0, 0]


def test_more_searches_than_threads_are_done_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    scalars = [Scalar(weights, np.full(2, 0.04)) for weights in simplex(2)]
    starts = np.random.default_rng(1).random((2, len(scalars)))
    together = descend_within(toy, starts, scalars, np.ones(1))
    monkeypatch.setattr(constrained, "MOST_AT_ONCE", 4)
    assert np.array_equal(descend_within(toy, starts, scalars, np.ones(1)), together)


@pytest.mark.slow
def test_a_front_has_nothing_that_another_is_better_than(goal: Make) -> None:
    lines = "constraints: [min_barrier_mJ > 1]\nminimize: [reach_min_mm]\n"
    made = goal(TWO + lines + "maximize: [stiffness_min_N_per_mm]", "finger.units=3")
    found = search(made).best
    assert len(found) > 8
    assert found.hold.all()
    for k, row in enumerate(found.objectives.T):
        others = np.delete(found.objectives, k, axis=1).T
        assert not ((others <= row).all(axis=1) & (others < row).any(axis=1)).any()
    assert (np.diff(found.objectives[0]) > 0.0).all()
    trace = search(made).trace
    steps = np.stack([trace["search"], trace["step"]])
    assert np.unique(steps, axis=1).shape == steps.shape


def test_counts_are_kept_too(goal: Make) -> None:
    """A separation at which all states are lost is not gone to."""
    lines = f"vary: {{{SEPARATION}: {{from: 2, to: 6.4}}}}\nconstraints: [n_stable >= 8]\n"
    made = goal(lines + "maximize: [unit_separation_mm]", base="three_unit")
    found = search(made).best
    assert found.hold[:, 0].all()
    further = MapEvaluation(made).columns({SEPARATION: np.array([6.4])})
    assert not MapEvaluation(made).hold(further).all() or found.points[0, 0] == 1.0


def test_listed_values_are_all_tried_and_the_best_comes_first(goal: Make) -> None:
    made = goal("vary: {finger.units: [2, 3, 4]}\nmaximize: [reach_max_mm]", base="three_unit")
    found = search(made)
    assert found.best.choice["finger.units"].tolist() == [4, 3, 2]
    assert found.n_starts == found.n_evaluated == 3
    target = "targets: [{pattern: '11*', quantity: tip, value: [37, -10], tolerance_mm: 0.5}]\n"
    found = search(goal(f"vary: {{finger.units: [2, 3, 4]}}\n{target}", base="three_unit"))
    assert found.best.choice["finger.units"][0] == 3
    assert (np.diff(found.best.misfits) > 0.0).all()
    assert sorted(found.trace["misfit"]) == found.best.misfits.tolist()


def test_a_limit_stops_searches_and_what_was_found_stays(goal: Make) -> None:
    target = "targets: [{pattern: '11*', quantity: tip, value: [52, -38], tolerance_mm: 0.5}]\n"
    made = goal(TWO + target + "minimize: [reach_min_mm]", "finger.units=3")
    few = search(made, limits=Limits(evaluations=40))
    assert few.is_stopped
    assert len(few.best)
    only = goal(TWO + target, "finger.units=3")
    more = search(only, limits=Limits(evaluations=400))
    assert more.n_evaluated >= 400
    assert more.n_starts > 32
    assert more.best.misfits[0] <= search(only).best.misfits[0] + 1e-9


def test_the_seed_decides(goal: Make) -> None:
    target = "targets: [{pattern: '11*', quantity: tip, value: [33, -19], tolerance_mm: 0.5}]\n"
    made = goal(TWO + target, "finger.units=3")
    first, again, other = (search(made, seed) for seed in (1, 1, 2))
    assert np.array_equal(first.best.points, again.best.points)
    assert np.array_equal(first.trace["misfit"], again.trace["misfit"])
    assert not np.array_equal(first.trace["misfit"][:32], other.trace["misfit"][:32])


def test_what_meets_all_comes_before_what_is_less(goal: Make) -> None:
    """A target is a limit beside an objective, as a constraint is; else it counts by its misfit."""
    target = "targets: [{pattern: '11100', quantity: tip, value: [52, -38], tolerance_mm: 0.5}]\n"
    met = search(goal(TWO + target)).best.points[:, :1]
    both = np.concatenate((met - [[0.3], [0.0]], met), axis=1)  # a lower dome, and the right one
    made = goal(TWO + target + "minimize: [dome_height_mm]")
    assert best_of(made, Designs.at(made, {}, both)).points[:, 0] == pytest.approx(met[:, 0])
    made = goal(TWO + "minimize: [dome_height_mm]")
    assert best_of(made, Designs.at(made, {}, both)).points[:, 0] == pytest.approx(both[:, 0])
    made = goal(TWO + target + "constraints: [dome_height_mm < 6]")
    assert best_of(made, Designs.at(made, {}, both)).points[:, 0] == pytest.approx(both[:, 0])


def test_alike_designs_are_one(goal: Make) -> None:
    target = "targets: [{pattern: '11100', quantity: tip, value: [52, -38], tolerance_mm: 0.5}]\n"
    made = goal(TWO + target)
    one = Designs.at(made, {}, np.array([[0.3, 0.3 + 1e-9, 0.5], [0.4, 0.4, 0.4]]))
    assert len(best_of(made, one)) == 2


def test_unfinished_searches_are_told_where_they_have_come_further(goal: Make) -> None:
    target = "targets: [{pattern: '11100', quantity: tip, value: [52, -38], tolerance_mm: 0.5}]\n"
    made = goal(TWO + target)
    every = Designs.at(made, {}, np.array([[0.3, 0.4, 0.5], [0.4, 0.4, 0.4]]))
    order = np.argsort(every.misfits)
    for finished, told in (((1, 1, 1), 3), ((1, 0, 0), 1), ((0, 1, 0), 2), ((0, 0, 0), 3)):
        flags = np.zeros(3, bool)
        flags[order] = finished
        best = best_of(made, every.with_finished(flags))
        assert best.misfits.tolist() == sorted(every.misfits)[:told]


def test_of_maps_only_what_matters_is_computed(goal: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """Snap pressures without the graph of states, and constraints on shapes without pressure."""

    def refuse(_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(PressedDesigns, "n_reachable", property(refuse))
    lines = TWO + "constraints: [snap_pressure_max_MPa > 0.1]"
    made = goal(lines, "pressure={}", base="three_unit")
    point = made.values({}, np.array([[0.5], [0.5]]))
    assert MapEvaluation(made).columns(point)["snap_pressure_max_MPa"][0] > 0.1
    monkeypatch.setattr(PressedDesigns, "__init__", refuse)
    made = goal(TWO + "constraints: [reach_max_mm > 1]", "pressure={}", base="three_unit")
    assert MapEvaluation(made).columns(point)["reach_max_mm"][0] > 1.0
