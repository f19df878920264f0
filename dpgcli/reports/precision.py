"""Error against run time: a figure, the same in plain text, and its conclusions."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dpgcli.benchmark.bench import BenchRow
from dpgcli.files.study_tables import json_value
from dpgcli.reports.drawing import drawn_to

WIDTH, HEIGHT = 64, 18
ZERO_DRAWN_AT = 0.1  # of the smallest error
NEAR = (0.05, 0.03)  # shares of the axes within which numbers would overlap
SLOWDOWN = 2.0  # of its recorded ratio: more than the noise of a shared machine
MARKS = "abcdefghijklmnopqrstuvwxyz"
COLORS = {"ladder": "#0072B2", "one finger": "#56B4E9", "peer": "#D55E00"}  # Okabe and Ito
MARKERS = {"ladder": "o", "one finger": "s", "peer": "^"}
LABELS = {"ladder": "dpg, in a batch", "one finger": "dpg, one finger", "peer": "state by state"}


def points(rows: Sequence[BenchRow]) -> list[BenchRow]:
    """The rows that are points of the figure."""
    return [
        row
        for row in rows
        if row["group"] in COLORS and math.isfinite(row["max_tip_error_mm"] * row["seconds"])
    ]


def model_error(rows: Sequence[BenchRow]) -> float | None:
    """Largest error of the lattice against given data (mm), if there are any."""
    found = [row["max_tip_error_mm"] for row in rows if row["group"] == "model"]
    found = [error for error in found if math.isfinite(error)]
    return max(found[0], _least_drawn(rows)) if found else None


def _least_drawn(rows: Sequence[BenchRow]) -> float:
    """The error (mm) at which zero is drawn on a logarithmic axis."""
    errors = [row["max_tip_error_mm"] for row in points(rows)]
    return ZERO_DRAWN_AT * min((error for error in errors if error > 0.0), default=1.0)


def cheapest_way(rows: Sequence[BenchRow], target: float) -> str:
    """A sentence that names the cheapest method below an error (mm)."""
    meets = [
        row
        for row in rows
        if row["group"] == "ladder" and row["max_tip_error_mm"] <= target and not row["n_missing"]
    ]
    if not meets:
        return f"no method is below {target:g} mm"
    best = min(meets, key=lambda row: float(row["seconds_per_state"]))
    return (
        f"cheapest below {target:g} mm: {best['method']}, "
        f"{best['seconds_per_state'] * 1e6:.3g} µs a state, error {best['max_tip_error_mm']:.1e} mm"
    )


def text_figure(rows: Sequence[BenchRow]) -> list[str]:
    """Largest tip error (mm) over seconds a state, both logarithmic, as lines of text."""
    shown = points(rows)
    if not shown:
        return []
    across = [math.log10(row["seconds_per_state"]) for row in shown]
    least = _least_drawn(rows)
    up = [math.log10(max(row["max_tip_error_mm"], least)) for row in shown]
    model = model_error(rows)
    top = max(up) if model is None else max(*up, math.log10(model))
    left, right = math.floor(min(across)), math.ceil(max(across))
    low, high = math.floor(min(up)), math.ceil(top)
    grid = [[" "] * WIDTH for _ in range(HEIGHT)]
    if model is not None:
        grid[_cell(math.log10(model), high, low, HEIGHT)] = list("-" * WIDTH)
    for x, y, mark in zip(across, up, MARKS, strict=False):
        _mark(grid[_cell(y, high, low, HEIGHT)], _cell(x, left, right, WIDTH), mark)
    heads = {0: f"1e{high:+03d}", HEIGHT - 1: f"1e{low:+03d}"}
    lines = ["largest tip error, mm"]
    lines += [f"{heads.get(i, ''):>6} |{''.join(line)}".rstrip() for i, line in enumerate(grid)]
    lines.append(f"{'':>6} +{'-' * WIDTH}")
    axis = f"1e{left:+03d}".ljust(WIDTH - 6) + f"1e{right:+03d}"
    lines.append(f"{'':>7}{axis}  s a state")
    lines += [
        f"{'':>7}{mark}  {row['method']} ({LABELS[row['group']]})"
        for mark, row in zip(MARKS, shown, strict=False)
    ]
    if model is not None:
        lines.append(f"{'':>7}-  the lattice's own error against the data given, {model:.2g} mm")
    return lines


def _mark(line: list[str], place: int, mark: str) -> None:
    """Put a mark into a line, or behind those that stand there."""
    free = (i for i in range(place, WIDTH) if line[i] in " -")
    line[next(free, place)] = mark


def _cell(value: float, first: float, last: float, size: int) -> int:
    """The index of a value among `size` cells from `first` to `last`."""
    share = (value - first) / (last - first) if last != first else 0.0
    return min(size - 1, max(0, round(share * (size - 1))))


def draw_precision(rows: Sequence[BenchRow], name: str, path: Path) -> None:
    """Draw the figure to an SVG or PNG file."""
    words = {
        "xlabel": "wall time per state (s)",
        "ylabel": "largest tip error (mm)",
        "xscale": "log",
        "yscale": "log",
    }
    text = "\n".join(
        f"{_named(number, row)}: {row['seconds_per_state']:.2e} s, {row['max_tip_error_mm']:.1e} mm"
        for number, row in enumerate(points(rows), start=1)
    )
    with drawn_to(path, 9.0, 5.5, name, text, **words) as axes:
        _draw_points(axes, points(rows))
        model = model_error(rows)
        if model is not None:
            label = f"the model against data: {model:.2g} mm"
            axes.axhline(model, color="#009E73", ls="--", label=label)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8)


def _draw_points(axes: Any, shown: Sequence[BenchRow]) -> None:
    """Numbered marks, named in the legend: names beside them would overlap."""
    least = _least_drawn(shown)
    places = []
    for number, row in enumerate(shown, start=1):
        x, y = row["seconds_per_state"], max(row["max_tip_error_mm"], least)
        group = row["group"]
        axes.errorbar(
            x,
            y,
            xerr=[
                [x - row["seconds_min"] / row["n_states"]],
                [row["seconds_max"] / row["n_states"] - x],
            ],
            fmt=MARKERS[group],
            color=COLORS[group],
            ms=6,
            label=_named(number, row),
        )
        places.append((x, y))
    axes.margins(0.08)
    for (x, y), numbers in _near(axes, places):
        text = ", ".join(map(str, numbers))
        axes.annotate(text, (x, y), textcoords="offset points", xytext=(5, 5), fontsize=8)


def _near(
    axes: Any, places: Sequence[tuple[float, float]]
) -> list[tuple[tuple[float, float], list[int]]]:
    """Marks, numbered from 1, that share a number's room; the place is that of the first."""
    axes.autoscale_view()
    to_shares = axes.transScale + axes.transLimits
    found: list[tuple[tuple[float, float], list[int]]] = []
    for number, place in enumerate(places, start=1):
        share = to_shares.transform(place)
        for other, numbers in found:
            dx, dy = abs(share - to_shares.transform(other))
            if dx < NEAR[0] and dy < NEAR[1]:
                numbers.append(number)
                break
        else:
            found.append((place, [number]))
    return found


def _named(number: int, row: BenchRow) -> str:
    return f"{number}  {row['method']} ({LABELS[row['group']]})"


def _which(row: BenchRow) -> str:
    """The row of a group that varies something."""
    ratio = f"k_L/k_b {row['stiffness_ratio']:.3g}"
    return f"{row['n_units']} units, {row['n_designs']:,} designs, {ratio}"


def changes(then: Sequence[BenchRow], now: Sequence[BenchRow]) -> list[str]:
    """Slowdowns against a record, by times relative to the NumPy kernel's, in words."""
    key = ("group", "method", "n_units", "n_designs", "stiffness_ratio")
    before = {tuple(row.get(name) for name in key): row.get("relative_time") for row in then}
    slower, n_compared = [], 0
    for row in now:
        old = before.get(tuple(json_value(row[name]) for name in key))
        if not old or not row["relative_time"] > 0.0:
            continue
        n_compared += 1
        ratio = row["relative_time"] / old
        if ratio > SLOWDOWN:
            slower.append(f"{ratio:.2f} times: {row['group']}, {row['method']}, {_which(row)}")
    verdict = f"{n_compared} compared with the record, {len(slower)} slower by more than {SLOWDOWN}"
    return [verdict, *slower]
