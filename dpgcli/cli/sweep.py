"""`dpg sweep`: the design space, into two tables."""

import math
import os
import sys
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dpgcli.cli.check import append_summary, code_of, print_verdicts
from dpgcli.cli.depfile import Depfile, depfile_text
from dpgcli.cli.exits import ExitCode, Terminated, check_failed, say_warnings
from dpgcli.cli.options import (
    ExecutorName,
    MaxFailed,
    Quiet,
    Restart,
    Scheduler,
    Settings,
    Strict,
    TargetError,
    Tolerance,
    Wait,
    Where,
    millimeters,
    seconds,
)
from dpgcli.cli.progress import ProgressLine
from dpgcli.cli.streams import put, say
from dpgcli.cli.validate import ProblemFormat
from dpgcli.cores import MOST_PROCESSES, cores

if TYPE_CHECKING:
    from dpgcli.api.place import Place
    from dpgcli.arrays import Columns
    from dpgcli.reports.space import DesignSpace
    from dpgcli.studies.sweep import Progress, Shard, Study
    from dpgcli.sweeps.expressions import Expression
    from dpgcli.sweeps.gate import RequirementVerdict


SweepPath = Annotated[Path, typer.Argument(metavar="SWEEP", help="YAML file of a sweep")]
Output = Annotated[  # as it is typed, for Make
    str, typer.Option("-o", "--output", metavar="FOLDER", help="Folder of the tables")
]
Jobs = Annotated[
    int | None,
    typer.Option(
        "-j", "--jobs", min=1, max=MOST_PROCESSES, help="Processes  [default: usable cores]"
    ),
]
Part = Annotated[
    str | None, typer.Option("--shard", metavar="K/N", help="Only part K of N; see merge")
]
Force = Annotated[bool, typer.Option("--force", help="Go on even if the disk is small")]
DepfilePath = Annotated[
    Path | None, typer.Option("--depfile", metavar="FILE", help="Write the files read, for Make")
]
Require = Annotated[
    list[str] | None,
    typer.Option("--require", metavar="EXPR", help="What each design must meet; repeatable"),
]
SummaryFile = Annotated[
    Path | None,
    typer.Option("--summary-file", metavar="FILE", help="Append the summary, in Markdown"),
]


def sweep(
    spec: SweepPath,
    output: Output,
    jobs: Jobs = None,
    executor: Where = ExecutorName.PROCESSES,
    scheduler: Scheduler = None,
    wait: Wait = None,
    shard: Part = None,
    settings: Settings = None,
    tolerance: Tolerance = None,
    target_error: TargetError = None,
    restart: Restart = False,
    force: Force = False,
    depfile: DepfilePath = None,
    require: Require = None,
    max_failed: MaxFailed = 0,
    summary_file: SummaryFile = None,
    strict: Strict = False,
    quiet: Quiet = False,
) -> None:
    """Evaluate every design of a space, resumably."""
    folder = Path(output)
    _start_fork_server_early(executor, jobs, folder)
    from dpgcli.api.sweep import shard_of, study_of
    from dpgcli.files.output import sole_use
    from dpgcli.studies.run import run
    from dpgcli.studies.sweep import drop_half_written

    part = shard_of(shard)
    place = _place(executor, jobs, scheduler, wait)
    _check_part(part, require, summary_file, depfile)
    target = None if target_error is None else millimeters("--target-error", target_error)
    study = study_of(spec, folder, settings or (), tolerance, target)
    _check_names(study, depfile, summary_file)
    rules = _rules(study, require or (), strict=strict)
    described = None if depfile is None else _described(study, output, depfile)

    work = partial(_computed, study, place, part, quiet)
    carry_out = partial(
        run,
        study,
        part,
        restart=restart,
        force=force,
        is_sent=place.is_sent,
        settings=settings or (),
        command=sys.argv,
        warn=say,
        tell=(lambda line: None) if quiet else say,
    )
    with sole_use(folder):
        drop_half_written(folder)
        is_new = carry_out(work) if described is None else described.beside(carry_out, work)
        if part is None:
            n_failed, code = _judge(study, rules, summary_file, is_new, quiet, strict=strict)
        else:
            n_failed, code = study.n_failed, ExitCode.DONE
    check_failed(n_failed, max_failed)
    if code:
        raise typer.Exit(code)


def _place(
    executor: ExecutorName, jobs: int | None, scheduler: str | None, wait: str | None
) -> "Place":
    from dpgcli.api.place import Place

    limit = None if wait is None else seconds("--wait", wait)
    return Place(executor.value, jobs, scheduler, limit)


def _rules(study: "Study", require: Sequence[str], *, strict: bool) -> "list[Expression]":
    """Requirements over columns of designs, checked before any work; what is doubted is said."""
    from dpgcli.api.sweep import rules_of

    rules, doubts = rules_of(study, require, strict=strict)
    say_warnings(doubts)
    return rules


