"""`dpg transitions`: rows in every format, files, what is refused, and readers that stop early."""

import csv
import io
import json
import signal
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from dpgcli.cli.exits import ExitCode

pytestmark = pytest.mark.slow

NAMES = [
    *("pattern", "line", "direction", "pressure_MPa", "unit", "reached_at_pressure"),
    *("pattern_after", "tie", "note"),
]
LINES = ("-s", "pressure.lines={A: 1-2, B: 3}")


def test_rows_are_the_same_in_every_format(call: Any) -> None:
    table, as_csv, as_json = (
        call("transitions", "three_unit.yaml", *LINES, "-q", "--format", form)
        for form in ("table", "csv", "json")
    )
    assert [r.exit_code for r in (table, as_csv, as_json)] == [ExitCode.DONE] * 3
    head, *lines = table.stdout.splitlines()
    assert head.split() == NAMES
    rows = list(csv.DictReader(io.StringIO(as_csv.stdout)))
    objects = json.loads(as_json.stdout)
    assert list(rows[0]) == list(objects[0]) == NAMES
    assert len(rows) == len(objects) == len(lines) == 32
    for row, said in zip(rows, objects, strict=True):
        pressure = said["pressure_MPa"]
        assert row["pressure_MPa"] == ("nan" if pressure is None else str(pressure))
        assert (pressure is None) == bool(said["note"]) == (said["pattern_after"] == "")
        assert [row[name] for name in NAMES if name != "pressure_MPa"] == [
            said[name] for name in NAMES if name != "pressure_MPa"
        ]
    assert table.stderr == ""


def test_the_summary_is_no_data(call: Any) -> None:
    result = call("transitions", "three_unit.yaml", *LINES, "--format", "csv")
    assert "reachable from rest: 4 states: 000, 001, 110, 111" in result.stderr
    assert "not reachable from rest with these lines: 4 states" in result.stderr
    assert "reachable" not in result.stdout


def test_scatter_comes_with_draws_and_a_seed(call: Any) -> None:
    scatter = ("--scatter", "stroke_mm=1%", "--draws", "20", "--format", "csv")
    first, again, other = (
        call("transitions", "three_unit.yaml", *scatter, "--seed", seed).stdout for seed in "112"
    )
    assert first == again != other
    assert first.splitlines()[0].endswith(",pressure_low_MPa,pressure_high_MPa")
    refused = call("transitions", "three_unit.yaml", "--draws", "20")
    assert refused.exit_code == ExitCode.USAGE
    assert "--draws goes with --scatter" in refused.stderr


def test_files(call: Any, folder: Path) -> None:
    files = ("-o", "t.parquet", "--graph", "g.graphml", "--plot", "p.png")
    result = call("transitions", "three_unit.yaml", *files)
    assert result.exit_code == ExitCode.DONE
    assert pq.read_table(folder / "t.parquet").column_names == NAMES
    assert (folder / "g.graphml").read_text(encoding="utf-8").count("<node ") == 8
    assert (folder / "p.png").read_bytes().startswith(b"\x89PNG")
    assert call("transitions", "three_unit.yaml", *files).exit_code == ExitCode.DONE


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--graph", "g.gml"), ".graphml"),
        (("-o", "t.csv"), "writes Parquet"),
        (("--plot", "p.pdf"), ".svg or .png"),
        (("--plot", "p.svg", "-s", "finger.units=7"), "--plot draws at most 64 states, not 128"),
        (("-o", "x.parquet", "--graph", "x.parquet"), ".graphml"),
        (("-s", "finger.units=17"), "expected at most 16"),
        (("--graph", "none/g.graphml"), "cannot write"),
        (("-s", "pressure.lines={A: 1-2}"), "pressure.lines"),
        (("-s", "pressure.lines={A: 1-2, B: 2-3}"), "pressure.lines"),
        (("-s", "pressure.effective_area_mm2=0"), "pressure.effective_area_mm2"),
    ],
)
def test_what_is_refused_before_any_work(
    call: Any, folder: Path, arguments: tuple[str, ...], said: str
) -> None:
    before = {path.name for path in folder.iterdir()}
    result = call("transitions", "three_unit.yaml", *arguments)
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr
    assert result.stdout == ""
    assert {path.name for path in folder.iterdir()} == before


def test_a_spec_that_is_not_there(call: Any) -> None:
    assert call("transitions", "none.yaml").exit_code == ExitCode.USAGE


def test_a_reader_that_stops_early_ends_it_quietly(start: Any) -> None:
    program = start("transitions", "three_unit.yaml", "-s", "finger.units=6", "--format", "csv")
    assert program.stdout is not None
    assert program.stdout.readline().startswith(b"pattern,line")
    program.stdout.close()
    assert program.wait(60) == 0


def test_an_interrupt_leaves_no_file(start: Any, folder: Path) -> None:
    import time

    program = start("transitions", "three_unit.yaml", "-s", "finger.units=13", "-o", "t.parquet")
    time.sleep(3.0)
    program.send_signal(signal.SIGINT)
    assert program.wait(60) == 130
    assert not [path for path in folder.iterdir() if path.name.startswith("t.parquet")]


@pytest.mark.parametrize(("lines", "is_long"), [((), False), (LINES, True)])
def test_what_may_take_long_is_said_before_by_law(
    call: Any, monkeypatch: pytest.MonkeyPatch, lines: tuple[str, ...], is_long: bool
) -> None:
    """By a curve: 16 directions of three units on one line are short, 32 on two here are not."""
    monkeypatch.setattr("dpgcli.actuation.costs.LONG", 12.0)
    by_curve = ("-s", "finger.calibration=finite_elements", "-s", "finger.law=push_only")
    found = call("transitions", "three_unit.yaml", *by_curve, *lines, "--format", "csv")
    said = "32 directions of 8 patterns: 0 to 16 s"
    assert (found.stderr.splitlines()[0] == said) is is_long
    assert said not in found.stdout
    quiet = call("transitions", "three_unit.yaml", *by_curve, *lines, "-q", "--format", "csv")
    assert quiet.stderr == ""
