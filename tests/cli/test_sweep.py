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
from dpgcli.errors import OutputError
from dpgcli.files.output import sole_use
from dpgcli.files.parts import PartStore
from dpgcli.files.sweep_file import read_sweep
from dpgcli.files.table_writer import read_metadata
from dpgcli.studies.sweep import Study
from dpgcli.studies.work import ChunkTask
from dpgcli.sweeps.executors import Chunk
from dpgcli.sweeps.maker import HERE

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


@pytest.mark.parametrize("is_done", [False, True])
def test_what_a_killed_run_was_writing_goes(call: Any, sweep: Path, is_done: bool) -> None:
    """Whatever file it was; nobody else's goes."""
    out = sweep.parent / "out"
    if is_done:
        assert call("sweep", "sweep.yaml", *SERIAL).exit_code == ExitCode.DONE
    out.mkdir(exist_ok=True)
    names = ("states.parquet", "designs.parquet", "run.json", "report.md", "notes.txt")
    for name in names:
        (out / f".{name}.dpg3.tmp").write_text("half")
    result = call("sweep", "sweep.yaml", *SERIAL, "-q")
    assert result.exit_code == ExitCode.DONE
    assert [path.name for path in out.glob(".*.tmp")] == [".notes.txt.dpg3.tmp"]


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


@pytest.mark.slow
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


@pytest.mark.parametrize(
    "n_bytes", [300, 15000, *(pytest.param(n, marks=pytest.mark.slow) for n in (0, 3000))]
)
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
        "# dpg sweep: what its tables are made from\n"
        "out/states.parquet out/designs.parquet: sweep.yaml three_unit.yaml\n"
        "\nsweep.yaml:\n\nthree_unit.yaml:\n\n"
        "MAKEFLAGS += --no-builtin-rules --check-symlink-times\n"
    )


def test_a_depfile_of_standard_input_names_files_only(run: Any, sweep: Path) -> None:
    result = run("sweep", "-", *SERIAL, "--depfile", "out.d", input=sweep.read_text())
    assert result.returncode == ExitCode.DONE
    text = (sweep.parent / "out.d").read_text()
    assert text.splitlines()[1] == "out/states.parquet out/designs.parquet: three_unit.yaml"


def test_progress_goes_to_standard_error_only(run: Any, sweep: Path) -> None:
    result = run("sweep", "sweep.yaml", "-o", "out", "-j", "2")
    assert "designs in " not in result.stdout
    others = [line for line in result.stderr.splitlines() if not line.startswith("warning: ")]
    assert len(others) == 1


@pytest.fixture
def design_2_kills() -> Iterator[pytest.MonkeyPatch]:
    """Design 2 kills whatever worker it meets, until this is undone."""
    from concurrent.futures import BrokenExecutor

    from dpgcli.sweeps import executors

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
    done = ChunkTask(study.evaluation, study.store)(Chunk(0, 6), values, HERE)
    assert done.n_states == 5 * 8
    assert len(pickle.dumps(done)) < select.PIPE_BUF / 4
    assert ChunkTask(study.evaluation, None)(Chunk(0, 6), values, HERE).content is not None


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
        (("--executor", "dask", "--scheduler", "x"), "--scheduler x: expected tcp://host:port"),
        (("--wait", "5m"), "--wait is for the workers of --executor dask"),
        (
            ("--executor", "dask", "--scheduler", "tcp://x:1", "--wait", "soon"),
            "--wait soon: expected a time in s, m or h: 5m",
        ),
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
    assert set(fine["accuracy_level"]) <= {"tolerance 1e-09", "tolerance 1e-12"}
    assert (fine["error_bound_mm"] <= 1e-5).all()
    again = call("sweep", "sweep.yaml", *SERIAL, "--target-error", "0.00001mm")
    assert "up to date" in again.stderr
    assert call("sweep", "sweep.yaml", *SERIAL, "--target-error", "1mm").exit_code == 0
    rough = pd.read_parquet(out / "designs.parquet").dropna(subset="error_bound_mm")
    assert set(rough["accuracy_level"]) == {"rigid bars"}
    assert (rough["max_numerical_error_mm"] <= rough["error_bound_mm"]).all()
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
    for output in ("all", "all", "other"):
        merged = call("merge", "s1", "s2", "-o", output)
        assert merged.exit_code == ExitCode.FAILED_CASES


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


THICKNESS = "finger.geometry.dome_thickness_mm"
DOMES = f"""base: base.yaml
space:
  - {{key: {HEIGHT}, values: [5, 6.5, 7.5]}}
  - {{key: {THICKNESS}, values: [0.6, 0.75]}}
"""


