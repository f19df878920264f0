"""What `dpg bench` measures is what it says."""

from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
import pytest

from dpgcli.benchmark import bench as module
from dpgcli.benchmark.ablation import ABLATIONS, ablations, check_ablation
from dpgcli.benchmark.bench import Bench, chosen_patterns, errors, repeated, varied
from dpgcli.benchmark.methods import BenchmarkResult
from dpgcli.calibration.known import KnownStates
from dpgcli.design.scene import Gripper, Scene
from dpgcli.errors import UsageError
from dpgcli.files.prediction import write_states
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.reference.equilibria import extended_states
from dpgcli.states.plan import Request, explain


def finger(n_units: int, linear_stiffness: float = 1e4, **changes: float) -> Finger:
    return uniform_finger(n_units, **{**STUDY, **changes}, linear_stiffness=linear_stiffness)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short growth tables and small batches."""
    monkeypatch.setattr(module, "GROWTH_UNITS", (1, 3))
    monkeypatch.setattr(module, "GROWTH_DESIGNS", (1, 3))
    monkeypatch.setattr(module, "GROWTH_RATIOS", (1e4, np.inf))
    monkeypatch.setattr(module, "TABLE_UNITS", 3)
    monkeypatch.setattr(module, "BATCH", 16)
    monkeypatch.setattr(module, "PEER_STATES", 1)
    monkeypatch.setattr("dpgcli.benchmark.timing.SHORTEST_ROUND", 0.0)


@pytest.mark.usefixtures("quick")
def test_every_row_has_every_column_and_sound_times() -> None:
    write = partial(write_states, spec_json="{}")
    rows = list(Bench(Scene(finger(2), ()), 1, ("every-unit",), write=write).rows())
    names = [column.name for column in module.COLUMNS]
    assert all(list(row) == names for row in rows)
    groups = list(dict.fromkeys(row["group"] for row in rows))
    assert groups == ["ladder", "one finger", "peer", "units", "designs", "stiffness", "kept"]
    for row in rows:
        assert row["seconds_min"] <= row["seconds"] <= row["seconds_max"]
        assert row["seconds_per_state"] == pytest.approx(row["seconds"] / row["n_states"])
        assert row["relative_time"] > 0.0
        assert row["certified"] == (
            row["group"] in ("ladder", "one finger", "stiffness") and row["method"][0] == "c"
        ) or row["method"].startswith("lattice")


@pytest.mark.usefixtures("quick")
@pytest.mark.slow
def test_third_parties_are_left_out_where_hinges_turn_each_other() -> None:
    coupled = finger(2).changed(hinge_coupling=np.array([[1.0]]))
    rows = list(Bench(Scene(coupled, ()), 1, ("every-unit",)).rows())
    assert "peer" not in {row["group"] for row in rows}
    ladder = [row for row in rows if row["method"] == "chain, 1e-12"]
    assert ladder and all(row["max_tip_error_mm"] < 1e-11 for row in ladder)


@pytest.mark.usefixtures("quick")
@pytest.mark.slow
def test_the_models_error_stands_beside_the_solvers() -> None:
    patterns = np.array([[True, True], [False, True]])
    tips = np.array([[26.0, 25.0], [-4.0, -7.0]])
    study = Bench(Scene(finger(2), ()), 1, known=KnownStates.of_tips(patterns, tips))
    (row,) = (row for row in study.rows() if row["group"] == "model")
    pose = extended_states(study.finger, patterns).pose[:2]
    assert row["max_tip_error_mm"] == pytest.approx(float(np.hypot(*(pose - tips)).max()))
    assert row["n_missing"] == 0
    assert np.isnan(row["max_angle_error_rad"]), "the data have no angles"
    angles = np.array([-1.0, -0.5])
    study = Bench(Scene(finger(2), ()), 1, known=KnownStates.of_tips(patterns, tips, angles))
    (row,) = (row for row in study.rows() if row["group"] == "model")
    off = np.abs(extended_states(study.finger, patterns).pose[2] - angles).astype(float)
    assert row["max_angle_error_rad"] == pytest.approx(off.max())
    assert row["rms_angle_error_rad"] == pytest.approx(np.sqrt((off**2).mean()))


def test_errors_count_states_that_exist_only() -> None:
    patterns = chosen_patterns(2)
    reference = extended_states(finger(2), patterns)
    pose, energy = reference.pose.astype(float), reference.energy.astype(float)
    exact = errors(BenchmarkResult(pose, energy), reference)
    assert exact["max_tip_error_mm"] < 1e-14
    assert exact["n_missing"] == 0
    pose[0, 1] += 3e-3
    pose[1, 1] += 4e-3
    pose[:, 2] = np.nan
    worse = errors(BenchmarkResult(pose, energy), reference)
    assert worse["max_tip_error_mm"] == pytest.approx(5e-3)
    assert worse["rms_tip_error_mm"] == pytest.approx(5e-3 / np.sqrt(3))
    assert worse["n_missing"] == 1
    none = extended_states(finger(2, force_linearity=0.5), patterns)
    assert errors(BenchmarkResult(pose, energy), none)["n_missing"] == 0


@pytest.mark.parametrize("n_units", [1, 3, 5, 6, 20, 64])
def test_patterns_are_chosen_evenly_from_first_to_last(n_units: int) -> None:
    patterns = chosen_patterns(n_units)
    assert patterns.shape[0] == n_units
    assert not patterns[:, 0].any()
    assert patterns[:, -1].all()
    assert len(np.unique(patterns, axis=1).T) == patterns.shape[1] <= 32


def test_repeated_units_and_varied_designs() -> None:
    longer = repeated(finger(2).changed(stroke=np.array([[3.0], [4.0]])), 5)
    assert longer.stroke.ravel().tolist() == [3.0, 4.0, 3.0, 4.0, 3.0]
    designs = varied(longer, 3)
    assert designs.n_designs == 3
    assert len(np.unique(designs.stroke[0])) == 3


KEPT: dict[str, Scene] = {
    "bars": Scene(finger(3, np.inf), ()),
    "hinges": Scene(finger(3, hinge_stiffness=0.0), ()),
    "every-unit": Scene(finger(3), ()),
    "whole-fingers": Scene(finger(13), ()),
    "second-finger": Scene(finger(2), (), Gripper(60.0, 0.0), 1.5),
    "every-column": Scene(finger(2), ()),
}


@pytest.mark.parametrize("name", ABLATIONS)
def test_the_plans_bound_covers_what_putting_back_changes(name: str) -> None:
    planned, kept = ablations(KEPT[name], name, None)
    planned.run()
    kept.run()
    assert kept.n_states == planned.n_states == 2 ** KEPT[name].finger.n_units
    assert kept.change <= kept.bound
    if name == "bars":
        assert kept.change > 1e-6, "the change is there"
        assert kept.bound < 1.0
    else:
        assert kept.change < 1e-9


@pytest.mark.parametrize("scene", KEPT.values(), ids=list(KEPT))
@pytest.mark.parametrize("target", [None, 1e-2])
def test_what_explain_leaves_out_is_what_can_be_put_back(
    scene: Scene, target: float | None
) -> None:
    plan = explain(scene, Request(columns=("states",), target_error=target))
    left_out = {omission.keep for omission in plan.omissions if omission.keep} | {"every-column"}
    possible = set()
    for name in ABLATIONS:
        with suppress(UsageError):
            check_ablation(scene, name, target)
            possible.add(name)
    assert possible == left_out


@pytest.mark.parametrize("target", [1e-2, 1e-1])
def test_bars_dropped_for_a_target_and_put_back(target: float) -> None:
    _, kept = ablations(Scene(finger(5), ()), "bars", target)
    assert 1e-4 < kept.change <= kept.bound <= target


@pytest.mark.parametrize(
    ("name", "scene"),
    [
        ("bars", Scene(finger(3), ())),
        ("hinges", Scene(finger(3), ())),
        ("every-unit", Scene(finger(1), ())),
        ("whole-fingers", Scene(finger(3), ())),
        ("second-finger", Scene(finger(3), ())),
        ("gravity", Scene(finger(3), ())),
    ],
)
def test_what_is_not_left_out_cannot_be_put_back(name: str, scene: Scene) -> None:
    with pytest.raises(UsageError, match=f"^keep {name}"):
        Bench(scene, 1, (name,)).check()


def test_more_states_than_can_be_held_twice_are_not_put_back() -> None:
    with pytest.raises(UsageError, match=r"2,097,152 states .* 1,048,576"):
        Bench(Scene(finger(21), ()), 1, ("whole-fingers",)).check()


def test_the_growth_goes_through_the_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    """Long fingers are measured in the way that predict takes them."""
    monkeypatch.setattr(module, "GROWTH_UNITS", (2, 13))
    monkeypatch.setattr("dpgcli.benchmark.timing.SHORTEST_ROUND", 0.0)
    rows: list[Any] = list(Bench(Scene(finger(2), ()), 1)._by_units())
    assert [row["method"] for row in rows] == ["direct", "pairs of half-fingers"]
    assert rows[1]["n_states"] == 2**13
