"""Selecting patterns, against fnmatch over all of them."""

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
        assert select(globs, n_units).tolist() == matched
    else:
        with pytest.raises(NothingSelectedError, match=str(n_units)):
            select(globs, n_units)


@pytest.mark.parametrize("glob", ["", "2", "1-1", "1 1", "[01]"])
def test_what_is_no_glob_is_refused(glob: str) -> None:
    with pytest.raises(UsageError, match="expected digits 0 and 1"):
        select([glob], 3)


@pytest.mark.slow
def test_too_many_matches_are_refused() -> None:
    with pytest.raises(UsageError, match="67,108,864"):
        select(["*"], 64)
    assert len(select(["1*" + 43 * "0"], 64)) == 2**20


@pytest.mark.slow
@given(pattern=st.text(alphabet="01", min_size=64, max_size=64))
def test_a_pattern_of_64_units_keeps_its_bits(pattern: str) -> None:
    (code,) = select([pattern], 64)
    inverted = inverted_units(np.array([code]), 64)
    assert int(code) == int(pattern, 2)
    assert texts(inverted).tolist() == [pattern.encode()]
    assert codes_of(inverted).tolist() == [int(pattern, 2)]


@given(n_codes=st.integers(1, 300), size=st.integers(1, 50))
def test_chunks_are_all_codes_in_order(n_codes: int, size: int) -> None:
    parts = list(chunks(n_codes, size))
    assert np.concatenate(parts).tolist() == list(range(n_codes))
    assert max(map(len, parts)) <= size
