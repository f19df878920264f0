"""The pressure at which a dome snapped: of static paths, jumps, cycles and dynamic records."""

from pathlib import Path

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.calibration.record import Record
from dpgcli.calibration.snap import snap_pressure
from dpgcli.files.measured import read_curve

FOLDER = Path(__file__).parents[2] / "configs" / "calibration"
TRAVEL = np.linspace(0.0, 15.0, 151)


def load(travel: Array) -> Array:
    """A pressure with its limit point, 0.15 MPa, at 2 mm, and wells at 0 and 13 mm."""
    shape = travel * (travel - 13.0) * (travel - 7.0)
    return np.asarray(0.15 * shape / 110.0)


PRESSURE = load(TRAVEL)
LARGEST = float(PRESSURE[TRAVEL < 7.0].max())


def test_a_whole_path_has_its_limit_point() -> None:
    assert PRESSURE[-1] > 1.2 * LARGEST, "an inverted dome bears more"
    assert snap_pressure(Record(TRAVEL, pressure=PRESSURE)) == LARGEST


def test_points_in_any_order() -> None:
    order = np.random.default_rng(3).permutation(len(TRAVEL))
    assert snap_pressure(Record(TRAVEL[order], pressure=PRESSURE[order])) == LARGEST


@pytest.mark.parametrize("last", [1.0, 2.0])
def test_a_jump_is_a_snap(last: float) -> None:
    kept = (last >= TRAVEL) | (TRAVEL > 13.0)
    found = snap_pressure(Record(TRAVEL[kept], pressure=PRESSURE[kept]))
    assert found == pytest.approx(load(np.array(last)))


def test_a_dome_that_only_bears_more_has_not_snapped() -> None:
    kept = TRAVEL < 1.5
    assert snap_pressure(Record(TRAVEL[kept], pressure=PRESSURE[kept])) is None


def test_a_dome_that_is_let_go_before_it_snaps() -> None:
    there = TRAVEL[TRAVEL < 1.5]
    travel = np.concatenate((there, there[::-1]))
    assert snap_pressure(Record(travel, pressure=load(travel))) is None


def test_a_path_that_ends_behind_its_limit_point() -> None:
    kept = TRAVEL < 5.0
    assert snap_pressure(Record(TRAVEL[kept], pressure=PRESSURE[kept])) == LARGEST


def test_a_cycle_has_that_of_its_way_there() -> None:
    there, back = TRAVEL[TRAVEL <= 2.0], TRAVEL[TRAVEL >= 13.0]
    travel = np.concatenate((there, back, back[::-1], there[::-1]))
    found = snap_pressure(Record(travel, pressure=load(travel)))
    assert found == pytest.approx(load(np.array(2.0)))


def test_what_begins_inverted_has_not_snapped() -> None:
    kept = TRAVEL > 10.0
    assert snap_pressure(Record(TRAVEL[kept], pressure=PRESSURE[kept])) is None
    assert snap_pressure(Record(TRAVEL[::-1], pressure=PRESSURE[::-1])) is None


def test_a_fast_piece_is_a_snap() -> None:
    """The pressure goes on rising while the dome snaps, and after."""
    there, back = np.linspace(0.0, 2.0, 60), np.linspace(13.6, 14.0, 60)
    fast = np.linspace(2.0, 13.6, 30)[1:-1]
    travel = np.concatenate((there, fast, back))
    time = np.concatenate(
        (np.linspace(0, 1, 60), np.linspace(1.0, 1.01, 30)[1:-1], 1.01 + 0.0 * back)
    )
    time[-60:] += np.linspace(0.0, 1.0, 60)
    assert snap_pressure(Record(travel, pressure=0.15 * time, time=time)) == pytest.approx(0.15)


def test_no_pressure() -> None:
    assert snap_pressure(Record(TRAVEL, force=PRESSURE)) is None
    assert snap_pressure(Record(TRAVEL, pressure=0.0 * PRESSURE)) is None
    assert snap_pressure(Record(TRAVEL, pressure=-PRESSURE - 1.0)) is None


@pytest.mark.parametrize(
    ("name", "pressure"),
    [("dome_path_h6.5_t0.75.csv", 0.149508565), ("dome_dynamic_h6.5_t0.75.csv", 0.151)],
)
def test_the_domes_of_the_examples(name: str, pressure: float) -> None:
    """The dynamic one snaps at 0.151 MPa, as its header says; its fast piece begins before."""
    found = snap_pressure(read_curve(FOLDER / name).curve)
    assert found == pytest.approx(pressure, rel=1e-9 if "path" in name else 0.012)
