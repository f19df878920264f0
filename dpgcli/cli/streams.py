"""Standard streams in bad company: closed, full, or read by somebody who has had enough."""

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

from dpgcli.text import printable


def open_streams() -> None:
    """Point closed streams to nowhere, so that no file gets their number and is written to.

    What standard output cannot spell is escaped.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDONLY if number == 0 else os.O_WRONLY)
    # closed by nobody: they are the process's own until its end
    sys.stdin = sys.stdin or os.fdopen(0, encoding="utf-8")
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8")
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def discard(stream: TextIO) -> None:
    """Let what a stream still holds go nowhere, so that the interpreter can end in peace."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)


def say(message: str) -> None:
    """Print on standard error; where that cannot be, the exit code has to do."""
    with suppress(OSError):
        print(_shown(message), file=sys.stderr, flush=True)


def put(text: str) -> None:
    """Print lines that may hold names and texts of others on standard output."""
    print(_shown(text))


def _shown(text: str) -> str:
    """Lines in which nothing but their ends does anything to a terminal."""
    return "\n".join(map(printable, text.split("\n")))


@contextmanager
def patient_output() -> Iterator[None]:
    """Hold back an error of standard output until the block is done, so that files get written."""
    stream = sys.stdout
    patient = _Patient(stream)
    sys.stdout = patient
    try:
        yield
    finally:
        sys.stdout = stream
    if patient.error is not None:
        raise patient.error


class _Patient(io.TextIOBase):
    """Writes through; after the first error it swallows all that follows."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream
        self.error: OSError | None = None

    def write(self, text: str) -> int:
        """Write, or keep why not."""
        if self.error is None:
            try:
                return self.stream.write(text)
            except OSError as error:
                self.error = error
                discard(self.stream)
        return len(text)

    def isatty(self) -> bool:
        """Whether the stream behind is a terminal."""
        return self.stream.isatty()
