"""The data behind the explorer of a design space, as JSON: columns, base spec, shapes."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np

from dpgcli.arrays import Array, Indices, distinct
from dpgcli.files.scene_file import spelled
from dpgcli.records import dataclass
from dpgcli.reports.explorer.shapes import NO_BASE, Shapes, rounded
from dpgcli.reports.outlines import DrawnState, Points
from dpgcli.reports.space import DesignSpace
from dpgcli.reports.summary import METRICS, extremes, varies
from dpgcli.text import printable, shortened

MOST_DESIGNS = 10_000
MOST_CELLS = 400_000  # numbers of all columns
MOST_AXES = 9
EXACT, SHOWN = 17, 6  # digits of swept values, which specs have, and of others
LONGEST_TEXT = 200
BEST = {True: "largest", False: "nearest zero"}


@dataclass(frozen=True)
class BestDesign:
    """A design that is the best by some metrics, in the row of a table, and states of it.

    `body` are points around the body that its fingers meet, none without one.
    """

    row: int
    metrics: Sequence[str]
    states: Sequence[DrawnState]
    body: Points | None = None


@dataclass(frozen=True)
class Explored:
    """What an explorer shows beside the table: designs in some rows, the best ones drawn.

    `keys` are those of the spec by column; `base` is its data, None where no one knows it.
    """

    rows: Indices
    best: Sequence[BestDesign] = ()
    keys: Mapping[str, str] = field(default_factory=dict)
    base: Mapping[str, Any] | None = None
    shapes: Shapes = field(default_factory=lambda: Shapes(NO_BASE))


def shown_rows(space: DesignSpace) -> Indices:
    """Rows of the designs that are shown: all if they are not too many, else spread evenly.

    The best and the worst are among them.
    """
    most = min(MOST_DESIGNS, MOST_CELLS // len(space.designs))
    if len(space) <= most:
        return np.arange(len(space))
    ends = [found.row for found in extremes(space)]
    spread = np.linspace(0, len(space) - 1, most - len(ends)).round().astype(np.int64)
    return distinct(np.concatenate((spread, ends)).astype(np.int64))


def best_rows(space: DesignSpace) -> dict[int, list[str]]:
    """The rows of the best designs, and the metrics by which each is; not where half are."""
    found: dict[int, list[str]] = {}
    for metric, word, row, n_more in extremes(space):
        if word == "best" and n_more < len(space.usable) // 2:
            found.setdefault(row, []).append(metric)
    return found


def content(space: DesignSpace, explored: Explored) -> str:
    """The data as JSON that ends no script, whatever it says."""
    rows = explored.rows
    swept = [name for name in space.swept if varies(space, name)]
    metrics = [name for name in METRICS if name in space.designs and varies(space, name)]
    axes = [*swept, *metrics][:MOST_AXES]
    fine = [name for name in metrics if space.designs[name].dtype.kind == "f"]
    across, up = [*dict.fromkeys((*fine, *axes, "design", "n_stable"))][:2]
    columns = [
        {**_column(space, explored, name), "is_axis": name in axes} for name in space.designs
    ]
    data = {
        "columns": columns,
        "across": across,
        "up": up,
        "selected": int(np.searchsorted(rows, explored.best[0].row)) if explored.best else -1,
        "base": explored.base,
        "shapes": explored.shapes.said(rows),
        "shown": _shown(space, rows),
    }
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _shown(space: DesignSpace, rows: Indices) -> str:
    if len(rows) == len(space):
        return f"All {len(space):,} designs are here."
    return (
        f"{len(rows):,} of {len(space):,} designs are here, spread evenly, the best and the worst "
        "among them: counts and fronts are of these. dpg pick asks all."
    )


def _column(space: DesignSpace, explored: Explored, name: str) -> dict[str, Any]:
    values = space.designs[name][explored.rows]
    said: dict[str, Any] = {
        "name": printable(name),
        "label": printable(space.label(name)),
        "unit": printable(space.units.get(name, "")),
        "best": BEST[METRICS.get(name, True)],
    }
    if key := explored.keys.get(name):
        said["key"] = key
    if values.dtype == object:
        texts, codes = np.unique(values.astype(str), return_inverse=True)
        said["texts"] = [printable(shortened(text, LONGEST_TEXT)) for text in texts.tolist()]
        return {**said, "values": codes.tolist()}
    digits = EXACT if name in space.swept else SHOWN
    plain = values.tolist() if values.dtype.kind in "iu" else _plain(values, digits)
    return {**said, "values": plain}


def _plain(values: Array, digits: int) -> list[float | str | None]:
    """Numbers as JSON has them: infinite ones as in a spec, none for NaN."""
    found = (rounded(value, digits) for value in values.tolist())
    return [None if value is None else spelled(value) for value in found]
