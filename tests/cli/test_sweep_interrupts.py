"""A sweep that is stopped at any time, in any way: the same command ends with the same bytes."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from dpgcli.cli.exits import ExitCode

PROGRAM = (
    sys.executable,
    "-c",
    "from dpgcli.__main__ import answer_stops, main; answer_stops(); "
    "import dpgcli.studies.sweep as s; s.STATES_PER_CHUNK = 2**11; main()",
)
SWEEP = """base: eight_unit.yaml
space:
  - {key: finger.geometry.dome_height_mm, linear: {from: 2.5, to: 7, count: 16}}
  - {key: finger.geometry.unit_separation_mm, linear: {from: 2, to: 3, count: 12}}
"""
TABLES = ["designs.parquet", "states.parquet"]
Launch = Callable[..., "subprocess.Popen[bytes]"]
MARK = "DPG_TEST_RUN"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="needs /proc"),
]


@pytest.fixture
def mark() -> str:
    """Tells the processes of this test from all others."""
    return uuid.uuid4().hex


@pytest.fixture
def launch(folder: Path, mark: str) -> Iterator[Launch]:
    """Start the sweep in a session of its own, as a terminal does."""
    configs = Path(__file__).parents[2] / "configs"
    (folder / "eight_unit.yaml").write_bytes((configs / "eight_unit.yaml").read_bytes())
    (folder / "sweep.yaml").write_text(SWEEP)

    def started(
        *options: str, output: str = "out", before: str = "", **more: Any
    ) -> "subprocess.Popen[bytes]":
        return subprocess.Popen(
            [
                *PROGRAM[:2],
                before + PROGRAM[2],
                "sweep",
                "sweep.yaml",
                "-o",
                output,
                "-q",
                *options,
            ],
            cwd=folder,
            env={**os.environ, MARK: mark},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
            **more,
        )

    yield started
    for number in family(mark):
        os.kill(number, signal.SIGKILL)


def family(mark: str) -> list[int]:
    """Processes that descend from the sweeps of a test."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            if (
                entry.name.isdigit()
                and f"{MARK}={mark}".encode() in (entry / "environ").read_bytes()
            ):
                found.append(int(entry.name))
        except OSError:
            continue
    return found


def workers(mark: str, main: int) -> list[int]:
    """Processes whose parent is a process of the family other than the first."""
    known = family(mark)
    return [number for number in known if parent(number) in set(known) - {main}]


def parent(number: int) -> int:
    try:
        return int(Path(f"/proc/{number}/stat").read_text().rsplit(")", 1)[1].split()[1])
    except OSError:
        return 0


def wait_until(happened: Callable[[], object], seconds: float = 20) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if happened():
            return True
        time.sleep(0.01)
    return False


def finished(process: "subprocess.Popen[bytes]") -> str:
    """Standard error of a process that must not hang."""
    output, errors = process.communicate(timeout=60)
    assert output == b""
    text = errors.decode()
    if was_python_starting(process, text):
        return ""
    return text


def was_python_starting(process: "subprocess.Popen[bytes]", errors: str) -> bool:
    """Whether an interrupt came before a line of the program had run: Python says so itself."""
    return process.returncode in (-signal.SIGINT, 1) and "dpgcli" not in errors


def contents(folder: Path) -> dict[str, bytes]:
    """The tables, which must be all there is besides run.json and a report."""
    assert {p.name for p in folder.iterdir()} - {"report.md"} == {*TABLES, "run.json"}
    return {name: (folder / name).read_bytes() for name in TABLES}


@pytest.fixture
def undisturbed(launch: Launch, folder: Path) -> tuple[dict[str, bytes], float]:
    """The tables of a run that nothing disturbs, and how long it takes."""
    began = time.monotonic()
    process = launch("-j", "2", output="undisturbed")
    assert finished(process) == ""
    assert process.returncode == ExitCode.DONE
    return contents(folder / "undisturbed"), time.monotonic() - began


