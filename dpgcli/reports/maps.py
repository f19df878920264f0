"""Figures of a design space: its metrics that vary, over the first two swept values."""

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
import pandas as pd

from dpgcli.reports.drawing import own_figure, svg_text, titled
from dpgcli.reports.space import DesignSpace
from dpgcli.reports.summary import METRICS, varies
from dpgcli.text import counted

COUNTED = ("n_stable",)  # drawn beside what is ranked
MOST_VECTORS = 2000  # beyond, points are drawn as pixels
MOST_POINTS = 20_000
FARTHEST = 1e100  # on an axis, which Matplotlib computes with; rigid bars' stiffness is infinite
MOST_TICKS = 8  # with a text each
NO_METADATA = dict.fromkeys(("Creator", "Format", "Type"))
NO_MATPLOTLIB = "No figures: they need Matplotlib, pip install matplotlib."


def figures(space: DesignSpace) -> str:
    """Every metric that varies over the first two swept values, as one inline SVG."""
    every_one = (*COUNTED, *METRICS)
    metrics = [name for name in every_one if name in space.designs and varies(space, name)]
    if not metrics or not space.varied:
        return "<p>No metric varies.</p>"
    designs, n_beyond = _drawable(pd.DataFrame(space.designs), metrics)
    every = 1 if _is_grid(space, designs) else len(designs) // MOST_POINTS + 1
    try:
        svg = _maps(space, designs[::every], metrics)
    except ImportError:
        return f"<p>{escape(NO_MATPLOTLIB)}</p>"
    caption = escape(_caption(space, every, n_beyond))
    return f'<p>{caption}</p>\n<figure class="maps">\n{svg}</figure>'


def _drawable(designs: pd.DataFrame, metrics: Sequence[str]) -> tuple[pd.DataFrame, int]:
    """Designs without values of metrics that are too far away to draw, and how many these are."""
    is_beyond = designs[metrics].abs() > FARTHEST
    return designs.assign(**designs[metrics].mask(is_beyond)), int(is_beyond.to_numpy().sum())


def _maps(space: DesignSpace, designs: pd.DataFrame, metrics: Sequence[str]) -> str:
    """Inline SVG with two maps a row."""
    n_rows = (len(metrics) + 1) // 2
    with own_figure(10.0, 3.6 * n_rows) as figure:
        for place, metric in enumerate(metrics, start=1):
            axes = figure.add_subplot(n_rows, 2, place, xlabel=titled(space.label(space.varied[0])))
            axes.set_title(titled(_title(space, metric)))
            _draw(axes, space, designs, metric)
        over = " and ".join(map(space.label, space.varied[:2]))
        what = ", ".join(map(space.label, metrics))
        text = svg_text(figure, what, f"{what} over {over}", NO_METADATA)
    return text[text.index("<svg") :]


def _title(space: DesignSpace, metric: str) -> str:
    """What a map shows of designs that share a place; nothing where none do."""
    if not (hidden := space.varied[2:]):
        return ""
    which = "largest" if METRICS.get(metric, True) else "nearest zero"
    return f"{space.label(metric)}, {which} over {', '.join(map(space.label, hidden))}"


def _caption(space: DesignSpace, every: int, n_beyond: int) -> str:
    is_line = len(space.varied) == 1
    text = "Designs without a state are left out." if is_line else "Gray: designs without a state."
    if hidden := space.varied[2:]:
        rows = np.arange(len(space))
        named = ", ".join(f"{space.label(name)} {space.span(name, rows)}" for name in hidden)
        text += f" A place stands for all designs there, of every {named}: each map shows the best"
        text += " value of these, as its title says."
    if n_beyond:
        text += f" {counted(n_beyond, 'value')} beyond {FARTHEST:g} are left out."
    return text + (f" One design in {every:,} is drawn." if every > 1 else "")


def _draw(axes: Any, space: DesignSpace, designs: pd.DataFrame, metric: str) -> None:
    """A line over one swept value; over two a map if they form a grid, else points."""
    designs = _ranked(designs, dict(zip(space.varied, (axes.xaxis, axes.yaxis), strict=False)))
    usable = designs[designs["n_stable"] > 0]
    merit = usable[metric] if METRICS.get(metric, True) else -usable[metric].abs()
    usable = usable.loc[merit.sort_values(kind="stable").index]  # the best is drawn last
    first, *others = space.varied
    if not others:
        line = usable.sort_values(first, kind="stable")
        axes.plot(line[first], line[metric], "o-", color="#31688e", ms=3, lw=1)
        axes.set_ylabel(titled(space.label(metric)))
        axes.grid(visible=True, alpha=0.25)
        return
    second = others[0]
    axes.set_ylabel(titled(space.label(second)))
    is_large = len(designs) > MOST_VECTORS
    if _is_grid(space, designs):
        cells = designs.assign(**{metric: usable[metric]})
        best = cells.loc[[*cells.index.difference(usable.index), *usable.index]]
        table = best.groupby([second, first])[metric].last().unstack()
        drawn = axes.pcolormesh(
            table.columns, table.index, table.to_numpy(float), cmap="viridis", rasterized=is_large
        )
        axes.set_facecolor("0.85")
    else:
        empty = designs.drop(usable.index)
        axes.plot(empty[first], empty[second], "x", color="0.7", ms=4, rasterized=is_large)
        drawn = axes.scatter(
            usable[first], usable[second], 14, usable[metric], cmap="viridis", rasterized=is_large
        )
    axes.figure.colorbar(drawn, label=titled(space.label(metric)))


def _ranked(designs: pd.DataFrame, axes: dict[str, Any]) -> pd.DataFrame:
    """Designs for axes of these columns: where a value is too far away, all stand a step apart."""
    for name, axis in axes.items():
        known = np.unique(designs[name].dropna())
        if len(known) and max(-known[0], known[-1]) > FARTHEST:
            designs = designs.assign(**{name: designs[name].rank(method="dense") - 1.0})
            places = np.unique(np.linspace(0, len(known) - 1, MOST_TICKS).astype(int))
            axis.set_ticks(places, [f"{value:.5g}" for value in known[places]])
    return designs


def _is_grid(space: DesignSpace, designs: pd.DataFrame) -> bool:
    """Whether the first two swept values come in all combinations."""
    places = designs[space.varied[:2]]
    sizes = places.nunique()
    return len(sizes) == 2 and sizes.min() > 1 and len(places.drop_duplicates()) == sizes.prod()