def _check_part(
    part: "Shard | None",
    require: list[str] | None,
    summary_file: Path | None,
    depfile: Path | None,
) -> None:
    """Raise UsageError for options that are about tables, which a shard does not make."""
    from dpgcli.errors import UsageError

    if part is None:
        return
    if require or summary_file:
        raise UsageError("--require and --summary-file need the whole table: give them to check")
    if depfile:
        raise UsageError("--depfile says what the tables are made from, and a shard makes none")


def _described(study: "Study", output: str, depfile: Path) -> Depfile:
    from dpgcli.studies.sweep import DESIGNS, STATES

    return Depfile(depfile, depfile_text(output, (STATES, DESIGNS), study.sweep.files))


def _start_fork_server_early(executor: ExecutorName, jobs: int | None, folder: Path) -> None:
    """Workers' imports, once for all of them, while this process is busy with its own."""
    n_workers = jobs or cores().usable
    if executor is not ExecutorName.PROCESSES or n_workers == 1 or os.path.lexists(folder):
        return  # in a folder that is there, there may be nothing to do
    from dpgcli.sweeps.pool import start_fork_server

    start_fork_server("dpgcli.studies.work", "filelock", "shapely")


def _check_names(study: "Study", depfile: Path | None, summary_file: Path | None) -> None:
    """Files of their own, none of them one that is read, nor where parts are kept."""
    from dpgcli.errors import UsageError
    from dpgcli.files.output import check_apart, check_appendable, check_not_read, real
    from dpgcli.studies.sweep import PARTS, outputs

    tables = [path for path, _ in outputs(study.folder)]
    own = [path for path in (depfile, summary_file) if path is not None]
    check_not_read(study.sweep.files, tables + own)
    check_apart(tables + own)
    parts = real(study.folder / PARTS)
    for path in own:
        if real(path).is_relative_to(parts):
            raise UsageError(f"{path}: expected a name outside of {PARTS}, where parts are kept")
    if summary_file is not None:
        check_appendable(summary_file, study.sweep.files)


def _judge(
    study: "Study",
    rules: "list[Expression]",
    summary_file: Path | None,
    is_new: bool,
    quiet: bool,
    *,
    strict: bool,
) -> tuple[int, ExitCode]:
    """Report; how many designs failed, and how the command ends if they may."""
    from dpgcli.api.report import summarize
    from dpgcli.reports.page import verdicts_markdown
    from dpgcli.sweeps.gate import check_requirements

    space, text = summarize(study.folder, is_new=is_new, strict=strict)
    designs = space.designs
    if is_new and not quiet:
        print_in_short(study.folder, space)
        if study.target_error is not None:
            say(_chosen(designs))
    verdicts: Sequence[RequirementVerdict] = check_requirements(designs, rules) if rules else ()
    print_verdicts(verdicts, ProblemFormat.TEXT)
    summary = text + ("\n" + verdicts_markdown(verdicts) if rules else "")
    is_written = summary_file is None or append_summary(summary_file, summary)
    return len(space.of_status("failed")), code_of(verdicts, is_written=is_written)


def print_in_short(folder: Path, space: "DesignSpace") -> None:
    """Where the tables are, how many designs, the best and the worst of them."""
    from dpgcli.cli.printing import print_grid
    from dpgcli.reports.summary import doubts, in_short
    from dpgcli.studies.sweep import REPORT

    counts, table = in_short(space)
    put(f"{folder}: {counts}; more in {folder / REPORT}")
    if table.rows:
        places = enumerate(table.head)
        texts = {name: [row[place] for row in table.rows] for place, name in places}
        print_grid(texts, left=table.head)
    say_warnings(doubts(space))


def _chosen(designs: "Columns") -> str:
    """The accuracy levels that designs took for the target error."""
    counts = Counter(level for level in designs["accuracy_level"].tolist() if level)
    ways = ", ".join(f"{count:,} {level}" for level, count in counts.most_common())
    bound = max((mm for mm in designs["error_bound_mm"].tolist() if mm == mm), default=math.nan)
    return f"chosen for the target error: {ways or 'nothing'}; largest bound {bound:.1e} mm"


def _computed(study: "Study", place: "Place", part: "Shard | None", quiet: bool) -> "Progress":
    line = ProgressLine(study.sweep.space.size, "designs", quiet=quiet)

    def watch(progress: "Progress") -> None:
        line.total = progress.n_designs
        line.resume_at(progress.n_resumed)
        line.show(progress.n_done)

    try:
        with place.workplace(say) as workplace:
            return study.compute(workplace, watch, part)
    except (KeyboardInterrupt, Terminated) as stop:
        raise type(stop)("what is done is kept, and the same command goes on from there") from None
    finally:
        line.clear()
