"""Predicted shapes with known tips over them."""

from pathlib import Path
from typing import Any

import numpy as np

from dpgcli.accuracy.comparison import Comparison, KnownTips
from dpgcli.arrays import Array
from dpgcli.report.drawing import drawn_to


def draw_comparison(known: KnownTips, found: Comparison, name: str, path: Path) -> None:
    """Draw each state's limiting layer to its tip, and the known tip, to an SVG or PNG file."""
    from matplotlib import colormaps

    words = {"xlabel": "x (mm)", "ylabel": "y (mm)", "title": name}
    with drawn_to(path, 9.0, 6.0, aspect="equal", **words) as axes:
        for state, inverted in enumerate(known.patterns.T):
            color = colormaps["viridis"](0.85 * inverted.mean())
            layer = np.concatenate((found.layer[:, :, state], found.predicted[:2, [state]]), axis=1)
            axes.plot(*layer, ".-", color=color)
            pattern = "".join("1" if on else "0" for on in inverted)
            _draw_known(axes, known.position[:, state], pattern, color)
        axes.plot([], [], "k.-", label="predicted, to its tip")
        axes.plot([], [], "kx", ms=9, mew=2, label="known tip")
        axes.legend(frameon=False)


def _draw_known(axes: Any, tip: Array, pattern: str, color: Any) -> None:
    axes.plot(*tip, "x", color=color, ms=9, mew=2)
    axes.annotate(pattern, tip, textcoords="offset points", xytext=(7, 4), fontsize=8)
