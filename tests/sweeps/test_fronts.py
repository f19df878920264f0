"""Pareto fronts against their definition."""

import numpy as np
import pytest
from numpy.typing import NDArray

from dpgcli.sweeps import fronts
from dpgcli.sweeps.fronts import on_front


def by_definition(values: NDArray[np.float64]) -> list[bool]:
    """Nobody is nowhere worse and somewhere better."""
    return [
        not any((other <= row).all() and (other < row).any() for other in values) for row in values
    ]


@pytest.mark.parametrize("n_objectives", [2, 3, 4])
@pytest.mark.parametrize("at_once", [3, 2**11])
def test_a_front_is_what_nothing_dominates(
    monkeypatch: pytest.MonkeyPatch, n_objectives: int, at_once: int
) -> None:
    """With many ties, and without any; in one block and in many."""
    monkeypatch.setattr(fronts, "ROWS_AT_ONCE", at_once)
    monkeypatch.setattr(fronts, "AT_ONCE", 2 * at_once)
    random = np.random.default_rng(n_objectives)
    for n_rows in (1, 2, 10, 60):
        tied = random.integers(0, 4, (n_rows, n_objectives)).astype(float)
        for values in (tied, random.normal(size=(n_rows, n_objectives))):
            assert on_front(values).tolist() == by_definition(values)


@pytest.mark.parametrize("n_objectives", [2, 3])
def test_where_all_are_on_the_front(n_objectives: int) -> None:
    """Rows of one sum, each better than every other somewhere; infinities are values."""
    values = np.random.default_rng(1).normal(size=(5000, n_objectives))
    values[:, -1] = -values[:, :-1].sum(axis=1)
    assert on_front(values).all()
    assert on_front(np.full((3, n_objectives), np.inf)).all()
    assert not len(on_front(np.empty((0, n_objectives))))


def test_the_closed_front_of_a_circle() -> None:
    """Of points in a quarter of a disc the least x and y are on its arc."""
    angle = np.linspace(0.0, np.pi / 2, 101)
    arc = -np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inside = 0.99 * arc
    assert on_front(np.concatenate([inside, arc])).tolist() == [False] * 101 + [True] * 101
