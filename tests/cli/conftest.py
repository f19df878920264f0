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
PROGRAM = (sys.executable, "-c", "from dpgcli.cli.main import main; main()")
AMBIENT = {"NO_COLOR", "FORCE_COLOR", "GITHUB_ACTIONS", "COLUMNS", "CLICOLOR_FORCE"}

Run = Callable[..., "subprocess.CompletedProcess[str]"]
Start = Callable[..., "subprocess.Popen[bytes]"]


def surroundings(changes: Mapping[str, str] | None = None) -> dict[str, str]:
    """The environment without what would change how output is written."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if name not in AMBIENT and not name.startswith(("PYTHONIO", "PYTHONUNB", "PYTHONUTF8"))
    }
    return {**kept, **(changes or {})}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Copies of some specs, so that no test can touch the real ones."""
    for name in ("three_unit.yaml", "twenty_unit.yaml", "gripper.yaml"):
        (tmp_path / name).write_bytes((CONFIGS / name).read_bytes())
    return tmp_path


@pytest.fixture
def run(folder: Path) -> Run:
    """Run `dpg` as a process of its own; `env` adds to the environment."""

    def started(
        *arguments: str, env: Mapping[str, str] | None = None, **options: Any
    ) -> "subprocess.CompletedProcess[str]":
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "timeout": 60}
        return subprocess.run(
            [*PROGRAM, *arguments],
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
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        process = subprocess.Popen(
            [*PROGRAM, *arguments], cwd=folder, env=surroundings(), **{**pipes, **options}
        )
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
