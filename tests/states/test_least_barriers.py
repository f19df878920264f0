"""The way over the least barriers: against all ways there are, ties, no way."""

from itertools import permutations

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.states.least_barriers import best_way


def random_barriers(n_units: int, seed: int, share_missing: float = 0.2) -> Array:
    random = np.random.default_rng(seed)
    barrier = random.uniform(1.0, 9.0, (n_units, 2**n_units))
    barrier[random.random(barrier.shape) < share_missing] = np.nan
    return barrier


def barriers_on(barrier: Array, start: int, units: tuple[int, ...]) -> list[float]:
    found = []
    for unit in units:
        found.append(float(barrier[unit, start]))
        start ^= 1 << (len(barrier) - 1 - unit)
    return found


def all_ways(barrier: Array, start: int, end: int) -> list[tuple[int, ...]]:
    """Every way without a state met twice, by depth-first search."""
    n_units = len(barrier)
    found: list[tuple[int, ...]] = []

    def go_on(here: int, met: frozenset[int], units: tuple[int, ...]) -> None:
        if here == end:
            found.append(units)
            return
        for unit in range(n_units):
            there = here ^ (1 << (n_units - 1 - unit))
            if there not in met and not np.isnan(barrier[unit, here]):
                go_on(there, met | {there}, (*units, unit))

    go_on(start, frozenset([start]), ())
    return found


@pytest.mark.parametrize("seed", range(20))
def test_no_other_way_has_a_smaller_largest_barrier_or_as_small_a_one_and_a_smaller_sum(
    seed: int,
) -> None:
    barrier = random_barriers(3, seed, 0.3)
    for start in range(8):
        for end in range(8):
            found = best_way(barrier, start, end)
            ways = [barriers_on(barrier, start, way) for way in all_ways(barrier, start, end)]
            if not ways:
                assert found is None
                continue
            assert found is not None
            own = barriers_on(barrier, start, found.units)
            best = min((max(way, default=0.0), sum(way)) for way in ways)
            assert (max(own, default=0.0), sum(own)) == pytest.approx(best, rel=1e-9)
            assert found.n_ways == 1


def test_a_detour_is_taken_where_it_has_lower_barriers() -> None:
    """From 00 to 10 over unit 1 directly, 5 mJ, or by way of 01 and 11, 3 mJ at most."""
    barrier = np.full((2, 4), np.nan)
    barrier[0, 0b00], barrier[1, 0b00], barrier[0, 0b01], barrier[1, 0b11] = 5.0, 3.0, 2.0, 1.0
    found = best_way(barrier, 0b00, 0b10)
    assert found is not None
    assert found.units == (1, 0, 1)
    barrier[0, 0b01] = 6.0
    found = best_way(barrier, 0b00, 0b10)
    assert found is not None
    assert found.units == (0,)


@pytest.mark.parametrize("noise", [0.0, 1e-9, 1e-7])
def test_what_differs_by_less_than_a_millionth_ties(noise: float) -> None:
    """The order is then that of the units, and all orders are counted."""
    random = np.random.default_rng(5)
    barrier = 6.0 * (1.0 + noise * random.uniform(-1.0, 1.0, (4, 16)))
    found = best_way(barrier, 0, 15)
    assert found is not None
    assert found.units == (0, 1, 2, 3)
    assert found.n_ways == len([*permutations(range(4))])


def test_a_difference_above_a_millionth_decides() -> None:
    barrier = np.full((2, 4), 6.0)
    barrier[0, 0b00] *= 1.0 + 3e-6
    found = best_way(barrier, 0b00, 0b11)
    assert found is not None
    assert (found.units, found.n_ways) == ((1, 0), 1)


def test_there_may_be_no_way() -> None:
    assert best_way(np.full((2, 4), np.nan), 0, 3) is None
    barrier = np.full((1, 2), np.nan)
    barrier[0, 1] = 1.0
    assert best_way(barrier, 0, 1) is None
    back = best_way(barrier, 1, 0)
    assert back is not None
    assert back.units == (0,)
    here = best_way(barrier, 1, 1)
    assert here is not None
    assert (here.units, here.n_ways) == ((), 1)
