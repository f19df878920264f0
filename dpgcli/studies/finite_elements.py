"""Runs of CalculiX in a folder: the deck, the log, and what comes out, whole or not at all."""

import math
import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from dpgcli.calibration.fe.curves import csv_text
from dpgcli.calibration.fe.finger import with_seconds
from dpgcli.calibration.fe.models import Model
from dpgcli.calibration.fe.results import displacements, reported_error, seconds, version
from dpgcli.errors import Field, SolverError, UsageError
from dpgcli.files.access import writing
from dpgcli.files.output import Mark, is_own, whole_file
from dpgcli.records import dataclass
from dpgcli.temporary import temporary_folder

SOLVER = "ccx"
MARKS = {
    ".inp": Mark.DECK,
    ".dat": Mark.DISPLACEMENTS,
    ".csv": Mark.CURVE,
    ".log": Mark.LOG,
}
THREADS = (
    "OMP_NUM_THREADS",
    "CCX_NPROC_STIFFNESS",
    "CCX_NPROC_EQUATION_SOLVER",
    "CCX_NPROC_RESULTS",
    "NUMBER_OF_CPUS",
)
"""Variables that set the threads of CalculiX (its manual, "How to run CalculiX")."""


@dataclass(frozen=True)
class Limits:
    """A limit in seconds, and a number of threads."""

    time_limit: float
    n_threads: int = 1


@dataclass(frozen=True)
class Output:
    """The output of a run: displacements, and its log."""

    displacements: str
    log: str


def write_deck(model: Model, folder: Path) -> tuple[Path, ...]:
    """Write a model's deck, and remove results of another one under its name; tells which.

    Raises UsageError where files of these names are not of `dpg fe`.
    """
    deck = deck_path(model, folder)
    outdated: tuple[Path, ...] = ()
    with writing(deck):
        _check_own(deck)
        if not deck.exists() or deck.read_bytes() != model.deck.encode():
            outdated = tuple(path for path in files(deck) if path.exists() and path != deck)
        for path in outdated:
            path.unlink()
    _write(deck, model.deck)
    return outdated


def files(deck: Path) -> tuple[Path, ...]:
    """The files between a deck and its curve."""
    return tuple(deck.with_suffix(suffix) for suffix in MARKS)


def _check_own(deck: Path) -> None:
    """Nobody else's files are overwritten or removed."""
    there = [path for path in files(deck) if path.exists()]
    if foreign := [str(path) for path in there if not is_own(path, MARKS[path.suffix])]:
        raise UsageError(f"{', '.join(foreign)}: not of dpg fe, give another folder")


def run(model: Model, folder: Path, limits: Limits) -> str:
    """Run CalculiX on the deck in a folder and write the curve; gives what the curve says.

    Until then a curve of the same deck stays. Raises UsageError where there is no CalculiX,
    SolverError where it fails or makes no sense.
    """
    deck = deck_path(model, folder)
    if shutil.which(SOLVER) is None:
        raise UsageError(
            f"{SOLVER} (CalculiX) is not installed: apt install calculix-ccx; the deck is {deck}"
        )
    output = solve(deck, limits)
    times, moved = displacements(output.displacements, model.n_nodes)
    if times[-1] < (1 - 1e-6) * model.end:
        raise SolverError(f"what ccx wrote ends at time {times[-1]:g} of {model.end:g}")
    outcome = model.outcome(times, moved)
    comments = model.comments(version(output.log), outcome.finding)
    took, curve = seconds(output.log), outcome.curve
    if isinstance(curve, dict) and math.isfinite(took):  # known states may say what each took
        curve = with_seconds(curve, took)
    _write(curve_path(model, folder), csv_text(comments, curve))
    return outcome.finding


def deck_path(model: Model, folder: Path) -> Path:
    """Where a model's deck stands."""
    return folder / f"{model.name}.inp"


def curve_path(model: Model, folder: Path) -> Path:
    """Where the curve of a run stands."""
    return folder / f"{model.name}.csv"


def _write(path: Path, text: str) -> None:
    with whole_file(path, MARKS[path.suffix]) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def solve(deck: Path, limits: Limits) -> Output:
    """Run CalculiX on a deck; its log and its .dat file come to stand beside the deck.

    Raises SolverError where it fails or takes too long. It works in a folder of its own, which
    nothing outlives; whatever interrupts it ends it with all its processes.
    """
    log, results = deck.with_suffix(".log"), deck.with_suffix(".dat")
    with _scratch(deck) as scratch:
        # a file of its own first: what stood there, or has the same inode, is not written into
        _write(log, f"# dpg fe, {deck.name}: words of {SOLVER}\n")
        with log.open("ab") as stream:
            code = _ended(deck.stem, scratch, stream, limits, log)
        said = log.read_text(encoding="utf-8", errors="replace")
        printed = scratch / results.name
        if code != 0 or not printed.exists():
            raise SolverError(_failure(code, said, log))
        text = printed.read_text(encoding="utf-8", errors="replace")
        _write(results, f"# dpg fe, {deck.name}: printed by {SOLVER}\n{text}")
    return Output(text, said)


def _ended(job: str, folder: Path, log: IO[bytes], limits: Limits, log_name: Path) -> int:
    """The exit code of CalculiX, which does not outlive this function."""
    environment = {**os.environ, **dict.fromkeys(THREADS, str(limits.n_threads))}
    with _doomed_group() as group:
        try:
            process = subprocess.Popen(
                [SOLVER, job],
                cwd=folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                process_group=group,
            )
        except OSError as error:
            raise SolverError(f"cannot start {SOLVER}: {error.strerror}") from error
        try:
            return process.wait(limits.time_limit)
        except subprocess.TimeoutExpired:
            raise SolverError(
                f"{SOLVER} was ended after {limits.time_limit:g} s (",
                Field("time_limit"),
                f"); its log is {log_name}",
            ) from None
        finally:
            if group is None:
                process.kill()
            else:
                os.killpg(group, signal.SIGKILL)
            process.wait()


@contextmanager
def _doomed_group() -> Iterator[int | None]:
    """A group of processes, all of which end with this block, and if this process is killed.

    A shell in it waits for the end of a pipe that this process alone can write to. None on
    Windows, which has no groups that could be killed.
    """
    if not hasattr(os, "killpg"):
        yield None
        return
    with subprocess.Popen(
        ["/bin/sh", "-c", "read line; kill -KILL 0"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        process_group=0,
    ) as shell:
        try:
            yield shell.pid
        finally:
            os.killpg(shell.pid, signal.SIGKILL)


def _failure(code: int, said: str, log: Path) -> str:
    """Why a run failed, as far as its log says."""
    how = f"signal {-code}" if code < 0 else f"exit code {code}"
    reason = reported_error(said) or "it names no error"
    return f"{SOLVER} failed ({how}): {reason}; its log is {log}"


@contextmanager
def _scratch(deck: Path) -> Iterator[Path]:
    """A folder beside the deck with a copy of it, gone at the end."""
    with writing(deck.parent), temporary_folder(deck) as scratch:
        shutil.copy(deck, scratch)
        yield scratch
