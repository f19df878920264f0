"""`dpg sweep`: tables, messages, exit codes, and a file for Make."""

import json
import os
import pickle
import re
import resource
import select
import shlex
import shutil
import subprocess
from collections import namedtuple
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from dpgcli.cli.exits import ExitCode
from dpgcli.exploration.executors import Chunk
from dpgcli.files.output import sole_use
from dpgcli.files.sweep import read_sweep
from dpgcli.studies.sweep import Study
from dpgcli.studies.work import Work

HEIGHT = "finger.geometry.dome_height_mm"
SEPARATION = "finger.geometry.unit_separation_mm"
SWEEP = f"""base: three_unit.yaml
space:
  - {{key: {HEIGHT}, values: [2.5, 6, 6.5]}}
  - {{key: {SEPARATION}, values: [2, 3]}}
"""
SERIAL = ("-o", "out", "--executor", "serial")


@pytest.fixture
def sweep(folder: Path) -> Path:
    """A small sweep in the folder."""
    path = folder / "sweep.yaml"
    path.write_text(SWEEP)
    return path


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.parquet")}


def test_two_tables_and_what_differs_between_runs(call: Any, sweep: Path) -> None:
    result = call("sweep", "sweep.yaml", *SERIAL)
    assert result.exit_code == ExitCode.DONE
    assert result.stderr.splitlines()[0].startswith("out: 6 designs, 40 states in ")
    out = sweep.parent / "out"
    assert {p.name for p in out.iterdir()} - {"report.md"} == {
        "designs.parquet",
        "run.json",
        "states.parquet",
    }
    designs = pd.read_parquet(out / "designs.parquet")
    assert designs["status"].tolist() == ["invalid" if i == 1 else "stable" for i in range(6)]
    assert designs["reason"][1].startswith(f"{HEIGHT}: expected a dome height > the unit")
    states = pd.read_parquet(out / "states.parquet")
    assert len(states) == 5 * 8


def test_the_same_bytes_from_processes(run: Any, call: Any, sweep: Path) -> None:
    assert call("sweep", "sweep.yaml", *SERIAL).exit_code == ExitCode.DONE
    result = run("sweep", "sweep.yaml", "-o", "two", "-j", "2", "-q")
    assert (result.returncode, result.stdout, result.stderr) == (ExitCode.DONE, "", "")
    assert contents(sweep.parent / "two") == contents(sweep.parent / "out")


def test_up_to_date_computes_and_touches_nothing(call: Any, sweep: Path) -> None:
    call("sweep", "sweep.yaml", *SERIAL)
    before = stamps(sweep.parent / "out")
    sweep.write_text("# a comment changes nothing\n" + SWEEP)
    result = call("sweep", "sweep.yaml", *SERIAL)
    assert (result.exit_code, result.stderr) == (ExitCode.DONE, "out: up to date\n")
    assert stamps(sweep.parent / "out") == before


def stamps(folder: Path) -> dict[str, tuple[int, int]]:
    """When each file was last changed, and which file it is."""
    return {p.name: (p.stat().st_mtime_ns, p.stat().st_ino) for p in folder.iterdir()}


def test_quiet_is_silent_always(call: Any, sweep: Path) -> None:
    for _ in ("computed", "up to date"):
        assert call("sweep", "sweep.yaml", *SERIAL, "-q").output == ""


def test_settings_change_the_base(call: Any, sweep: Path) -> None:
    call("sweep", "sweep.yaml", *SERIAL, "-s", "finger.units=2")
    designs = pd.read_parquet(sweep.parent / "out" / "designs.parquet")
    assert set(designs["n_states"]) == {0, 4}


def test_a_sweep_from_standard_input(run: Any, sweep: Path) -> None:
    result = run("sweep", "-", *SERIAL, "-q", input=sweep.read_text())
    assert (result.returncode, result.stderr) == (ExitCode.DONE, "")


