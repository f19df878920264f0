"""Chunks of work on any `concurrent.futures.Executor`, and recovery when a worker dies.

A chunk is a range of cases. A worker that dies takes a whole process pool with it; then the
chunks that were under way are tried once more, each alone in a pool of its own. A chunk that
kills its worker again is halved, until the one case that kills is alone: it is reported as
failed, and everything else goes on. If nothing but failures comes back, it is not the cases:
the run gives up.
"""

import os
from collections import deque
from collections.abc import Callable, Collection, Generator, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    wait,
)
from contextlib import contextmanager
from dataclasses import field
from time import monotonic, sleep
from typing import Any, Generic, ParamSpec, TypeVar

from dpgcli.errors import WorkplaceError
from dpgcli.records import dataclass

T = TypeVar("T")
R = TypeVar("R")
P = ParamSpec("P")
Arguments = Callable[["Chunk"], tuple[Any, ...]]

UNDER_WAY_PER_WORKER = 2  # keeps workers busy and memory bounded
TRIALS = 3  # workers that must fail to do nothing before none is believed to start
MOST_FAILURES_IN_A_ROW = 16  # more than that, and the workplace is to blame
PERIOD = 1.0  # s, of looking after a workplace while nothing comes back
GO_ON = "What is done is kept, and the same command goes on from there."


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
    """The result of a chunk; no value where its single case killed every worker it met."""

    chunk: Chunk
    value: T | None


@dataclass
class Runner(Generic[T]):
    """Runs a function of each chunk's arguments at a workplace.

    `deaths` gathers the chunks that were under way when a worker died.
    """

    workplace: "Backend"
    function: Callable[..., T]
    arguments: Arguments
    deaths: list[Chunk] = field(default_factory=list)

    def run(self, chunks: Iterable[Chunk]) -> Iterator[Result[T]]:
        """Results as they are done, in no order.

        Raises WorkplaceError where no worker can work or all are lost. Failures are held back
        until something succeeds after them: a workplace to blame leaves none.
        """
        failures: list[Result[T]] = []
        for result in self._results(chunks):
            if result.value is not None:
                yield from failures
                failures.clear()
                yield result
                continue
            failures.append(result)
            if len(failures) > MOST_FAILURES_IN_A_ROW:
                raise WorkplaceError(
                    f"{len(failures)} cases in a row killed their workers, from case "
                    f"{failures[0].chunk.start} on: is there memory enough? {GO_ON}"
                )
        yield from failures

    def _results(self, chunks: Iterable[Chunk]) -> Iterator[Result[T]]:
        waiting = deque(chunks)
        while waiting:
            suspects = yield from self._run_until_broken(waiting)
            if suspects or waiting:  # it broke
                self._check_that_a_worker_starts()
            for chunk in suspects:
                yield from self._run_alone(chunk)

    def _run_until_broken(self, waiting: deque[Chunk]) -> Generator[Result[T], None, list[Chunk]]:
        """Work off `waiting`; return the chunks that were under way when a worker died."""
        n_workers = self.workplace.n_workers
        under_way: dict[Future[T], Chunk] = {}
        with self._open(n_workers) as executor:
            try:
                while waiting or under_way:
                    while waiting and len(under_way) < UNDER_WAY_PER_WORKER * n_workers:
                        future = executor.submit(self.function, *self.arguments(waiting[0]))
                        under_way[future] = waiting.popleft()
                    for future in self._done(under_way):
                        value = future.result()
                        yield Result(under_way.pop(future), value)
            except self.workplace.broken:
                self.deaths += under_way.values()
            finally:
                for future in under_way:
                    future.cancel()
        return list(under_way.values())

    def _done(self, futures: Collection[Future[Any]]) -> set[Future[Any]]:
        """Wait for the first results, looking after the workers meanwhile."""
        began = monotonic()
        while not (done := wait(futures, PERIOD, FIRST_COMPLETED).done):
            self.workplace.watch(monotonic() - began)
        return done

    def _run_alone(self, chunk: Chunk) -> Iterator[Result[T]]:
        """A chunk that may be to blame, in a pool of its own; halved if it is."""
        try:
            with self._open(1) as executor:
                future = executor.submit(self.function, *self.arguments(chunk))
                self._done([future])
                value = future.result()
        except self.workplace.broken:
            if chunk.is_single:
                yield Result(chunk, None)
                return
            for half in chunk.halves():
                yield from self._run_alone(half)
        else:
            yield Result(chunk, value)

    def _check_that_a_worker_starts(self) -> None:
        """Start a worker, up to three attempts."""
        for is_last in (*(False,) * (TRIALS - 1), True):
            try:
                with self._open(1) as executor:
                    trial = executor.submit(os.getpid)
                    self._done([trial])
                    trial.result()
            except self.workplace.broken as error:
                if is_last:
                    why = str(error) or type(error).__name__
                    name, hint = self.workplace.name, self.workplace.hint
                    said = f"{name}: workers do not start ({why.rstrip('.')}){hint}. {GO_ON}"
                    raise WorkplaceError(said) from error
                sleep(PERIOD)  # until a worker that is closing has gone
            else:
                return

    @contextmanager
    def _open(self, n_workers: int) -> Iterator[Executor]:
        executor = self.workplace.make(n_workers)
        try:
            with self.workplace.reached():
                yield executor
        finally:
            executor.shutdown(wait=self.workplace.is_local)


@dataclass(frozen=True)
class Backend:
    """A backend: a function that makes an executor of n workers, and their number.

    `is_local` says that workers see this machine's files. `broken` is what an executor raises
    when a worker dies, `lost` when there is nobody left to ask. `ask` puts a question to each
    worker that may be of another installation: what it returns or raises, by the worker's name.
    `watch` is called with the seconds for which nothing has come back, and may raise
    WorkplaceError. `close` ends what was opened to reach the workers; `hint` is said where none
    starts.
    """

    name: str
    make: Callable[[int], Executor]
    n_workers: int
    is_local: bool = True
    broken: tuple[type[BaseException], ...] = (BrokenExecutor,)
    lost: tuple[type[BaseException], ...] = ()
    ask: Callable[[Callable[[], Any]], dict[str, Any]] = lambda _: {}
    watch: Callable[[float], None] = lambda _: None
    close: Callable[[], object] = lambda: None
    hint: str = ""

    @contextmanager
    def reached(self) -> Iterator[None]:
        """Have it said that the workplace is lost: WorkplaceError from what is raised then."""
        try:
            yield
        except self.lost as error:
            raise WorkplaceError(f"{self.name} is lost. {GO_ON}") from error


def serial() -> Backend:
    """This process."""
    return Backend("this process", lambda _: SerialExecutor(), 1)


class SerialExecutor(Executor):
    """Runs what is submitted at once, in this process."""

    def submit(self, fn: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> Future[R]:
        """Call and keep the result or the exception."""
        future: Future[R] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future
