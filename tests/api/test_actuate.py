"""`actuate`: the study's graded finger, laws, lines and grippers; what is kept and what is said."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import dpgcli as dpg
from dpgcli.api.actuate import ActuateResult
from dpgcli.errors import ActuationError, OutputError, SpecError, UsageError

CONFIGS = Path(__file__).parents[2] / "configs"
GRADED = CONFIGS / "graded_five_unit.yaml"
FITTED = {"finger.calibration": "finite_elements", "finger.law": "push_only"}
COLUMNS = [
    *("event", "line", "pressure_MPa", "unit", "kind", "pattern_before", "pattern_after"),
    *("energy_released_mJ", "tip_x_mm", "tip_y_mm", "tip_angle_rad", "tie"),
]


@pytest.fixture(scope="module")
def graded() -> ActuateResult:
    """One line on the study's graded finger, up, back and beyond."""
    return dpg.actuate(GRADED, pressure="0:0.16:0.2:0:-0.1:0")


def test_the_graded_finger_goes_through_its_intermediate_state(graded: ActuateResult) -> None:
    events = graded.table
    assert list(events.names) == COLUMNS
    assert events["pattern_before"].tolist() == ["00000", "11100", "11111", "00011"]
    assert events["pattern_after"].tolist() == ["11100", "11111", "00011", "00000"]
    assert events["unit"].tolist() == ["1,2,3", "4,5", "1,2,3", "4,5"]
    assert events["tie"].tolist() == ["2,3", "5", "2,3", "5"]
    assert events["kind"].tolist() == ["snap", "snap", "reset", "reset"]
    assert events["event"].tolist() == [1, 2, 3, 4]
    assert set(events["line"]) == {"A"}
    assert events["pressure_MPa"][0] == pytest.approx(0.1495, rel=1e-4)
    assert events["pressure_MPa"][2] == pytest.approx(-0.06499, rel=1e-3)
    assert graded.pattern == "00000"


@pytest.mark.parametrize(("factor", "is_told"), [(99.0, False), (101.0, True), (-101.0, True)])
def test_pressures_hundreds_of_times_beyond_thresholds_may_be_kilopascals(
    factor: float, *, is_told: bool
) -> None:
    """Of the largest threshold of any unit by itself, here the snap pressure: 0.1495 MPa."""
    found = dpg.actuate(CONFIGS / "three_unit.yaml", pressure=[0.0, 0.1495 * factor, 0.0])
    said = [line for line in found.summary if "kPa" in line]
    assert len(said) == is_told
    if is_told:
        assert said[0].startswith("warning: pressures go to 101 times the largest threshold")


def test_a_hold_between_the_two_is_the_study_s_state(graded: ActuateResult) -> None:
    """Held at 0.16 MPa the finger has three inverted units, and keeps them without pressure."""
    found = dpg.actuate(GRADED, pressure="0:0.16:0")
    state = dpg.predict(GRADED, patterns="11100").table
    assert found.pattern == "11100"
    assert found.path["tip_x_mm"][-1] == pytest.approx(state["tip_x_mm"][0], abs=1e-9)
    assert found.path["tip_y_mm"][-1] == pytest.approx(state["tip_y_mm"][0], abs=1e-9)
    assert found.path["energy_mJ"][-1] == pytest.approx(state["energy_mJ"][0], rel=1e-9)
    pattern = graded.path["pattern"][graded.path["history_step"] == 2][-1]
    assert pattern == "11100"


def test_a_dome_s_own_curve_snaps_at_its_own_pressure() -> None:
    """0.1495 MPa at h = 6.5 mm and 0.176 at 7.5 (`data/dome_grid.csv`), to 1 %."""
    found = dpg.actuate(GRADED, pressure="0:0.16:0.2:0", settings=FITTED).table
    assert found["pattern_after"].tolist() == ["11100", "11111"]
    np.testing.assert_allclose(found["pressure_MPa"], [0.1495, 0.176], rtol=0.01)
    assert found["unit"].tolist() == ["1,2,3", "4,5"]


