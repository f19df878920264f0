"""The SHA-256 of a table in its own footer, so that no damaged byte of it is believed.

The digits stand behind `dpg.file_sha256` among the file's metadata, and are those of all bytes
but themselves. Values, names, units and offsets are covered, before anything is decoded.
"""

import hashlib
import os
from pathlib import Path
from typing import BinaryIO

KEY = "dpg.file_sha256"
UNSEALED = "0" * 64
HEAD = KEY.encode() + b"\x18\x40"  # what Thrift puts between a key and a text of 64 bytes
TAIL = 2**16  # bytes at the end that are looked at in what says no size of its footer
END = b"PAR1"  # behind four bytes that say how long the footer is
BLOCK = 2**20


def seal(path: Path) -> None:
    """Put the SHA-256 of a table that was written with `UNSEALED` into it."""
    with path.open("r+b") as stream:
        place = _place(stream)
        assert place is not None, "a table is written with a place for its SHA-256"
        digest = _sha256(stream, place)
        stream.seek(place)
        stream.write(digest)


def is_whole(path: Path) -> bool | None:
    """Whether a table is as it was sealed; None where there is none, or one without a seal."""
    try:
        if not path.is_file():  # a pipe would be waited for
            return None
        with path.open("rb") as stream:
            return is_whole_in(stream)
    except OSError:
        return None


def is_whole_in(stream: BinaryIO) -> bool | None:
    """Whether a table is as it was sealed; None for a file without a seal."""
    place = _place(stream)
    if place is None:
        return None
    stream.seek(place)
    said = stream.read(len(UNSEALED))
    return said == _sha256(stream, place)


def footer_size(stream: BinaryIO) -> int:
    """Bytes at the end of a table that hold its metadata; 0 for what is no table.

    They are as many as the metadata need: a sweep's spec, lists of values, names of columns.
    """
    size = stream.seek(0, os.SEEK_END)
    stream.seek(max(size - 8, 0))
    length, mark = stream.read(4), stream.read(4)
    found = int.from_bytes(length, "little") + 8
    return found if mark == END and found <= size else 0


def _place(stream: BinaryIO) -> int | None:
    """The byte range of the digits."""
    size = max(footer_size(stream), TAIL)
    start = stream.seek(max(stream.seek(0, os.SEEK_END) - size, 0))
    found = stream.read(size).rfind(HEAD)
    return None if found < 0 else start + found + len(HEAD)


def _sha256(stream: BinaryIO, place: int) -> bytes:
    """SHA-256 of all bytes but the digits at a place, as hexadecimal text."""
    digest = hashlib.sha256()
    stream.seek(0)
    while block := stream.read(min(BLOCK, place - stream.tell())):
        digest.update(block)
    end = stream.seek(0, os.SEEK_END)  # a device may never come to one
    stream.seek(place + len(UNSEALED))
    while block := stream.read(min(BLOCK, max(end - stream.tell(), 0))):
        digest.update(block)
    return digest.hexdigest().encode()
