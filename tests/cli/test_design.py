"""`dpg design`: what it prints, writes and refuses, and how it ends."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]
GOAL = """\
base: three_unit.yaml
vary:
  finger.geometry.dome_height_mm: {from: 4.5, to: 7.5}
  finger.geometry.unit_separation_mm: {from: 2, to: 4}
targets:
  - {pattern: "11*", quantity: tip, value: VALUE, tolerance_mm: 0.5}
"""


@pytest.fixture
def goal(folder: Path) -> Callable[[str], str]:
    """The name of a goal whose tip should be there."""

    def made(value: str, name: str = "goal.yaml") -> str:
        (folder / name).write_text(GOAL.replace("VALUE", value), encoding="utf-8")
        return name

    return made


def test_a_goal_that_is_met(run: Run, goal: Callable[[str], str]) -> None:
    done = run("design", goal("[36, -16]"))
    assert done.returncode == 0, done.stderr
    head, row, *_ = done.stdout.splitlines()
    assert head.split()[:5] == [
        "design",
        "dome_height_mm",
        "unit_separation_mm",
        "misfit",
        "meets_all",
    ]
    assert row.split()[0] == "1"
    assert "yes" in row.split()
    assert "all that is asked; each is certified anew from its spec" in done.stderr
    assert "32 starts" in done.stderr


def test_a_goal_that_is_not_met_says_why_and_ends_with_1(
    run: Run, goal: Callable[[str], str]
) -> None:
    done = run("design", goal("[20, -36]"))
    assert done.returncode == 1
    assert "no design meets all that is asked" in done.stderr
    assert "target 1 (tip of 11*) is missed by" in done.stderr
    assert "in the way: dome_height_mm <= 7.5; with 7.8" in done.stderr


def test_rows_for_programs_and_files(run: Run, goal: Callable[[str], str], folder: Path) -> None:
    arguments = ("design", goal("[36, -16]"), "--output", "found", "-q", "--format", "json")
    done = run(*arguments)
    assert done.returncode == 0
    rows = json.loads(done.stdout)
    assert rows[0]["target_1_miss_mm"] < 1e-6
    assert {p.name for p in (folder / "found").iterdir()} >= {
        "best.parquet", "trace.parquet", "design_1.yaml"
    }  # fmt: skip
    assert run("validate", "found/design_1.yaml").returncode == 0
    assert run(*arguments).stdout == done.stdout


def test_a_folder_that_cannot_be_is_refused_before_the_work(
    run: Run, goal: Callable[[str], str], folder: Path
) -> None:
    name = goal("[36, -16]")
    (folder / "best.parquet").write_text("mine")
    for output, said in ((name, "it is no folder"), (".", "best.parquet: it is there and not of")):
        done = run("design", name, "-o", output)
        assert done.returncode == 2
        assert said in done.stderr
        assert not done.stdout
    assert (folder / "best.parquet").read_text() == "mine"


@pytest.mark.slow
def test_other_seeds_and_limits(run: Run, goal: Callable[[str], str]) -> None:
    name = goal("[36, -16]")
    assert run("design", name, "--seed", "2", "--evaluations", "300").returncode == 0
    assert run("design", name, "--budget", "1s").returncode in (0, 1)  # as far as it came
    done = run("design", name, "--budget", "soon")
    assert done.returncode == 2
    assert "expected a time in s, m or h" in done.stderr


def test_nothing_of_the_kind(run: Run, goal: Callable[[str], str]) -> None:
    """A thin dome does not stay inverted against its hinge; what varies cannot be set."""
    name = goal("[36, -16]")
    done = run("design", name, "-s", "finger.geometry.dome_thickness_mm=0.01")
    assert done.returncode == 5
    assert "none of 32 starts is a finger with certified states of 11*" in done.stderr
    done = run("design", name, "-s", "finger.geometry.dome_height_mm=5")
    assert done.returncode == 2
    assert "a key that the space leaves alone" in done.stderr


def test_validate_takes_goals_and_others_say_which_command_does(
    run: Run, goal: Callable[[str], str]
) -> None:
    name = goal("[36, -16]")
    assert run("validate", name).stdout == f"{name}: ok\n"
    done = run("predict", name)
    assert done.returncode == 2
    assert "a goal (dpg design takes it)" in done.stderr
    done = run("validate", goal("[36]", "bad.yaml"))
    assert done.returncode == 2
    assert "bad.yaml:6:" in done.stdout


def test_explain_says_how_a_goal_is_searched_for(run: Run, goal: Callable[[str], str]) -> None:
    done = run("explain", goal("[36, -16]"))
    assert done.returncode == 0
    for said in (
        "goal.yaml: a goal around three_unit.yaml",
        "finger.geometry.dome_height_mm               4.5 … 7.5",
        "target 1     tip of 11*: 36, -16 ± 0.5",
        "tip_x_mm: exact slopes",
        "32 starts, without limits",
        "2 states of a design at most",
    ):
        assert said in done.stdout
    facts = json.loads(run("explain", "goal.yaml", "--format", "json").stdout)
    assert facts["ranges"]["finger.geometry.unit_separation_mm"] == [2.0, 4.0]
    assert facts["slopes"] == {"tip_x_mm": "exact", "tip_y_mm": "exact"}


@pytest.mark.slow
def test_processes_and_where_they_are(run: Run, goal: Callable[[str], str]) -> None:
    name = goal("[36, -16]")
    done = run("design", name, "-o", "found", "-j", "2", "-q")
    assert done.returncode == 0, done.stderr
    assert run("design", name, "-q").stdout == done.stdout
    done = run("design", name, "--executor", "dask")
    assert done.returncode == 2
    assert "--executor dask and --scheduler tcp://host:port go together" in done.stderr
