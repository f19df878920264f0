"""`dpg stress`: what is printed and written, and when it fails."""

import csv
import io
import json
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from dpgcli.cli.exits import ExitCode
from dpgcli.hard_cases import verdicts
from dpgcli.hard_cases.cases import Case
from dpgcli.hard_cases.outcomes import Answer, Outcome, Verdict
from dpgcli.hard_cases.table import STRESS_COLUMNS

pytestmark = pytest.mark.slow

Call = Callable[..., Any]
QUICK = ("--only", "mirror")
N_QUICK = 18


@pytest.fixture
def overconfident(monkeypatch: pytest.MonkeyPatch) -> None:
    """A solver that states errors a million times too small."""

    def boastful(case: Case) -> Answer:
        answer = honest(case)
        return replace(answer, tip_error=1e-6 * answer.tip_error)

    honest = verdicts.answered
    monkeypatch.setattr(verdicts, "answered", boastful)


def test_the_built_in_cases_need_no_spec(call: Call) -> None:
    result = call("stress", *QUICK)
    assert result.exit_code == ExitCode.DONE
    title, _, heads, *lines = result.stdout.splitlines()
    assert title == "The study's finger"
    assert heads.split()[:5] == ["family", "formulation", "cases", "right", "recognized"]
    assert lines[0].split()[:5] == ["mirror", "chain", "12", "4", "8"]
    assert lines[1].split()[:5] == ["mirror", "lattice", "6", "2", "4"]
    assert result.stderr.startswith(f"{N_QUICK} cases in ")
    assert result.stderr.endswith("12 recognized, 6 right; 0 failures\n")


def test_the_users_finger_comes_first_and_its_margins_last(call: Call) -> None:
    words = ("--only", "patterns", "--only", "mirror", "--set", "finger.units=2")
    result = call("stress", "three_unit.yaml", *words)
    assert result.exit_code == ExitCode.DONE
    sections = [block.splitlines() for block in result.stdout.split("\n\n")]
    titles = [block[0] for block in sections if len(block) == 1]
    assert titles[:2] == ["The spec's finger", "The study's finger"]
    assert titles[2].startswith("Values of each unit")
    tables = [block for block in sections if len(block) > 1]
    assert [line.split()[:3] for line in tables[0][1:3]] == [
        ["patterns", "chain", "4"],
        ["patterns", "lattice", "4"],
    ]
    assert tables[-1][1].split()[:4] == ["1-2", "0.043", "(goes", "at"]
    assert "0.0964682)" in tables[-1][1], "where the reference unit loses its second well"


def test_values_that_lose_no_well_have_no_limit(call: Call) -> None:
    """The search for limits ends somewhere; beside soft walls there is none to be found."""
    walls = ("--set", "finger.wall_compliance_mm_per_N=5", "--set", "finger.units=1")
    result = call("stress", "three_unit.yaml", "--only", "patterns", *walls, "-q")
    last = result.stdout.rstrip().splitlines()[-1]
    assert "24.2 (never goes)" in last and "3.5 (never goes)" in last
    assert "(goes at 0.104" in last


def test_graded_units_have_lines_of_their_own(call: Call) -> None:
    setting = "finger.overrides.2.geometry.dome_height_mm=7.0"
    result = call("stress", "three_unit.yaml", "--only", "patterns", "-s", setting, "-q")
    units = [line.split()[0] for line in result.stdout.rstrip().splitlines()[-3:]]
    assert units == ["1", "2", "3"]


