"""Content of files as it is read: bounded, from names without control characters, UTF-8."""

import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from dpgcli.errors import SpecError
from dpgcli.files.places import Location, located
from dpgcli.text import control_character

MAX_BYTES = 256 * 1024  # of what people write
TOP_LEVEL = rb"""(?:^(?:\xef\xbb\xbf)?|\A\s*\{(?s:.*\W))["']?%s["']?\s*:(?:\s|$)"""


def content_of(path: Path, place: Location, most: int | None = None, hint: str = "") -> bytes:
    """The bytes of a file, at most `most`; of a regular file, which has an end, all by default.

    Raises SpecError for what cannot be read.
    """
    if control := control_character(str(path)):
        expected = "a name without control characters"
        raise SpecError((located(place, "file", expected, f"{control} in it"),))
    try:
        status = path.stat()
        is_regular = stat.S_ISREG(status.st_mode)
        if stat.S_ISDIR(status.st_mode) or (most is None and not is_regular):
            found = "a directory" if stat.S_ISDIR(status.st_mode) else "a device or pipe"
            raise SpecError((located(place, "file", "a file", found),))
        if most is None:
            return path.read_bytes()
        if is_regular and status.st_size > most:
            raise _too_large(place, most, f"{status.st_size} bytes", hint)
        if stat.S_ISFIFO(status.st_mode):
            return _piped(path, place, most, hint)
        with path.open("rb") as stream:
            return bounded(stream, place, most, hint)
    except (OSError, ValueError) as error:
        found = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise SpecError((located(place, "file", "a readable file", found.lower()),)) from None


def _piped(path: Path, place: Location, most: int, hint: str) -> bytes:
    """The content of a pipe, such as that of `<(...)`.

    Raises OSError for one that nobody has open to write to: it would be waited for, in silence.
    """
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    with os.fdopen(handle, "rb") as stream:
        begin = b""
        with suppress(BlockingIOError):  # somebody will
            begin = os.read(handle, 1)
            if not begin:
                raise OSError(None, "a pipe that nobody writes to")
        os.set_blocking(handle, True)
        content = begin + stream.read(most)
    if len(content) > most:
        raise _too_large(place, most, "more", hint)
    return content


def beside(folder: Path, name: str) -> Path:
    """The file that a name in another file means: from its folder, ~ being the user's own.

    >>> beside(Path("configs"), "five_unit.yaml").as_posix()
    'configs/five_unit.yaml'
    """
    return folder / os.path.expanduser(name)  # noqa: PTH111  as it is where there is no such user


def opened(path: Path) -> BinaryIO:
    """A file to read; raises OSError for a device or pipe, which may have no end."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise OSError(None, "is a device or pipe, not a file")
    return path.open("rb")


@contextmanager
def quoted_if(path: Path, key: str, expected: str) -> Iterator[None]:
    """Keep problems in what a file says to files that have a key at their top level.

    Whoever names a file in another one need not be allowed to read it: of what is no file of
    the kind nothing is shown.
    """
    try:
        yield
    except SpecError:
        place = Location(str(path))
        content = content_of(path, place, MAX_BYTES)
        if re.search(TOP_LEVEL % key.encode(), content, re.MULTILINE) or not content:
            raise
        raise SpecError((located(place, "file", expected, "something else"),)) from None


def bounded(stream: BinaryIO, place: Location, most: int, hint: str = "") -> bytes:
    """The content of a stream, at most `most` bytes; raises SpecError for more."""
    content = stream.read(most + 1)
    if len(content) > most:
        raise _too_large(place, most, "more", hint)
    return content


def _too_large(place: Location, most: int, found: str, hint: str) -> SpecError:
    return SpecError((located(place, "file", f"at most {most // 1024:,} KiB", found, hint),))


def decoded(content: bytes, place: Location) -> str:
    """The text of a file. Raises SpecError for what is not UTF-8."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = content[: error.start]
        column = len(before) - (before.rfind(b"\n") + 1) + 1
        here = Location(place.file, before.count(b"\n") + 1, column)
        found = f"byte 0x{content[error.start]:02x}"
        problem = located(here, "file", "text in UTF-8", found, "save the file as UTF-8")
        raise SpecError((problem,)) from None
