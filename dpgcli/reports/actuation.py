"""A finger under pressure: pressure against tip with all that happened, shapes at the holds."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from dpgcli.actuation.readings import Readings
from dpgcli.actuation.tables import numbered
from dpgcli.actuation.travel import EventKind, Travel
from dpgcli.arrays import Array, Indices
from dpgcli.design.pressure import Pressure
from dpgcli.design.scene import Scene
from dpgcli.mechanics.coordinates import Stations
from dpgcli.records import dataclass
from dpgcli.reports.drawing import figure_to
from dpgcli.reports.fingers import draw_finger, set_window, signed
from dpgcli.reports.outlines import DrawnState, Profile, finger_shape
from dpgcli.reports.panels import Window
from dpgcli.states.patterns import texts

# of Okabe and Ito: told apart by color-blind readers; in gray by marks and dashes
RISING, FALLING, JUMP, UNSTABLE = "#0072B2", "#D55E00", "0.45", "#009E73"
MARKS = {EventKind.SNAP: "^", EventKind.RESET: "v", EventKind.CONTACT: "o", EventKind.RELEASE: "s"}
MOST_PANELS, IN_ROW = 12, 6
LETTERS = "abcdefghijkl"
POINTS = 72.0  # an inch

# in inches
WIDTH, CURVES = 9.0, 3.2
LEFT, RIGHT, HEAD, FOOT = 0.7, 0.15, 0.45, 0.5
BETWEEN, TITLE = 0.3, 0.42
NEAR = (0.02, 0.04)  # of the axes: what is nearer shares a letter's place


@dataclass(frozen=True)
class Drawing:
    """What is drawn: a way, the quantities of its points, unstable branches, and the finger."""

    way: Travel
    readings: Readings
    branches: Sequence[Readings]
    pressure: Pressure
    scene: Scene

    def draw(self, path: Path) -> None:
        """Draw to an SVG or PNG file, the same bytes each time."""
        lines = self.pressure.lines
        rows = ceil(len(self.holds) / IN_ROW)
        below = FOOT + rows * (self.panel[1] + TITLE)
        page = WIDTH, HEAD + CURVES + FOOT + below
        title = "A finger under pressure"
        with figure_to(path, *page, title, self._description(), layout=None) as figure:
            room = (WIDTH - LEFT - RIGHT + BETWEEN) / len(lines)
            drawn: list[Any] = []
            for place, line in enumerate(lines):
                box = LEFT + place * room, below + FOOT, room - BETWEEN, CURVES
                axes = figure.add_axes(_share(box, page), sharey=drawn[0] if drawn else None)
                drawn.append(axes)
                self._draw_curve(axes, place)
                axes.set_xlabel(f"pressure{f' of line {line}' if len(lines) > 1 else ''} (MPa)")
                axes.tick_params("y", labelleft=place == 0)
            drawn[0].set_ylabel("deflection of the tip, \u2212y (mm)")
            self._draw_key(figure, page)
            self._draw_holds(figure, page)

    @cached_property
    def deflection(self) -> Array:
        """How far the tip is towards the inner side, mm, by point."""
        return np.asarray(-self.readings.pose[1])

    @cached_property
    def holds(self) -> Indices:
        """The points whose shapes are drawn: ends of steps of the first cycle, some of many."""
        holds = np.array(self.way.holds, int)
        holds = holds[self.way.points.cycle[holds] == 1]
        n = min(len(holds), MOST_PANELS)
        return np.asarray(holds[np.linspace(0, len(holds) - 1, n).round().astype(int)])

    @cached_property
    def states(self) -> list[DrawnState]:
        """Their shapes."""
        return [*_drawn(self.scene, self.readings, self.holds)]

    @cached_property
    def window(self) -> Window:
        """A window around all of them."""
        window = Window.around(self.states)
        assert window is not None, "there is a hold"
        return window

    @property
    def panel(self) -> tuple[float, float]:
        """Width and height of a panel, inches."""
        n = min(len(self.holds), IN_ROW)
        width = min((WIDTH - LEFT - RIGHT + BETWEEN) / n - BETWEEN, 2.0)
        return width, width * self.window.size[1] / self.window.size[0]

    def _unit_of(self, line: int) -> int:
        return int(np.argmax(self.pressure.line_of == line))

    def _draw_curve(self, axes: Any, line: int) -> None:
        """Deflection over the pressure of a line, what happens on it, and where it is held."""
        from matplotlib.collections import LineCollection

        values = self.readings.shapes.pressure[self._unit_of(line)]
        points = np.stack((values, self.deflection), axis=1)
        segments = np.stack((points[:-1], points[1:]), axis=1)
        jumps = np.array([event.before for event in self.way.events], int)
        is_jump = np.isin(np.arange(len(segments)), jumps)
        rises = np.diff(values) >= 0.0
        for which, color, dashes in (
            (rises & ~is_jump, RISING, "-"),
            (~rises & ~is_jump, FALLING, "-"),
            (is_jump, JUMP, ":"),
        ):
            axes.add_collection(
                LineCollection([*segments[which]], colors=color, linestyles=dashes, lw=1.6)
            )
        for branch in self.branches:
            own = branch.shapes.pressure[self._unit_of(line)], -branch.pose[1]
            axes.plot(*own, color=UNSTABLE, lw=1.0, ls="--")
        self._mark_events(axes, line, points)
        axes.margins(x=0.12, y=0.08)
        axes.autoscale_view()
        self._mark_holds(axes, points)
        axes.grid(visible=True, alpha=0.25)
        axes.xaxis.set_major_formatter(lambda number, _: signed(f"{number:g}"))
        axes.yaxis.set_major_formatter(lambda number, _: signed(f"{number:g}"))

    def _mark_holds(self, axes: Any, points: Array) -> None:
        """Letters of the holds, those of one place together."""
        to_shares = axes.transScale + axes.transLimits
        together: dict[tuple[float, ...], list[tuple[str, Array]]] = {}
        for letter, hold in zip(LETTERS, points[self.holds], strict=False):
            place = tuple((to_shares.transform(hold) / NEAR).round().tolist())
            together.setdefault(place, []).append((letter, hold))
            axes.plot(*hold, ".", color="black", ms=5, zorder=5)
        said = {"textcoords": "offset points", "fontsize": 8, "ha": "right"}
        for holds in together.values():
            letters = ", ".join(letter for letter, _ in holds)
            axes.annotate(letters, holds[0][1], (-4, 3), **said)

    def _mark_events(self, axes: Any, line: int, points: Array) -> None:
        """Marks and numbers of the events of a line; numbers in the first cycle only."""
        for number, event in enumerate(self.way.events, start=1):
            if self.pressure.line_of[event.units[0]] != line:
                continue
            place = points[event.before]
            axes.plot(*place, MARKS[event.kind], color="black", mfc="white", ms=6, zorder=6)
            if self.way.points.cycle[event.before] == 1:
                said = {"textcoords": "offset points", "fontsize": 7, "zorder": 7}
                is_right = place[0] > points[:, 0].mean() and len(self.pressure.lines) > 1
                beside = (-6, -9) if is_right else (6, -4)
                said["ha"] = "right" if is_right else "left"
                axes.annotate(f"{number}: {numbered(event.units)}", place, beside, **said)

    def _draw_key(self, figure: Any, page: tuple[float, float]) -> None:
        """What colors and marks mean, above the curves."""
        from matplotlib.lines import Line2D

        kinds = [kind for kind in EventKind if any(event.kind is kind for event in self.way.events)]
        handles = [
            Line2D([], [], color=RISING, lw=1.6, label="pressure rises"),
            Line2D([], [], color=FALLING, lw=1.6, label="pressure falls"),
            *([Line2D([], [], color=JUMP, lw=1.6, ls=":", label="event")] if kinds else []),
            *(
                Line2D([], [], marker=MARKS[kind], color="black", mfc="white", lw=0, label=kind)
                for kind in kinds
            ),
            Line2D([], [], marker=".", color="black", lw=0, label="hold"),
        ]
        if self.branches:
            handles.append(Line2D([], [], color=UNSTABLE, lw=1.0, ls="--", label="unstable"))
        place = {"loc": "upper center", "bbox_to_anchor": (0.5, 1.0 - 0.05 / page[1])}
        figure.legend(handles=handles, ncols=len(handles), frameon=False, fontsize=8, **place)

    def _draw_holds(self, figure: Any, page: tuple[float, float]) -> None:
        """A panel for each hold, all at one scale."""
        width, height = self.panel
        scale = width / self.window.size[0]
        rows = ceil(len(self.holds) / IN_ROW)
        for place, state in enumerate(self.states):
            row, column = divmod(place, IN_ROW)
            left = LEFT + column * (width + BETWEEN)
            bottom = FOOT + (rows - 1 - row) * (height + TITLE)
            axes = figure.add_axes(_share((left, bottom, width, height), page))
            set_window(axes, self.window, self.window.right, scale)
            is_lowest = place + IN_ROW >= len(self.states)
            axes.tick_params("x", labelbottom=is_lowest)
            axes.tick_params("y", labelleft=column == 0)
            title = f"{LETTERS[place]}  {self._said(int(self.holds[place]))}\n{state.pattern}"
            axes.set_title(title, fontsize=7.5, pad=3.0)
            for finger in state.fingers:
                draw_finger(axes, finger, POINTS * scale)
            if is_lowest:
                axes.set_xlabel(f"x ({self.window.unit})", fontsize=8)
            if column == 0:
                axes.set_ylabel(f"y ({self.window.unit})", fontsize=8)

    def _said(self, point: int) -> str:
        """The pressures at a point, in words."""
        values = self.readings.shapes.pressure[:, point]
        each = [f"{values[self._unit_of(k)]:.4g}" for k in range(len(self.pressure.lines))]
        if len(each) == 1:
            return signed(f"{each[0]} MPa")
        pairs = zip(self.pressure.lines, each, strict=True)
        return signed(", ".join(f"{line} {value}" for line, value in pairs) + " MPa")

    def _description(self) -> str:
        """The events in words, for those who do not see them."""
        patterns = texts(self.readings.shapes.inverted).astype(str)
        said = [
            f"{number}: {event.kind} of {numbered(event.units)} at {self._said(event.before)}, "
            f"{patterns[event.before]} to {patterns[event.after]}"
            for number, event in enumerate(self.way.events, start=1)
        ]
        return "\n".join(["deflection of the tip over pressure", *said])


def _share(box: Sequence[float], page: tuple[float, float]) -> Array:
    return np.asarray(np.array(box) / np.array([*page, *page]))


def _drawn(scene: Scene, readings: Readings, which: Indices) -> Iterator[DrawnState]:
    """The shapes of some points."""
    profile = Profile.of(scene)
    placed = readings.in_gripper
    nodes = readings.nodes if placed is None else placed.upper
    patterns = texts(readings.shapes.inverted).astype(str)
    for point in which.tolist():
        here = Stations(*(part[:, point] for part in nodes))
        base, top = here.base_x + 1j * here.base_y, here.top_x + 1j * here.top_y
        shape = finger_shape(profile, base, top, readings.shapes.inverted[:, point])
        fingers = (shape,) if placed is None else (shape, shape.mirrored())
        yield DrawnState(str(patterns[point]), "stable", shape.tip, fingers)
