"""`dpg sweep`: the design space, into two tables."""

import os
import re
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from dpgcli.cli.check import append_summary, code_of, print_verdicts
from dpgcli.cli.depfile import write_depfile
from dpgcli.cli.exits import ExitCode, Terminated
from dpgcli.cli.options import (
    LONG,
    MOST_PROCESSES,
    MaxFailed,
    Quiet,
    Settings,
    TargetError,
    Tolerance,
    millimeters,
    seconds,
)
from dpgcli.cli.progress import ProgressLine
from dpgcli.cli.report import summarize
from dpgcli.cli.streams import say
from dpgcli.cli.sweep_summary import check_failed, run_facts, run_summary
from dpgcli.cli.validate import ProblemFormat

if TYPE_CHECKING:
    import pandas as pd

    from dpgcli.studies.sweep import Progress, Shard, Study
    from dpgcli.sweeps.executors import Workplace
    from dpgcli.sweeps.expressions import Expression
    from dpgcli.sweeps.gate import Verdict

MOST_NAMED = 20
WAIT = "5m"
ADDRESS = r"(?:(?:tcp|tls|ws|wss|ucx)://)?[^\s/]+:[0-9]{1,5}/?"


class ExecutorName(StrEnum):
    """Where designs are evaluated."""

    PROCESSES = "processes"
    SERIAL = "serial"
    DASK = "dask"


SweepPath = Annotated[Path, typer.Argument(metavar="SWEEP", help="YAML file of a sweep")]
Output = Annotated[Path, typer.Option("-o", "--output", help="Folder of the tables")]
Jobs = Annotated[
    int | None,
    typer.Option("-j", "--jobs", min=1, max=MOST_PROCESSES, help="Processes  [default: cores]"),
]
Where = Annotated[ExecutorName, typer.Option("--executor", help="Where designs are evaluated")]
Scheduler = Annotated[
    str | None, typer.Option("--scheduler", metavar="ADDRESS", help="Of Dask: tcp://host:port")
]
Wait = Annotated[
    str | None,
    typer.Option(
        "--wait", metavar="TIME", help="For a worker of Dask, while none is there  [default: 5m]"
    ),
]
Part = Annotated[
    str | None, typer.Option("--shard", metavar="K/N", help="Only part K of N; see merge")
]
Restart = Annotated[bool, typer.Option("--restart", help="Begin anew, whatever is there")]
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
    wait: Wait = None,
    shard: Part = None,
    settings: Settings = None,
    tolerance: Tolerance = None,
    target_error: TargetError = None,
    restart: Restart = False,
    force: Force = False,
    depfile: Depfile = None,
    require: Require = None,
    max_failed: MaxFailed = 0,
    summary_file: SummaryFile = None,
    quiet: Quiet = False,
) -> None:
    """Evaluate every design of a space, resumably."""
    if executor is ExecutorName.PROCESSES and jobs != 1 and not output.exists():
        _start_fork_server_early()
    from dpgcli.errors import UsageError
    from dpgcli.files.output import sole_use
    from dpgcli.studies.sweep import drop_half_written, drop_parts

    part = _shard(shard)
    limit = _patience(executor, scheduler, wait)
    if part is not None and (require or summary_file):
        raise UsageError("--require and --summary-file need the whole table: give them to check")
    study = _study(spec, settings or (), output, tolerance, target_error)
    _check_names(study, depfile, summary_file)
    rules = _rules(study, require or [])
    if depfile is not None:
        write_depfile(depfile, study)
    with sole_use(output):
        drop_half_written(output)
        is_new = restart or not study.is_up_to_date
        if is_new:
            study.extent.check(study.chunk_size, is_sent=executor is ExecutorName.DASK)
            if part is None:
                _check_tables(study)
            _check_folder(study, restart=restart, force=force)
            if not quiet:
                _say_before(study)
            progress = _computed(study, _workplace(executor, jobs, scheduler, limit), part, quiet)
            _conclude(study, progress, part, settings or (), quiet)
        else:
            if part is None and study.owns_all_parts:  # what a run left that was stopped at its end
                drop_parts(study.folder)
            if not quiet:
                say(f"{output}: up to date")
        if part is None:
            n_failed, code = _judge(study, rules, summary_file, is_new, quiet)
        else:
            n_failed, code = study.n_failed, ExitCode.DONE
    check_failed(n_failed, max_failed)
    if code:
        raise typer.Exit(code)


