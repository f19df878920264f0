"""The work-precision figure, in text and as a picture, from rows made by hand."""

import math
from pathlib import Path
from typing import Any

import pytest

from dpgcli.reports.precision import cheapest_way, draw_precision, text_figure


def row(method: str, error: float, seconds: float, group: str = "ladder") -> dict[str, Any]:
    return {
        "group": group,
        "method": method,
        "n_states": 10,
        "n_missing": 0,
        "max_tip_error_mm": error,
        "seconds": 10 * seconds,
        "seconds_min": 9 * seconds,
        "seconds_max": 12 * seconds,
        "seconds_per_state": seconds,
    }


ROWS = [
    row("rough", 1e-2, 1e-6),
    row("fine", 1e-12, 1e-5),
    row("slow", 1e-12, 1e-1, "peer"),
    row("never", math.nan, 1e-6),
]


def test_the_cheapest_way_that_is_exact_enough() -> None:
    assert cheapest_way(ROWS, 0.1).startswith("cheapest below 0.1 mm: rough, 1 µs a state")
    assert cheapest_way(ROWS, 1e-3).startswith("cheapest below 0.001 mm: fine, 10 µs a state")
    assert cheapest_way(ROWS, 1e-15) == "no method is below 1e-15 mm"
    incomplete = [{**ROWS[0], "n_missing": 1}]
    assert cheapest_way(incomplete, 1.0) == "no method is below 1 mm"


def test_places_in_the_text_figure() -> None:
    lines = text_figure(ROWS)
    (top,) = (line for line in lines if line.startswith(" 1e-02"))
    (bottom,) = (line for line in lines if line.startswith(" 1e-12"))
    assert top.index("a") < bottom.index("b") < bottom.index("c")
    assert any("a  rough" in line for line in lines)
    assert not any("never" in line for line in lines)
    assert text_figure([]) == []


@pytest.mark.parametrize("scale", [1e-18, 1.0, 1e9])
def test_what_is_exact_is_drawn_below_everything_else(scale: float) -> None:
    """Also where all errors are far below those of a finger in millimeters."""
    rows = [row("exact", 0.0, 1e-3), row("fine", 1e-3 * scale, 1e-5), row("rough", scale, 1e-6)]
    places = {
        mark: next(i for i, line in enumerate(text_figure(rows)) if f"{mark}" in line[7:])
        for mark in "abc"
    }
    assert places["c"] < places["b"] < places["a"]


def test_the_models_error_is_a_line_above_the_points() -> None:
    model = {**row("model", 3.0, 1.0), "group": "model"}
    lines = text_figure([*ROWS, model])
    (place,) = (i for i, line in enumerate(lines) if "-" * 40 in line and "+" not in line)
    assert place < next(i for i, line in enumerate(lines) if "a" in line.partition("|")[2])
    assert any("against the data given, 3 mm" in line for line in lines)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".svg", ".png"])
def test_the_picture_is_the_same_every_time(tmp_path: Path, suffix: str) -> None:
    pytest.importorskip("matplotlib")
    paths = [tmp_path / f"{name}{suffix}" for name in "ab"]
    for path in paths:
        draw_precision(ROWS, "finger.yaml", path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