def calibration(linearity: float = 0.04) -> str:
    """A dome with a curve, and a grid of its stiffness over heights and thicknesses."""
    travel = [0.25 * place for place in range(61)]
    energy = [22.0 * u**2 * (0.015 + 0.985 * (1.0 - u / 13.5) ** 2) for u in travel]
    points = [(h, t) for h in (4.5, 6.0, 7.0) for t in (0.5, 0.7, 1.0)]
    data = {
        "calibration_version": 1,
        "made_by": "hand",
        "method": "none",
        "values": {
            "bistable_stiffness_N_per_mm": {"value": 44.0, "standard_error": 1.0},
            "force_linearity": {"value": linearity},
            "stroke_mm": {"value": 13.5},
        },
        "geometry": {
            "dome_height_mm": 6.5,
            "dome_thickness_mm": 0.75,
            "unit_separation_mm": 3.0,
            "elastic_modulus_MPa": 26.0,
            "channel_width_mm": 10.0,
            "limiting_layer_thickness_mm": 1.5,
        },
        "curve": {
            "travel_mm": travel,
            "energy_mJ": energy,
            "opening_per_travel": 1.0,
        },
        "grid": {
            "method": "interpolation",
            "over": ["dome_height_mm", "dome_thickness_mm"],
            "points": {
                "dome_height_mm": [h for h, _ in points],
                "dome_thickness_mm": [t for _, t in points],
                "hinge_stiffness_N_mm_per_rad": [20.0 + h * t for h, t in points],
            },
        },
    }
    return json.dumps(data)


@pytest.fixture
def domes(folder: Path) -> Path:
    """A sweep whose base has a calibration file and a law."""
    (folder / "dome.yaml").write_text(calibration())
    text = (folder / "three_unit.yaml").read_text()
    law = "calibration: [dome.yaml, published]\n  law: push_only"
    (folder / "base.yaml").write_text(text.replace("calibration: published", law))
    (folder / "domes.yaml").write_text(DOMES)
    return folder


def test_calibrated_domes_give_the_same_bytes_from_processes(
    run: Any, call: Any, domes: Path
) -> None:
    assert call("sweep", "domes.yaml", *SERIAL).exit_code == ExitCode.DONE
    result = run("sweep", "domes.yaml", "-o", "two", "-j", "2", "-q")
    assert (result.returncode, result.stderr) == (ExitCode.DONE, "")
    assert contents(domes / "two") == contents(domes / "out")


@pytest.mark.parametrize("law", ["published", "tabulated", "push_only"])
def test_a_design_of_a_sweep_is_that_of_predict(call: Any, domes: Path, law: str) -> None:
    settings = ("-s", f"finger.law={law}")
    assert call("sweep", "domes.yaml", *SERIAL, *settings).exit_code == ExitCode.DONE
    states = pd.read_parquet(domes / "out" / "states.parquet")
    design = ("-s", f"{HEIGHT}=7.5", "-s", f"{THICKNESS}=0.6")
    result = call("predict", "base.yaml", *settings, *design, "--format", "json", "-q")
    rows = json.loads(result.stdout)
    own = states[(states["dome_height_mm"] == 7.5) & (states["dome_thickness_mm"] == 0.6)]
    assert own["status"].tolist() == [row["status"] for row in rows]
    assert own["tip_y_mm"].to_numpy() == pytest.approx(
        [row["tip_y_mm"] for row in rows], abs=1e-10, nan_ok=True
    )
    said = read_metadata(domes / "out" / "states.parquet")["dpg.law"]
    assert said.startswith({"push_only": "push-only law, tabulated"}.get(law, f"{law} law"))


def test_a_depfile_lists_the_calibration(call: Any, domes: Path) -> None:
    assert call("sweep", "domes.yaml", *SERIAL, "--depfile", "out.d").exit_code == ExitCode.DONE
    text = (domes / "out.d").read_text()
    assert text.splitlines()[1] == (
        "out/states.parquet out/designs.parquet: domes.yaml base.yaml dome.yaml"
    )
    assert "\ndome.yaml:\n" in text


@pytest.mark.parametrize("option", ["--depfile", "--summary-file"])
@pytest.mark.parametrize("name", ["domes.yaml", "base.yaml", "dome.yaml", "out/../dome.yaml"])
def test_an_output_takes_the_place_of_no_file_that_is_read(
    call: Any, domes: Path, name: str, option: str
) -> None:
    (domes / "out").mkdir()
    before = (domes / name).read_bytes()
    result = call("sweep", "domes.yaml", *SERIAL, option, name)
    assert result.exit_code == ExitCode.USAGE
    assert "is the spec or data that is read: give another name" in result.stderr
    assert (domes / name).read_bytes() == before


