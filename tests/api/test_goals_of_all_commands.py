"""Goals about what grasp, transitions and sweeps put into columns: the numbers are theirs."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import dpgcli as dpg
from dpgcli.api import reached as anew
from dpgcli.api.given import goal_input
from dpgcli.errors import NothingSelectedError
from dpgcli.files.goal_file import GoalFile
from dpgcli.search import search
from dpgcli.search.targets import TargetEvaluation
from dpgcli.sweeps.extent import MOST_PRESSED

STROKE = "finger.lattice.stroke_mm"
SNAP = "pressure.snap_pressure_MPa"
BODY = {"disc": {"diameter_mm": 12.0}, "at_mm": [30.0, 0.0]}
GRIPPER = {"base_spacing_mm": 20.0, "mounting_angle_deg": 0.0}


@pytest.fixture(autouse=True)
def few_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "STARTS", 3)


@pytest.fixture
def pressed(study: dict[str, Any]) -> dict[str, Any]:
    """A finger of two of the study's units, each on its own line."""
    lines = {"A": "1", "B": "2"}
    return {
        "finger": {**study["finger"], "units": 2},
        "pressure": {"lines": lines, "snap_pressure_MPa": 0.12},
    }


@pytest.fixture
def holding(study: dict[str, Any]) -> dict[str, Any]:
    """A gripper of two fingers of two units, with a disc between them."""
    thick = {**study["finger"], "units": 2, "geometry": {"limiting_layer_thickness_mm": 1.5}}
    return {"finger": thick, "gripper": GRIPPER, "object": BODY}


def goal(base: Mapping[str, Any], *targets: dict[str, Any], **more: Any) -> dict[str, Any]:
    vary = {STROKE: {"from": 3.0, "to": 4.0}}
    return {"base": base, "vary": vary, "targets": [*targets], **more}


def spec_of(found: Any) -> dict[str, Any]:
    return dict(found.specs[0].model_dump(exclude_none=True))


@pytest.mark.parametrize(
    "varied",
    [[0.12, 0.131], pytest.param({"from": 0.1, "to": 0.2}, marks=pytest.mark.slow)],
    ids=["list", "range"],
)
def test_a_target_of_pressure_is_that_of_transitions(pressed: dict[str, Any], varied: Any) -> None:
    up = {"pattern": "00", "quantity": "pressure_B_up_MPa", "value": 0.13,
          "tolerance_MPa": 0.002}  # fmt: skip
    down = {"pattern": "1*", "quantity": "pressure_A_down_MPa", "value": -0.06,
            "tolerance_MPa": 0.1}  # fmt: skip
    reachable = {"pattern": "10", "quantity": "reachable", "value": True}
    found = dpg.inverse_design(goal(pressed, up, down, reachable, vary={SNAP: varied}))
    assert found.is_met
    row = found.table.to_pandas().iloc[0]
    graph = dpg.transitions(spec_of(found))
    rows = graph.to_pandas().set_index(["pattern", "line", "direction"])["pressure_MPa"]
    assert row["target_1_pressure_B_up_MPa"] == pytest.approx(rows.loc["00", "B", "+"], abs=1e-9)
    assert row["target_2_pressure_A_down_MPa"] == pytest.approx(
        rows.loc[row["target_2_pattern"], "A", "-"], abs=1e-9
    )
    assert row["target_1_miss_MPa"] < (2e-3 if isinstance(varied, list) else 1e-5)
    assert bool(row["target_3_reachable"]) and "10" in graph.reachable
    if isinstance(varied, dict):
        kept = "reachable: searches do not follow what changes in steps"
        assert any(line.startswith(kept) for line in found.summary)


def test_what_is_never_left_has_no_pressure(pressed: dict[str, Any]) -> None:
    up = {"pattern": "11", "quantity": "pressure_A_up_MPa", "value": 0.1, "tolerance_MPa": 0.1}
    with pytest.raises(
        NothingSelectedError, match="certified states of 11 that have pressure_A_up_MPa"
    ):
        dpg.inverse_design(goal(pressed, up))


@pytest.mark.parametrize(
    "varied",
    [[3.3, 3.5], pytest.param({"from": 3.0, "to": 4.0}, marks=pytest.mark.slow)],
    ids=["list", "range"],
)
def test_a_target_of_a_grasp_is_that_of_grasp(holding: dict[str, Any], varied: Any) -> None:
    squeeze = {"pattern": "1*", "quantity": "squeeze_N", "value": 0.5, "tolerance_N": 0.01}
    touch = {"pattern": "10", "quantity": "n_contacts", "value": 2, "tolerance": 0.5}
    found = dpg.inverse_design(goal(holding, squeeze, touch, vary={STROKE: varied}), evaluations=4)
    row = found.table.to_pandas().iloc[0]
    assert row["target_1_pattern"] == "10"
    held = dpg.grasp(spec_of(found), patterns=["10"]).to_pandas()
    assert row["target_1_squeeze_N"] == pytest.approx(held["squeeze_N"][0], abs=1e-9)
    assert row["target_1_squeeze_N"] > 0.0
    assert row["target_2_n_contacts"] >= 2
    if isinstance(varied, dict):
        assert not row["finished"]  # the limit ended its search


