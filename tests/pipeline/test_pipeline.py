"""The examples of a pipeline run: the Makefile with make, the workflow's steps with bash."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow.parquet as pq
import pytest
from ruamel.yaml import YAML

Done = subprocess.CompletedProcess[str]
ROOT = Path(__file__).parents[2]
pytestmark = [
    pytest.mark.skipif(shutil.which("make") is None, reason="needs make"),
    pytest.mark.slow,
]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A copy of the specs, and a `dpg` on the PATH that runs this package."""
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    program = tmp_path / "bin" / "dpg"
    program.parent.mkdir()
    program.write_text(
        f"#!{sys.executable}\nfrom dpgcli.__main__ import main\n"
        "if __name__ == '__main__':\n    main()\n",
        encoding="utf-8",
    )
    program.chmod(0o755)
    return tmp_path


def shell(command: str, checkout: Path, folder: Path, timeout: float = 120, **env: str) -> Done:
    path = f"{checkout / 'bin'}:{os.environ['PATH']}"
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", command],
        cwd=folder,
        env={**os.environ, "PATH": path, **env},
        capture_output=True,
        text=True,
        check=False,
        timeout=timeout,
    )


def make(checkout: Path, *arguments: str) -> Done:
    folder = checkout / "configs" / "pipeline"
    return shell(" ".join(("make", *arguments)), checkout, folder)


def test_make_does_what_is_out_of_date_and_no_more(checkout: Path) -> None:
    first = make(checkout)
    assert first.returncode == 0, first.stderr
    out = checkout / "configs" / "pipeline" / "out"
    assert {p.name for p in out.iterdir()} >= {"states.parquet", "designs.parquet", "report.html"}
    again = make(checkout)
    assert "dpg" not in again.stdout
    base = checkout / "configs" / "five_unit.yaml"
    base.write_text(base.read_text().replace("elastic_modulus_MPa: 26", "elastic_modulus_MPa: 27"))
    changed = make(checkout)
    assert changed.returncode == 0, changed.stderr
    assert "dpg sweep" in changed.stdout


def test_the_plan_computes_nothing(checkout: Path) -> None:
    said = make(checkout, "plan")
    assert said.returncode == 0, said.stderr
    assert "designs  78: 70 to solve" in said.stdout
    assert not (checkout / "configs" / "pipeline" / "out").exists()
    sweep = checkout / "configs" / "sweeps" / "height_separation.yaml"
    sweep.write_text(sweep.read_text().replace("dome_height_mm,", "dome_hight_mm,"))
    wrong = make(checkout, "plan")
    assert wrong.returncode == 2
    assert "did you mean dome_height_mm?" in wrong.stdout
    assert "dpg explain" not in wrong.stdout


@pytest.mark.parametrize(
    "out",
    ["$PWD/../pipeline/g/", *(pytest.param(o, marks=pytest.mark.slow) for o in ("g/", "g//h"))],
)
def test_a_base_is_never_forgotten_however_the_folder_is_spelled(checkout: Path, out: str) -> None:
    said = (
        "base: ../three_unit.yaml\n"
        "space: [{key: finger.geometry.dome_height_mm, values: [6, 6.5]}]\n"
    )
    (checkout / "configs" / "sweeps" / "s.yaml").write_text(said, encoding="utf-8")
    gate = (f"OUT={out}", "SWEEP=../sweeps/s.yaml", "REQUIRE='reach_max_mm < 41'")
    first = make(checkout, *gate)
    assert first.returncode == 0, first.stderr
    assert "dpg sweep" not in make(checkout, *gate).stdout
    base = checkout / "configs" / "three_unit.yaml"
    base.write_text(base.read_text().replace("separation_mm: 3", "separation_mm: 4"))
    changed = make(checkout, *gate)
    assert changed.returncode == 2, changed.stdout
    assert "not met: reach_max_mm < 41" in changed.stdout


def test_a_base_that_is_a_link_set_to_another_older_file_is_judged_anew(checkout: Path) -> None:
    said = "base: ../base.yaml\nspace: [{key: finger.geometry.dome_height_mm, values: [6, 6.5]}]\n"
    (checkout / "configs" / "sweeps" / "s.yaml").write_text(said, encoding="utf-8")
    for name in ("three_unit.yaml", "five_unit.yaml"):
        os.utime(checkout / "configs" / name, (1e9, 1e9))
    link = checkout / "configs" / "base.yaml"
    link.symlink_to("three_unit.yaml")
    gate = ("SWEEP=../sweeps/s.yaml", "REQUIRE='n_units < 4'")
    first = make(checkout, *gate)
    assert first.returncode == 0, first.stderr
    assert "dpg sweep" not in make(checkout, *gate).stdout
    link.unlink()
    link.symlink_to("five_unit.yaml")
    changed = make(checkout, *gate)
    assert changed.returncode == 2, changed.stdout
    assert "not met: n_units < 4" in changed.stdout


