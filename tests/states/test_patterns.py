"""Selecting patterns, against fnmatch over all of them."""

import time
import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from fnmatch import fnmatchcase

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dpgcli.errors import NothingSelectedError, UsageError
from dpgcli.states.patterns import chunks, codes_of, inverted_units, select, texts

GLOBS = st.text(alphabet="01*?", min_size=1, max_size=8)


@given(globs=st.lists(GLOBS, min_size=1, max_size=3), n_units=st.integers(1, 10))
def test_select_is_fnmatch_over_all_patterns(globs: list[str], n_units: int) -> None:
    patterns = [format(code, f"0{n_units}b") for code in range(2**n_units)]
    matched = [k for k, p in enumerate(patterns) if any(fnmatchcase(p, g) for g in globs)]
    if matched:
        selection = select(globs, n_units)
        assert len(selection) == len(matched)
        assert selection.codes(0, len(matched)).tolist() == matched
        assert selection.codes(1, len(matched)).tolist() == matched[1:]
    else:
        with pytest.raises(NothingSelectedError, match=str(n_units)):
            select(globs, n_units)


@pytest.mark.parametrize("glob", ["", "2", "1-1", "1 1", "[01]"])
def test_what_is_no_glob_is_refused(glob: str) -> None:
    with pytest.raises(UsageError, match="expected digits 0 and 1"):
        select([glob], 3)


def test_too_many_matches_are_refused() -> None:
    with pytest.raises(UsageError, match="67,108,864"):
        select(["*"], 64)
    with pytest.raises(UsageError, match="67,108,864"):
        select(["1*" + 36 * "0"], 64)
    assert len(select(["1*" + 37 * "0"], 64)) == 2**26


def peak(work: Callable[[], object]) -> int:
    """Bytes that are allocated at once while the work is done."""
    tracemalloc.start()
    work()
    (_, most) = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return most


def test_selecting_half_of_a_large_map_takes_the_memory_of_a_block() -> None:
    globs = [f"{'0' * i}*{'?' * k}" for i in range(1, 9) for k in range(8)]

    def all_blocks() -> None:
        selection = select(globs, 24)
        assert len(selection) == 2**23
        assert selection.codes(2**23 - 2, 2**23).tolist() == [2**23 - 2, 2**23 - 1]

    assert len(globs) == 64
    assert peak(all_blocks) < 2**20


def test_patterns_that_repeat_count_once() -> None:
    assert select(["01", "0?", "01", "*1"], 2).codes(0, 3).tolist() == [0, 1, 3]


@pytest.mark.parametrize(
    "globs",
    [
        ["*" * 400 + "1"],
        ["1" + "*1" * 200],
        ["*?" * 64],
        [f"{code:024b}" for code in range(0, 2**24, 2**13 + 1)],
        [f"*{code:08b}*" for code in range(256)],
    ],
)
def test_long_and_many_globs_take_no_time(globs: list[str]) -> None:
    began = time.process_time()
    with suppress(UsageError, NothingSelectedError):
        select(globs, 24)
    with suppress(UsageError, NothingSelectedError):
        select(globs, 64)
    assert time.process_time() - began < 5


def test_too_many_ways_to_match_are_refused_before_they_are_all_found() -> None:
    began = time.process_time()
    with pytest.raises(UsageError, match="16,384 ways"):
        select(["*1" + "?" * 20 + "0*"], 48)
    with pytest.raises(UsageError, match="200,000 symbols"):
        select([f"{code:024b}" for code in range(0, 2**24, 2**11)][:8000], 24)
    assert time.process_time() - began < 5


@pytest.mark.slow
@given(pattern=st.text(alphabet="01", min_size=64, max_size=64))
def test_a_pattern_of_64_units_keeps_its_bits(pattern: str) -> None:
    (code,) = select([pattern], 64).codes(0, 1)
    inverted = inverted_units(np.array([code]), 64)
    assert int(code) == int(pattern, 2)
    assert texts(inverted).tolist() == [pattern.encode()]
    assert codes_of(inverted).tolist() == [int(pattern, 2)]


@given(n_codes=st.integers(1, 300), size=st.integers(1, 50))
def test_chunks_are_all_codes_in_order(n_codes: int, size: int) -> None:
    parts = list(chunks(n_codes, size))
    assert np.concatenate(parts).tolist() == list(range(n_codes))
    assert max(map(len, parts)) <= size
