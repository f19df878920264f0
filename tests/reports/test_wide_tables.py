"""Tables with more columns than a page has room for: those that vary are there, others counted."""

import json
import re

import numpy as np
import pytest

from dpgcli.arrays import Columns
from dpgcli.reports.explorer.content import Explored, content, shown_rows
from dpgcli.reports.page import html, markdown
from dpgcli.reports.space import MOST_COLUMNS, DesignSpace

N = 5


def wide(n_constant: int, n_varied: int, **more: np.ndarray) -> DesignSpace:
    """Constants first, so that what varies is not there for its place."""
    swept = {f"same_{k}_mm": np.full(N, 3.0) for k in range(n_constant)}
    swept |= {f"size_{k}_mm": np.arange(N) + 1.0 * k for k in range(n_varied)}
    designs: Columns = {
        "design": np.arange(N),
        **swept,
        "calibration": np.full(N, "given", object),
        "status": np.full(N, "stable", object),
        "reason": np.full(N, "", object),
        "n_stable": np.full(N, 4),
        "reach_max_mm": np.arange(N) + 1.0,
        **more,
    }
    return DesignSpace(designs, {})


@pytest.mark.parametrize(
    ("n_constant", "n_varied", "said"),
    [
        (MOST_COLUMNS - 3, 3, ""),
        (MOST_COLUMNS - 2, 3, "98 are left out: 98 that have one value."),
        (0, MOST_COLUMNS + 1, "1 are left out: 1 behind those here."),
        (7, 200, "107 are left out: 7 that have one value and 100 behind those here."),
        (101, 0, "101 are left out: 101 that have one value."),
    ],
)
def test_what_is_left_out_is_counted(n_constant: int, n_varied: int, said: str) -> None:
    found = wide(n_constant, n_varied)
    assert said in found.narrowed.left_out
    assert bool(said) == bool(found.narrowed.left_out)
    text = markdown(found)
    assert ("are left out" in text) == bool(said)
    assert said in text
    n_swept = n_constant + n_varied if not said else min(n_varied, MOST_COLUMNS)
    named = {*re.findall(r"(?:same|size)_\d+_mm", text)}
    assert len(named) == n_swept
    assert not said or not any(name.startswith("same") for name in named)


def test_columns_that_we_know_are_never_left_out() -> None:
    behind = {f"extra_{k}": np.arange(N) + 0.0 for k in range(200)}
    behind["stiffness_min_N_per_mm"] = np.ones(N)  # one value, and a metric
    narrowed = wide(0, 90, **behind).narrowed.designs
    assert "stiffness_min_N_per_mm" in narrowed
    assert ("extra_9" in narrowed, "extra_10" in narrowed) == (True, False)


def test_a_value_beside_nothing_is_one_value() -> None:
    """What is not known is no value: such a column tells no designs apart."""
    half = np.array([np.nan, 1.0, 1.0, np.nan, 1.0])
    found = wide(0, 100, half=half, none=np.full(N, np.nan)).narrowed
    assert {"half", "none"}.isdisjoint(found.designs)


def test_forty_thousand_columns_are_a_page() -> None:
    """It was a ValueError, of fewer rows than none, after minutes."""
    found = wide(20_000, 20_000)
    page = html(found)
    assert len(page) < 4e6
    assert "39,900 are left out" in page
    narrowed = found.narrowed
    data = json.loads(content(narrowed, Explored(shown_rows(narrowed))))
    assert len(data["columns"]) == len(narrowed.designs) == MOST_COLUMNS + 6
