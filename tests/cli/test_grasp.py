"""`dpg grasp`: rows, files, figures, pairs, refusals, pipes."""

import csv
import io
import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from dpgcli.cli.exits import ExitCode
from dpgcli.grasping.table import ANGLE, COLUMNS, JAW_GAP, OF_CLOSING, OF_FRICTION, OF_PAIRS

CONFIGS = Path(__file__).parents[2] / "configs"
LEFT_OUT = (ANGLE, JAW_GAP, *OF_CLOSING, *OF_FRICTION)
NAMES = [column.name for column in COLUMNS if column.name not in LEFT_OUT]  # of a disc, placed
DISC = ("--object", "disc:40", "--at", "40,0")
RIGID = ("--set", "finger.linear_stiffness_N_per_mm=.inf")


@pytest.fixture
def gripper(folder: Path) -> str:
    (folder / "gripper.yaml").write_bytes((CONFIGS / "gripper.yaml").read_bytes())
    return "gripper.yaml"


def rows_of(call: Any, *arguments: str) -> list[dict[str, Any]]:
    result = call(*arguments, *RIGID, "-q", "--format", "json")
    assert (result.exit_code, result.stderr) == (ExitCode.DONE, "")
    rows: list[dict[str, Any]] = json.loads(result.stdout)
    return rows


def test_rows_are_the_same_in_every_format(call: Any, folder: Path, gripper: str) -> None:
    arguments = ("grasp", gripper, *DISC, "--pattern", "0110?")
    objects = rows_of(call, *arguments)
    as_csv = call(*arguments, *RIGID, "-q", "--format", "csv").stdout
    assert call(*arguments, *RIGID, "-q", "-o", "g.parquet").exit_code == ExitCode.DONE
    for row, said in zip(csv.DictReader(io.StringIO(as_csv)), objects, strict=True):
        numbers = {k: v for k, v in said.items() if isinstance(v, float)}
        assert {k: float(row[k]) for k in numbers} == numbers
    written = pq.read_table(folder / "g.parquet")
    assert written.column_names == list(objects[0]) == NAMES
    assert written["pattern_after"].to_pylist() == ["01100", "01101"]
    assert b"published" in written.schema.field("squeeze_N").metadata[b"basis"]


def test_a_body_in_the_spec_is_the_same(call: Any, folder: Path, gripper: str) -> None:
    said = "\nobject:\n  disc: {diameter_mm: 40}\n  at_mm: [40, 0]\n"
    text = (folder / gripper).read_text(encoding="utf-8") + said
    (folder / "own.yaml").write_text(text, encoding="utf-8")
    chosen = ("--pattern", "01110")
    assert rows_of(call, "grasp", "own.yaml", *chosen) == rows_of(
        call, "grasp", gripper, *DISC, *chosen
    )
    smaller = rows_of(call, "grasp", "own.yaml", *chosen, "--object", "disc:20")
    assert smaller[0]["n_contacts"] == 0
    assert call("predict", "own.yaml", "-q").exit_code == ExitCode.DONE


