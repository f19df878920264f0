"""Chunks at a workplace: every case once, whatever dies."""

import errno
import gc
import importlib
import os
import resource
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from concurrent.futures import process as process_module
from multiprocessing import forkserver, get_context
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dpgcli.errors import WorkplaceError
from dpgcli.sweeps import executors
from dpgcli.sweeps.executors import Backend, Chunk, Runner, chunked, serial
from dpgcli.sweeps.pool import _own_temporary_folder, process_pool, processes


@pytest.fixture
def deadly() -> Iterator[Any]:
    """Functions that worker processes can import too."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(Path(__file__).parent)
        yield importlib.import_module("deadly")


def results(runner: "Runner[Any]", chunks: Iterator[Chunk]) -> dict[int, Any]:
    """Values by case; every case must come once."""
    values: dict[int, Any] = {}
    for result in runner.run(chunks):
        cases = range(result.chunk.start, result.chunk.stop)
        assert values.keys().isdisjoint(cases)
        values |= dict.fromkeys(cases) if result.value is None else {}
        values |= dict(zip(cases, result.value or (), strict=False))
    return values


@given(st.lists(st.integers(1, 9), min_size=1, max_size=8), st.integers(1, 7))
def test_chunks_cover_what_is_missing_and_are_cut_at_fixed_places(
    lengths: list[int], size: int
) -> None:
    missing, here = [], 0
    for length in lengths:
        missing.append((here, here + length))
        here += length + 2
    chunks = list(chunked(missing, size))
    cases = [case for chunk in chunks for case in range(chunk.start, chunk.stop)]
    assert cases == [case for start, stop in missing for case in range(start, stop)]
    assert all(c.start // size == (c.stop - 1) // size for c in chunks)


@pytest.mark.parametrize("workplace", [serial(), processes(1), processes(3)])
def test_nothing_dies(deadly: Any, tmp_path: Path, workplace: Backend) -> None:
    runner = Runner(workplace, deadly.squares, deadly.arguments(tmp_path))
    assert results(runner, chunked([(0, 20)], 3)) == {case: case**2 for case in range(20)}
    assert runner.deaths == []


def test_a_worker_that_dies_once_costs_nothing(deadly: Any, tmp_path: Path) -> None:
    runner = Runner(processes(2), deadly.squares, deadly.arguments(tmp_path, once=[7]))
    assert results(runner, chunked([(0, 20)], 4)) == {case: case**2 for case in range(20)}
    assert Chunk(4, 8) in runner.deaths


@pytest.mark.slow
def test_a_worker_that_starts_while_the_pool_breaks_is_not_waited_for(
    deadly: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It escapes the end of the others, and was once waited for without end: it is ended, too."""
    pool, late = process_pool(2), list[Any]()
    spawn, started = ProcessPoolExecutor._spawn_process, threading.Event()
    manager = process_module._ExecutorManagerThread
    join = manager.join_executor_internals

    def spawn_late(self: Any) -> None:
        known, self._processes = self._processes, {}
        spawn(self)
        late.extend(self._processes.values())
        began = time.monotonic()
        while not self._broken and time.monotonic() - began < 5.0:
            time.sleep(0.01)
        time.sleep(0.2)  # those that are known have been ended
        known.update(self._processes)
        self._processes = known
        started.set()

    def join_later(self: Any) -> None:
        started.wait(10.0)
        join(self)

    pool.submit(deadly.dies)
    monkeypatch.setattr(ProcessPoolExecutor, "_spawn_process", spawn_late)
    monkeypatch.setattr(manager, "join_executor_internals", join_later)
    pool.submit(os.getpid)
    ending = threading.Thread(target=pool.shutdown, daemon=True)
    ending.start()
    ending.join(20.0)
    assert not ending.is_alive()
    (exit_code,) = (process.exitcode for process in late)
    assert exit_code in (-signal.SIGTERM, -signal.SIGKILL)  # the latter if it was the one that died


