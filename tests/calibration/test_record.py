"""What is wrong with a curve: each finding by a case that has it and one that has not."""

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.calibration.record import (
    Record,
    cleaned,
    in_order,
    integral,
    inverted_well,
    lag1_autocorrelation,
    quasi_static,
    record_warnings,
    unsampled,
    work,
)
from dpgcli.errors import FitError
from dpgcli.mechanics import laws

TRAVEL = np.linspace(0.0, 14.0, 141)
VALUES = np.array([44.0, 0.02, 13.5])


def energy(travel: Array) -> Array:
    return laws.bistable(travel, *VALUES).energy


def force(travel: Array) -> Array:
    return laws.bistable(travel, *VALUES).force


def ringing() -> Record:
    """Slow loading to 2 mm, a snap that rings around 13 mm and dies out, a slow release."""
    time = np.concatenate((np.linspace(0.0, 1.0, 50), np.linspace(1.001, 1.1, 400)))
    since = time[50:] - 1.0
    ring = 13.5 + 6.0 * np.exp(-60.0 * since) * np.cos(700.0 * since)
    travel = np.concatenate((np.linspace(0.0, 2.0, 50), ring))
    rest = np.linspace(1.101, 2.0, 40)
    travel = np.concatenate((travel, np.linspace(13.5, 13.2, 40)))
    return Record(travel, energy=energy(travel), time=np.concatenate((time, rest)))


CLEAN = Record(TRAVEL, energy=energy(TRAVEL), force=force(TRAVEL))


def test_a_clean_curve_has_no_dirt() -> None:
    assert list(record_warnings(CLEAN, is_cut=False)) == []
    loading = Record(TRAVEL, energy=energy(TRAVEL), force=force(TRAVEL), time=TRAVEL)
    assert list(record_warnings(loading, is_cut=False)) == []


def test_ringing_is_said_unless_it_is_cut_away() -> None:
    said = list(record_warnings(ringing(), is_cut=False))
    assert said[0].startswith("ringing: the travel reverses 1")
    assert not [
        text for text in record_warnings(ringing(), is_cut=True) if text.startswith("ringing")
    ]


def test_loading_and_unloading_is_not_ringing() -> None:
    there = np.concatenate((TRAVEL, TRAVEL[::-1], TRAVEL, TRAVEL[::-1]))
    cycles = Record(there, energy=energy(there), time=np.arange(float(len(there))))
    assert list(record_warnings(cycles, is_cut=False)) == []
    assert quasi_static(cycles).kept.all()


def test_energies_that_drift_are_said_with_numbers() -> None:
    there = np.concatenate((TRAVEL, TRAVEL[::-1]))
    drifting = energy(there) + np.linspace(0.0, 40.0, len(there))
    said = list(
        record_warnings(Record(there, energy=drifting, time=np.arange(282.0)), is_cut=False)
    )
    assert said[0].startswith("drifting energy: at ")
    assert "anything from" in said[0]


def test_an_energy_that_is_not_the_work_is_said() -> None:
    said = list(
        record_warnings(
            Record(TRAVEL, energy=1.1 * energy(TRAVEL), force=force(TRAVEL)), is_cut=False
        )
    )
    assert [text.partition(":")[0] for text in said] == ["the energy is not the work done"]
    by_volume = Record(
        TRAVEL, energy=1.1 * energy(TRAVEL), pressure=force(TRAVEL) / 50, volume=50 * TRAVEL
    )
    assert list(record_warnings(by_volume, is_cut=False)) == said


def test_an_energy_at_rest_is_said() -> None:
    said = list(record_warnings(Record(TRAVEL, energy=energy(TRAVEL) + 20.0), is_cut=False))
    assert said == ["the energy at rest is 20 mJ, not 0 as the law has it"]


def test_quasi_static_pieces_are_before_the_snap_and_after_the_ringing() -> None:
    record = ringing()
    kept, said = quasi_static(record)
    assert record.time is not None
    assert kept[record.time <= 0.99].all()
    assert not kept[(record.time > 1.002) & (record.time < 1.05)].any()
    assert kept[record.time >= 1.15].all()
    assert f"dropped {int((~kept).sum())} of 490 points" in said


def test_a_long_hold_does_not_make_the_loading_fast() -> None:
    held = ringing()
    assert held.time is not None
    travel = np.append(held.travel, np.full(500, held.travel[-1]))
    time = np.append(held.time, np.linspace(2.001, 50.0, 500))
    kept = quasi_static(Record(travel, time=time)).kept
    assert kept[time < 0.99].all()
    assert not kept[(time > 1.002) & (time < 1.05)].any()


def test_without_time_everything_is_static() -> None:
    kept, said = quasi_static(CLEAN)
    assert kept.all()
    assert said.startswith("no time")


