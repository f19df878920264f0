"""`compare`, `bench`, `stress` and `check` as functions, beside their commands."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import dpgcli as dpg
from dpgcli.benchmark import bench as module

Rows = Callable[..., list[dict[str, Any]]]
PUSH = Path(__file__).parents[2] / "configs" / "calibration" / "push_3.5mm.yaml"


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short growth tables and small batches."""
    monkeypatch.setattr(module, "GROWTH_UNITS", (1,))
    monkeypatch.setattr(module, "GROWTH_DESIGNS", (2,))
    monkeypatch.setattr(module, "GROWTH_RATIOS", (1e4,))
    monkeypatch.setattr(module, "TABLE_UNITS", 3)
    monkeypatch.setattr(module, "BATCH", 8)
    monkeypatch.setattr(module, "PEER_STATES", 1)
    monkeypatch.setattr("dpgcli.benchmark.timing.SHORTEST_ROUND", 0.0)


def test_a_comparison_as_by_its_command(printed: Rows, folder: Path) -> None:
    place = ("--first-station", "5.4,-0.8", "--tip-offset", "4,-0.7")
    rows = printed("compare", "study.yaml", "tips.csv", "--calibration", str(PUSH), *place)
    asked: dict[str, Any] = {"first_station": (5.4, -0.8), "tip_offset": (4.0, -0.7)}
    found = dpg.compare("study.yaml", "tips.csv", calibration=PUSH, **asked)
    assert found.table.to_arrow().to_pylist() == rows
    assert {"error_mm", "calibrated_error_mm"} <= set(rows[0])
    assert any(row["error_mm"] != row["calibrated_error_mm"] for row in rows)
    read = dpg.read_calibration(PUSH)
    frame = pd.read_csv("tips.csv", dtype={"pattern": str})
    again = dpg.compare("study.yaml", frame, calibration=read, **asked)
    assert again.table.to_pandas().equals(found.table.to_pandas())
    assert found.summary[0].startswith("5 states, errors of the model (as in the spec")
    assert found.summary[-1].startswith("22.5 s a state in the data")
    found.draw("states.svg")
    assert "predicted, calibrated" in Path("states.svg").read_text()


def test_a_calibration_changes_specs_alone(folder: Path) -> None:
    scene = dpg.explain("study.yaml").scene
    assert dpg.compare(scene, "tips.csv").calibrated is None
    with pytest.raises(dpg.UsageError, match=r"^calibration changes a spec"):
        dpg.compare(scene, "tips.csv", calibration=PUSH)


@pytest.mark.slow
def test_a_bench_in_a_table_and_a_record(quick: None, folder: Path) -> None:
    seen: list[str] = []
    found = dpg.bench(
        "study.yaml",
        repeats=1,
        target_error=1e-3,
        keep=["every-unit"],
        against="tips.csv",
        watch=lambda row: seen.append(row["group"]),
    )
    table = found.table.to_pandas()
    assert table["group"].tolist() == seen
    assert {"ladder", "peer", "model", "kept"} <= set(seen)
    assert found.findings[0].startswith("cheapest below 0.001 mm: ")
    found.save("bench.parquet")
    assert pd.read_parquet("bench.parquet").equals(table)
    found.record("bench.json")
    assert json.loads(Path("bench.json").read_text())["command"] == []
    again = dpg.bench("study.yaml", repeats=1, compare="bench.json")
    assert "compared with the record" in again.findings[0]
    with pytest.raises(dpg.UsageError, match=r"^compare bench.json: of another finger, differs"):
        dpg.bench("study.yaml", settings={"finger.units": 2}, compare="bench.json")


@pytest.mark.slow
def test_hard_cases_as_by_the_command(printed: Rows, folder: Path) -> None:
    rows = printed("stress", "--only", "scale", "-q")
    seen: list[str] = []
    found = dpg.stress(only=["scale"], watch=lambda outcome: seen.append(outcome.case.family))
    table = found.table.to_pandas()
    assert table["case"].tolist() == [row["case"] for row in rows]
    np.testing.assert_array_equal(table["residual_N"], [row["residual_N"] for row in rows])
    assert seen == ["scale"] * len(rows)
    assert found.failures == ()
    assert sum(family.n_cases for family in found.families) == len(rows)
    found.save("stress.parquet")
    assert pd.read_parquet("stress.parquet").equals(table)


def test_hard_cases_that_are_not_there(folder: Path) -> None:
    with pytest.raises(dpg.UsageError, match=r"^only foo: expected some of patterns, stiffness"):
        dpg.stress(only=["foo"])
    with pytest.raises(dpg.NothingSelectedError, match=r"^only patterns: there are none without a"):
        dpg.stress(only=["patterns"])
    with pytest.raises(dpg.UsageError, match=r"^settings changes a spec: give one"):
        dpg.stress(settings={"finger.units": 2})


def test_requirements_of_a_table(folder: Path) -> None:
    designs = pd.DataFrame(
        {
            "design": [0, 1, 2],
            "height_mm": [5.5, 6.0, 6.5],
            "calibration": "given",
            "status": ["stable", "excluded", "stable"],
            "reason": "",
            "n_stable": [8, 0, 8],
        }
    )
    met, missed = dpg.check(designs, ["n_stable == 8", "height_mm > 6"])
    assert (met.is_met, missed.is_met, missed.n_checked) == (True, False, 2)
    assert [failure.values for failure in missed.failures()] == [{"height_mm": 5.5}]
    with pytest.raises(dpg.UsageError, match=r"^require 'size > 1': no column size of numbers"):
        dpg.check(designs, "size > 1")
    with pytest.raises(dpg.UsageError, match=r"^the table is no table of designs: no column desig"):
        dpg.check(designs[["height_mm"]], "height_mm > 6")
    with pytest.raises(dpg.UsageError, match=r"^cannot read designs.parquet"):
        dpg.check("designs.parquet", "height_mm > 6")
