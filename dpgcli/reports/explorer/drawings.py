"""The best designs of a space, drawn as fingers in a page: at rest, and with all units inverted."""

from collections.abc import Iterator, Sequence
from html import escape

import numpy as np

from dpgcli.reports.explorer.content import BestDesign
from dpgcli.reports.outlines import FingerShape, Points
from dpgcli.reports.panels import Window
from dpgcli.reports.space import DesignSpace
from dpgcli.text import printable

LEGEND = (
    "Each design is the best by what stands below it. Outlined at rest, filled with all units "
    "inverted; all at one scale. The thick line is the limiting layer."
)
OF_BODY = " Dashed: the body; the fingers are as they are without it."


def best_designs(space: DesignSpace, best: Sequence[BestDesign], rows: Sequence[int]) -> str:
    """Figures of the best designs; `rows` are those that the explorer knows."""
    bodies = [design.body for design in best if design.body is not None]
    window = Window.around([state for design in best for state in design.states], bodies)
    if window is None:
        return ""
    figures = "\n".join(
        _figure(space, design, window, rows.index(design.row)) for design in best if design.states
    )
    return f'<p>{LEGEND}{OF_BODY if bodies else ""}</p>\n<div class="shapes">\n{figures}\n</div>\n'


def _figure(space: DesignSpace, design: BestDesign, window: Window, place: int) -> str:
    number = space.number(design.row)
    said = f"Design {number}: {'; '.join(state.description for state in design.states)}"
    values = zip(space.swept, space.point(design.row), strict=True)
    best = ", ".join(
        f"{space.words(name)} {space.shown(name, space.designs[name][design.row])}"
        for name in design.metrics
    )
    at = ", ".join(f"{name} {value}" for name, value in values)
    button = f'<button type="button" data-row="{place}" hidden>Explore design {number}</button>'
    caption = f"<strong>Design {number}</strong>: {_text(best)}<br>{_text(at)}<br>{button}"
    drawing = "\n".join(_svg(design, window, said))
    return f"<figure>\n{drawing}\n<figcaption>{caption}</figcaption>\n</figure>"


def _svg(design: BestDesign, window: Window, said: str) -> Iterator[str]:
    box = (window.left, -window.top, *window.size)
    shape = " ".join(f"{value:.3f}" for value in box)
    yield f'<svg viewBox="{shape}" role="img" aria-label="{_text(said)}">'
    if design.body is not None:
        yield f'<polygon class="body" points="{_points(design.body)}"/>'
    for state in design.states:
        for finger in state.fingers:
            yield from _straight(finger) if not finger.are_inverted.any() else _filled(finger)
    yield "</svg>"


def _straight(finger: FingerShape) -> Iterator[str]:
    for points in finger.chambers:
        yield f'<polygon class="straight" points="{_points(points)}"/>'


def _filled(finger: FingerShape) -> Iterator[str]:
    kinds = ["inverted" if is_inverted else "ground" for is_inverted in finger.are_inverted]
    for points, kind in zip(finger.chambers, [*kinds[:-1], "end"], strict=True):
        yield f'<polygon class="chamber {kind}" points="{_points(points)}"/>'
    yield f'<polyline class="mount" points="{_points(finger.mount)}"/>'
    layer = f'stroke-width="{finger.thickness:.3f}" points="{_points(finger.layer)}"'
    yield f'<polyline class="layer" {layer}/>'


def _points(points: Points) -> str:
    pairs = np.column_stack((points.real, -points.imag)).round(3).tolist()
    return " ".join(f"{x:g},{y:g}" for x, y in pairs)


def _text(text: str) -> str:
    return escape(printable(text))
