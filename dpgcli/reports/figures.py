"""Figures of states: a panel for each, all at one scale, or all in one."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import ceil
from pathlib import Path
from textwrap import wrap
from typing import Any

from dpgcli.records import dataclass
from dpgcli.reports.drawing import figure_to
from dpgcli.reports.fingers import (
    MEASURE,
    NOTE_SIZE,
    WORD,
    draw_finger,
    handles,
    set_window,
    signed,
)
from dpgcli.reports.outlines import DrawnState, drawn_states, notes
from dpgcli.reports.overlay import Overlay
from dpgcli.reports.panels import DIMENSION, LEFT, LENGTHS, NO_WINDOW, PanelGrid, Window
from dpgcli.states.predict import Prediction

POINTS = 72.0  # an inch
TITLE_SIZE, DIGIT = 9.0, 0.65  # points; the width of a digit of it
AXIS_LABELS, LEGEND_ROW, NOTE = 0.42, 0.19, 0.16  # inches
WIDE = 9.0  # inches, of a page with the legend in one row
NARROW_LEGEND = 4  # columns of another


def draw_states(prediction: Prediction, path: Path, *, overlay: bool = False) -> None:
    """Draw every state to an SVG or PNG file, the same bytes each time.

    A panel for each, those with fewer inverted units first; a state that is not stable is a word.
    Or the limiting layers of all that are stable in one picture.
    """
    scene, states = prediction.plan.scene, drawn_states(prediction)
    what = "gripper of two fingers" if scene.gripper else "finger"
    title = f"States of a {what} of {prediction.plan.n_units} units"
    text = "\n".join(state.description for state in states)
    if overlay:
        over = Overlay(states)
        with figure_to(path, *over.picture.page, title, text, layout=None) as figure:
            over.draw(figure)
        return
    window = Window.around(states) or NO_WINDOW
    grid = PanelGrid.of(
        len(states), prediction.plan.n_units, window, DIMENSION if scene.gripper else 0.0
    )
    explained = partial(handles, is_gripper=scene.gripper is not None)
    foot = Foot(notes(scene), explained, grid.page[0] > WIDE)
    grid = replace(grid, foot=foot.height)
    with figure_to(path, *grid.page, title, text, layout=None) as figure:
        for place, state in enumerate(states):
            _draw_panel(figure, state, window, grid, place)
        foot.draw(figure, window, grid)


def _draw_panel(
    figure: Any, state: DrawnState, window: Window, grid: PanelGrid, place: int
) -> None:
    axes = figure.add_axes(grid.box(place))
    scale = window.size[1] / grid.shape_height  # mm per inch
    set_window(axes, window, window.left + scale * grid.panel_width, 1.0 / scale)
    is_leftmost, is_lowest = grid.is_outer(place)
    axes.tick_params("x", bottom=is_lowest, labelbottom=is_lowest)
    axes.tick_params("y", left=is_leftmost, labelleft=is_leftmost)
    in_line = ceil(len(state.pattern) / grid.n_title_lines)
    size = min(TITLE_SIZE, POINTS * grid.panel_width / (DIGIT * in_line))
    title = "\n".join(wrap(state.pattern, in_line))
    axes.set_title(title, fontsize=size, pad=3.0, linespacing=1.1)
    for finger in state.fingers:
        draw_finger(axes, finger, POINTS / scale)
    if state.faces is not None:
        _draw_aperture(axes, state, window)
    if not state.fingers:
        word = state.status.replace("_", " ").replace(" ", "\n", 1)
        middle = {"ha": "center", "va": "center", "transform": axes.transAxes}
        axes.text(0.5, 0.5, word, color=WORD, style="italic", **middle)


def _draw_aperture(axes: Any, state: DrawnState, window: Window) -> None:
    """A dimension beside the fingers, with lines to the two faces."""
    assert state.faces is not None and state.aperture is not None, "of a gripper"
    x = window.right
    for face in state.faces:
        axes.plot([face.real, x], [face.imag, face.imag], color=MEASURE, lw=0.6)
    arrow = {"arrowstyle": "<->", "color": MEASURE, "shrinkA": 0, "shrinkB": 0}
    upper, lower = (face.imag for face in state.faces)
    axes.annotate("", (x, upper), (x, lower), arrowprops={**arrow, "mutation_scale": 6, "lw": 0.8})
    text = signed(f"{state.aperture / LENGTHS[window.unit]:.1f} {window.unit}")
    if state.overlaps:
        text += "\noverlap"
    place = {"xytext": (4, 0), "textcoords": "offset points", "va": "center"}
    axes.annotate(text, (x, 0.0), color=MEASURE, fontsize=6.5, **place)


@dataclass(frozen=True)
class Foot:
    """What stands below the panels: a legend, in two rows if the page is not wide, and notes."""

    notes: list[str]
    handles: Callable[[], list[Any]]
    is_wide: bool

    @property
    def height(self) -> float:
        """In inches."""
        n_rows = 1 if self.is_wide else 2
        return AXIS_LABELS + n_rows * LEGEND_ROW + NOTE * len(self.notes) + 0.08

    def draw(self, figure: Any, window: Window, grid: PanelGrid) -> None:
        """Axis labels around all panels, the legend and notes below."""
        width, height = grid.page
        left, middle = (grid.left - LEFT + 0.06) / width, 0.5 * (1.0 + self.height / height)
        figure.text(left, middle, f"y ({window.unit})", rotation=90, va="center")
        top = (self.height - 0.22) / height
        figure.text(0.5, top, f"x ({window.unit})", ha="center", va="top")
        explained = self.handles()
        figure.legend(
            handles=explained,
            loc="upper center",
            bbox_to_anchor=(0.5, (self.height - AXIS_LABELS) / height),
            ncols=len(explained) if self.is_wide else NARROW_LEGEND,
            frameon=False,
            fontsize=8,
            borderaxespad=0.0,
        )
        for place, note in enumerate(reversed(self.notes)):
            y = (0.05 + NOTE * place) / height
            figure.text(0.5, y, note, color=WORD, fontsize=NOTE_SIZE, ha="center")