def test_a_column_for_every_key_beside_those_that_are_always_there(call: Any, sweep: Path) -> None:
    sweep.write_text(
        "base: three_unit.yaml\nspace:\n"
        "  - {key: finger.overrides.1.geometry.dome_height_mm, values: [6]}\n"
        "  - {key: finger.overrides.2-3.geometry.dome_height_mm, values: [6.5, 7]}\n"
    )
    assert call("sweep", "sweep.yaml", *SERIAL).exit_code == ExitCode.DONE
    designs = pd.read_parquet(sweep.parent / "out" / "designs.parquet")
    assert designs["finger.overrides.1.geometry.dome_height_mm"].tolist() == [6, 6]
    assert designs["finger.overrides.2-3.geometry.dome_height_mm"].tolist() == [6.5, 7]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("space: []\n", "sweep.yaml:1:1: base: expected the path of a spec"),
        (SWEEP.replace("values: [2, 3]", "vals: [2]"), "sweep.yaml:4:47: space.1.vals: expected"),
        (SWEEP.replace("dome_height", "dome_hight"), "(did you mean dome_height_mm?)"),
        (SWEEP + "constraints: [1 +]\n", "sweep.yaml:5:15: constraints.0: expected an expression"),
        (SWEEP + "  - {table: t.csv}\n", "sweep.yaml:5:6: space.2.table: expected a CSV or"),
        (SWEEP.replace("three", "four"), "four_unit.yaml: file: expected a readable file"),
        (SWEEP + "constraints: [calibration > 3]\n", "sweep.yaml:5:15: constraints.0: expected"),
    ],
)
def test_problems_have_their_place(call: Any, sweep: Path, content: str, said: str) -> None:
    sweep.write_text(content)
    result = call("sweep", "sweep.yaml", *SERIAL)
    assert result.exit_code == ExitCode.USAGE, result.stderr
    assert said in result.stderr
    assert result.stderr.splitlines()[-1].startswith("dpg: ")
    assert "Traceback" not in result.stderr
    assert not (sweep.parent / "out").exists()


@pytest.mark.parametrize("shard", ["0/2", "3/2", "1", "a/b", "1/0", "-1/2", "1/2/3", "1.5/2"])
def test_a_shard_is_k_of_n(call: Any, sweep: Path, shard: str) -> None:
    result = call("sweep", "sweep.yaml", *SERIAL, "--shard", shard)
    assert result.exit_code == ExitCode.USAGE
    assert "expected K/N" in result.stderr


@pytest.mark.parametrize(
    "options", [("--executor", "dask"), ("--scheduler", "tcp://127.0.0.1:1"), ("-j", "0")]
)
def test_options_that_make_no_sense(call: Any, sweep: Path, options: tuple[str, ...]) -> None:
    result = call("sweep", "sweep.yaml", "-o", "out", *options)
    assert result.exit_code == ExitCode.USAGE
    assert not (sweep.parent / "out").exists()


@pytest.mark.parametrize("name", ["file", "file/out"])
def test_an_output_that_cannot_be_a_folder(call: Any, sweep: Path, name: str) -> None:
    (sweep.parent / "file").write_text("old")
    result = call("sweep", "sweep.yaml", "--executor", "serial", "-o", name)
    assert result.exit_code == ExitCode.USAGE
    assert result.stderr.startswith("dpg: cannot write file")
    assert (sweep.parent / "file").read_text() == "old"


def test_a_changed_sweep_beside_an_unfinished_one(call: Any, sweep: Path) -> None:
    assert call("sweep", "sweep.yaml", *SERIAL, "--shard", "1/2").exit_code == ExitCode.DONE
    changed = ("sweep", "sweep.yaml", *SERIAL, "-s", "finger.units=2")
    result = call(*changed)
    assert result.exit_code == ExitCode.USAGE
    assert "differs in sweep.base.finger.units" in result.stderr
    assert "--restart" in result.stderr
    assert call(*changed, "--restart").exit_code == ExitCode.DONE
    assert not (sweep.parent / "out" / ".parts").exists()


Usage = namedtuple("Usage", "total used free")


def test_a_disk_too_small(call: Any, sweep: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(0, 0, 1000))
    result = call("sweep", "sweep.yaml", *SERIAL)
    assert result.exit_code == ExitCode.USAGE
    assert "6 designs have about 48 states" in result.stderr
    assert "--force" in result.stderr
    assert not (sweep.parent / "out").exists()
    assert call("sweep", "sweep.yaml", *SERIAL, "--force").exit_code == ExitCode.DONE


