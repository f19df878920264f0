"""Readers that stop, disks that fill up, and streams that are closed."""

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

pytestmark = pytest.mark.slow

SMALL = (
    ("predict", "three_unit.yaml"),
    ("predict", "three_unit.yaml", "--format", "json"),
    ("explain", "three_unit.yaml"),
    ("validate", "three_unit.yaml"),
    ("schema",),
    ("init", "-"),
)
HELP = (("--version",), ("predict", "--help"))
SLOW = pytest.mark.slow
BUFFERING = ({}, {"PYTHONUNBUFFERED": "1"})


@pytest.fixture
def no_reader() -> Iterator[int]:
    """The writing end of a pipe that nobody reads."""
    reading, writing = os.pipe()
    os.close(reading)
    yield writing
    os.close(writing)


@pytest.fixture
def full() -> Iterator[int]:
    """A file on a full disk, open for writing."""
    if not Path("/dev/full").is_char_device():
        pytest.skip("no /dev/full here")
    handle = os.open("/dev/full", os.O_WRONLY)
    yield handle
    os.close(handle)


@pytest.mark.parametrize("arguments", [*SMALL, *HELP])
def test_a_reader_that_has_had_enough_ends_it_quietly(
    run: Any, no_reader: int, arguments: tuple[str, ...]
) -> None:
    result = run(*arguments, stdout=no_reader)
    assert result.returncode == 0
    assert "Error" not in result.stderr
    assert "dpg:" not in result.stderr


@pytest.mark.parametrize("form", ["csv", *(pytest.param(f, marks=SLOW) for f in ("json", "table"))])
def test_head_of_a_million_rows(start: Any, form: str) -> None:
    process = start("predict", "twenty_unit.yaml", "--format", form)
    assert process.stdout.readline()
    process.stdout.close()
    errors = process.stderr.read()
    assert process.wait(60) == 0
    assert b"Error" not in errors
    assert b"Traceback" not in errors


@pytest.mark.parametrize("env", BUFFERING, ids=["buffered", "unbuffered"])
def test_a_failed_check_stays_one_when_nobody_reads(
    run: Any, folder: Path, no_reader: int, env: dict[str, str]
) -> None:
    (folder / "bad.yaml").write_text("finger: 1\n", encoding="utf-8")
    result = run("validate", "bad.yaml", stdout=no_reader, env=env)
    assert (result.returncode, result.stderr) == (2, "")


@pytest.mark.parametrize("env", BUFFERING, ids=["buffered", "unbuffered"])
def test_the_file_is_written_when_nobody_reads_the_rows(
    run: Any, folder: Path, no_reader: int, env: dict[str, str]
) -> None:
    arguments = ("-q", "three_unit.yaml", "--format", "csv", "-o", "states.parquet")
    result = run("predict", *arguments, stdout=no_reader, env=env)
    assert (result.returncode, result.stderr) == (0, "")
    assert pq.read_table(folder / "states.parquet").num_rows == 8
    assert (folder / "states.run.json").is_file()


@pytest.mark.parametrize(
    "arguments", [SMALL[0], SMALL[-1], HELP[0], *(pytest.param(a, marks=SLOW) for a in SMALL[1:-1])]
)
def test_a_full_disk_behind_standard_output_is_2(
    run: Any, full: int, arguments: tuple[str, ...]
) -> None:
    result = run(*arguments, stdout=full)
    assert result.returncode == 2
    assert "Traceback" not in result.stderr
    assert result.stderr.strip() == "dpg: cannot write the output: No space left on device"


@pytest.mark.parametrize("env", BUFFERING, ids=["buffered", "unbuffered"])
def test_a_full_disk_behind_the_rows_is_not_blamed_on_the_file(
    run: Any, folder: Path, full: int, env: dict[str, str]
) -> None:
    arguments = ("-q", "three_unit.yaml", "--format", "csv", "-o", "states.parquet")
    result = run("predict", *arguments, stdout=full, env=env)
    assert result.returncode == 2
    assert result.stderr == "dpg: cannot write the output: No space left on device\n"
    written = folder / "states.parquet"
    assert not written.exists() or pq.read_table(written).num_rows == 8
    assert not list(folder.glob(".*.tmp"))


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("predict", "three_unit.yaml"), 0),
        (("predict", "missing.yaml"), 2),
        (("predict", "three_unit.yaml", "--pattern", "0000"), 5),
    ],
)
def test_messages_that_cannot_be_written_do_not_change_the_code(
    run: Any, full: int, arguments: tuple[str, ...], code: int
) -> None:
    assert run(*arguments, stderr=full).returncode == code


@pytest.mark.parametrize(
    ("arguments", "code"),
    [(("predict", "three_unit.yaml"), 0), (("predict", "missing.yaml"), 2), (("init",), 0)],
)
def test_closed_standard_error_sends_no_messages_into_the_data(
    run: Any, arguments: tuple[str, ...], code: int
) -> None:
    result: subprocess.CompletedProcess[str] = run(*arguments, preexec_fn=lambda: os.close(2))
    assert result.returncode == code
    assert "missing.yaml" not in result.stdout
    assert "wrote" not in result.stdout


@pytest.mark.parametrize("arguments", [SMALL[0], SMALL[2], ("--help",)])
def test_closed_standard_output_is_no_bug(run: Any, arguments: tuple[str, ...]) -> None:
    result = run(*arguments, preexec_fn=lambda: os.close(1))
    assert result.returncode in (0, 2)
    assert "Traceback" not in result.stderr


def test_closed_standard_output_does_not_keep_a_file_from_being_written(
    run: Any, folder: Path
) -> None:
    arguments = ("-q", "three_unit.yaml", "-o", "states.parquet")
    result = run("predict", *arguments, preexec_fn=lambda: os.close(1))
    assert "Traceback" not in result.stderr
    assert pq.read_table(folder / "states.parquet").num_rows == 8
