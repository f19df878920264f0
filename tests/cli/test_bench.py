"""`dpg bench`: tables, files, figures and messages."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from dpgcli.benchmark import bench as module
from dpgcli.cli.exits import ExitCode

pytestmark = pytest.mark.slow

BENCH = ("bench", "three_unit.yaml", "--repeats", "1")


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short growth tables and small batches."""
    monkeypatch.setattr(module, "GROWTH_UNITS", (1,))
    monkeypatch.setattr(module, "GROWTH_DESIGNS", (2,))
    monkeypatch.setattr(module, "GROWTH_RATIOS", (1e4,))
    monkeypatch.setattr(module, "TABLE_UNITS", 3)
    monkeypatch.setattr(module, "BATCH", 8)
    monkeypatch.setattr(module, "PEER_STATES", 1)
    monkeypatch.setattr("dpgcli.benchmark.timing.SHORTEST_ROUND", 0.0)


def test_tables_a_figure_in_text_and_the_cheapest_way(call: Any) -> None:
    result = call(*BENCH, "--target-error", "1um", "--keep", "every-unit")
    assert result.exit_code == ExitCode.DONE
    for title in ("Methods, with a batch", "state by state", "Softer and stiffer bars", "put back"):
        assert title in result.stdout
    assert "largest tip error, mm" in result.stdout
    assert result.stdout.splitlines()[-1].startswith("cheapest below 0.001 mm: ")
    assert result.stderr == ""


