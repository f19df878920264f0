"""Rows as they are printed and written, options that change them, and files."""

import csv
import io
import json
import math
import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow.parquet as pq
import pytest

from dpgcli.cli.exits import ExitCode

Call = Callable[..., Any]
FINE = ("--formulation", "lattice", "--tolerance", "1e-14")
FIRST = [
    "pattern",
    "status",
    "tip_x_mm",
    "tip_y_mm",
    "tip_angle_rad",
    "tip_angle_deg",
    "energy_mJ",
    "min_eigenvalue_N_per_mm",
    "residual_N",
]
IN_THE_TABLE = [*FIRST[:4], "tip_angle_deg", "energy_mJ", "numerical_error_mm"]
HINGE_OF_NANOMETERS = "finger.lattice.hinge_stiffness_N_mm_per_rad=24.2e-12"
ONE_WELL = ("-s", "finger.lattice.force_linearity=0.2")


def rows_of(call: Call, *arguments: str) -> list[dict[str, Any]]:
    result = call("predict", "-q", *arguments, "--format", "json")
    assert (result.exit_code, result.stderr) == (0, "")

    def refused(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    rows: list[dict[str, Any]] = json.loads(result.stdout, parse_constant=refused)
    return rows


@pytest.mark.parametrize("form", ["table", "json", "csv", "parquet"])
def test_the_first_columns_are_fixed(call: Call, folder: Path, form: str) -> None:
    if form == "parquet":
        call("predict", "-q", "three_unit.yaml", "-o", "states.parquet")
        names = pq.read_schema(folder / "states.parquet").names
    else:
        text = call("predict", "-q", "three_unit.yaml", "--format", form).stdout
        head = text.splitlines()[0]
        names = list(json.loads(text)[0]) if form == "json" else head.replace(",", " ").split()
    assert names[: len(FIRST)] == FIRST if form != "table" else names == IN_THE_TABLE


def test_the_table_of_a_finger_of_nanometers_has_digits_too(call: Call, study: Any) -> None:
    lengths = {"segment_length_mm": 13.75, "segment_height_mm": 10.75, "stroke_mm": 3.5}
    changes = [f"finger.lattice.{key}={value * 1e-6}" for key, value in lengths.items()]
    settings = [word for change in changes for word in ("-s", change)]
    columns = ("--columns", "tip_x_mm,tip_y_mm", "--pattern", "111")
    large = call("predict", study[0], "-q", *columns)
    small = call("predict", study[0], "-q", *columns, "-s", HINGE_OF_NANOMETERS, *settings)
    x, y = map(float, large.stdout.split()[-2:])
    small_x, small_y = map(float, small.stdout.split()[-2:])
    assert 1e6 * small_x == pytest.approx(x, rel=1e-5)
    assert 1e6 * small_y == pytest.approx(y, rel=1e-5)


@pytest.mark.parametrize("changes", [(), ONE_WELL, ("--nodes",)])
@pytest.mark.parametrize("spec", ["three_unit.yaml", "gripper.yaml"])
def test_all_formats_hold_the_same_values(
    call: Call, folder: Path, spec: str, changes: tuple[str, ...]
) -> None:
    expected = rows_of(call, spec, *changes)
    text = call("predict", "-q", spec, *changes, "--format", "csv").stdout
    call("predict", "-q", spec, *changes, "-o", "states.parquet")
    for got in (
        [list(row.items()) for row in csv.DictReader(io.StringIO(text))],
        [list(row.items()) for row in pq.read_table(folder / "states.parquet").to_pylist()],
        [
            list(row.items())
            for row in pd.read_parquet(folder / "states.parquet").to_dict("records")
        ],
    ):
        assert len(got) == len(expected)
        for row, wanted in zip(got, expected, strict=True):
            assert [name for name, _ in row] == list(wanted)
            for (_, value), target in zip(row, wanted.values(), strict=True):
                if target is None:
                    assert math.isnan(float(value))
                elif isinstance(target, float):
                    assert float(value) == target
                else:
                    assert str(value) == str(target)


def test_a_table_of_one_state_reads_as_the_manual_says(call: Call) -> None:
    result = call("predict", "three_unit.yaml", "--pattern", "101")
    names, values = (line.split() for line in result.stdout.splitlines())
    row = dict(zip(names, values, strict=True))
    assert (row["pattern"], row["status"]) == ("101", "stable")
    assert float(row["tip_x_mm"]) == pytest.approx(38.3598, abs=1e-3)


def test_the_summary_is_on_standard_error(call: Call) -> None:
    result = call("predict", "three_unit.yaml")
    assert "8 stable" in result.stderr
    assert "residual" in result.stderr
    assert " s (" in result.stderr
    assert "residual " not in result.stdout.replace("residual_N", "")


def test_quiet_is_quiet(call: Call) -> None:
    assert call("predict", "-q", "three_unit.yaml").stderr == ""
    assert call("predict", "--quiet", "three_unit.yaml").stderr == ""


def test_lines_of_a_table_end_without_blanks(call: Call) -> None:
    text = call("predict", "-q", "three_unit.yaml", *ONE_WELL).stdout
    assert [line for line in text.splitlines() if line != line.rstrip()] == []


def test_only_the_first_rows_of_a_long_table_are_printed(call: Call) -> None:
    result = call("predict", "three_unit.yaml", "-s", "finger.units=8")
    assert len(result.stdout.splitlines()) == 65
    assert "256 rows" in result.stderr
    whole = call("predict", "-q", "three_unit.yaml", "-s", "finger.units=8", "--format", "csv")
    assert len(whole.stdout.splitlines()) == 257


def test_a_pattern_without_a_state_says_why(call: Call) -> None:
    rows = rows_of(call, "three_unit.yaml", *ONE_WELL)
    assert [row["status"] for row in rows] == ["stable", *["not_bistable"] * 7]
    for row in rows[1:]:
        assert row["tip_x_mm"] is row["energy_mJ"] is row["min_eigenvalue_N_per_mm"] is None
        assert row["reached_pattern"] == "000"
    table = call("predict", "three_unit.yaml", *ONE_WELL)
    assert "reached_pattern" in table.stdout
    assert "7 not_bistable" in table.stderr
    assert "not_bistable: a unit that the pattern inverts has no second well" in table.stderr
    assert "marginal: " not in table.stderr
    alone = call("predict", "three_unit.yaml", *ONE_WELL, "--pattern", "1*")
    assert (alone.exit_code, "no stable state" in alone.stderr) == (0, True)


def test_node_coordinates_that_stiff_bars_spoil_say_what_to_take(call: Call) -> None:
    stiff = ("-s", "finger.linear_stiffness_N_per_mm=1e9", "-s", "finger.units=1")
    result = call("predict", "three_unit.yaml", *stiff, *FINE)
    assert "1 not_converged" in result.stderr
    assert "(node coordinates with very stiff bars: take the chain)" in result.stderr
    assert "as loads grow" not in result.stderr


def test_a_state_that_is_lost_as_loads_grow_says_so(call: Call) -> None:
    """Pressed from its end the finger folds onto itself; the chain has no stiff bars to mind."""
    pressed = ("-s", "finger.units=2", "-s", "loads.tip_force_x_N=-6.5", "--pattern", "10")
    result = call("predict", "three_unit.yaml", *pressed)
    assert "1 not_converged" in result.stderr
    assert "or the state is lost, or folds onto itself, as loads grow" in result.stderr
    assert "node coordinates" not in result.stderr


@pytest.mark.parametrize(
    ("globs", "found"),
    [
        (["101"], ["101"]),
        (["1*1"], ["101", "111"]),
        (["1??"], ["100", "101", "110", "111"]),
        (["111", "000"], ["000", "111"]),
        (["1*", "1*1"], ["100", "101", "110", "111"]),
    ],
)
def test_patterns_select(call: Call, globs: list[str], found: list[str]) -> None:
    words = [word for glob in globs for word in ("--pattern", glob)]
    rows = rows_of(call, "three_unit.yaml", *words)
    assert [row["pattern"] for row in rows] == found
    whole = {row["pattern"]: row for row in rows_of(call, "three_unit.yaml")}
    assert rows == [whole[pattern] for pattern in found]


def test_settings_are_typed_as_in_a_file_and_the_last_wins(call: Call) -> None:
    settings = ("-s", "finger.units=4", "--set", "finger.units=2")
    assert len(rows_of(call, "three_unit.yaml", *settings)) == 4
    stiff = rows_of(call, "three_unit.yaml", "-s", "finger.linear_stiffness_N_per_mm=1e6")
    assert stiff[7]["tip_y_mm"] != rows_of(call, "three_unit.yaml")[7]["tip_y_mm"]
    graded = ("-s", "finger.overrides.2.geometry.dome_height_mm=7")
    assert rows_of(call, "three_unit.yaml", *graded)[2] != rows_of(call, "three_unit.yaml")[2]


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("finger.units=five", ["finger.units", '"five"']),
        ("finger.units=5.0", ["finger.units", "5.0"]),
        ("finger.units='5'", ["finger.units", '"5"']),
        ("finger.units=", ["finger.units", "nothing"]),
        ("finger.units=[1", ["finger.units", "YAML"]),
        ("finger.unis=5", ["unis", "did you mean units?"]),
        ("units=5", ["units", "did you mean finger.units?"]),
        ("finger.lattice.strok_mm=3", ["did you mean stroke_mm?"]),
        ("finger.units", ["key.path=value"]),
        ("=5", ["key.path=value"]),
        ("finger.units.deeper=5", ["finger.units"]),
    ],
)
def test_a_wrong_setting_is_a_problem(call: Call, setting: str, words: list[str]) -> None:
    result = call("predict", "three_unit.yaml", "-s", setting)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("--set: ")
    assert [word for word in words if word not in result.stderr] == []


