"""`validate` and `explain` take sweep files: all mistakes at once, and what the sweep then does."""

import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow.parquet as pq
import pytest

import dpgcli as dpg
from dpgcli.files import sweep_file
from dpgcli.files.parts import PartStore
from dpgcli.sweeps import extent

Call = Callable[..., Any]
PROGRAM = "from dpgcli.__main__ import main; main()"
HEIGHT = "finger.geometry.dome_height_mm"
SEPARATION = "finger.geometry.unit_separation_mm"
FEW = f"""\
base: three_unit.yaml
space:
  - {{key: {HEIGHT}, values: [6, 6.5, 7]}}
  - {{key: {SEPARATION}, values: [2, 3]}}
"""
MIXED = f"""\
base: three_unit.yaml
space:
  - {{key: finger.units, values: [1, 2, 4, 0, 2.5, 65]}}
  - {{key: {HEIGHT}, linear: {{from: 0, to: 7, count: 8}}}}
  - {{key: {SEPARATION}, values: [2, 3]}}
constraints: [dome_height_mm - unit_separation_mm > 0.5, units != 1]
"""
HUGE = f"""\
base: three_unit.yaml
space:
  - {{key: {HEIGHT}, linear: {{from: 6, to: 7, count: 2000}}}}
  - {{key: {SEPARATION}, linear: {{from: 2, to: 3, count: 2000}}}}
  - {{key: finger.geometry.channel_width_mm, linear: {{from: 9, to: 10, count: 2000}}}}
"""
WRONG = """\
base: wrong_base.yaml
spaces: []
space:
  - {key: finger.geometry.dome_hight_mm, values: [1]}
  - {key: finger.units, values: []}
  - {key: finger.units, linear: {from: 1, to: 2, count: 3}}
constraints: [units <]
"""
WRONG_BASE = "finger:\n  units: 0\n  bogus: 1\n"


@pytest.fixture
def write(folder: Path) -> Callable[[str], None]:
    """Write the sweep file, with its base beside it."""
    (folder / "wrong_base.yaml").write_text(WRONG_BASE)
    return lambda text: (folder / "sweep.yaml").write_text(text) and None


