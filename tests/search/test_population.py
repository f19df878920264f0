"""Populations: they find what trying all combinations finds, and slopes do the rest."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.search import population
from dpgcli.search import search as module
from dpgcli.search.goal import Goal
from dpgcli.search.part import Clock
from dpgcli.search.search import Limits, Searched, search

Make = Callable[..., Goal]
LISTS = (
    "vary:\n"
    "  finger.units: [2, 3, 4]\n"
    "  finger.geometry.dome_height_mm: [5, 5.5, 6, 6.5, 7, 7.5]\n"
    "  finger.geometry.chamber_length_mm: [8, 8.5, 9, 9.5, 10]\n"
)
RANGE = "  finger.geometry.unit_separation_mm: {from: 2, to: 4}\n"
TIP = "targets: [{pattern: '11*', quantity: tip, value: [33, -17], tolerance_mm: 0.5}]\n"


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Searched]:
    """A search in which so many choices are tried, and a population looks among more."""

    def searching(made: Goal, most: int, seed: int = 1, limits: Limits | None = None) -> Searched:
        monkeypatch.setattr(module, "MOST_CHOICES", most)
        return search(made, seed, limits)

    return searching


def test_a_population_finds_the_best_of_all_choices(
    goal: Make, found: Callable[..., Searched]
) -> None:
    """Of lists alone, with either seed."""
    made = goal(LISTS + TIP, base="three_unit")
    assert made.n_choices == 90
    every = found(made, 90).best
    for seed in (1, 2):
        best = found(made, 89, seed).best
        assert best.misfits[0] == pytest.approx(every.misfits[0], rel=1e-9)
        assert {k: v[0] for k, v in best.choice.items()} == {
            k: v[0] for k, v in every.choice.items()
        }


@pytest.mark.slow
def test_the_ranges_are_polished_by_slopes(goal: Make, found: Callable[..., Searched]) -> None:
    made = goal(LISTS + RANGE + TIP, base="three_unit")
    best = found(made, 10)
    assert best.n_starts == module.POLISHED_STARTS * population.MOST_CHOSEN
    every = found(made, 90)
    assert best.best.misfits[0] <= every.best.misfits[0] * 1.05 + 1e-6
    again = found(made, 10)
    assert np.array_equal(best.best.points, again.best.points)
    assert all(np.array_equal(best.trace[n], again.trace[n]) for n in best.trace)
    steps = np.stack([best.trace["search"], best.trace["step"]])
    assert np.unique(steps, axis=1).shape == steps.shape


def test_rules_come_before_objectives(goal: Make, found: Callable[..., Searched]) -> None:
    rules = "constraints: ['min_barrier_mJ > 1.5', 'n_stable >= 8']\nminimize: [reach_min_mm]\n"
    made = goal(LISTS + rules, base="three_unit")
    every, best = found(made, 90).best, found(made, 89).best
    assert best.hold[:, 0].all()
    assert best.objectives[0, 0] == pytest.approx(every.objectives[0, 0], rel=1e-9)


@pytest.mark.slow
def test_fronts_have_a_population_for_each_objective(
    goal: Make, found: Callable[..., Searched]
) -> None:
    lines = "minimize: [reach_min_mm]\nmaximize: [stiffness_min_N_per_mm]\n"
    made = goal(LISTS + lines, base="three_unit")
    every, best = found(made, 90).best, found(made, 89)
    ends = best.best.objectives.min(axis=1)
    assert ends == pytest.approx(every.objectives.min(axis=1), rel=1e-9)
    assert {*best.trace["search"].tolist()} >= {0, 1, 2}


def test_a_limit_ends_a_population(goal: Make, found: Callable[..., Searched]) -> None:
    made = goal(LISTS + RANGE + TIP, base="three_unit")
    few = found(made, 10, 1, Limits(evaluations=200))
    assert few.is_stopped
    assert few.n_evaluated < 2000
    assert not few.best.are_finished.all()


def test_no_choice_is_a_finger(goal: Make) -> None:
    """Whose domes reach their neighbors: nothing is chosen, and nothing goes wrong."""
    made = goal(
        "vary: {finger.geometry.dome_height_mm: [1.0, 1.5], finger.units: [2, 3]}\n" + TIP,
        base="three_unit",
    )
    found = population.chosen(made, np.random.default_rng(1), Clock(evaluations=60))
    assert len(found.designs) == 0
    assert len(found.trace["search"]) == 0
