"""`dpg grasp --approach close`: fingers that close on a body by pressure."""

import json
import re
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

import dpgcli as dpg
from dpgcli.cli.exits import ExitCode

SPEC = """\
finger:
  units: 3
  calibration: published
  linear_stiffness_N_per_mm: .inf
  geometry:
    dome_height_mm: 6.5
    dome_thickness_mm: 0.75
    unit_cell_mm: 22
    chamber_length_mm: 9
    channel_width_mm: 10
    limiting_layer_thickness_mm: 1.5
    unit_separation_mm: 3
    elastic_modulus_MPa: 26
gripper: {base_spacing_mm: 40, mounting_angle_deg: 0}
"""
DISC = ("--object", "disc:28", "--at", "28.35,0")
CLOSE = ("--approach", "close")


@pytest.fixture
def spec(folder: Path) -> str:
    (folder / "g.yaml").write_text(SPEC, encoding="utf-8")
    return "g.yaml"


def test_rows_say_what_snapped_at_which_pressure(call: Any, folder: Path, spec: str) -> None:
    options = ("--pressure", "0:0.2:0", "-o", "g.parquet", "--plot", "g.svg")
    result = call("grasp", spec, *DISC, *CLOSE, *options, "--format", "json")
    assert result.exit_code == ExitCode.DONE
    (row,) = json.loads(result.stdout)
    assert (row["pattern"], row["status"], row["resets"]) == ("000", "stable", "")
    assert re.match(r"snap [123,]+ at 0\.1495 MPa; snap [123,]+ at 0\.1\d+ MPa", row["events"])
    assert row["tie"] == "1,2,3"
    assert "ties in 1 state: the model does not say which of the units goes first" in result.stderr
    assert "pressures: assumed, snap pressure" in result.stderr
    table = pq.read_table(folder / "g.parquet")
    assert table["events"].to_pylist() == [row["events"]]
    found = dpg.grasp(
        spec, object="disc:28", at=(28.35, 0), approach="close", pressure=[0.0, 0.2, 0.0]
    )
    assert found.table["events"].tolist() == [row["events"]]


def test_fingers_close_from_where_loads_leave_them(call: Any, folder: Path, spec: str) -> None:
    """As `actuate` and `routine` do: this couple flips the softest unit before any pressure."""
    lattice = "finger.overrides.{}.lattice.bistable_stiffness_N_per_mm={}"
    graded = ("--set", lattice.format(2, 16), "--set", lattice.format(3, 18))
    loaded = (*graded, "--set", "loads.tip_moment_N_mm=-52")
    far = ("--object", "disc:10", "--at", "30,0", "--set", "gripper.base_spacing_mm=90")
    result = call(
        "grasp", spec, *far, *CLOSE, *loaded, "--pressure", "0:0.01:0", "--format", "json"
    )
    (row,) = json.loads(result.stdout)
    assert (row["pattern"], row["status"]) == ("100", "stable")


def test_lines_are_named_and_histories_are_those_of_actuate(
    call: Any, folder: Path, spec: str
) -> None:
    """A unit is told with the pressure of its own line; a table of pressures is read, and kept."""
    lines = ("--set", "pressure.lines={A: 1-2, B: 3}", "--pattern", "0??", "-q", "--format", "json")
    ramps = ("--pressure", "A=0:0:0.16:0", "--pressure", "B=0:0.16:0.16:0")
    rows = json.loads(call("grasp", spec, *DISC, *CLOSE, *ramps, *lines).stdout)
    assert [row["pattern"] for row in rows] == ["000", "001", "010", "011"]
    assert rows[0]["events"].startswith("snap 3 at B 0.1495")
    table = "A (kPa),B (kPa)\n0,0\n0,160\n160,160\n0,0\n"
    (folder / "p.csv").write_text(table, encoding="utf-8")
    again = call("grasp", spec, *DISC, *CLOSE, "--pressure", "p.csv", *lines)
    assert json.loads(again.stdout) == rows
    over = call("grasp", spec, *DISC, *CLOSE, "--pressure", "p.csv", *lines[:2], "-o", "p.csv")
    assert over.exit_code != ExitCode.DONE
    assert (folder / "p.csv").read_text(encoding="utf-8") == table


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ((*DISC, *CLOSE), "--pressure: expected pressures in MPa such as 0:0.15:0"),
        (
            (*DISC, *CLOSE, "--pressure", "0:0.16"),
            "--pressure ends at 0.16 MPa: expected 0 at the end",
        ),
        ((*DISC, *CLOSE, "--pressure", "0:x:0"), 'found "x"'),
        ((*DISC, "--pressure", "0:0.16:0"), "--pressure goes with --approach close"),
        (
            CLOSE,
            "--approach close goes with a body: expected an --object such as disc:40\n"
            "dpg: --pressure: expected pressures in MPa such as 0:0.15:0",
        ),
        (
            (*DISC[:2], *CLOSE),
            "--at: expected the place of the body in mm, such as 40,0\ndpg: --pressure: expected",
        ),
        (
            ("--jaws", "30:40", "--at", "28,0", *CLOSE, "--pressure", "0:0.1:0"),
            "--jaws goes without --approach and --pressure",
        ),
    ],
)
def test_refusals(call: Any, spec: str, options: tuple[str, ...], said: str) -> None:
    result = call("grasp", spec, *options)
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr and not result.stdout


def test_domes_that_only_push(call: Any, spec: str) -> None:
    """The law of `calibration: finite_elements`: they snap by themselves, and then push."""
    options = ("--set", "finger.calibration=finite_elements", "--pressure", "0:0.2:0")
    result = call("grasp", spec, *DISC, *CLOSE, *options, "--format", "json")
    assert result.exit_code == ExitCode.DONE
    (row,) = json.loads(result.stdout)
    assert (row["status"], row["pattern_after"], row["tie"]) == ("stable", "111", "1,2,3")
    assert re.fullmatch(r"snap 1,2,3 at 0\.1496?\d* MPa", row["events"])
    assert row["squeeze_N"] > 0.1 and row["penetration_mm"] <= 1e-9
    assert "pressures: fitted, snap pressure" in result.stderr


def test_gaps_closed_beyond_domes_at_rest_are_rows(call: Any, spec: str) -> None:
    """The published energy has domes at rest where gaps are shut: a body shuts them more."""
    options = ("--set", "finger.law=push_only", "--pressure", "0:0.2:0")
    result = call(
        "grasp", spec, "--object", "disc:39", *DISC[2:], *CLOSE, *options, "--format", "json"
    )
    (row,) = json.loads(result.stdout)
    assert (row["status"], row["pattern_after"]) == ("gap_closed", "")


def test_fingers_that_meet_as_they_close_touch_each_other(call: Any, spec: str) -> None:
    """Rows have the force between them, and summaries say what mirrored pairs leave open."""
    options = ("--pressure", "0:0.2:0", "--set", "gripper.base_spacing_mm=25", "--format", "json")
    body = ("--object", "disc:4", "--at", "60,0")
    result = call("grasp", spec, *body, *CLOSE, *options)
    assert result.exit_code == ExitCode.DONE
    (row,) = json.loads(result.stdout)
    assert row["status"] == "stable" and row["between_fingers_N"] > 0.1 and not row["overlaps"]
    assert row["aperture_mm"] == pytest.approx(0.0, abs=1e-9) and row["n_contacts"] == 0
    assert "1 state in which the fingers touch each other" in result.stderr
    assert "1 mirrored pair snapped or reset together: which finger goes first" in result.stderr