def test_every_case_as_csv_and_json(call: Call) -> None:
    names = [column.name for column in STRESS_COLUMNS]
    as_csv = list(csv.DictReader(io.StringIO(call("stress", *QUICK, "--format", "csv").stdout)))
    assert list(as_csv[0]) == names

    def refused(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    text = call("stress", *QUICK, "--format", "json").stdout
    as_json = json.loads(text, parse_constant=refused)
    assert list(as_json[0]) == names
    assert len(as_csv) == len(as_json) == N_QUICK
    assert [row["verdict"] for row in as_csv] == [row["verdict"] for row in as_json]
    folded = next(row for row in as_json if row["verdict"] == "recognized")
    assert (folded["status"], folded["true_tip_error_mm"]) == ("folded", None)


def test_the_table_of_all_cases(call: Call, folder: Path) -> None:
    words = ("--only", "patterns", "-s", "finger.units=2", "-q")
    contents = []
    for name in ("one.parquet", "two.parquet"):
        assert call("stress", "three_unit.yaml", *words, "-o", name).exit_code == ExitCode.DONE
        contents.append((folder / name).read_bytes())
    assert contents[0] == contents[1]
    table = pq.read_table(folder / "one.parquet")
    assert table.column_names == [column.name for column in STRESS_COLUMNS]
    assert table["pattern"].to_pylist() == ["00", "00", "01", "01", "10", "10", "11", "11"]
    assert table.schema.field("residual_N").metadata[b"unit"] == b"N"
    assert b'"units":2' in table.schema.metadata[b"dpg.spec"]


@pytest.mark.usefixtures("overconfident")
def test_a_failing_case_is_shown_and_makes_the_command_fail(call: Call, folder: Path) -> None:
    result = call("stress", *QUICK, "-o", "cases.parquet")
    assert result.exit_code == ExitCode.REQUIREMENT == 1
    failures = result.stdout.split("Failures\n\n")[1].split("\n\n")[0].splitlines()
    assert failures[0].split()[:3] == ["subject", "family", "case"]
    assert all("overconfident" in line and "stable" in line for line in failures[1:])
    n_failures = len(failures) - 1
    assert f"{n_failures} overconfident" in result.stderr
    assert result.stderr.endswith(f"; {n_failures} failures\n")
    failing = pq.read_table(folder / "cases.parquet")["fails"].to_pylist()
    assert sum(failing) == n_failures > 0


@pytest.mark.usefixtures("overconfident")
@pytest.mark.parametrize("printed_as", ["csv", "json"])
def test_the_exit_code_does_not_depend_on_the_format(call: Call, printed_as: str) -> None:
    result = call("stress", *QUICK, "--format", printed_as, "-q")
    assert (result.exit_code, result.stderr) == (ExitCode.REQUIREMENT, "")


def test_what_is_missed_by_a_guess_is_shown_and_no_failure(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(cases: Iterable[Case]) -> Iterator[Outcome]:
        for outcome in all_right(cases):
            yield replace(outcome, verdict=Verdict.MISSED)

    all_right = verdicts.stress
    monkeypatch.setattr(verdicts, "stress", missing)
    result = call("stress", *QUICK)
    assert result.exit_code == ExitCode.DONE
    assert "Failures" not in result.stdout
    assert result.stdout.count("  missed  ") == N_QUICK + 1  # and a head
    assert result.stderr.endswith(f"{N_QUICK} missed; 0 failures\n")


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("--only", "mirrors"), ExitCode.USAGE, "expected some of patterns, stiffness"),
        (("--only", "patterns"), ExitCode.NOTHING_SELECTED, "none without a spec"),
        (("-s", "finger.units=2"), ExitCode.USAGE, "--set changes a spec: give one"),
        (("missing.yaml",), ExitCode.USAGE, "missing.yaml"),
        (
            ("three_unit.yaml", "-s", "finger.law=push_only"),
            ExitCode.USAGE,
            "the published law only, not the push-only law",
        ),
        (("-o", "cases.csv", *QUICK), ExitCode.USAGE, "writes Parquet"),
        (("-o", "no/cases.parquet", *QUICK), ExitCode.USAGE, "cannot write"),
        (("three_unit.yaml", "-o", "three_unit.yaml", *QUICK), ExitCode.USAGE, "is the spec"),
    ],
)
def test_usage(call: Call, words: tuple[str, ...], code: int, message: str) -> None:
    result = call("stress", *words)
    assert result.exit_code == code
    assert message in result.stderr
    assert result.stdout == ""


def test_without_mpmath_it_says_what_to_install(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mpmath", None)
    result = call("stress", *QUICK)
    assert result.exit_code == ExitCode.USAGE
    assert result.stderr == "dpg: dpg stress needs mpmath: pip install mpmath\n"