def test_pressure_goes_on_from_any_state() -> None:
    found = dpg.actuate(GRADED, pressure="0:-0.07:0", start="11111")
    assert found.table["pattern_after"].tolist() == ["00011"]
    assert found.pattern == "00011"


def test_lines_step_together() -> None:
    settings = {"pressure.lines": {"left": "1-3", "right": [4, 5]}}
    found = dpg.actuate(GRADED, pressure=["left=0:0.16:0:0", "right=0:0:0.2:0"], settings=settings)
    assert found.table["line"].tolist() == ["left", "right"]
    assert found.table["unit"].tolist() == ["1,2,3", "4,5"]
    first = found.path["event"] == 2
    assert found.path["pressure_right_MPa"][first][0] == found.table["pressure_MPa"][1]
    share = found.table["pressure_MPa"][1] / 0.2
    assert found.path["pressure_left_MPa"][first][0] == pytest.approx(0.16 * (1.0 - share))


def test_a_gripper_has_its_aperture() -> None:
    found = dpg.actuate(CONFIGS / "gripper.yaml", pressure="0:0.16:0")
    assert list(found.table.names) == [*COLUMNS[:-1], "aperture_mm", "tie"]
    state = dpg.predict(CONFIGS / "gripper.yaml", patterns="11111").table
    assert found.path["aperture_mm"][-1] == pytest.approx(state["aperture_mm"][0], abs=1e-8)
    assert found.path["fingers_overlap"][-1]
    assert any("the fingers overlap" in line for line in found.summary)


def test_times_are_those_of_the_history() -> None:
    found = dpg.actuate(GRADED, pressure={"time": [10, 20, 21], "A": [0, 0.16, 0]}, cycles=2)
    path = found.path
    rising = (path["history_step"] == 2) & (path["cycle"] == 1)
    np.testing.assert_allclose(
        path["time_s"][rising], 10.0 + path["pressure_A_MPa"][rising] / 0.016, rtol=1e-12
    )
    assert path["time_s"][path["cycle"] == 2][0] == 10.0
    assert path["time_s"][-1] == 21.0


def test_both_sides_of_events_are_points_of_the_path(graded: ActuateResult) -> None:
    path, events = graded.path, graded.table
    for number in events["event"]:
        before, after = np.flatnonzero(path["event"] == number)
        row = number - 1
        assert after == before + 1
        assert path["pattern"][before] == events["pattern_before"][row]
        assert path["pattern"][after] == events["pattern_after"][row]
        assert path["tip_y_mm"][after] == events["tip_y_mm"][row]
        fall = path["potential_energy_mJ"][before] - path["potential_energy_mJ"][after]
        assert fall == pytest.approx(events["energy_released_mJ"][row], abs=1e-9)
    np.testing.assert_allclose(path["travel_1_mm"], path["opening_1_mm"])  # of this law
    assert np.abs(path["smallest_pivot"][path["event"] > 0][::2]).max() < 1e-4  # folds
    assert path["residual_N"].max() < 1e-8


def test_a_dome_alone_travels_without_its_unit() -> None:
    path = dpg.actuate(GRADED, pressure="0:0.14", settings=FITTED).path
    assert path["opening_1_mm"].tolist() == pytest.approx([0.0] * len(path), abs=1e-9)
    assert path["travel_1_mm"][-1] > 1.0


