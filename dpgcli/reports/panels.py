"""Where panels are on a page, and what each shows: one window at one scale for all."""

from collections.abc import Sequence
from math import ceil, inf, log

import numpy as np

from dpgcli.arrays import Array
from dpgcli.records import dataclass
from dpgcli.reports.outlines import DrawnState, Points

LENGTHS = {"m": 1e3, "mm": 1.0, "µm": 1e-3, "nm": 1e-6}  # in mm
FLATTEST = 1.0 / 6.0  # window: of its larger side
MARGIN = 0.03  # of the same
SMALLEST = 1e-9  # window, mm

# in inches
PAGE, NARROWEST = (11.0, 11.0), 5.6
LARGEST_PANEL, READABLE = 3.4, 0.95
TITLE, LEFT, RIGHT, BETWEEN = 0.25, 0.62, 0.08, 0.12
TITLE_LINE, DIGIT = 0.12, 0.06  # of a small title: its height, the width of a digit
DIMENSION = 0.62  # beside the fingers of a gripper

BEST_ASPECT = 1.3  # of a page
EMPTY_PLACES, UNREADABLE = 5.0, 3.0  # how bad a page is by shares of these


@dataclass(frozen=True)
class Window:
    """What a panel shows, in mm."""

    left: float
    right: float
    bottom: float
    top: float

    @classmethod
    def around(cls, states: Sequence[DrawnState], others: Sequence[Points] = ()) -> "Window | None":
        """A window around all shapes, and other points with them; None if there are no shapes."""
        points = [finger.points for state in states for finger in state.fingers]
        return cls.of(np.concatenate([*points, *others])) if points else None

    @classmethod
    def of(cls, points: Points) -> "Window":
        """A window around points (mm), not too flat, with a margin."""
        size = max(np.ptp(points.real), np.ptp(points.imag), SMALLEST)
        sides = []
        for values in (points.real, points.imag):
            spare = max(0.0, FLATTEST * size - np.ptp(values)) / 2.0 + MARGIN * size
            sides += [float(values.min() - spare), float(values.max() + spare)]
        return cls(*sides)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height."""
        return self.right - self.left, self.top - self.bottom

    @property
    def unit(self) -> str:
        """The unit of length in which its numbers are short.

        >>> Window(0.0, 40.0, -10.0, 10.0).unit, Window(0.0, 0.04, 0.0, 0.0).unit
        ('mm', 'µm')
        """
        return next((unit for unit in LENGTHS if max(self.size) >= LENGTHS[unit]), "nm")


NO_WINDOW = Window(0.0, 1.0, 0.0, 1.0)  # where there is nothing to see


@dataclass(frozen=True)
class PanelGrid:
    """Panels in rows on a page, in inches, above a foot; `dimension` is room right of shapes.

    A title of many digits has several lines.
    """

    n_panels: int
    n_digits: int
    n_columns: int
    shape_width: float
    shape_height: float
    dimension: float = 0.0
    foot: float = 0.0

    @classmethod
    def of(
        cls, n_panels: int, n_digits: int, window: Window, dimension: float = 0.0
    ) -> "PanelGrid":
        """As many columns as make a page of a good shape with few empty places.

        >>> window = Window(0.0, 60.0, 0.0, 50.0)
        >>> [PanelGrid.of(n, 5, window).n_columns for n in (1, 8, 32, 64)]
        [1, 4, 8, 8]
        """
        aspect = window.size[1] / window.size[0]

        def grid(n_columns: int) -> PanelGrid:
            room = (PAGE[0] - LEFT - RIGHT) / n_columns - BETWEEN - dimension
            highest = min(LARGEST_PANEL, PAGE[1] / ceil(n_panels / n_columns) - TITLE)
            width = min(room, LARGEST_PANEL, highest / aspect)
            return cls(n_panels, n_digits, n_columns, width, width * aspect, dimension)

        return min(map(grid, range(1, n_panels + 1)), key=cls.badness)

    def badness(self) -> float:
        """How far a page is from a good shape, full rows and panels that one can read."""
        if min(self.shape_width, self.shape_height) <= 0.0:  # no room beside what is written
            return inf
        shape = self.n_columns * self.panel_width / (self.n_rows * self.row_height)
        n_empty = self.n_columns * self.n_rows - self.n_panels
        too_small = max(0.0, READABLE / self.shape_width - 1.0)
        is_off = abs(log(shape / BEST_ASPECT))
        return is_off + EMPTY_PLACES * n_empty / self.n_panels + UNREADABLE * too_small

    @property
    def n_rows(self) -> int:
        """Number of rows, the last one perhaps not full."""
        return ceil(self.n_panels / self.n_columns)

    @property
    def panel_width(self) -> float:
        """The width of a panel, its dimension included."""
        return self.shape_width + self.dimension

    @property
    def n_title_lines(self) -> int:
        """In how many lines the digits of a title fit above their panel."""
        return ceil(self.n_digits * DIGIT / self.panel_width)

    @property
    def row_height(self) -> float:
        """The height of a row with the titles above its panels."""
        return self.shape_height + TITLE + (self.n_title_lines - 1) * TITLE_LINE

    @property
    def page(self) -> tuple[float, float]:
        """Width and height of the page."""
        width = LEFT + self.n_columns * (self.panel_width + BETWEEN) - BETWEEN + RIGHT
        return max(NARROWEST, width), self.n_rows * self.row_height + self.foot

    @property
    def left(self) -> float:
        """The left side of the first column."""
        row = self.n_columns * (self.panel_width + BETWEEN) - BETWEEN
        return LEFT + (self.page[0] - LEFT - RIGHT - row) / 2.0

    def box(self, place: int) -> Array:
        """Left, bottom, width and height of a panel, as shares of the page."""
        row, column = divmod(place, self.n_columns)
        width, height = self.page
        left = self.left + column * (self.panel_width + BETWEEN)
        bottom = height - (row + 1) * self.row_height
        box = np.array([left, bottom, self.panel_width, self.shape_height])
        return np.asarray(box / np.array([width, height, width, height]))

    def is_outer(self, place: int) -> tuple[bool, bool]:
        """Whether a panel is the leftmost of its row, the lowest of its column."""
        return place % self.n_columns == 0, place + self.n_columns >= self.n_panels