def stop(process: "subprocess.Popen[bytes]", way: str) -> None:
    if way in GROUP_SIGNALS:
        os.killpg(process.pid, GROUP_SIGNALS[way])
    else:
        process.send_signal(getattr(signal, way))


def number_of(way: str) -> int:
    return int(GROUP_SIGNALS.get(way) or getattr(signal, way))


GROUP_SIGNALS = {"ctrl-c": signal.SIGINT, "hang-up": signal.SIGHUP}
WAYS = {
    "hang-up": (ExitCode.TERMINATED, "terminated"),
    "ctrl-c": (ExitCode.INTERRUPTED, "interrupted"),
    "SIGINT": (ExitCode.INTERRUPTED, "interrupted"),
    "SIGTERM": (ExitCode.TERMINATED, "terminated"),
    "SIGKILL": (-signal.SIGKILL, ""),
}


def disturb(
    launch: Launch, folder: Path, mark: str, seconds: float, seed: int, n_times: int
) -> dict[str, bytes]:
    """Stop a sweep at random, then let it end."""
    random_numbers = random.Random(seed)
    for _ in range(n_times):
        way = random_numbers.choice(list(WAYS))
        process = launch("-j", "2")
        begun = folder / "out" / ".parts"
        wait_until(lambda begun=begun, run=process: begun.exists() or run.poll() is not None)
        time.sleep(random_numbers.uniform(0, 0.6 * seconds))
        was_running = process.poll() is None
        if was_running:
            stop(process, way)
        errors = finished(process)
        assert wait_until(lambda: not family(mark), 10), f"orphans after {way}"
        if process.returncode not in (0, 1) or was_running:
            code, word = WAYS[way]
            if process.returncode == 1:  # with words of ours it is no end for a signal
                assert errors == "", (way, errors)
                continue
            assert process.returncode in (code, 0, -number_of(way)), (way, errors)
            if way != "SIGKILL":  # then Python's resource tracker complains
                assert "Traceback" not in errors, (way, errors)
                assert len(errors.splitlines()) <= 1, (way, errors)
            assert word in errors or process.returncode != code
    process = launch("-j", "2")
    assert finished(process) == ""
    assert process.returncode == ExitCode.DONE
    return contents(folder / "out")


def test_stopped_at_random(
    launch: Launch, folder: Path, mark: str, undisturbed: tuple[dict[str, bytes], float]
) -> None:
    expected, seconds = undisturbed
    assert disturb(launch, folder, mark, seconds, seed=1, n_times=3) == expected


@pytest.mark.parametrize("seed", range(2, 8))
def test_stopped_at_random_many_times(
    launch: Launch, folder: Path, mark: str, undisturbed: tuple[dict[str, bytes], float], seed: int
) -> None:
    expected, seconds = undisturbed
    assert disturb(launch, folder, mark, seconds, seed, n_times=8) == expected


@pytest.mark.parametrize("way", ["ctrl-c", "SIGTERM", "hang-up"])
def test_an_interrupt_under_way_says_how_to_go_on(
    launch: Launch, folder: Path, mark: str, way: str
) -> None:
    process = launch("-j", "2")
    assert wait_until(lambda: list((folder / "out").rglob("*.part")))
    stop(process, way)
    errors = finished(process)
    code, word = WAYS[way]
    assert process.returncode == code
    assert errors.startswith(f"dpg: {word}")
    assert len(errors.splitlines()) == 1
    assert not list((folder / "out").rglob("*.tmp"))
    assert wait_until(lambda: not family(mark), 5)