def facts(call: Call, *arguments: str, text: str | None = None) -> dict[str, Any]:
    result = call("explain", *arguments, "--format", "json", text=text)
    assert (result.exit_code, result.stderr) == (0, "")

    def refused(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    plan: dict[str, Any] = json.loads(result.stdout, parse_constant=refused)
    return plan


def test_sweeps_and_specs_are_validated_together(call: Call, write: Any) -> None:
    write(FEW)
    result = call("validate", "three_unit.yaml", "sweep.yaml")
    assert (result.exit_code, result.stdout) == (0, "three_unit.yaml: ok\nsweep.yaml: ok\n")


@pytest.mark.parametrize(
    ("space", "said"),
    [
        ("finger.overrides.9.lattice.stroke_mm, values: [1, 2]}]", "finger.overrides.9: expected"),
        ("finger.units, values: [0, 99]}]", "finger.units: expected a whole number from 1 to 64"),
        ("finger.units, values: [1, 2]}]\nconstraints: [units > 3]", "constraints exclude all of"),
    ],
)
def test_a_sweep_without_a_design_to_solve_is_not_ok(
    call: Call, write: Any, space: str, said: str
) -> None:
    write(f"base: three_unit.yaml\nspace: [{{key: {space}\n")
    result = call("validate", "sweep.yaml")
    assert result.exit_code == 2
    found = "sweep.yaml: space: expected a design that can be solved, found none in 2 ("
    assert result.stdout.startswith(found + said)


def test_a_sweep_with_one_design_to_solve_is_ok(call: Call, write: Any) -> None:
    write("base: three_unit.yaml\nspace: [{key: finger.units, values: [0, 3, 99]}]\n")
    assert call("validate", "sweep.yaml").stdout == "sweep.yaml: ok\n"


def test_mistakes_of_a_sweep_and_of_its_base_come_together(call: Call, write: Any) -> None:
    write(WRONG)
    lines = call("validate", "sweep.yaml").stdout.splitlines()
    assert [line.partition(" expected")[0] for line in lines] == [
        "sweep.yaml:2:1: spaces:",
        "sweep.yaml:4:6: space.0.key:",
        "sweep.yaml:5:25: space.1.values:",
        "sweep.yaml:6:25: space.2.linear:",
        "sweep.yaml:7:15: constraints.0:",
        "wrong_base.yaml:2:3: finger.units:",
        "wrong_base.yaml:3:3: finger.bogus:",
        "7 problems",
    ]
    for command in (("explain", "sweep.yaml"), ("sweep", "sweep.yaml", "-o", "out")):
        refused = call(*command)
        assert (refused.exit_code, refused.stdout) == (2, "")
        assert refused.stderr.splitlines()[:-1] == lines[:-1]


@pytest.mark.parametrize("form", ["json", "github"])
def test_all_forms_list_the_mistakes_of_sweeps(call: Call, write: Any, form: str) -> None:
    write(WRONG)
    result = call("validate", "sweep.yaml", "--format", form)
    assert result.exit_code == 2
    files = [problem["file"] for problem in json.loads(result.stdout)] if form == "json" else []
    assert files == (["sweep.yaml"] * 5 + ["wrong_base.yaml"] * 2 if form == "json" else [])
    assert form == "json" or result.stdout.count("::error file=wrong_base.yaml,line=") == 2


@pytest.mark.parametrize(
    ("base", "said"),
    [
        ("", "sweep.yaml:1:1: base: expected the path of a spec, from this file's folder, found"),
        ("base:\n", "sweep.yaml:1:1: base: expected the path of a spec, from this file's folder"),
        ("base: none.yaml\n", "none.yaml: file: expected a readable file, found no such file"),
        ("base: .\n", ".: file: expected a file, found a directory"),
        ("base: 3\n", "sweep.yaml:1:1: base: expected the path of a spec"),
    ],
)
def test_a_sweep_without_its_base_still_says_what_else_is_wrong(
    call: Call, write: Any, base: str, said: str
) -> None:
    write(
        f"{base}space: [{{key: finger.unitz, values: [1]}}]\nconstraints: [nothing_mm > 1, 3 <]\n"
    )
    result = call("validate", "sweep.yaml")
    assert result.exit_code == 2
    assert any(line.startswith(said) for line in result.stdout.splitlines())
    assert "did you mean units?" in result.stdout
    assert "constraints.1: expected an expression" in result.stdout
    assert "nothing_mm" not in result.stdout  # the base may have it
    assert result.stdout.splitlines()[-1] == "3 problems"


def test_settings_change_the_base(call: Call, write: Any) -> None:
    write(FEW)
    assert facts(call, "sweep.yaml", "-s", "finger.units=5")["n_states"] == 6 * 32
    wrong = call("validate", "sweep.yaml", "-s", "finger.units=0")
    assert (wrong.exit_code, "--set: finger.units: expected a whole" in wrong.stdout) == (2, True)
    varied = call("validate", "sweep.yaml", "-s", f"{HEIGHT}=6")
    assert (varied.exit_code, "that the space leaves alone" in varied.stdout) == (2, True)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("spaze: []\n", "document.yaml:1:1: spaze: {}, found spaze (did you mean space?)"),
        ("a: 1\nfingr: {}\n", "document.yaml:2:1: fingr: {}, found fingr (did you mean finger?)"),
        ("zzz: 1\n", "document.yaml:1:1: document: {}, found neither"),
        ("calibration_version: 1\n", "document.yaml:1:1: document: {}, found neither (a calib"),
        ("{}\n", "document.yaml:1:1: document: {}, found neither"),
        (
            "finger: {}\nspace: []\n",
            "document.yaml:1:1: finger: {}, found finger beside space (the",
        ),
        ("base: a\ngripper: {}\n", "document.yaml:2:1: gripper: {}, found gripper beside base"),
    ],
)
@pytest.mark.parametrize("command", ["validate", "explain"])
def test_what_is_neither_is_said_to_be(
    call: Call, folder: Path, command: str, text: str, said: str
) -> None:
    (folder / "document.yaml").write_text(text)
    result = call(command, "document.yaml")
    kinds = (
        "expected a spec, with the key finger, a sweep, with the keys base and space, or a goal, "
        "with the keys base, vary and targets"
    )
    assert result.exit_code == 2
    problem, count = result.output.splitlines()
    assert problem.startswith(said.format(kinds))
    assert "1 problem" in count


@pytest.mark.parametrize("text", ["space: []\n", "constraints: []\n", "gripper: {}\n"])
def test_one_key_is_enough_to_know_what_is_meant(call: Call, folder: Path, text: str) -> None:
    (folder / "part.yaml").write_text(text)
    said = call("validate", "part.yaml").stdout
    assert "or a sweep" not in said
    assert ("base: " if "gripper" not in text else "finger: ") in said