def test_cycles_close_to_a_billionth_of_a_millimeter(graded: ActuateResult) -> None:
    found = dpg.actuate(GRADED, pressure="0:0.16:0.2:0:-0.1:0", cycles=100)
    assert len(found.table) == 100 * len(graded.table)
    assert found.drift.patterns == ("00000",)
    assert found.drift.tip <= found.drift.nodes < 1e-9
    assert any(line.startswith("100 cycles end in 00000: drift ") for line in found.summary)
    assert not any("cycles" in line for line in graded.summary)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pressure", "cycles", "found"),
    [
        ("0:0.1:0.2:0:0", 50_000, "1,250,000 pressures, of 5 steps of 5 units, cycles 50,000"),
        (np.zeros(200_001), 1, "1,000,005 pressures, of 200,001 steps of 5 units, cycles 1"),
    ],
)
def test_a_path_that_memory_may_not_hold_is_refused_before_the_work(
    pressure: Any, cycles: int, found: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dpgcli.api.actuate.travel", lambda *_: pytest.fail("worked"))
    said = f"{found}: expected at most 1,000,000, as the path is held in memory"
    with pytest.raises(dpg.UsageError, match=f"^{said}$"):
        dpg.actuate(GRADED, pressure=pressure, cycles=cycles)


def test_the_largest_path_is_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    """200,000 pressures of five units, whatever follows them."""
    monkeypatch.setattr("dpgcli.api.actuate.travel", lambda *_: pytest.fail("worked"))
    with pytest.raises(pytest.fail.Exception, match="worked"):
        dpg.actuate(GRADED, pressure="0:0.1:0.2:0", cycles=50_000)


def test_the_summary_says_the_end_the_loss_ties_and_what_pressures_rest_on(
    graded: ActuateResult,
) -> None:
    final, lost, ties, pressures, *_ = graded.summary
    assert final.startswith("final pattern 00000 at 0 MPa, certified: the stable state")
    assert lost == f"4 events, {sum(graded.table['energy_released_mJ']):.5g} mJ lost in them"
    assert ties.startswith("ties in 4 of 4 events")
    assert pressures.startswith("pressures: assumed, ")
    given = dpg.actuate(
        GRADED, pressure="0:0.1", settings={"pressure.effective_area_mm2": 30.0}
    ).summary
    assert "0 events" in given[1]
    assert not any(line.startswith("ties") for line in given)
    assert any(line.startswith("pressures: given, ") for line in given)
    fitted = dpg.actuate(GRADED, pressure="0:0.1", settings=FITTED).summary
    assert any(line.startswith("pressures: fitted, ") for line in fitted)


def test_the_end_under_pressure_is_certified_by_its_balance() -> None:
    found = dpg.actuate(GRADED, pressure="0:0.16")
    assert found.certificate.is_certified
    assert "under its pressures" in found.summary[0]
    assert "0.16 MPa" in found.summary[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pressure", "settings"),
    [("0:150:0", {}), ("0:1000", FITTED), ("0:-1000", {})],
)
def test_what_no_finger_can_do_is_an_error_with_what_happened_before(
    pressure: str, settings: dict[str, Any]
) -> None:
    with pytest.raises(ActuationError, match=r" at -?\d.* MPa, on the way to step 2") as caught:
        dpg.actuate(GRADED, pressure=pressure, settings=settings)
    before = caught.value.result
    assert "pressures are in MPa, of which 150 kPa are 0.15" in str(caught.value)
    assert before.path["pressure_A_MPa"][-1] != float(pressure.split(":")[1])
    if pressure == "0:150:0":
        assert before.table["pattern_after"].tolist() == ["11100", "11111"]


@pytest.mark.parametrize("start", ["111", "0x000", "11121", "1*", "000000"])
def test_a_start_that_is_no_pattern_is_refused(start: str) -> None:
    with pytest.raises(UsageError, match="expected 5 digits, 0 or 1"):
        dpg.actuate(GRADED, pressure="0:0.1", start=start)


def test_a_start_that_is_no_state_is_refused() -> None:
    lost = {"finger.lattice.force_linearity": 0.2, "finger.calibration": "published"}
    with pytest.raises(UsageError, match="expected a stable state, found not_bistable"):
        dpg.actuate(GRADED, pressure="0:0.1", start="10000", settings=lost)


@pytest.mark.parametrize("cycles", [0, -1, 1.5, "2", True, 10**7])
def test_cycles_that_are_no_number_of_them_are_refused(cycles: Any) -> None:
    with pytest.raises(UsageError, match="cycles"):
        dpg.actuate(GRADED, pressure="0:0.1", cycles=cycles)


def test_a_finger_s_values_have_no_lines() -> None:
    finger = dpg.uniform_finger(
        3, segment_length=13.5, segment_height=10.75, stroke=3.5,
        bistable_stiffness=12.84, force_linearity=0.043, hinge_stiffness=24.2,
    )  # fmt: skip
    with pytest.raises(UsageError, match="pressure is a section of a spec"):
        dpg.actuate(finger, pressure="0:0.1")


def test_a_spec_s_own_history_is_followed() -> None:
    settings = {"pressure.history": {"A": "0:0.16:0"}}
    assert dpg.actuate(GRADED, settings=settings).pattern == "11100"
    assert dpg.actuate(GRADED, pressure="0:0.2:0", settings=settings).pattern == "11111"
    with pytest.raises(UsageError, match=r"or pressure\.history in the spec"):
        dpg.actuate(GRADED)
    with pytest.raises(SpecError):
        dpg.actuate(GRADED, pressure="0.2")


def test_a_unit_that_loses_its_second_state_only_bends() -> None:
    lost = {"finger.lattice.force_linearity": 0.5, "finger.calibration": "published"}
    found = dpg.actuate(GRADED, pressure="0:0.1:0", settings=lost)
    assert len(found.table) == 0
    assert found.pattern == "00000"


def test_the_path_is_kept_with_its_events(tmp_path: Path, graded: ActuateResult) -> None:
    path = tmp_path / "path.parquet"
    graded.save(path)
    table = pq.read_table(path)
    assert table.column_names == list(graded.path.names)
    metadata = {key.decode(): text.decode() for key, text in table.schema.metadata.items()}
    events = json.loads(metadata["dpg.events"])
    assert [event["unit"] for event in events] == ["1,2,3", "4,5", "1,2,3", "4,5"]
    assert "dome_height_mm" in metadata["dpg.spec"]
    assert table.schema.field("pressure_A_MPa").metadata[b"unit"] == b"MPa"
    basis = table.schema.field("energy_mJ").metadata[b"basis"]
    assert basis
    first = path.read_bytes()
    dpg.actuate(GRADED, pressure="0:0.16:0.2:0:-0.1:0").save(path)
    assert path.read_bytes() == first


def test_no_file_that_is_read_is_written(tmp_path: Path) -> None:
    spec, history = tmp_path / "spec.yaml", tmp_path / "history.csv"
    spec.write_bytes(GRADED.read_bytes())
    history.write_text("A\n0\n0.1\n")
    found = dpg.actuate(spec, pressure=history)
    for name in (spec, history):
        with pytest.raises(UsageError, match="is read"):
            found.save(name)
    with pytest.raises(OutputError):
        found.save(tmp_path / "missing" / "path.parquet")
    with pytest.raises(UsageError, match=r"ends in \.parquet"):
        found.save(tmp_path / "path.csv")


def test_unstable_branches_are_points_that_say_so(tmp_path: Path) -> None:
    found = dpg.actuate(GRADED, pressure="0:0.2", unstable=True)
    plain = dpg.actuate(GRADED, pressure="0:0.2")
    path = found.path
    n = len(plain.path)
    assert path["is_stable"].tolist() == [True] * n + [False] * (len(path) - n)
    assert path["event"][n:].tolist() == sorted(path["event"][n:].tolist())
    assert {*path["event"][n:].tolist()} == {1, 2}
    assert path["smallest_pivot"][n:].max() < 0.0
    assert path.to_pandas()[:n].equals(plain.path.to_pandas())
    assert found.table.to_pandas().equals(plain.table.to_pandas())
    with pytest.raises(UsageError, match="unstable"):
        dpg.actuate(GRADED, pressure="0:0.2", unstable="yes")  # type: ignore[arg-type]
