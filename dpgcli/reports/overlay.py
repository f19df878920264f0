"""All states of a finger in one picture: their limiting layers, each with its pattern."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dpgcli.arrays import Array
from dpgcli.reports.fingers import NOTE_SIZE, WORD, draw_backdrop, set_window, signed
from dpgcli.reports.outlines import DrawnState
from dpgcli.reports.panels import LENGTHS, NARROWEST, Window

SHADES = 0.88  # of the color map: its end is too light on white
MOST_SHADES = 12  # in the key
LARGEST = 7.0  # inches, of the longer side of the picture
LEFT, TOP, FOOT = 0.62, 0.12, 0.98  # inches around the picture
LEADER, ROW, LETTER = 0.45, 0.125, 0.072  # inches: to a label, between labels, of its letters


@dataclass(frozen=True)
class Overlay:
    """States over each other, their labels on the right, those of the highest tips above.

    Sizes in inches, `scale` in inches per mm; `heights` are those of the labels above the
    picture's lower side.
    """

    states: tuple[DrawnState, ...]
    n_left_out: int
    window: Window
    scale: float
    heights: Array

    @classmethod
    def of(cls, states: Sequence[DrawnState]) -> "Overlay":
        """Of the states that are stable; labels are as near to their tips as they find room."""
        drawn = [state for state in states if state.fingers]
        window = Window.around(drawn) or Window(0.0, 1.0, 0.0, 1.0)
        scale = LARGEST / max(window.size)
        drawn.sort(key=lambda state: state.fingers[0].tip.imag)
        tips = np.array([state.fingers[0].tip.imag for state in drawn])
        heights = spread(scale * (tips - window.bottom), ROW)
        return cls(tuple(drawn), len(states) - len(drawn), window, scale, heights)

    @property
    def picture(self) -> Array:
        """Width and height of the picture."""
        return self.scale * np.array(self.window.size)

    @property
    def page(self) -> tuple[float, float]:
        """Width and height of the page."""
        labels = map(self.label, self.states)
        width = LEFT + self.picture[0] + LEADER + LETTER * max(map(len, labels), default=0) + 0.1
        above = max(self.picture[1], self.heights.max(initial=0.0) + ROW)
        return max(NARROWEST, float(width)), float(FOOT + self.below + above + TOP)

    @property
    def below(self) -> float:
        """How far labels reach below the picture."""
        return max(0.0, ROW - float(self.heights.min(initial=ROW)))

    def label(self, state: DrawnState) -> str:
        """The pattern, and a gripper's aperture."""
        if state.aperture is None:
            return state.pattern
        unit = self.window.unit
        return signed(f"{state.pattern}  {state.aperture / LENGTHS[unit]:.1f} {unit}")

    def draw(self, figure: Any) -> None:
        """Draw on a figure of the size of the page."""
        page = np.array([*self.page, *self.page])
        bottom = FOOT + self.below
        axes = figure.add_axes(np.array([LEFT, bottom, *self.picture]) / page)
        set_window(axes, self.window, self.window.right)
        axes.set_xlabel(f"x ({self.window.unit})")
        axes.set_ylabel(f"y ({self.window.unit})")
        for state in sorted(self.states, key=lambda state: state.n_inverted)[:1]:
            for finger in state.fingers:
                draw_backdrop(axes, finger)
        for state, height in zip(self.states, self.heights, strict=True):
            self._draw_state(axes, state, float(height))
        self._draw_key(figure)

    def _draw_state(self, axes: Any, state: DrawnState, height: float) -> None:
        color = _color(state)
        for finger in state.fingers:
            line = np.append(finger.layer[:-1], finger.tip)
            axes.plot(line.real, line.imag, color=color, lw=2.2, solid_capstyle="butt")
            tip = finger.tip
            axes.plot(tip.real, tip.imag, "o", color=color, ms=5.5, mec="white", mew=0.8, zorder=4)
        tip = state.fingers[0].tip
        place = (
            self.window.right + LEADER / self.scale,
            self.window.bottom + height / self.scale,
        )
        leader = {"arrowstyle": "-", "color": color, "lw": 0.6, "shrinkA": 1, "relpos": (0.0, 0.5)}
        axes.annotate(
            self.label(state),
            (tip.real, tip.imag),
            place,
            fontsize=7.5,
            va="center",
            annotation_clip=False,
            arrowprops=leader,
        )

    def _draw_key(self, figure: Any) -> None:
        """Colors by the number of inverted units; what is not drawn."""
        from matplotlib.lines import Line2D

        height = self.page[1]
        shades = {state.n_inverted: _color(state) for state in self.states}
        every = len(shades) // (MOST_SHADES + 1) + 1
        handles = [
            Line2D([], [], color=shades[n], lw=3.0, marker="o", mec="white", label=str(n))
            for n in sorted(shades)[::every]
        ]
        if handles:
            figure.legend(
                handles=handles,
                title="inverted units; at the end the tip",
                loc="lower center",
                bbox_to_anchor=(0.5, 0.16 / height),
                ncols=len(handles),
                frameon=False,
                fontsize=8,
                title_fontsize=8,
                borderaxespad=0.0,
            )
        if self.n_left_out:
            note = f"not drawn: {self.n_left_out} that are not stable"
            figure.text(0.5, 0.05 / height, note, color=WORD, fontsize=NOTE_SIZE, ha="center")


def _color(state: DrawnState) -> Any:
    """A shade by the share of inverted units: of a map that is even for color-blind readers."""
    from matplotlib import colormaps

    return colormaps["viridis"](SHADES * state.n_inverted / len(state.pattern))


def spread(heights: Array, least: float) -> Array:
    """Ascending heights moved apart by at least `least`, as little as that takes.

    The least squares of the moves are an isotonic regression.

    >>> spread(np.array([0.0, 1.0, 1.0]), 0.5).tolist()
    [0.0, 0.75, 1.25]
    """
    from scipy.optimize import isotonic_regression

    if not len(heights):
        return heights
    steps = least * np.arange(len(heights))
    return np.asarray(isotonic_regression(heights - steps).x + steps)
