"""Where chunks of work run: one seam, `concurrent.futures.Executor`, and what to do if it breaks.

A chunk is a range of cases. A worker that dies takes a whole process pool with it; then the
chunks that were under way are tried once more, each alone in a pool of its own. A chunk that
kills its worker again is halved, until the one case that kills is alone: it is reported as
failed, and everything else goes on.
"""

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Generic, TypeVar

T = TypeVar("T")
Arguments = Callable[["Chunk"], tuple[Any, ...]]

UNDER_WAY_PER_WORKER = 2  # keeps workers busy and memory bounded


@dataclass(frozen=True)
class Chunk:
    """Cases start … stop − 1."""

    start: int
    stop: int

    @property
    def is_single(self) -> bool:
        return self.stop - self.start == 1

    def halves(self) -> "tuple[Chunk, Chunk]":
        """The chunk cut in two."""
        middle = (self.start + self.stop) // 2
        return Chunk(self.start, middle), Chunk(middle, self.stop)


def chunked(missing: Iterable[tuple[int, int]], size: int) -> Iterator[Chunk]:
    """Ranges of cases cut at the multiples of `size`, so that chunks are the same in any order.

    >>> [(c.start, c.stop) for c in chunked([(0, 5), (7, 8)], 4)]
    [(0, 4), (4, 5), (7, 8)]
    """
    for start, stop in missing:
        first = start
        while first < stop:
            last = min(stop, (first // size + 1) * size)
            yield Chunk(first, last)
            first = last


@dataclass(frozen=True)
class Result(Generic[T]):
    """What came of a chunk; no value where its single case killed every worker it met."""

    chunk: Chunk
    value: T | None


@dataclass
class Runner(Generic[T]):
    """Runs a function of each chunk's arguments at a workplace.

    `deaths` gathers the chunks that were under way when a worker died.
    """

    workplace: "Workplace"
    function: Callable[..., T]
    arguments: Arguments
    deaths: list[Chunk] = field(default_factory=list)

    def run(self, chunks: Iterable[Chunk]) -> Iterator[Result[T]]:
        """Results as they are done, in no order."""
        waiting = deque(chunks)
        while waiting:
            suspects = yield from self._run_until_broken(waiting)
            for chunk in suspects:
                yield from self._run_alone(chunk)

    def _run_until_broken(self, waiting: deque[Chunk]) -> Generator[Result[T], None, list[Chunk]]:
        """Work off `waiting`; return the chunks that were under way when a worker died."""
        executor = self.workplace.make(self.workplace.n_workers)
        under_way: dict[Future[T], Chunk] = {}
        try:
            while waiting or under_way:
                while waiting and len(under_way) < UNDER_WAY_PER_WORKER * self.workplace.n_workers:
                    future = executor.submit(self.function, *self.arguments(waiting[0]))
                    under_way[future] = waiting.popleft()
                for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                    value = future.result()
                    yield Result(under_way.pop(future), value)
        except self.workplace.broken:
            self.deaths += under_way.values()
        finally:
            for future in under_way:
                future.cancel()
            executor.shutdown(wait=False)
        return list(under_way.values())

    def _run_alone(self, chunk: Chunk) -> Iterator[Result[T]]:
        """A chunk that may be to blame, in a pool of its own; halved if it is."""
        executor = self.workplace.make(1)
        try:
            value = executor.submit(self.function, *self.arguments(chunk)).result()
        except self.workplace.broken:
            if chunk.is_single:
                yield Result(chunk, None)
                return
            for half in chunk.halves():
                yield from self._run_alone(half)
        else:
            yield Result(chunk, value)
        finally:
            executor.shutdown(wait=False)


@dataclass(frozen=True)
class Workplace:
    """Where to run: how to make an executor of n workers, how many, and how it says it broke."""

    make: Callable[[int], Executor]
    n_workers: int
    broken: tuple[type[BaseException], ...] = (BrokenExecutor,)


def serial() -> Workplace:
    """This process."""
    return Workplace(lambda _: SerialExecutor(), 1)


def processes(n_workers: int) -> Workplace:
    """A pool of processes on this machine."""
    return Workplace(process_pool, n_workers)


def dask_cluster(scheduler: str) -> Workplace:
    """The workers of a Dask cluster; raises OSError where no scheduler answers."""
    from distributed import Client, KilledWorker

    client = Client(scheduler, timeout=10, set_as_default=False)
    n_threads = sum(client.nthreads().values())
    executor = partial(client.get_executor, pure=False)
    return Workplace(lambda _: executor(), max(n_threads, 1), (BrokenExecutor, KilledWorker))


class SerialExecutor(Executor):
    """Runs what is submitted at once, in this process."""

    def submit(self, fn, /, *args, **kwargs):  # type: ignore[no-untyped-def]
        """Call and keep the result or the exception."""
        future: Future[object] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def process_pool(n_workers: int) -> Executor:
    """A pool of fresh processes: BLAS on one thread, deaf to Ctrl-C, gone with their parent."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    context = get_context("forkserver" if os.name == "posix" else "spawn")
    return ProcessPoolExecutor(n_workers, mp_context=context, initializer=_start_worker)


def _start_worker() -> None:
    import signal
    import threading

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A killed parent cannot end its workers; they would wait for work forever."""
    from multiprocessing import parent_process
    from multiprocessing.connection import wait as wait_for

    parent = parent_process()
    if parent is not None:
        wait_for([parent.sentinel])
        os._exit(1)
