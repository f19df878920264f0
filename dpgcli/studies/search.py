"""A search carried out at a workplace: parts kept in the folder of its output until it is done."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from io import BytesIO
from pathlib import Path
from tempfile import gettempdir
from typing import Any

import numpy as np

from dpgcli.errors import WorkplaceError
from dpgcli.files.access import reading, writing
from dpgcli.files.goal_file import GoalFile
from dpgcli.files.parts import FINGERPRINT, GOAL, PartStore, fingerprint
from dpgcli.files.scene_file import canonical, canonical_json
from dpgcli.files.table_writer import versions
from dpgcli.records import dataclass
from dpgcli.search.descent import Residuals
from dpgcli.search.designs import Designs
from dpgcli.search.part import Found, Part
from dpgcli.search.search import Limits, Task
from dpgcli.studies.sweep import PARTS, check_unfinished, drop_parts
from dpgcli.sweeps.executors import GO_ON, Backend, Chunk, Runner
from dpgcli.sweeps.maker import HERE, Maker, check_maker, check_workers
from dpgcli.temporary import temporary_folder

COUNTS = ("n_starts", "n_empty", "n_evaluated")
NESTED = ("choice", "columns", "trace")  # of columns by name


@dataclass(frozen=True)
class StoredTask:
    """Does a part of a search; keeps what it comes to in the `store`, or sends it along.

    Without the bytes a worker's answer is shorter than what a pipe takes at once: one that is
    killed while it sends leaves no half of a message, for the rest of which the pool would wait.
    """

    task: Task
    store: PartStore | None

    def __call__(self, part: Part, maker: Maker) -> bytes:
        """What a part comes to as bytes; none where it is kept, or is nothing."""
        check_maker(maker, "search")
        found = self.task(part)
        if found is None or self.store is None:
            return b"" if found is None else packed(found)
        with self.store.part(part.number, part.number + 1) as file:
            file.write(packed(found))
        return b""


@dataclass(frozen=True)
class SearchStudy:
    """A search of this seed and these limits at a workplace, its parts kept in a folder."""

    given: GoalFile
    seed: int
    limits: Limits
    workplace: Backend
    folder: Path

    @cached_property
    def identity(self) -> dict[str, str]:
        """All that its parts depend on, and the fingerprint of that."""
        goal = {key: value for key, value in self.given.said.items() if key != "base"}
        said = {
            GOAL: json.dumps(canonical(goal), sort_keys=True),
            "dpg.goal_base": canonical_json(self.given.base),
            "dpg.seed": str(self.seed),
            "dpg.evaluations": str(self.limits.evaluations),
            "dpg.versions": versions(),
            "dpg.code": HERE.code,
        }
        return {**said, FINGERPRINT: fingerprint(said)}

    @cached_property
    def store(self) -> PartStore:
        """Where the parts of just this search are kept."""
        return PartStore(self.folder / PARTS / self.identity[FINGERPRINT][:16])

    def begin(self, *, restart: bool = False) -> None:
        """Say what the parts are of. Raises UsageError where those of other work are there."""
        if restart:
            drop_parts(self.folder)
        check_unfinished(self.folder, self.identity)
        check_workers(self.workplace, "search")
        self.store.say(self.identity)
        for damaged in self.store.damaged():
            with writing(damaged.path):
                damaged.path.unlink()

    def run(self, task: Task, parts: Sequence[Part]) -> Iterator[Found | None]:
        """What parts come to, in their order; those that are there already are not done again.

        Raises WorkplaceError for a part that kills its workers.
        """
        numbered, kept = {part.number: part for part in parts}, self._kept()
        work = StoredTask(task, self.store if self.workplace.is_local else None)
        runner = Runner(self.workplace, work, lambda chunk: (numbered[chunk.start], HERE))
        for result in runner.run(Chunk(n, n + 1) for n in numbered if n not in kept):
            number = result.chunk.start
            if result.value is None:
                raise WorkplaceError(
                    f"part {number} of the search killed its worker, twice: is there memory "
                    f"enough? {GO_ON}"
                )
            if result.value:
                with self.store.part(number, number + 1) as file:
                    file.write(result.value)
        kept = self._kept()
        for number in numbered:
            yield _read(kept[number]) if number in kept else None

    def _kept(self) -> dict[int, Path]:
        """The files of parts that are there, by number."""
        return {part.start: part.path for part in self.store.parts()}


@contextmanager
def parts_folder(output: Path | None) -> Iterator[Path]:
    """A folder for parts: that of the output, or one that goes at the end."""
    if output is not None:
        yield output
        return
    with temporary_folder(Path(gettempdir()) / "design") as folder:
        yield folder


def packed(found: Found) -> bytes:
    """What a part of a search comes to, as the bytes of an .npz file."""
    designs = found.designs
    arrays: dict[str, Any] = {
        **{f"choice/{key}": column for key, column in designs.choice.items()},
        **{f"columns/{key}": column for key, column in designs.columns.items()},
        **{f"trace/{key}": column for key, column in found.trace.items()},
        **{name: np.array(getattr(found, name)) for name in COUNTS},
        "points": designs.points,
        "values": designs.residuals.values,
        "slopes": designs.residuals.slopes,
        "codes": designs.codes,
        "objectives": designs.objectives,
        "hold": designs.hold,
        "are_finished": designs.are_finished,
    }
    sink = BytesIO()
    np.savez(sink, **arrays)
    return sink.getvalue()


def unpacked(content: bytes) -> Found:
    """The same as it was."""
    with np.load(BytesIO(content), allow_pickle=False) as arrays:
        known = dict(arrays)
    choice, columns, trace = (_under(name, known) for name in NESTED)
    designs = Designs(
        choice,
        known["points"],
        Residuals(known["values"], known["slopes"]),
        known["codes"],
        columns,
        known["objectives"],
        known["hold"],
        known["are_finished"],
    )
    return Found(designs, trace, *(int(known[name]) for name in COUNTS))


def _read(path: Path) -> Found:
    with reading(path):
        content = path.read_bytes()
    return unpacked(content)


def _under(name: str, known: Mapping[str, Any]) -> dict[str, Any]:
    head = f"{name}/"
    return {key.removeprefix(head): own for key, own in known.items() if key.startswith(head)}