def test_a_pool_that_breaks_while_it_starts_a_worker_is_broken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its pipes are closed under the start: that is no lack of processes."""
    pool = process_pool(1)

    def spawn(self: Any) -> None:
        self._broken = "a worker died"
        raise OSError("handle is closed")

    monkeypatch.setattr(ProcessPoolExecutor, "_spawn_process", spawn)
    with pytest.raises(BrokenExecutor, match="while another was started"):
        pool.submit(os.getpid)
    pool.shutdown()


def test_a_case_that_always_kills_is_alone_in_failing(deadly: Any, tmp_path: Path) -> None:
    runner = Runner(processes(2), deadly.squares, deadly.arguments(tmp_path, always=[5]))
    found = results(runner, chunked([(0, 12)], 4))
    assert found == {case: None if case == 5 else case**2 for case in range(12)}
    assert len((tmp_path / "5").read_text()) >= 2, "retried at least once"


def test_several_die_at_once(deadly: Any, tmp_path: Path) -> None:
    given = deadly.arguments(tmp_path, always=[0, 3], once=[4, 9])
    found = results(Runner(processes(3), deadly.squares, given), chunked([(0, 12)], 2))
    assert found == {case: None if case in (0, 3) else case**2 for case in range(12)}


@pytest.mark.slow
def test_workers_that_always_die_end_the_run(deadly: Any, tmp_path: Path) -> None:
    """Then it is not the cases' fault, and none of them is reported as failed."""
    runner = Runner(processes(2), deadly.squares, deadly.arguments(tmp_path, always=range(64)))
    found = []
    with pytest.raises(WorkplaceError, match=r"17 cases in a row .* is there memory enough"):
        found += runner.run(chunked([(0, 64)], 8))
    assert found == []


def test_a_few_cases_that_all_kill_are_failures(deadly: Any, tmp_path: Path) -> None:
    runner = Runner(processes(2), deadly.squares, deadly.arguments(tmp_path, always=range(3)))
    assert results(runner, chunked([(0, 3)], 2)) == dict.fromkeys(range(3))


