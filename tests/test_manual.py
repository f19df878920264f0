"""The README is current: it names everything, and its sessions are what the program prints."""

import inspect
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.models import OptionInfo
from typer.testing import CliRunner

import dpgcli as dpg
from dpgcli.benchmark.ablation import ABLATIONS
from dpgcli.cli import (
    bench,
    check,
    compare,
    explain,
    fe,
    init,
    merge,
    predict,
    report,
    schema,
    stress,
    sweep,
    validate,
)
from dpgcli.cli.exits import ExitCode
from dpgcli.cli.fit.bistable import bistable
from dpgcli.cli.fit.finger import finger
from dpgcli.cli.fit.grid import grid
from dpgcli.cli.fit.hinge import hinge
from dpgcli.cli.main import app
from dpgcli.design.scene import Origin
from dpgcli.files.scene_file import json_schema, read_spec
from dpgcli.files.sweep_file import read_sweep
from dpgcli.hard_cases.families import FAMILIES, PATTERNS
from dpgcli.hard_cases.verdicts import Verdict
from dpgcli.states.certify import Status
from dpgcli.states.columns import Group
from dpgcli.states.quantities import declared
from dpgcli.sweeps.evaluation import LEVEL_COLUMNS, DesignStatus
from dpgcli.sweeps.metrics import METRICS

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = {
    **{
        module.__name__.rpartition(".")[2]: getattr(module, module.__name__.rpartition(".")[2])
        for module in (
            predict,
            explain,
            sweep,
            bench,
            compare,
            stress,
            merge,
            check,
            report,
            validate,
            init,
            schema,
        )
    },
    "fit bistable": bistable,
    "fit hinge": hinge,
    "fit finger": finger,
    "fit grid": grid,
    "fe dome": fe.dome,
    "fe hinge": fe.hinge,
}
LAST_DIGITS = re.compile(r"\d\.\de[-+]\d\d")  # rounding differs between processors


def blocks(language: str, text: str = README) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def sessions() -> list[list[tuple[str, str]]]:
    """Commands of each console block with their output."""
    return [
        [part.partition("\n")[::2] for part in block.split("$ ")[1:]] for block in blocks("console")
    ]


@pytest.mark.parametrize("session", sessions(), ids=lambda session: session[0][0][:60])
def test_a_session_prints_what_the_manual_shows(
    session: list[tuple[str, str]], tmp_path: Path
) -> None:
    """Its commands one after the other, in a folder of its own beside the examples."""
    (tmp_path / "configs").symlink_to(ROOT / "configs")
    run = "from dpgcli.__main__ import main; main()"
    for command, expected in session:
        program, *arguments = shlex.split(command)
        assert program == "dpg"
        result = subprocess.run(
            [sys.executable, "-c", run, *arguments],
            cwd=tmp_path,
            env={**os.environ, "NO_COLOR": "1"},
            capture_output=True,
            text=True,
            check=True,
        )
        assert LAST_DIGITS.sub("#", result.stdout) == LAST_DIGITS.sub("#", expected)


def test_the_spec_shown_is_valid(tmp_path: Path) -> None:
    path = tmp_path / "spec.yaml"
    path.write_text(blocks("yaml")[0], encoding="utf-8")
    assert read_spec(path).finger.units == 5


def test_the_sweep_shown_is_valid(tmp_path: Path) -> None:
    (tmp_path / "sweeps").mkdir()
    shutil.copy(ROOT / "configs" / "five_unit.yaml", tmp_path)
    path = tmp_path / "sweeps" / "sweep.yaml"
    path.write_text(blocks("yaml")[1], encoding="utf-8")
    assert read_sweep(path).space.size == 13 * 3 * 3 * 2 * 64


def test_the_examples_in_python_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One after the other, in a folder of their own beside the examples."""
    (tmp_path / "configs").symlink_to(ROOT / "configs")
    monkeypatch.chdir(tmp_path)
    section = re.search(r"^## From Python\n(.*?)^## ", README, re.MULTILINE | re.DOTALL)
    assert section is not None
    names: dict[str, object] = {}
    for example in blocks("python", section[1]):
        exec(example, names)
    said = capsys.readouterr().out
    assert "101" in said
    assert "met: n_stable == 32: all 3 designs" in said
    assert (tmp_path / "dome.yaml").exists()


def test_the_examples_of_reading_tables_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In a folder with the tables that the commands before them have made."""
    monkeypatch.chdir(tmp_path)
    run = CliRunner().invoke
    sweep_file = ROOT / "configs" / "sweeps" / "height_separation.yaml"
    assert run(app, ["sweep", str(sweep_file), "-o", "out", "--executor", "serial"]).exit_code == 0
    spec = ROOT / "configs" / "five_unit.yaml"
    assert run(app, ["predict", str(spec), "-o", "states.parquet"]).exit_code == 0
    examples = blocks("python", README.partition("## From Python\n")[0])
    assert examples
    for example in examples:
        exec(example, {})
    assert "tip_y_mm" in capsys.readouterr().out


def test_every_function_is_named() -> None:
    functions = [name for name in dpg.__all__ if inspect.isfunction(getattr(dpg, name))]
    named = {name for name in functions if re.search(rf"(`|dpg\.){name}\b", README)}
    assert set(functions) - named <= {"read_calibration", "uniform_finger"}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_and_option_is_named(name: str) -> None:
    assert f"`dpg {name}" in README
    options = set()
    for parameter in inspect.signature(COMMANDS[name]).parameters.values():
        for metadata in getattr(parameter.annotation, "__metadata__", ()):
            if isinstance(metadata, OptionInfo):
                said = (metadata.default, *(metadata.param_decls or ()))
                named = {text for text in said if isinstance(text, str) and text[:1] == "-"}
                options |= named or {f"--{parameter.name.replace('_', '-')}"}
    assert not {option for option in options if option not in README}


def test_every_key_of_the_spec_is_named() -> None:
    definitions = json_schema()["$defs"].values()
    keys = {key for part in definitions for key in part.get("properties", {})}
    assert not {key for key in keys if key not in README}


def test_every_column_group_status_origin_and_exit_code_is_named() -> None:
    columns = declared(3, ("bistable", "hinge", "bar"), True)
    named = {c.name for c in columns if c.group not in (Group.NODES, Group.OPENINGS)}
    named |= {"opening_1_mm", *(g.value for g in Group), *(s.text for s in Status), *Origin}
    assert not {name for name in named if f"`{name}" not in README}
    named = {c.name for c in (*METRICS, *LEVEL_COLUMNS)} | {*DesignStatus, *ABLATIONS}
    named |= {*Verdict, PATTERNS.name, *(family.name for family in FAMILIES)}
    assert not {name for name in named if f"`{name}" not in README}
    assert not {code for code in ExitCode if not re.search(rf"^\|.*\b{code}\b.*\|", README, re.M)}
