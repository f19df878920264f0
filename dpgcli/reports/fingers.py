"""Fingers on axes: chambers, inverted ones filled, limiting layer, tip, and what they mean."""

from typing import Any

import numpy as np

from dpgcli.arrays import Array
from dpgcli.reports.outlines import FingerShape
from dpgcli.reports.panels import LENGTHS, Window

# of Okabe and Ito: told apart by color-blind readers and in gray
INVERTED, TIP, MEASURE = "#E69F00", "#D55E00", "#0072B2"
REST, END, EDGE, MOUNT = "#FFFFFF", "#D0D0D0", "#4D4D4D", "#999999"
PALE, WORD = "#EFEFEF", "#595959"
EDGE_WIDTH, LAYER_WIDTH, MOUNT_WIDTH = 0.7, 1.6, 3.0  # points
LARGEST_SHARES = np.array([0.04, 0.1])  # of the mount's length: edges, layer
NOTE_SIZE = 7.0  # points
MOST_STEPS, STEP = 5, 0.2  # between ticks; inches that one takes at least
BUTT: dict[str, Any] = {"solid_capstyle": "butt", "solid_joinstyle": "round"}


def draw_finger(axes: Any, finger: FingerShape, scale: float) -> None:
    """Draw a finger; `scale` in points per mm. Lines are thinner where it is very small."""
    colors = [INVERTED if is_inverted else REST for is_inverted in finger.are_inverted]
    size = scale * abs(finger.mount[1] - finger.mount[0])
    edge_width, layer_width = np.minimum((EDGE_WIDTH, LAYER_WIDTH), size * LARGEST_SHARES)
    _draw_chambers(axes, finger, [*colors[:-1], END], EDGE, edge_width)
    _draw_line(axes, finger.mount, MOUNT, MOUNT_WIDTH)
    _draw_line(axes, finger.layer, "black", max(layer_width, finger.thickness * scale))
    axes.plot(finger.tip.real, finger.tip.imag, "o", color=TIP, ms=5, mec="white", mew=0.7)


def draw_backdrop(axes: Any, finger: FingerShape) -> None:
    """Draw the chambers of a finger, pale, and where it is mounted."""
    _draw_chambers(axes, finger, [PALE], "white", EDGE_WIDTH)
    _draw_line(axes, finger.mount, MOUNT, MOUNT_WIDTH)


def _draw_chambers(
    axes: Any, finger: FingerShape, colors: list[str], edge: str, width: float
) -> None:
    from matplotlib.collections import PolyCollection

    outlines = [np.column_stack((points.real, points.imag)) for points in finger.chambers]
    polygons = PolyCollection(outlines, facecolors=colors, edgecolors=edge, lw=width)
    axes.add_collection(polygons)


def _draw_line(axes: Any, points: Any, color: str, width: float) -> None:
    axes.plot(points.real, points.imag, color=color, lw=width, **BUTT)


def handles(*, is_gripper: bool) -> list[Any]:
    """What the parts of a finger are, for a legend."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    edge: dict[str, Any] = {"edgecolor": EDGE, "lw": EDGE_WIDTH}
    found = [
        Patch(facecolor=INVERTED, label="inverted unit", **edge),
        Patch(facecolor=REST, label="unit in its ground state", **edge),
        Patch(facecolor=END, label="end (no unit)", **edge),
        Line2D([], [], color="black", lw=3.0, label="limiting layer"),
        Line2D([], [], color=TIP, marker="o", mec="white", lw=0, label="tip"),
        Line2D([], [], color=MOUNT, lw=MOUNT_WIDTH, label="mount"),
    ]
    if is_gripper:
        found.append(Line2D([], [], color=MEASURE, lw=0.8, label="aperture"))
    return found


def set_window(axes: Any, window: Window, right: float, scale: float) -> None:
    """Show a window, up to `right`, with ticks in its unit and a faint grid.

    `scale` is in inches per mm.
    """
    unit = LENGTHS[window.unit]
    axes.set_xlim(window.left, right)
    axes.set_ylim(window.bottom, window.top)
    ticks = _ticks(window.left / unit, window.right / unit, scale * unit)
    axes.set_xticks(ticks * unit, _texts(ticks))
    ticks = _ticks(window.bottom / unit, window.top / unit, scale * unit)
    axes.set_yticks(ticks * unit, _texts(ticks))
    axes.grid(visible=True, color="0.92", lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[:].set_color("0.85")
    axes.tick_params(labelsize=7, color="0.6", length=2.5)


def _ticks(low: float, high: float, scale: float) -> Array:
    from matplotlib.ticker import MaxNLocator

    n_steps = min(MOST_STEPS, max(1, int((high - low) * scale / STEP)))
    ticks = np.asarray(MaxNLocator(n_steps, steps=[1, 2, 5, 10]).tick_values(low, high))
    return ticks[(low <= ticks) & (ticks <= high)]


def _texts(numbers: Array) -> list[str]:
    return [signed(f"{number:g}") for number in numbers]


def signed(number: str) -> str:
    """A number with a minus sign where it has a hyphen."""
    return number.replace("-", "\u2212")
