"""`dpg grasp --jaws`: force by the aperture of jaws, as a table, a Parquet file and a figure."""

from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from dpgcli.cli.exits import ExitCode

CONFIGS = Path(__file__).parents[2] / "configs"
GRIPPER = str(CONFIGS / "gripper.yaml")
JAWS = ("--jaws", "30:40", "--at", "45,0", "--pattern", "10000", "--pattern", "01000")


@pytest.mark.slow
def test_rows_files_and_a_summary(call: Any, folder: Path) -> None:
    result = call("grasp", GRIPPER, *JAWS, "-o", "j.parquet", "--plot", "j.svg")
    assert result.exit_code == ExitCode.DONE
    lines = result.stdout.splitlines()
    assert lines[0].split()[:4] == ["pattern", "status", "n_inverted", "touch_mm"]
    assert [line.split()[0] for line in lines[1:]] == ["01000", "10000"]
    assert lines[2].endswith("1 at 38.58 mm")
    assert "F1, 1 unit inverted: 0.363 N (1 state), at least 0.2998 N (1 state)" in result.stderr
    assert "1 state without a reset up to 40 mm" in result.stderr
    assert "forces: published" in result.stderr
    table = pq.read_table(folder / "j.parquet")
    assert table.num_rows == 2 * 101
    assert table.column_names[:3] == ["pattern", "step", "jaw_gap_mm"]
    assert "aperture of the jaws" in (folder / "j.svg").read_text(encoding="utf-8")


@pytest.mark.slow
def test_states_that_are_lost_are_counted(call: Any) -> None:
    """Nothing is said to bear what only a part of the way was looked at for."""
    options = ("--jaws", "55:100", "--at", "30,0", "--pattern", "00000")
    result = call("grasp", GRIPPER, *options)
    assert result.exit_code == ExitCode.DONE
    header, row = (line.split() for line in result.stdout.splitlines())
    assert row[header.index("ended_by")] == "folded" and row[header.index("lost_mm")] == "94.60000"
    assert "F0, 0 units inverted: at least 7.671 N (1 state)" in result.stderr
    assert "1 state lost on the way: no certified state from lost_mm on" in result.stderr


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--jaws", "30", "--at", "45,0"), "--jaws 30: expected two apertures in mm"),
        (("--jaws", "3_0:40", "--at", "45,0"), "--jaws 3_0:40: expected two apertures in mm"),
        (("--jaws", "30:nan", "--at", "45,0"), "expected two apertures"),
        (("--jaws", "30:30", "--at", "45,0"), "expected two apertures from 0.001 to 10000 mm"),
        (("--jaws", "-3:30", "--at", "45,0"), "expected two apertures from 0.001 to 10000 mm"),
        (("--jaws", "30:40"), "--at: expected the middle of the jaws in mm"),
        (("--jaws", "30:40", "--at", "45,3"), "expected jaws on the axis"),
        (("--jaws", "30:62", "--at", "5,0"), "begins in the base of a finger"),
        (("--jaws", "30:40", "--at", "45,0", "--both"), "--jaws goes without --both"),
        (("--jaws", "30:40", "--at", "45,0", "--object", "disc:4"), "without --object"),
    ],
)
def test_wrong_jaws(options: tuple[str, ...], said: str, call: Any) -> None:
    result = call("grasp", GRIPPER, *options)
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr


def test_jaws_need_a_gripper(call: Any) -> None:
    result = call("grasp", str(CONFIGS / "five_unit.yaml"), "--jaws", "30:40", "--at", "45,0")
    assert result.exit_code == ExitCode.USAGE
    assert "--jaws: jaws need a gripper" in result.stderr