def test_other_code_judges_anew(checkout: Path) -> None:
    """Tables that are as they were are not computed again, but what is said of them is."""
    assert make(checkout).returncode == 0
    program = checkout / "bin" / "dpg"
    new = 'case "$1" in --version) echo dpg 99.0;; *) exec "$0".old "$@";; esac\n'
    program.rename(program.with_name("dpg.old"))
    program.write_text(f"#!/bin/sh\n{new}", encoding="utf-8")
    program.chmod(0o755)
    again = make(checkout)
    assert again.returncode == 0, again.stderr
    assert "up to date" in again.stderr
    assert "dpg check" in again.stdout
    assert "dpg report" in again.stdout
    assert "dpg" not in make(checkout).stdout


def test_a_part_that_is_new_in_an_inner_folder_is_judged(checkout: Path) -> None:
    inner = checkout / "configs" / "sweeps" / "designs" / "a"
    inner.mkdir(parents=True)
    (inner / "p.csv").write_text("finger.geometry.dome_height_mm\n6.5\n", encoding="utf-8")
    said = "base: ../three_unit.yaml\nspace: [{table: designs}]\n"
    (checkout / "configs" / "sweeps" / "s.yaml").write_text(said, encoding="utf-8")
    gate = ("SWEEP=../sweeps/s.yaml", "REQUIRE='reach_max_mm < 41'")
    first = make(checkout, *gate)
    assert first.returncode == 0, first.stderr
    (inner / "q.csv").write_text("finger.geometry.unit_separation_mm\n4\n", encoding="utf-8")
    changed = make(checkout, *gate)
    assert changed.returncode == 2, changed.stdout
    assert "other columns in q.csv" in changed.stderr


def test_a_gate_that_is_not_met_fails_the_build(checkout: Path) -> None:
    result = make(checkout, "REQUIRE='min_barrier_mJ > 1e6'")
    assert result.returncode == 2  # of make: a recipe failed
    assert not (checkout / "configs" / "pipeline" / "out" / "checked").exists()


def test_a_stricter_gate_is_held_against_the_tables_that_are_there(checkout: Path) -> None:
    assert make(checkout, "REQUIRE='min_barrier_mJ > 0.1'").returncode == 0
    for _ in range(2):
        stricter = make(checkout, "REQUIRE='min_barrier_mJ > 1e6'")
        assert stricter.returncode == 2
        assert "dpg sweep" not in stricter.stdout
    assert make(checkout, "REQUIRE='min_barrier_mJ > 0.1'").returncode == 0
    assert "dpg" not in make(checkout, "REQUIRE='min_barrier_mJ > 0.1'").stdout


def test_another_sweep_is_no_longer_up_to_date(checkout: Path) -> None:
    """Its file is older than the tables of the first one."""
    sweeps = checkout / "configs" / "sweeps"
    said = "base: ../three_unit.yaml\nspace: [{key: finger.units, values: [3]}]\n"
    (sweeps / "few.yaml").write_text(said, encoding="utf-8")
    assert make(checkout).returncode == 0
    few = make(checkout, "SWEEP=../sweeps/few.yaml")
    assert few.returncode == 0, few.stderr
    out = checkout / "configs" / "pipeline" / "out"
    assert len(pd.read_parquet(out / "designs.parquet")) == 1
    assert "1 designs" in (out / "report.html").read_text(encoding="utf-8")


def test_a_script_beside_a_sweep_or_spec_of_its_name_replaces_neither(checkout: Path) -> None:
    """As Make's own rules would have it, and the whole study would be lost."""
    sweeps = checkout / "configs" / "sweeps"
    said = "base: finger\nspace: [{key: finger.units, values: [3]}]\n"
    (sweeps / "study").write_text(said, encoding="utf-8")
    shutil.copy(checkout / "configs" / "three_unit.yaml", sweeps / "finger")
    spec = (sweeps / "finger").read_bytes()
    assert make(checkout, "SWEEP=../sweeps/study").returncode == 0
    os.utime(sweeps / "study", (1e9, 1e9))
    os.utime(sweeps / "finger", (1e9, 1e9))
    for name in ("study.sh", "finger.sh"):
        (sweeps / name).write_text("#!/bin/sh\n# newer\n", encoding="utf-8")
    assert "dpg sweep" not in make(checkout, "SWEEP=../sweeps/study").stdout
    assert (sweeps / "study").read_text(encoding="utf-8") == said
    shell(
        "make -f calibration.mk -k SPEC=../sweeps/finger DPG=true",
        checkout,
        sweeps.parent / "pipeline",
    )
    assert (sweeps / "finger").read_bytes() == spec


