"""Figures of jaws: squeeze by aperture, and the largest by the number of inverted units."""

from pathlib import Path
from typing import Any

import numpy as np

from dpgcli.arrays import Columns
from dpgcli.design.scene import Scene
from dpgcli.grasping.jaw_table import is_exact
from dpgcli.grasping.jaws import JawPath
from dpgcli.grasping.mechanism import STUDY
from dpgcli.reports.drawing import figure_to
from dpgcli.reports.outlines import notes

WIDTH, HEIGHT = 9.0, 4.0  # inches
COLORS = "cividis"  # read alike by color-blind readers, and light to dark in gray
LIGHTEST = 0.85  # of the colors: lighter ones are lost on white
MOST_NAMED = 12  # states with a line of the legend each
STUDY_COLOR = "#D55E00"


def draw_jaws(scene: Scene, path: JawPath, rows: Columns, to: Path) -> None:
    """Draw to an SVG or PNG file, the same bytes each time."""
    text = "\n".join(_described(rows, lane) for lane in range(len(path.codes)))
    with figure_to(to, WIDTH, HEIGHT, "Squeeze of jaws by their aperture", text) as figure:
        curves, numbers = figure.subplots(1, 2, width_ratios=(2.2, 1.0))
        _draw_curves(curves, path, rows, scene.finger.n_units)
        _draw_numbers(numbers, rows, scene.finger.n_units)
        for axes in (curves, numbers):
            axes.grid(visible=True, alpha=0.25)
        figure.supxlabel("\n".join(notes(scene)), fontsize=7.5, x=0.01, ha="left")


def _color(number: int, n_units: int) -> Any:
    from matplotlib import colormaps

    return colormaps[COLORS](LIGHTEST * number / max(n_units, 1))


def _draw_curves(axes: Any, path: JawPath, rows: Columns, n_units: int) -> None:
    turn = len(path.gap) // 2 + 1
    named = set[int]()
    for lane in range(len(path.codes)):
        number, squeeze = int(rows["n_inverted"][lane]), path.squeeze[:, lane]
        color, word = _color(number, n_units), None
        if len(path.codes) <= MOST_NAMED:
            word = str(rows["pattern"][lane])
        elif number not in named:
            word = f"{number} inverted"
        named.add(number)
        axes.plot(path.gap[:turn], squeeze[:turn], color=color, lw=1.5, label=word)
        axes.plot(path.gap[turn - 1 :], squeeze[turn - 1 :], color=color, lw=1.0, ls="--")
        halts = [halt for halt in path.halts if halt.lane == lane]
        where = [halt.gap for halt in halts], [halt.squeeze for halt in halts]
        axes.plot(*where, "v", color=color, ms=5, mec="black", mew=0.5)
    axes.plot([], [], color="0.3", ls="--", lw=1.0, label="as they close again")
    axes.plot([], [], "v", color="0.6", mec="black", mew=0.5, ls="", label="a unit resets")
    axes.set_xlabel("aperture of the jaws (mm)")
    axes.set_ylabel("squeeze (N)")
    axes.legend(fontsize=7.5, frameon=False)


def _draw_numbers(axes: Any, rows: Columns, n_units: int) -> None:
    largest, exact = rows["largest_squeeze_N"], is_exact(rows)
    for lane, number in enumerate(rows["n_inverted"]):
        color = _color(int(number), n_units)
        told = "o" if exact[lane] else "^"
        axes.plot(number, largest[lane], told, color=color, ms=5, mec="black", mew=0.4)
    if not exact[~np.isnan(largest)].all():
        axes.plot(
            [], [], "^", color="0.6", mec="black", mew=0.4, label="at least: no unit has reset"
        )
    measured = [(text.count("1"), force) for text, force in STUDY.items() if len(text) == n_units]
    if measured:
        label = "measured in the study\n(a mechanism of unknown sizes)"
        axes.plot(*zip(*measured, strict=True), "D", mfc="none", mec=STUDY_COLOR, label=label)
    if axes.get_legend_handles_labels()[1]:
        axes.legend(fontsize=7.0, frameon=False)
    axes.set_xticks(np.arange(n_units + 1))
    axes.set_xlim(-0.5, n_units + 0.5)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("inverted units of a finger")
    axes.set_ylabel("largest squeeze before a unit resets (N)")


def _described(rows: Columns, lane: int) -> str:
    """A state in one line, for those who do not see it."""
    force, gap = rows["largest_squeeze_N"][lane], rows["largest_at_mm"][lane]
    if np.isnan(force):
        return f"{rows['pattern'][lane]}: no force"
    bound = "at most" if is_exact(rows)[lane] else "at least"
    return f"{rows['pattern'][lane]}: {bound} {force:.4g} N, at {gap:.4g} mm"
