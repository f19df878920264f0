"""A sweep: every design of a space, evaluated on an executor, resumable, into two tables."""

import hashlib
import json
import shutil
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, NamedTuple

from dpgcli.errors import UsageError
from dpgcli.exploration.executors import Chunk, Runner, chunked
from dpgcli.exploration.space import Space
from dpgcli.files.parts import PartStore, encoded
from dpgcli.files.sweep import Sweep
from dpgcli.files.tables import SCHEMA_VERSION, read_metadata, versions, write_table
from dpgcli.states.plan import DEFAULT_TOLERANCE
from dpgcli.studies.evaluation import Evaluation, Numbers, Tables, value_columns

STATES_PER_CHUNK = 2**15  # a quarter of a second of work
BYTES_PER_STATE = 120  # in the tables and, while they are made, in the parts
STATES, DESIGNS = "states.parquet", "designs.parquet"


@dataclass(frozen=True)
class Shard:
    """Part `number` (from 1) of `count`: every count-th chunk."""

    number: int = 1
    count: int = 1


@dataclass
class Progress:
    """How far a sweep is; handed to whoever watches after every chunk."""

    n_designs: int
    n_done: int = 0
    n_resumed: int = 0
    n_failed: int = 0
    seconds: float = 0.0
    seconds_writing: float = 0.0
    cpu_seconds_core: float = 0.0
    failures: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class Study:
    """A sweep ready to run into a folder."""

    sweep: Sweep
    folder: Path
    tolerance: float = DEFAULT_TOLERANCE

    @property
    def evaluation(self) -> Evaluation:
        return Evaluation(
            self.sweep.base_data,
            value_columns(self.sweep.space),
            self.sweep.constraints,
            self.tolerance,
            self.sweep.base.gripper is not None,
        )

    @property
    def fingerprint(self) -> str:
        """SHA-256 of all that the results depend on."""
        text = json.dumps([self.sweep.canonical_json(), self.tolerance, SCHEMA_VERSION, versions()])
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def store(self) -> PartStore:
        return PartStore(self.folder / ".parts" / self.fingerprint[:16])

    @property
    def chunk_size(self) -> int:
        """Designs per chunk: many states, but never so many that one waits for it."""
        return max(1, STATES_PER_CHUNK >> self.most_units)

    @property
    def most_units(self) -> int:
        return max([self.sweep.base.finger.units, *_values(self.sweep.space, "finger.units")])

    def ranges(self, shard: Shard) -> list[tuple[int, int]]:
        """Designs of a shard: its chunks, as ranges."""
        size = self.sweep.space.size
        every = range((shard.number - 1) * self.chunk_size, size, shard.count * self.chunk_size)
        return [(first, min(first + self.chunk_size, size)) for first in every]

    @property
    def is_up_to_date(self) -> bool:
        """Whether both tables are there and were made from just this."""
        return all(
            read_metadata(self.folder / name).get("dpg.fingerprint") == self.fingerprint
            for name in (STATES, DESIGNS)
        )

    def check_room(self) -> None:
        """Refuse a sweep whose tables the disk cannot hold; raises UsageError."""
        n_states = self.sweep.space.size << self.most_units
        needed = 2 * n_states * BYTES_PER_STATE
        free = shutil.disk_usage(_existing(self.folder)).free
        if needed > free:
            raise UsageError(
                f"{self.sweep.space.size:,} designs have about {n_states:,} states, "
                f"{needed / 2**30:,.0f} GiB while they are made, and {free / 2**30:,.0f} GiB are "
                "free: take fewer values or units, or go on with --force"
            )

    def check_unfinished(self) -> None:
        """Refuse to leave an unfinished sweep of other content behind; raises UsageError."""
        for said in sorted(self.store.folder.parent.glob("*/sweep.json")):
            if said.parent != self.store.folder:
                changes = _changes(json.loads(said.read_text()), json.loads(self._said()))
                raise UsageError(
                    f"{self.folder} holds an unfinished sweep that differs in "
                    f"{', '.join(changes) or 'versions'}: finish it as it was, take another "
                    "--output, or drop it with --restart"
                )

    def drop_unfinished(self) -> None:
        """Remove what unfinished sweeps left in the folder."""
        shutil.rmtree(self.store.folder.parent, ignore_errors=True)

    def _said(self) -> str:
        said = json.loads(self.sweep.canonical_json())
        said["base"] = json.loads(said["base"])
        return json.dumps({**said, "tolerance": self.tolerance, "versions": versions()})

    def compute(
        self,
        make: Callable[[int], Executor],
        n_workers: int,
        watch: Callable[[Progress], None],
        shard: Shard | None = None,
        broken: tuple[type[BaseException], ...] = (),
    ) -> Progress:
        """Evaluate what is missing, part by part; `watch` sees the progress after each."""
        store, evaluation, space = self.store, self.evaluation, self.sweep.space
        store.remove_damaged()
        store.say(self._said())
        ranges = self.ranges(shard or Shard())
        missing = store.missing(ranges)
        progress = Progress(sum(stop - start for start, stop in ranges))
        progress.n_resumed = progress.n_done = progress.n_designs - sum(b - a for a, b in missing)
        runner = Runner(make, n_workers, _evaluated, lambda c: _arguments(evaluation, space, c))
        runner.broken += broken
        began = perf_counter()
        for result in runner.run(chunked(missing, self.chunk_size)):
            chunk = result.chunk
            done = result.value
            if done is None:
                progress.failures.append(chunk.start)
                tables = evaluation.failed(chunk.start, space.designs(chunk.start, chunk.stop))
                done = Evaluated(_encoded(evaluation, tables), 0.0)
            writing = perf_counter()
            store.write(chunk.start, chunk.stop, done.content)
            progress.seconds_writing += perf_counter() - writing
            progress.cpu_seconds_core += done.cpu_seconds
            progress.n_done += chunk.stop - chunk.start
            progress.seconds = perf_counter() - began
            watch(progress)
        return progress

    def assemble(self) -> None:
        """Join all parts into the two tables; whole files only, then the parts go."""
        evaluation, store = self.evaluation, self.store
        metadata = {
            "dpg.fingerprint": self.fingerprint,
            "dpg.sweep": self._said(),
            "dpg.schema_version": str(SCHEMA_VERSION),
            "dpg.law": "published: the spring pushes and pulls",
            "dpg.versions": versions(),
        }
        write_table(self.folder / STATES, evaluation.state_columns, store.states(), metadata)
        write_table(self.folder / DESIGNS, evaluation.design_columns, store.designs(), metadata)
        self.drop_unfinished()


