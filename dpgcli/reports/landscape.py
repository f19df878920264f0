"""The energy of a finger on its way from state to state, states and saddles marked."""

from pathlib import Path
from typing import Any

import numpy as np

from dpgcli.arrays import Array, Columns
from dpgcli.reports.drawing import drawn_to
from dpgcli.states.landscape import Landscape

# of Okabe and Ito: told apart by color-blind readers; in gray by their marks
STATE, SADDLE, WAY = "#0072B2", "#D55E00", "0.35"
HEIGHT, NARROWEST, STEP, DIGIT = 4.5, 6.0, 1.1, 0.085  # inches; a step is as wide as its pattern
ABOVE, BELOW = (0, 6), (0, -8)  # points


def draw_landscape(landscape: Landscape, rows: Columns, path: Path) -> None:
    """Draw the energy over the travel of the domes that flip, to an SVG or PNG file.

    Each dome is held wherever it is on its way, while all else is at rest.
    """
    patterns = rows["pattern"][0::2]
    title = f"Energy from {patterns[0]} to {patterns[-1]}"
    n_flips, n_units = len(patterns) - 1, len(patterns[0])
    width = max(NARROWEST, 1.0 + n_flips * max(STEP, DIGIT * (n_units + 3)))
    text = "\n".join(_described(rows))
    words = {"xlabel": "travel of the domes that flip, added up (mm)", "ylabel": "energy (mJ)"}
    with drawn_to(path, width, HEIGHT, title, text, **words) as axes:
        at_states, at_saddles = _draw_way(axes, landscape)
        _mark(axes, at_states, rows["energy_mJ"][0::2], "o", STATE, "stable state")
        _mark(axes, at_saddles, rows["energy_mJ"][1::2], "^", SADDLE, "saddle, with its barrier")
        for x, energy, pattern in zip(at_states, rows["energy_mJ"][0::2], patterns, strict=True):
            _write(axes, x, energy, pattern, STATE, BELOW)
        for x, row in zip(at_saddles, range(1, len(rows["pattern"]), 2), strict=True):
            words_there = f"unit {rows['unit'][row]}\n{rows['barrier_mJ'][row]:.3g} mJ"
            _write(axes, x, rows["energy_mJ"][row], words_there, SADDLE, ABOVE)
        axes.margins(0.08, 0.18)
        axes.figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=8)


def _draw_way(axes: Any, landscape: Landscape) -> tuple[Array, Array]:
    """Draw the line; the places of states and of saddles on it, mm."""
    states, saddles = [0.0], []
    for stretch, energy in zip(landscape.stretches(), landscape.saddles.energy, strict=True):
        axes.plot(states[-1] + stretch.travel, stretch.energy, color=WAY, lw=1.4, zorder=1)
        highest = int(np.abs(stretch.energy - energy).argmin())
        saddles.append(states[-1] + float(stretch.travel[highest]))
        states.append(states[-1] + float(stretch.travel[-1]))
    return np.array(states), np.array(saddles)


def _mark(axes: Any, x: Array, energy: Array, marker: str, color: str, label: str) -> None:
    axes.plot(x, energy, marker, color=color, ms=7, label=label, zorder=2)


def _write(
    axes: Any, x: float, energy: float, text: str, color: str, offset: tuple[int, int]
) -> None:
    """Write above or below a mark."""
    side = {"va": "bottom" if offset[1] > 0 else "top", "ha": "center"}
    where = {"textcoords": "offset points", "xytext": offset, "color": color, "fontsize": 8}
    axes.annotate(text, (x, energy), **where, **side)


def _described(rows: Columns) -> list[str]:
    """A line for each state and saddle, for those who do not see the figure."""
    named = zip(rows["kind"], rows["pattern"], rows["energy_mJ"], strict=True)
    return [f"{kind} {pattern}: {energy:.5g} mJ" for kind, pattern, energy in named]
