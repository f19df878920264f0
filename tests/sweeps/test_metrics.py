"""Metrics of designs: hulls, distinct tips and extremes, whatever the scale and the blocks."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest

from dpgcli.arrays import Array, Columns
from dpgcli.design.scene import Scene
from dpgcli.mechanics.finger import Finger
from dpgcli.states.accuracy import Exactness
from dpgcli.states.certify import Status
from dpgcli.states.columns import Group
from dpgcli.states.quantities import declared
from dpgcli.states.units import UnitSolutions
from dpgcli.sweeps.designs import Block, design_states
from dpgcli.sweeps.metrics import Metrics
from dpgcli.sweeps.tips import CELL_BITS, MOST_OWNERS, TIPS_PER_LENGTH, DistinctTips

Fingers = Callable[..., Finger]
QUANTITIES = tuple(q for q in declared(1, (), False) if q.group in {Group.STATES, Group.STIFFNESS})


def all_states(finger: Finger) -> Iterator[Block]:
    return design_states(Scene(finger, ()), Exactness(UnitSolutions.of(finger), 1e-12), QUANTITIES)


LENGTH = 27.0  # mm, of the reference finger of two units


@pytest.fixture
def metrics(reference_finger: Fingers) -> Callable[..., Columns]:
    """Metrics of one design by the tips in each block, in mm."""

    def of(*blocks: Sequence[tuple[float, float]], status: Sequence[int] = ()) -> Columns:
        found = Metrics(UnitSolutions.of(reference_finger(2)), 1)
        for tips in blocks:
            x, y = np.array(tips, float).reshape(-1, 2).T
            same = {"tip_stiffness_min_N_per_mm": x, "tip_stiffness_max_N_per_mm": x}
            same |= {"residual_N": x, "numerical_error_mm": x, "tip_x_mm": x, "tip_y_mm": y}
            stable = np.array(status or [Status.STABLE] * len(x), np.uint8)
            found.add({**same, "status": stable})
        return found.columns()

    return of


def in_other_units(finger: Finger, length: float, force: float) -> Finger:
    """The same finger where the units of length and force are that many times smaller."""
    factors = {
        "bistable_stiffness": force / length,
        "linear_stiffness": force / length,
        "hinge_stiffness": force * length,
        "force_linearity": 1.0,
    }
    return Finger(
        finger.n_units, **{n: v * factors.get(n, length) for n, v in finger.arrays().items()}
    )


@pytest.mark.parametrize("length", [1e-6, 1e-3, 1e3])
def test_metrics_scale_with_the_finger(graded_finger: Fingers, length: float) -> None:
    """In micrometers as in meters: the area is never lost, and as many tips differ."""
    finger, force = graded_finger(5, 3), length**2
    scaled = in_other_units(finger, length, force)
    (one,), (other,) = (list(all_states(f)) for f in (finger, scaled))
    assert one.metrics is not None and other.metrics is not None
    powers = {"mm2": length**2, "mm": length, "N": force, "mJ": force * length}
    powers["N_per_mm"] = force / length
    compared = 0
    for name, values in one.metrics.items():
        if "residual" in name or "error" in name:
            continue
        suffix = next((s for s in ("N_per_mm", "mm2", "mm", "mJ") if name.endswith(s)), "")
        expected = values * powers.get(suffix, 1)
        np.testing.assert_allclose(other.metrics[name], expected, rtol=1e-9, err_msg=name)
        compared += 1
    assert compared == 11
    assert one.metrics["workspace_area_mm2"] > 1.0
    assert one.metrics["n_distinct_tips"] == 32


SQUARE = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (1.0, 1.0), (1.0, 0.0)]


def test_the_hull_of_blocks_is_the_hull_of_all(metrics: Callable[..., Columns]) -> None:
    assert metrics(SQUARE)["workspace_area_mm2"].tolist() == [4.0]
    for cut in range(1, 6):
        assert metrics(SQUARE[:cut], SQUARE[cut:])["workspace_area_mm2"].tolist() == [4.0]
    assert metrics(*([tip] for tip in SQUARE))["workspace_area_mm2"].tolist() == [4.0]


@pytest.mark.parametrize(
    "tips",
    [
        [(1.0, 2.0)],
        [(1.0, 2.0)] * 4,
        [(0.0, 0.0), (3.0, 1.0)],
        [(0.0, 0.0), (1.0, 3.0), (2.0, 6.0)],
        [(0.1 * k, 0.3 * k) for k in range(20)],  # in a line but for rounding
        [(LENGTH, 0.0), (LENGTH + 2e-15, 1e-3), (LENGTH, 2e-3)],
    ],
)
def test_tips_in_a_line_span_nothing(
    metrics: Callable[..., Columns], tips: list[tuple[float, float]]
) -> None:
    assert metrics(tips)["workspace_area_mm2"].tolist() == [0.0]


def test_a_sliver_is_an_area(metrics: Callable[..., Columns]) -> None:
    sliver = [(LENGTH, 0.0), (LENGTH + 1e-10, 1.0), (LENGTH, 2.0)]
    assert metrics(sliver)["workspace_area_mm2"] == pytest.approx(1e-10, rel=1e-4)


def test_states_that_are_not_stable_do_not_count(metrics: Callable[..., Columns]) -> None:
    status = [Status.STABLE] * 4 + [Status.MARGINAL, Status.NOT_BISTABLE]
    far = metrics([*SQUARE[:4], (9.0, 9.0), (np.nan, np.nan)], status=status)
    assert far["workspace_area_mm2"].tolist() == [4.0]
    assert (far["n_stable"].tolist(), far["n_distinct_tips"].tolist()) == ([4], [4])
    assert far["reach_max_mm"] == pytest.approx(np.sqrt(8.0))
    none = metrics(SQUARE, status=[Status.FOLDED] * 6)
    assert (none["n_stable"].tolist(), none["n_distinct_tips"].tolist()) == ([0], [0])
    assert none["workspace_area_mm2"].tolist() == [0.0]
    assert np.isnan([none[name][0] for name in ("reach_min_mm", "max_numerical_error_mm")]).all()


def test_extremes_are_those_of_all_blocks(metrics: Callable[..., Columns]) -> None:
    found = metrics([(3.0, 4.0), (6.0, 8.0)], [(1.0, 0.0)], [(5.0, 12.0)])
    assert (found["reach_min_mm"].tolist(), found["reach_max_mm"].tolist()) == ([1.0], [13.0])
    names = ("stiffness_min_N_per_mm", "stiffness_max_N_per_mm", "max_residual_N")
    assert [found[name].tolist() for name in names] == [[1.0], [6.0], [6.0]]


def test_tips_are_told_apart_by_a_ten_thousandth_of_the_length(
    metrics: Callable[..., Columns],
) -> None:
    step = LENGTH / TIPS_PER_LENGTH

    def count(*blocks: list[tuple[float, float]]) -> int:
        return int(metrics(*blocks)["n_distinct_tips"][0])

    steps = [(k * step, -3 * k * step) for k in range(-5, 6)]
    assert count(steps) == count(steps[:4], steps[2:]) == 11
    assert count([(0.4 * step, 0.0), (-0.4 * step, 0.0), (0.0, 0.4 * step)]) == 1
    assert count([(0.0, 0.6 * step)], [(0.0, 0.0)], [(0.0, 1.4 * step)]) == 2


def test_no_grid_is_too_large_for_its_cells(metrics: Callable[..., Columns]) -> None:
    """Cells of one design never run into those of another coordinate."""
    far = LENGTH / TIPS_PER_LENGTH * 2.0**CELL_BITS
    tips = [(sx * f, sy * f) for f in (far, 5 * far) for sx in (-1, 0, 1) for sy in (-1, 0, 1)]
    assert metrics(tips)["n_distinct_tips"].tolist() == [9]


def test_designs_of_one_batch_do_not_mix(graded_finger: Fingers) -> None:
    fingers = [graded_finger(3, seed) for seed in range(7)]
    parts = [finger.arrays() for finger in fingers]
    arrays = {name: np.concatenate([p[name] for p in parts], axis=1) for name in parts[0]}
    (together,) = all_states(Finger(3, **arrays))
    assert together.metrics is not None
    areas: list[Array] = []
    for place, finger in enumerate(fingers):
        (alone,) = all_states(finger)
        assert alone.metrics is not None
        for name, values in alone.metrics.items():
            assert together.metrics[name][place] == values[0], name
        areas.append(alone.metrics["workspace_area_mm2"])
    assert len(np.unique(areas)) == 7


def test_tips_of_many_designs_are_counted_apart() -> None:
    """Two for each, whatever its number: blocks of short fingers have tens of thousands."""
    n_designs = 100_000
    owner = np.repeat(np.arange(n_designs), 3)
    tips = np.tile([[5000.0, -3.0], [5000.0, -3.0], [-2.0, 4.0]], (n_designs, 1))
    distinct_tips = DistinctTips()
    distinct_tips.add(owner, tips)
    assert (distinct_tips.counts(n_designs) == 2).all()
    with pytest.raises(AssertionError, match="fewer designs"):
        distinct_tips.add(np.array([MOST_OWNERS]), tips[:1])
