"""Figures of a design space: whatever values its axes and names its columns have."""

import itertools
import re
from typing import Any

import numpy as np
import pytest

from dpgcli.arrays import Columns
from dpgcli.reports.maps import figures
from dpgcli.reports.space import DesignSpace

INF, NAN = float("inf"), float("nan")


def grid(**swept: list[float]) -> Columns:
    """A grid of designs, each with a reach of its own."""
    points = np.array(list(itertools.product(*swept.values())), float).T
    n = points.shape[1]
    return {
        "design": np.arange(n),
        **dict(zip(swept, points, strict=True)),
        "calibration": np.full(n, "given", object),
        "status": np.full(n, "stable", object),
        "reason": np.full(n, "", object),
        "n_stable": np.full(n, 4),
        "reach_max_mm": np.arange(n) + 1.0,
    }


def texts(svg: str) -> list[str]:
    return re.findall(r"<text[^>]*>([^<]*)</text>", svg)


@pytest.mark.parametrize(
    ("swept", "ticks"),
    [
        ({"stiffness": [1e3, 1e4, INF], "height": [5, 6]}, ["1000", "10000", "inf"]),
        ({"height": [5, 6], "stiffness": [1e3, 1e4, INF]}, ["1000", "10000", "inf"]),
        ({"height": [6, 7, INF]}, ["6", "7", "inf"]),
        ({"stiffness": [INF], "height": [5, 6]}, ["5.0", "6.0"]),
        ({"stiffness": [1e3, INF], "height": [6, INF]}, ["1000", "inf", "6", "inf"]),
        ({"stiffness": [-INF, 1, INF], "height": [5, 6]}, ["-inf", "1", "inf"]),
        ({"stiffness": [1, 2], "height": [5, 6], "third": [1, INF]}, []),
        ({"stiffness": [-1e308, 1e308], "height": [5, 6]}, ["-1e+308", "1e+308"]),
        ({"stiffness": [*range(100), INF], "height": [5, 6]}, ["0", "14", "28", "inf"]),
        ({"stiffness": [NAN, 1, INF], "height": [5, 6]}, ["1", "inf"]),
        ({"stiffness": [NAN, NAN], "height": [5, 6]}, []),
    ],
)
def test_an_axis_may_end_nowhere(swept: dict[str, Any], ticks: list[str]) -> None:
    found = texts(figures(DesignSpace(grid(**swept), {})))
    assert [tick for tick in ticks if tick in found] == ticks


def test_what_is_swept_and_constant_is_no_axis() -> None:
    found = texts(figures(DesignSpace(grid(gap=[3], height=[5, 6], length=[1, 2, 3]), {})))
    assert ("gap" in found, "height" in found, "length" in found) == (False, True, True)
    (line,) = [figures(DesignSpace(grid(gap=[3], height=[5, 6]), {}))]
    assert "over height" in line
    assert "gap" not in texts(line)


def test_an_axis_of_numbers_is_one_to_scale() -> None:
    found = texts(figures(DesignSpace(grid(stiffness=[1, 2, 9], height=[5, 6]), {})))
    assert {"4", "6", "8"} <= set(found)


@pytest.mark.parametrize("swept", [{"a": [1, 2]}, {"a": [1, 2], "b": [1, 2]}])
@pytest.mark.parametrize("word", [r"$\frac$", "$x^{$", r"\$", "$$"])
def test_names_and_units_are_no_formulas(swept: dict[str, Any], word: str) -> None:
    designs = {
        {"a": f"a{word}", "b": f"b{word}"}.get(key, key): column
        for key, column in grid(**swept).items()
    }
    names = (*designs, "reach_max_mm")
    svg = figures(DesignSpace(designs, dict.fromkeys(names, word)))
    assert word in "".join(texts(svg))


@pytest.mark.parametrize(
    ("values", "n_beyond"),
    [
        ([-1e308, 1e308], 4),
        ([1e-320, 1e308], 2),
        ([1.0, -1e101], 2),
        ([1e99, -1e99], 0),
        ([INF, 1.0], 2),
        ([INF, NAN], 0),  # one value, which is on no map
        ([NAN, NAN], 0),
        ([5e-324, 1e-323], 0),
        ([7.0, 7.0], 0),
    ],
)
@pytest.mark.parametrize("swept", [{"a": [1, 2, 3, 4]}, {"a": [1, 2], "b": [1, 2]}])
def test_values_too_far_away_to_draw_are_left_out_in_words(
    swept: dict[str, Any], values: list[float], n_beyond: int
) -> None:
    """They ended in Matplotlib's overflow, of the differences of its ticks."""
    designs = grid(**swept)
    designs["reach_max_mm"] = np.resize(values, 4)
    designs["stiffness_min_N_per_mm"] = np.arange(4.0)
    svg = figures(DesignSpace(designs, {}))
    assert "stiffness" in "".join(texts(svg))
    said = f"{n_beyond} values beyond 1e+100 are left out."
    assert (said in svg, "values beyond" in svg) == (bool(n_beyond), bool(n_beyond))
