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
    from dpgcli.studies.sweep import Progress, Shard, Study


class ExecutorName(StrEnum):
    """Where designs are evaluated."""

    PROCESSES = "processes"
    SERIAL = "serial"
    DASK = "dask"


def sweep(
    spec: Annotated[Path, typer.Argument(metavar="SWEEP", help="YAML file of a sweep")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the tables")],
    jobs: Annotated[
        int | None, typer.Option("-j", "--jobs", min=1, help="Processes  [default: cores]")
    ] = None,
    executor: Annotated[
        ExecutorName, typer.Option("--executor", help="Where designs are evaluated")
    ] = ExecutorName.PROCESSES,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="Of Dask: tcp://host:port")
    ] = None,
    shard: Annotated[
        str | None, typer.Option("--shard", metavar="K/N", help="Only part K of N; see merge")
    ] = None,
    settings: Settings = None,
    tolerance: Tolerance = None,
    restart: Annotated[
        bool, typer.Option("--restart", help="Drop what an unfinished sweep left")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Go on even if the disk is small")] = False,
    depfile: Annotated[
        Path | None, typer.Option("--depfile", help="Write the files read, for Make")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Evaluate every design of a space, resumably."""
    from dpgcli.files.sweep import read_sweep
    from dpgcli.states.plan import DEFAULT_TOLERANCE
    from dpgcli.studies.sweep import Study

    part = _shard(shard)
    study = Study(read_sweep(spec, settings or ()), output, tolerance or DEFAULT_TOLERANCE)
    if depfile is not None:
        _write_depfile(depfile, study)
    if study.is_up_to_date and part is None:
        say(f"{output}: up to date")
        return
    if restart:
        study.drop_unfinished()
    study.check_unfinished()
    if not force:
        study.check_room()
    progress = _computed(study, _workplace(executor, jobs, scheduler), part, quiet)
    if part is None:
        study.assemble()
        _write_run(study, progress)
    if not quiet:
        say(_summary(output, progress, part))


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

    targets = " ".join(_escaped(study.folder / name) for name in (STATES, DESIGNS))
    sources = [_escaped(source) for source in study.sweep.files]
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
        text += f"; {len(progress.failures)} failed (their worker died twice): see designs.parquet"
    if part is not None:
        text += f"; part {part.number} of {part.count}: join with dpg merge"
    return text
