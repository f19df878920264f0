"""`dpg actuate`: events in every format, files, figures, refusals, and readers that stop early."""

import csv
import io
import json
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from dpgcli.cli.exits import ExitCode

pytestmark = pytest.mark.slow

CONFIGS = Path(__file__).parents[2] / "configs"
NAMES = [
    *("event", "line", "pressure_MPa", "unit", "kind", "pattern_before", "pattern_after"),
    *("energy_released_mJ", "tip_x_mm", "tip_y_mm", "tip_angle_rad", "tie"),
]


@pytest.fixture
def graded(folder: Path) -> str:
    (folder / "graded.yaml").write_bytes((CONFIGS / "graded_five_unit.yaml").read_bytes())
    return "graded.yaml"


def test_events_are_the_same_in_every_format(call: Any, graded: str) -> None:
    arguments = ("actuate", graded, "--pressure", "0:0.16:0.2:0", "-q")
    table, as_csv, as_json = (
        call(*arguments, "--format", form) for form in ("table", "csv", "json")
    )
    assert [r.exit_code for r in (table, as_csv, as_json)] == [ExitCode.DONE] * 3
    head, *lines = table.stdout.splitlines()
    assert head.split() == NAMES
    assert [line.split()[3] for line in lines] == ["1,2,3", "4,5"]
    rows = list(csv.DictReader(io.StringIO(as_csv.stdout)))
    objects = json.loads(as_json.stdout)
    assert list(rows[0]) == list(objects[0]) == NAMES
    for row, said in zip(rows, objects, strict=True):
        assert {name: str(value) for name, value in said.items()} == row
    assert [row["pattern_after"] for row in objects] == ["11100", "11111"]
    assert [row["tie"] for row in objects] == ["2,3", "5"]
    assert table.stderr == ""


def test_nothing_that_happens_is_an_empty_table(call: Any, graded: str) -> None:
    arguments = ("actuate", graded, "--pressure", "0:0.01:0")
    assert call(*arguments).stdout.split() == NAMES
    assert json.loads(call(*arguments, "--format", "json").stdout) == []
    assert "0 events" in call(*arguments).stderr


def test_a_gripper_has_one_column_more(call: Any) -> None:
    rows = json.loads(
        call("actuate", "gripper.yaml", "--pressure", "0:0.16:0", "--format", "json").stdout
    )
    assert list(rows[0]) == [*NAMES[:-1], "aperture_mm", "tie"]


def test_a_file_of_pressures(call: Any, folder: Path, graded: str) -> None:
    (folder / "history.csv").write_text("time_s,A (kPa)\n0,0\n1,160\n2,0\n")
    result = call("actuate", graded, "--pressure", "history.csv", "-o", "path.parquet")
    assert result.exit_code == ExitCode.DONE
    assert "final pattern 11100 at 0 MPa, certified" in result.stderr
    path = pq.read_table(folder / "path.parquet").to_pandas()
    assert path["time_s"].tolist()[-1] == 2.0
    assert path["pressure_A_MPa"].max() == pytest.approx(0.16)
    (folder / "history.csv").write_text("time_s,A\n0,0\n1,a\n2,\n")
    wrong = call("actuate", graded, "--pressure", "history.csv")
    assert wrong.exit_code == ExitCode.USAGE
    assert "history.csv:3: A: expected a number" in wrong.stderr
    assert "history.csv:4: A: expected a number" in wrong.stderr


def test_a_spec_on_standard_input(call: Any, folder: Path, graded: str) -> None:
    text = (folder / graded).read_text(encoding="utf-8")
    piped = call("actuate", "-", "--pressure", "0:0.16:0", text=text)
    assert piped.exit_code == ExitCode.DONE
    assert piped.stdout == call("actuate", graded, "--pressure", "0:0.16:0").stdout


def test_that_of_the_spec_is_the_default(call: Any, graded: str) -> None:
    own = ("-s", "pressure.history={A: 0:0.16:0}")
    assert "final pattern 11100" in call("actuate", graded, *own).stderr
    result = call("actuate", graded)
    assert result.exit_code == ExitCode.USAGE
    assert result.stderr == (
        "dpg: --pressure: expected pressures in MPa such as 0:0.15:0, "
        "or pressure.history in the spec\n"
    )


@pytest.mark.parametrize("name", ["path.png", "path.svg"])
def test_a_figure(call: Any, folder: Path, graded: str, name: str) -> None:
    arguments = ("actuate", graded, "--pressure", "0:0.2:-0.1:0", "--plot", name)
    assert call(*arguments).exit_code == ExitCode.DONE
    first = (folder / name).read_bytes()
    assert len(first) > 10_000
    assert call(*arguments).exit_code == ExitCode.DONE
    assert (folder / name).read_bytes() == first


