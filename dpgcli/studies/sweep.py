"""A sweep: every design of a space, evaluated at a workplace, resumable, into two tables."""

import os
import re
import shlex
import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import field
from functools import cached_property, partial
from itertools import islice
from pathlib import Path
from time import perf_counter

from dpgcli.design.outputs import Trust, of_space
from dpgcli.errors import Field, UsageError
from dpgcli.files.access import inside, reading, writing
from dpgcli.files.output import Mark
from dpgcli.files.parts import BASE, FINGERPRINT, N_DESIGNS, SAID, PartStore, fingerprint, work_of
from dpgcli.files.scene_file import scene_of, spelled
from dpgcli.files.seal import is_whole
from dpgcli.files.sweep_file import Sweep
from dpgcli.files.sweep_file.space import numbers_of
from dpgcli.files.table_writer import SCHEMA_VERSION, read_metadata, versions, write_table
from dpgcli.files.trust import trust_metadata, with_bases
from dpgcli.records import dataclass
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.studies.work import ChunkTask, reason_against
from dpgcli.sweeps.designs import designs_at_once
from dpgcli.sweeps.differences import differences
from dpgcli.sweeps.evaluation import DesignEvaluation, DesignStatus, value_columns
from dpgcli.sweeps.executors import Backend, Chunk, Runner, chunked
from dpgcli.sweeps.extent import ASKED_AT_ONCE, MOST_ASKED, Extent, size_text
from dpgcli.sweeps.maker import HERE, check_workers
from dpgcli.temporary import drop_orphans
from dpgcli.text import printable

STATES_PER_CHUNK = 2**15  # a quarter of a second of work
CHUNK_SECONDS = 4.0  # of work with bodies: several times what a batch takes to begin
STATES, DESIGNS = "states.parquet", "designs.parquet"
RUN, REPORT = "run.json", "report.md"
PARTS = ".parts"
STORE = re.compile(r"[0-9a-f]{16}")  # how a fingerprint begins


@dataclass(frozen=True)
class Shard:
    """Part `number` (from 1) of `count`: every count-th chunk."""

    number: int = 1
    count: int = 1


@dataclass
class Progress:
    """How far a sweep is; handed to whoever watches after every chunk.

    `n_states` were computed in this run. `seconds` is the wall time of that, `tables_seconds`
    of joining the parts into the tables; `core_seconds` and `writing_seconds` are the workers'
    CPU time for states and parts; `failures` are designs whose worker died twice, `deaths` the
    chunks that were under way when a worker died, all of which were evaluated again.
    """

    n_designs: int
    n_done: int
    n_resumed: int
    n_workers: int
    n_states: int = 0
    seconds: float = 0.0
    tables_seconds: float = 0.0
    core_seconds: float = 0.0
    writing_seconds: float = 0.0
    failures: list[int] = field(default_factory=list)
    deaths: Sequence[Chunk] = ()