def test_wrong_settings_are_listed_together(call: Call) -> None:
    settings = ("-s", "finger.unis=5", "-s", "gripper.bogus=1", "-s", "finger.units=0")
    lines = call("predict", "three_unit.yaml", *settings).stderr.splitlines()
    assert len([line for line in lines if ": expected " in line]) >= 3


def test_a_section_that_is_none_gets_no_hint_about_numbers(call: Call) -> None:
    result = call("predict", "three_unit.yaml", "-s", "finger=3")
    assert "a section of keys" in result.stderr
    assert "1e12" not in result.stderr


def test_columns_are_chosen(call: Call) -> None:
    rows = rows_of(call, "three_unit.yaml", "--columns", "energy_mJ, openings")
    names = ["pattern", "status", "energy_mJ", *(f"opening_{i}_mm" for i in (1, 2, 3))]
    assert list(rows[0]) == names
    nodes = rows_of(call, "three_unit.yaml", "--nodes")[0]
    assert {"B0_x_mm", "T3_y_mm"} < set(nodes)
    assert nodes["B3_x_mm"] == nodes["tip_x_mm"]


def test_unknown_columns_are_named_with_what_there_is(call: Call) -> None:
    result = call("predict", "three_unit.yaml", "--columns", "tip_x,energies")
    assert (result.exit_code, result.stdout) == (2, "")
    assert "tip_x" in result.stderr
    assert "tip_x_mm" in result.stderr


