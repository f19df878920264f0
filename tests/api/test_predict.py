"""`predict`, `explain` and `validate`: specs in every form, tables for pandas and Arrow."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import dpgcli as dpg
from dpgcli.cli.main import app

Rows = Callable[..., list[dict[str, Any]]]


def test_states_as_by_the_command(printed: Rows, study: dict[str, Any]) -> None:
    rows = printed("predict", "study.yaml", "--pattern", "1*1", "--columns", "default,nodes")
    found = dpg.predict("study.yaml", patterns="1*1", columns=("default", "nodes"))
    assert found.to_pandas().to_dict("records") == rows
    assert found.to_arrow().to_pylist() == rows
    assert (
        dpg.predict(study, patterns=["1*1"], columns="default,nodes")
        .to_pandas()
        .equals(found.to_pandas())
    )


def test_values_are_specs(folder: Path, study: dict[str, Any]) -> None:
    lattice = {
        key.partition("_N")[0].removesuffix("_mm"): value
        for key, value in study["finger"]["lattice"].items()
    }
    finger = dpg.uniform_finger(3, **lattice, linear_stiffness=1e4)
    scene = dpg.explain("study.yaml").scene
    expected = dpg.predict("study.yaml").to_pandas()
    for value in (finger, scene, Path("study.yaml")):
        assert dpg.predict(value).to_pandas().equals(expected)


@pytest.mark.parametrize("units", [2, np.int64(2)])
def test_settings_are_values_by_key(folder: Path, units: int) -> None:
    settings = {"finger.units": units, "finger.linear_stiffness_N_per_mm": float("inf")}
    plan = dpg.explain("study.yaml", settings=settings)
    assert (plan.n_states, plan.scene.finger.is_rigid) == (4, True)
    texts = ["finger.units=2", "finger.linear_stiffness_N_per_mm=.inf"]
    assert dpg.explain("study.yaml", settings=texts).scene.sources == plan.scene.sources


def test_columns_have_units(folder: Path) -> None:
    table = dpg.predict("study.yaml").table
    assert (len(table), table.units["tip_x_mm"], table.units["pattern"]) == (8, "mm", "")
    assert table["tip_x_mm"].dtype == np.float64
    assert repr(table).startswith("Table(8 rows: pattern, status, tip_x_mm")


def test_a_saved_table_has_the_bytes_of_the_command(folder: Path) -> None:
    CliRunner().invoke(app, ["predict", "study.yaml", "-o", "command.parquet"])
    found = dpg.predict("study.yaml")
    found.save("function.parquet")
    assert Path("function.parquet").read_bytes() == Path("command.parquet").read_bytes()
    assert pd.read_parquet("function.parquet").equals(found.to_pandas())
    metadata = pq.read_schema("function.parquet").metadata
    assert metadata[b"dpg.spec"].startswith(b'{"finger":{')
    assert Path("function.run.json").exists()
    with pytest.raises(dpg.UsageError, match=r"study.yaml is the spec or data that is read"):
        found.save("study.yaml")


def test_a_figure_has_at_most_64_states(folder: Path) -> None:
    dpg.predict("study.yaml").draw("states.svg")
    assert "<svg" in Path("states.svg").read_text()
    many = dpg.predict("study.yaml", settings={"finger.units": 7}, columns="states")
    with pytest.raises(dpg.UsageError, match=r"^plot draws at most 64 states, not 128: .* patt"):
        many.draw("many.svg")
    with pytest.raises(dpg.UsageError, match=r"^sketch draws at most 64 states, not 128: .* patt"):
        many.sketch()


def test_figures_and_sketches_are_those_of_the_command(folder: Path) -> None:
    run = CliRunner().invoke
    options = ("--plot", "command.svg", "--overlay", "--sketch", "-q")
    result = run(app, ["predict", "study.yaml", *options], env={"COLUMNS": "60"})
    found = dpg.predict("study.yaml")
    found.draw("function.svg", overlay=True)
    assert Path("function.svg").read_bytes() == Path("command.svg").read_bytes()
    assert result.stdout.endswith(f"\n\n{found.sketch(60)}\n")
    found.draw("panels.svg")
    assert Path("panels.svg").read_bytes() != Path("command.svg").read_bytes()


@pytest.mark.parametrize(
    ("asked", "error", "message"),
    [
        ({"tolerance": 1.0}, dpg.UsageError, r"^tolerance 1.0: expected 1e-14"),
        ({"target_error": -1.0}, dpg.UsageError, r"^target_error -1.0 mm: expected a length"),
        (
            {"target_error": 1.0, "tolerance": 1e-6},
            dpg.UsageError,
            "^target_error chooses the tolerance: drop tolerance$",
        ),
        ({"formulation": "net"}, dpg.UsageError, "^formulation 'net': expected chain or lattice"),
        ({"columns": "height"}, dpg.UsageError, "^columns: height unknown for this scene"),
        ({"columns": "uncertainty"}, dpg.UsageError, "^uncertainty: no value of the spec has"),
        ({"patterns": "1x1"}, dpg.UsageError, "^patterns '1x1': expected digits"),
        ({"patterns": "11"}, dpg.NothingSelectedError, "^no pattern of 3 units matches 11"),
        ({"settings": {"finger.unit": 3}}, dpg.SpecError, "^settings: finger.unit: expected a kn"),
        ({"settings": ["finger"]}, dpg.SpecError, "^settings: setting: expected key.path=value"),
    ],
)
def test_errors_name_fields(
    folder: Path, asked: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        dpg.predict("study.yaml", **asked)


def test_settings_change_no_value(folder: Path) -> None:
    scene = dpg.explain("study.yaml").scene
    with pytest.raises(dpg.UsageError, match=r"^settings change a spec, not a finger's values"):
        dpg.predict(scene, settings={"finger.units": 2})


def test_what_is_left_out_names_fields(folder: Path) -> None:
    why = {omission.what: omission.why for omission in dpg.explain("study.yaml").omissions}
    assert why["nodes columns"] == "given on request: nodes"


def test_all_problems_of_all_specs(folder: Path, study: dict[str, Any]) -> None:
    assert dpg.validate("study.yaml", study) == ()
    del study["finger"]["lattice"]["stroke_mm"]
    problems = dpg.validate("study.yaml", study, settings={"finger.units": 0})
    assert [(problem.file, problem.key) for problem in problems] == [
        ("settings", "finger.units"),
        ("settings", "finger.units"),
    ]
    assert [problem.key for problem in dpg.validate(study)] == ["finger.lattice.stroke_mm"]