def _start_fork_server_early() -> None:
    """Workers' imports, once for all of them, while this process is busy with its own."""
    from dpgcli.sweeps.executors import start_fork_server

    start_fork_server("dpgcli.cli.main", "dpgcli.studies.sweep", "filelock")


def _study(
    spec: Path,
    settings: Sequence[str],
    output: Path,
    tolerance: float | None,
    target_error: str | None,
) -> "Study":
    from dpgcli.files.sweep_file import read_sweep
    from dpgcli.states.rungs import DEFAULT_TOLERANCE, check_exactness
    from dpgcli.studies.sweep import Study

    target = None if target_error is None else millimeters("--target-error", target_error)
    exactness = DEFAULT_TOLERANCE if tolerance is None else tolerance
    check_exactness(exactness, target)
    return Study(read_sweep(spec, settings), output, exactness, target)


def _say_before(study: "Study") -> None:
    """What a long sweep takes."""
    from dpgcli.studies.extent import size_text

    extent = study.extent
    if extent.seconds > LONG:
        less = ", less what constraints exclude" if study.sweep.constraints else ""
        say(
            f"{study.folder}: {study.sweep.space.size:,} designs, {extent.n_states:,} states"
            f"{less}: about {extent.seconds / 60:,.1f} min of one core, "
            f"{size_text(extent.bytes_needed)} of disk, {size_text(extent.bytes_in_memory)} of "
            "memory (rough: a factor of two either way)"
        )


def _check_names(study: "Study", depfile: Path | None, summary_file: Path | None) -> None:
    """Files of their own, none of them one that is read."""
    from dpgcli.files.output import check_apart, check_appendable, check_not_read
    from dpgcli.studies.sweep import outputs

    written = [path for path, _ in outputs(study.folder)]
    written += [path for path in (depfile, summary_file) if path is not None]
    check_not_read(study.sweep.files, written)
    check_apart(written)
    if summary_file is not None:
        check_appendable(summary_file, study.sweep.files)


def _check_tables(study: "Study") -> None:
    """Refuse what cannot be replaced, and say what is damaged."""
    from dpgcli.files.output import check_outputs
    from dpgcli.studies.sweep import outputs

    for path in study.damaged:
        say(f"{path} is damaged: made again")
    check_outputs(study.sweep.files, *outputs(study.folder))


def _check_folder(study: "Study", *, restart: bool, force: bool) -> None:
    """Refuse what is unfinished there, unless it is to go, and what has no room."""
    if restart:
        study.drop_unfinished()
    study.check_unfinished()
    if not force:
        study.check_room()


def _rules(study: "Study", require: list[str]) -> "list[Expression]":
    """Requirements over the columns of designs, checked before any work."""
    if not require:
        return []
    from dpgcli.states.columns import Kind
    from dpgcli.sweeps.gate import requirement

    columns = study.evaluation.design_columns
    numbers = [column.name for column in columns if column.kind in (Kind.COUNT, Kind.NUMBER)]
    return [requirement(text, numbers) for text in require]


def _conclude(
    study: "Study",
    progress: "Progress",
    part: "Shard | None",
    settings: Sequence[str],
    quiet: bool,
) -> None:
    """Write the tables unless this is a part of them, and say what the run came to."""
    from dpgcli.files.table_writer import write_run
    from dpgcli.studies.sweep import RUN

    replays = [study.replay(number, settings) for number in progress.failures[:MOST_NAMED]]
    if part is None:
        write_run(study.folder / RUN, run_facts(study, progress, replays))
        began = perf_counter()
        study.assemble()  # last but for its own time: finished tables say that all is there
        progress.tables_seconds = perf_counter() - began
        write_run(study.folder / RUN, run_facts(study, progress, replays))
    if not quiet:
        say(run_summary(study.folder, progress, part))
    for replay in replays:
        say(f"failed, its worker died twice; alone: {replay}")


