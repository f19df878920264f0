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
