"""Results of chunks on disk, so that an interrupted sweep can go on.

A part holds the states and the designs of a range of designs as two Arrow streams. Its name is
its range and the SHA-256 of its bytes: a part that does not match its name does not count.
"""

import hashlib
import json
import re
import struct
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa

from dpgcli.errors import OutputError
from dpgcli.files.output import Mark, whole_file
from dpgcli.files.tables import record_batch
from dpgcli.states.columns import Column
from dpgcli.states.rows import Columns

NAME = re.compile(r"(\d{10})-(\d{10})-([0-9a-f]{16})\.part")
LENGTH = struct.Struct("<Q")
SAID = "sweep.json"
FINGERPRINT = "dpg.fingerprint"


def fingerprint(said: Mapping[str, str]) -> str:
    """The SHA-256 of what a sweep is about."""
    rest = {key: text for key, text in said.items() if key != FINGERPRINT}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()


def encoded(
    state_columns: tuple[Column, ...],
    states: Columns,
    design_columns: tuple[Column, ...],
    designs: Columns,
) -> bytes:
    """The bytes of a part."""
    first = _stream(record_batch(state_columns, states))
    return LENGTH.pack(len(first)) + first + _stream(record_batch(design_columns, designs))


def _stream(batch: Any) -> bytes:
    sink = pa.BufferOutputStream()
    options = pa.ipc.IpcWriteOptions(compression="zstd")
    with pa.ipc.new_stream(sink, batch.schema, options=options) as writer:
        writer.write_batch(batch)
    content: bytes = sink.getvalue().to_pybytes()
    return content


class Part(NamedTuple):
    """A part on disk and the designs start … stop − 1 that it holds."""

    start: int
    stop: int
    path: Path

    def batches(self, which: int) -> Iterator[Any]:
        """Record batches of its states (0) or designs (1)."""
        yield from self._stream(which)

    def schema(self, which: int) -> Any:
        """Columns of its states (0) or designs (1)."""
        return self._stream(which).schema

    def _stream(self, which: int) -> Any:
        content = self.path.read_bytes()
        (length,) = LENGTH.unpack_from(content)
        middle = LENGTH.size + length
        return pa.ipc.open_stream(content[LENGTH.size : middle] if which == 0 else content[middle:])


@dataclass(frozen=True)
class PartStore:
    """The parts of one sweep in a folder."""

    folder: Path

    def write(self, start: int, stop: int, content: bytes) -> None:
        """Store a part, whole or not at all."""
        digest = hashlib.sha256(content).hexdigest()[:16]
        path = self.folder / f"{start:010d}-{stop:010d}-{digest}.part"
        with whole_file(path, Mark.ANY) as temporary:
            temporary.write_bytes(content)

    def say(self, said: dict[str, str]) -> None:
        """Keep what the sweep is about beside its parts."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"cannot write {self.folder}: {error.strerror}") from error
        if self.said() != said:
            with whole_file(self.folder / SAID, Mark.ANY) as temporary:
                temporary.write_text(json.dumps(said, indent=2), encoding="utf-8")

    def said(self) -> dict[str, str]:
        """What the sweep is about; empty where that cannot be read, or is damaged."""
        try:
            said = json.loads((self.folder / SAID).read_bytes())
        except (OSError, ValueError, RecursionError):
            return {}
        if not isinstance(said, dict) or said.get(FINGERPRINT) != fingerprint(said):
            return {}
        return said

    def drop(self) -> None:
        """Remove what belongs to the sweep, and the folder if that was all."""
        with suppress(OSError):
            for path in self.folder.iterdir():
                is_temporary = path.name.startswith(".") and path.suffix == ".tmp"
                if is_temporary or path.name == SAID or NAME.fullmatch(path.name):
                    path.unlink()
            self.folder.rmdir()
            self.folder.parent.rmdir()

    def parts(self) -> list[Part]:
        """Parts in order of their designs."""
        matches = ((NAME.fullmatch(path.name), path) for path in self.folder.glob("*.part"))
        return sorted(Part(int(m[1]), int(m[2]), path) for m, path in matches if m)

    def damaged(self) -> list[Part]:
        """Parts whose bytes do not match their name."""
        return [
            part
            for part in self.parts()
            if hashlib.sha256(part.path.read_bytes()).hexdigest()[:16] not in part.path.name
        ]

    def missing(self, ranges: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
        """What of these ranges no part covers."""
        parts, gaps = self.parts(), []
        for start, stop in ranges:
            here = start
            for part in parts:
                if here < part.stop and part.start < stop:
                    if part.start > here:
                        gaps.append((here, part.start))
                    here = part.stop
            if here < stop:
                gaps.append((here, stop))
        return gaps