@pytest.mark.parametrize("way", ["ctrl-c", "SIGTERM", "hang-up"])
def test_an_interrupt_while_the_workers_start(
    launch: Launch, folder: Path, mark: str, way: str
) -> None:
    """Workers that find their pool gone end without a word; there is more work than time."""
    (folder / "sweep.yaml").write_text(SWEEP.replace("count: 12", "count: 240"))
    code, _ = WAYS[way]
    for delay in (0.0, 0.03, 0.06, 0.1, 0.15):
        process = launch("-j", "2")
        assert wait_until(lambda: list((folder / "out").rglob("sweep.json")))
        time.sleep(delay)
        stop(process, way)
        errors = finished(process)
        assert process.returncode == code
        assert len(errors.splitlines()) == 1, errors
        assert wait_until(lambda: not family(mark), 5)
        shutil.rmtree(folder / "out")


def test_a_signal_before_the_command_begins_is_no_crash() -> None:
    """While typer still reads the arguments."""
    program = (
        "import os, signal; from dpgcli.cli.exits import run_and_exit; "
        "run_and_exit(lambda **_: os.kill(os.getpid(), signal.SIGTERM))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False)
    assert done.returncode == ExitCode.TERMINATED
    assert b"Traceback" not in done.stderr


def test_ctrl_c_twice_ends_as_plainly(launch: Launch, folder: Path, mark: str) -> None:
    process = launch("-j", "2")
    assert wait_until(lambda: list((folder / "out").rglob("*.part")))
    for _ in range(3):
        stop(process, "ctrl-c")
        time.sleep(0.05)
    errors = finished(process)
    assert process.returncode in (ExitCode.INTERRUPTED, -signal.SIGINT)
    assert "Traceback" not in errors
    assert wait_until(lambda: not family(mark), 5)


def test_no_worker_outlives_a_killed_parent(launch: Launch, folder: Path, mark: str) -> None:
    process = launch("-j", "2")
    assert wait_until(lambda: list((folder / "out").rglob("*.part")))
    assert len(workers(mark, process.pid)) >= 1
    process.kill()
    finished(process)
    assert wait_until(lambda: not family(mark), 5)


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_killed_workers_cost_nothing(
    launch: Launch,
    folder: Path,
    mark: str,
    undisturbed: tuple[dict[str, bytes], float],
    seed: int,
) -> None:
    random_numbers = random.Random(seed)
    process = launch("-j", "2")
    assert wait_until(lambda: list((folder / "out").rglob("*.part")))
    for _ in range(3):
        time.sleep(random_numbers.uniform(0, 0.3))
        if found := workers(mark, process.pid):
            os.kill(random_numbers.choice(found), signal.SIGKILL)
    errors = finished(process)
    assert process.returncode == ExitCode.DONE, errors
    assert "Traceback" not in errors
    assert contents(folder / "out") == undisturbed[0]


@pytest.mark.slow
def test_a_kill_while_the_tables_are_written_leaves_no_rubbish(
    launch: Launch, folder: Path, mark: str, undisturbed: tuple[dict[str, bytes], float]
) -> None:
    """What a killed run left is cleared away by the run that ends the sweep."""
    waits = "import time, dpgcli.files.table_writer as t; t.seal = lambda _: time.sleep(60); "
    process = launch("-j", "2", before=waits)
    assert wait_until(lambda: list((folder / "out").glob(".states.parquet.*.tmp")))
    process.kill()
    finished(process)
    process = launch("-j", "2")
    assert finished(process) == ""
    assert contents(folder / "out") == undisturbed[0]


@pytest.mark.slow
def test_one_sweep_at_a_time_in_a_folder(
    launch: Launch, folder: Path, undisturbed: tuple[dict[str, bytes], float]
) -> None:
    """Two at once either both end well or one is refused; the tables are right."""
    both = [launch("-j", "1"), launch("-j", "1")]
    errors = [finished(process) for process in both]
    assert {process.returncode for process in both} <= {ExitCode.DONE, ExitCode.USAGE}, errors
    assert ExitCode.DONE in {process.returncode for process in both}
    assert not any("Traceback" in text for text in errors)
    assert {n: (folder / "out" / n).read_bytes() for n in TABLES} == undisturbed[0]
