"""Predicted shapes with known states over them."""

from pathlib import Path
from typing import Any

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.comparison import Comparison
from dpgcli.calibration.known import KnownStates
from dpgcli.reports.drawing import drawn_to, titled
from dpgcli.states.patterns import texts


def draw_comparison(
    known: KnownStates, found: Comparison, calibrated: Comparison | None, name: str, path: Path
) -> None:
    """Draw each state's limiting layer to its tip, and what is known, to an SVG or PNG file."""
    from matplotlib import colormaps

    words = {"xlabel": "x (mm)", "ylabel": "y (mm)", "title": titled(name)}
    with drawn_to(path, 9.0, 6.0, aspect="equal", **words) as axes:
        names = texts(known.patterns)
        for state, inverted in enumerate(known.patterns.T):
            color = colormaps["viridis"](0.85 * inverted.mean())
            axes.plot(*found.states.layer[:, :, state], ".-", color=color)
            if calibrated is not None:
                axes.plot(*calibrated.states.layer[:, :, state], "--", color=color)
            if known.shapes:
                axes.plot(*known.shapes[state], "+", color=color, ms=4)
            _draw_known(axes, known.tip[:, state], names[state].decode(), color)
        axes.plot([], [], "k.-", label="predicted, to its tip")
        if calibrated is not None:
            axes.plot([], [], "k--", label="predicted, calibrated")
        if known.shapes:
            axes.plot([], [], "k+", ms=4, label="known shape")
        axes.plot([], [], "kx", ms=9, mew=2, label="known tip")
        axes.legend(frameon=False)


def _draw_known(axes: Any, tip: Array, pattern: str, color: Any) -> None:
    if np.isfinite(tip).all():
        axes.plot(*tip, "x", color=color, ms=9, mew=2)
        axes.annotate(pattern, tip, textcoords="offset points", xytext=(7, 4), fontsize=8)
