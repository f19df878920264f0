"""`routine`: its steps one by one, what a controller is told, and what each step fails by."""

import copy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.actuation.pulses import Pulse
from dpgcli.api.routine import RoutineResult, planned, seconds_of
from dpgcli.grasping import routine as search
from dpgcli.grasping import steps
from dpgcli.grasping.plans import Plan
from dpgcli.grasping.routine import carrying, letting_go, lifting
from dpgcli.grasping.stages import beside, kept, lifted, pulsed
from dpgcli.grasping.table import grasp_rows
from dpgcli.states.certify import Status

SPEC: dict[str, Any] = {
    "finger": {
        "units": 3,
        "calibration": "published",
        "linear_stiffness_N_per_mm": float("inf"),
        "geometry": {
            "dome_height_mm": 6.5,
            "dome_thickness_mm": 0.75,
            "unit_cell_mm": 22,
            "chamber_length_mm": 9,
            "channel_width_mm": 10,
            "limiting_layer_thickness_mm": 1.5,
            "unit_separation_mm": 3,
            "elastic_modulus_MPa": 26,
        },
    },
    "gripper": {"base_spacing_mm": 34, "mounting_angle_deg": 0},
    "object": {"disc": {"diameter_mm": 26}, "at_mm": [35, 0], "friction": 0.5, "mass_g": 5},
    "loads": {"gravity_direction": "x"},
}
BEGIN = (90.0, 0.0)
TWO_LINES = {"pressure.lines": {"A": "1-2", "B": "3"}}
STEPS = ["open", "approach", "close", "lift", "carry", "release", "withdraw"]


def grasp_row(pressures: list[float], **options: Any) -> Any:
    found = dpg.grasp(SPEC, approach="close", pressure=pressures, **options)
    return found.to_pandas().iloc[0]


@pytest.fixture(scope="module")
def found() -> RoutineResult:
    return dpg.routine(SPEC, approach_from=BEGIN)


@pytest.fixture(scope="module")
def rows(found: RoutineResult) -> Any:
    return found.to_pandas().set_index("step")


@pytest.fixture(scope="module")
def peaks(rows: Any) -> tuple[float, float]:
    """Of the pulses that close and let go."""
    return rows.peak_pressure_MPa["close"], rows.peak_pressure_MPa["release"]


def test_all_steps_go_well(found: RoutineResult, rows: Any) -> None:
    assert found.exists
    assert list(rows.index) == STEPS
    assert set(rows.status) == {"stable"}
    assert list(rows.pattern_after) == ["000", "000", "011", "011", "011", "000", "000"]
    assert list(rows.pattern_before) == ["000", *rows.pattern_after[:-1]]
    assert list(rows.object_x_mm) == [90.0, 35.0, 35.0, 35.0, 35.0, 35.0, 90.0]


def test_the_body_passes_straight_fingers_by_their_gap(rows: Any) -> None:
    """Half of 34 mm, less half of the layer and the radius."""
    for step in ("approach", "withdraw"):
        assert rows.clearance_mm[step] == pytest.approx(17.0 - 0.75 - 13.0, abs=1e-12)


def test_closing_is_what_grasp_does(rows: Any, peaks: tuple[float, float]) -> None:
    own, other = rows.loc["carry"], grasp_row([0.0, peaks[0], 0.0])
    assert other.status == "stable"
    assert own.pattern_after == other.pattern_after
    assert own.n_contacts == other.n_contacts == 2
    assert own.squeeze_N == pytest.approx(other.squeeze_N, rel=1e-9)
    assert own.payload_N == pytest.approx(other.payload_N, rel=1e-6)
    assert own.payload_margin == pytest.approx(own.payload_N / (0.005 * 9.80665) - 1.0)


def test_letting_go_is_what_grasp_does(rows: Any, peaks: tuple[float, float]) -> None:
    up, down = peaks
    other = grasp_row([0.0, up, 0.0, down, 0.0])
    assert (other.pattern_after, other.n_contacts) == (rows.pattern_after["release"], 0)


