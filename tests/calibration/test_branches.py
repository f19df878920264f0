"""Loading and unloading: turns of the travel, and what the branches do to values and errors."""

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.calibration.bistable import BistableFit, BistableOptions, fit_bistable, law
from dpgcli.calibration.branches import turns, ways
from dpgcli.calibration.choices import Branches, CurveQuantity, Rule
from dpgcli.calibration.opening import OpeningRule
from dpgcli.calibration.record import Record
from dpgcli.errors import FitError

TRUE = np.array([12.84, 0.043, 3.5])
UP = np.linspace(0.0, 4.2, 200)
BOTH = np.concatenate((UP, UP[::-1]))
EQUAL = OpeningRule(Rule.EQUAL)


def force(travel: Array, size: float = 1.0, seed: int = 0) -> Array:
    noise = np.random.default_rng(seed).normal(0.0, 0.02, len(travel))
    return size * law(travel, TRUE, CurveQuantity.FORCE) + noise


def fitted(record: Record, branches: Branches | None = None, **options: object) -> BistableFit:
    choice = BistableOptions(EQUAL, CurveQuantity.FORCE, branches=branches, **options)  # type: ignore[arg-type]
    return fit_bistable(record, choice)


def hysteretic(share: float) -> Record:
    loads = np.concatenate((force(UP, 1.0 + share), force(UP[::-1], 1.0 - share, 1)))
    return Record(BOTH, force=loads)


def warned(found: BistableFit, start: str) -> list[str]:
    return [text for text in found.warnings if text.startswith(start)]


@pytest.mark.parametrize(
    ("travel", "places"),
    [
        ([0, 1, 2], [0, 2]),
        ([2, 1, 0], [0, 2]),
        ([0, 5, 10, 9.9, 10.1, 20], [0, 5]),
        ([0, 10, 20, 20, 20, 10, 0], [0, 2, 6]),
        ([10, 20, 0, 20], [0, 1, 2, 3]),
        ([10, 0, 20], [0, 1, 2]),
        ([0, 0, 0], [0, 2]),
    ],
)
def test_small_swings_are_no_turns(travel: list[float], places: list[int]) -> None:
    assert turns(np.array(travel, float)) == places


def test_each_point_is_on_one_way() -> None:
    noise = np.random.default_rng(0).normal(0.0, 0.01, 400)
    found = ways(Record(BOTH + noise))
    assert found is not None
    assert not (found.loading & found.unloading).any()
    assert (found.loading | found.unloading).all()
    assert found.loading[:195].all()
    assert found.unloading[205:].all()


def test_points_in_no_order_have_no_ways() -> None:
    shuffled = np.random.default_rng(0).permutation(UP)
    assert ways(Record(shuffled)) is None
    found = fitted(Record(shuffled, force=force(shuffled)))
    assert warned(found, "the points were not in order of travel: sorted")
    with pytest.raises(FitError, match="branches loading: the points are in no order"):
        fitted(Record(shuffled, force=force(shuffled)), Branches.LOADING)


def test_the_covariance_is_that_of_two_equally_likely_values() -> None:
    found, loading, unloading = (
        fitted(hysteretic(0.06), branch) for branch in (None, Branches.LOADING, Branches.UNLOADING)
    )
    alike = fitted(hysteretic(0.0))
    half = 0.5 * (loading.fit.values - unloading.fit.values)
    added = found.fit.covariance - np.outer(half, half)
    errors = np.sqrt(np.diag(added))
    assert (errors < 0.5 * np.abs(half[0])).all()
    assert np.all(np.linalg.eigvalsh(added) >= -1e-12)
    assert found.fit.standard_errors == pytest.approx(np.sqrt(np.diag(found.fit.covariance)))
    assert half[0] == pytest.approx(0.06 * TRUE[0], rel=0.02)
    assert not warned(alike, "hysteresis"), "noise alone is none"
    assert alike.fit.standard_errors[0] < 0.01 * TRUE[0]


def test_intervals_reach_to_both_branches() -> None:
    found = fitted(hysteretic(0.06), resamples=20)
    assert found.fit.intervals is not None
    low, high = found.fit.intervals[0]
    assert low < 0.945 * TRUE[0]
    assert high > 1.055 * TRUE[0]


def test_held_values_have_no_hysteresis() -> None:
    found = fitted(hysteretic(0.06), fixed={"stroke_mm": 3.5, "force_linearity": 0.043})
    assert np.isnan(found.fit.standard_errors[1:]).all()
    assert found.fit.covariance[1:, 1:].tolist() == [[0, 0], [0, 0]]
    (said,) = warned(found, "hysteresis")
    assert "stroke_mm" not in said


def test_a_short_way_back_is_said_and_fitted_along() -> None:
    travel = np.concatenate((UP, UP[::-1][:40]))
    found = fitted(Record(travel, force=force(travel)))
    (said,) = warned(found, "40 points of unloading, from 3.377 to 4.2 mm")
    assert "branches loading or unloading" in said


def test_the_order_of_time_counts_where_there_is_one() -> None:
    order = np.random.default_rng(0).permutation(400)
    record = hysteretic(0.06)
    assert record.force is not None
    shuffled = Record(BOTH[order], force=record.force[order], time=np.arange(400.0)[order])
    found = fitted(shuffled, Branches.LOADING)
    assert found.fit.values[0] == pytest.approx(1.06 * TRUE[0], rel=5e-3)
    assert warned(fitted(shuffled), "hysteresis")


def test_branches_apart_by_more_than_a_factor_are_asked_about() -> None:
    near, far = hysteretic(0.3), hysteretic(0.4)
    assert warned(fitted(near), "hysteresis"), "1.3/0.7 is below two"
    with pytest.raises(FitError, match=r"are two curves: bistable_stiffness_N_per_mm 17.* and 7.7"):
        fitted(far)
    assert warned(fitted(far, Branches.BOTH), "hysteresis")


def test_slow_pieces_have_their_hysteresis_as_well() -> None:
    record = hysteretic(0.06)
    slow = Record(BOTH, force=record.force, time=np.linspace(0.0, 40.0, len(BOTH)))
    found = fitted(slow, Branches.QUASI_STATIC)
    assert warned(found, "hysteresis")
    assert found.fit.standard_errors[0] == pytest.approx(0.06 * TRUE[0], rel=0.05)