def test_other_choices_make_a_calibration_anew(checkout: Path) -> None:
    """Dry runs: `dpg` prints what it would do, and makes what it is told to."""
    program = checkout / "bin" / "dpg"
    program.write_text(
        '#!/bin/sh\necho ran "$@" "$CODE"\n'
        'case "$1" in fe) mkdir -p "$5"; touch "$5/$2.csv";; esac\n'
        'for last; do :; done\ncase "$1" in fit|predict) touch "$last";; esac\n',
        encoding="utf-8",
    )
    folder = checkout / "configs" / "pipeline"

    def ran(choices: str, **env: str) -> list[str]:
        done = shell(f"make -f calibration.mk {choices}", checkout, folder, **env)
        assert done.returncode == 0, done.stderr
        return [line.split()[1] for line in done.stdout.splitlines() if line.startswith("ran ")]

    everything = ["fe", "fit", "fe", "fit", "predict"]
    assert sorted(ran("")) == sorted(everything)
    assert ran("") == []
    assert ran("STROKE=3.4") == ["fit", "predict"]
    assert sorted(ran("STROKE=3.4 MESH=fine")) == sorted(everything)
    assert sorted(ran("STROKE=3.4 MESH=fine SPEC=../five_unit.yaml")) == sorted(everything)
    assert sorted(ran("STROKE=3.4 MESH=fine SPEC=../five_unit.yaml", CODE="2")) == sorted(
        everything
    )
    assert ran("STROKE=3.4 MESH=fine SPEC=../five_unit.yaml", CODE="2") == []


def workflow() -> dict[str, Any]:
    text = (ROOT / "configs" / "pipeline" / "ci.yml").read_text(encoding="utf-8")
    loaded: dict[str, Any] = YAML(typ="safe", pure=True).load(text)
    return loaded


@pytest.mark.parametrize("job", ["sweep", "gate"])
def test_the_workflow_installs_dpg_wherever_it_was_copied_to(tmp_path: Path, job: str) -> None:
    """`pip install .` in a repository with specs installs something else, or nothing."""
    steps = [step["run"] for step in workflow()["jobs"][job]["steps"] if "run" in step]
    guard, install = steps[:2]
    assert (install, workflow()["env"]["DPG"]) == ('pip install "$DPG"', ".")
    assert shell(guard, ROOT, ROOT, DPG=".").returncode == 0
    refused = shell(guard, ROOT, tmp_path, DPG=".")
    assert (refused.returncode, refused.stdout[:9]) == (2, "::error::")
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "gripper-study"\n')
    assert shell(guard, ROOT, tmp_path, DPG=".").returncode == 2
    assert shell(guard, ROOT, tmp_path, DPG="git+https://example.org/dpg").returncode == 0


def test_the_workflow_s_steps_run_in_order(checkout: Path) -> None:
    jobs, sweep = workflow()["jobs"], workflow()["env"]["SWEEP"]
    summary = checkout / "summary.md"
    steps = [
        step["run"].replace("${{ matrix.shard }}", str(shard))
        for shard in jobs["sweep"]["strategy"]["matrix"]["shard"]
        for step in jobs["sweep"]["steps"]
        if "run" in step
    ]
    steps += [step["run"] for step in jobs["gate"]["steps"] if "run" in step]
    for step in steps:
        if not step.startswith("pip "):
            env = {"SWEEP": sweep, "GITHUB_STEP_SUMMARY": str(summary), "GITHUB_ACTIONS": "true"}
            env["DPG"] = "git+https://example.org/dpg"
            result = shell(step, checkout, checkout, **env)
            assert result.returncode == 0, (step, result.stderr)
    assert "|" in summary.read_text(encoding="utf-8")
    (gate,) = [step for step in steps if step.startswith("dpg check")]
    for threshold, code in (("1e6", 1), ("0.1", 0)):
        command = gate.replace("> 0.1", f"> {threshold}")
        assert (
            shell(command, checkout, checkout, GITHUB_STEP_SUMMARY=str(summary)).returncode == code
        )


@pytest.mark.skipif(shutil.which("ccx") is None, reason="needs CalculiX")
def test_from_geometry_by_finite_elements_to_all_states(checkout: Path) -> None:
    """A coarse mesh: dome and hinge in minutes, springs from both, eight certified states."""
    folder = checkout / "configs" / "pipeline"
    done = shell("make -j2 -f calibration.mk", checkout, folder, timeout=900)
    assert done.returncode == 0, done.stderr
    states = pd.read_parquet(folder / "calibrated" / "states.parquet")
    assert (states["status"] == "stable").all()
    assert len(states) == 8
    bent = states["pattern"] != "000"
    assert (states["tip_angle_uncertainty_rad"][bent] > 0.0).all()
    metadata = pq.read_metadata(folder / "calibrated" / "states.parquet").metadata
    sources = json.loads(metadata[b"dpg.sources"])
    origins = {key: (origin, rule) for key, _, _, origin, rule in sources}
    assert origins["bistable_stiffness_N_per_mm"] == ("calibrated", "from dome.yaml")
    assert origins["hinge_stiffness_N_mm_per_rad"] == ("calibrated", "from hinge.yaml")
    again = shell("make -f calibration.mk", checkout, folder)
    assert "dpg" not in again.stdout
