"""Small sketches of states for terminals, of braille: two by four dots a character."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from dpgcli.arrays import Flags
from dpgcli.reports.outlines import DrawnState, FingerShape, Points
from dpgcli.reports.panels import Window

WIDEST, HIGHEST = 18, 9  # characters of a sketch
BETWEEN = 2  # columns
BLANK = 0x2800  # the braille character without dots
DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])


def sketches(states: Sequence[DrawnState], width: int) -> str:
    """Sketches side by side in lines of `width` characters, each under its pattern.

    Inverted units are filled, all others outlines; all have one scale. What is not stable is a
    word.
    """
    window = Window.around(states)
    size = _size(window, width)
    blocks = [_block(state, window, size) for state in states]
    columns = max(map(len, (line for block in blocks for line in block)), default=0)
    n_beside = max(1, (width + BETWEEN) // (columns + BETWEEN))
    rows = [_beside(blocks[i : i + n_beside], columns) for i in range(0, len(blocks), n_beside)]
    return "\n\n".join("\n".join(row).rstrip() for row in rows)


def _size(window: Window | None, width: int) -> tuple[int, int]:
    """Columns and lines of a sketch: characters are twice as high as wide."""
    if window is None:
        return 1, 1
    aspect = window.size[1] / window.size[0]
    columns = max(1, min(WIDEST, width, round(2 * HIGHEST / aspect)))
    return columns, max(1, min(HIGHEST, round(0.5 * columns * aspect)))


def _block(state: DrawnState, window: Window | None, size: tuple[int, int]) -> list[str]:
    if not state.fingers or window is None:
        return [state.pattern, state.status]
    return [state.pattern, *braille(_dots(state.fingers, window, size))]


def _beside(blocks: Sequence[list[str]], columns: int) -> Iterator[str]:
    n_lines = max(map(len, blocks))
    filled = [[*block, *[""] * (n_lines - len(block))] for block in blocks]
    for line in zip(*filled, strict=True):
        yield (" " * BETWEEN).join(part.ljust(columns) for part in line).rstrip()


def _dots(fingers: Sequence[FingerShape], window: Window, size: tuple[int, int]) -> Flags:
    """Which dots are set, (row, column), the upper row first."""
    n_rows, n_columns = len(DOTS) * size[1], 2 * size[0]
    scale = min((n_columns - 1) / window.size[0], (n_rows - 1) / window.size[1])
    corner = complex(window.left, window.top)
    dots = np.zeros((n_rows, n_columns), bool)
    for finger in fingers:
        for outline, is_inverted in zip(finger.chambers, finger.are_inverted, strict=True):
            ring = (outline - corner) * scale
            _draw(dots, np.append(ring, ring[0]))
            if is_inverted:
                _fill(dots, ring)
        _draw(dots, (finger.layer - corner) * scale)
    return dots


def _draw(dots: Flags, line: Points) -> None:
    """Set the dots along a line, in dots from the upper left corner."""
    for start, end in pairwise(line):
        n_steps = 2 * int(abs(end - start)) + 2
        points = start + (end - start) * np.linspace(0.0, 1.0, n_steps)
        dots[np.rint(-points.imag).astype(int), np.rint(points.real).astype(int)] = True


def _fill(dots: Flags, ring: Points) -> None:
    """Set the dots inside a ring."""
    import shapely

    row, column = np.indices(dots.shape)
    polygon = shapely.Polygon(np.column_stack((ring.real, -ring.imag)))
    dots |= shapely.contains_xy(polygon, column, row)


def braille(dots: Flags) -> list[str]:
    """Lines of braille, four rows and two columns of dots a character; spaces where none is set.

    >>> braille(np.array([[1, 0, 1, 1], [0, 1, 1, 1], [1, 0, 1, 1], [0, 1, 1, 1]], bool))
    ['⢕⣿']
    """
    cells = dots.reshape(-1, len(DOTS), dots.shape[1] // 2, 2).swapaxes(1, 2)
    codes = (cells * DOTS).sum(axis=(2, 3))
    return ["".join(chr(BLANK + code) if code else " " for code in line) for line in codes]