def test_both_formulations_agree(call: Call) -> None:
    chain = rows_of(call, "three_unit.yaml")
    lattice = rows_of(call, "three_unit.yaml", "--formulation", "lattice")
    assert len(chain) == 8
    for one, other in zip(chain, lattice, strict=True):
        assert other["tip_x_mm"] == pytest.approx(one["tip_x_mm"], abs=1e-6)
        assert other["tip_y_mm"] == pytest.approx(one["tip_y_mm"], abs=1e-6)


@pytest.mark.parametrize(
    "target", ["missing/states.parquet", "folder", "three_unit.yaml/states.parquet", "", ".."]
)
@pytest.mark.parametrize("option", ["--output", "--plot"])
def test_a_place_that_cannot_be_written_is_found_before_the_work(
    call: Call, folder: Path, option: str, target: str
) -> None:
    (folder / "folder").mkdir()
    before = sorted(folder.rglob("*"))
    result = call("predict", "three_unit.yaml", option, target)
    assert (result.exit_code, result.stdout) == (2, "")
    assert "Traceback" not in result.stderr
    assert sorted(folder.rglob("*")) == before


def test_the_run_file_too_is_tried_before_the_work(call: Call, folder: Path) -> None:
    (folder / "states.run.json").mkdir()
    result = call("predict", "three_unit.yaml", "-o", "states.parquet")
    assert (result.exit_code, result.stdout) == (2, "")
    assert not (folder / "states.parquet").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ("predict", "-q", "three_unit.yaml", "-o", "pipe.svg"),
        ("predict", "-q", "three_unit.yaml", "--plot", "pipe.svg"),
        ("init", "--force", "pipe.svg"),
    ],
)
def test_what_is_no_plain_file_is_never_replaced(
    run: Any, folder: Path, arguments: tuple[str, ...]
) -> None:
    """A pipe here; renaming over a device such as /dev/null would harm the whole machine."""
    os.mkfifo(folder / "pipe.svg")
    result = run(*arguments)
    assert stat.S_ISFIFO((folder / "pipe.svg").stat().st_mode)
    assert result.returncode == 2
    assert "pipe.svg" in result.stderr