def test_a_refused_depfile_leaves_no_empty_folder(call: Any, domes: Path) -> None:
    assert call("sweep", "domes.yaml", *SERIAL, "--depfile", "base.yaml").exit_code == 2
    assert not (domes / "out").exists()


def test_a_depfile_is_that_of_the_tables_beside_it(call: Any, domes: Path) -> None:
    """Whatever is refused leaves it alone; tables that are up to date have it again."""
    run = ("sweep", "domes.yaml", *SERIAL, "--depfile", "out.d")
    assert call(*run).exit_code == ExitCode.DONE
    before = (domes / "out.d").read_bytes()
    (domes / "copy.yaml").write_bytes((domes / "domes.yaml").read_bytes() + b"\n# another\n")
    other = ("sweep", "copy.yaml", "-s", "finger.law=published", *run[2:])
    with sole_use(domes / "out"):
        assert "another dpg is at work" in call(*other).stderr
    theirs = PartStore(domes / "out" / ".parts" / ("a" * 16))
    theirs.say({"dpg.designs": "3"})
    assert "holds unfinished work whose sweep.json is damaged" in call(*other).stderr
    theirs.drop()
    assert "a shard makes none" in call(*other, "--shard", "1/2").stderr
    (domes / "out" / "run.json").write_text("{}")
    assert "cannot write out/run.json" in call(*other).stderr
    assert (domes / "out.d").read_bytes() == before
    (domes / "out.d").unlink()
    assert "out: up to date\n" in call(*run).stderr
    assert (domes / "out.d").read_bytes() == before