def test_long_work_is_said_before(call: Any, gripper: str, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ("grasp", gripper, *DISC, *RIGID, "--pattern", "0111?")
    said = "2 grasps of 4 states: about "
    assert said not in call(*arguments).stderr
    monkeypatch.setattr("dpgcli.cli.grasp.LONG", 0.0)
    first = call(*arguments).stderr.splitlines()[0]
    assert first.startswith(said)
    assert first.endswith(" MiB of memory (rough)")
    assert call(*arguments, "-q").stderr == ""


def test_grasps_that_take_too_much_are_refused(call: Any, gripper: str) -> None:
    result = call("grasp", gripper, *DISC, "--set", "finger.units=10", "--both")
    assert result.exit_code == ExitCode.USAGE
    assert "GiB of memory: expected at most 1.0: select with --pattern" in result.stderr


def test_pairs_of_states(call: Any, gripper: str) -> None:
    """What one finger does against a body that does not move is not the other one's business."""
    own = rows_of(call, "grasp", gripper, *DISC, "--pattern", "0110?")
    alone = {row["pattern"]: row for row in own}
    both = rows_of(call, "grasp", gripper, *DISC, "--both", "--pattern", "0110?")
    assert [row["pattern"] for row in both] == ["01100", "01100/01101", "01101/01100", "01101"]
    upper, lower = alone["01100"], alone["01101"]
    pair = both[1]
    assert pair["finger_force_y_N"] == upper["finger_force_y_N"] < 0.0
    middle = 0.5 * (upper["squeeze_N"] + lower["squeeze_N"])
    assert pair["squeeze_N"] == pytest.approx(middle, rel=1e-12)
    assert pair["touching"] == "4/5"
    named = rows_of(call, "grasp", gripper, *DISC, "--pattern", "01100/01101")
    assert named == [pair]


def test_a_body_beside_the_axis_pushes_the_fingers_differently(call: Any, gripper: str) -> None:
    chosen = ("--object", "disc:40", "--pattern", "01100")
    (up,) = rows_of(call, "grasp", gripper, *chosen, "--at", "40,1")
    (down,) = rows_of(call, "grasp", gripper, *chosen, "--at", "40,-1")
    assert up["squeeze_N"] == pytest.approx(down["squeeze_N"], rel=1e-9)
    assert abs(up["finger_force_y_N"]) > abs(down["finger_force_y_N"]) > 0.0


def test_a_disc_out_of_reach_is_a_row(call: Any, gripper: str) -> None:
    rows = rows_of(
        call, "grasp", gripper, "--object", "disc:10", "--at", "300,0", "--pattern", "0000?"
    )
    assert [row["n_contacts"] for row in rows] == [0, 0]
    assert all(row["status"] == "stable" and row["margin"] is None for row in rows)


def test_a_finger_alone_has_no_columns_of_pairs(call: Any, folder: Path, gripper: str) -> None:
    text = (folder / gripper).read_text(encoding="utf-8").split("gripper:")[0]
    (folder / "one.yaml").write_text(text, encoding="utf-8")
    (row,) = rows_of(
        call, "grasp", "one.yaml", "--object", "disc:20", "--at", "40,-16", "--pattern", "01000"
    )
    assert list(row) == [name for name in NAMES if name not in OF_PAIRS]
    assert row["n_contacts"] == 1 and row["finger_force_y_N"] < 0.0
    result = call("grasp", "one.yaml", *DISC, "--both")
    assert result.exit_code == ExitCode.USAGE
    assert "--pattern: pairs of states need a gripper in the spec" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--at", "40,0"), "--object: expected a body such as disc:40, here or as object in the"),
        (("--object", "disc:40"), "--at: expected the place of the body in mm, such as 40,0"),
        (("--object", "can:40", "--at", "40,0"), "--object can:40: expected disc and its diameter"),
        (("--object", "disc:-4", "--at", "40,0"), "--object disc:-4: expected disc"),
        (("--object", "disc:nan", "--at", "40,0"), "--object disc:nan: expected disc"),
        (("--object", "disc:40", "--at", "40"), "--at 40: expected two numbers in mm"),
        (("--object", "disc:40", "--at", "10,30"), "begins in the base of a finger"),
        ((*DISC, "--pattern", "11/1"), "no pattern of 5 units matches 11"),
        ((*DISC, "--plot", "g.pdf"), ".svg or .png"),
    ],
)
def test_refusals(call: Any, gripper: str, arguments: tuple[str, ...], said: str) -> None:
    result = call("grasp", gripper, *arguments)
    assert result.exit_code != ExitCode.DONE
    assert said in result.stderr and not result.stdout


