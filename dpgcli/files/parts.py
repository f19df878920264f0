"""Results of chunks on disk, so that an interrupted sweep can go on.

A part is an Arrow file of a range of designs, with a row for each block of work: the list of its
states and the list of its designs. Parquet would be a little smaller, and takes three times as
long. Its name is its range and a SHA-256 of its bytes, of that range and of its sweep, by the name
of the folder: a part that does not match its name, damaged or of another sweep, does not count.
"""

import hashlib
import json
import os
import re
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from enum import StrEnum
from itertools import accumulate
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
import pyarrow as pa

from dpgcli.arrays import Columns
from dpgcli.errors import WorkplaceError
from dpgcli.files.access import inside, reading, writing
from dpgcli.files.content import opened
from dpgcli.files.output import Mark, is_own, whole_file
from dpgcli.files.record_batches import record_batch, schema
from dpgcli.files.trust import TRUST, WARNINGS
from dpgcli.records import dataclass
from dpgcli.states.columns import Column
from dpgcli.temporary import drop_orphans, temporary_file

NAME = re.compile(r"(\d{10})-(\d{10})-([0-9a-f]{16})\.part")
UNFINISHED = re.compile(r"\.(.+)\.dpg\d+\.tmp")
COUNT = re.compile(r"[1-9][0-9]{0,9}")  # as many digits as a name has room for
LISTS = ("states", "designs")
SAID = "sweep.json"
MOST_SAID = 2**26  # bytes
FINGERPRINT, N_DESIGNS = "dpg.fingerprint", "dpg.designs"
GOAL = "dpg.goal"  # what a search is of; a sweep has none
BASE = "dpg.base"  # a name only: no result depends on it
NO_CAUSE = (FINGERPRINT, BASE, TRUST, WARNINGS)
SHA256 = "sha256"  # of all texts in sweep.json, the name of the base as well


class Work(StrEnum):
    """What parts in a folder are of."""

    SWEEP = "sweep"
    SEARCH = "search"


def work_of(said: Mapping[str, str]) -> Work:
    """Whose metadata these are.

    >>> work_of({"dpg.goal": "{}"}).value, work_of({"dpg.designs": "3"}).value
    ('search', 'sweep')
    """
    return Work.SEARCH if GOAL in said else Work.SWEEP


def fingerprint(said: Mapping[str, str]) -> str:
    """The SHA-256 of a sweep's metadata, but for the name of its base and what follows from it."""
    return _sha256({key: text for key, text in said.items() if key not in NO_CAUSE})


def _sha256(texts: Mapping[str, str]) -> str:
    return hashlib.sha256(json.dumps(texts, sort_keys=True).encode()).hexdigest()


def write_part(
    sink: IO[bytes],
    state_columns: tuple[Column, ...],
    design_columns: tuple[Column, ...],
    blocks: Iterable[tuple[Columns, Columns]],
) -> int:
    """Write a part as its blocks of states and of designs come; the number of its states."""
    both = (state_columns, design_columns)
    described = pa.schema(
        {name: pa.list_(pa.struct(list(schema(c)))) for name, c in zip(LISTS, both, strict=True)}
    )
    n_states = 0
    # every core has a worker: threads of this one would wait for each other
    packed = pa.ipc.IpcWriteOptions(compression="lz4", use_threads=False)
    with pa.ipc.new_file(sink, described, options=packed) as writer:
        for block in blocks:
            states, designs = (record_batch(*table) for table in zip(both, block, strict=True))
            row = [_as_list(states), _as_list(designs)]
            writer.write_batch(pa.RecordBatch.from_arrays(row, schema=described))
            n_states += states.num_rows
    return n_states


def _as_list(batch: Any) -> Any:
    """Blocks of rows, concatenated."""
    rows = batch.to_struct_array()
    ends = pa.py_buffer(np.array([0, len(rows)], np.int32))
    return pa.Array.from_buffers(pa.list_(rows.type), 1, [None, ends], children=[rows])


class Part(NamedTuple):
    """A part on disk and the designs start … stop − 1 that it holds."""

    start: int
    stop: int
    path: Path

    def batches(self, which: int) -> Iterator[Any]:
        """Record batches of its states (0) or designs (1), a block each."""
        with self._opened(which) as file:
            for place in range(file.num_record_batches):
                yield pa.RecordBatch.from_struct_array(file.get_batch(place).column(0).values)

    def schema(self, which: int) -> Any:
        """Columns of its states (0) or designs (1)."""
        with self._opened(which) as file:
            return pa.schema(file.schema.field(LISTS[which]).type.value_type)

    @contextmanager
    def _opened(self, which: int) -> Iterator[Any]:
        only = pa.ipc.IpcReadOptions(included_fields=[which])
        with reading(self.path):
            stream = self.path.open("rb")
        with stream, pa.ipc.open_file(stream, options=only) as file:
            yield file

    @property
    def is_damaged(self) -> bool:
        """Whether its bytes and its sweep do not match its name."""
        with reading(self.path):
            is_there = self.path.is_file()
            return not is_there or _name(self.path, self.start, self.stop) != self.path.name


