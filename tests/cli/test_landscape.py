"""`dpg landscape` and `predict --columns barriers`: rows, files, figures, refusals, pipes."""

import csv
import io
import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from dpgcli.cli.exits import ExitCode
from dpgcli.design.outputs import Output

CONFIGS = Path(__file__).parents[2] / "configs"
NAMES = [
    *("step", "pattern", "kind", "unit", "energy_mJ", "barrier_mJ", "tip_x_mm", "tip_y_mm"),
    "status",
]
WAY = ("--from", "00000", "--to", "11100")
BARRIERS = [*(f"barrier_{unit}_mJ" for unit in range(1, 6)), "least_barrier_mJ"]


@pytest.fixture
def graded(folder: Path) -> str:
    (folder / "graded.yaml").write_bytes((CONFIGS / "graded_five_unit.yaml").read_bytes())
    return "graded.yaml"


def rows_of(call: Any, *arguments: str) -> list[dict[str, Any]]:
    result = call(*arguments, "-q", "--format", "json")
    assert (result.exit_code, result.stderr) == (ExitCode.DONE, "")
    rows: list[dict[str, Any]] = json.loads(result.stdout)
    return rows


def test_rows_are_the_same_in_every_format(call: Any, folder: Path, graded: str) -> None:
    arguments = ("landscape", graded, *WAY)
    objects = rows_of(call, *arguments)
    as_csv = call(*arguments, "-q", "--format", "csv").stdout
    table = call(*arguments, "-q", "-o", "way.parquet").stdout.splitlines()
    assert table[0].split() == NAMES
    assert [line.split()[1] for line in table[1:]] == [row["pattern"] for row in objects]
    for row, said in zip(csv.DictReader(io.StringIO(as_csv)), objects, strict=True):
        assert row == {k: "nan" if v is None else str(v) for k, v in said.items()}
    written = pq.read_table(folder / "way.parquet")
    assert written.column_names == list(objects[0]) == NAMES
    assert [
        {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in row.items()}
        for row in written.to_pylist()
    ] == objects


def test_the_columns_say_what_they_show(call: Any, folder: Path, graded: str) -> None:
    assert call("landscape", graded, *WAY, "-o", "way.parquet").exit_code == ExitCode.DONE
    schema = pq.read_schema(folder / "way.parquet")
    field = schema.field("barrier_mJ").metadata
    assert field[b"unit"] == b"mJ"
    assert field[b"outputs"].decode() == Output.BARRIERS
    assert b"published" in field[b"basis"]
    assert json.loads(schema.metadata[b"dpg.spec"])["finger"]["units"] == 5


def test_a_graded_finger_on_its_way(call: Any, graded: str) -> None:
    """The lower domes first, with 6.0382 mJ each; then the higher ones."""
    rows = rows_of(call, "landscape", graded, "--from", "00000", "--to", "11111")
    assert [row["pattern"] for row in rows[:4]] == ["00000", "?0000", "10000", "1?000"]
    assert rows[0]["energy_mJ"] == pytest.approx(0.0, abs=1e-12)
    assert rows[0]["barrier_mJ"] is None
    assert rows[1]["barrier_mJ"] == pytest.approx(6.03822, abs=1e-5)
    assert rows[2]["energy_mJ"] == pytest.approx(4.36133, abs=1e-5)
    assert [row["unit"] for row in rows[1::2]] == [1, 2, 3, 4, 5]
    back = rows_of(call, "landscape", graded, "--from", "11111", "--to", "00000")
    assert {row["pattern"]: row["energy_mJ"] for row in back}["11111"] == rows[-1]["energy_mJ"]
    assert back[1]["barrier_mJ"] == pytest.approx(1.67689, abs=1e-5)


def test_it_passes_the_states_on_the_way_in_their_order(call: Any, graded: str) -> None:
    arguments = ("--from", "00000", "--via", "00011", "--via", "10000", "--to", "10000")
    rows = rows_of(call, "landscape", graded, *arguments)
    states = [row["pattern"] for row in rows[::2]]
    assert states[0] == "00000"
    assert states[2] == "00011"
    assert states[-1] == "10000"
    assert len(states) == 6


