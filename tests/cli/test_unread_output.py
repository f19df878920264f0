"""A closed pipe silences printing and nothing else: work, files and exit codes are the same."""

import os
import subprocess
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from dpgcli.cli.streams import Stream

pytestmark = pytest.mark.slow

CONFIGS = Path(__file__).parents[2] / "configs"
SWEEP = """base: three_unit.yaml
space:
  - {key: finger.geometry.dome_height_mm, values: [6, 6.5, 7]}
"""
SERIAL = ("--executor", "serial")
CURVE = os.fspath(CONFIGS / "calibration" / "hinge_moment.csv")
BUFFERED: dict[str, str] = {}
UNBUFFERED = {"PYTHONUNBUFFERED": "1"}
KILLS = (
    "from concurrent.futures import BrokenExecutor as B\n"
    "from dpgcli.sweeps.executors import SerialExecutor as S\n"
    "old = S.submit\n"
    "def broken(): raise B('killed')\n"
    "def submit(self, f, *a):\n"
    "    return old(self, broken) if a and a[0].start <= 1 < a[0].stop else old(self, f, *a)\n"
    "S.submit = submit"
)
FAILS = """
from dpgcli.hard_cases.outcomes import Outcome
Outcome.is_failure = property(lambda self: True)
"""
BREAKS = (
    ""
    "def broken(*_): raise BrokenPipeError('of a socket')\n"
    "import dpgcli.api.given as specs\n"
    "specs.read_document = broken"
)
FEW = (
    "from dpgcli.states.predict import Prediction\n"
    "old = Prediction.blocks\n"
    "def blocks(self):\n"
    "    for number, block in enumerate(old(self)):\n"
    "        assert number < 2, 'goes on'\n"
    "        yield block\n"
    "Prediction.blocks = blocks"
)
SLOW = pytest.mark.slow
Unread = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture
def unread(run: Any, folder: Path) -> Iterator[Unread]:
    """Run `dpg` with a standard output that nobody reads."""
    (folder / "sweep.yaml").write_text(SWEEP)
    (folder / "bad.yaml").write_text("finger: 1\n")
    reading, writing = os.pipe()
    os.close(reading)
    yield lambda *words, **options: run(*words, **{"stdout": writing, "env": BUFFERED, **options})
    os.close(writing)


@pytest.mark.parametrize(
    "env",
    [UNBUFFERED, pytest.param(BUFFERED, marks=SLOW)],
    ids=["unbuffered", "buffered"],
)
@pytest.mark.parametrize(
    ("words", "before", "code"),
    [
        (("sweep", "sweep.yaml", "-o", "out", *SERIAL, "--require", "n_units > 9"), "", 1),
        (("sweep", "sweep.yaml", "-o", "out", *SERIAL), KILLS, 4),
        (("validate", "three_unit.yaml", "bad.yaml"), "", 2),
        (("stress", "--only", "mirror", "-q"), FAILS, 1),
        (("stress", "--only", "mirror", "-q", "--format", "csv"), FAILS, 1),
    ],
)
def test_the_verdict_stands(
    unread: Unread, words: tuple[str, ...], before: str, code: int, env: dict[str, str]
) -> None:
    done = unread(*words, before=before, env=env)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("before", [KILLS, pytest.param("", marks=SLOW)])
def test_of_tables_that_are_made_joined_and_judged(
    unread: Unread, folder: Path, before: str
) -> None:
    code = 4 if before else 0
    shard = ("sweep", "sweep.yaml", *SERIAL, "-o", "shard", "--shard", "1/1")
    assert unread(*shard, before=before).returncode == code
    assert unread("merge", "shard", "-o", "out").returncode == code
    tables = {"states.parquet", "designs.parquet", "report.md"}
    assert {path.name for path in (folder / "out").iterdir()} == tables
    check = ("check", "out/designs.parquet", "--require", "n_units > 9")
    assert unread(*check, "--summary-file", "summary.md").returncode == 1
    assert "not met" in (folder / "summary.md").read_text()
    assert unread("report", "out").returncode == 0


