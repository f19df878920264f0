"""`sweep` and `merge`: every design of a space, in two tables."""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from tempfile import gettempdir

from dpgcli.api.arguments import (
    as_texts,
    check_callable,
    check_flags,
    check_texts,
    each_of,
    number,
    path_of,
)
from dpgcli.api.given import SweepInput, sweep_input
from dpgcli.api.inputs import Settings, setting_texts
from dpgcli.api.place import Place
from dpgcli.api.report import silent, summarize
from dpgcli.api.tables import Table
from dpgcli.errors import Field, Message, UsageError
from dpgcli.files.output import check_not_read, check_outputs, sole_use
from dpgcli.files.parts import FINGERPRINT, PartStore, Work, work_of
from dpgcli.files.table_reader import read_undamaged
from dpgcli.files.trust import warnings_in
from dpgcli.records import dataclass
from dpgcli.reports.space import DesignSpace
from dpgcli.reports.summary import doubts as ranked_doubts
from dpgcli.reports.summary import surely_ranked
from dpgcli.states.accuracy import DEFAULT_TOLERANCE, check_exactness
from dpgcli.states.columns import Kind
from dpgcli.studies.run import run
from dpgcli.studies.sweep import (
    DESIGNS,
    RUN,
    STATES,
    Progress,
    Shard,
    Study,
    assemble,
    drop_half_written,
    outputs,
    stores,
)
from dpgcli.sweeps.expressions import Expression
from dpgcli.sweeps.gate import (
    RequirementVerdict,
    check_beyond_doubt,
    check_requirements,
    doubts,
    requirement,
)
from dpgcli.temporary import temporary_folder