def test_a_face_needs_the_thickness_of_its_layer(call: Any, folder: Path) -> None:
    values = {
        "segment_length_mm": 13.5,
        "segment_height_mm": 10.75,
        "stroke_mm": 3.5,
        "bistable_stiffness_N_per_mm": 12.84,
        "force_linearity": 0.043,
        "hinge_stiffness_N_mm_per_rad": 24.2,
    }
    spec = {"finger": {"units": 2, "lattice": values}}
    (folder / "bare.yaml").write_text(json.dumps(spec), encoding="utf-8")
    result = call("grasp", "bare.yaml", *DISC)
    assert result.exit_code == ExitCode.USAGE
    assert "limiting_layer_thickness_mm" in result.stderr


def test_wrong_keys_of_an_object(call: Any, folder: Path, gripper: str) -> None:
    wrong = "\nobject:\n  disc: {diameter_mm: -4, color: red}\n  at_mm: [4]\n  held: loosely\n"
    text = (folder / gripper).read_text(encoding="utf-8") + wrong
    (folder / "own.yaml").write_text(text, encoding="utf-8")
    result = call("grasp", "own.yaml")
    assert result.exit_code == ExitCode.USAGE
    for said in (
        "object.disc.diameter_mm: expected a length > 0 in mm, found -4",
        "object.disc.color: expected a known key",
        "object.at_mm: expected two numbers in mm, such as [40, 0], found [4]",
        'object.held: expected "fixed", "guided" (moves along x) or "free", found "loosely"',
    ):
        assert said in result.stderr


@pytest.mark.parametrize("key", ["object.disc", "object.at_mm", "object", "object.held"])
def test_an_axis_is_of_numbers(call: Any, folder: Path, gripper: str, key: str) -> None:
    text = f"base: {gripper}\nspace:\n  - {{key: {key}, values: [20, 40]}}\n"
    (folder / "sweep.yaml").write_text(text, encoding="utf-8")
    result = call("sweep", "sweep.yaml", "-o", "out")
    assert result.exit_code == ExitCode.USAGE
    assert f"expected the key of a number, found {key} (name the number itself)" in result.stderr


def test_the_summary_says_what_forces_rest_on(call: Any, gripper: str) -> None:
    result = call("grasp", gripper, *DISC, *RIGID, "--pattern", "11100")
    assert "of 1 state 1 in touch with the body, 1 changed on the way" in result.stderr
    assert "forces: published" in result.stderr and "warning: forces" in result.stderr


def test_figures(call: Any, folder: Path, gripper: str) -> None:
    arguments = ("grasp", gripper, *DISC, *RIGID, "--pattern", "01110", "--pattern", "10100", "-q")
    for name in ("a.svg", "b.svg"):
        assert call(*arguments, "--plot", name).exit_code == ExitCode.DONE
    first = (folder / "a.svg").read_text(encoding="utf-8")
    assert first == (folder / "b.svg").read_text(encoding="utf-8")
    assert "01110: 2 contacts, largest force 0.60" in first
    assert "10100 → 00100" in first
    many = call("grasp", gripper, *DISC, "--both", "--plot", "c.svg")
    assert many.exit_code == ExitCode.USAGE and not (folder / "c.svg").exists()


@pytest.mark.slow
def test_a_reader_that_ends_early_changes_nothing(folder: Path, gripper: str) -> None:
    program = f"{sys.executable} -m dpgcli"
    arguments = " ".join((*DISC, *RIGID))
    command = f"{program} grasp {gripper} {arguments} -q -o g.parquet --format csv | head -n 1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, cwd=folder)
    assert done.stdout.startswith("pattern,status")
    assert pq.read_table(folder / "g.parquet").num_rows == 32
    assert done.stderr == ""


def test_infinite_margins_are_no_numbers_in_json(call: Any, gripper: str) -> None:
    result = call("grasp", gripper, *DISC, *RIGID, "-q", "--format", "json", "--pattern", "00000")
    assert "Infinity" not in result.stdout
    (row,) = json.loads(result.stdout)
    assert row["margin"] is None and not math.isnan(row["squeeze_N"])
