"""Thresholds of scattered fingers: those of units alone between rigid bars, and statistics."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.actuation import transition_scatter
from dpgcli.actuation.alone import thresholds_alone
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.transition_scatter import SPREAD_COLUMNS, spread_rows
from dpgcli.actuation.transitions import state_graph
from dpgcli.mechanics.finger import Finger

pytestmark = pytest.mark.slow

Study = Callable[..., Finger]
Made = Callable[..., Pressed]
STROKES = np.array([[3.5], [3.5], [4.2]])
LINES = np.array([0, 0, 1])
N = 40


@pytest.fixture
def draws(study: Study, pressed: Made) -> Pressed:
    random = np.random.default_rng(3)
    return pressed(study(3, np.inf).changed(stroke=STROKES * random.normal(1.0, 0.05, (3, N))))


def test_statistics_are_those_of_the_units_that_leave_first(
    study: Study, pressed: Made, draws: Pressed
) -> None:
    """The draws are some of more: those that are no fingers leave nothing."""
    graph = state_graph(pressed(study(3, np.inf).changed(stroke=STROKES)), LINES)
    rows, n_draws = graph.transitions, N + 10
    places = np.arange(N) + 3
    found = spread_rows([(places, draws)], LINES, graph.reach, rows, n_draws)
    assert [*found] == [column.name for column in SPREAD_COLUMNS]
    assert (found["share_without_state"] == 10 / n_draws).all()
    assert (found["share_unknown"] == 0.0).all()
    alone = thresholds_alone(draws)
    for k in range(len(rows.code)):
        state = np.array([digit == "1" for digit in f"{int(rows.code[k]):03b}"])
        up = rows.sign[k] > 0
        free = np.flatnonzero((state != up) & (rows.line[k] == LINES))
        if not len(free):
            assert found["share_leaving"][k] == 0.0
            assert np.isnan(found["pressure_mean_MPa"][k])
            continue
        thresholds = (alone.snap if up else alone.reset)[free]
        first = thresholds[np.abs(thresholds).argmin(axis=0), np.arange(N)]
        unit = free[np.abs(thresholds).argmin(axis=0)]
        tied = {int(rows.unit[k])} | {i for i in range(3) if int(rows.tied[k]) >> (2 - i) & 1}
        assert found["share_leaving"][k] == N / n_draws
        assert found["share_same_unit"][k] == np.isin(unit, [*tied]).sum() / n_draws
        assert found["pressure_mean_MPa"][k] == pytest.approx(first.mean(), rel=1e-9)
        assert found["pressure_deviation_MPa"][k] == pytest.approx(first.std(ddof=1), rel=1e-7)
        ends = np.percentile(first, [2.5, 97.5])
        assert found["pressure_low_MPa"][k] == pytest.approx(ends[0], rel=1e-9)
        assert found["pressure_high_MPa"][k] == pytest.approx(ends[1], rel=1e-9)


def test_another_unit_may_leave_first(study: Study, pressed: Made) -> None:
    """On one line 3.5 and 3.6 mm, 5 % apart in half of the draws: sometimes the second does."""
    strokes, line = np.array([[3.5], [3.6]]), np.zeros(2, np.int64)
    random = np.random.default_rng(4)
    own = pressed(study(2, np.inf).changed(stroke=strokes * random.normal(1.0, 0.03, (2, N))))
    graph = state_graph(pressed(study(2, np.inf).changed(stroke=strokes)), line)
    found = spread_rows([(np.arange(N), own)], line, graph.reach, graph.transitions, N)
    assert 0.5 < found["share_same_unit"][0] < 0.95


def test_chunks_change_no_bit(
    study: Study, pressed: Made, draws: Pressed, monkeypatch: pytest.MonkeyPatch
) -> None:
    graph = state_graph(pressed(study(3, np.inf).changed(stroke=STROKES)), LINES)
    every = [(np.arange(N), draws)]
    whole = spread_rows(every, LINES, graph.reach, graph.transitions, N)
    monkeypatch.setattr(transition_scatter, "lanes_at_once", lambda n_units: 31)
    parts = spread_rows(every, LINES, graph.reach, graph.transitions, N)
    for name, values in whole.items():
        assert np.array_equal(values, parts[name], equal_nan=True)


def test_one_draw_has_no_deviation(study: Study, pressed: Made) -> None:
    own = pressed(study(1, np.inf))
    line = np.zeros(1, np.int64)
    graph = state_graph(own, line)
    found = spread_rows([(np.array([0]), own)], line, graph.reach, graph.transitions, 1)
    assert np.isnan(found["pressure_deviation_MPa"]).all()
    assert found["pressure_mean_MPa"][0] == found["pressure_low_MPa"][0]
    assert found["pressure_mean_MPa"][0] == graph.transitions.pressure[0]
