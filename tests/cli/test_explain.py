"""The plan that is printed is the plan that is carried out."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

Call = Callable[..., Any]
RIGID = ("-s", "finger.linear_stiffness_N_per_mm=.inf")
REQUESTS = [
    ("three_unit.yaml",),
    ("three_unit.yaml", "--pattern", "1*", "--nodes"),
    ("three_unit.yaml", "--columns", "energies,tip_x_mm"),
    ("three_unit.yaml", "--formulation", "lattice"),
    ("three_unit.yaml", "--tolerance", "1e-9"),
    ("three_unit.yaml", *RIGID),
    ("gripper.yaml",),
    ("twenty_unit.yaml",),
]


def facts(call: Call, *arguments: str) -> dict[str, Any]:
    result = call("explain", *arguments, "--format", "json")
    assert (result.exit_code, result.stderr) == (0, "")

    def refused(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    plan: dict[str, Any] = json.loads(result.stdout, parse_constant=refused)
    return plan


@pytest.mark.parametrize("arguments", REQUESTS, ids=" ".join)
def test_predict_does_what_explain_says(
    call: Call, folder: Path, arguments: tuple[str, ...]
) -> None:
    plan = facts(call, *arguments)
    assert call("predict", "-q", *arguments, "-o", "states.parquet").exit_code == 0
    table = pq.ParquetFile(folder / "states.parquet")
    assert table.schema_arrow.names == plan["columns"]
    assert table.metadata.num_rows == plan["n_states"]
    run = json.loads((folder / "states.run.json").read_text(encoding="utf-8"))
    assert run["finger_solves"] == plan["n_finger_solves"]
    assert run["worst_residual_N"] <= plan["residual_limit_N"]


@pytest.mark.parametrize("arguments", REQUESTS, ids=" ".join)
def test_the_text_says_the_same(call: Call, arguments: tuple[str, ...]) -> None:
    plan = facts(call, *arguments)
    text = call("explain", *arguments).stdout
    assert f"{plan['n_states']:,} of {2 ** plan['n_units']:,}" in text
    assert plan["method"] in text
    assert all(part["what"] in text and part["why"] in text for part in plan["left_out"])
    assert all(source["key"] in text for source in plan["sources"])


def test_pressure_is_left_out_of_states(call: Call) -> None:
    """Lines, and what their pressures rest on, are said all the same."""
    left_out = facts(call, "three_unit.yaml")["left_out"]
    assert "loads, pressure and contact" in [part["what"] for part in left_out]
    setting = ("-s", "pressure={lines: {A: 1-2, B: 3}, snap_pressure_MPa: 0.16}")
    plan = facts(call, "three_unit.yaml", *setting)
    assert [part["what"] for part in plan["left_out"]][:2] == ["loads and contact", "pressure"]
    assert plan["pressure_lines"] == {"A": [1, 2], "B": [3]}
    (snap,) = (source for source in plan["sources"] if source["key"] == "snap_pressure_MPa")
    assert (snap["value"], snap["units"], snap["origin"]) == (0.16, "1-3", "given")
    text = call("explain", "three_unit.yaml", *setting).stdout
    assert "  pressure lines  A (units 1-2), B (unit 3)\n" in text
    assert facts(call, "three_unit.yaml")["pressure_lines"] is None


def test_loads_are_listed_in_the_finger_s_frame(call: Call) -> None:
    assert facts(call, "three_unit.yaml")["loads"] is None
    settings = ("-s", "loads={tip_force_N: [0, -0.1], tip_moment_N_mm: 2, unit_mass_g: [10, 0, 5]}")
    plan = facts(call, "three_unit.yaml", *settings)
    assert "load" in plan["terms"]
    assert plan["left_out"][0]["what"] == "pressure and contact"
    loads = plan["loads"]
    assert (loads["tip_force_N"], loads["tip_moment_N_mm"]) == ([0.0, -0.1], 2.0)
    assert loads["unit_weight_N"] == pytest.approx([0.0980665, 0.0, 0.04903325])
    assert loads["gravity_direction"] == [-1.0, 0.0]
    tilted = ("-s", "gripper={base_spacing_mm: 60, mounting_angle_deg: 90}")
    turned = facts(call, "three_unit.yaml", *settings, *tilted)["loads"]
    assert turned["gravity_direction"] == pytest.approx([0.0, 1.0], abs=1e-15)
    text = call("explain", "three_unit.yaml", *settings).stdout
    said = "tip force (0, -0.1) N; couple on the end 2 N mm; weight of 0.09807/0/0.04903 N a unit"
    assert f"  loads           {said} along (-1, 0), on its chamber's middle (assumed)\n" in text


def test_rigid_bars_are_left_out_by_name(call: Call) -> None:
    plan = facts(call, "three_unit.yaml", *RIGID)
    assert plan["terms"] == ["bistable", "hinge"]
    assert any("bar" in part["what"] for part in plan["left_out"])


def test_a_wrong_spec_is_no_plan(call: Call) -> None:
    result = call("explain", "three_unit.yaml", "-s", "finger.units=0")
    assert (result.exit_code, result.stdout) == (2, "")


def test_what_predict_refuses_explain_refuses(call: Call) -> None:
    for arguments in (("--columns", "nope"), ("--tolerance", "1"), ("--pattern", "2")):
        asked = ("three_unit.yaml", *arguments)
        assert call("explain", *asked).stderr == call("predict", *asked).stderr


FITTED = """\
calibration_version: 1
made_by: hand
method: none
values: {bistable_stiffness_N_per_mm: {value: 13, standard_error: 0.25}}
geometry: {dome_height_mm: 6.5, dome_thickness_mm: 0.75, elastic_modulus_MPa: 26}
"""
BY_FILE = ("three_unit.yaml", "-s", "finger.calibration=[fitted.yaml, published]")


def test_values_of_a_file_have_their_error_and_its_name(call: Call, folder: Path) -> None:
    (folder / "fitted.yaml").write_text(FITTED)
    sources = {source["key"]: source for source in facts(call, *BY_FILE)["sources"]}
    assert sources["bistable_stiffness_N_per_mm"] == {
        "key": "bistable_stiffness_N_per_mm",
        "units": "1-3",
        "value": 13.0,
        "origin": "calibrated",
        "rule": "from fitted.yaml",
        "standard_error": 0.25,
    }
    assert sources["force_linearity"]["standard_error"] is None
    text = call("explain", *BY_FILE).stdout
    assert "calibrated    from fitted.yaml (± 0.25)" in text


def test_uncertainty_is_left_out_until_it_is_asked_for(call: Call, folder: Path) -> None:
    (folder / "fitted.yaml").write_text(FITTED)
    plan = facts(call, *BY_FILE)
    assert not [name for name in plan["columns"] if "uncertainty" in name]
    assert any("--uncertainty" in part["why"] for part in plan["left_out"])
    asked = facts(call, *BY_FILE, "--uncertainty")
    assert asked["columns"][-4:] == [
        "tip_x_uncertainty_mm",
        "tip_y_uncertainty_mm",
        "tip_angle_uncertainty_rad",
        "uncertainty_covers",
    ]
    nothing = facts(call, "three_unit.yaml")
    assert not any("--uncertainty" in part["why"] for part in nothing["left_out"])


def test_long_fingers_are_pairs_of_halves_under_every_law(call: Call) -> None:
    long = ("twenty_unit.yaml", "-s", "finger.units=14", "--columns", "tip_x_mm")
    assert facts(call, *long)["method"] == "pairs of half-fingers"
    pushing = facts(call, *long, "-s", "finger.law=push_only")
    assert (pushing["method"], pushing["n_finger_solves"]) == ("pairs of half-fingers", 2**11)
