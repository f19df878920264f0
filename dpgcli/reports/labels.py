"""A picture at one scale with labels on its right, which neither hide it nor each other."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from dpgcli.arrays import Array
from dpgcli.records import dataclass
from dpgcli.reports.fingers import set_window
from dpgcli.reports.outlines import Points
from dpgcli.reports.panels import NARROWEST, Window

LARGEST = 7.0  # inches, of the longer side of the picture
LEFT = 0.62  # inches left of it
LEADER, ROW, LETTER = 0.45, 0.125, 0.072  # inches: to a label, between labels, of its letters
LABEL_SIZE = 7.5  # points


@dataclass(frozen=True)
class Picture:
    """What is in a window, and a label for some of its points (mm), from the lowest on.

    All else is in inches, `scale` in inches per mm; `heights` of labels are above the picture's
    lower side, `foot` and `head` what is below and above.
    """

    window: Window
    labels: tuple[str, ...]
    points: Points
    heights: Array
    foot: float
    head: float

    @classmethod
    def of(
        cls, window: Window, labels: Sequence[str], points: Points, foot: float, head: float
    ) -> "Picture":
        """Labels are as near to the heights of their points as they find room."""
        order = np.argsort(points.imag, kind="stable")
        scale = LARGEST / max(window.size)
        heights = spread(scale * (points[order].imag - window.bottom), ROW)
        return cls(window, tuple(labels[i] for i in order), points[order], heights, foot, head)

    @property
    def scale(self) -> float:
        """Inches per mm."""
        return LARGEST / max(self.window.size)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the picture."""
        return self.scale * self.window.size[0], self.scale * self.window.size[1]

    @property
    def bottom(self) -> float:
        """The picture's lower side: above the foot, and above labels that reach below it."""
        return self.foot + max(0.0, ROW - float(self.heights.min(initial=ROW)))

    @property
    def page(self) -> tuple[float, float]:
        """Width and height of the page."""
        width = LEFT + self.size[0] + LEADER + LETTER * max(map(len, self.labels), default=0) + 0.1
        above = max(self.size[1], float(self.heights.max(initial=0.0)) + ROW)
        return max(NARROWEST, width), self.bottom + above + self.head

    def axes(self, figure: Any) -> Any:
        """Axes on a figure of the size of the page."""
        page = np.array([*self.page, *self.page])
        axes = figure.add_axes(np.array([LEFT, self.bottom, *self.size]) / page)
        set_window(axes, self.window, self.window.right, self.scale)
        axes.set_xlabel(f"x ({self.window.unit})")
        axes.set_ylabel(f"y ({self.window.unit})")
        return axes

    def write(self, axes: Any, colors: dict[str, Any]) -> None:
        """Write the labels; lines in their colors lead to the points."""
        x = self.window.right + LEADER / self.scale
        for label, point, height in zip(self.labels, self.points, self.heights, strict=True):
            leader = {"arrowstyle": "-", "lw": 0.6, "shrinkA": 1, "relpos": (0.0, 0.5)}
            axes.annotate(
                label,
                (point.real, point.imag),
                (x, self.window.bottom + height / self.scale),
                fontsize=LABEL_SIZE,
                va="center",
                annotation_clip=False,
                arrowprops={**leader, "color": colors[label]},
            )


def spread(heights: Array, least: float) -> Array:
    """Ascending heights moved apart to at least `least`, as little as that takes.

    The least squares of the moves are an isotonic regression.

    >>> spread(np.array([0.0, 1.0, 1.0]), 0.5).tolist()
    [0.0, 0.75, 1.25]
    """
    from scipy.optimize import isotonic_regression

    if not len(heights):
        return heights
    steps = least * np.arange(len(heights))
    return np.asarray(isotonic_regression(heights - steps).x + steps)