def test_a_way_to_where_one_is(call: Any, graded: str) -> None:
    (row,) = rows_of(call, "landscape", graded, "--from", "10101", "--to", "10101")
    assert (row["step"], row["pattern"], row["unit"]) == (0, "10101", 0)
    result = call("landscape", graded, "--from", "10101", "--to", "10101", "--plot", "one.svg")
    assert result.exit_code == ExitCode.DONE


def test_the_summary_says_ties_and_what_barriers_rest_on(call: Any, graded: str) -> None:
    said = call("landscape", graded, *WAY).stderr
    assert "3 flips, each over a certified saddle; largest barrier 6.0382 mJ" in said
    assert "6 paths are as good within a millionth" in said
    assert "barriers: published" in said
    assert "a twentieth of finite elements'" in said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--from", "0000", "--to", "11111"), "--from 0000: expected 5 digits, 0 or 1"),
        (("--from", "00000", "--to", "1111?"), "--to 1111?: expected 5 digits, 0 or 1"),
        (("--from", "00000", "--to", ""), "is empty: expected a value"),
        (("--from", "00000", "--to", "1" * 5, "--via", "2"), "--via 2: expected 5 digits"),
        (("--from", "00000"), "--to"),
        (("--to", "00000"), "--from"),
        ((*WAY, "-o", "way.csv"), "way.csv"),
        ((*WAY, "--plot", "way.pdf"), ".svg or .png"),
        ((*WAY, "-o", "graded.yaml"), "graded.yaml"),
        ((*WAY, "-s", "finger.unts=3"), "units"),
    ],
)
def test_wrong_input_is_refused(
    call: Any, folder: Path, graded: str, arguments: tuple[str, ...], words: str
) -> None:
    before = sorted(folder.iterdir())
    result = call("landscape", graded, *arguments)
    assert result.exit_code == ExitCode.USAGE
    assert words in result.stderr
    assert result.stdout == ""
    assert sorted(folder.iterdir()) == before


def test_a_pattern_that_is_no_state_is_refused_with_its_status(call: Any, graded: str) -> None:
    change = ("-s", 'finger.overrides={"5": {"lattice": {"force_linearity": 0.3}}}')
    result = call("landscape", graded, "--from", "00000", "--to", "11111", *change)
    assert result.exit_code == ExitCode.USAGE
    assert "--to 11111: expected a stable state, found not_bistable" in result.stderr
    rows = rows_of(call, "landscape", graded, *WAY, *change)
    assert len(rows) == 7


def test_too_many_units_are_refused_with_the_number(call: Any, folder: Path) -> None:
    (folder / "long.yaml").write_bytes((CONFIGS / "twenty_unit.yaml").read_bytes())
    result = call("landscape", "long.yaml", "--from", "0" * 20, "--to", "1" * 20)
    assert result.exit_code == ExitCode.USAGE
    assert "landscape of 20 units: expected at most 12, with 4,096 states" in result.stderr


def test_the_figure_has_labels_and_the_same_bytes(call: Any, folder: Path, graded: str) -> None:
    for name in ("a.svg", "b.svg"):
        assert call("landscape", graded, *WAY, "--plot", name).exit_code == ExitCode.DONE
    text = (folder / "a.svg").read_text()
    assert text == (folder / "b.svg").read_text()
    for words in (
        *("energy (mJ)", "travel of the domes that flip, added up (mm)"),
        *(">00000<", ">10000<", ">11000<", ">11100<", ">unit 3<", ">6.04 mJ<"),
        *("stable state", "saddle, with its barrier", "saddle ?0000: 6.0382 mJ"),
    ):
        assert words in text, words
    assert call("landscape", graded, *WAY, "--plot", "a.png").exit_code == ExitCode.DONE
    assert (folder / "a.png").read_bytes().startswith(b"\x89PNG")


