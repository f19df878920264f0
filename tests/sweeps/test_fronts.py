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


@pytest.mark.parametrize("n_objectives", [2, 3, 4, 5])
@pytest.mark.parametrize("at_once", [1, 20, fronts.AT_ONCE])
def test_a_front_is_what_nothing_dominates(
    monkeypatch: pytest.MonkeyPatch, n_objectives: int, at_once: int
) -> None:
    """With many ties, infinities, and without any; compared at once, and halved."""
    monkeypatch.setattr(fronts, "AT_ONCE", at_once)
    random = np.random.default_rng(n_objectives)
    for n_rows in (1, 2, 10, 60, 200):
        tied = random.integers(0, 4, (n_rows, n_objectives)).astype(float)
        endless = np.where(tied == 3.0, np.inf, np.where(tied == 0.0, -np.inf, tied))
        for values in (tied, endless, random.normal(size=(n_rows, n_objectives))):
            assert on_front(values).tolist() == by_definition(values)


@pytest.mark.parametrize("n_objectives", [3, 4])
def test_large_fronts_do_not_cost_their_square(
    monkeypatch: pytest.MonkeyPatch, n_objectives: int
) -> None:
    """Where nothing dominates anything: of four times as many rows, four or five times as many
    pairs are compared; each with each would be 16."""
    compared, below = list[int](), fronts._are_below

    def counted(rows: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
        compared.append(len(rows) * len(others))
        return below(rows, others)

    monkeypatch.setattr(fronts, "_are_below", counted)
    n_pairs = []
    for n_rows in (8000, 32000):
        values = np.random.default_rng(1).normal(size=(n_rows, n_objectives))
        values[:, -1] = -values[:, :-1].sum(axis=1)
        compared.clear()
        on_front(values)
        n_pairs.append(sum(compared))
    assert n_pairs[1] < 6 * n_pairs[0]


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