@pytest.mark.parametrize("n_bytes", [0, 300, 3000, 15000])
def test_a_full_disk_leaves_nothing_half_written_and_can_go_on(
    run: Any, call: Any, sweep: Path, n_bytes: int
) -> None:
    result = run(
        "sweep",
        "sweep.yaml",
        *SERIAL,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, n_bytes)),
    )
    assert result.returncode == ExitCode.USAGE
    assert "cannot write out/" in result.stderr
    assert "Traceback" not in result.stderr
    assert not list((sweep.parent / "out").rglob("*.tmp"))
    assert call("sweep", "sweep.yaml", *SERIAL).exit_code == ExitCode.DONE
    assert call("sweep", "sweep.yaml", "-o", "new", "--executor", "serial").exit_code == 0
    assert contents(sweep.parent / "out") == contents(sweep.parent / "new")


def make(folder: Path, target: str) -> str:
    """What GNU Make does, with an environment of its own."""
    environment = {"PATH": os.environ["PATH"]}
    command = ["make", "--no-print-directory", "-f", "Makefile", target]
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    return done.stdout + done.stderr


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
@pytest.mark.parametrize("name", ["sweep.yaml", "a sweep.yaml", "a#b.yaml", "a$b.yaml", "a%b.yaml"])
def test_make_runs_a_sweep_only_when_a_file_changed(call: Any, sweep: Path, name: str) -> None:
    folder = sweep.parent
    (folder / "heights.csv").write_text(f"{HEIGHT}\n6\n6.5\n")
    (folder / name).write_text("base: three_unit.yaml\nspace: [{table: heights.csv}]\n")
    result = call("sweep", name, *SERIAL, "--depfile", "out.d")
    assert result.exit_code == ExitCode.DONE
    (folder / "Makefile").write_text("out/states.parquet:\n\t@echo again\n\ninclude out.d\n")
    assert "up to date" in make(folder, "out/states.parquet")
    sources = [name, "three_unit.yaml", "heights.csv"]
    now = (folder / "out.d").stat().st_mtime
    for age, aged in ((90, sources), (60, ["out/states.parquet", "out/designs.parquet"])):
        for each in aged:
            os.utime(folder / each, (now - age, now - age))
    assert "up to date" in make(folder, "out/states.parquet")
    for changed in sources:
        os.utime(folder / changed, (now - 30, now - 30))
        assert make(folder, "out/states.parquet") == "again\n", changed
        os.utime(folder / changed, (now - 90, now - 90))
    (folder / "heights.csv").unlink()
    assert make(folder, "out/states.parquet") == "again\n", "a lost file is no error, as in gcc -MP"


def test_a_depfile_in_the_output_folder(call: Any, sweep: Path) -> None:
    result = call("sweep", "sweep.yaml", *SERIAL, "--depfile", "out/sweep.d")
    assert result.exit_code == ExitCode.DONE
    assert (sweep.parent / "out" / "sweep.d").read_text() == (
        "out/states.parquet out/designs.parquet: sweep.yaml three_unit.yaml\n"
        "\nsweep.yaml:\n\nthree_unit.yaml:\n"
    )


def test_a_depfile_of_standard_input_names_files_only(run: Any, sweep: Path) -> None:
    result = run("sweep", "-", *SERIAL, "--depfile", "out.d", input=sweep.read_text())
    assert result.returncode == ExitCode.DONE
    text = (sweep.parent / "out.d").read_text()
    assert text.splitlines()[0] == "out/states.parquet out/designs.parquet: three_unit.yaml"


def test_progress_goes_to_standard_error_only(run: Any, sweep: Path) -> None:
    result = run("sweep", "sweep.yaml", "-o", "out", "-j", "2")
    assert "designs in " not in result.stdout
    assert len(result.stderr.splitlines()) == 1


@pytest.fixture
def design_2_kills() -> Iterator[pytest.MonkeyPatch]:
    """Design 2 kills whatever worker it meets, until this is undone."""
    from concurrent.futures import BrokenExecutor

    from dpgcli.exploration import executors

    submit = executors.SerialExecutor.submit

    def deadly(self: Any, fn: Any, /, *arguments: Any) -> Any:
        if arguments and 6.0 in arguments[1][HEIGHT] and 2.0 in arguments[1][SEPARATION]:
            fn, arguments = _die, ()
        return submit(self, fn, *arguments)

    def _die() -> None:
        raise BrokenExecutor("killed")

    patch = pytest.MonkeyPatch()
    patch.setattr(executors.SerialExecutor, "submit", deadly)
    yield patch
    patch.undo()