def test_a_spec_with_a_disc_has_its_states(call: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dpgcli.benchmark.contacts.BATCH", 4)
    monkeypatch.setattr(module, "TOUCHING_STATES", 2)
    disc = ("-s", "object={disc: {diameter_mm: 16}, at_mm: [25, -14]}")
    result = call(*BENCH, *disc)
    assert result.exit_code == ExitCode.DONE
    _, _, table = result.stdout.partition("The states against the spec's body\n\n")
    heads, *lines = table.split("\n\n")[0].splitlines()
    assert heads.split()[:3] == ["method", "certified", "n_missing"]
    assert [line.split("  ")[0] for line in lines] == [
        "this package, 2 states at once",
        "this package, 4 states at once",
        "SciPy SLSQP",
        "SciPy trust-constr",
    ]
    assert "spec's disc" not in call(*BENCH).stdout


def test_all_rows_in_files(call: Any, folder: Path) -> None:
    options = ("-o", "b.parquet", "--json", "b.json", "--plot", "b.svg", "--format", "csv")
    result = call(*BENCH, *options)
    assert result.exit_code == ExitCode.DONE
    table = pd.read_parquet(folder / "b.parquet")
    record = json.loads((folder / "b.json").read_text())
    assert list(table) == [column.name for column in module.COLUMNS]
    assert len(record["rows"]) == len(table) == len(result.stdout.splitlines()) - 1
    assert record["numpy"] == np.__version__
    ladder = table[table["group"] == "ladder"].set_index("method")
    assert ladder.loc["chain, 1e-12", "max_tip_error_mm"] < 1e-12
    figure = (folder / "b.svg").read_text()
    assert "largest tip error (mm)" in figure
    assert "wall time per state (s)" in figure


def test_what_got_slower_is_said(call: Any, folder: Path) -> None:
    assert call(*BENCH, "--json", "b.json", "-q").exit_code == ExitCode.DONE
    record = json.loads((folder / "b.json").read_text())
    for row in record["rows"]:
        row["relative_time"] *= 1e-3 if row["method"] == "chain, 1e-09" else 1e3
    (folder / "b.json").write_text(json.dumps(record))
    result = call(*BENCH, "--compare", "b.json", "--format", "json")
    assert json.loads(result.stdout)
    verdict, *slower = result.stderr.splitlines()
    assert verdict.endswith("2 slower by more than 2.0")
    assert all("chain, 1e-09, 3 units" in line for line in slower)


def test_a_record_of_another_finger_or_of_nothing_is_refused(call: Any, folder: Path) -> None:
    assert call(*BENCH, "--json", "b.json", "-q").exit_code == ExitCode.DONE
    other = ("-s", "finger.geometry.chamber_length_mm=20", "--compare", "b.json")
    result = call(*BENCH, *other)
    assert result.exit_code == ExitCode.USAGE
    assert "of another finger, differs in spec.finger.geometry.chamber_length_mm" in result.stderr
    for rows in ([{"group": []}], [{"method": "chain", "relative_time": "1"}], [3], {}):
        (folder / "b.json").write_text(json.dumps({"rows": rows}))
        result = call(*BENCH, "--compare", "b.json")
        assert result.exit_code == ExitCode.USAGE
        assert "b.json is no record of dpg bench --json" in result.stderr


def test_a_record_is_json_as_the_standard_has_it(call: Any, folder: Path) -> None:
    options = ("-s", "finger.linear_stiffness_N_per_mm=.inf", "--json", "b.json", "-q")
    assert call(*BENCH, *options).exit_code == ExitCode.DONE
    record = json.loads((folder / "b.json").read_text(), parse_constant=pytest.fail)
    assert {row["stiffness_ratio"] for row in record["rows"]} >= {".inf"}


def test_the_models_own_error(call: Any, folder: Path) -> None:
    (folder / "fe.csv").write_text(
        "# measured by hand\npattern,tip_y_mm,tip_x_mm\n111,-14,36\n000,0,40.5\n"
    )
    result = call(*BENCH, "--against", "fe.csv")
    assert "the lattice's own error against the data given, 3.3 mm" in result.stdout


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("pattern,tip_x_mm\n111,3\n", "a column tip_x_mm and tip_y_mm, or tip_angle_rad, found"),
        ("pattern,tip_x_mm,tip_y_mm\n", "expected rows below the header, found none"),
        (
            "pattern,tip_x_mm,tip_y_mm\n11,1,2\n",
            "fe.csv:2: pattern: expected 3 digits 0 and 1",
        ),
        (
            "pattern,tip_x_mm,tip_y_mm\n111,1,2\n101,x,2\n",
            "fe.csv:3: tip_x_mm: expected a number",
        ),
        ("pattern,tip_x_mm,tip_y_mm\n111,1,nan\n", "fe.csv:2: tip_y_mm: expected a number"),
        ("pattern,tip_x_mm,tip_y_mm\n111,1,1e300\n", "fe.csv:2: tip_y_mm: expected a number"),
        (
            "pattern,tip_x_mm,tip_y_mm\n\n# b\n111,1,2\n111,1,2\n",
            "fe.csv:5: pattern: expected each pattern once, or once for each moment_N_mm, found",
        ),
        ("pattern,tip_x_mm,tip_y_mm\n111,1,2,3\n", "fe.csv:2: row: expected 3 cells, found 4"),
        ("", "fe.csv: file: expected a header and rows, found nothing"),
    ],
)
def test_data_that_cannot_be_used(call: Any, folder: Path, content: str, said: str) -> None:
    (folder / "fe.csv").write_text(content)
    result = call(*BENCH, "--against", "fe.csv")
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--keep", "gravity"), "--keep gravity: expected bars, hinges, "),
        (("--keep", "second-finger"), "this scene leaves out every-unit, every-column"),
        (("--plot", "b.pdf"), "expected a name that ends in .svg or .png"),
        (("--target-error", "soon"), "--target-error soon: expected a length > 0 in mm"),
        (("--target-error", "0"), "--target-error 0: expected a length > 0 in mm"),
        (("--output", "three_unit.yaml"), "three_unit.yaml is the spec or data that is read"),
        (("--output", "b.csv"), "--output b.csv: writes Parquet"),
        (("--output", "b", "--json", "b"), "expected names that differ"),
        (("--json", "none/b.json"), "cannot write none/b.json"),
        (("--plot", "none/b.svg"), "cannot write none/b.svg"),
        (("--against", "none.csv"), "none.csv: file: expected a readable file"),
        (("--compare", "three_unit.yaml"), "not JSON"),
        (("--compare", "none.json"), "cannot read none.json: No such file"),
        (("--repeats", "0"), "--repeats"),
        (("-s", "finger.law=push_only"), "the published law only, not the push-only law"),
    ],
)
def test_options_that_make_no_sense(call: Any, options: tuple[str, ...], said: str) -> None:
    result = call(*BENCH, *options)
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr
    assert result.stdout == ""


def test_without_mpmath(call: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    result = call(*BENCH)
    assert result.exit_code == ExitCode.USAGE
    assert "dpg bench needs mpmath: pip install mpmath" in result.stderr


def test_rigid_bars_have_no_peers(call: Any) -> None:
    options = ("-s", "finger.linear_stiffness_N_per_mm=.inf", "--keep", "bars")
    result = call(*BENCH, *options)
    assert result.exit_code == ExitCode.DONE
    assert "What one would do instead" not in result.stdout
    assert "bars put back" in result.stdout
