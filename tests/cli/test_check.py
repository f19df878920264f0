"""`dpg check`: exit codes, what is listed, and the summary for GitHub."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dpgcli.cli.check import LARGEST_SUMMARY, NOTE
from dpgcli.cli.exits import ExitCode

Call = Callable[..., Any]
N_DESIGNS = 30


@pytest.fixture
def table(folder: Path) -> str:
    """Thirty designs of area 0 … 29; the last is invalid."""
    last = [False] * (N_DESIGNS - 1) + [True]
    columns = {
        "design": list(range(N_DESIGNS)),
        "height_mm": [place / 2 for place in range(N_DESIGNS)],
        "calibration": ["given"] * N_DESIGNS,
        "status": ["invalid" if is_last else "stable" for is_last in last],
        "reason": ["100%\nwrong" if is_last else "" for is_last in last],
        "n_stable": [0 if is_last else 8 for is_last in last],
        "area_mm2": [float("nan") if last[place] else float(place) for place in range(N_DESIGNS)],
    }
    pq.write_table(pa.table(columns), folder / "designs.parquet")
    return "designs.parquet"


@pytest.mark.parametrize(
    ("rules", "code"),
    [
        (["area_mm2 >= 0"], ExitCode.REQUIREMENT),  # the invalid design
        (["n_stable >= 0", "area_mm2 > 100"], ExitCode.REQUIREMENT),
        (["aria_mm2 > 0"], ExitCode.USAGE),
        (["area_mm2 >"], ExitCode.USAGE),
        (["area_mm2"], ExitCode.USAGE),
        ([], ExitCode.USAGE),
    ],
)
def test_exit_codes(call: Call, table: str, rules: list[str], code: int) -> None:
    options = [word for rule in rules for word in ("--require", rule)]
    assert call("check", table, *options).exit_code == code


def test_a_requirement_is_1_and_nothing_else_is() -> None:
    assert ExitCode.REQUIREMENT == 1


def test_what_all_meet_is_0(call: Call, folder: Path, table: str) -> None:
    pq.write_table(pq.read_table(folder / table).slice(0, 5), folder / "few.parquet")
    result = call("check", "few.parquet", "--require", "area_mm2 < 5", "--require", "area_mm2 >= 0")
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout == "met: area_mm2 < 5: all 5 designs\nmet: area_mm2 >= 0: all 5 designs\n"


def test_a_summary_is_not_appended_to_the_table(call: Call, folder: Path, table: str) -> None:
    before = (folder / table).read_bytes()
    result = call("check", table, "--require", "n_stable >= 0", "--summary-file", table)
    assert result.exit_code == ExitCode.USAGE
    assert "is the spec or data that is read: give another name" in result.stderr
    assert (folder / table).read_bytes() == before


def test_an_unknown_column_names_the_nearest(call: Call, table: str) -> None:
    result = call("check", table, "--require", "aria_mm2 > 0")
    assert result.stdout == ""
    assert "no column aria_mm2 of numbers; the nearest is area_mm2" in result.stderr


def test_at_most_twenty_designs_are_listed(call: Call, table: str) -> None:
    result = call("check", table, "--require", "area_mm2 >= 28")
    lines = result.stdout.splitlines()
    assert lines[0] == "not met: area_mm2 >= 28: 29 of 30 designs"
    assert lines[1] == "  design 0 (height_mm = 0): area_mm2 = 0"
    assert lines[20] == "  design 19 (height_mm = 9.5): area_mm2 = 19"
    assert lines[21:] == ["  and 9 more"]


def test_twenty_need_no_rest(call: Call, table: str) -> None:
    lines = call("check", table, "--require", "area_mm2 >= 19").stdout.splitlines()
    assert len(lines) == 21
    assert lines[-1] == "  design 29 (height_mm = 14.5): invalid: 100% wrong"


def test_json_lists_all_and_has_no_nan(call: Call, table: str) -> None:
    result = call("check", table, "--require", "area_mm2 >= 28", "--format", "json")
    (verdict,) = json.loads(result.stdout, parse_constant=lambda name: pytest.fail(name))
    assert result.exit_code == ExitCode.REQUIREMENT
    assert (verdict["requirement"], verdict["is_met"]) == ("area_mm2 >= 28", False)
    assert (verdict["n_checked"], verdict["n_failing"]) == (30, 29)
    assert len(verdict["failing"]) == 29
    assert verdict["failing"][3] == {
        "design": 3,
        "values": {"height_mm": 1.5},
        "found": {"area_mm2": 3.0},
        "status": "stable",
        "reason": "",
    }
    assert verdict["failing"][-1]["found"] == {"area_mm2": None}


@pytest.mark.parametrize("value", [float("inf"), float("-inf"), float("nan")])
def test_json_has_no_number_that_is_none(
    call: Call, folder: Path, table: str, value: float
) -> None:
    """Among swept values, as of rigid bars, and among what was found."""
    columns = pq.read_table(folder / table).to_pydict()
    for name in ("height_mm", "area_mm2"):
        columns[name] = [value] * N_DESIGNS
    pq.write_table(pa.table(columns), folder / "designs.parquet")
    result = call("check", table, "--require", "area_mm2 == 1", "--format", "json")
    (verdict,) = json.loads(result.stdout, parse_constant=lambda name: pytest.fail(name))
    assert verdict["failing"][0]["values"] == {"height_mm": None}
    assert verdict["failing"][0]["found"] == {"area_mm2": None}


@pytest.mark.parametrize("form", ["text", "json", "github"])
def test_a_table_of_a_sweep_that_went_through_csv(call: Call, folder: Path, form: str) -> None:
    sweep = "base: three_unit.yaml\nspace:\n  - {key: finger.units, values: [1, 2]}\n"
    (folder / "sweep.yaml").write_text(sweep)
    assert call("sweep", "sweep.yaml", "-q", "-o", "out", "-j", "1").exit_code == 0
    rules = ("--require", "n_stable > 2", "--format", form)
    before = call("check", "out/designs.parquet", *rules)
    pd.read_parquet(folder / "out" / "designs.parquet").to_csv(folder / "t.csv", index=False)
    pd.read_csv(folder / "t.csv").to_parquet(folder / "t.parquet")
    after = call("check", "t.parquet", *rules)
    assert before.exit_code == after.exit_code == ExitCode.REQUIREMENT
    assert before.stdout == after.stdout != ""


def test_a_damaged_table_is_no_table(call: Call, folder: Path) -> None:
    sweep = "base: three_unit.yaml\nspace:\n  - {key: finger.units, values: [1, 2]}\n"
    (folder / "sweep.yaml").write_text(sweep)
    run = ("sweep", "sweep.yaml", "-o", "out", "-j", "1")
    assert call(*run).exit_code == 0
    path = folder / "out" / "designs.parquet"
    content = path.read_bytes()
    path.write_bytes(content[:50] + bytes([content[50] ^ 1]) + content[51:])
    for command in (
        ("check", "out/designs.parquet", "--require", "n_stable > 0"),
        ("report", "out"),
    ):
        result = call(*command)
        assert (result.exit_code, result.stdout) == (ExitCode.USAGE, "")
        assert "out/designs.parquet is damaged" in result.stderr
    again = call(*run)
    assert again.exit_code == 0
    assert "dpg" not in again.stderr.splitlines()[0]
    assert again.stderr.startswith("out/designs.parquet is damaged: made again\n")
    assert path.read_bytes() == content


def test_github_shows_nine_and_how_many_more(call: Call, table: str) -> None:
    rules = ("--require", "area_mm2 >= 4", "--require", "n_stable > 8")
    lines = call("check", table, *rules, "--format", "github").stdout.splitlines()
    assert len(lines) == 10
    assert lines[0] == "::error ::area_mm2 >= 4: design 0 (height_mm = 0): area_mm2 = 0"
    assert lines[4] == (
        "::error ::area_mm2 >= 4: design 29 (height_mm = 14.5): invalid: 100%25 wrong"
    )
    assert lines[5] == "::error ::n_stable > 8: design 0 (height_mm = 0): n_stable = 8"
    assert lines[9] == "::error ::and 26 more"


def test_the_verdict_stands_when_nobody_reads_it(run: Any, table: str) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    result = run("check", table, "--require", "area_mm2 > 5", stdout=writer)
    os.close(writer)
    assert (result.returncode, result.stderr) == (ExitCode.REQUIREMENT, "")


def test_a_space_with_nothing_to_check_is_5(call: Call, folder: Path, table: str) -> None:
    pq.write_table(pq.read_table(folder / table).slice(0, 0), folder / "none.parquet")
    result = call("check", "none.parquet", "--require", "area_mm2 > 0")
    assert (result.exit_code, result.stdout) == (ExitCode.NOTHING_SELECTED, "")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("missing.parquet", "No such file"),
        (".", "is a folder"),
        ("three_unit.yaml", "not a Parquet file"),
        ("cut.parquet", "not a Parquet file"),
        ("states.parquet", "no table of designs: no column design, calibration, reason"),
    ],
)
def test_what_is_no_table_of_designs_is_2(
    call: Call, folder: Path, table: str, name: str, said: str
) -> None:
    (folder / "cut.parquet").write_bytes((folder / table).read_bytes()[:-20])
    states = pa.table({"status": ["stable"], "n_stable": [1]})
    pq.write_table(states, folder / "states.parquet")
    result = call("check", name, "--require", "n_stable > 0")
    assert (result.exit_code, result.stdout) == (ExitCode.USAGE, "")
    assert said in result.stderr
    assert "Traceback" not in result.stderr


def test_the_summary_is_appended(call: Call, folder: Path, table: str) -> None:
    summary = folder / "summary.md"
    summary.write_text("before\n", encoding="utf-8")
    call("check", table, "--require", "area_mm2 < 2", "--summary-file", "summary.md")
    lines = summary.read_text(encoding="utf-8").splitlines()
    assert lines[:5] == ["before", "", "# Requirements", "", lines[4]]
    assert lines[4] == r"not met: area_mm2 \< 2: 28 of 30 designs"
    assert "| design 2 (height_mm = 1): area_mm2 = 2 |" in lines
    assert lines[-1] == "| design 29 (height_mm = 14.5): invalid: 100% wrong |"


def test_a_summary_stays_within_what_github_takes(call: Call, folder: Path, table: str) -> None:
    summary = folder / "summary.md"
    arguments = ("check", table, "--require", "area_mm2 < 2", "--summary-file", "summary.md")
    full = "x" * (LARGEST_SUMMARY - 200)
    summary.write_text(full, encoding="utf-8")
    result = call(*arguments)
    assert result.exit_code == ExitCode.REQUIREMENT
    assert "no room" in result.stderr
    assert summary.read_text(encoding="utf-8") == f"{full}\n{NOTE}"
    full = "x" * (LARGEST_SUMMARY - 5)
    summary.write_text(full, encoding="utf-8")
    assert call(*arguments).exit_code == ExitCode.REQUIREMENT
    assert summary.read_text(encoding="utf-8") == full


def test_a_summary_fits_to_the_byte(call: Call, folder: Path, table: str) -> None:
    summary = folder / "summary.md"
    arguments = ("check", table, "--require", "area_mm2 < 2", "--summary-file", "summary.md")
    call(*arguments)
    length = summary.stat().st_size
    for spare, is_whole in ((0, True), (-1, False)):
        summary.write_text("x" * (LARGEST_SUMMARY - length - 1 - spare), encoding="utf-8")
        call(*arguments)
        assert (summary.stat().st_size == LARGEST_SUMMARY) is is_whole
        assert (NOTE in summary.read_text(encoding="utf-8")) is not is_whole


def test_a_summary_that_cannot_be_written_is_2(call: Call, table: str) -> None:
    result = call(
        "check", table, "--require", "area_mm2 < 2", "--summary-file", "missing/summary.md"
    )
    assert result.exit_code == ExitCode.USAGE
    assert "cannot write missing/summary.md" in result.stderr


@pytest.mark.parametrize(("limit", "code"), [("2", 1), ("5", 2)])
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_under_the_summary_hides_no_verdict(
    call: Call, folder: Path, table: str, limit: str, code: int
) -> None:
    pq.write_table(pq.read_table(folder / table).slice(0, 5), folder / "few.parquet")
    rule = ("check", "few.parquet", "--require", f"area_mm2 < {limit}")
    result = call(*rule, "--summary-file", "/dev/full")
    assert result.exit_code == code
    assert result.stdout == call(*rule).stdout != ""
    assert "dpg: cannot write /dev/full: No space left on device" in result.stderr


@pytest.mark.parametrize(("limit", "code"), [("9", 1), ("2", 2)])
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_under_the_summary_of_a_sweep(
    call: Call, folder: Path, limit: str, code: int
) -> None:
    text = "base: three_unit.yaml\nspace: [{key: finger.units, values: [3]}]\n"
    (folder / "sweep.yaml").write_text(text, encoding="utf-8")
    run = ("sweep", "sweep.yaml", "-q", "-o", "out", "--executor", "serial")
    result = call(*run, "--require", f"n_units > {limit}", "--summary-file", "/dev/full")
    assert result.exit_code == code
    assert f"met: n_units > {limit}" in result.stdout
    assert "dpg: cannot write /dev/full: No space left on device" in result.stderr
