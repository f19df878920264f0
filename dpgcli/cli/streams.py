"""Robust standard streams: closed descriptors, full disks, readers that stop early (`| head`)."""

import io
import os
import sys
from select import select
from typing import Any, TextIO

from dpgcli.cli.spelling import with_options
from dpgcli.text import inert, printable


class Stream(io.RawIOBase):
    """A standard stream whose writes never fail: after the first error they are discarded.

    So nothing that prints is stopped by whoever reads, or does not: `error` says at the end.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        self.error: OSError | None = None

    def write(self, content: Any, /) -> int:
        """Write all, or keep the error."""
        rest = memoryview(content)
        while rest and self.error is None:
            try:
                rest = rest[os.write(self.number, rest) :]
            except BlockingIOError:  # a pipe that others have set so, and that is full
                select([], [self.number], [])
            except OSError as error:
                self.error = error
        return len(content)

    def drop(self) -> None:
        """Discard what follows: the rest could wait for a reader that never comes."""
        self.error = self.error or BrokenPipeError()

    def writable(self) -> bool:
        """Always."""
        return True

    def fileno(self) -> int:
        """The number it had from the start."""
        return self.number

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return os.isatty(self.number)


OUTPUT, MESSAGES = Stream(1), Stream(2)


def open_streams() -> None:
    """Reopen closed streams on /dev/null, so that no later file gets descriptor 0, 1 or 2.

    What a stream cannot spell is escaped.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDONLY if number == 0 else os.O_WRONLY)
    # closed by nobody: they are the process's own until its end
    sys.stdin = sys.stdin or os.fdopen(0, encoding="utf-8")
    sys.stdout = _text(OUTPUT, sys.stdout, by_line=OUTPUT.isatty())
    sys.stderr = _text(MESSAGES, sys.stderr, by_line=True)


def is_read() -> bool:
    """Whether standard output still goes anywhere."""
    return OUTPUT.error is None


def _text(stream: Stream, before: TextIO | None, *, by_line: bool) -> TextIO:
    """Text as it was written before, to a stream that takes everything."""
    at_once = getattr(before, "write_through", False)
    binary: Any = stream if at_once else io.BufferedWriter(stream)
    return io.TextIOWrapper(
        binary,
        encoding=before.encoding if before else "utf-8",
        errors="backslashreplace",
        line_buffering=by_line,
        write_through=at_once,
    )


def say(message: str) -> None:
    """Print on standard error; where that cannot be, the exit code has to do."""
    print(_shown(with_options(message)), file=sys.stderr, flush=True)


def put(text: str, end: str = "\n") -> None:
    """Print lines that may hold names and texts of others on standard output."""
    print(_shown(text), end=end)


def put_json(text: str) -> None:
    """Print JSON, of which a runner would obey the same inside of texts: its data stay the same."""
    print(text.replace("##", r"#\u0023"), end="")


def annotate(message: str, **place: str | int | None) -> None:
    """Print an error for GitHub's runner, which is to obey it, at a `file`, `line` and `col`."""
    said = ",".join(
        f"{key}={_escaped(printable(str(value)), ':,')}"
        for key, value in place.items()
        if value is not None
    )
    print(f"::error {said}::{_escaped(printable(message))}")


def _escaped(text: str, also: str = "") -> str:
    """Text as a workflow command takes it."""
    for character in "%\r\n" + also:
        text = text.replace(character, f"%{ord(character):02X}")
    return text


def _shown(text: str) -> str:
    """Lines in which nothing but their ends does anything to a terminal, or to a runner."""
    return "\n".join(map(unobeyed, text.split("\n")))


def unobeyed(text: str) -> str:
    """Text of others in one line, which neither a terminal nor a runner obeys."""
    return inert(printable(text))
