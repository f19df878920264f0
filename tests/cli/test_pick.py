"""`dpg pick` and `dpg predict --design`: what is chosen, said and written, and exit codes."""

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow.parquet as pq
import pytest

from dpgcli.cli.exits import ExitCode
from dpgcli.sweeps.fronts import on_front

Call = Callable[..., Any]
SWEEP = """\
base: three_unit.yaml
space:
  - {key: finger.geometry.dome_height_mm, linear: {from: 5.5, to: 7.5, count: 5}}
  - {key: finger.geometry.unit_separation_mm, values: [2.5, 6.0]}
constraints: [dome_height_mm < 7.2]
"""


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a sweep: ten designs, two of them excluded, two invalid."""
    import dpgcli as dpg

    base = Path("configs/three_unit.yaml").read_text(encoding="utf-8")
    folder = tmp_path_factory.mktemp("swept")
    (folder / "three_unit.yaml").write_text(base, encoding="utf-8")
    (folder / "sweep.yaml").write_text(SWEEP, encoding="utf-8")
    dpg.sweep(folder / "sweep.yaml", folder / "out", executor="serial")
    return folder / "out"


@pytest.fixture
def out(folder: Path, tables: Path) -> str:
    (folder / "out").mkdir()
    for name in ("designs.parquet", "states.parquet"):
        (folder / "out" / name).write_bytes((tables / name).read_bytes())
    return "out"


def test_rows_in_order_and_what_became_of_the_others(call: Call, out: str) -> None:
    where = ("--where", "dome_height_mm > 5.8 and unit_separation_mm < 5")
    result = call("pick", out, *where, "--minimize", "reach_min_mm", "--top", "2")
    assert result.exit_code == 0
    first, *rows = result.stdout.splitlines()
    assert first.split()[:3] == ["design", "dome_height_mm", "unit_separation_mm"]
    assert [row.split()[0] for row in rows] == ["6", "4"]
    assert result.stderr.splitlines() == [
        "10 designs: 6 with stable states, 2 excluded, 2 invalid",
        "dome_height_mm > 5.8: met by 5 of 6 designs",
        "unit_separation_mm < 5: met by 4 of 6 designs",
        "all of them: met by 3 designs",
    ]


def test_nothing_left_is_5_and_explains_itself(call: Call, out: str, folder: Path) -> None:
    where = ("--where", "dome_height_mm > 6.8 and unit_separation_mm > 5 and n_stable < 8")
    result = call("pick", out, *where, "--spec", "best.yaml", "-o", "best.parquet")
    assert result.exit_code == ExitCode.NOTHING_SELECTED
    assert result.stdout == ""
    assert "dpg: n_stable < 8: met by 0 of 6 designs; all others by 1\n" in result.stderr
    assert not [*folder.glob("best.*")]


def test_a_spec_predicts_what_the_sweep_has(call: Call, out: str, folder: Path) -> None:
    options = ("--minimize", "reach_min_mm", "--maximize", "reach_max_mm", "--top", "1")
    result = call("pick", out, *options, "--spec", "best.yaml", "--format", "json")
    (row,) = json.loads(result.stdout)
    (folder / "three_unit.yaml").unlink()
    call("predict", "best.yaml", "-o", "best.parquet", "-q")
    call("predict", out, "--design", str(row["design"]), "-o", "by_number.parquet", "-q")
    states = pd.read_parquet(folder / out / "states.parquet").query("design == @row['design']")
    for name in ("best", "by_number"):
        found = pd.read_parquet(folder / f"{name}.parquet")
        shared = [column for column in found if column in states and column != "status"]
        pd.testing.assert_frame_equal(
            found[shared], states[shared].reset_index(drop=True), rtol=1e-12, atol=1e-12
        )
    assert f"design {row['design']} of the sweep around three_unit.yaml" in result.stderr


def test_states_are_chosen_among_and_lead_to_their_design(
    call: Call, out: str, folder: Path
) -> None:
    options = ("--states", "--minimize", "tip_y_mm", "--top", "1", "--spec", "curled.yaml")
    result = call("pick", out, *options, "--format", "csv")
    head, row = (line.split(",") for line in result.stdout.splitlines())
    assert head == ["design", "dome_height_mm", "unit_separation_mm", "pattern", "tip_y_mm"]
    frame = pd.read_parquet(folder / out / "states.parquet")
    best = frame.loc[frame.tip_y_mm.idxmin()]
    assert row == [str(best[name]) for name in head]
    assert f"dome_height_mm: {best.dome_height_mm}" in (folder / "curled.yaml").read_text()


def test_chosen_rows_are_a_table_that_goes_on(call: Call, out: str, folder: Path) -> None:
    """With all columns specs can be made from it; without some values of a design they cannot."""
    call("pick", out, "--top", "3", "--columns", "all", "-o", "some.parquet", "-q")
    whole = pd.read_parquet(folder / out / "designs.parquet")
    expected = whole[whole.n_stable > 0][:3].reset_index(drop=True)
    pd.testing.assert_frame_equal(pd.read_parquet(folder / "some.parquet"), expected)
    field = pq.read_schema(folder / "some.parquet").field("reach_max_mm")
    assert {b"unit", b"outputs", b"basis"} <= {*field.metadata}
    assert call("pick", "some.parquet", "--design", "0", "--spec", "zero.yaml").exit_code == 0
    names = "design,dome_height_mm,calibration,status,reason,n_stable"
    call("pick", out, "--columns", names, "-o", "few.parquet", "-q")
    assert call("pick", "few.parquet").exit_code == 0
    result = call("predict", "few.parquet", "--design", "0")
    assert result.exit_code == ExitCode.USAGE
    assert "no base spec is kept" in result.stderr
    assert call("pick", "few.parquet", "--spec", "no.yaml").exit_code == ExitCode.USAGE


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--top", "0"), "--top 0: expected a whole number from 1 on"),
        (("--where", "hight > 1"), "--where 'hight > 1': no column hight"),
        (("--minimize", "status"), "--minimize status: no column status of numbers"),
        (("--maximize", "pattern", "--states"), "--maximize pattern: no column pattern of numbers"),
        (("--columns", "desing"), "--columns desing: no such column; the nearest is design"),
        (("--output", "out/states.parquet"), "is the spec or data that is read"),
        (("--spec", "three_unit.yaml"), "it is there and not of dpg"),
        (("--output", "x.csv"), "writes Parquet"),
        (("--strict", "--maximize", "min_barrier_mJ"), "--strict allows no choice by what is"),
    ],
)
def test_what_cannot_be_asked(call: Call, out: str, options: tuple[str, ...], message: str) -> None:
    result = call("pick", out, *options)
    assert result.exit_code == ExitCode.USAGE
    assert message in result.stderr


def test_what_nothing_should_be_chosen_by_is_warned_of(call: Call, out: str) -> None:
    options = ("--where", "min_barrier_mJ > 0", "--minimize", "energy_mJ")
    said = call("pick", out, *options[:2]).stderr
    assert "warning: --where 'min_barrier_mJ > 0': min_barrier_mJ rests on barriers" in said
    assert (
        "warning: --minimize: energy_mJ rests on"
        in call("pick", out, "--states", *options[2:]).stderr
    )
    assert "warning" not in call("pick", out, "--minimize", "reach_min_mm").stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("pick", "out/states.parquet"), "is a table of states: choose among them with --states"),
        (("pick", "nowhere"), "cannot read nowhere: No such file or directory"),
        (("pick", "three_unit.yaml"), "cannot read three_unit.yaml: "),
        (("predict", "out"), "out is a folder: say which of its designs with --design"),
        (("predict", "out", "--design", "99"), "--design 99: out/designs.parquet has 0 to 9"),
        (("predict", "three_unit.yaml", "--design", "1"), "cannot read three_unit.yaml"),
        (("predict", "out", "--design", "3"), "stroke_mm = 0"),  # invalid
    ],
)
def test_what_there_is_nothing_to_choose_from(
    call: Call, out: str, words: tuple[str, ...], message: str
) -> None:
    result = call(*words)
    assert result.exit_code == ExitCode.USAGE
    assert message in result.stderr


def test_a_damaged_table_is_not_chosen_from(call: Call, out: str, folder: Path) -> None:
    path = folder / out / "designs.parquet"
    content = bytearray(path.read_bytes())
    content[100] ^= 1
    path.write_bytes(content)
    for words in (("pick", out), ("predict", out, "--design", "0")):
        result = call(*words)
        assert result.exit_code == ExitCode.USAGE
        assert "damaged" in result.stderr


def test_all_options_of_predict_go_with_a_design(call: Call, out: str) -> None:
    options = ("--pattern", "1*1", "--set", "finger.units=2", "--columns", "energy_mJ", "-q")
    result = call("predict", out, "--design", "0", *options)
    assert result.stdout.splitlines()[1].split()[0] == "11"


def test_an_excluded_design_can_be_predicted(call: Call, out: str) -> None:
    assert call("predict", out, "--design", "8", "-q").exit_code == 0


def test_the_same_bytes_each_time(call: Call, out: str, folder: Path) -> None:
    options = ("--minimize", "reach_min_mm", "--maximize", "reach_max_mm", "-q")
    for name in ("a", "b"):
        call("pick", out, *options, "-o", f"{name}.parquet", "--spec", f"{name}.yaml")
    for kind in ("parquet", "yaml"):
        assert (folder / f"a.{kind}").read_bytes() == (folder / f"b.{kind}").read_bytes()


def test_choosing_that_takes_long_says_so(
    call: Call, out: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slow(values: Any) -> Any:
        time.sleep(0.3)
        return on_front(values)

    monkeypatch.setattr("dpgcli.cli.progress.ELAPSED_PERIOD", 0.05)
    monkeypatch.setattr("dpgcli.sweeps.choice.on_front", slow)
    objectives = ("--minimize", "reach_min_mm", "--maximize", "reach_max_mm")
    assert "choosing, 0 s\n" in call("pick", out, *objectives).stderr
    assert "choosing" not in call("pick", out, *objectives, "-q").stderr