def test_the_spec_is_not_overwritten_by_its_table(call: Call, folder: Path) -> None:
    before = (folder / "three_unit.yaml").read_bytes()
    result = call("predict", "three_unit.yaml", "-o", "three_unit.yaml")
    assert (folder / "three_unit.yaml").read_bytes() == before
    assert result.exit_code == 2


def test_table_and_figure_need_two_names(call: Call, folder: Path) -> None:
    result = call("predict", "three_unit.yaml", "-o", "states.svg", "--plot", "states.svg")
    assert result.exit_code == 2
    assert not (folder / "states.svg").exists()


def test_a_table_comes_with_its_run(call: Call, folder: Path) -> None:
    assert call("predict", "-q", "three_unit.yaml", "-o", "states.parquet").exit_code == 0
    facts = json.loads((folder / "states.run.json").read_text(encoding="utf-8"))
    assert facts["table"] == "states.parquet"
    assert facts["states"]["stable"] == 8
    assert facts["seconds"] > 0
    assert sorted(p.name for p in folder.glob("*states*")) == ["states.parquet", "states.run.json"]


def test_files_get_the_permissions_of_new_files(run: Any, folder: Path) -> None:
    for mask, mode in ((0o077, 0o600), (0o022, 0o644)):
        for path in folder.glob("states.*"):
            path.unlink()
        result = run("predict", "-q", "three_unit.yaml", "-o", "states.parquet", umask=mask)
        assert result.returncode == 0
        for name in ("states.parquet", "states.run.json"):
            assert stat.S_IMODE((folder / name).stat().st_mode) == mode


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spec", "name"),
    [
        pytest.param("twenty_unit.yaml", "states.parquet", marks=pytest.mark.slow),
        ("three_unit.yaml", "states.svg"),
    ],
)
def test_two_runs_write_the_same_bytes(run: Any, folder: Path, spec: str, name: str) -> None:
    option = "-o" if name.endswith("parquet") else "--plot"
    contents = []
    for _ in range(2):
        assert run("predict", "-q", spec, option, name).returncode == 0
        contents.append((folder / name).read_bytes())
        (folder / name).unlink()
    assert contents[0] == contents[1]