@dataclass(frozen=True)
class PartStore:
    """The parts of one sweep in a folder."""

    folder: Path

    @contextmanager
    def part(self, start: int, stop: int) -> Iterator[IO[bytes]]:
        """A file to write the bytes of a part to; stored whole or not at all."""
        place = self.folder / _range(start, stop)
        with writing(place), temporary_file(place) as (scratch, _):
            with scratch.open("wb") as file:
                yield file
            with whole_file(self.folder / _name(scratch, start, stop), Mark.ANY) as temporary:
                scratch.replace(temporary)

    @property
    def is_own(self) -> bool:
        """Whether it is in the folder itself, and nobody else's description is in it."""
        said = self.folder / SAID
        with reading(self.folder):
            is_linked = self.folder.is_symlink() or self.folder.parent.is_symlink()
            return not is_linked and (not os.path.lexists(said) or _is_description(said))

    def say(self, said: dict[str, str]) -> None:
        """Write the sweep's metadata (sweep.json) beside its parts, never through a link."""
        for folder in (self.folder.parent, self.folder):
            with writing(folder):
                if folder.is_symlink():
                    raise OSError(None, "a link, and what it leads to may go")
        with writing(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
        if self.said() != said:
            with whole_file(self.folder / SAID, Mark.ANY) as temporary:
                text = json.dumps({**said, SHA256: _sha256(said)}, indent=2)
                temporary.write_text(text, encoding="utf-8", newline="\n")

    def said(self) -> dict[str, str]:
        """The sweep's metadata (sweep.json); empty where the file is missing or damaged.

        Raises UsageError for what cannot be read.
        """
        path = self.folder / SAID
        with reading(path):
            try:
                with opened(path) as stream:
                    said = json.loads(stream.read(MOST_SAID))
            except (FileNotFoundError, ValueError, RecursionError):
                return {}
        if not _is_work(said):
            return {}
        is_whole = said.pop(SHA256, None) == _sha256(said)
        return said if is_whole and said[FINGERPRINT] == fingerprint(said) else {}

    def drop(self) -> None:
        """Remove what belongs to the sweep, and the folder if that was all."""
        with suppress(OSError):
            for path in self.folder.iterdir():
                is_temporary = path.name.startswith(".") and path.suffix == ".tmp"
                is_own = is_temporary or path.name == SAID or NAME.fullmatch(path.name)
                if is_own and not path.is_dir():
                    path.unlink()
            self.folder.rmdir()
            self.folder.parent.rmdir()

    @contextmanager
    def dropped_if_empty(self) -> Iterator[None]:
        """Leave nothing of work that no worker began."""
        try:
            yield
        except WorkplaceError:
            if not self.parts():
                self.drop()
            raise

    def drop_half_written(self) -> None:
        """Remove what workers that were killed were about to write."""
        names = (UNFINISHED.fullmatch(path.name) for path in inside(self.folder))
        for name in {found[1] for found in names if found}:
            drop_orphans(self.folder / name)

    def parts(self) -> list[Part]:
        """Parts in order of their designs, but for those that lie within another one.

        A worker that is killed between storing its part and saying so leaves one of a chunk that
        may be halved afterwards.
        """
        matches = [(NAME.fullmatch(path.name), path) for path in inside(self.folder)]
        with reading(self.folder):
            found = [Part(int(m[1]), int(m[2]), p) for m, p in matches if m and not p.is_dir()]
        found.sort(key=lambda part: (part.start, -part.stop, part.path))
        reached = accumulate((part.stop for part in found), max, initial=0)
        return [part for part, before in zip(found, reached, strict=False) if part.stop > before]

    def damaged(self) -> list[Part]:
        """Parts that do not match their name: damaged, or of another sweep."""
        return [part for part in self.parts() if part.is_damaged]

    def missing(self, ranges: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
        """The parts of these ranges, in order, that are not stored yet."""
        waiting, gaps = deque(self.parts()), []
        for start, stop in ranges:
            here = start
            while waiting and waiting[0].start < stop:
                if waiting[0].start > here:
                    gaps.append((here, waiting[0].start))
                here = max(here, waiting[0].stop)
                if here > stop:
                    break  # it goes on into the next range
                waiting.popleft()
            if here < stop:
                gaps.append((here, stop))
        return gaps


def _is_work(said: Any) -> bool:
    """Whether this is metadata: texts, with the goal of a search or a sweep's number of designs."""
    is_text = isinstance(said, dict) and all(isinstance(text, str) for text in said.values())
    if not is_text or FINGERPRINT not in said:
        return False
    is_search = work_of(said) is Work.SEARCH
    return is_search or COUNT.fullmatch(said.get(N_DESIGNS, "")) is not None


def _is_description(path: Path) -> bool:
    """Whether a file is the description of a sweep, damaged or not."""
    return path.is_file() and not path.is_symlink() and is_own(path, Mark.PARTS)


def _name(path: Path, start: int, stop: int) -> str:
    """The name of a part with these bytes, of these designs, in the folder that it is in."""
    digest = hashlib.sha256(f"{path.parent.name} {start} {stop} ".encode())
    with path.open("rb") as file:
        hashlib.file_digest(file, lambda: digest)
    return f"{_range(start, stop)}-{digest.hexdigest()[:16]}.part"


def _range(start: int, stop: int) -> str:
    return f"{start:010d}-{stop:010d}"
