"""Where work is done: in this process, by a pool of processes, or by the workers of Dask."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from dpgcli.api.arguments import check_numbers, check_texts, check_whole
from dpgcli.cores import MOST_PROCESSES, cores
from dpgcli.errors import Field, UsageError
from dpgcli.records import dataclass
from dpgcli.sweeps.guard import GUARD, OF_POOL
from dpgcli.text import quoted

if TYPE_CHECKING:
    from dpgcli.sweeps.executors import Backend

EXECUTORS = ("processes", "serial", "dask")
WAIT = 300.0  # s

Say = Callable[[str], None]


@dataclass(frozen=True)
class Place:
    """Where designs are evaluated: by how many processes, or by which Dask scheduler's workers.

    `wait` (s) is how long a worker of Dask may be waited for. Raises UsageError for what does not
    go together.
    """

    executor: str = "processes"
    jobs: int | None = None
    scheduler: str | None = None
    wait: float | None = None

    def __post_init__(self) -> None:
        check_whole(jobs=self.jobs)
        check_texts(executor=self.executor, scheduler=self.scheduler)
        check_numbers(wait=self.wait)
        dask, scheduler = Field("executor"), Field("scheduler")
        if self.executor not in EXECUTORS:
            raise UsageError(dask, f" {quoted(self.executor)}: expected {', '.join(EXECUTORS)}")
        if self.jobs is not None and not 1 <= self.jobs <= MOST_PROCESSES:
            expected = f"expected 1 process or more, {MOST_PROCESSES:,} at most"
            raise UsageError(Field("jobs"), f" {self.jobs}: {expected}")
        if self.is_sent != (self.scheduler is not None):
            raise UsageError(dask, " dask and ", scheduler, " tcp://host:port go together")
        _end_if_begun_by_us()
        if self.scheduler is not None:
            from dpgcli.sweeps import cluster

            cluster.check_address(self.scheduler)
        if self.scheduler is None and self.wait is not None:
            raise UsageError(Field("wait"), " is for the workers of ", dask, " dask")

    @property
    def is_here(self) -> bool:
        """Whether this process does it all."""
        is_alone = self.executor == "serial" or (self.jobs or cores().usable) == 1
        return is_alone and not self.is_sent

    @property
    def is_sent(self) -> bool:
        """Whether designs are sent to other machines."""
        return self.executor == "dask"

    @contextmanager
    def workplace(self, say: Say) -> Iterator["Backend"]:
        """The workers, for as long as they are needed; `say` hears of those that are waited for."""
        found = self._found(say)
        try:
            yield found
        finally:
            found.close()

    def _found(self, say: Say) -> "Backend":
        """The workers, found or about to be started."""
        if self.scheduler is not None:
            return self._cluster(self.scheduler, say)
        from dpgcli.sweeps import executors, pool

        if self.is_here:
            return executors.serial()
        _check_may_begin()
        _check_importable()
        return pool.processes(int(self.jobs or cores().usable))  # of NumPy, JSON could not say it

    def _cluster(self, scheduler: str, say: Say) -> "Backend":
        from dpgcli.sweeps import cluster

        try:
            return cluster.dask_cluster(scheduler, WAIT if self.wait is None else self.wait, say)
        except ImportError as error:
            what = " dask needs Dask: pip install distributed"
            raise UsageError(Field("executor"), what) from error
        except (OSError, ValueError) as error:
            what = f" {scheduler}: no scheduler or no worker answers"
            why = f"{what}: {str(error) or 'time is up'}"
            raise UsageError(Field("scheduler"), why) from error


def _end_if_begun_by_us() -> None:
    """End a worker of ours that is about to begin this work instead of importing its program.

    The process that waits for it says why, once for all workers. Those of others get an error.
    """
    process = sys.modules.get("multiprocessing.process")  # which is there in each of its children
    if process is None or not getattr(process.current_process(), "_inheriting", False):
        return
    if OF_POOL in os.environ:
        raise SystemExit(1)
    raise UsageError(f"this process is still importing its program: {GUARD}")


def _check_may_begin() -> None:
    """Raise UsageError where the system of processes allows this one none of its own."""
    from multiprocessing import current_process

    if current_process().daemon:
        raise UsageError(
            Field("executor"),
            " processes: this one is a worker of multiprocessing, a daemon, and may start none: "
            "take serial",
        )


def _check_importable() -> None:
    """Raise UsageError where processes cannot import the program that starts them."""
    program = sys.modules["__main__"]
    file, spec = (getattr(program, name, None) for name in ("__file__", "__spec__"))
    if spec is None and file is not None and not Path(file).exists():
        raise UsageError(
            Field("executor"),
            f" processes: each of them imports the program that starts it, and {file} is no file, "
            "as where it is read from standard input: save it in a file, or take serial",
        )