@pytest.mark.usefixtures("design_2_kills")
def test_a_design_that_kills_its_worker_is_a_row_and_has_its_exit_code(
    call: Any, sweep: Path
) -> None:
    result = call("sweep", "sweep.yaml", *SERIAL)
    assert result.exit_code == ExitCode.FAILED_CASES
    assert "workers died with designs 0-5 under way, which were evaluated again" in result.stderr
    assert "dpg: 1 design failed; --max-failed is 0" in result.stderr
    designs = pd.read_parquet(sweep.parent / "out" / "designs.parquet")
    expected = ["stable", "invalid", "failed", "stable", "stable", "stable"]
    assert designs["status"].tolist() == expected
    again = call("sweep", "sweep.yaml", *SERIAL)
    assert "up to date" in again.stderr
    assert again.exit_code == ExitCode.FAILED_CASES


def test_a_failed_design_comes_with_the_command_that_replays_it(
    call: Any, sweep: Path, design_2_kills: pytest.MonkeyPatch
) -> None:
    options = ("--max-failed", "1", "-s", "finger.linear_stiffness_N_per_mm=2.0e4")
    result = call("sweep", "sweep.yaml", *SERIAL, *options)
    assert result.exit_code == ExitCode.DONE
    (replay,) = re.findall("^failed, .* alone: dpg (.*)$", result.stderr, re.MULTILINE)
    assert json.loads((sweep.parent / "out" / "run.json").read_text())["replay"] == [
        f"dpg {replay}"
    ]
    alone = call(*shlex.split(replay), "--columns", "tip_x_mm", "--format", "json")
    assert alone.exit_code == ExitCode.DONE
    design_2_kills.undo()
    assert call("sweep", "sweep.yaml", *SERIAL[2:], "-o", "whole", *options).exit_code == 0
    states = pd.read_parquet(sweep.parent / "whole" / "states.parquet")
    expected = states[states["design"] == 2]["tip_x_mm"].tolist()
    assert [row["tip_x_mm"] for row in json.loads(alone.stdout)] == expected


def test_one_dpg_at_a_time_in_a_folder(call: Any, sweep: Path) -> None:
    with sole_use(sweep.parent / "out"):
        result = call("sweep", "sweep.yaml", *SERIAL)
    assert result.exit_code == ExitCode.USAGE
    assert "another dpg is at work in out" in result.stderr
    assert call("sweep", "sweep.yaml", *SERIAL).exit_code == ExitCode.DONE


def test_a_refused_sweep_leaves_no_empty_folder(call: Any, sweep: Path) -> None:
    result = call("sweep", "sweep.yaml", "-o", "new", "--executor", "dask", "-j", "2")
    assert result.exit_code == ExitCode.USAGE
    assert not (sweep.parent / "new").exists()


def test_what_a_worker_sends_is_less_than_a_pipe_takes_at_once(sweep: Path) -> None:
    """A worker killed halfway through a longer message would leave the pool waiting forever."""
    study = Study(read_sweep(sweep), sweep.parent / "out")
    study.store.say({})
    values = study.sweep.space.designs(0, 6)
    done = Work(study.evaluation, study.store)(Chunk(0, 6), values)
    assert done.n_states == 5 * 8
    assert len(pickle.dumps(done)) < select.PIPE_BUF / 4
    assert Work(study.evaluation, None)(Chunk(0, 6), values).content is not None


def test_shares_of_the_time_add_up(call: Any, sweep: Path) -> None:
    assert call("sweep", "sweep.yaml", *SERIAL).exit_code == ExitCode.DONE
    facts = json.loads((sweep.parent / "out" / "run.json").read_text())
    assert facts["states"] == 5 * 8
    shares = facts["core_share"] + facts["writing_share"] + facts["pool_share"]
    assert shares == pytest.approx(1.0, abs=0.05)
    assert facts["states_per_second"] == pytest.approx(
        40 / (facts["seconds"] + facts["tables_seconds"])
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--tolerance", "0"), "--tolerance 0.0: expected 1e-14"),
        (("--tolerance", "nan"), "--tolerance nan: expected 1e-14"),
        (("--tolerance", "1"), "--tolerance 1.0: expected 1e-14"),
        (("--target-error", "0"), "--target-error 0: expected a length > 0"),
        (("--target-error", "1e400mm"), "--target-error 1e400mm: expected a length > 0"),
        (("--target-error", "1mm", "--tolerance", "1e-6"), "drop --tolerance"),
        (("--scheduler", "tcp://x:1"), "go together"),
        (("--summary-file", "none/s.md"), "cannot write none/s.md"),
    ],
)
def test_options_are_checked_even_if_all_is_up_to_date(
    call: Any, sweep: Path, options: tuple[str, ...], said: str
) -> None:
    assert call("sweep", "sweep.yaml", *SERIAL).exit_code == ExitCode.DONE
    result = call("sweep", "sweep.yaml", *SERIAL, *options)
    assert result.exit_code == ExitCode.USAGE
    assert said in result.stderr


