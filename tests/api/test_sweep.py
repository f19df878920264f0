"""`sweep`, `merge` and `report`: from files and data, into folders and values."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from typer.testing import CliRunner

import dpgcli as dpg
from dpgcli.cli.main import app

STROKE = "finger.lattice.stroke_mm"
SPACE: list[dict[str, Any]] = [
    {"key": STROKE, "values": [2.0, 3.5]},
    {"key": "finger.units", "values": [2, 3]},
]
SERIAL: dict[str, Any] = {"executor": "serial"}
FILE = f"""\
base: study.yaml
space:
  - {{key: {STROKE}, values: [2.0, 3.5]}}
  - {{key: finger.units, values: [2, 3]}}
"""


@pytest.fixture
def space(folder: Path) -> Path:
    (folder / "sweep.yaml").write_text(FILE)
    return folder


def test_tables_as_by_the_command(space: Path) -> None:
    command = ["sweep", "sweep.yaml", "-o", "command", "--executor", "serial"]
    assert CliRunner().invoke(app, command).exit_code == 0
    found = dpg.sweep("sweep.yaml", "function", **SERIAL)
    for name in ("states.parquet", "designs.parquet"):
        assert (space / "function" / name).read_bytes() == (space / "command" / name).read_bytes()
    assert found.designs.to_pandas().equals(pd.read_parquet("command/designs.parquet"))
    assert found.states.to_pandas().equals(pd.read_parquet("command/states.parquet"))
    assert found.n_failed == 0
    assert found.report.startswith("# Design space\n\n4 designs over stroke_mm")


def test_swept_values_are_told_apart_in_any_order_of_columns(space: Path) -> None:
    """Every other column of designs is known, those of an accuracy level too."""
    found = dpg.sweep("sweep.yaml", "out", target_error=1e-2, **SERIAL)
    frame = found.designs.to_pandas()
    (expected,) = dpg.check(frame, "stroke_mm > 3")
    for order in (sorted(frame), list(reversed(frame.columns))):
        (verdict,) = dpg.check(frame[order], "stroke_mm > 3")
        assert [f.design for f in verdict.failures()] == [0, 1]
        values = [f.values for f in verdict.failures()]
        assert values == [f.values for f in expected.failures()]
    frame[sorted(frame)].to_parquet("out/designs.parquet")
    assert "## " in dpg.report("out")


@pytest.mark.parametrize("is_named", [True, False])
def test_data_are_a_sweep(space: Path, study: dict[str, Any], is_named: bool) -> None:
    base = "study.yaml" if is_named else study
    found = dpg.sweep({"base": base, "space": SPACE}, **SERIAL)
    expected = dpg.sweep("sweep.yaml", "out", **SERIAL)
    assert found.designs.to_pandas().equals(expected.designs.to_pandas())
    assert found.states.to_pandas().equals(expected.states.to_pandas())
    assert not found.folder.exists()


def test_what_is_there_is_not_made_again(space: Path) -> None:
    dpg.sweep("sweep.yaml", "out", **SERIAL)
    before = (space / "out" / "run.json").read_bytes()
    seen: list[int] = []
    dpg.sweep("sweep.yaml", "out", watch=lambda progress: seen.append(progress.n_done), **SERIAL)
    assert seen == []
    assert (space / "out" / "run.json").read_bytes() == before
    dpg.sweep(
        "sweep.yaml",
        "out",
        restart=True,
        watch=lambda progress: seen.append(progress.n_done),
        **SERIAL,
    )
    assert seen == [4]


def test_settings_and_target_errors(space: Path) -> None:
    settings = {"finger.lattice.force_linearity": 0.2}
    found = dpg.sweep("sweep.yaml", settings=settings, target_error=1e-2, **SERIAL)
    designs = found.designs.to_pandas()
    assert set(designs["status"]) == {"partly_stable"}
    assert "error_bound_mm" in designs


def test_processes_give_the_same(space: Path) -> None:
    serial = dpg.sweep("sweep.yaml", **SERIAL)
    assert dpg.sweep("sweep.yaml", jobs=2).states.arrow.equals(serial.states.arrow)


def test_shards_join(space: Path) -> None:
    for number in (1, 2):
        shard = dpg.sweep("sweep.yaml", f"part{number}", shard=f"{number}/2", **SERIAL)
        with pytest.raises(dpg.UsageError, match=r"cannot read part\d/designs.parquet"):
            _ = shard.designs
    joined = dpg.merge(["part1", "part2"], "whole")
    assert joined.states.arrow.equals(dpg.sweep("sweep.yaml", **SERIAL).states.arrow)
    with pytest.raises(dpg.UsageError, match="expected the output of one dpg sweep shard"):
        dpg.merge(["whole"], "again")


def test_a_report_of_a_folder(space: Path) -> None:
    found = dpg.sweep("sweep.yaml", "out", **SERIAL)
    assert dpg.report("out") == found.report
    assert dpg.report("out", format="html").startswith("<!DOCTYPE html>")
    with pytest.raises(dpg.UsageError, match=r"^format 'pdf': expected md or html"):
        dpg.report("out", format="pdf")


def test_a_sweep_is_checked(space: Path) -> None:
    found = dpg.sweep("sweep.yaml", **SERIAL)
    (verdict,) = dpg.check(found.designs, "n_units > 2")
    assert [failure.values["units"] for failure in verdict.failures()] == [2, 2]


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"executor": "cloud"}, "^executor 'cloud': expected processes, serial, dask"),
        ({"executor": "dask"}, "^executor dask and scheduler tcp://host:port go together"),
        ({"scheduler": "tcp://host:1"}, r"^executor dask and scheduler tcp://host:port go tog"),
        ({"executor": "dask", "scheduler": "x"}, "^scheduler x: expected tcp://host:port"),
        ({"wait": 1.0}, "^wait is for the workers of executor dask"),
        ({"shard": "3/2"}, "^shard 3/2: expected K/N with K from 1 to N"),
        ({"shard": "1/2"}, "^a shard is kept in a folder: give output"),
        ({"tolerance": 1.0}, r"^tolerance 1.0: expected 1e-14"),
    ],
)
def test_errors_name_fields(space: Path, asked: dict[str, Any], message: str) -> None:
    with pytest.raises(dpg.UsageError, match=message):
        dpg.sweep("sweep.yaml", **asked)


def test_a_wrong_sweep_says_where(space: Path, study: dict[str, Any]) -> None:
    with pytest.raises(dpg.SpecError, match=r"^settings: finger.units: expected a key that the sp"):
        dpg.sweep("sweep.yaml", settings={"finger.units": 3}, **SERIAL)
    with pytest.raises(dpg.SpecError, match=r"^sweep: space: expected"):
        dpg.sweep({"base": study}, **SERIAL)
    study["finger"]["units"] = 0
    with pytest.raises(dpg.SpecError, match=r"^spec: finger.units: expected a whole number"):
        dpg.sweep({"base": study, "space": SPACE}, **SERIAL)


def test_another_sweep_in_the_folder_is_named(space: Path) -> None:
    dpg.sweep("sweep.yaml", "out", shard="1/2", **SERIAL)
    with pytest.raises(dpg.UsageError, match="take another output, or drop it with restart"):
        dpg.sweep("sweep.yaml", "out", tolerance=1e-6, **SERIAL)


def test_tables_of_the_next_sweep_are_not_those_of_this_one(space: Path) -> None:
    first = dpg.sweep("sweep.yaml", "out", **SERIAL)
    second = dpg.sweep("sweep.yaml", "out", tolerance=1e-9, **SERIAL)
    for table in ("designs", "states"):
        with pytest.raises(dpg.UsageError, match=r"out/\w+.parquet is of another sweep by now"):
            getattr(first, table)
    assert len(second.designs) == 4


def test_tables_that_were_read_stay(space: Path) -> None:
    first = dpg.sweep("sweep.yaml", "out", **SERIAL)
    before = first.designs.to_pandas()
    dpg.sweep("sweep.yaml", "out", settings={"finger.lattice.force_linearity": 0.2}, **SERIAL)
    assert first.designs.to_pandas().equals(before)


def test_a_merge_knows_its_tables(space: Path) -> None:
    for number in (1, 2):
        dpg.sweep("sweep.yaml", f"part{number}", shard=f"{number}/2", **SERIAL)
    merged = dpg.merge(["part1", "part2"], "whole")
    assert len(merged.designs) == 4
    dpg.sweep("sweep.yaml", "whole", settings={"finger.lattice.force_linearity": 0.2}, **SERIAL)
    with pytest.raises(dpg.UsageError, match=r"states.parquet is of another sweep"):
        _ = merged.states


def test_a_shard_beside_the_tables_of_another_sweep(space: Path) -> None:
    dpg.sweep("sweep.yaml", "out", settings={"finger.lattice.force_linearity": 0.2}, **SERIAL)
    shard = dpg.sweep("sweep.yaml", "out", shard="1/2", **SERIAL)
    with pytest.raises(dpg.UsageError, match=r"designs.parquet is of another sweep"):
        _ = shard.designs


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "O_NONBLOCK"), reason="orphans stay on Windows")
def test_what_a_killed_sweep_without_a_folder_leaves_goes_with_the_next(space: Path) -> None:
    (space / "temporary").mkdir()
    program = (
        "import os, dpgcli as dpg; dpg.sweep('sweep.yaml', executor='serial', watch=lambda _: {})"
    )
    left = []
    for watch in ("os.kill(os.getpid(), 9)", "None"):
        subprocess.run(
            [sys.executable, "-c", program.format(watch)],
            env={**os.environ, "TMPDIR": str(space / "temporary")},
            check=watch == "None",
        )
        left.append(len(list((space / "temporary").iterdir())))
    assert left == [1, 0]


def test_a_program_from_standard_input_is_told_what_helps(folder: Path) -> None:
    """Processes cannot import it: without tracebacks of theirs."""
    (folder / "sweep.yaml").write_text(FILE)
    program = """import dpgcli as dpg
try:
    dpg.sweep("sweep.yaml", jobs=2)
except dpg.UsageError as error:
    print(error)
"""
    ran = subprocess.run(
        [sys.executable, "-"], input=program, capture_output=True, text=True, check=True, cwd=folder
    )
    assert ran.stderr == ""
    assert "standard input: save it in a file, or take serial" in ran.stdout


def test_a_base_whose_name_is_no_text(folder: Path) -> None:
    """As of a disk that was written in another encoding: the name is only told."""
    base = folder / os.fsdecode(b"b\xff.yaml")
    base.write_bytes((folder / "study.yaml").read_bytes())
    found = dpg.sweep({"base": base, "space": SPACE}, folder / "out", **SERIAL)
    assert found.designs["n_stable"].tolist() == [4, 8, 4, 8]
