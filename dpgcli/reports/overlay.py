"""All states of a finger in one picture: their limiting layers, each with its pattern."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from dpgcli.records import dataclass
from dpgcli.reports.fingers import NOTE_SIZE, WORD, draw_backdrop, signed
from dpgcli.reports.labels import Picture
from dpgcli.reports.outlines import DrawnState
from dpgcli.reports.panels import LENGTHS, NO_WINDOW, Window

SHADES = 0.88  # of the color map: its end is too light on white
MOST_SHADES = 12  # in the key
FOOT, HEAD = 0.98, 0.12  # inches


@dataclass(frozen=True)
class Overlay:
    """States over each other, those with more inverted units on top; what is not stable is not."""

    states: Sequence[DrawnState]

    @cached_property
    def drawn(self) -> list[DrawnState]:
        """The states that are stable."""
        return [state for state in self.states if state.fingers]

    @cached_property
    def picture(self) -> Picture:
        """A window around them with the patterns beside their tips."""
        window = Window.around(self.drawn) or NO_WINDOW
        labels = [_label(state, window.unit) for state in self.drawn]
        tips = np.array([state.fingers[0].tip for state in self.drawn], np.complex128)
        return Picture.of(window, labels, tips, FOOT, HEAD)

    def draw(self, figure: Any) -> None:
        """Draw on a figure of the size of the picture's page."""
        axes = self.picture.axes(figure)
        for state in self.drawn[:1]:
            for finger in state.fingers:
                draw_backdrop(axes, finger)
        for state in self.drawn:
            _draw_layers(axes, state)
        unit = self.picture.window.unit
        self.picture.write(axes, {_label(s, unit): shade(s.pattern) for s in self.drawn})
        self._draw_key(figure)

    def _draw_key(self, figure: Any) -> None:
        """Colors by the number of inverted units; how many are not drawn."""
        height = self.picture.page[1]
        draw_shades(figure, [state.pattern for state in self.drawn], 0.16 / height)
        if n_left_out := len(self.states) - len(self.drawn):
            note = f"not drawn: {n_left_out} that are not stable"
            figure.text(0.5, 0.05 / height, note, color=WORD, fontsize=NOTE_SIZE, ha="center")


def _label(state: DrawnState, unit: str) -> str:
    """The pattern, and a gripper's aperture."""
    if state.aperture is None:
        return state.pattern
    return signed(f"{state.pattern}  {state.aperture / LENGTHS[unit]:.1f} {unit}")


def _draw_layers(axes: Any, state: DrawnState) -> None:
    color = shade(state.pattern)
    for finger in state.fingers:
        line = np.append(finger.layer[:-1], finger.tip)
        axes.plot(line.real, line.imag, color=color, lw=2.2, solid_capstyle="butt")
        tip = finger.tip
        axes.plot(tip.real, tip.imag, "o", color=color, ms=5.5, mec="white", mew=0.8, zorder=4)


def shade(pattern: str) -> Any:
    """A color by the share of inverted units, from a map that is even for color-blind readers."""
    from matplotlib import colormaps

    return colormaps["viridis"](SHADES * pattern.count("1") / len(pattern))


def draw_shades(figure: Any, patterns: Sequence[str], bottom: float) -> None:
    """A key to the shades of patterns, at most some of them."""
    from matplotlib.lines import Line2D

    shades = {pattern.count("1"): shade(pattern) for pattern in patterns}
    every = len(shades) // (MOST_SHADES + 1) + 1
    handles = [
        Line2D([], [], color=shades[n], lw=3.0, marker="o", mec="white", label=str(n))
        for n in sorted(shades)[::every]
    ]
    if not handles:
        return
    figure.legend(
        handles=handles,
        title="inverted units",
        loc="lower center",
        bbox_to_anchor=(0.5, bottom),
        ncols=len(handles),
        frameon=False,
        fontsize=8,
        title_fontsize=8,
        borderaxespad=0.0,
    )
