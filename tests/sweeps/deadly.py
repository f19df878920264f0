"""Functions for worker processes, some of which kill the process that runs them."""

import os
import signal
from collections.abc import Iterable
from pathlib import Path

from dpgcli.sweeps.executors import Chunk


def arguments(folder: Path, always: Iterable[int] = (), once: Iterable[int] = ()) -> object:
    """What `squares` gets for a chunk."""
    return lambda chunk: (chunk, str(folder), frozenset(always), frozenset(once))


def squares(chunk: Chunk, folder: str, always: frozenset[int], once: frozenset[int]) -> list[int]:
    """Squares of the cases; dies at cases in `always`, and the first time at cases in `once`."""
    for case in range(chunk.start, chunk.stop):
        mark = Path(folder) / f"{case}"
        if case in always or (case in once and not mark.exists()):
            with mark.open("a") as marks:
                marks.write("x")
            os.kill(os.getpid(), signal.SIGKILL)
    return [case**2 for case in range(chunk.start, chunk.stop)]


def dies() -> None:
    """Ends the process that calls it."""
    os.kill(os.getpid(), signal.SIGKILL)


def process_id(_: Chunk) -> int:
    """Which process runs this."""
    return os.getpid()


def refused(_: Chunk) -> int:
    """An error of the function's own."""
    raise ZeroDivisionError("of its own")