@dataclass(frozen=True)
class Study:
    """A sweep ready to run into a folder."""

    sweep: Sweep
    folder: Path
    tolerance: float = DEFAULT_TOLERANCE
    target_error: float | None = None

    @cached_property
    def evaluation(self) -> DesignEvaluation:
        """The function of each chunk."""
        data = self.sweep.base_data
        return DesignEvaluation(
            self.sweep.base.design,
            numbers_of(data),
            partial(reason_against, data),
            value_columns(self.sweep.space),
            self.sweep.constraints,
            self.tolerance,
            self.target_error,
        )

    @cached_property
    def metadata(self) -> dict[str, str]:
        """All that the results depend on, its fingerprint, and what the outputs rest on."""
        return {**self._identity, **trust_metadata(self.trusts, self.warnings)}

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of the calibrations in use."""
        return scene_of(self.sweep.base).warnings

    @property
    def fingerprint(self) -> str:
        """The SHA-256 of all that the results depend on."""
        return self._identity[FINGERPRINT]

    @cached_property
    def trusts(self) -> tuple[Trust, ...]:
        """What outputs of the designs rest on, at worst: of a million at most, spread evenly."""
        kinds: Counter[tuple[Trust, ...]] = Counter()
        step = max(1, self.sweep.space.size // MOST_ASKED)
        for chunk in islice(chunked([(0, self.sweep.space.size)], ASKED_AT_ONCE), None, None, step):
            values = self.sweep.space.designs(chunk.start, chunk.stop)
            for trusts, count in self.evaluation.kinds_of_trust(values):
                kinds[trusts] += count
        return of_space([*kinds.items()])

    @cached_property
    def _identity(self) -> dict[str, str]:
        said = {
            "dpg.sweep": self.sweep.canonical_json(),
            **self._exactness,
            N_DESIGNS: str(self.sweep.space.size),
            "dpg.schema_version": str(SCHEMA_VERSION),
            "dpg.law": scene_of(self.sweep.base).finger.law.description,
            "dpg.versions": versions(),
            "dpg.code": HERE.code,
        }
        return {**said, BASE: printable(self.sweep.base_path.name), FINGERPRINT: fingerprint(said)}

    @property
    def _exactness(self) -> dict[str, str]:
        if self.target_error is None:
            return {"dpg.tolerance": repr(self.tolerance)}
        return {"dpg.target_error_mm": repr(self.target_error)}

    @cached_property
    def store(self) -> PartStore:
        """Where the parts of just this sweep are kept."""
        return PartStore(self.folder / PARTS / self.fingerprint[:16])

    @property
    def chunk_size(self) -> int:
        """Designs per chunk: many states, but never so many that one waits for it.

        They are whole batches, since a small one takes longer by the state. Under pressure a batch
        takes a second or more, as do a few designs with a body.
        """
        most_units = self.extent.most_units
        if self.extent.has_pressure:
            return designs_at_once(most_units)
        most, at_once = STATES_PER_CHUNK >> most_units, designs_at_once(most_units)
        if self.extent.body_seconds:
            of_design = (self.extent.body_seconds * most_units**2) * 2**most_units
            most = min(most, int(CHUNK_SECONDS / of_design))
        return most // at_once * at_once or max(1, most)

    @cached_property
    def extent(self) -> Extent:
        """Time, disk and memory of the sweep."""
        allowed = self.evaluation.allowed if self.sweep.constraints else None
        base = self.sweep.base
        has_pressure = base.design.pressure is not None
        body_seconds = 0.0
        if base.design.body is not None:
            from dpgcli.grasping.costs import design_seconds

            body_seconds = design_seconds(scene_of(base))
        return Extent(self.sweep.space, base.finger.units, allowed, has_pressure, body_seconds)

    def ranges(self, shard: Shard) -> list[tuple[int, int]]:
        """Designs of a shard: its chunks, as ranges."""
        size = self.sweep.space.size
        step = min(self.chunk_size, -(-size // shard.count))  # so that none goes without
        every = range((shard.number - 1) * step, size, shard.count * step)
        return [(first, min(first + step, size)) for first in every]

    @property
    def is_up_to_date(self) -> bool:
        """Whether both tables are there, undamaged, and were made from just this."""
        wanted = self.fingerprint
        return all(
            is_whole(self.folder / name)
            and read_metadata(self.folder / name).get(FINGERPRINT) == wanted
            for name in (STATES, DESIGNS)
        )

    @property
    def damaged(self) -> list[Path]:
        """Tables that are there and were sealed, but are not as they were."""
        tables = (self.folder / name for name in (STATES, DESIGNS))
        return [path for path in tables if is_whole(path) is False]

    @property
    def owns_all_parts(self) -> bool:
        """Whether no other sweep has unfinished parts in the folder."""
        return all(store.folder == self.store.folder for store in stores(self.folder))

    @property
    def n_failed(self) -> int:
        """How many designs of the parts that are there have failed."""
        batches = (batch for part in self.store.parts() for batch in part.batches(1))
        return sum(batch["status"].to_pylist().count(DesignStatus.FAILED) for batch in batches)

    def check_memory(self) -> None:
        """Refuse what this machine's memory cannot hold; raises UsageError."""
        memory = _memory()
        if memory is not None and self.extent.bytes_in_memory > memory:
            raise UsageError(
                f"{self.sweep.space.size:,} designs take {size_text(self.extent.bytes_in_memory)} "
                f"of memory in their summary, and this machine has {size_text(memory)}: "
                "take fewer values, or go on with ",
                Field("force"),
            )

    def check_disk(self) -> None:
        """Refuse what the disk cannot hold; raises UsageError."""
        missing = self.store.missing([(0, self.sweep.space.size)])
        n_designs = sum(stop - start for start, stop in missing)
        n_states = self.extent.n_states * n_designs // self.sweep.space.size
        needed = self.extent.bytes_needed * n_designs // self.sweep.space.size
        free = shutil.disk_usage(_existing(self.folder)).free
        if needed > free:
            raise UsageError(
                f"{n_designs:,} designs have about {n_states:,} states, "
                f"{size_text(needed)} while they are made, and {size_text(free)} are free: "
                "take fewer values or units, or go on with ",
                Field("force"),
            )

    def check_unfinished(self) -> None:
        """Refuse to go on beside unfinished work of other content; raises UsageError."""
        check_unfinished(self.folder, self.metadata)

    def drop_unfinished(self) -> None:
        """Remove what unfinished sweeps left in the folder."""
        drop_parts(self.folder)

    def compute(
        self, workplace: Backend, watch: Callable[[Progress], None], shard: Shard | None = None
    ) -> Progress:
        """Evaluate what is missing, part by part; `watch` sees the progress after each."""
        store, evaluation, space = self.store, self.evaluation, self.sweep.space
        check_workers(workplace)
        store.say(self.metadata)
        for damaged in store.damaged():
            with writing(damaged.path):
                damaged.path.unlink()
        ranges = self.ranges(shard or Shard())
        missing = store.missing(ranges)
        n_designs = sum(stop - start for start, stop in ranges)
        n_resumed = n_designs - sum(stop - start for start, stop in missing)
        progress = Progress(n_designs, n_resumed, n_resumed, workplace.n_workers)
        work = ChunkTask(evaluation, store if workplace.is_local else None)
        runner = Runner(workplace, work, lambda c: (c, space.designs(c.start, c.stop), HERE))
        began = perf_counter()
        for result in runner.run(chunked(missing, self.chunk_size)):
            chunk, done = result.chunk, result.value
            if done is None:
                progress.failures.append(chunk.start)
                tables = evaluation.failed(chunk.start, space.designs(chunk.start, chunk.stop))
                done = work.stored(chunk, [tables])
            if done.content is not None:
                with store.part(chunk.start, chunk.stop) as file:
                    file.write(done.content)
            progress.n_states += done.n_states
            progress.core_seconds += done.core_seconds
            progress.writing_seconds += done.writing_seconds
            progress.n_done += chunk.stop - chunk.start
            progress.seconds = perf_counter() - began
            progress.deaths = runner.deaths
            watch(progress)
        return progress

    def replay(self, number: int, settings: Sequence[str] = ()) -> str:
        """The command that evaluates one design alone; `settings` are those of the sweep."""
        values = self.sweep.space.designs(number, number + 1)
        changes = [f"{key}={spelled(column[0].item())}" for key, column in values.items()]
        options = (option for change in (*settings, *changes) for option in ("--set", change))
        return shlex.join(["dpg", "predict", str(self.sweep.base_path), *options])

    def assemble(self) -> None:
        """Join all parts into the two tables; then the parts go."""
        assemble([self.store], self.folder)
        self.drop_unfinished()