def test_a_depfile_is_there_before_the_tables(
    call: Any, domes: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tables that are new beside a depfile that is not would look up to date for good."""

    def assemble(study: Study) -> None:
        assert (domes / "out.d").exists()
        assert not (study.folder / "states.parquet").exists()
        raise OutputError("no space")

    monkeypatch.setattr(Study, "assemble", assemble)
    assert call("sweep", "domes.yaml", *SERIAL, "--depfile", "out.d").exit_code == ExitCode.USAGE


@pytest.mark.parametrize("name", ["/", ".", "out"])
def test_a_folder_is_no_depfile(call: Any, domes: Path, name: str) -> None:
    result = call("sweep", "domes.yaml", *SERIAL, "--depfile", name)
    assert result.exit_code == ExitCode.USAGE
    assert f"cannot write {name}: is a folder" in result.stderr.lower()


def test_a_changed_calibration_is_computed_anew(call: Any, domes: Path) -> None:
    settings = ("-s", "finger.law=published")
    assert call("sweep", "domes.yaml", *SERIAL, *settings).exit_code == ExitCode.DONE
    before = contents(domes / "out")
    again = call("sweep", "domes.yaml", *SERIAL, *settings)
    assert again.stderr == "out: up to date\n"
    (domes / "dome.yaml").write_text(calibration(0.05))
    assert call("sweep", "domes.yaml", *SERIAL, *settings).exit_code == ExitCode.DONE
    assert contents(domes / "out") != before


def test_a_changed_calibration_beside_an_unfinished_sweep_is_refused(
    call: Any, domes: Path
) -> None:
    assert call("sweep", "domes.yaml", *SERIAL, "--shard", "1/2").exit_code == ExitCode.DONE
    (domes / "dome.yaml").write_text(calibration(0.05))
    result = call("sweep", "domes.yaml", *SERIAL)
    assert result.exit_code == ExitCode.USAGE
    assert (
        "differs in sweep.base.finger.calibration.0.values.force_linearity.value" in result.stderr
    )


@pytest.mark.parametrize(
    ("heights", "origins"),
    [
        ([5.0, 6.5, 7.0], ["scaled", "scaled", "scaled"]),
        ([4.4, 6.5, 7.1], ["extrapolated", "scaled", "extrapolated"]),
    ],
)
def test_a_row_says_how_far_to_trust_its_constants(
    call: Any, domes: Path, heights: list[float], origins: list[str]
) -> None:
    """Domes of another thickness are scaled; the hinges' grid ends at heights of 4.5 and 7 mm."""
    space = f"base: base.yaml\nspace: [{{key: {HEIGHT}, values: {heights}}}]\n"
    (domes / "domes.yaml").write_text(space)
    settings = ("-s", f"{THICKNESS}=0.8", "-s", "finger.law=published")
    assert call("sweep", "domes.yaml", *SERIAL, *settings).exit_code == ExitCode.DONE
    designs = pd.read_parquet(domes / "out" / "designs.parquet")
    assert designs["calibration"].tolist() == origins


def test_a_grid_interpolates_inside_its_points_and_extrapolates_outside(
    call: Any, domes: Path
) -> None:
    """With all else given, the gravest origin is that of the grid."""
    space = f"base: base.yaml\nspace: [{{key: {HEIGHT}, values: [4.5, 5.5, 7, 7.01]}}]\n"
    (domes / "domes.yaml").write_text(space)
    values = ("bistable_stiffness_N_per_mm=12.84", "force_linearity=0.043")
    settings = [word for value in values for word in ("-s", f"finger.lattice.{value}")]
    settings += ["-s", "finger.geometry.unit_separation_mm=3", "-s", "finger.law=published"]
    grid = json.loads(calibration())
    del grid["values"]["stroke_mm"], grid["curve"]
    (domes / "dome.yaml").write_text(json.dumps(grid))
    assert call("sweep", "domes.yaml", *SERIAL, *settings).exit_code == ExitCode.DONE
    designs = pd.read_parquet(domes / "out" / "designs.parquet")
    assert designs["calibration"].tolist() == [*["interpolated"] * 3, "extrapolated"]


def test_what_is_wrong_in_a_calibration_has_its_place(call: Any, domes: Path) -> None:
    (domes / "dome.yaml").write_text("calibration_version: 2\n")
    result = call("sweep", "domes.yaml", *SERIAL)
    assert result.exit_code == ExitCode.USAGE
    assert "dome.yaml:1:1: calibration_version: expected 1" in result.stderr
    assert not (domes / "out").exists()


def test_what_takes_long_is_said_before_it_is_begun(
    call: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The work itself is left out; `-q` says nothing."""
    axis = "space:\n  - {key: finger.units, values: [22, 2]}\n"
    (folder / "long.yaml").write_text(f"base: three_unit.yaml\n{axis}")

    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Study, "compute", stopped)
    said, *_ = call("sweep", "long.yaml", "-o", "out").stderr.splitlines()
    assert said.startswith("out: 2 designs, 4,194,308 states: about 1.5 min of one core, 960 MiB")
    assert "of disk, 400 MiB of memory" in said
    quiet = call("sweep", "long.yaml", "-o", "out", "-q").stderr
    assert "about" not in quiet
    (folder / "short.yaml").write_text(f"base: three_unit.yaml\n{axis.replace('22', '3')}")
    assert "about" not in call("sweep", "short.yaml", "-o", "short").stderr


@pytest.mark.parametrize("force", [(), ("--force",)])
def test_a_finger_of_more_states_than_can_be_is_refused_whatever_is_forced(
    call: Any, folder: Path, force: tuple[str, ...]
) -> None:
    axis = "space:\n  - {key: finger.units, values: [2, 40]}\n"
    (folder / "long.yaml").write_text(f"base: three_unit.yaml\n{axis}")
    result = call("sweep", "long.yaml", "-o", "out", *force)
    assert result.exit_code == ExitCode.USAGE
    assert "40 units has 1,099,511,627,776 states, more than the 67,108,864" in result.stderr
    assert not (folder / "out").exists()


@pytest.mark.parametrize(
    "name",
    [
        "states.parquet",
        "report.md",
        *(pytest.param(n, marks=pytest.mark.slow) for n in ("designs.parquet", "run.json")),
    ],
)
def test_a_pipe_among_the_outputs_is_refused_before_any_work(
    run: Any, sweep: Path, name: str
) -> None:
    """Reading it would wait for a writer that never comes."""
    (sweep.parent / "out").mkdir()
    os.mkfifo(sweep.parent / "out" / name)
    result = run("sweep", "sweep.yaml", *SERIAL, "-q", timeout=30)
    assert result.returncode == ExitCode.USAGE
    assert result.stderr == f"dpg: cannot write out/{name}: is a device or pipe, not a file\n"
    assert not (sweep.parent / "out" / ".parts").exists()


def test_a_pipe_in_the_place_of_a_run_is_not_read(run: Any, call: Any, sweep: Path) -> None:
    assert call("sweep", "sweep.yaml", *SERIAL).exit_code == ExitCode.DONE
    (sweep.parent / "out" / "run.json").unlink()
    os.mkfifo(sweep.parent / "out" / "run.json")
    assert run("sweep", "sweep.yaml", *SERIAL, timeout=30).returncode == ExitCode.DONE
    assert run("report", "out", timeout=30).returncode == ExitCode.DONE