def _judge(
    study: "Study", rules: "list[Expression]", summary_file: Path | None, is_new: bool, quiet: bool
) -> tuple[int, ExitCode]:
    """Report; how many designs failed, and how the command ends if they may."""
    from dpgcli.report.page import verdicts_markdown
    from dpgcli.sweeps.gate import check_requirements

    designs, text = summarize(study.folder, is_new=is_new)
    if is_new and not quiet:
        print(text, end="")
        if study.target_error is not None:
            say(_chosen(designs))
    verdicts: Sequence[Verdict] = check_requirements(designs, rules) if rules else ()
    print_verdicts(verdicts, ProblemFormat.TEXT)
    summary = text + ("\n" + verdicts_markdown(verdicts) if rules else "")
    is_written = summary_file is None or append_summary(summary_file, summary)
    return int((designs["status"] == "failed").sum()), code_of(verdicts, is_written=is_written)


def _chosen(designs: "pd.DataFrame") -> str:
    """What the designs took for the target error."""
    counts = designs.loc[designs["rung"] != "", "rung"].value_counts()
    ways = ", ".join(f"{count:,} {rung}" for rung, count in counts.items())
    bound = designs["error_bound_mm"].max()
    return f"chosen for the target error: {ways or 'nothing'}; largest bound {bound:.1e} mm"


def _computed(
    study: "Study", workplace: "Workplace", part: "Shard | None", quiet: bool
) -> "Progress":
    line = ProgressLine(study.sweep.space.size, "designs", quiet=quiet)

    def watch(progress: "Progress") -> None:
        line.total = progress.n_designs
        line.resume_at(progress.n_resumed)
        line.show(progress.n_done)

    try:
        return study.compute(workplace, watch, part)
    except (KeyboardInterrupt, Terminated) as stop:
        raise type(stop)("what is done is kept, and the same command goes on from there") from None
    finally:
        line.clear()


def _shard(text: str | None) -> "Shard | None":
    from dpgcli.errors import UsageError
    from dpgcli.studies.sweep import Shard

    if text is None:
        return None
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise UsageError(f"--shard {text}: expected K/N with K from 1 to N, such as 3/16")
    return Shard(int(match[1]), int(match[2]))


def _patience(executor: ExecutorName, scheduler: str | None, wait: str | None) -> float:
    """How long a worker of Dask may be waited for, in s."""
    from dpgcli.errors import UsageError

    if (executor is ExecutorName.DASK) != (scheduler is not None):
        raise UsageError("--executor dask and --scheduler tcp://host:port go together")
    if scheduler is not None and re.fullmatch(ADDRESS, scheduler) is None:
        raise UsageError(f"--scheduler {scheduler}: expected tcp://host:port")
    if scheduler is None and wait is not None:
        raise UsageError("--wait is for the workers of --executor dask")
    return seconds("--wait", wait or WAIT)


def _workplace(
    executor: ExecutorName, jobs: int | None, scheduler: str | None, limit: float
) -> "Workplace":
    from dpgcli.errors import UsageError
    from dpgcli.sweeps import cluster, executors

    if scheduler is not None:
        try:
            return cluster.dask_cluster(scheduler, limit, say)
        except ImportError as error:
            raise UsageError("--executor dask needs Dask: pip install distributed") from error
        except (OSError, ValueError) as error:
            what = f"--scheduler {scheduler}: no scheduler or no worker answers"
            raise UsageError(f"{what}: {str(error) or 'time is up'}") from error
    n_workers = jobs or os.cpu_count() or 1
    if executor is ExecutorName.SERIAL or n_workers == 1:
        return executors.serial()
    return executors.processes(n_workers)
