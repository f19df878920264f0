"""Fingers under dead loads, from spec to table."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import dpgcli as dpg
from dpgcli.design.outputs import Output
from dpgcli.files.scene_file import read_spec, scene_of

LATTICE = {
    "segment_length_mm": 13.5,
    "segment_height_mm": 10.75,
    "stroke_mm": 3.5,
    "bistable_stiffness_N_per_mm": 12.84,
    "force_linearity": 0.043,
    "hinge_stiffness_N_mm_per_rad": 24.2,
}
CONFIGS = Path(__file__).parents[2] / "configs"
LOADS = {"tip_force_N": [0.05, -0.1], "tip_moment_N_mm": 1.5, "unit_mass_g": 12.0}
ZERO = {"tip_force_N": [0.0, 0.0], "tip_moment_N_mm": 0.0, "unit_mass_g": 0.0}
GRIPPER = {"base_spacing_mm": 60.0, "mounting_angle_deg": 30.0}


def spec(loads: Mapping[str, Any] | None = None, **more: Any) -> dict[str, Any]:
    finger = {"units": 3, "linear_stiffness_N_per_mm": 1.0e4, "lattice": LATTICE}
    return {"finger": finger, **({} if loads is None else {"loads": loads}), **more}


def table(given: Any, **more: Any) -> pd.DataFrame:
    return dpg.predict(given, **more).to_pandas()


def test_nothing_is_there_without_loads() -> None:
    for loads in (None, {}, ZERO):
        plan = dpg.explain(spec(loads))
        assert plan.terms == ("bistable", "hinge", "bar")
        assert plan.omissions[0].what == "loads, pressure and contact"
        pd.testing.assert_frame_equal(table(spec(loads)), table(spec()), check_exact=True)


def test_a_plan_says_that_loads_act() -> None:
    plan = dpg.explain(spec(LOADS))
    assert plan.terms == ("bistable", "hinge", "bar", "load")
    assert plan.omissions[0].what == "pressure and contact"
    (shapes,) = (trust for trust in plan.trusts if trust.output is Output.SHAPES)
    assert shapes.doubt.startswith("loads move it by stiffness: ")
    assert shapes.known_error.endswith("under loads as the stiffness of units")
    assert not any(t.doubt for t in dpg.explain(spec(ZERO)).trusts if t.output is Output.SHAPES)


def test_energies_are_told_term_by_term() -> None:
    found = table(spec(LOADS), columns="default")
    parts = [column for column in found if column.endswith("_energy_mJ")]
    assert parts[-1] == "load_energy_mJ"
    assert found["energy_mJ"].to_numpy() == pytest.approx(found[parts].sum(axis=1), rel=1e-12)
    work = 0.05 * found["tip_x_mm"] - 0.1 * found["tip_y_mm"] + 1.5 * found["tip_angle_rad"]
    nodes = table(spec(LOADS), columns="nodes")
    fallen = -sum(nodes[f"T{k}_x_mm"] for k in (1, 2, 3))
    work += 12.0e-3 * 9.80665 * fallen
    assert found["load_energy_mJ"].to_numpy() == pytest.approx(-work, rel=1e-9)


def test_a_tilted_finger_feels_gravity_as_a_turned_one_does() -> None:
    """The upper finger of a gripper whose +x points up, tilted by 30°, and that finger alone."""
    along = [-np.cos(np.pi / 6.0), 0.5]
    alone = table(spec({**LOADS, "gravity_direction": along}), columns="nodes")
    pair = table(spec(LOADS, gripper=GRIPPER), columns="nodes")
    cos, sin = np.cos(np.pi / 6.0), np.sin(np.pi / 6.0)
    for node in ("B3", "T1"):
        x, y = (alone[f"{node}_{axis}_mm"] for axis in "xy")
        assert pair[f"upper_{node}_x_mm"].to_numpy() == pytest.approx(cos * x - sin * y, abs=1e-9)
        upper = pair[f"upper_{node}_y_mm"].to_numpy()
        assert upper == pytest.approx(30.0 + sin * x + cos * y, abs=1e-9)


def test_the_fingers_of_a_gripper_stay_mirror_images() -> None:
    """The lower one solved by itself, in its own right-handed frame: all of y turned over."""
    pair = table(spec(LOADS, gripper=GRIPPER), columns="nodes")
    for axis, sign in (("x", 1.0), ("y", -1.0)):
        for node in ("B1", "T2", "B3"):
            lower = pair[f"lower_{node}_{axis}_mm"]
            assert (lower == sign * pair[f"upper_{node}_{axis}_mm"]).all()


@pytest.mark.slow
def test_a_sweep_gives_what_predict_gives() -> None:
    space = [
        {"key": "loads.tip_force_y_N", "values": [0.0, 0.3, 0.9]},
        {"key": "loads.unit_mass_g", "values": [0.0, 20.0]},
        {"key": "gripper.mounting_angle_deg", "values": [0.0, 25.0]},
    ]
    swept = dpg.sweep({"base": spec({}, gripper=GRIPPER), "space": space})
    states, designs = (swept.states, swept.designs)
    states, designs = (
        t if isinstance(t, pd.DataFrame) else t.to_pandas() for t in (states, designs)
    )
    assert set(designs["status"]) == {"stable", "partly_stable"}
    for design in designs.itertuples():
        loads = {"tip_force_y_N": design.tip_force_y_N, "unit_mass_g": design.unit_mass_g}
        tilted = {**GRIPPER, "mounting_angle_deg": design.mounting_angle_deg}
        alone = table(spec(loads, gripper=tilted))
        mine = states[states["design"] == design.design].reset_index(drop=True)
        assert mine["status"].tolist() == alone["status"].tolist()
        assert mine["reached_pattern"].tolist() == alone["reached_pattern"].tolist()
        for column in ("tip_y_mm", "energy_mJ", "tip_compliance_yy_mm_per_N", "aperture_mm"):
            pd.testing.assert_series_equal(mine[column], alone[column], rtol=1e-12)


def test_trust_of_a_space_counts_designs_under_load() -> None:
    space = [{"key": "loads.tip_force_y_N", "values": [0.0, 0.1, 0.2]}]
    plan = dpg.explain({"base": spec({}), "space": space})
    (shapes,) = (trust for trust in plan.trusts if trust.output is Output.SHAPES)
    assert shapes.share == "2 of 3 designs"


def test_a_target_error_is_not_promised_before_the_work() -> None:
    free, loaded = (dpg.explain(spec(loads), target_error=1e-3) for loads in (ZERO, LOADS))
    assert free.error_bound < 1e-3
    assert np.isinf(loaded.error_bound)
    assert loaded.accuracy_level is not None
    assert loaded.accuracy_level.name == "tolerance 1e-12"


def test_long_fingers_fall_into_halves_only_without_forces() -> None:
    def method(loads: Mapping[str, Any]) -> str:
        given = spec(loads)
        given["finger"] |= {"units": 14}
        return str(dpg.explain(given, columns="states").method)

    assert method(ZERO) == "pairs of half-fingers"
    assert method({"tip_force_N": [0.0, 0.01]}) == method({"unit_mass_g": 1.0}) == "direct"
    couple = {"tip_moment_N_mm": 15.0}
    assert method(couple) == "pairs of half-fingers"
    given = spec(couple)
    given["finger"] |= {"units": 14}
    whole = table(given, columns=["states", "energies"]).set_index("pattern")
    some = [whole.index[place] for place in (0, 77, 9999, 16383)]
    alone = table(given, columns=["states", "energies"], patterns=some).set_index("pattern")
    for column in ("tip_y_mm", "energy_mJ", "load_energy_mJ"):
        assert whole.loc[some, column].to_numpy() == pytest.approx(alone[column], abs=1e-9)


def test_uncertainties_are_those_of_the_loaded_finger() -> None:
    """By differences of whole predictions; the mounting angle turns gravity, too."""
    loads = {**LOADS, "unit_mass_g": 40.0}
    tolerances = {"stroke_mm": 1e-4, "mounting_angle_deg": 0.01}
    for key, size in tolerances.items():
        found = []
        for sign in (1.0, -1.0):
            moved = spec(loads, gripper=dict(GRIPPER))
            moved["finger"] = {**moved["finger"], "lattice": dict(LATTICE)}
            section = moved["gripper"] if key in GRIPPER else moved["finger"]["lattice"]
            section[key] += sign * size
            found.append(table(moved))
        given = spec(loads, gripper=GRIPPER, uncertainty={key: size})
        stated = table(given, columns=["default", "uncertainty"])
        for column, error in (
            ("tip_y_mm", "tip_y_uncertainty_mm"),
            ("aperture_mm", "aperture_uncertainty_mm"),
        ):
            by_differences = 0.5 * np.abs(found[0][column] - found[1][column])
            assert by_differences.max() > 1e-5
            assert stated[error].to_numpy() == pytest.approx(by_differences, rel=1e-3, abs=1e-9)


def test_actuation_begins_at_rest_under_the_loads() -> None:
    pressure = {"snap_pressure_MPa": 0.1495, "history": {"A": [0.0, 0.25, 0.0]}}
    found = dpg.actuate(spec(LOADS, pressure=pressure))
    rest = table(spec(LOADS))
    first = found.path.to_pandas().iloc[0]
    assert first["tip_y_mm"] == pytest.approx(rest["tip_y_mm"][0], abs=1e-9)
    assert abs(first["tip_y_mm"]) > 0.1
    last = found.path.to_pandas().iloc[-1]
    assert found.pattern == "111"
    assert last["tip_y_mm"] == pytest.approx(rest["tip_y_mm"][7], abs=1e-9)
    assert found.certificate.is_certified


def test_a_couple_shifts_thresholds_by_a_closed_form() -> None:
    """Rigid bars: the force at the opening is that of the pressure and of the couple together."""

    def snap(moment: float) -> float:
        given = spec({"tip_moment_N_mm": moment})
        given["finger"] |= {"units": 1, "linear_stiffness_N_per_mm": np.inf}
        given["pressure"] = {"effective_area_mm2": 30.0, "history": {"A": [0.0, 0.4, 0.0]}}
        events = dpg.actuate(given).table.to_pandas()
        return float(events["pressure_MPa"][0])

    # p A dx/dθ − M dx/dθ·(1/lever) … the least pressure at which no turn balances
    turn = np.linspace(0.0, 0.25, 250_001)
    opening = 2.0 * 10.75 * np.sin(0.5 * turn)
    u, softening = opening / 3.5, 1.0 - 0.043
    force = 12.84 * opening * (1.0 + softening * (2.0 * u**2 - 3.0 * u))
    lever = 10.75 * np.cos(0.5 * turn)
    for moment in (0.0, -8.0, 5.0):
        needed = (force * lever + 24.2 * turn + moment) / (30.0 * lever)
        assert snap(moment) == pytest.approx(needed.max(), rel=1e-9)


def test_a_scene_of_a_spec_file_bears_what_the_file_says() -> None:
    finger = scene_of(read_spec(CONFIGS / "gripper.yaml", ["loads.unit_mass_g=12"])).finger
    assert finger.is_loaded
    assert finger.unit_weight.item() == pytest.approx(0.1176798)