@pytest.mark.slow
def test_margins_are_to_the_thresholds_that_grasp_finds(
    rows: Any, peaks: tuple[float, float]
) -> None:
    up, down = peaks
    for history, step in (([0.0, 0.298, 0.0], "close"), ([0.0, up, 0.0, -0.298, 0.0], "release")):
        events = grasp_row(history).events.split("; ")
        kind = "snap" if step == "close" else "reset"
        own = [float(e.split(" at ")[1].split()[0]) for e in events if e.startswith(kind)]
        peak = up if step == "close" else down
        nearest = min(abs(pressure - peak) for pressure in own)
        assert rows.margin_MPa[step] == pytest.approx(nearest, abs=2e-6)


def test_a_controller_gets_ramps_that_actuate_reads(
    found: RoutineResult, peaks: tuple[float, float], tmp_path: Path
) -> None:
    """Without a body all three snap, and reset again."""
    assert found.history.time is not None
    assert found.history.time.tolist() == [0.0, 5.0, 6.0, 7.0, 12.0, 13.0, 14.0, 19.0]
    assert found.history.pressure[:, 0].tolist() == [0, 0, peaks[0], 0, 0, peaks[1], 0, 0]
    found.save_controller(tmp_path / "r.csv")
    way = dpg.actuate(SPEC, pressure=tmp_path / "r.csv")
    np.testing.assert_allclose(way.history.history.pressure, found.history.pressure, rtol=1e-9)
    assert way.history.history.time is not None
    assert way.history.history.time.tolist() == found.history.time.tolist()
    assert way.pattern == found.rows["pattern_after"][-1] == "000"
    assert "111" in way.table["pattern_after"].tolist()


def test_what_is_said(found: RoutineResult) -> None:
    text = "\n".join(found.summary)
    assert found.summary[0].startswith("routine of 2 pulses, the fewest that are found; smallest")
    assert "quasi-static" in text
    assert "contact is without friction" in text
    assert "payload: pull along x" in text
    assert any(line.startswith("forces: published") for line in found.summary)
    assert any(line.startswith("pressures: assumed") for line in found.summary)


def failing(**changes: Any) -> RoutineResult:
    """A routine that is not found; keys with a point are settings."""
    settings = {key: value for key, value in changes.items() if "." in key}
    others = {key: value for key, value in changes.items() if "." not in key}
    missed = dpg.routine(SPEC, **{"approach_from": BEGIN, "settings": settings, **others})
    assert not missed.exists
    with pytest.raises(dpg.UsageError, match="no routine is found"):
        _ = missed.history
    return missed


