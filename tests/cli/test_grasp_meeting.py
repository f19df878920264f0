"""`dpg grasp` without a body: two fingers that touch each other."""

import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from dpgcli.cli.exits import ExitCode
from dpgcli.grasping.table import (
    ANGLE,
    BETWEEN,
    COLUMNS,
    JAW_GAP,
    OF_BODIES,
    OF_CLOSING,
    OF_FRICTION,
)

CONFIGS = Path(__file__).parents[2] / "configs"
LEFT_OUT = (ANGLE, JAW_GAP, BETWEEN, *OF_BODIES, *OF_CLOSING, *OF_FRICTION)
NAMES = [column.name for column in COLUMNS if column.name not in LEFT_OUT]


@pytest.fixture
def gripper(folder: Path) -> str:
    (folder / "gripper.yaml").write_bytes((CONFIGS / "gripper.yaml").read_bytes())
    return "gripper.yaml"


def test_rows_files_and_figures(call: Any, folder: Path, gripper: str) -> None:
    arguments = ("grasp", gripper, "--pattern", "1100?", "--pattern", "11000/10101")
    result = call(*arguments, "-q", "--format", "json", "-o", "g.parquet", "--plot", "g.svg")
    assert (result.exit_code, result.stderr) == (ExitCode.DONE, "")
    rows = json.loads(result.stdout)
    assert [list(row) for row in rows] == [NAMES] * 3
    assert [row["touching"] for row in rows] == ["5", "5", "5"]
    assert all(row["squeeze_N"] == -row["finger_force_y_N"] > 0.0 for row in rows)
    assert all(0.0 <= row["penetration_mm"] <= 1e-9 for row in rows)
    assert [row["aperture_mm"] == 0.0 for row in rows] == [True, True, False]
    written = pq.read_table(folder / "g.parquet")
    assert written["squeeze_N"].to_pylist() == [row["squeeze_N"] for row in rows]
    assert written.schema.metadata[b"dpg.approach"] == b"together"
    assert b"dpg.object" not in written.schema.metadata
    drawn = (folder / "g.svg").read_text(encoding="utf-8")
    assert "force on the other finger" in drawn and "force on the body" not in drawn


def test_fingers_that_do_not_meet_are_rows(call: Any, gripper: str) -> None:
    result = call("grasp", gripper, "--pattern", "0000?", "--format", "json")
    rows = json.loads(result.stdout)
    assert [(row["n_contacts"], row["status"], row["margin"]) for row in rows] == [
        (0, "stable", None)
    ] * 2
    assert "of 2 states 0 in touch with each other, 0 changed on the way" in result.stderr


def test_what_is_taken_of_mirrored_pairs_is_said(call: Any, gripper: str) -> None:
    result = call("grasp", gripper, "--pattern", "11011", "--pattern", "11011/10101")
    assert "1 mirrored pair reset together: which finger goes first the model" in result.stderr
    near = ("--set", "gripper.base_spacing_mm=60.25")
    result = call("grasp", gripper, "--pattern", "11011", *near)
    assert "1 mirrored pair giving way to one side: marginal" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--approach", "insert"), "--approach insert goes with a body: expected an --object such"),
        (("--approach", "close", "--pressure", "0:0.1:0"), "--approach close goes with a body"),
        (
            ("--set", "gripper.base_spacing_mm=1.5"),
            "gripper.base_spacing_mm: expected more than 1.5, where the faces meet",
        ),
    ],
)
def test_refusals(call: Any, gripper: str, arguments: tuple[str, ...], said: str) -> None:
    result = call("grasp", gripper, *arguments)
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr and not result.stdout


def test_a_finger_alone_is_told_what_to_give(call: Any, folder: Path, gripper: str) -> None:
    text = (folder / gripper).read_text(encoding="utf-8").split("gripper:")[0]
    (folder / "one.yaml").write_text(text, encoding="utf-8")
    result = call("grasp", "one.yaml")
    assert result.exit_code == ExitCode.USAGE
    assert "--object: expected a body such as disc:40" in result.stderr
    assert "two fingers, of a gripper, go without" in result.stderr


def test_about_a_body_they_meet_as_well(call: Any, folder: Path, gripper: str) -> None:
    """The row, the summary and the figure say so."""
    about = ("--object", "disc:18", "--at", "25,0", "-s", "gripper.base_spacing_mm=30")
    soft = ("-s", "finger.calibration=finite_elements", "--pattern", "10000")
    told = ("--format", "json", "--plot", "both.svg")
    result = call("grasp", gripper, *about, *soft, *told)
    assert result.exit_code == ExitCode.DONE
    (row,) = json.loads(result.stdout)
    assert row["n_contacts"] == 2 and row["between_fingers_N"] > 0.01 and not row["overlaps"]
    assert row["squeeze_N"] == -row["finger_force_y_N"] > 0.1
    assert "1 state in which the fingers touch each other\n" in result.stderr
    drawn = (folder / "both.svg").read_text(encoding="utf-8")
    assert "force on the body or the other finger" in drawn
    assert f"{row['between_fingers_N']:.4g} N between the fingers" in drawn
