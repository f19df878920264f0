"""The program as people start it, in a folder of its own."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from dpgcli.cli.main import app

CONFIGS = Path(__file__).parents[2] / "configs"
PROGRAM = (sys.executable, "-c", "from dpgcli.__main__ import main; main()")
AMBIENT = {"NO_COLOR", "FORCE_COLOR", "GITHUB_ACTIONS", "COLUMNS", "CLICOLOR_FORCE"}

Run = Callable[..., "subprocess.CompletedProcess[str]"]
Start = Callable[..., "subprocess.Popen[bytes]"]

STUDY = """\
finger:
  units: 3
  linear_stiffness_N_per_mm: 1.0e4
  lattice:
    segment_length_mm: 13.75
    segment_height_mm: 10.75
    stroke_mm: 3.5
    bistable_stiffness_N_per_mm: 12.84
    force_linearity: 0.043
    hinge_stiffness_N_mm_per_rad: 24.2
"""
TIPS = """\
pattern,tip_x_mm,tip_y_mm,tip_angle_rad,seconds
000,51.99976,-0.00817,-0.000297,22.5
001,51.36669,-3.44429,-0.266250,22.5
010,50.85420,-7.16644,-0.274989,22.5
100,50.46532,-10.33568,-0.263758,22.5
110,47.71870,-16.52155,-0.524182,22.5
"""


def surroundings(changes: Mapping[str, str] | None = None) -> dict[str, str]:
    """The environment without what would change how output is written."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if name not in AMBIENT and not name.startswith(("PYTHONIO", "PYTHONUNB", "PYTHONUTF8"))
    }
    return {**kept, "PYTHONWARNINGS": "error", **(changes or {})}  # as in the tests themselves


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Copies of some specs, so that no test can touch the real ones."""
    for name in ("three_unit.yaml", "twenty_unit.yaml", "gripper.yaml"):
        (tmp_path / name).write_bytes((CONFIGS / name).read_bytes())
    return tmp_path


@pytest.fixture
def study(folder: Path) -> tuple[str, str]:
    """Names of a lattice with the study's springs, and of a finite-element finger's tips."""
    (folder / "study.yaml").write_text(STUDY)
    (folder / "tips.csv").write_text(TIPS)
    return "study.yaml", "tips.csv"


@pytest.fixture
def run(folder: Path) -> Run:
    """Run `dpg` as a process of its own; `env` adds to the environment, `before` to the program."""

    def started(
        *arguments: str, env: Mapping[str, str] | None = None, before: str = "", **options: Any
    ) -> "subprocess.CompletedProcess[str]":
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "timeout": 60}
        return subprocess.run(
            [*PROGRAM[:2], f"{before}\n{PROGRAM[2]}", *arguments],
            cwd=folder,
            env=surroundings(env),
            check=False,
            text=True,
            **{**pipes, **options},
        )

    return started


@pytest.fixture
def start(folder: Path) -> Iterator[Start]:
    """Start `dpg` and go on; whatever still runs at the end is ended."""
    started: list[subprocess.Popen[bytes]] = []

    def launch(*arguments: str, **options: Any) -> "subprocess.Popen[bytes]":
        usual = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "env": surroundings()}
        process = subprocess.Popen([*PROGRAM, *arguments], cwd=folder, **{**usual, **options})
        started.append(process)
        return process

    yield launch
    for process in started:
        process.kill()
        process.communicate()


@pytest.fixture
def call(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Any]]:
    """Run `dpg` within this process: faster, where no process is needed."""
    monkeypatch.chdir(folder)
    for name in AMBIENT:
        monkeypatch.delenv(name, raising=False)
    before = signal.getsignal(signal.SIGTERM)

    def called(*arguments: str, text: str | None = None) -> Any:
        words: Sequence[str] = arguments
        return CliRunner().invoke(app, list(words), input=text)

    yield called
    signal.signal(signal.SIGTERM, before)