def test_standard_input_is_read_once(call: Call, write: Any) -> None:
    write(FEW)
    assert call("validate", "-", text=FEW).stdout == "-: ok\n"
    assert facts(call, "-", text=FEW)["n_designs"] == 6
    wrong = call("validate", "-", text=WRONG)
    assert wrong.exit_code == 2
    assert wrong.stdout.startswith("<stdin>:2:1: spaces: ")
    assert "wrong_base.yaml:2:3: " in wrong.stdout


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_a_pipe_is_read_once(folder: Path, write: Any) -> None:
    """Names in it are from the folder of the pipe, `/dev/fd`."""
    write(FEW.replace("three_unit.yaml", str(folder / "three_unit.yaml")))
    program = shlex.join([sys.executable, "-c", PROGRAM, "explain", "--format", "json"])
    done = subprocess.run(
        ["bash", "-c", f"{program} <(cat sweep.yaml)"],
        cwd=folder,
        env={**os.environ, "NO_COLOR": "1"},
        capture_output=True,
        check=False,
        timeout=60,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert json.loads(done.stdout)["n_designs"] == 6


@pytest.mark.parametrize("command", ["validate", "explain"])
def test_a_reader_that_goes_away_ends_it_quietly(run: Any, write: Any, command: str) -> None:
    write(FEW)
    reading, writing = os.pipe()
    os.close(reading)
    done = run(command, "sweep.yaml", stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("text", [FEW, MIXED, FEW.replace("three_unit", "gripper")])
def test_the_sweep_does_what_explain_says(
    call: Call, folder: Path, write: Any, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    """Designs and states are equal, the disk is right to a factor of two."""
    write(text)
    plan = facts(call, "sweep.yaml")
    taken = []
    monkeypatch.setattr(PartStore, "drop", lambda store: taken.append(bytes_in(folder / "out")))
    assert call("sweep", "sweep.yaml", "-o", "out", "--executor", "serial").exit_code == 0
    designs = pd.read_parquet(folder / "out" / "designs.parquet")
    counts = designs["status"].value_counts()
    assert plan["n_designs"] == len(designs)
    assert plan["n_excluded"] == counts.get("excluded", 0)
    assert plan["n_invalid"] == counts.get("invalid", 0)
    assert plan["n_states"] == pq.read_metadata(folder / "out" / "states.parquet").num_rows
    assert plan["most_units"] == designs["n_units"].max()
    (at_most,) = taken
    assert at_most / 2 < plan["expected_disk_bytes"] < 2 * at_most
    assert plan["refused"] is None


def bytes_in(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def test_the_mixed_sweep_has_designs_of_every_kind(call: Call, write: Any) -> None:
    write(MIXED)
    plan = facts(call, "sweep.yaml")
    assert min(plan["n_excluded"], plan["n_invalid"], plan["n_states"]) > 0
    text = call("explain", "sweep.yaml").stdout
    n_solved = plan["n_designs"] - plan["n_excluded"] - plan["n_invalid"]
    assert f"designs  {plan['n_designs']}: {n_solved} to solve, " in text
    assert f", {plan['n_excluded']} excluded by constraints, " in text
    assert f"{plan['n_invalid']} that cannot exist" in text
    assert f"states   {plan['n_states']:,}; the longest finger has 4 units" in text
    assert all(axis["keys"][0]["key"] in text for axis in plan["axes"])
    assert all(f"  {rule}\n" in text for rule in plan["constraints"])


def test_a_huge_space_is_measured_and_not_begun(
    call: Call, folder: Path, write: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = counted_designs(monkeypatch)
    write(HUGE)
    before = sorted(folder.iterdir())
    plan = facts(call, "sweep.yaml")
    assert (plan["n_designs"], plan["n_states"]) == (8 * 10**9, 64 * 10**9)
    assert (plan["n_excluded"], plan["n_invalid"]) == (None, None)
    assert sum(seen) < 1.1 * extent.MOST_ASKED, "what their outputs rest on is asked of a million"
    assert {row["share"] for row in plan["trust"]} == {""}
    assert plan["expected_disk_bytes"] > 10**12
    text = call("explain", "sweep.yaml").stdout
    assert "designs  8,000,000,000, too many to hold each" in text
    assert "states   at most 64,000,000,000" in text
    assert plan["refused"] in text
    refused = call("sweep", "sweep.yaml", "-o", "out").stderr
    assert refused == f"dpg: {plan['refused']}\n"
    assert {path.name for path in folder.iterdir()} - {path.name for path in before} <= {"out"}


def counted_designs(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many designs of a space are looked at, each time."""
    from dpgcli.sweeps.space import Space

    whole, seen = Space.designs, [0]

    def designs(space: Space, first: int, stop: int) -> Any:
        seen.append(stop - first)
        return whole(space, first, stop)

    monkeypatch.setattr(Space, "designs", designs)
    return seen


def test_more_designs_than_can_be_numbered_are_a_mistake(call: Call, write: Any) -> None:
    write(HUGE + f"  - {{key: finger.geometry.dome_thickness_mm, values: {[0.5] * 50}}}\n")
    for command in ("validate", "explain"):
        result = call(command, "sweep.yaml")
        assert result.exit_code == 2
        assert "space: expected at most 9,999,999,999 designs, found 400,000," in result.output


def test_what_the_memory_cannot_hold_is_said(
    call: Call, write: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(FEW)
    monkeypatch.setattr("dpgcli.studies.sweep._memory", lambda: 2**20)
    assert "--force" in facts(call, "sweep.yaml")["refused"]
    result = call("explain", "sweep.yaml")
    assert result.exit_code == 0
    assert "this machine has 1 MiB: take fewer values, or go on with --force" in result.stdout


@pytest.mark.parametrize(
    "options",
    [("--pattern", "1*"), ("--columns", "all"), ("--nodes",), ("--formulation", "lattice")],
)
def test_options_of_states_are_refused(call: Call, write: Any, options: tuple[str, ...]) -> None:
    write(FEW)
    result = call("explain", "sweep.yaml", *options)
    assert (result.exit_code, result.stdout) == (2, "")
    assert "--pattern, --columns and --formulation are for specs" in result.stderr
    assert call("explain", "sweep.yaml", "--target-error", "0.01mm").exit_code == 0
    wrong = call("explain", "sweep.yaml", "--tolerance", "1")
    assert wrong.stderr == call("sweep", "sweep.yaml", "-o", "o", "--tolerance", "1").stderr


def test_a_document_is_opened_once(call: Call, write: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from dpgcli.files import yaml_file

    write(FEW)
    read = []
    content_of = yaml_file.content_of

    def counted(path: Path, *others: Any) -> bytes:
        read.append(path.name)
        return content_of(path, *others)

    monkeypatch.setattr(yaml_file, "content_of", counted)
    assert call("validate", "sweep.yaml", "three_unit.yaml").exit_code == 0
    assert read == ["sweep.yaml", "three_unit.yaml", "three_unit.yaml"]


def test_the_limit_of_what_is_looked_at(
    call: Call, write: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(FEW)
    for most, n_invalid in ((6, 0), (5, None)):
        monkeypatch.setattr("dpgcli.studies.plan.MOST_ASKED", most)
        plan = facts(call, "sweep.yaml")
        assert (plan["n_invalid"], plan["n_states"]) == (n_invalid, 48)
    assert extent.MOST_ASKED == 10**6


def test_functions_take_sweeps(call: Call, write: Any, folder: Path) -> None:
    write(WRONG)
    found = dpg.validate("sweep.yaml", folder / "three_unit.yaml")
    assert [str(problem) for problem in found] == call(
        "validate", "sweep.yaml"
    ).stdout.splitlines()[:-1]
    write(FEW)
    assert dpg.validate("sweep.yaml", settings={"finger.units": 2}) == ()
    base = sweep_file.read_sweep(Path("sweep.yaml")).base_data
    table = pd.DataFrame({HEIGHT: [6.0, 6.5], SEPARATION: [2.0, 3.0]})
    data = {"base": base, "space": [{"table": table}], "constraints": ["dome_height_mm > 6"]}
    plan = dpg.explain(data, settings={"finger.units": 4})
    assert (plan.n_designs, plan.n_excluded, plan.n_invalid, plan.n_states) == (2, 1, 0, 16)
    assert dpg.validate(data) == ()
    wrong = dpg.validate({"base": {"finger": {"units": 0}}, "space": [{"key": "x", "values": [1]}]})
    assert [problem.key for problem in wrong] == ["space.0.key", "finger.units"]
    with pytest.raises(dpg.UsageError, match="patterns, columns and formulation are for specs"):
        dpg.explain(data, patterns="1*")
    with pytest.raises(dpg.SpecError, match="found finger beside space"):
        dpg.explain({"finger": {}, "space": []})


def test_what_takes_specs_alone_says_what_takes_a_sweep(call: Any, folder: Path) -> None:
    (folder / "wide.yaml").write_text("base: three_unit.yaml\nspace: []\n", encoding="utf-8")
    for command in (("predict",), ("bench",), ("compare",)):
        more = ("three.csv",) if command == ("compare",) else ()
        result = call(*command, "wide.yaml", *more)
        assert result.exit_code == 2
        assert result.stderr.startswith(
            "wide.yaml:2:1: space: expected a spec, with the key finger, found a sweep "
            "(dpg sweep and dpg explain take it)"
        )


@pytest.mark.parametrize("output", ["tables", "tables/out"])
def test_no_output_lies_in_a_folder_that_is_read(call: Any, folder: Path, output: str) -> None:
    key = "finger.geometry.dome_height_mm"
    (folder / "tables").mkdir()
    (folder / "tables" / "a.csv").write_text(f"{key}\n6.5\n", encoding="utf-8")
    (folder / "wide.yaml").write_text("base: three_unit.yaml\nspace: [{table: tables}]\n")
    result = call("sweep", "wide.yaml", "-o", output)
    assert result.exit_code == 2
    assert "would lie in a folder that is read" in result.stderr
    assert sorted(path.name for path in (folder / "tables").iterdir()) == ["a.csv"]
