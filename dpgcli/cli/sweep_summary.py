"""What a run of a sweep came to: times, shares of them, failures."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dpgcli.cli.exits import ExitCode, fail

if TYPE_CHECKING:
    from dpgcli.studies.sweep import Progress, Shard, Study


MOST_HELD = 6  # ranges of designs that are named


def run_facts(study: "Study", progress: "Progress", replays: Sequence[str]) -> dict[str, Any]:
    """The content of run.json; shares are of the wall time of all workers.

    By their fingerprint a report knows whether they are those of the tables beside them.
    """
    import platform

    from dpgcli.files.parts import FINGERPRINT

    core, writing, pool = _shares(progress)
    return {
        "fingerprint": study.metadata[FINGERPRINT],
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
        "command": sys.argv,
    }


def check_failed(n_failed: int, max_failed: int) -> None:
    """End the command with its exit code if more designs failed than may."""
    if n_failed > max_failed:
        designs = "design" if n_failed == 1 else "designs"
        fail(ExitCode.FAILED_CASES, f"{n_failed:,} {designs} failed; --max-failed is {max_failed}")


def run_summary(output: Path, progress: "Progress", part: "Shard | None") -> str:
    """One line for standard error."""
    new = progress.n_done - progress.n_resumed
    resumed = f", {progress.n_resumed:,} were there" if progress.n_resumed else ""
    text = (
        f"{output}: {new:,} designs, {progress.n_states:,} states "
        f"in {_seconds(progress):.3g} s ({progress.n_states / _seconds(progress):,.0f} states/s)"
        f"{resumed}"
    )
    if progress.n_states:
        core, writing, pool = (f"{100 * share:.0f} %" for share in _shares(progress))
        of = "the worker's time" if progress.n_workers == 1 else "the workers' time"
        text += f"; {core} of {of} in states, {writing} in parts, {pool} in the pool"
        text += f"; tables {progress.tables_seconds:.2g} s" if part is None else ""
    if progress.deaths:
        held = ", ".join(f"{chunk.start}-{chunk.stop - 1}" for chunk in progress.deaths[:MOST_HELD])
        more = ", ..." if len(progress.deaths) > MOST_HELD else ""
        text += f"; workers died with designs {held}{more} under way, which were evaluated again"
    if part is not None:
        text += f"; part {part.number} of {part.count}: join with dpg merge"
    return text


def _seconds(progress: "Progress") -> float:
    return max(progress.seconds + progress.tables_seconds, 1e-9)


def _shares(progress: "Progress") -> tuple[float, float, float]:
    """Of the workers' wall time: CPU time for states, for parts, and all the rest."""
    whole = max(progress.seconds * progress.n_workers, 1e-9)
    core, writing = progress.core_seconds / whole, progress.writing_seconds / whole
    return core, writing, max(1.0 - core - writing, 0.0)
