"""`dpg pulses`: rows in every format, exit codes, what is refused, readers that stop early."""

import csv
import io
import json
import signal
from typing import Any

import pytest

from dpgcli.cli.exits import ExitCode

pytestmark = pytest.mark.slow

LINES = ("-s", "pressure.lines={A: 1-2, B: 3}")
NAMES = [
    *("pulse", "line", "peak_pressure_MPa", "margin_MPa", "pattern_before", "pattern_at_peak"),
    *("pattern_after", "tie"),
]


def test_rows_are_the_same_in_every_format(call: Any) -> None:
    table, as_csv, as_json = (
        call("pulses", "three_unit.yaml", "--to", "111", *LINES, "-q", "--format", form)
        for form in ("table", "csv", "json")
    )
    assert [r.exit_code for r in (table, as_csv, as_json)] == [ExitCode.DONE] * 3
    head, *lines = table.stdout.splitlines()
    assert head.split() == NAMES
    rows = list(csv.DictReader(io.StringIO(as_csv.stdout)))
    objects = json.loads(as_json.stdout)
    assert list(rows[0]) == list(objects[0]) == NAMES
    assert len(rows) == len(objects) == len(lines) == 2
    for row, said in zip(rows, objects, strict=True):
        assert {name: str(value) for name, value in said.items()} == row
    assert table.stderr == ""


def test_the_summary_is_no_data(call: Any) -> None:
    result = call("pulses", "three_unit.yaml", "--to", "111", "--format", "csv")
    assert "1 pulse from 000 to 111, the fewest there are" in result.stderr
    assert "ties in pulse 1" in result.stderr
    assert "fewest" not in result.stdout


def test_what_may_take_long_is_said_before(call: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dpgcli.actuation.costs.LONG", 0.1)
    said = "at most 16 directions of 8 patterns: 0 to 0 s"
    loud, quiet = (call("pulses", "three_unit.yaml", "--to", "111", *q) for q in ((), ("-q",)))
    assert loud.stderr.splitlines()[0] == said
    assert quiet.stderr == ""


@pytest.mark.parametrize(("form", "empty"), [("csv", ",".join(NAMES) + "\n"), ("json", "[]\n")])
def test_no_sequence_is_no_rows_and_exit_code_1(call: Any, form: str, empty: str) -> None:
    result = call("pulses", "three_unit.yaml", "--to", "101", "--format", form)
    assert result.exit_code == ExitCode.REQUIREMENT
    assert result.stdout == empty
    assert "units 1 and 2 are a tie" in result.stderr
    assert "thresholds 5% apart" in result.stderr
    quiet = call("pulses", "three_unit.yaml", "--to", "101", "--format", form, "-q")
    assert (quiet.exit_code, quiet.stdout, quiet.stderr) == (ExitCode.REQUIREMENT, empty, "")


def test_a_look_up_table(call: Any) -> None:
    result = call("pulses", "three_unit.yaml", "--table", "--from", "110", *LINES, "-q")
    assert result.exit_code == ExitCode.DONE
    head, *lines = result.stdout.splitlines()
    assert head.split() == [
        *("line", "direction", "from_MPa", "to_MPa", "pattern_at_peak", "pattern_after"),
    ]
    rows = [line.split() for line in lines]
    assert [row[:2] for row in rows] == [
        ["A", "+"], ["A", "-"], ["A", "-"], ["B", "+"], ["B", "+"], ["B", "-"],
    ]  # fmt: skip
    assert [row[-1] for row in rows] == ["110", "110", "000", "110", "111", "110"]


def test_scatter_adds_columns_and_lines(call: Any) -> None:
    scatter = ("--scatter", "dome_thickness_mm=1%,dome_height_mm=0.05mm", "--draws", "50")
    first, again = (
        call("pulses", "three_unit.yaml", "--to", "111", *scatter, "--format", "csv")
        for _ in range(2)
    )
    assert first.exit_code == ExitCode.DONE
    assert first.stdout == again.stdout
    (row,) = csv.DictReader(io.StringIO(first.stdout))
    assert list(row)[len(NAMES) :] == [
        *("probability", "probability_low", "probability_high"),
        *("window_from_MPa", "window_to_MPa"),
    ]
    assert row["window_to_MPa"] == "inf"
    assert "50 fingers drawn, seed 1: normal, dome_thickness_mm 1 %" in first.stderr
    assert "% of draws end in 111 (95% confidence:" in first.stderr
    other = call("pulses", "three_unit.yaml", "--to", "111", *scatter, "--seed", "2", "-q")
    assert other.exit_code == ExitCode.DONE


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--to", "11"), "--to 11: expected 3 digits, 0 or 1"),
        (("--to", "111", "--from", "x"), "--from x: expected 3 digits, 0 or 1"),
        ((), "expected --to or --table, one of both"),
        (("--to", "111", "--table"), "expected --to or --table, one of both"),
        (("--to", "111", "--draws", "10"), "--draws goes with --scatter"),
        (("--to", "111", "--seed", "1"), "--seed goes with --scatter"),
        (("--table", "--scatter", "stroke_mm=1%"), "--scatter goes with --to"),
        (("--to", "111", "--scatter", "stroke_mm=1%", "--draws", "0"), "--draws 0: expected 1 to"),
        (("--to", "111", "--scatter", "x=1%"), "--scatter: x: expected a key of the finger"),
    ],
)
def test_wrong_options_are_refused(call: Any, options: tuple[str, ...], message: str) -> None:
    result = call("pulses", "three_unit.yaml", *options)
    assert result.exit_code == ExitCode.USAGE
    assert message in result.stderr
    assert result.stdout == ""


def test_a_reader_that_stops_early_is_no_error(start: Any) -> None:
    process = start("pulses", "three_unit.yaml", "--table", "--format", "csv")
    process.stdout.close()
    process.stderr.read()
    assert process.wait() in (ExitCode.DONE, -signal.SIGPIPE)
