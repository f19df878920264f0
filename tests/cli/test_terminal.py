"""On a terminal and in a pipe: widths, escape codes, progress."""

import fcntl
import os
import pty
import re
import struct
import subprocess
import termios
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow

Shown = Callable[..., tuple[int, str]]
ESCAPES = re.compile(r"\x1b\[[0-9;]*m")
COLORFUL = (
    {"FORCE_COLOR": "1"},
    {"TTY_COMPATIBLE": "1"},
    {"GITHUB_ACTIONS": "true", "CLICOLOR_FORCE": "1", "PY_COLORS": "1"},
)


@pytest.fixture
def shown(start: Any) -> Shown:
    """Exit code and text of a run on a terminal with so many columns."""

    def on_terminal(*arguments: str, columns: int = 80) -> tuple[int, str]:
        ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        process = start(*arguments, stdin=theirs, stdout=theirs, stderr=theirs)
        os.close(theirs)
        content = b""
        while True:
            try:
                part = os.read(ours, 65536)
            except OSError:  # Linux says so when the other end is closed
                break
            if not part:
                break
            content += part
        os.close(ours)
        return process.wait(30), content.decode().replace("\r\n", "\n")

    return on_terminal


@pytest.mark.parametrize("env", COLORFUL, ids=lambda env: next(iter(env)))
@pytest.mark.parametrize(
    "arguments",
    [("predict", "three_unit.yaml"), ("predict", "--nope"), ("help", "sweeps"), ("help",)],
)
def test_no_escape_codes_in_pipes(
    run: Any, env: dict[str, str], arguments: tuple[str, ...]
) -> None:
    result: subprocess.CompletedProcess[str] = run(*arguments, env=env)
    assert "\x1b" not in result.stdout + result.stderr


@pytest.mark.parametrize("env", [{"COLUMNS": "40", "TERM": "dumb"}, {"COLUMNS": "x"}])
def test_rows_in_a_pipe_are_never_cropped(run: Any, env: dict[str, str]) -> None:
    lines = run("predict", "-q", "three_unit.yaml", env=env).stdout.splitlines()
    assert len(lines) == 9
    assert lines[0].endswith("numerical_error_mm")
    assert len({len(line) for line in lines}) == 1


def test_a_table_fits_a_terminal_of_80_columns(shown: Shown) -> None:
    code, text = shown("predict", "-q", "three_unit.yaml")
    assert code == 0
    assert max(map(len, text.splitlines())) <= 80
    assert "111" in text
    assert "\x1b" not in text


def test_a_narrow_terminal_names_what_it_leaves_out(shown: Shown) -> None:
    code, text = shown("predict", "three_unit.yaml", columns=60)
    assert code == 0
    assert "no room for numerical_error_mm" in text
    code, text = shown("predict", "-q", "three_unit.yaml", columns=40)
    assert code == 0
    assert all(pattern in text for pattern in ("000", "101", "111"))


def test_a_problem_on_a_terminal_is_the_same_text(shown: Shown, run: Any) -> None:
    code, text = shown("predict", "missing.yaml")
    assert (code, text) == (2, run("predict", "missing.yaml").stderr)


def test_no_progress_in_a_pipe(run: Any, folder: Path) -> None:
    result = run("predict", "twenty_unit.yaml", "-o", "states.parquet")
    assert result.stdout == ""
    assert "\r" not in result.stderr
    assert "%" not in result.stderr.splitlines()[0]
    assert "1,048,576 stable" in result.stderr


@pytest.mark.parametrize("columns", [40, 120])
def test_pages_are_rendered_in_the_width_of_the_terminal(shown: Shown, columns: int) -> None:
    code, text = shown("help", "sweeps", columns=columns)
    lines = [ESCAPES.sub("", line) for line in text.split("\n")]
    assert code == 0
    assert "\x1b[" in text
    assert max(map(len, lines)) <= columns
    assert not any(line.startswith("#") or "|---|" in line for line in lines)
    assert "(dpg help" in " ".join(" ".join(lines).split())