@dataclass(frozen=True)
class SweepResult:
    """The tables of a sweep, read when asked for; of a shard there are none before `merge`.

    `n_failed` designs killed their worker, twice. `report` is the page on the space, `space` what
    it was made of; `fingerprint` is that of all the tables depend on. `verdicts` are on what was
    required.
    """

    folder: Path
    fingerprint: str
    n_failed: int
    report: str = ""
    space: DesignSpace | None = None
    verdicts: tuple[RequirementVerdict, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Of calibrations in use, and of requirements and rankings by what is doubted."""
        if self.space is None:
            return ()
        required = (warning for verdict in self.verdicts for warning in verdict.warnings)
        return (*warnings_in(self.space.metadata), *required, *ranked_doubts(self.space))

    @cached_property
    def designs(self) -> Table:
        """A row for each design: what became of it, and its metrics.

        Raises UsageError where the folder has the table of another sweep by now, or none.
        """
        return self._table(DESIGNS)

    @cached_property
    def states(self) -> Table:
        """A row for each state of each design. Raises UsageError as `designs` does."""
        return self._table(STATES)

    def _table(self, name: str) -> Table:
        path = self.folder / name
        table = read_undamaged(path)
        said = (table.schema.metadata or {}).get(FINGERPRINT.encode(), b"").decode()
        if said != self.fingerprint:
            raise UsageError(
                f"{path} is of another sweep by now than this result: give each an ",
                Field("output"),
                " of its own, or read its tables before the next",
            )
        return Table(table)


def sweep(
    sweep: SweepInput,
    output: str | Path | None = None,
    *,
    settings: Settings = (),
    tolerance: float | None = None,
    target_error: float | None = None,
    jobs: int | None = None,
    executor: str = "processes",
    scheduler: str | None = None,
    wait: float | None = None,
    shard: str | Shard | None = None,
    restart: bool = False,
    force: bool = False,
    require: str | Sequence[str] = (),
    strict: bool = False,
    watch: Callable[[Progress], None] = lambda progress: None,
) -> SweepResult:
    """Evaluate every design of a space: `sweep` is its file, or the data of one.

    In data the `base` may be a spec's data, too. The tables go into the folder `output`, where
    another call goes on; without one they are in the result alone. The other arguments are those
    of `dpg sweep`; `watch` sees the progress. Processes import the program that starts them: put
    its work under `if __name__ == "__main__"`, or take executor="serial".
    Raises SpecError for a wrong sweep, UsageError for wrong choices, OutputError, WorkplaceError.

    >>> lattice = {"segment_length_mm": 13.5, "segment_height_mm": 10.75, "stroke_mm": 3.5,
    ...            "bistable_stiffness_N_per_mm": 12.84, "force_linearity": 0.043,
    ...            "hinge_stiffness_N_mm_per_rad": 24.2}
    >>> finger = {"units": 2, "linear_stiffness_N_per_mm": 1e4, "lattice": lattice}
    >>> space = [{"key": "finger.lattice.stroke_mm", "values": [2.5, 3.5]}]
    >>> result = sweep({"base": {"finger": finger}, "space": space}, executor="serial")
    >>> result.designs["n_stable"].tolist(), len(result.states)
    ([4, 4], 8)
    """
    place, part = Place(executor, jobs, scheduler, wait), shard_of(shard)
    check_flags(restart=restart, force=force, strict=strict)
    check_callable(watch=watch)
    _check_part(part, output, require)
    with _folder(output) as folder:
        study = study_of(sweep, folder, settings, tolerance, target_error)
        check_not_read(study.sweep.files, [path for path, _ in outputs(folder)])
        rules, _ = rules_of(study, require, strict=strict)
        with sole_use(folder):
            drop_half_written(folder)
            is_new = run(
                study,
                part,
                lambda: _computed(study, place, watch, part),
                restart=restart,
                force=force,
                is_sent=place.is_sent,
                settings=setting_texts(settings),
                warn=silent,
                tell=silent,
            )
            result = _result(study, part, is_new, rules, strict=strict)
        if output is None:
            _ = result.designs, result.states  # before their folder goes
    return result


def _computed(
    study: Study, place: "Place", watch: Callable[[Progress], None], part: Shard | None
) -> Progress:
    with place.workplace(silent) as workplace:
        return study.compute(workplace, watch, part)


@contextmanager
def _folder(output: str | Path | None) -> Iterator[Path]:
    if output is not None:
        yield path_of("output", output)
        return
    with temporary_folder(Path(gettempdir()) / "sweep") as folder:
        yield folder / "output"  # which is locked, as the folder is


def _check_part(
    part: Shard | None, output: str | Path | None, require: str | Sequence[str]
) -> None:
    """Raise UsageError for what a shard, if it is one, has no place or no table for."""
    if part is None:
        return
    if output is None:
        raise UsageError("a ", Field("shard"), " is kept in a folder: give ", Field("output"))
    if require:
        raise UsageError(Field("require"), " needs the whole table: give it to check")


def _result(
    study: Study, part: Shard | None, is_new: bool, rules: Sequence[Expression], *, strict: bool
) -> SweepResult:
    if part is not None:
        return SweepResult(study.folder, study.fingerprint, study.n_failed)
    found = _summarized(study.folder, study.fingerprint, is_new=is_new, strict=strict)
    if found.space is None or not rules:
        return found
    verdicts = check_requirements(found.space.designs, rules, found.space.trusts)
    return replace(found, verdicts=verdicts)


def _summarized(
    folder: Path, fingerprint: str, *, is_new: bool, strict: bool = False
) -> SweepResult:
    space, text = summarize(folder, is_new=is_new, strict=strict)
    return SweepResult(folder, fingerprint, len(space.of_status("failed")), text, space)


def study_of(
    sweep: SweepInput,
    folder: Path,
    settings: Settings = (),
    tolerance: float | None = None,
    target_error: float | None = None,
) -> Study:
    """A sweep ready to run into a folder."""
    tolerance, target_error = number("tolerance", tolerance), number("target_error", target_error)
    exactness = DEFAULT_TOLERANCE if tolerance is None else tolerance
    check_exactness(exactness, target_error)
    return Study(sweep_input(sweep, settings), folder, exactness, target_error)


def rules_of(
    study: Study, require: str | Sequence[str], *, strict: bool
) -> tuple[list[Expression], list[Message]]:
    """Requirements over the columns of designs, checked before any work, and what is doubted.

    Raises UsageError for what is no requirement, and where it is `strict` for requirements and
    rankings by what is doubted.
    """
    texts = as_texts("require", require)
    if not texts and not strict:  # so that a large space need not be asked what it rests on
        return [], []
    columns = study.evaluation.design_columns
    numbers = [column.name for column in columns if column.kind in (Kind.COUNT, Kind.NUMBER)]
    rules = [requirement(text, numbers) for text in texts]
    known = {trust.output: trust for trust in study.trusts}
    trusts = {c.name: [known[o] for o in c.outputs if o in known] for c in columns}
    if strict and known:  # else there is no design to judge
        check_beyond_doubt(trusts, rules, surely_ranked(trusts))
    return rules, [doubt for rule in rules for doubt in doubts(rule, trusts)]


def shard_of(shard: str | Shard | None) -> Shard | None:
    """A part of a sweep in words, K/N.

    >>> shard_of("3/16")
    Shard(number=3, count=16)
    """
    if shard is None or isinstance(shard, Shard):
        return shard
    check_texts(shard=shard)
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", shard)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise UsageError(Field("shard"), f" {shard}: expected K/N with K from 1 to N, such as 3/16")
    return Shard(int(match[1]), int(match[2]))


def merge(shards: str | Path | Sequence[str | Path], output: str | Path) -> SweepResult:
    """Join the folders of shards into the tables of the whole sweep.

    Raises UsageError for folders without a shard, damage, gaps and overlaps, and parts of
    different sweeps.

    >>> merge(["nowhere"], "whole")
    Traceback (most recent call last):
        ...
    dpgcli.errors.UsageError: nowhere: expected the output of one dpg sweep shard, found no shard
    """
    folders = each_of("shards", shards)
    if not folders:
        raise UsageError("shards: expected one folder or more")
    paths = [path_of("shards", folder) for folder in folders]
    return merged(paths, path_of("output", output))


def merged(shards: Sequence[Path], folder: Path) -> SweepResult:
    """The same, of paths."""
    found = [_store(shard) for shard in shards]
    check_not_read(shards, [path for path, _ in outputs(folder)])
    with sole_use(folder):
        drop_half_written(folder)
        check_outputs((), *(each for each in outputs(folder) if each[0] != folder / RUN))
        return _summarized(folder, assemble(found, folder), is_new=True)


def _store(folder: Path) -> PartStore:
    """The parts of the one shard in a folder."""
    here = stores(folder)
    if len(here) != 1:
        what = "no shard" if not here else "several sweeps"
        expected = f"{folder}: expected the output of one dpg sweep "
        raise UsageError(expected, Field("shard"), f", found {what}")
    if work_of(here[0].said()) is Work.SEARCH:
        raise UsageError(f"{folder} holds an unfinished search, no shard of a sweep")
    return here[0]
