"""Figures of states."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dpgcli.arrays import Array
from dpgcli.reports.drawing import drawn_to
from dpgcli.states.predict import Prediction

STATES_LABELLED = 16


def draw_states(prediction: Prediction, path: Path) -> None:
    """Draw the shape of every certified state to an SVG or PNG file, the same bytes each time.

    Line: limiting layer; dots: its nodes; faint: struts to the dome axis. Colors run with the
    number of inverted units (a perceptually uniform map, fit for color-blind readers).
    """
    rows = prediction.arrays()
    is_gripper = prediction.plan.scene.gripper is not None
    shapes = list(_shapes(rows, prediction.plan.n_units, is_gripper))
    with drawn_to(path, 9.0, 6.0, xlabel="x (mm)", ylabel="y (mm)", aspect="equal") as axes:
        _draw_shapes(axes, shapes, prediction.plan.n_units)


@dataclass(frozen=True)
class _Shape:
    """One finger in one state: node positions (2, station) in mm."""

    pattern: str
    base: Array
    top: Array
    is_labelled: bool


def _shapes(rows: dict[str, Any], n_units: int, is_gripper: bool) -> Iterator[_Shape]:
    """Draw the shapes of certified states; few of them with labels, one for each state."""
    stable = np.flatnonzero(rows["status"] == "stable")
    for state in stable:
        for finger in ("upper_", "lower_") if is_gripper else ("",):
            base, top = (
                np.array(
                    [
                        [rows[f"{finger}{node}{i}_{axis}_mm"][state] for i in range(n_units + 1)]
                        for axis in "xy"
                    ]
                )
                for node in "BT"
            )
            is_labelled = len(stable) <= STATES_LABELLED and finger != "lower_"
            yield _Shape(str(rows["pattern"][state]), base, top, is_labelled)


def _draw_shapes(axes: Any, shapes: list[_Shape], n_units: int) -> None:
    from matplotlib import colormaps

    colors = colormaps["viridis"].resampled(256)
    for shape in sorted(shapes, key=lambda s: s.pattern.count("1")):
        n_inverted = shape.pattern.count("1")
        color = colors(0.85 * n_inverted / n_units)
        for ends in np.stack((shape.base, shape.top), axis=2).transpose(1, 0, 2):
            axes.plot(*ends, color=color, lw=0.7, alpha=0.5)
        axes.plot(*shape.base, "o-", color=color, lw=1.6, ms=3.5, label=f"{n_inverted} inverted")
        if shape.is_labelled:
            axes.annotate(
                shape.pattern,
                shape.base[:, -1],
                textcoords="offset points",
                xytext=(6, -4),
                fontsize=8,
            )
    handles, labels = axes.get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    axes.legend(
        once.values(), once.keys(), loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False
    )
