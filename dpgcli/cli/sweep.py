"""`dpg sweep`: the design space, into two tables."""

import os
import re
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dpgcli.cli.options import Quiet, Settings, Tolerance
from dpgcli.cli.progress import ProgressLine
from dpgcli.cli.streams import say

if TYPE_CHECKING:
    from dpgcli.exploration.executors import Workplace
    from dpgcli.exploration.expressions import Expression
    from dpgcli.studies.sweep import Progress, Shard, Study


MOST_NAMED = 20


class ExecutorName(StrEnum):
    """Where designs are evaluated."""

    PROCESSES = "processes"
    SERIAL = "serial"
    DASK = "dask"


SweepPath = Annotated[Path, typer.Argument(metavar="SWEEP", help="YAML file of a sweep")]
Output = Annotated[Path, typer.Option("-o", "--output", help="Folder of the tables")]
Jobs = Annotated[
    int | None, typer.Option("-j", "--jobs", min=1, help="Processes  [default: cores]")
]
Where = Annotated[ExecutorName, typer.Option("--executor", help="Where designs are evaluated")]
Scheduler = Annotated[
    str | None, typer.Option("--scheduler", metavar="ADDRESS", help="Of Dask: tcp://host:port")
]
Part = Annotated[
    str | None, typer.Option("--shard", metavar="K/N", help="Only part K of N; see merge")
]
Restart = Annotated[bool, typer.Option("--restart", help="Drop what an unfinished sweep left")]
Force = Annotated[bool, typer.Option("--force", help="Go on even if the disk is small")]
Depfile = Annotated[Path | None, typer.Option("--depfile", help="Write the files read, for Make")]
Require = Annotated[
    list[str] | None,
    typer.Option("--require", metavar="EXPR", help="What each design must meet; repeatable"),
]
SummaryFile = Annotated[
    Path | None, typer.Option("--summary-file", help="Append the report to this file")
]


def sweep(
    spec: SweepPath,
    output: Output,
    jobs: Jobs = None,
    executor: Where = ExecutorName.PROCESSES,
    scheduler: Scheduler = None,
    shard: Part = None,
    settings: Settings = None,
    tolerance: Tolerance = None,
    restart: Restart = False,
    force: Force = False,
    depfile: Depfile = None,
    require: Require = None,
    summary_file: SummaryFile = None,
    quiet: Quiet = False,
) -> None:
    """Evaluate every design of a space, resumably."""
    from dpgcli.errors import UsageError
    from dpgcli.files.sweep import read_sweep
    from dpgcli.states.plan import DEFAULT_TOLERANCE
    from dpgcli.studies.sweep import Study

    part = _shard(shard)
    if part is not None and (require or summary_file):
        raise UsageError("--require and --summary-file need the whole table: give them to check")
    study = Study(read_sweep(spec, settings or ()), output, tolerance or DEFAULT_TOLERANCE)
    rules = _rules(study, require or [])
    if depfile is not None:
        _write_depfile(depfile, study)
    is_new = part is not None or not study.is_up_to_date
    if not is_new:
        if not quiet:
            say(f"{output}: up to date")
    else:
        if restart:
            study.drop_unfinished()
        study.check_unfinished()
        if not force:
            study.check_room()
        progress = _computed(study, _workplace(executor, jobs, scheduler), part, quiet)
        if part is None:
            _write_run(study, progress)
            study.assemble()  # last: finished tables say that all is there
        if not quiet:
            say(_summary(output, progress, part))
    if part is None:
        _conclude(study, rules, summary_file, is_new, quiet)


def _rules(study: "Study", require: list[str]) -> "list[Expression]":
    """Requirements over the columns of designs, checked before any work."""
    from dpgcli.report.requirements import requirement
    from dpgcli.states.columns import Kind

    columns = study.evaluation.design_columns
    numbers = [column.name for column in columns if column.kind in (Kind.COUNT, Kind.NUMBER)]
    return [requirement(text, numbers) for text in require]


def _conclude(
    study: "Study",
    rules: "list[Expression]",
    summary_file: Path | None,
    is_new: bool,
    quiet: bool,
) -> None:
    """Write and print the report; then what the requirements say, which may end with code 1."""
    from dpgcli.cli.check import append_summary, conclude
    from dpgcli.cli.validate import ProblemFormat
    from dpgcli.files.output import whole_file
    from dpgcli.files.reading import read_designs, read_run
    from dpgcli.report.page import markdown, verdicts_markdown
    from dpgcli.report.requirements import check_requirements
    from dpgcli.studies.sweep import DESIGNS, REPORT, RUN

    designs, units = read_designs(study.folder / DESIGNS)
    text = markdown(designs, units, read_run(study.folder / RUN))
    if is_new or not (study.folder / REPORT).exists():
        with whole_file(study.folder / REPORT) as temporary:
            temporary.write_text(text, encoding="utf-8")
    if is_new and not quiet:
        print(text, end="")
    verdicts = check_requirements(designs, rules) if rules else ()
    if summary_file is not None:
        append_summary(summary_file, text + ("\n" + verdicts_markdown(verdicts) if rules else ""))
    conclude(verdicts, ProblemFormat.TEXT)