def test_targets_of_designs_have_no_pattern(holding: dict[str, Any]) -> None:
    most = {"quantity": "squeeze_max_N", "value": 0.2, "tolerance_N": 1.0}
    count = {"quantity": "n_grasps", "value": 4, "tolerance": 10}
    given = goal(holding, most, count, vary={STROKE: [3.0, 3.5]})
    found = dpg.inverse_design(given)
    assert "target_1_pattern" not in found.table.names
    space = [{"key": STROKE, "values": [3.0, 3.5]}]
    swept = dpg.sweep({"base": holding, "space": space}, executor="serial").designs.to_pandas()
    rows = found.table.to_pandas().sort_values("stroke_mm")
    assert rows["target_1_squeeze_max_N"].tolist() == pytest.approx(
        swept["squeeze_max_N"].tolist(), rel=1e-9
    )
    assert rows["target_2_n_grasps"].tolist() == swept["n_grasps"].tolist()


def read(given: dict[str, Any]) -> GoalFile:
    return goal_input(given)


def test_slopes_of_targets_of_designs_and_steps(pressed: dict[str, Any]) -> None:
    """Those of numbers by differences, those of counts and truths none."""
    reach = {"quantity": "reach_min_mm", "value": 30.0, "tolerance_mm": 2.0}
    count = {"quantity": "n_reachable", "value": 3, "tolerance": 0.5}
    tip = {"pattern": "11", "quantity": "tip_y_mm", "value": 0.0, "tolerance_mm": 1.0}
    made = read(goal(pressed, reach, tip, count)).goal
    evaluation = TargetEvaluation(made)
    assert evaluation.by_differences == ("reach_min_mm",)
    assert evaluation.stepwise == ("n_reachable",)

    def at(point: float, **more: Any) -> Any:
        return evaluation(made.values({}, np.array([[point]])), **more)[0]

    here, h = at(0.4), 1e-3
    slopes = (at(0.4 + h).values - at(0.4 - h).values) / (2.0 * h)
    assert here.slopes[:2, 0, 0] == pytest.approx(slopes[:2, 0], rel=1e-4)
    assert here.slopes[2, 0, 0] == 0.0
    plain = at(0.4, with_slopes=False)
    assert plain.values == pytest.approx(here.values, rel=1e-12)
    assert not np.isfinite(plain.slopes[1]).any()


def test_what_is_found_anew_has_to_agree(
    holding: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A grasp that is another from the spec is a bug, and told."""
    from dpgcli.grasping import table

    rows_of = table.grasp_rows

    def wrong(found: Any) -> Any:
        rows = rows_of(found)
        return {**rows, "squeeze_N": rows["squeeze_N"] + 1e-6}

    monkeypatch.setattr(table, "grasp_rows", wrong)
    squeeze = {"pattern": "10", "quantity": "squeeze_N", "value": 0.5, "tolerance_N": 0.01}
    with pytest.raises(AssertionError, match="predict finds the same"):
        dpg.inverse_design(goal(holding, squeeze, vary={STROKE: [3.5]}))
    assert anew.AGREEMENT == 1e-9


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ({"quantity": "squeeze_N", "value": 1, "tolerance_N": 1}, "the base has no object"),
        ({"quantity": "squeeze_max_N", "value": 1, "tolerance_N": 1}, "the base has no object"),
        ({"quantity": "aperture_mm", "value": 1, "tolerance_mm": 1}, "the base has no gripper"),
        ({"quantity": "reach_min_mm", "value": 1, "tolerance_mm": 1, "pattern": "1*"},
         "a known key, found \"pattern\" (reach_min_mm is of whole designs)"),
        ({"quantity": "tip_x_mm", "value": 1, "tolerance_mm": 1}, "pattern such as 111*"),
        ({"quantity": "reachable", "value": 1, "pattern": "1*"}, "expected true or false, found 1"),
        ({"quantity": "reachable", "value": True, "tolerance": 1, "pattern": "1*"},
         "expected a known key"),
        ({"quantity": "n_reachable", "value": 3}, "tolerance: expected a number > 0"),
        ({"quantity": "pressure_C_up_MPa", "value": 3}, "the nearest is pressure_"),
        ({"quantity": "reachable_patterns", "value": 3}, "tip, or a column of states or of design"),
    ],
)  # fmt: skip
def test_mistakes(pressed: dict[str, Any], target: dict[str, Any], said: str) -> None:
    problems = [problem.statement for problem in dpg.validate(goal(pressed, target))]
    assert any(said in problem for problem in problems), problems


def test_sections_that_are_missing_and_fingers_that_are_too_long(study: dict[str, Any]) -> None:
    reachable = {"quantity": "reachable", "value": True, "pattern": "1*"}
    (problem,) = dpg.validate(goal(study, reachable))
    assert "the base has no pressure" in problem.statement
    long = {**study, "finger": {**study["finger"], "units": MOST_PRESSED + 1}, "pressure": {}}
    (problem,) = dpg.validate(goal(long, {**reachable, "pattern": "1" * 13}))
    assert "expected at most 12 units under pressure, found 13" in problem.statement
