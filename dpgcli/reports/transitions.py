"""The graph of states as a figure: layers by the number of inverted units, edges by pressure."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dpgcli.arrays import Array, Columns
from dpgcli.reports.drawing import drawn_to

COLORS = ("#31688e", "#c1440e", "#35b779", "#7b3294", "#8c6d31", "#d6569a")  # of lines, in turn
REACHED, OTHER = "#222222", "#b0b0b0"
LAYER, PLACE = 2.2, 0.62  # inches between layers, and between states of a layer
WIDENING = 0.1  # inches between layers more for each state of the largest
BENDS = {"+": 0.10, "-": 0.16}  # of an edge, to its left: so that both directions are seen
STYLES = {"+": "-", "-": "--"}
TRIED = (0.36, 0.3, 0.44, 0.24, 0.52, 0.6, 0.68)  # of a layer along an edge, for its label
ROOM = np.array([0.55, 0.13])  # inches of a label
MARGIN = 15  # points between an edge's end and the middle of its state's name


def draw_transitions(states: Columns, transitions: Columns, path: Path) -> None:
    """Draw stable states and their transitions to a .svg or .png file.

    Both are columns of `api.transitions`. States that are not reached from rest are gray, and so
    are the edges that start there.
    """
    patterns = states["pattern"].astype(str).tolist()
    places = _places(patterns)
    is_reached = dict(zip(patterns, states["reachable"].tolist(), strict=True))
    x, y = np.array([*places.values()]).T
    inches = np.array([LAYER + WIDENING * float(np.ptp(y)), PLACE])
    size = inches[0] * (1.0 + np.ptp(x)), 1.4 + PLACE * (1.0 + np.ptp(y))
    said = f"{len(patterns)} stable states and the pressures (MPa) at which they are left"
    with drawn_to(path, *size, said, said) as axes:
        axes.set_axis_off()
        axes.grid(visible=False)
        lines = list(dict.fromkeys(transitions["line"].tolist()))
        colors = {line: COLORS[k % len(COLORS)] for k, line in enumerate(lines)}
        _draw_edges(axes, transitions, places, is_reached, colors, inches)
        for pattern, place in places.items():
            _draw_state(axes, pattern, place, is_reached[pattern])
        axes.set_xlim(x.min() - 0.5, x.max() + 0.5)
        axes.set_ylim(y.min() - 0.8, y.max() + 0.8)
        _legend(axes, colors, is_gray=not all(is_reached.values()))


def _places(patterns: list[str]) -> dict[str, tuple[float, float]]:
    """Where states stand: to the right by inverted units, in a layer in the order of patterns."""
    layers: dict[int, list[str]] = {}
    for pattern in patterns:
        layers.setdefault(pattern.count("1"), []).append(pattern)
    return {
        pattern: (float(n_inverted), 0.5 * (len(layer) - 1) - (len(layer) - 1 - k))
        for n_inverted, layer in sorted(layers.items())
        for k, pattern in enumerate(layer)
    }


def _draw_state(axes: Any, pattern: str, place: tuple[float, float], is_reached: bool) -> None:
    color = REACHED if is_reached else OTHER
    box = {"boxstyle": "round,pad=0.25", "fc": "white", "ec": color, "lw": 1.0}
    axes.text(*place, pattern, ha="center", va="center", color=color, bbox=box, zorder=3)


def _draw_edges(
    axes: Any,
    transitions: Columns,
    places: Mapping[str, tuple[float, float]],
    is_reached: Mapping[str, bool],
    colors: Mapping[str, str],
    inches: Array,
) -> None:
    rows = zip(
        *(
            transitions[name].astype(str).tolist()
            for name in ("pattern", "pattern_after", "direction", "line", "tie")
        ),
        transitions["pressure_MPa"].tolist(),
        strict=True,
    )
    taken = [np.array(place) * inches for place in places.values()]
    for source, target, direction, line, tie, pressure in rows:
        if target and target != source:
            color = colors[line] if is_reached[source] else OTHER
            ends = np.array([places[source], places[target]])
            text = f"{pressure:.4g}" + (" tie" if tie else "")
            n_layers = max(1.0, abs(ends[1, 0] - ends[0, 0]))
            bend = BENDS[direction]
            tries = [_along(ends * inches, bend, share / n_layers) for share in TRIED]
            taken.append(_with_most_room(np.array(tries), np.array(taken)))
            _draw_edge(axes, ends, direction, color)
            _draw_label(axes, taken[-1] / inches, color, text)


def _with_most_room(tries: Array, taken: Array) -> Array:
    """The first place at which a label covers nothing that is there, else that which covers least.

    Places (place, 2) in inches; those taken are the middles of labels and names.
    """
    apart = (np.abs(tries[:, None] - taken) / ROOM).max(axis=2).min(axis=1)
    return np.asarray(tries[np.minimum(apart, 1.0).argmax()])


def _draw_edge(axes: Any, ends: Array, direction: str, color: str) -> None:
    """An arrow that bends to its right."""
    axes.annotate(
        "",
        ends[1],
        ends[0],
        arrowprops={
            "arrowstyle": "->", "color": color, "ls": STYLES[direction], "lw": 0.9,
            "connectionstyle": f"arc3,rad={BENDS[direction]}", "shrinkA": MARGIN, "shrinkB": MARGIN,
        },
        zorder=_height(color),
    )  # fmt: skip


def _draw_label(axes: Any, place: Array, color: str, text: str) -> None:
    white = {"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.85}
    axes.text(
        *place,
        text,
        color=color,
        fontsize=6.5,
        ha="center",
        va="center",
        bbox=white,
        zorder=_height(color),
    )


def _height(color: str) -> float:
    """What is gray lies below."""
    return 1.0 if color == OTHER else 2.0


def _along(ends: Array, bend: float, share: float) -> Array:
    """A place on the curve of an arrow between ends in inches, as Matplotlib's arc3 draws it."""
    start, stop = ends
    right, up = stop - start
    middle = 0.5 * (start + stop) + bend * np.array([up, -right])
    weights = (1.0 - share) ** 2, 2.0 * share * (1.0 - share), share**2
    return np.asarray(weights[0] * start + weights[1] * middle + weights[2] * stop)


def _legend(axes: Any, colors: Mapping[str, str], *, is_gray: bool) -> None:
    """What colors and dashes say."""
    names = [(f"line {line}", color, "-") for line, color in colors.items()]
    names += [("pressure rises", REACHED, STYLES["+"]), ("pressure falls", REACHED, STYLES["-"])]
    names += [("not reached from rest", OTHER, "-")] if is_gray else []
    for name, color, style in names:
        axes.plot([], [], color=color, ls=style, label=name)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=len(names), frameon=False)