def test_a_worker_that_dies_as_it_is_tried_is_tried_again(
    deadly: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever kills workers from outside may hit that one, too."""
    monkeypatch.setattr(executors, "PERIOD", 0.01)
    opened = []

    def fragile(n_workers: int) -> ProcessPoolExecutor:
        opened.append(n_workers)
        doomed = deadly.dies if len(opened) in (2, 3) else None
        return ProcessPoolExecutor(n_workers, get_context("forkserver"), initializer=doomed)

    workplace = Backend("the pool", fragile, 2)
    runner = Runner(workplace, deadly.squares, deadly.arguments(tmp_path, once=[4]))
    assert results(runner, chunked([(0, 12)], 3)) == {case: case**2 for case in range(12)}
    assert opened[:4] == [2, 1, 1, 1]


def test_workers_that_do_not_start(
    deadly: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(executors, "PERIOD", 0.01)

    def broken(n_workers: int) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(n_workers, get_context("forkserver"), initializer=deadly.dies)

    workplace = Backend("the pool", broken, 2)
    runner = Runner(workplace, deadly.squares, deadly.arguments(tmp_path))
    with pytest.raises(WorkplaceError, match="the pool: workers do not start"):
        list(runner.run(chunked([(0, 20)], 3)))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("workplace", [serial(), processes(2)])
def test_an_error_of_the_function_is_raised(deadly: Any, workplace: Backend) -> None:
    runner: Runner[int] = Runner(workplace, deadly.refused, lambda c: (c,))
    with pytest.raises(ZeroDivisionError, match="of its own"):
        list(runner.run(chunked([(0, 9)], 1)))


def test_processes_are_other_processes(deadly: Any) -> None:
    runner: Runner[int] = Runner(processes(2), deadly.process_id, lambda c: (c,))
    numbers = {result.value for result in runner.run(chunked([(0, 8)], 1))}
    assert os.getpid() not in numbers
    assert len(numbers) <= 2


def test_few_chunks_are_under_way_at_a_time(deadly: Any, tmp_path: Path) -> None:
    """A space may be far larger than memory: chunks are made when they are needed."""
    made = []

    def arguments(chunk: Chunk) -> Any:
        made.append(chunk)
        return deadly.arguments(tmp_path)(chunk)

    runner = Runner(processes(2), deadly.squares, arguments)
    running = runner.run(chunked([(0, 100)], 1))
    next(running)
    assert len(made) <= 2 * 2 + 2
    running.close()


def test_a_reader_that_stops_early_leaves_no_thread_behind(deadly: Any, tmp_path: Path) -> None:
    running = Runner(processes(2), deadly.squares, deadly.arguments(tmp_path)).run(
        chunked([(0, 50)], 1)
    )
    next(running)
    running.close()
    for thread in threading.enumerate():
        if thread is not threading.main_thread():
            thread.join(timeout=10)
            assert not thread.is_alive()


@pytest.mark.parametrize(("n_times", "ends_well"), [(1, True), (99, False)])
def test_a_fork_server_that_is_killed_is_started_again(
    deadly: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, n_times: int, ends_well: bool
) -> None:
    """Just after it has been looked at, and before it is asked for a worker."""
    server: Any = vars(forkserver)["_forkserver"]
    killed = []

    def unlucky(n_workers: int) -> Any:
        pool = process_pool(n_workers)
        monkeypatch.undo()
        if len(killed) < n_times:
            killed.append(server._forkserver_pid)
            os.kill(killed[-1], signal.SIGKILL)
            os.waitid(os.P_PID, killed[-1], os.WEXITED | os.WNOWAIT)
            monkeypatch.setattr(server, "ensure_running", lambda: None)
        return pool

    workplace = Backend("the pool", unlucky, 2)
    runner = Runner(workplace, deadly.squares, deadly.arguments(tmp_path))
    if ends_well:
        assert results(runner, chunked([(0, 12)], 3)) == {case: case**2 for case in range(12)}
    else:
        with pytest.raises(WorkplaceError, match=r"do not start \(the fork server is gone\)"):
            list(runner.run(chunked([(0, 12)], 3)))
    assert killed


def test_a_system_that_allows_no_more_processes(deadly: Any, tmp_path: Path) -> None:
    runner = Runner(processes(2), deadly.squares, deadly.arguments(tmp_path))
    process_pool(1).shutdown()  # what is started once is there
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    with pytest.raises(WorkplaceError, match="start a process: Too many open files"):
        try:
            n_open = len(list(Path("/dev/fd").iterdir()))
            resource.setrlimit(resource.RLIMIT_NOFILE, (n_open + 9, limits[1]))
            list(runner.run(chunked([(0, 12)], 3)))
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, limits)


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.EROFS, "Read-only file system"),
        PermissionError(errno.EACCES, "Permission denied"),
        ImportError("This platform lacks a functioning sem_open implementation"),
        NotImplementedError("system provides too few semaphores"),
    ],
)
def test_a_system_without_semaphores_is_named(
    monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("multiprocessing.synchronize._multiprocessing.SemLock", refused)
    why = getattr(error, "strerror", None) or str(error)
    with pytest.raises(WorkplaceError) as said:
        processes(2).make(2)
    assert str(said.value) == (
        f"workers cannot be started: {why}, for semaphores (/dev/shm on Linux). "
        "Without workers: jobs 1"
    )


def test_an_interrupt_while_a_pool_is_made_leaves_no_semaphore(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made, gone = set[str](), set[str]()

    def interrupted(name: str, _: str) -> None:
        made.add(name)
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr("multiprocessing.resource_tracker.register", interrupted)
    monkeypatch.setattr("multiprocessing.resource_tracker.unregister", lambda n, _: gone.add(n))
    with pytest.raises(KeyboardInterrupt):
        process_pool(1)
    gc.collect()
    assert made
    assert gone == made


def test_a_system_without_a_place_for_sockets_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused() -> str:
        raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found")

    _own_temporary_folder.cache_clear()
    monkeypatch.setattr("tempfile.gettempdir", refused)
    with pytest.raises(WorkplaceError, match=r"No usable temporary directory found\. Without work"):
        processes(2).make(2)
