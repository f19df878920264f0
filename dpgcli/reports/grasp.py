"""Figures of grasps: fingers on a body with the forces on it, a panel for each state."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dpgcli.arrays import Array, Columns
from dpgcli.design.bodies import Body, Jaws, at_place
from dpgcli.grasping.frames import FingerFrame
from dpgcli.grasping.grasped import Grasped
from dpgcli.grasping.table import BETWEEN, Grasps
from dpgcli.reports.drawing import figure_to
from dpgcli.reports.figures import POINTS, TITLE_SIZE, WIDE, Foot
from dpgcli.reports.fingers import EDGE, MEASURE, WORD, draw_finger, handles, set_window
from dpgcli.reports.outlines import (
    FingerShape,
    Points,
    Profile,
    around_body,
    finger_shape,
    notes,
)
from dpgcli.reports.panels import PanelGrid, Window
from dpgcli.states.certify import Status
from dpgcli.states.patterns import inverted_units

BODY = "#DCE9F3"
LONGEST = 0.2  # of the window: the arrow of the largest force
PLATE = 1.6  # points: the thickness of a jaw
SHORTEST = 4.0  # points: an arrow's head


def draw_grasps(found: Grasps, rows: Columns, path: Path) -> None:
    """Draw every grasp to an SVG or PNG file, the same bytes each time."""
    n = range(len(rows["pattern"]))
    titles, lines = [_title(rows, row) for row in n], [_described(rows, row) for row in n]
    draw_panels(found, rows, path, ("Grasps", "\n".join(lines)), titles)


def draw_panels(
    found: Grasps,
    rows: Columns,
    path: Path,
    described: tuple[str, str],
    titles: Sequence[str],
    ghosts: Mapping[int, Array] | None = None,
) -> None:
    """Draw grasps, a panel for each row, under these titles.

    `described` are title and text for those who do not see it. `ghosts` (2,) mm are places by row
    between which the body moves and that where it is.
    """
    n, pale = len(titles), ghosts or {}
    profile = Profile.of(found.scene)
    shapes = [_fingers(found, profile, row, rows) for row in range(n)]
    bodies = [_body(found, row) for row in range(n)]
    drawn = [finger.points for own in shapes for finger in own]
    window = Window.of(np.concatenate([*bodies, *drawn]))
    largest = _largest(found, rows)
    grid = PanelGrid.of(n, max(map(len, titles)), window)
    on_what = _on_what(found)
    said = [*notes(found.scene), _said(largest, on_what)]
    foot = Foot(said, partial(_handles, found.body, on_what), grid.page[0] > WIDE)
    grid = replace(grid, foot=foot.height)
    with figure_to(path, *grid.page, *described, layout=None) as figure:
        for row, fingers in enumerate(shapes):
            axes = figure.add_axes(grid.box(row))
            scale = window.size[1] / grid.shape_height  # mm per inch
            set_window(axes, window, window.left + scale * grid.panel_width, 1.0 / scale)
            is_leftmost, is_lowest = grid.is_outer(row)
            axes.tick_params("x", bottom=is_lowest, labelbottom=is_lowest)
            axes.tick_params("y", left=is_leftmost, labelleft=is_leftmost)
            axes.set_title(titles[row], fontsize=TITLE_SIZE, pad=3.0)
            if row in pale:
                _draw_ghost(axes, bodies[row], pale[row] - found.centers[:, row])
            if found.body is not None:
                _draw_body(axes, found.body, bodies[row])
            for finger in fingers:
                draw_finger(axes, finger, POINTS / scale)
            status = Status(rows["status"][row])
            if status is Status.STABLE:
                _draw_forces(axes, found, row, LONGEST * max(window.size) / (largest or 1.0))
            else:
                word = status.text.replace("_", "\n", 1)
                middle = {"ha": "center", "va": "center", "transform": axes.transAxes}
                axes.text(0.5, 0.5, word, color=WORD, style="italic", **middle)
        foot.draw(figure, window, grid)


def _largest(found: Grasps, rows: Columns) -> float:
    """The largest force that is drawn, N."""
    is_there = rows["status"] == Status.STABLE
    sizes = [
        part.push[:, own[is_there]].max(initial=0.0)
        for finger, own in zip(found.fingers, found.pairs, strict=True)
        for part in finger.pushes
    ]
    return float(max(sizes))


def _on_what(found: Grasps) -> str:
    """What forces are drawn on."""
    if found.body is None:
        return "other finger"
    is_met = any(finger.between is not None for finger in found.fingers)
    return "body or the other finger" if is_met else "body"


def _draw_ghost(axes: Any, around: Points, away: Array) -> None:
    """The outline of a body at another place, so far away, and the way between both."""
    there = np.append(around, around[0]) + complex(*away)
    axes.plot(there.real, there.imag, color=EDGE, lw=0.7, ls="--", zorder=0)
    way = np.mean(around) + np.array([complex(*away), 0.0])
    axes.plot(way.real, way.imag, color=EDGE, lw=0.7, ls=":", zorder=0.5)


def _at_rest(found: Grasps, row: int) -> Body | None:
    """The body where it has come to rest; where it was, if there is no answer."""
    body, center, n_rows = found.body, found.centers[:, row], found.pairs.shape[1]
    if body is None or np.isnan(center).any():
        return body
    turned, opened = (
        float(np.broadcast_to(by, n_rows)[row]) for by in (found.turned, found.opened)
    )
    if isinstance(body, Jaws):
        body = replace(body, gap=body.gap + opened)
    return at_place(body, center, turned)


def _body(found: Grasps, row: int) -> Points:
    """Points around the body; none without one."""
    body = _at_rest(found, row)
    return np.zeros(0, complex) if body is None else around_body(body)


def _draw_body(axes: Any, body: Body, around: Points) -> None:
    if isinstance(body, Jaws):
        axes.fill(around.real, around.imag, facecolor=BODY, lw=0.0, zorder=0)
        for plate in (around[:2], around[2:]):
            axes.plot(plate.real, plate.imag, color=EDGE, lw=PLATE, zorder=0)
    else:
        axes.fill(around.real, around.imag, facecolor=BODY, edgecolor=EDGE, lw=0.7, zorder=0)


def _fingers(found: Grasps, profile: Profile, row: int, rows: Columns) -> tuple[FingerShape, ...]:
    """The shapes of a row's fingers; none without an answer.

    Where the body gets away they are as they were when it was let go of.
    """
    is_let_go = rows["status"][row] == Status.NOT_HELD and found.closing is None
    if rows["status"][row] != Status.STABLE and not is_let_go:
        return ()
    taken = [(frame, *found.take(place, row)) for place, frame in enumerate(found.frames)]
    return tuple(_shape(found, profile, frame, own, lane) for frame, own, lane in taken)


def _shape(
    found: Grasps, profile: Profile, frame: FingerFrame, own: Grasped, lane: int
) -> FingerShape:
    finger = found.scene.finger
    nodes = own.nodes
    as_upper = frame._replace(side=1)
    height = float(finger.segment_height[0, 0])
    base = _complex(as_upper.placed(_with(nodes.base_x, nodes.base_y, lane, 0.0)))
    top = _complex(as_upper.placed(_with(nodes.top_x, nodes.top_y, lane, height)))
    inverted = inverted_units(own.after[lane : lane + 1], finger.n_units)[:, 0]
    shape = finger_shape(profile, base, top, inverted)
    return shape if frame.side > 0 else shape.mirrored()


def _with(x: Array, y: Array, lane: int, height: float) -> Array:
    """Nodes of a lane, behind the clamped one, (2, station)."""
    return np.stack((np.append(0.0, x[:, lane]), np.append(height, y[:, lane])))


def _complex(points: Array) -> Points:
    together: Points = points[0] + 1j * points[1]
    return together


def _draw_forces(axes: Any, found: Grasps, row: int, scale: float) -> None:
    """Arrows from the places of contact into the body, or the finger; `scale` in mm per N."""
    body, there = found.body, _at_rest(found, row)
    moved = np.zeros(2) if body is None or there is None else there.middle - body.middle
    for place, frame in enumerate(found.frames):
        own, lane = found.take(place, row)
        few = [part.take_lanes(np.array([lane])) for part in own.pushes]
        for part, cell in [(p, c) for p in few for c in np.flatnonzero(p.push[:, 0] > 0.0)]:
            way = frame.outside(part.touches.directions[:, cell, 0])
            start = frame.placed(part.touches.places[:, cell, 0]) + moved
            end = start + scale * part.push[cell, 0] * way
            arrow = {"arrowstyle": "-|>", "color": MEASURE, "lw": 1.1, "shrinkA": 0, "shrinkB": 0}
            arrow["mutation_scale"] = SHORTEST * 2.0
            axes.annotate("", end, start, arrowprops=arrow, zorder=5)


def _handles(body: Body | None, on_what: str) -> list[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    of_fingers = [handle for handle in handles(is_gripper=False) if handle.get_label() != "tip"]
    patch = Patch(facecolor=BODY, edgecolor=EDGE, lw=0.7, label="body")
    label = f"force on the {on_what}"
    arrow = Line2D([], [], color=MEASURE, marker=">", lw=1.1, ms=5, label=label)
    return [*of_fingers, *(() if body is None else (patch,)), arrow]


def _said(largest: float, on_what: str) -> str:
    if largest == 0.0:
        return f"no forces on the {on_what}"
    return f"arrows are to scale: the longest is {largest:.3g} N"


def _title(rows: Columns, row: int) -> str:
    before, after = rows["pattern"][row], rows["pattern_after"][row]
    return before if after in ("", before) else f"{before} → {after}"


def _described(rows: Columns, row: int) -> str:
    """A grasp in one line, for those who do not see it."""
    status = Status(rows["status"][row])
    if status is not Status.STABLE:
        return f"{_title(rows, row)}: {status.text.replace('_', ' ')}"
    n = rows["n_contacts"][row]
    force = f", largest force {rows['max_contact_N'][row]:.4g} N" if n else ""
    between = rows[BETWEEN][row] if BETWEEN in rows else 0.0
    met = f", {between:.4g} N between the fingers" if between else ""
    return f"{_title(rows, row)}: {n} contacts{force}{met}"