def test_unstable_branches_go_into_files(call: Any, folder: Path, graded: str) -> None:
    arguments = ("actuate", graded, "--pressure", "0:0.2", "--unstable")
    assert call(*arguments).exit_code == ExitCode.USAGE
    result = call(*arguments, "-o", "path.parquet", "--plot", "path.svg")
    assert result.exit_code == ExitCode.DONE
    is_stable = pq.read_table(folder / "path.parquet")["is_stable"].to_pylist()
    assert True in is_stable
    assert False in is_stable
    assert "unstable" in (folder / "path.svg").read_text(encoding="utf-8")


REFUSED = {
    "one number": (("--pressure", "0.15"), "0:0.15:0 back as well"),
    "kPa": (("--pressure", "0:150kPa:0"), "--pressure: 0:150kPa:0: expected"),
    "no pressure": (("--pressure", ""), "is empty: expected a value"),
    "a line of nobody": (("--pressure", "B=0:1"), "expected a line: A, found B"),
    "a start": (("--pressure", "0:1", "--from", "111"), "--from 111: expected 5 digits"),
    "cycles": (("--pressure", "0:1", "--cycles", "0"), "--cycles 0: expected 1 to 100,000"),
    "a table": (("--pressure", "0:1", "-o", "a.csv"), "--output a.csv: writes Parquet"),
    "a figure": (("--pressure", "0:1", "--plot", "a.pdf"), "expected a name that ends in .svg"),
    "a key": (("--pressure", "0:1", "-s", "pressure.area=3"), "pressure.area"),
    "units on no line": (
        ("--pressure", "0:1", "-s", "pressure.lines={A: 1-4}"),
        "expected every unit on a line, found none for unit 5",
    ),
    "units on two": (
        ("--pressure", "A=0:1", "-s", "pressure.lines={A: 1-4, B: 4-5}"),
        "found unit 4, which is on line A too",
    ),
    "an area of zero": (
        ("--pressure", "0:1", "-s", "pressure.effective_area_mm2=0"),
        "pressure.effective_area_mm2: expected an area > 0",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_makes_no_sense_is_refused(call: Any, folder: Path, graded: str, case: str) -> None:
    arguments, said = REFUSED[case]
    before = sorted(path.name for path in folder.iterdir())
    result = call("actuate", graded, *arguments)
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr
    assert result.stdout == ""
    assert sorted(path.name for path in folder.iterdir()) == before


def test_a_finger_that_folds_ends_with_what_happened_before(
    call: Any, folder: Path, graded: str
) -> None:
    result = call(
        *("actuate", graded, "--pressure", "0:150:0", "--format", "json"),
        *("-o", "path.parquet", "--plot", "path.svg"),
    )
    assert result.exit_code == ExitCode.USAGE
    assert [row["pattern_after"] for row in json.loads(result.stdout)] == ["11100", "11111"]
    assert "dpg: the finger folds onto itself at " in result.stderr
    assert "150 kPa are 0.15" in result.stderr
    assert "final pattern" not in result.stderr
    assert not list(folder.glob("path.*"))


@pytest.mark.parametrize(("to", "is_long"), [(0.01, False), (0.15, True)])
def test_a_history_that_may_take_long_is_said_so_before(
    call: Any, folder: Path, graded: str, monkeypatch: pytest.MonkeyPatch, to: float, is_long: bool
) -> None:
    """20 steps back and forth, over a threshold or far from one."""
    monkeypatch.setattr("dpgcli.actuation.costs.LONG", 1.0)
    (folder / "long.csv").write_text("A\n" + f"0\n{to}\n" * 10)
    arguments = ("actuate", graded, "--pressure", "long.csv", "--format", "csv")
    found = call(*arguments)
    assert found.stderr.startswith("20 steps of pressure: 0 to 1 s\n") is is_long
    assert "steps of pressure" not in found.stdout
    assert call(*arguments, "-q").stderr == ""


def test_a_reader_that_stops_early_is_no_error(folder: Path, graded: str, start: Any) -> None:
    process = start("actuate", graded, "--pressure", "0:0.2:-0.1:0", "--cycles", "5000",
                    "--format", "csv", "-q")  # fmt: skip
    head = subprocess.run(
        ["head", "-1"], stdin=process.stdout, capture_output=True, text=True, check=True
    )
    process.stdout.close()
    assert head.stdout == ",".join(NAMES) + "\n"
    assert process.wait(60) == ExitCode.DONE
    assert process.stderr.read() == b""


def test_an_interrupt_leaves_nothing_half_written(folder: Path, graded: str, start: Any) -> None:
    rows = "\n".join(f"{0.01 * (k % 7):.3f}" for k in range(20_000))
    (folder / "long.csv").write_text(f"A\n{rows}\n")
    before = sorted(path.name for path in folder.iterdir())
    process = start("actuate", graded, "--pressure", "long.csv", "-o", "path.parquet")
    time.sleep(3.0)
    process.send_signal(signal.SIGINT)
    assert process.wait(20) == ExitCode.INTERRUPTED
    assert b"interrupted" in process.stderr.read()
    assert sorted(path.name for path in folder.iterdir()) == before