def test_the_work_is_the_energy() -> None:
    fine = np.linspace(0.0, 14.0, 4001)
    assert work(Record(fine, force=force(fine))) == pytest.approx(energy(fine), abs=1e-3)
    by_volume = Record(fine, pressure=force(fine) / 50.0, volume=50.0 * fine)
    assert work(by_volume) == pytest.approx(energy(fine), abs=1e-3)


@pytest.mark.parametrize(
    ("curve", "said"),
    [
        (Record(TRAVEL, energy=energy(TRAVEL)), "no work without force_N"),
        (Record(TRAVEL, pressure=force(TRAVEL)), "no work without force_N"),
        (
            Record(TRAVEL, force=force(TRAVEL)).points((TRAVEL < 2.0) | (TRAVEL > 12.95)),
            "no work across 1.9 to 13 mm",
        ),
        (Record(TRAVEL[40:], force=force(TRAVEL[40:])), "no work across 0 to 4 mm"),
        (Record(TRAVEL[:40:-1], force=TRAVEL[:40:-1], time=TRAVEL[:100]), "no work across 0 to 14"),
        (
            Record(TRAVEL[5:], pressure=force(TRAVEL[5:]), volume=TRAVEL[5:]),
            "no work across 0 to 0.5 mm",
        ),
    ],
)
def test_no_work_without_what_it_needs(curve: Record, said: str) -> None:
    with pytest.raises(FitError, match=said):
        work(curve)


def test_the_integral_of_a_line_is_exact() -> None:
    along = np.array([0.0, 0.5, 2.0, 3.0])
    assert integral(2.0 * along, along) == pytest.approx(along**2)


def test_points_are_put_in_order() -> None:
    shuffled = np.random.default_rng(0).permutation(len(TRAVEL))
    found, said = in_order(CLEAN.points(shuffled))
    assert np.array_equal(found.travel, TRAVEL)
    assert said == ("the points were not in order of travel: sorted",)
    timed = Record(TRAVEL[::-1], energy=energy(TRAVEL[::-1]), time=TRAVEL)
    assert in_order(timed) == (timed, ())
    twice, said = in_order(CLEAN.points(np.repeat(np.arange(141), 2)))
    assert np.array_equal(twice.travel, TRAVEL)
    assert said == ("141 repeated points left out",)


@pytest.mark.parametrize("kept", [TRAVEL >= 0.0, (TRAVEL < 2.0) | (TRAVEL > 13.3), TRAVEL > 12.0])
def test_the_inverted_well_is_where_the_force_is_zero(kept: Array) -> None:
    beta = 1.0 - VALUES[1]
    well = VALUES[2] * (3 * beta + np.sqrt(9 * beta**2 - 8 * beta)) / (4 * beta)
    for curve in (Record(TRAVEL, energy=energy(TRAVEL)), Record(TRAVEL, force=force(TRAVEL))):
        assert inverted_well(curve.points(kept)) == pytest.approx(well, abs=0.02)


@pytest.mark.parametrize("kept", [TRAVEL < 2.0, TRAVEL < 7.0, TRAVEL < 11.0, TRAVEL == 14.0])
def test_no_well_where_there_are_no_points(kept: Array) -> None:
    assert inverted_well(CLEAN.points(kept)) is None


def test_a_law_with_one_well_has_no_inverted_one() -> None:
    assert inverted_well(Record(TRAVEL, energy=TRAVEL**2)) is None


def test_gaps() -> None:
    assert unsampled(TRAVEL) == []
    assert unsampled(TRAVEL[(TRAVEL < 2.05) | (TRAVEL > 12.95)]) == [(2.0, 13.0)]


def test_a_cleaned_curve_rises_and_follows_the_data() -> None:
    travel = np.random.default_rng(0).uniform(0.0, 14.0, 20_000)
    found, energies = cleaned(travel, energy(travel))
    assert 150 < len(found) <= 201
    assert np.diff(found).min() > 0.01
    assert energies == pytest.approx(energy(found), abs=0.1)


def test_points_that_hardly_differ_are_one() -> None:
    """Also where the edge of a cell lies between them."""
    travel = np.append(np.linspace(0.0, 10.0, 11), [5.0 - 1e-9, 5.0 + 1e-9])
    found, energies = cleaned(travel, travel)
    assert found == pytest.approx(np.linspace(0.0, 10.0, 11), abs=1e-8)
    assert energies == pytest.approx(found)


def test_a_small_curve_is_kept_as_it_is() -> None:
    found, energies = cleaned(TRAVEL, energy(TRAVEL))
    assert np.array_equal(found, TRAVEL)
    assert np.array_equal(energies, energy(TRAVEL))


def test_neighbors_alike_and_not() -> None:
    noise = np.random.default_rng(0).normal(size=1000)
    assert abs(lag1_autocorrelation(noise)) < 0.1
    assert lag1_autocorrelation(np.sin(np.linspace(0.0, 6.0, 100))) > 0.95
    assert lag1_autocorrelation(np.zeros(5)) == 0.0