def test_designs_choose_by_their_target_error(call: Any, sweep: Path) -> None:
    out = sweep.parent / "out"
    result = call("sweep", "sweep.yaml", *SERIAL, "--target-error", "10nm")
    assert result.exit_code == ExitCode.DONE
    assert "chosen for the target error: " in result.stderr
    fine = pd.read_parquet(out / "designs.parquet").dropna(subset="error_bound_mm")
    assert set(fine["rung"]) <= {"tolerance 1e-09", "tolerance 1e-12"}
    assert (fine["error_bound_mm"] <= 1e-5).all()
    again = call("sweep", "sweep.yaml", *SERIAL, "--target-error", "0.00001mm")
    assert "up to date" in again.stderr
    assert call("sweep", "sweep.yaml", *SERIAL, "--target-error", "1mm").exit_code == 0
    rough = pd.read_parquet(out / "designs.parquet").dropna(subset="error_bound_mm")
    assert set(rough["rung"]) == {"rigid bars"}
    assert (rough["max_tip_error_mm"] <= rough["error_bound_mm"]).all()
    assert (rough["error_bound_mm"] <= 1.0).all()
    assert rough["stiffness_max_N_per_mm"].isna().all(), "the bars carry it"
    assert fine["stiffness_max_N_per_mm"].notna().all()
    moved = abs(rough["reach_min_mm"] - fine["reach_min_mm"]).max()
    assert 1e-6 < moved <= rough["error_bound_mm"].max()


@pytest.mark.usefixtures("design_2_kills")
def test_shards_with_failed_designs_have_the_exit_code_every_time(call: Any, sweep: Path) -> None:
    for number in (1, 2, 1, 2):
        shard = ("--shard", f"{number}/2", "-o", f"s{number}", *SERIAL[2:])
        found = call("sweep", "sweep.yaml", *shard).exit_code
        assert found == (ExitCode.FAILED_CASES if number == 1 else ExitCode.DONE)
    merged = call("merge", "s1", "s2", "-o", "s1")
    assert merged.exit_code == ExitCode.FAILED_CASES
    assert not (sweep.parent / "s1" / ".parts").exists()
    assert call("merge", "s1", "s2", "-o", "s3").exit_code == ExitCode.USAGE
    again = call("sweep", "sweep.yaml", "-o", "s1", "--shard", "1/2", *SERIAL[2:])
    assert "up to date" in again.stderr


def test_setting_what_the_space_varies_is_refused(call: Any, sweep: Path) -> None:
    result = call("sweep", "sweep.yaml", *SERIAL, "-s", f"{HEIGHT}=5")
    assert result.exit_code == ExitCode.USAGE
    assert f"--set: {HEIGHT}: expected a key that the space leaves alone" in result.stderr


def test_restart_begins_anew_even_where_all_is_done(call: Any, sweep: Path) -> None:
    assert call("sweep", "sweep.yaml", *SERIAL).exit_code == ExitCode.DONE
    result = call("sweep", "sweep.yaml", *SERIAL, "--restart")
    assert result.exit_code == ExitCode.DONE
    assert result.stderr.startswith("out: 6 designs, 40 states in ")


def test_what_some_units_override_keeps_its_whole_key(call: Any, sweep: Path) -> None:
    key = "finger.overrides.2.geometry.dome_height_mm"
    sweep.write_text(f"base: three_unit.yaml\nspace:\n  - {{key: {key}, values: [6, 7]}}\n")
    result = call("sweep", "sweep.yaml", *SERIAL, "--require", f"{key} > 5")
    assert result.exit_code == ExitCode.DONE
    assert pd.read_parquet(sweep.parent / "out" / "designs.parquet")[key].tolist() == [6.0, 7.0]
