"""A sweep carried out: what is refused before it, what it comes to, and words about both."""

import platform
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

from dpgcli.files.output import check_outputs
from dpgcli.files.table_writer import write_run
from dpgcli.studies.sweep import RUN, Progress, Shard, Study, drop_parts, outputs
from dpgcli.sweeps.extent import size_text, time_text
from dpgcli.text import counted

LONG = 30.0  # s of one core: what takes longer is said before
MOST_NAMED = 20  # failed designs with a command for each
MOST_HELD = 6  # ranges of designs that are named

Say = Callable[[str], None]


def run(
    study: Study,
    part: Shard | None,
    compute: Callable[[], Progress],
    *,
    restart: bool = False,
    force: bool = False,
    is_sent: bool = False,
    settings: Sequence[str] = (),
    command: Sequence[str] = (),
    warn: Say,
    tell: Say,
) -> bool:
    """Bring the folder of a study up to date, or a part of it; whether there was anything to do.

    `compute` evaluates what is missing; `is_sent` where designs are sent to other machines.
    `settings` and `command` are what it was asked for with. `warn` hears of damage and failed
    designs, `tell` how long it takes and took. Whoever calls has the folder to himself.
    Raises UsageError for what is refused, OutputError for what cannot be written.
    """
    if study.is_up_to_date and not restart:
        if part is None and study.owns_all_parts:  # what a run left that was stopped at its end
            drop_parts(study.folder)
        tell(f"{study.folder}: up to date")
        return False
    study.extent.check(study.chunk_size, is_sent=is_sent)
    if part is None:
        for path in study.damaged:
            warn(f"{path} is damaged: made again")
        check_outputs(study.sweep.files, *outputs(study.folder))
    if restart:
        study.drop_unfinished()
    study.check_unfinished()
    if not force:
        study.check_memory()
        study.check_disk()
    if study.extent.seconds > LONG:
        tell(cost(study))
    try:
        with study.store.dropped_if_empty():
            progress = compute()
    finally:  # a signal to all processes ends workers at once
        study.store.drop_half_written()
    replays = [study.replay(number, settings) for number in progress.failures[:MOST_NAMED]]
    if part is None:
        _write_tables(study, progress, replays, command)
    tell(run_summary(study.folder, progress, part))
    for replay in replays:
        warn(f"failed, its worker died twice; alone: {replay}")
    return True


def _write_tables(
    study: Study, progress: Progress, replays: Sequence[str], command: Sequence[str]
) -> None:
    """Tables come last but for their own time: finished ones say that all is there."""
    write_run(study.folder / RUN, run_facts(study, progress, replays, command))
    began = perf_counter()
    study.assemble()
    progress.tables_seconds = perf_counter() - began
    write_run(study.folder / RUN, run_facts(study, progress, replays, command))


def cost(study: Study) -> str:
    """Time, disk and memory of a sweep, in words."""
    extent = study.extent
    less = ", less what constraints exclude" if study.sweep.constraints else ""
    return (
        f"{study.folder}: {study.sweep.space.size:,} designs, {extent.n_states:,} states"
        f"{less}: about {time_text(extent.seconds)} of one core, "
        f"{size_text(extent.bytes_needed)} of disk, {size_text(extent.bytes_in_memory)} of "
        "memory (rough: a factor of two either way)"
    )


def run_facts(
    study: Study, progress: Progress, replays: Sequence[str], command: Sequence[str]
) -> dict[str, Any]:
    """The content of run.json; shares are of the wall time of all workers.

    The fingerprint says which tables they are about.
    """
    core, writing, pool = _shares(progress)
    return {
        "fingerprint": study.fingerprint,
        "designs": progress.n_designs,
        "resumed_designs": progress.n_resumed,
        "states": progress.n_states,
        "states_per_second": progress.n_states / _seconds(progress),
        "seconds": progress.seconds,
        "tables_seconds": progress.tables_seconds,
        "workers": progress.n_workers,
        "core_cpu_seconds": progress.core_seconds,
        "writing_cpu_seconds": progress.writing_seconds,
        "core_share": core,
        "writing_share": writing,
        "pool_share": pool,
        "held_by_dead_workers": [f"{c.start}-{c.stop - 1}" for c in progress.deaths],
        "failed_designs": progress.failures,
        "replay": list(replays),
        "machine": platform.machine(),
        "host": platform.node(),
        "python": platform.python_version(),
        "command": list(command),
    }


def run_summary(output: Path, progress: Progress, part: Shard | None) -> str:
    """One line for standard error."""
    new = progress.n_done - progress.n_resumed
    resumed = f", {progress.n_resumed:,} were there" if progress.n_resumed else ""
    seconds = _seconds(progress)
    pace = f"in {seconds:.3g} s ({progress.n_states / seconds:,.0f} states/s)"
    done = (
        f"{counted(new, 'design')}, {counted(progress.n_states, 'state')} {pace}"
        if new
        else "no designs left"
    )
    text = f"{output}: {done}{resumed}"
    if progress.n_states:
        core, writing, pool = (f"{100 * share:.0f} %" for share in _shares(progress))
        of = "the worker's time" if progress.n_workers == 1 else "the workers' time"
        rest = "waiting" if progress.n_workers == 1 else "in the pool"
        text += f"; {core} of {of} in states, {writing} in parts, {pool} {rest}"
        text += f"; tables {progress.tables_seconds:.2g} s" if part is None else ""
    if progress.deaths:
        held = ", ".join(f"{chunk.start}-{chunk.stop - 1}" for chunk in progress.deaths[:MOST_HELD])
        more = ", ..." if len(progress.deaths) > MOST_HELD else ""
        text += f"; workers died with designs {held}{more} under way, which were evaluated again"
    if part is not None:
        text += f"; part {part.number} of {part.count}: join with dpg merge"
    return text


def _seconds(progress: Progress) -> float:
    return max(progress.seconds + progress.tables_seconds, 1e-9)


def _shares(progress: Progress) -> tuple[float, float, float]:
    """Of the workers' wall time: CPU time for states, for parts, and all the rest."""
    whole = max(progress.seconds * progress.n_workers, 1e-9)
    core, writing = progress.core_seconds / whole, progress.writing_seconds / whole
    return core, writing, max(1.0 - core - writing, 0.0)