class Evaluated(NamedTuple):
    """The bytes of a part and the CPU time it took, s."""

    content: bytes
    cpu_seconds: float


def _arguments(evaluation: Evaluation, space: Space, chunk: Chunk) -> tuple[Any, ...]:
    return evaluation, chunk.start, space.designs(chunk.start, chunk.stop)


def _evaluated(evaluation: Evaluation, start: int, values: dict[str, Numbers]) -> Evaluated:
    """What a worker does with a chunk."""
    began = process_time()
    tables = evaluation(start, values)
    content = _encoded(evaluation, tables)
    return Evaluated(content, process_time() - began)


def _encoded(evaluation: Evaluation, tables: Tables) -> bytes:
    return encoded(
        evaluation.state_columns, tables.states, evaluation.design_columns, tables.designs
    )


def _values(space: Space, key: str) -> list[int]:
    return [int(v) for axis in space.axes if key in axis.values for v in axis.values[key]]


def _existing(folder: Path) -> Path:
    """The folder, or the nearest above it that exists."""
    folder = folder.absolute()
    return folder if folder.exists() else _existing(folder.parent)


def _changes(old: Any, new: Any, path: str = "") -> list[str]:
    """Dotted keys in which two plain values differ."""
    if isinstance(old, dict) and isinstance(new, dict):
        return [
            change
            for key in sorted({*old, *new})
            for change in _changes(old.get(key), new.get(key), f"{path}.{key}".lstrip("."))
        ]
    return [] if old == new else [path]
