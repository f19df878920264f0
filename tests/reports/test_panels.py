"""Pages of panels: everything on the page, nothing on anything else, big enough to see."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from dpgcli.reports.labels import spread
from dpgcli.reports.panels import DIMENSION, PAGE, PanelGrid, Window

ASPECTS = some.floats(1.0 / 6.0, 6.0)


@given(some.integers(1, 64), some.integers(1, 64), ASPECTS, some.sampled_from([0.0, DIMENSION]))
def test_panels_lie_on_the_page_side_by_side(
    n_panels: int, n_digits: int, aspect: float, dimension: float
) -> None:
    grid = PanelGrid.of(n_panels, n_digits, Window(0.0, 60.0, 0.0, 60.0 * aspect), dimension)
    assert grid.page[0] <= PAGE[0] + 1e-9
    boxes = np.array([grid.box(place) for place in range(n_panels)])
    low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
    assert (low >= -1e-9).all() and (high <= 1.0 + 1e-9).all()
    apart = (low[:, None] >= high - 1e-9) | (low >= high[:, None] - 1e-9)
    assert (apart.any(axis=2) | np.eye(n_panels, dtype=bool)).all()


@given(some.integers(1, 64), ASPECTS, some.sampled_from([0.0, DIMENSION]))
def test_shapes_are_drawn_at_one_scale_in_both_directions(
    n_panels: int, aspect: float, dimension: float
) -> None:
    window = Window(-5.0, 55.0, -30.0, 60.0 * aspect - 30.0)
    grid = PanelGrid.of(n_panels, 5, window, dimension)
    assert grid.shape_width / grid.shape_height == pytest.approx(1.0 / aspect)
    assert grid.shape_width > 0.15


def test_titles_of_several_lines_have_room_above_their_panels() -> None:
    grid = PanelGrid.of(64, 64, Window(0.0, 600.0, 0.0, 100.0))
    assert grid.n_title_lines > 2
    above = grid.box(0)[1] - (grid.box(grid.n_columns)[1] + grid.box(grid.n_columns)[3])
    assert above * grid.page[1] > 0.11 * grid.n_title_lines


def test_outer_panels_are_those_without_a_neighbor() -> None:
    grid = PanelGrid(n_panels=5, n_digits=3, n_columns=3, shape_width=1.0, shape_height=1.0)
    assert [grid.is_outer(place) for place in range(5)] == [
        (True, False),
        (False, False),
        (False, True),
        (True, True),
        (False, True),
    ]


@pytest.mark.parametrize(
    ("size", "unit"), [(2e-5, "nm"), (0.04, "µm"), (40.0, "mm"), (900.0, "mm"), (4e4, "m")]
)
def test_numbers_on_axes_are_short(size: float, unit: str) -> None:
    assert Window(0.0, size, 0.0, size).unit == unit


def test_a_flat_finger_has_a_window_that_is_not() -> None:
    window = Window.of(np.array([0.0, 120.0 + 1.0j]))
    width, height = window.size
    assert height > width / 7.0
    assert (window.bottom + window.top) / 2.0 == pytest.approx(0.5)


@given(some.lists(some.floats(-100.0, 100.0), min_size=1, max_size=64))
def test_labels_are_moved_apart_no_more_than_needed(heights: list[float]) -> None:
    before = np.sort(heights)
    after = spread(before, 0.5)
    assert (np.diff(after) >= 0.5 - 1e-9).all()
    assert after.mean() == pytest.approx(before.mean(), abs=1e-9)
    if (np.diff(before) >= 0.5).all():
        np.testing.assert_allclose(after, before, atol=1e-9)