@pytest.mark.parametrize(
    ("changes", "step", "status", "reason"),
    [
        ({"gripper.base_spacing_mm": 26}, "approach", "collides", "meet with the body at "),
        ({"closed": "101"}, "close", "no_pulses", "lead to 101, as without the body, from 000"),
        pytest.param(
            *({"at": (70.0, 0.0)}, "close", "not_touched", "not both fingers touch"),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            *({"object.held": "free"}, "lift", "not_held", "let go of, the body leaves"),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            *({"object.friction": 1e-3}, "lift", "slips", "slips as soon as"),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            *({"object.mass_g": 1e5}, "carry", "too_heavy", "of a weight of 980.7 N"),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_each_step_fails_by_itself(
    changes: dict[str, Any], step: str, status: str, reason: str
) -> None:
    missed = failing(**changes)
    table = missed.table
    assert (table["step"][-1], table["status"][-1]) == (step, status)
    assert set(table["status"][:-1]) == {"stable"}
    assert any(reason in line for line in missed.summary)
    assert any(line.startswith(f"{step}: {status} in ") for line in missed.summary)


def test_where_a_body_meets_a_finger(request: pytest.FixtureRequest) -> None:
    """A disc of 13 mm on the axis, the face at 12.25 mm, up to half a phalanx beyond the nodes."""
    missed = failing(**{"gripper.base_spacing_mm": 26})
    end = 3.5 * 13.5
    assert missed.table["object_x_mm"][-1] == pytest.approx(end + np.sqrt(13.0**2 - 12.25**2))
    assert missed.table["clearance_mm"][-1] == 0.0


def test_an_open_state_that_cannot_be_reached() -> None:
    missed = failing(open="101")
    assert len(missed.table) == 0
    assert "no pulses lead from rest to the open state that is asked for" in missed.summary
    with pytest.raises(dpg.UsageError, match="no steps to draw"):
        missed.draw("strip.svg")


@pytest.fixture(scope="module")
def held() -> Any:
    """A prospect, fingers that have closed, and what is told of them."""
    _, known = planned(SPEC, BEGIN, None, None, "", "", ())
    plan = known.plans[-1]
    parts, _ = pulsed(
        known.task, beside(known.task, np.array([0], np.uint64)), [plan.closing], known.reach
    )
    found, after = lifted(known.task, parts)
    return known, plan, found, after


def test_a_pulse_too_small_to_let_go(held: Any) -> None:
    known, _, found, after = held
    weak = Pulse(0, -1e-3, -1e-3, -1e-3, 0b011, 0b000, is_open=False)
    words, codes, near = letting_go(known, found, after, [(0, (weak,))])
    assert (words.tolist(), codes.tolist()) == (["in_touch"], [0b011])
    assert near[0] > 1.0  # the next threshold is many times as far


def test_a_way_back_that_is_not_free(held: Any) -> None:
    known, _, found, after = held
    (pulses,) = (p for p in search.releases(known, [0b011])[0b011].values() if p and p[-1].peak < 0)
    words, *_ = letting_go(known, found, after, [(0, pulses)])
    assert words.tolist() == ["stable"]
    elsewhere = replace(known, task=replace(known.task, begin=np.array([35.0, 90.0])))
    words, *_ = letting_go(elsewhere, found, after, [(0, pulses)])
    assert words.tolist() == ["collides"]


@pytest.mark.slow
@pytest.mark.parametrize(("peaks", "status"), [((), "no_pulses"), ((-1e-3,), "in_touch")])
def test_fingers_that_do_not_let_go(
    monkeypatch: pytest.MonkeyPatch, peaks: tuple[float, ...], status: str
) -> None:
    def few(_: object, codes: list[int]) -> dict[int, dict[int, tuple[Pulse, ...]]]:
        pulses = tuple(Pulse(0, peak, peak, peak, 0, 0, is_open=False) for peak in peaks)
        return {code: {0: pulses} for code in codes}

    monkeypatch.setattr(search, "releases", few)
    table = failing().table
    assert (table["step"][-1], table["status"][-1]) == ("release", status)


def test_what_is_not_known_is_no_success(held: Any) -> None:
    task = held[0].task
    status = np.array([Status.STABLE, Status.STABLE, Status.NOT_CONVERGED], np.uint8)
    table = {"status": status, "payload_N": np.array([np.nan, 1.0, np.nan])}
    assert lifting(task, table).tolist() == ["stable", "stable", "not_converged"]
    assert carrying(task, table).tolist() == ["unknown", "stable", "not_converged"]
    bare = replace(task, scene=replace(task.scene, friction=None))
    assert carrying(bare, table).tolist() == ["not_checked", "not_checked", "not_converged"]


@pytest.mark.slow
def test_without_friction_nothing_is_said_of_payload() -> None:
    spec = copy.deepcopy(SPEC)
    del spec["object"]["friction"], spec["object"]["mass_g"]
    found = dpg.routine(spec, approach_from=BEGIN)
    assert found.exists
    assert not {"payload_N", "payload_margin"} & set(found.table.names)
    assert [found.table["status"][k] for k in (3, 4)] == ["not_checked"] * 2
    text = "\n".join(found.summary)
    assert "not checked: whether the body is lifted and carried" in text


@pytest.mark.slow
def test_a_peak_just_beyond_a_threshold_is_not_taken() -> None:
    """Of these fingers one unit snaps at 0.1643 MPa with the disc there, where 0.1645 would do."""
    settings = {"finger.units": 2, "finger.linear_stiffness_N_per_mm": 1e4}
    found = dpg.routine(
        SPEC, approach_from=BEGIN, object="disc:24", at=(24, 0), settings=settings
    ).to_pandas().set_index("step")  # fmt: skip
    assert found.margin_MPa["close"] > 0.05 * found.peak_pressure_MPa["close"]
    low = 1.1 * 0.1495
    assert found.peak_pressure_MPa["close"] > 1.2 * low
    spec = {**SPEC, "object": {**SPEC["object"], "disc": {"diameter_mm": 24}, "at_mm": [24, 0]}}
    other = dpg.grasp(spec, approach="close", pressure=[0.0, low, 0.0], settings=settings)
    assert other.table["n_contacts"][0] == 2
    thresholds = [float(e.split(" at ")[1].split()[0]) for e in other.table["events"][0].split(";")]
    assert 0.0 < low - max(thresholds) < 0.05 * low


def test_ends_in_the_state_in_which_it_began_are_taken_first(
    held: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def all_well(*given: Any) -> Any:
        targets = np.array([pulses[-1].target for _, pulses in given[-1]], np.uint64)
        assert len(set(targets.tolist())) > 1
        return np.full(len(targets), "stable"), targets, np.ones(len(targets))

    monkeypatch.setattr(search, "letting_go", all_well)
    best = search.searched(held[0]).plan
    assert best is not None
    assert best.release[-1].target == best.opened == 0b000


@pytest.mark.slow
def test_a_routine_that_does_not_hold_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if fingers that are followed one by one went another way than many at once."""
    monkeypatch.setattr(steps, "closing", lambda *_: np.array(["not_touched"]))
    with pytest.raises(dpg.ActuationError, match="does not hold: close ends not_touched") as caught:
        dpg.routine(SPEC, approach_from=BEGIN)
    assert caught.value.result.rows["status"][-1] == "not_touched"


def test_fingers_that_do_not_rest_begin_nothing() -> None:
    """A force that the straight finger buckles under."""
    pushed = {"finger.law": "push_only", "loads.tip_force_x_N": -0.5}
    with pytest.raises(dpg.UsageError, match="000 is marginal"):
        dpg.routine(SPEC, approach_from=BEGIN, settings=pushed)


def test_fingers_begin_where_loads_leave_them() -> None:
    """This couple flips two units before any pulse."""
    graded = {"3": {"geometry": {"dome_height_mm": 7.5}}}
    loads = {"loads.tip_moment_N_mm": -52, "finger.overrides": graded}
    found = dpg.routine(SPEC, approach_from=BEGIN, settings=loads)
    assert found.table["pattern_before"].tolist()[0] == "110"
    assert found.routine.search.known.openings[0b110] == ()


@pytest.mark.slow
def test_two_lines_go_one_after_the_other() -> None:
    found = dpg.routine(SPEC, approach_from=BEGIN, closed="111", settings=TWO_LINES, ramp=0.5)
    table = found.table
    assert found.exists
    n_releases = len(table) - 7
    expected = [*STEPS[:3], *STEPS[2:5], *(["release"] * n_releases), "withdraw"]
    assert table["step"].tolist() == expected
    assert sorted(table["line"][2:4]) == ["A", "B"]
    pressure = found.history.pressure
    assert pressure.shape[1] == 2
    assert not (pressure[:, 0] * pressure[:, 1]).any()
    other = dpg.grasp(
        SPEC,
        approach="close",
        pressure={"A": pressure[:6, 0].tolist(), "B": pressure[:6, 1].tolist()},
        settings=TWO_LINES,
    )
    assert other.table["pattern_after"][0] == table["pattern_after"][3]
    assert other.table["squeeze_N"][0] == pytest.approx(table["squeeze_N"][3], rel=1e-9)


@pytest.mark.slow
def test_fingers_open_by_a_pulse_first() -> None:
    missed = dpg.routine(
        SPEC, approach_from=BEGIN, open="001", object="disc:18", at=(70, 0), settings=TWO_LINES
    )
    first = missed.to_pandas().iloc[0]
    assert (first.step, first.line, first.pattern_after) == ("open", "B", "001")
    alone = dpg.pulses(SPEC, end="001", settings=TWO_LINES).table
    assert first.peak_pressure_MPa == alone["peak_pressure_MPa"][0]
    assert first.margin_MPa == alone["margin_MPa"][0]


@pytest.fixture(scope="module")
def moving() -> RoutineResult:
    """A disc that is let go of between fingers that touch it at four places."""
    settings = {
        "finger.units": 5,
        "gripper.base_spacing_mm": 24.16,
        "gripper.mounting_angle_deg": 10,
        "object": {"disc": {"diameter_mm": 30}, "at_mm": [25, 0], "held": "free"},
    }
    return dpg.routine({**SPEC, "object": settings.pop("object")}, approach_from=(150, 0),
                       settings=settings)  # fmt: skip


@pytest.mark.slow
def test_a_body_that_moves_is_let_go_of_where_it_is(moving: RoutineResult) -> None:
    assert moving.exists
    table = moving.to_pandas().set_index("step")
    assert table.status["lift"] == "stable"
    assert table.status["carry"] == "not_checked"
    peak = table.peak_pressure_MPa["close"]
    other = dpg.grasp(
        moving.given.scene, approach="close", pressure=[0.0, peak, 0.0]
    ).to_pandas().iloc[0]  # fmt: skip
    assert table.n_contacts["lift"] == other.n_contacts == 4
    assert table.object_x_mm["lift"] == pytest.approx(other.object_x_mm, abs=1e-9)
    assert table.object_x_mm["lift"] < 25.0 - 1e-3
    assert table.object_x_mm["release"] == table.object_x_mm["lift"]
    assert table.n_contacts["release"] == 0


@pytest.mark.slow
def test_a_body_that_has_moved_is_kept_where_it_is(moving: RoutineResult) -> None:
    """With the same forces, now of fingers that are each by itself."""
    task, plan = moving.routine.task, moving.routine.search.plan
    assert plan is not None
    parts = beside(task, np.array([plan.opened], np.uint64))
    found, after = lifted(task, pulsed(task, parts, [plan.closing], 0.3)[0])
    there, rows = grasp_rows(found), grasp_rows(kept(task, after, found.centers))
    assert rows["n_contacts"][0] == there["n_contacts"][0] == 4
    assert rows["squeeze_N"][0] == pytest.approx(there["squeeze_N"][0], rel=1e-9)
    assert rows["penetration_mm"][0] < 1e-9
    assert rows["residual_N"][0] < 1e-9


def test_plans_have_peaks_10_percent_beyond_and_midway(held: Any) -> None:
    """Peaks 10 % beyond the last threshold, or midway to where pressures are followed to."""
    known = held[0]
    (low, high) = [plan.closing[0].peak for plan in known.plans]
    assert low == pytest.approx(1.1 * 0.1495, rel=1e-3)
    assert high == pytest.approx(0.5 * (0.1495 + known.reach), rel=1e-3)
    assert isinstance(known.plans[0], Plan)
    assert 1.0 < seconds_of(known) < 30.0


@pytest.mark.slow
def test_two_runs_are_the_same_bytes(found: RoutineResult, tmp_path: Path) -> None:
    again = dpg.routine(SPEC, approach_from=BEGIN)
    names = ("r.parquet", "r.csv", "r.svg")
    for result, folder in ((found, tmp_path / "a"), (again, tmp_path / "b")):
        folder.mkdir()
        result.save(folder / names[0])
        result.save_controller(folder / names[1])
        result.draw(folder / names[2])
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


NO_GRIPPER = {key: value for key, value in SPEC.items() if key != "gripper"}
JAWS = {**SPEC, "object": {"jaws": {"gap_mm": 20, "height_mm": 20}, "at_mm": [30, 0],
                           "compliance": {"stiffness_N_per_mm": 0.1}}}  # fmt: skip


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda: dpg.routine(NO_GRIPPER, approach_from=BEGIN), "expected gripper in the spec"),
        (lambda: dpg.routine(SPEC, approach_from=(35, 0)), "^approach_from: expected another"),
        (lambda: dpg.routine(SPEC, approach_from=(35,)), "^approach_from "),
        (lambda: dpg.routine(SPEC, approach_from=BEGIN, ramp=0.0), "^ramp 0: expected a number"),
        (lambda: dpg.routine(SPEC, approach_from=BEGIN, move=-1.0), "^move -1: expected"),
        (lambda: dpg.routine(SPEC, approach_from=BEGIN, open="2"), "^open 2: expected 3 digits"),
        (lambda: dpg.routine(SPEC, approach_from=BEGIN, closed="11"), "^closed 11: expected 3"),
        (lambda: dpg.routine(JAWS, approach_from=BEGIN), "^object: expected a body that keeps"),
        (lambda: dpg.routine(SPEC, approach_from=BEGIN, object="disc:40", at=(5, 0)), "begins"),
    ],
)
def test_refusals(call: Callable[[], object], match: str) -> None:
    with pytest.raises(dpg.UsageError, match=match):
        call()


def test_files_have_names_of_their_kind(found: RoutineResult, tmp_path: Path) -> None:
    with pytest.raises(dpg.UsageError, match=r"a name that ends in \.csv"):
        found.save_controller(tmp_path / "r.txt")
    other = tmp_path / "mine.csv"
    other.write_text("time_s,A_MPa\n")
    with pytest.raises(dpg.OutputError):
        found.save_controller(other)
    assert other.read_text() == "time_s,A_MPa\n"