def test_a_figure_names_its_states(call: Call, folder: Path) -> None:
    assert call("predict", "-q", "gripper.yaml", "--plot", "states.svg").exit_code == 0
    assert call("predict", "-q", "three_unit.yaml", "--plot", "three.svg").exit_code == 0
    text = (folder / "three.svg").read_text(encoding="utf-8")
    assert text.startswith("<?xml")
    assert all(f">{pattern}<" in text for pattern in ("000", "101", "111"))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("three_unit.yaml", "--plot", "states.pdf"), [".svg", ".png"]),
        (("three_unit.yaml", "--plot", "states"), [".svg", ".png"]),
        (("twenty_unit.yaml", "--plot", "states.svg"), ["64", "--pattern"]),
        (("twenty_unit.yaml", "--sketch"), ["--sketch draws at most 64", "--pattern"]),
        (("three_unit.yaml", "--overlay"), ["--overlay", "--plot"]),
        (("three_unit.yaml", "--sketch", "--format", "csv"), ["--sketch", "--format csv"]),
        (("three_unit.yaml", "--sketch", "--format", "json"), ["--sketch", "--format json"]),
    ],
)
def test_a_figure_that_cannot_be_drawn_is_refused_at_once(
    call: Call, folder: Path, arguments: tuple[str, ...], words: list[str]
) -> None:
    result = call("predict", *arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    assert [word for word in words if word not in result.stderr] == []
    assert not list(folder.glob("states*"))


def test_sketches_stand_under_the_table(call: Call) -> None:
    result = call("predict", "-q", "three_unit.yaml", "--pattern", "1*1", "--sketch")
    table, sketches = result.stdout.split("\n\n", 1)
    assert [line.split()[0] for line in table.splitlines()] == ["pattern", "101", "111"]
    assert sketches.splitlines()[0].split() == ["101", "111"]
    assert "\u28ff" in sketches


def test_sketches_need_letters_of_braille(run: Any) -> None:
    result = run("predict", "three_unit.yaml", "--sketch", env={"PYTHONIOENCODING": "ascii"})
    assert (result.returncode, result.stdout) == (2, "")
    assert "braille" in result.stderr and "UTF-8" in result.stderr
    without = run("predict", "three_unit.yaml", env={"PYTHONIOENCODING": "ascii"})
    assert without.returncode == 0


def test_without_matplotlib_it_says_what_to_install(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    result = call("predict", "three_unit.yaml", "--plot", "states.svg")
    assert (result.exit_code, result.stdout) == (2, "")
    assert "pip install matplotlib" in result.stderr


FITTED = """\
calibration_version: 1
made_by: hand
method: none
values:
  force_linearity: {value: 0.043, standard_error: 0.002}
  segment_height_mm: {value: 10.75, standard_error: 0.1}
geometry: {dome_height_mm: 6.5, dome_thickness_mm: 0.75, elastic_modulus_MPa: 26,
  unit_cell_mm: 22, limiting_layer_thickness_mm: 1.5}
"""
BY_FILE = ("-s", "finger.calibration=[fitted.yaml, published]")
UNCERTAIN = [
    "tip_x_uncertainty_mm",
    "tip_y_uncertainty_mm",
    "tip_angle_uncertainty_rad",
    "uncertainty_covers",
]


@pytest.fixture
def fitted(folder: Path) -> None:
    (folder / "fitted.yaml").write_text(FITTED)


@pytest.mark.usefixtures("fitted")
def test_uncertainty_comes_on_request_and_last(call: Call, folder: Path) -> None:
    plain = rows_of(call, "three_unit.yaml", *BY_FILE)
    found = rows_of(call, "three_unit.yaml", *BY_FILE, "--uncertainty")
    assert list(found[0]) == [*plain[0], *UNCERTAIN]
    assert [{n: v for n, v in row.items() if n not in UNCERTAIN} for row in found] == plain
    alone = rows_of(call, "three_unit.yaml", *BY_FILE, "--columns", "uncertainty")
    assert list(alone[0]) == ["pattern", "status", *UNCERTAIN]
    call("predict", "-q", "three_unit.yaml", *BY_FILE, "--uncertainty", "-o", "u.parquet")
    table = pd.read_parquet(folder / "u.parquet")
    assert table[UNCERTAIN].to_dict("records") == [{n: r[n] for n in UNCERTAIN} for r in alone]
    unit = pq.read_schema(folder / "u.parquet").field("tip_angle_uncertainty_rad").metadata
    assert unit[b"unit"] == b"rad"


@pytest.mark.usefixtures("fitted")
@pytest.mark.parametrize(
    "command",
    [
        ("predict", "-o", "fitted.yaml"),
        ("bench", "--json", "fitted.yaml"),
        ("stress", "--only", "mirror", "-o", "fitted.yaml"),
        ("compare", "--plot", "link.svg"),
    ],
    ids=lambda command: command[0],
)
def test_the_calibration_that_a_spec_names_is_no_output(
    call: Call, folder: Path, command: tuple[str, ...]
) -> None:
    (folder / "link.svg").symlink_to("fitted.yaml")
    (folder / "tips.csv").write_text("pattern,tip_x_mm,tip_y_mm\n100,39,-10\n")
    data = ("tips.csv",) if command[0] == "compare" else ()
    result = call(command[0], "three_unit.yaml", *data, *BY_FILE, *command[1:])
    assert result.exit_code == ExitCode.USAGE
    assert "is the spec or data that is read: give another name" in result.stderr
    assert (folder / "fitted.yaml").read_text() == FITTED


def test_a_link_stays_a_link(call: Call, folder: Path) -> None:
    (folder / "far").mkdir()
    (folder / "states.parquet").symlink_to("far/away.parquet")
    assert call("predict", "three_unit.yaml", "-q", "-o", "states.parquet").exit_code == 0
    assert (folder / "states.parquet").is_symlink()
    assert len(pd.read_parquet(folder / "far" / "away.parquet")) == 8
    (folder / "one.svg").symlink_to("two.svg")
    (folder / "two.svg").symlink_to("one.svg")
    result = call("predict", "three_unit.yaml", "-q", "--plot", "one.svg")
    assert result.exit_code in (ExitCode.DONE, ExitCode.USAGE)
    assert "Traceback" not in result.stderr


@pytest.mark.usefixtures("fitted")
def test_uncertainty_is_that_of_two_values_a_little_off(call: Call) -> None:
    """By differences of whole predictions: squares of the two errors add."""
    (found,) = rows_of(call, "three_unit.yaml", *BY_FILE, "--uncertainty", "--pattern", "110")
    squares = dict.fromkeys(("tip_x_mm", "tip_y_mm", "tip_angle_rad"), 0.0)
    soft = ("-s", "finger.geometry.unit_cell_mm=null")
    for key, value, error in (("force_linearity", 0.043, 0.002), ("segment_height_mm", 10.75, 0.1)):
        ends = []
        for sign in (-1e-3, 1e-3):
            setting = f"finger.lattice.{key}={value + sign * error!r}"
            (row,) = rows_of(
                call, "three_unit.yaml", *BY_FILE, *soft, "-s", setting, "--pattern", "110"
            )
            ends.append(row)
        for name in squares:
            squares[name] += ((ends[1][name] - ends[0][name]) / 2e-3) ** 2
    for name, column in zip(squares, UNCERTAIN[:3], strict=True):
        assert found[column] == pytest.approx(math.sqrt(squares[name]), rel=1e-5)


@pytest.mark.usefixtures("fitted")
def test_a_state_that_does_not_exist_has_no_uncertainty(call: Call) -> None:
    wells = ("-s", "finger.overrides.2.lattice.force_linearity=0.3")
    rows = rows_of(call, "three_unit.yaml", *BY_FILE, *wells, "--uncertainty")
    assert len(rows) == 8
    for row in rows:
        assert (row["status"] == "stable") == (row["pattern"][1] == "0")
        assert (row["tip_x_uncertainty_mm"] is not None) == (row["status"] == "stable")
    straight = rows[0]
    assert straight["tip_x_uncertainty_mm"] == pytest.approx(0.0, abs=1e-12)
    assert straight["tip_y_uncertainty_mm"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.usefixtures("fitted")
def test_a_grippers_uncertainty_is_that_of_its_finger(call: Call) -> None:
    options = (*BY_FILE, "--uncertainty", "--pattern", "11111")
    (gripper,) = rows_of(call, "gripper.yaml", *options)
    (finger,) = rows_of(call, "gripper.yaml", *options, "-s", "gripper=null")
    assert [gripper[name] for name in UNCERTAIN] == [finger[name] for name in UNCERTAIN]


@pytest.mark.usefixtures("fitted")
@pytest.mark.parametrize("command", ["predict", "explain"])
@pytest.mark.parametrize(
    ("options", "said"),
    [
        ((), "--uncertainty: no value of the spec has a standard error"),
        ((*BY_FILE, "--formulation", "lattice"), "drop --formulation"),
        (
            (
                *BY_FILE,
                "-s",
                "finger.lattice.force_linearity=0.04",
                "-s",
                "finger.lattice.segment_height_mm=10.75",
            ),
            "--uncertainty: no value of the spec has a standard error",
        ),
    ],
)
def test_uncertainty_of_what_has_none_is_refused(
    call: Call, command: str, options: tuple[str, ...], said: str
) -> None:
    result = call(command, "three_unit.yaml", "--uncertainty", *options)
    assert (result.exit_code, result.stdout) == (2, "")
    assert said in result.stderr


@pytest.mark.usefixtures("fitted")
def test_without_the_option_errors_change_no_byte(call: Call, folder: Path) -> None:
    texts = []
    for error in ("0.002", "0.2"):
        (folder / "fitted.yaml").write_text(FITTED.replace("0.002", error))
        texts.append(call("predict", "-q", "three_unit.yaml", *BY_FILE, "--format", "csv").stdout)
    assert texts[0] == texts[1]


LAWS = {
    "published": "published law, pushing and pulling",
    "push_only": "push-only law, published energy of the dome",
    "tabulated": "tabulated law, pushing and pulling",
}


@pytest.mark.parametrize(("law", "description"), LAWS.items())
def test_the_law_is_named_wherever_states_are_summed_up(
    call: Call, folder: Path, law: str, description: str
) -> None:
    travel = [0.05 * place for place in range(91)]
    dome = {
        "values": {
            "bistable_stiffness_N_per_mm": {"value": 12.84},
            "stroke_mm": {"value": 3.5},
        },
        "curve": {
            "travel_mm": travel,
            "energy_mJ": [6.42 * x**2 * (0.043 + 0.957 * (1 - x / 3.5) ** 2) for x in travel],
            "opening_per_travel": 1.0,
        },
    }
    head = {"calibration_version": 1, "made_by": "hand", "method": "none"}
    (folder / "dome.yaml").write_text(json.dumps({**head, **dome}))
    options = ["three_unit.yaml", "-s", f"finger.law={law}"]
    if law == "tabulated":
        options += ["-s", "finger.calibration=[dome.yaml, published]"]
    result = call("predict", *options, "-o", "law.parquet")
    assert result.stderr.splitlines()[-2].endswith(f"; {description}")
    assert pq.read_metadata(folder / "law.parquet").metadata[b"dpg.law"] == description.encode()
    assert f"({description})" in call("explain", *options).stdout
    (row,) = rows_of(call, *options, "--pattern", "101")
    assert row["tip_x_mm"] == pytest.approx(38.35981703, abs=1e-4)


def test_a_file_of_domes_can_be_predicted_from_its_table(call: Call, folder: Path) -> None:
    (folder / "fitted.yaml").write_text(FITTED)
    call("predict", "-q", "three_unit.yaml", *BY_FILE, "-o", "t.parquet")
    kept = pq.read_metadata(folder / "t.parquet").metadata[b"dpg.spec"]
    (folder / "kept.json").write_bytes(kept)
    (folder / "fitted.yaml").unlink()
    again = rows_of(call, "kept.json", "--uncertainty")
    (folder / "fitted.yaml").write_text(FITTED)
    assert again == rows_of(call, "three_unit.yaml", *BY_FILE, "--uncertainty")


@pytest.mark.parametrize(("patterns", "is_long"), [((), False), (("--pattern", "00*"), True)])
def test_what_takes_long_is_said_before(
    call: Call, monkeypatch: pytest.MonkeyPatch, patterns: tuple[str, ...], is_long: bool
) -> None:
    """The work itself is left out; `-q` says nothing."""
    monkeypatch.setattr("dpgcli.states.predict.Prediction.blocks", lambda _: iter(()))
    columns = ("twenty_unit.yaml", "--columns", "min_eigenvalue_N_per_mm", *patterns)
    said = call("predict", *columns, "--format", "csv").stderr.splitlines()
    assert said[0].startswith("262,144 states: about ") == is_long
    assert call("predict", "-q", *columns, "--format", "csv").stderr == ""


@pytest.mark.parametrize(("first", "second"), [("t", "t.parquet"), ("t.parquet", "t")])
def test_the_facts_of_one_table_are_not_replaced_by_those_of_another(
    call: Call, folder: Path, first: str, second: str
) -> None:
    one = ("predict", "three_unit.yaml", "-q", "-o")
    assert call(*one, first).exit_code == ExitCode.DONE
    facts = (folder / "t.run.json").read_bytes()
    refused = call(*one, second)
    assert refused.exit_code == ExitCode.USAGE
    assert refused.stderr == f"dpg: t.run.json has the facts of {first}: give another name\n"
    assert (folder / "t.run.json").read_bytes() == facts
    assert not (folder / second).exists()
    assert call(*one, first).exit_code == ExitCode.DONE
    (folder / first).unlink()
    assert call(*one, second).exit_code == ExitCode.DONE