def test_a_sweep_writes_all_its_files(unread: Unread, folder: Path) -> None:
    options = ("--require", "n_units > 9", "--summary-file", "summary.md", "--depfile", "out.d")
    done = unread("sweep", "sweep.yaml", "-o", "out", "-j", "2", *options, env=UNBUFFERED)
    assert done.returncode == 1
    written = {path.name for path in (folder / "out").iterdir()}
    assert written == {"states.parquet", "designs.parquet", "run.json", "report.md"}
    summary = (folder / "summary.md").read_text()
    report, mark = (folder / "out" / "report.md").read_text().rsplit("\n<!--", 1)
    assert mark == " written by dpg -->\n"
    assert report in summary and mark not in summary
    assert "design 1 (dome_height_mm = 6.5): n_units = 3" in summary
    assert (folder / "out.d").is_file()


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (("predict", "three_unit.yaml", "--format", "csv", "-o", "a.parquet"), ["a.parquet"]),
        (("predict", "three_unit.yaml", "--plot", "a.svg"), ["a.svg"]),
        pytest.param(
            ("compare", "study.yaml", "tips.csv", "--plot", "a.svg"), ["a.svg"], marks=SLOW
        ),
        pytest.param(
            ("fit", "hinge", CURVE, "-o", "a.yaml", "--plot", "a.svg"),
            ["a.yaml", "a.svg"],
            marks=SLOW,
        ),
        (("fe", "hinge", "three_unit.yaml", "--out", "deck", "--mesh", "coarse"), ["deck"]),
        pytest.param(
            ("stress", "--only", "mirror", "--format", "json", "-o", "a.parquet"),
            ["a.parquet"],
            marks=SLOW,
        ),
    ],
)
@pytest.mark.usefixtures("study")
def test_files_are_written(
    unread: Unread, folder: Path, words: tuple[str, ...], names: list[str]
) -> None:
    done = unread(*words, env=UNBUFFERED)
    assert done.returncode == 0, done.stderr
    assert "dpg:" not in done.stderr
    assert all((folder / name).exists() for name in names)
    assert "predict" not in words or done.stderr.startswith("8 stable in ")


def test_a_broken_pipe_elsewhere_is_an_error(unread: Unread) -> None:
    done = unread("validate", "three_unit.yaml", before=BREAKS)
    assert done.returncode == 3
    assert "BrokenPipeError: of a socket" in done.stderr


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("--require", "n_units > 0"), 2),
        (("--require", "n_units > 9"), 1),
    ],
)
def test_a_full_disk_behind_the_report_is_said_when_all_is_done(
    unread: Unread, folder: Path, words: tuple[str, ...], code: int
) -> None:
    """A verdict that the work has itself comes first."""
    if not Path("/dev/full").is_char_device():
        pytest.skip("no /dev/full here")
    with Path("/dev/full").open("wb") as full:
        options = ("-o", "out", *SERIAL, "-q", "--summary-file", "summary.md")
        done = unread("sweep", "sweep.yaml", *options, *words, stdout=full)
    assert done.returncode == code
    assert done.stderr.endswith("dpg: cannot write the output: No space left on device\n")
    assert (folder / "summary.md").stat().st_size > 0
    assert {path.suffix for path in (folder / "out").iterdir()} == {".parquet", ".json", ".md"}


def test_a_pipe_that_does_not_wait_gets_all() -> None:
    """As others who write to it may have made it."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    content = bytes(range(256)) * 4096  # more than the pipe holds
    with ThreadPoolExecutor(1) as thread, os.fdopen(reading, "rb") as stream:
        read = thread.submit(stream.read)
        assert Stream(writing).write(memoryview(content)) == len(content)
        os.close(writing)
        assert read.result(30) == content


def test_who_only_prints_stops_when_nobody_reads(unread: Unread) -> None:
    words = ("predict", "twenty_unit.yaml", "--format", "csv")
    done = unread(*words, before=FEW)
    assert (done.returncode, done.stderr) == (0, "")
    done = unread(*words, "-o", "a.parquet", before=FEW)
    assert done.returncode == 3
    assert "AssertionError: goes on" in done.stderr
