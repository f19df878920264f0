"""`dpg routine`: rows, files, and the exit code of what cannot be done."""

import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from dpgcli.cli.exits import ExitCode

SPEC = """\
finger:
  units: 2
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
gripper: {base_spacing_mm: 34, mounting_angle_deg: 0}
"""
BODY = ("--object", "disc:26", "--at", "20,0", "--approach-from", "90,0")


@pytest.fixture
def spec(folder: Path) -> str:
    (folder / "g.yaml").write_text(SPEC, encoding="utf-8")
    return "g.yaml"


@pytest.mark.slow
def test_rows_and_files(call: Any, folder: Path, spec: str) -> None:
    files = "--output", "r.parquet", "--controller", "r.csv", "--plot", "r.svg"
    times = "--ramp", "500s", "--move", "2m"
    result = call("routine", spec, *BODY, *files, *times, "--format", "json")
    assert result.exit_code == ExitCode.DONE
    rows = json.loads(result.stdout)
    assert [row["step"] for row in rows][:3] == ["open", "approach", "close"]
    assert {row["status"] for row in rows} == {"stable", "not_checked"}
    table = pq.read_table(folder / "r.parquet")
    assert table.column("pattern_after").to_pylist() == [row["pattern_after"] for row in rows]
    told = {key.decode(): value.decode() for key, value in table.schema.metadata.items()}
    assert json.loads(told["dpg.approach_from_mm"]) == [90.0, 0.0]
    assert json.loads(told["dpg.object"])["disc"] == {"diameter_mm": 26.0}
    lines = (folder / "r.csv").read_text().splitlines()
    assert lines[0].startswith("# dpg routine: ")
    assert lines[1] == "time_s,line,pressure_MPa"
    assert [line.split(",")[0] for line in lines[2:]] == [
        *("0", "120", "620", "1120", "1240", "1740", "2240", "2360")
    ]
    figure = (folder / "r.svg").read_text()
    for step in ("1 open", "2 approach", "3 close: A 0.164 MPa", "4 lift", "7 withdraw"):
        assert step in figure
    assert "routine of 2 pulses" in result.stderr
    again = call("actuate", spec, "--pressure", "r.csv", "--format", "json", "--quiet")
    assert again.exit_code == ExitCode.DONE
    assert json.loads(again.stdout)[-1]["pattern_after"] == "00"


def test_what_cannot_be_done_is_exit_1_with_rows(call: Any, folder: Path, spec: str) -> None:
    options = "--set", "gripper.base_spacing_mm=27", "--controller", "r.csv", "--plot", "r.svg"
    result = call("routine", spec, *BODY, *options)
    assert result.exit_code == ExitCode.REQUIREMENT
    assert result.stdout.splitlines()[2].split()[:1] == ["approach"]
    assert "collides" in result.stdout.splitlines()[2]
    assert "approach: collides in 2 open states" in result.stderr
    assert not (folder / "r.csv").exists()
    assert "r.csv is not written\n" in result.stderr
    assert "2 approach collides" in (folder / "r.svg").read_text()
    quiet = call("routine", spec, *BODY, *options[:2], "--quiet")
    assert (quiet.exit_code, quiet.stderr) == (ExitCode.REQUIREMENT, "")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--controller", "r.txt"), "--controller r.txt: expected a name that ends in .csv"),
        (("--ramp", "fast"), "--ramp fast: expected a time in s, m or h"),
        (("--ramp", "0s"), "--ramp 0: expected a number > 0"),
        (("--approach-from", "20,0"), "--approach-from: expected another place"),
        (
            ("--approach-from", "-90,0"),
            "expected a place in front of the gripper's base, found one",
        ),
        (("--approach-from", "0,0"), "found one behind it, at x = 0 mm"),
        (("--open", "2"), "--open 2: expected 2 digits, 0 or 1"),
        (("--output", "r.csv"), "--output r.csv: writes Parquet"),
        (("--plot", "r.pdf"), "--plot r.pdf: expected a name"),
        (("--controller", "g.yaml"), "--controller g.yaml: expected a name"),
    ],
)
def test_refusals(call: Any, spec: str, options: tuple[str, str], said: str) -> None:
    result = call("routine", spec, *BODY, *options)
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr


def test_an_old_file_for_a_controller_is_told_of(call: Any, folder: Path, spec: str) -> None:
    (folder / "r.csv").write_text("# dpg routine: of another one\n")
    options = "--set", "gripper.base_spacing_mm=27", "--controller", "r.csv", "--quiet"
    result = call("routine", spec, *BODY, *options)
    assert result.exit_code == ExitCode.REQUIREMENT
    assert result.stderr == "r.csv is not written: what is there is of another run\n"


def test_a_body_is_needed(call: Any, spec: str) -> None:
    result = call("routine", spec, *BODY[-2:])
    assert result.exit_code == ExitCode.USAGE
    assert (
        "--object: expected a body such as disc:40, here or as object in the spec" in result.stderr
    )


def test_a_place_to_come_from_is_needed(call: Any, spec: str) -> None:
    result = call("routine", spec, *BODY[:4])
    assert result.exit_code == ExitCode.USAGE
    assert "--approach-from" in result.stderr