def test_a_spec_from_standard_input_and_a_reader_that_stops_early(
    folder: Path, graded: str
) -> None:
    program = f"{sys.executable} -c 'from dpgcli.cli.main import main; main()'"
    command = f"cat {graded} | {program} landscape - --from 00000 --to 11111 -q | head -n 1"
    done = subprocess.run(
        command, shell=True, cwd=folder, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == NAMES


def test_barriers_are_columns_of_states(call: Any, folder: Path, graded: str) -> None:
    rows = rows_of(call, "predict", graded, "--columns", "barriers")
    assert list(rows[0]) == ["pattern", "status", *BARRIERS, "least_robust_unit"]
    assert len(rows) == 32
    by_pattern = {row["pattern"]: row for row in rows}
    rest, one = by_pattern["00000"], by_pattern["10000"]
    assert [rest[name] for name in BARRIERS[:5]] == pytest.approx(
        [6.03822] * 3 + [9.65665] * 2, abs=1e-5
    )
    assert one["barrier_1_mJ"] == pytest.approx(6.03823 - 4.36133, abs=2e-5)  # to reset
    assert (rest["least_robust_unit"], one["least_robust_unit"]) == ("1,2,3", "1")
    assert one["least_barrier_mJ"] == one["barrier_1_mJ"]
    way = rows_of(call, "landscape", graded, *WAY)
    assert way[1]["barrier_mJ"] == rest["barrier_1_mJ"]
    few = rows_of(call, "predict", graded, "--columns", "barriers", "--pattern", "1000?")
    assert few == [by_pattern["10000"], by_pattern["10001"]]
    assert call("predict", graded, "--columns", "barriers", "-o", "b.parquet").exit_code == 0
    field = pq.read_schema(folder / "b.parquet").field("barrier_1_mJ")
    assert field.metadata[b"outputs"].decode() == Output.BARRIERS


def test_barriers_are_paid_for_only_where_they_are_asked_for(call: Any, graded: str) -> None:
    assert "barrier_1_mJ" not in rows_of(call, "predict", graded)[0]
    assert "barrier_1_mJ" in rows_of(call, "predict", graded, "--columns", "all")[0]
    plan = call("explain", graded).stdout
    assert "barriers columns: given on request: --columns barriers" in plan
    assert "160 barriers between states" not in plan
    asked = call("explain", graded, "--columns", "barriers").stdout
    assert "160 barriers between states" in asked


def test_one_barrier_by_its_name_keeps_the_bars(call: Any, graded: str) -> None:
    """A target error would drop them; barriers with bars are asked for."""
    names = ("--columns", "barrier_3_mJ", "--target-error", "1mm")
    (row,) = rows_of(call, "predict", graded, *names, "--pattern", "11100")
    exact = rows_of(call, "predict", graded, "--columns", "barriers", "--pattern", "11100")
    assert row["barrier_3_mJ"] == pytest.approx(exact[0]["barrier_3_mJ"], rel=1e-9)


def test_the_summary_names_the_least_robust_unit(call: Any, graded: str) -> None:
    said = call("predict", graded, "--columns", "barriers").stderr
    assert "least robust: unit 3 in 00100, 1.6769 mJ" in said  # the first of those that tie
    assert "not found" not in said
    rest = call("predict", graded, "--columns", "barriers", "--pattern", "00000").stderr
    assert "least robust: units 1,2,3 in 00000, 6.0382 mJ" in rest
    without = call("predict", graded).stderr
    assert "least robust" not in without


def test_barriers_that_are_not_found_are_counted(
    call: Any, graded: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As if no saddle led to both of its states."""
    monkeypatch.setattr(
        "dpgcli.states.saddles._are_same", lambda ends, _: np.zeros(len(ends.status), bool)
    )
    result = call("predict", graded, "--columns", "barriers", "--pattern", "1000?")
    assert result.exit_code == ExitCode.DONE
    assert "10 barriers not found: no certified saddle parts the two states" in result.stderr
    assert "least robust" not in result.stderr
    way = call("landscape", graded, *WAY)
    assert way.exit_code == ExitCode.USAGE
    assert "no flips of single units lead there from 00000; 160 barriers not found" in way.stderr


def test_a_state_without_neighbors_has_empty_barriers(call: Any, folder: Path, study: Any) -> None:
    arguments = ("-s", "finger.lattice.force_linearity=0.3", "--columns", "barriers")
    rows = rows_of(call, "predict", study[0], *arguments)
    assert all(row["barrier_1_mJ"] is None for row in rows)
    assert {row["least_robust_unit"] for row in rows} == {""}
    assert "least robust" not in call("predict", study[0], *arguments).stderr
