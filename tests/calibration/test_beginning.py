"""How a curve leaves rest: what is not zero there is said, what is reversed is refused."""

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.calibration.beginning import beginning_warnings, check_sign
from dpgcli.calibration.bistable import law
from dpgcli.calibration.choices import CurveQuantity
from dpgcli.calibration.record import Record
from dpgcli.errors import FitError

TRUE = np.array([12.84, 0.043, 3.5])
TRAVEL = np.linspace(0.0, 4.2, 300)


def force(travel: Array, noise: float = 0.05) -> Array:
    exact = law(np.maximum(travel, 0.0), TRUE, CurveQuantity.FORCE)
    return exact + np.random.default_rng(0).normal(0.0, noise, len(travel))


def said(travel: Array, load: Array) -> list[str]:
    return list(beginning_warnings(Record(travel, force=load)))


@pytest.mark.parametrize("largest", [2.0, 4.2, 9.0])
@pytest.mark.parametrize("n_points", [12, 85, 3000])
@pytest.mark.parametrize("noise", [0.0, 0.1, 0.3])
def test_a_law_leaves_rest_as_it_should(largest: float, n_points: int, noise: float) -> None:
    travel = np.linspace(0.0, largest, n_points)
    load = force(travel, noise)
    assert said(travel, load) == []
    check_sign(Record(travel, force=load))


@pytest.mark.parametrize("offset", [1.0, -1.0])
def test_a_load_cell_that_was_not_set_to_zero(offset: float) -> None:
    (text,) = said(TRAVEL, force(TRAVEL) + offset)
    assert text.startswith("the force at rest is ")
    assert float(text.split()[5]) == pytest.approx(offset, abs=0.05)


def test_a_record_that_begins_under_load() -> None:
    later = TRAVEL[5:]
    (text,) = said(later - later[0], force(TRAVEL)[5:])
    assert text.startswith("the force at rest is 0.8")


@pytest.mark.parametrize("slack", [0.2, 0.5, 1.0])
def test_travel_before_the_dome_is_touched(slack: float) -> None:
    (text,) = said(TRAVEL, force(TRAVEL - slack))
    assert text.startswith("the force begins to rise at a travel of ")
    assert float(text.split()[9]) == pytest.approx(slack, abs=0.02)


def test_a_travel_that_is_a_position() -> None:
    (text,) = said(TRAVEL + 55.3, force(TRAVEL))
    assert text.startswith("the travel begins at 55.3 mm, with hardly a force")


def test_a_part_of_a_curve_is_no_position() -> None:
    travel = np.linspace(2.8, 4.2, 40)
    assert said(travel, force(travel)) == []


@pytest.mark.parametrize("largest", [2.0, 4.2, 9.0])
@pytest.mark.parametrize("order", [1, -1])
def test_a_force_that_pulls_is_reversed(largest: float, order: int) -> None:
    travel = np.linspace(0.0, largest, 100)[::order]
    with pytest.raises(FitError, match="the force is negative where the dome leaves its rest"):
        check_sign(Record(travel, force=-force(travel)))


def test_a_pressure_is_looked_at_as_a_force_is() -> None:
    record = Record(TRAVEL, pressure=-force(TRAVEL) / 260.0)
    with pytest.raises(FitError, match=r"pressure is negative .* pressure_MPa=-TITLE"):
        check_sign(record)
