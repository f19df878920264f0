"""Spaces: which designs, in which order, made when they are asked for."""

import itertools
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dpgcli.sweeps.space import (
    Axis,
    Range,
    Space,
    linear,
    listed,
    logarithmic,
    sampled,
)


@given(st.lists(st.integers(1, 4), min_size=1, max_size=4), st.data())
def test_a_space_is_the_product_with_the_last_axis_fastest(
    sizes: list[int], data: st.DataObject
) -> None:
    space = Space(
        tuple(listed(f"k{i}", [10 * i + j for j in range(n)]) for i, n in enumerate(sizes))
    )
    every = list(itertools.product(*([10 * i + j for j in range(n)] for i, n in enumerate(sizes))))
    assert space.size == len(every)
    start = data.draw(st.integers(0, space.size - 1))
    stop = data.draw(st.integers(start, space.size))
    rows = list(zip(*(c.tolist() for c in space.designs(start, stop).values()), strict=True))
    assert rows == every[start:stop]


def test_paired_keys_vary_together() -> None:
    pairs = Axis({"a": np.array([1, 2]), "b": np.array([3.0, 4.0])})
    space = Space((pairs, listed("c", [0, 1])))
    found = {key: column.tolist() for key, column in space.designs(0, 4).items()}
    assert found == {"a": [1, 1, 2, 2], "b": [3, 3, 4, 4], "c": [0, 1, 0, 1]}
    assert space.keys == ("a", "b", "c")


@pytest.mark.parametrize("values", [{}, {"a": np.zeros(2), "b": np.zeros(3)}])
def test_columns_of_an_axis_are_equally_long(values: dict[str, np.ndarray]) -> None:
    with pytest.raises(ValueError, match="equally many"):
        Axis(values)


def test_ranges_end_exactly_where_they_say() -> None:
    even = linear("a", 0.1, 0.7, 7).values["a"]
    ratios = logarithmic("a", 0.1, 1000.0, 5).values["a"]
    assert (even[0], even[-1], ratios[0], ratios[-1]) == (0.1, 0.7, 0.1, 1000.0)
    np.testing.assert_allclose(np.diff(even), 0.1, rtol=1e-14)
    np.testing.assert_allclose(ratios, [0.1, 1, 10, 100, 1000], rtol=1e-14)


def test_ranges_may_fall() -> None:
    assert linear("a", 3, 1, 3).values["a"].tolist() == [3, 2, 1]
    np.testing.assert_allclose(logarithmic("a", 100, 1, 3).values["a"], [100, 10, 1])


def test_whole_numbers_stay_whole() -> None:
    assert listed("a", [1, 2]).values["a"].dtype.kind == "i"
    assert listed("a", [1, 2.5]).values["a"].dtype.kind == "f"


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube"])
@pytest.mark.parametrize("count", [1, 2, 5, 64, 100])
def test_samples_are_seeded_and_within_bounds(method: str, count: int) -> None:
    ranges = {"a": Range(2.0, 3.0), "b": Range(1e-3, 1e3, is_logarithmic=True)}
    first, again, other = (sampled(method, ranges, count, seed).values for seed in (5, 5, 6))
    assert {len(column) for column in first.values()} == {count}
    assert all(first[key].tobytes() == again[key].tobytes() for key in ranges)
    assert all((first[key] != other[key]).all() for key in ranges)
    assert all(((r.first <= first[k]) & (first[k] <= r.last)).all() for k, r in ranges.items())


def test_a_latin_hypercube_has_one_sample_in_each_stripe() -> None:
    columns = sampled("latin_hypercube", {"a": Range(0, 1), "b": Range(-10, 10)}, 50, 0).values
    assert sorted((columns["a"] * 50).astype(int)) == list(range(50))
    assert sorted(((columns["b"] + 10) / 20 * 50).astype(int)) == list(range(50))


def test_sobol_samples_are_balanced() -> None:
    values = sampled("sobol", {"a": Range(0, 1), "b": Range(0, 1)}, 256, 3).values
    for column in values.values():
        assert np.bincount((column * 256).astype(int)).tolist() == [1] * 256


def test_samples_of_a_logarithmic_range_are_even_in_the_logarithm() -> None:
    column = sampled("sobol", {"a": Range(1e-2, 1e4, is_logarithmic=True)}, 600, 1).values["a"]
    decades = np.floor(np.log10(column)).astype(int)
    assert np.abs(np.bincount(decades + 2) - 100).max() <= 2


def test_a_vast_space_costs_nothing_until_it_is_asked_for() -> None:
    began = time.perf_counter()
    axes = tuple(linear(f"k{i}", 0.0, 1.0, 1_000_000) for i in range(3))
    space = Space(axes)
    last = space.designs(space.size - 2, space.size)
    assert space.size == 10**18
    assert last["k2"].tolist() == pytest.approx([1 - 1 / 999_999, 1.0])
    assert time.perf_counter() - began < 5