def _computed(
    study: "Study", workplace: "Workplace", part: "Shard | None", quiet: bool
) -> "Progress":
    line = ProgressLine(study.sweep.space.size, "designs", quiet=quiet)

    def watch(progress: "Progress") -> None:
        line.total = progress.n_designs
        line.resume_at(progress.n_resumed)
        line.show(progress.n_done)

    progress = study.compute(workplace, watch, part)
    line.clear()
    return progress


def _shard(text: str | None) -> "Shard | None":
    from dpgcli.errors import UsageError
    from dpgcli.studies.sweep import Shard

    if text is None:
        return None
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise UsageError(f"--shard {text}: expected K/N with K from 1 to N, such as 3/16")
    return Shard(int(match[1]), int(match[2]))


def _workplace(executor: ExecutorName, jobs: int | None, scheduler: str | None) -> "Workplace":
    from dpgcli.errors import UsageError
    from dpgcli.exploration import executors

    if (executor is ExecutorName.DASK) != (scheduler is not None):
        raise UsageError("--executor dask and --scheduler tcp://host:port go together")
    if scheduler is not None:
        try:
            return executors.dask_cluster(scheduler)
        except ImportError as error:
            raise UsageError("--executor dask needs Dask: pip install 'dpgcli[dask]'") from error
        except (OSError, ValueError) as error:
            raise UsageError(f"--scheduler {scheduler}: no scheduler answers: {error}") from error
    n_workers = jobs or os.cpu_count() or 1
    if executor is ExecutorName.SERIAL or n_workers == 1:
        return executors.serial()
    return executors.processes(n_workers)


def _write_depfile(path: Path, study: "Study") -> None:
    """Targets, what they were made from, and an empty rule for each of those, as gcc -MP does."""
    from dpgcli.files.output import whole_file
    from dpgcli.studies.sweep import DESIGNS, STATES

    study.folder.mkdir(parents=True, exist_ok=True)
    targets = " ".join(_escaped(study.folder / name) for name in (STATES, DESIGNS))
    sources = [_escaped(source) for source in study.sweep.files if source != Path("-")]
    text = f"{targets}: {' '.join(sources)}\n" + "".join(f"\n{source}:\n" for source in sources)
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _escaped(path: Path) -> str:
    """A name as Make reads it."""
    return re.sub(r"([ #\\])", r"\\\1", os.path.normpath(path)).replace("$", "$$")


def _write_run(study: "Study", progress: "Progress") -> None:
    from dpgcli.files.tables import write_run
    from dpgcli.studies.sweep import RUN

    write_run(study.folder / RUN, _facts(progress))


def _facts(progress: "Progress") -> dict[str, Any]:
    import platform

    return {
        "designs": progress.n_designs,
        "resumed_designs": progress.n_resumed,
        "failed_designs": progress.failures,
        "worker_deaths": progress.deaths,
        "seconds": progress.seconds,
        "core_cpu_seconds": progress.core_seconds,
        "writing_seconds": progress.writing_seconds,
        "machine": platform.machine(),
        "host": platform.node(),
        "python": platform.python_version(),
        "command": sys.argv,
    }


def _summary(output: Path, progress: "Progress", part: "Shard | None") -> str:
    new = progress.n_done - progress.n_resumed
    resumed = f", {progress.n_resumed:,} were there" if progress.n_resumed else ""
    rate = new / max(progress.seconds, 1e-9)
    text = (
        f"{output}: {new:,} designs in {progress.seconds:.3g} s ({rate:,.0f}/s){resumed}; "
        f"{progress.core_seconds:.3g} s of CPU in workers, {progress.writing_seconds:.2g} s writing"
    )
    if progress.failures:
        named = ", ".join(f"design {number}" for number in progress.failures[:MOST_NAMED])
        more = ", ..." if len(progress.failures) > MOST_NAMED else ""
        text += f"; failed, their worker died twice: {named}{more}"
    if part is not None:
        text += f"; part {part.number} of {part.count}: join with dpg merge"
    return text