def check_unfinished(folder: Path, metadata: dict[str, str]) -> None:
    """Refuse parts in a folder of other work than this; raises UsageError."""
    for store in stores(folder):
        if store.folder.name == metadata[FINGERPRINT][:16]:
            continue
        said = store.said()
        what = f"unfinished work whose {SAID} is damaged"
        if said:
            what = f"an unfinished {work_of(said)}"
            if work_of(said) is work_of(metadata):
                what += f" that differs in {', '.join(differences(said, metadata))}"
        raise UsageError(
            f"{folder} holds {what}: finish it as it was, take another ",
            Field("output"),
            ", or drop it with ",
            Field("restart"),
        )


def assemble(parts_of: Sequence[PartStore], folder: Path) -> str:
    """Join the parts of one sweep from one or more stores into its two tables, whole or not.

    Gives the fingerprint of the sweep. Raises UsageError for damage, parts of different sweeps,
    gaps and overlaps.
    """
    metadata = parts_of[0].said()
    for store in parts_of:
        if not store.said().get(FINGERPRINT, "").startswith(store.folder.name):
            raise UsageError(f"{store.folder / SAID} is damaged: run its sweep again")
        if damaged := store.damaged():
            wrong = "is damaged, or of another sweep: run its sweep again"
            raise UsageError(f"{damaged[0].path} {wrong}")
    for store in parts_of[1:]:
        if changed := differences(metadata, store.said()):
            raise UsageError(f"{store.folder.parent.parent} differs in {', '.join(changed)}")
    parts = sorted(part for store in parts_of for part in store.parts())
    covered = 0
    for part in [*parts, None]:
        start = part.start if part else int(metadata[N_DESIGNS])
        if start != covered:
            what = "lack" if start > covered else "share"
            first, last = sorted((start, covered))
            raise UsageError(f"the parts {what} designs {first} to {last - 1}")
        covered = part.stop if part else covered
    for which, name in enumerate((STATES, DESIGNS)):
        batches = (batch for part in parts for batch in part.batches(which))
        described = with_bases(parts[0].schema(which), metadata)
        write_table(folder / name, described, batches, metadata, in_thread=True)
    return metadata[FINGERPRINT]


def outputs(folder: Path) -> tuple[tuple[Path, Mark], ...]:
    """The files of a finished sweep."""
    tables = ((folder / name, Mark.TABLE) for name in (STATES, DESIGNS))
    return (*tables, (folder / RUN, Mark.FACTS), (folder / REPORT, Mark.REPORT))


def drop_parts(folder: Path) -> None:
    """Remove what unfinished sweeps left in a folder, and nothing of anybody else's."""
    for store in _stores(folder):
        store.drop()


def drop_half_written(folder: Path) -> None:
    """Remove what a killed run was about to write."""
    for path, _ in outputs(folder):
        drop_orphans(path)


def stores(folder: Path) -> list[PartStore]:
    """The parts of unfinished sweeps in a folder."""
    with reading(folder):
        return [store for store in _stores(folder) if (store.folder / SAID).exists()]


def _stores(folder: Path) -> list[PartStore]:
    """Folders whose names are beginnings of fingerprints, and that nobody else uses."""
    named = [path for path in inside(folder / PARTS) if STORE.fullmatch(path.name)]
    with reading(folder):
        found = [PartStore(path) for path in named if path.is_dir()]
    return [store for store in found if store.is_own]


def _memory() -> int | None:
    """Bytes of this machine's memory, where the system says."""
    if not hasattr(os, "sysconf"):  # Windows
        return None
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def _existing(folder: Path) -> Path:
    """The folder, or the nearest above it that exists."""
    with writing(folder):
        return next(place for place in (folder, *folder.absolute().parents) if place.exists())
