"""Waiting for the workers of a cluster: a word in time, an end in time, and never too early."""

import asyncio
import time
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, CancelledError
from functools import partial
from threading import Thread
from types import SimpleNamespace
from typing import Any

import pytest

from dpgcli.api.place import Place
from dpgcli.errors import NoWorkerError, UsageError
from dpgcli.sweeps import cluster, executors
from dpgcli.sweeps.cluster import ClusterExecutor, WorkerWatch, check_address, dask_cluster
from dpgcli.sweeps.executors import Backend, Chunk, Runner, chunked


class Scene:
    """A clock, a number of workers, and what was said."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, limit: float) -> None:
        self.now, self.n_workers = 1000.0, 2
        self.said: list[str] = []
        monkeypatch.setattr(cluster, "monotonic", lambda: self.now)
        self.watch = WorkerWatch("Dask", lambda: self.n_workers, limit, self.said.append, self.now)

    def wait(self, seconds: int) -> None:
        """Look once a second while nothing comes back."""
        for second in range(1, seconds + 1):
            self.now += 1.0
            self.watch(float(second))


def test_a_missing_worker_is_said_once_and_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(monkeypatch, 60.0)
    scene.n_workers = 0
    scene.wait(9)
    assert scene.said == []
    scene.wait(51)
    assert scene.said == ["Dask: no worker answers; waiting 60 s for one (wait)"]
    with pytest.raises(NoWorkerError, match=r"Dask: no worker for 61 s \(wait\). What is done"):
        scene.wait(1)


def test_a_worker_that_comes_back_begins_the_wait_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(monkeypatch, 60.0)
    for n_said in (1, 2):
        scene.n_workers = 0
        scene.wait(50)
        scene.n_workers = 1
        scene.wait(5)
        assert len(scene.said) == n_said


def test_long_work_is_no_reason_to_give_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also when its worker is lost at the end of it."""
    scene = Scene(monkeypatch, 60.0)
    scene.wait(500)
    assert scene.said == ["Dask: nothing from any of its 2 workers for 10 s; waiting"]
    scene.n_workers = 0
    scene.now += 59.0
    scene.watch(559.0)


def test_one_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(monkeypatch, 60.0)
    scene.n_workers = 1
    scene.wait(12)
    assert scene.said == ["Dask: nothing from its worker for 10 s; waiting"]


@pytest.mark.parametrize(
    "address",
    [
        "tcp://127.0.0.1:8786",
        "localhost:8786",
        "tls://a.b-c:1/",
        "tcp://[::1]:8786",
        "wss://a:65535",
    ],
)
def test_an_address_of_a_scheduler(address: str) -> None:
    check_address(address)


@pytest.mark.parametrize(
    ("address", "form"),
    [
        ("localhost", "tcp://host:port, such as tcp://localhost:8786"),
        ("tcp://localhost", "tcp://host:port, such as tcp://localhost:8786"),
        ("tls://node7", "tls://host:port, such as tls://node7:8786"),
        ("http://localhost:8787", "tcp://host:port, such as tcp://localhost:8786"),
        ("ucx://node7:8786", "tcp://host:port, such as tcp://node7:8786"),
        ("tcp://localhost:0", "tcp://host:port, such as tcp://localhost:8786"),
        ("tcp://localhost:65536", "tcp://host:port, such as tcp://localhost:8786"),
        ("localhost:8787/status", "tcp://host:port"),
        ("tcp://:8786", "tcp://host:port"),
        ("two words:8786", "tcp://host:port"),
        ("", "tcp://host:port"),
    ],
)
def test_what_is_none_is_told_the_form_that_works(address: str, form: str) -> None:
    with pytest.raises(UsageError) as refused:
        check_address(address)
    assert str(refused.value) == f"scheduler {address}: expected {form}"


@pytest.mark.parametrize("scheme", ["tls", "wss"])
def test_secret_schemes_need_keys(monkeypatch: pytest.MonkeyPatch, scheme: str) -> None:
    pytest.importorskip("distributed")
    began = time.monotonic()
    with pytest.raises(
        UsageError, match="expected keys of Dask in DASK_DISTRIBUTED__COMM__TLS__CA"
    ):
        dask_cluster(f"{scheme}://127.0.0.1:8786", 1.0, print)
    import dask

    names = ("ca-file", "client.cert", "client.key")
    keys = {f"distributed.comm.tls.{name}": "/nowhere/k.pem" for name in names}
    with (
        dask.config.set(keys),
        pytest.raises(UsageError, match=r"Dask's keys: .*No such file"),
    ):
        dask_cluster(f"{scheme}://127.0.0.1:8786", 1.0, print)
    assert time.monotonic() - began < cluster.PATIENCE, "nothing was waited for"


def test_a_host_without_an_address_is_not_waited_for() -> None:
    pytest.importorskip("distributed")
    began = time.monotonic()
    with pytest.raises(OSError, match=r"\[Errno"):
        dask_cluster("tcp://nohost.invalid:8786", 1.0, print)
    assert time.monotonic() - began < cluster.PATIENCE


class Client:
    """A client of Dask whose scheduler has so many workers of two threads."""

    def __init__(self, n_workers: int) -> None:
        self.n_workers, self.is_closed = n_workers, False

    def nthreads(self, **_: float) -> dict[str, int]:
        return {str(place): 2 for place in range(self.n_workers)}

    def close(self) -> None:
        self.is_closed = True


@pytest.mark.parametrize("n_workers", [0, 3])
def test_a_client_is_closed_however_it_ends(
    monkeypatch: pytest.MonkeyPatch, n_workers: int
) -> None:
    pytest.importorskip("distributed")
    client = Client(n_workers)
    monkeypatch.setattr(cluster, "_client", lambda _: client)
    monkeypatch.setattr(cluster, "PERIOD", 0.001)
    place = Place("dask", scheduler="tcp://127.0.0.1:8786", wait=0.01)
    error = RuntimeError if n_workers else NoWorkerError
    with pytest.raises(error), place.workplace(print) as found:
        assert found.n_workers == 2 * n_workers
        assert not client.is_closed
        raise RuntimeError
    assert client.is_closed


class Work:
    """A future of Dask: what is asked of a worker is done here, or `closing` is raised instead."""

    def __init__(self, work: Any, closing: BaseException | None) -> None:
        self.work, self.closing, self.is_released = work, closing, False

    def __await__(self) -> Iterator[None]:
        yield from asyncio.sleep(0).__await__()
        if self.closing is not None:
            raise self.closing
        return self.work()

    def release(self) -> None:
        self.is_released = True


class Workers:
    """A client of Dask; `closing` are what it raises of the first tasks, None where they go on."""

    def __init__(self, running: asyncio.AbstractEventLoop) -> None:
        self.closing, self.asked, self.status = (
            list[BaseException | None](),
            list[Work](),
            "running",
        )

        def call(function: Any, *arguments: Any) -> None:
            asyncio.run_coroutine_threadsafe(function(*arguments), running)

        self.loop: Any = SimpleNamespace(add_callback=call)

    def submit(self, function: Any, *arguments: Any, pure: bool, retries: int) -> Work:
        if self.status == "closed":
            raise OSError("Client is closed")
        assert not pure
        assert retries > 1, "another worker may be sound"
        work = Work(partial(function, *arguments), self.closing.pop(0) if self.closing else None)
        self.asked.append(work)
        return work


@pytest.fixture
def client() -> Iterator[Workers]:
    running = asyncio.new_event_loop()
    thread = Thread(target=running.run_forever)
    thread.start()
    yield Workers(running)
    running.call_soon_threadsafe(running.stop)
    thread.join()
    running.close()


CLOSING = "cannot schedule new futures after shutdown"


def squares(chunk: Chunk) -> list[int]:
    return [case**2 for case in range(chunk.start, chunk.stop)]


def refused() -> None:
    raise RuntimeError(CLOSING)


def test_work_is_done_by_dask_and_let_go(client: Workers) -> None:
    assert ClusterExecutor(client).submit(pow, 2, 5).result(timeout=10) == 32
    assert client.asked[0].is_released


def test_errors_of_the_work_are_no_errors_of_workers(client: Workers) -> None:
    """Though they read like those of one that closes; where they came from is kept."""
    with pytest.raises(RuntimeError, match=CLOSING) as raised:
        ClusterExecutor(client).submit(refused).result(timeout=10)
    assert not isinstance(raised.value, BrokenExecutor)
    assert "in refused" in raised.value.__notes__[0]


@pytest.mark.parametrize(
    ("raised", "seen"),
    [
        (RuntimeError(CLOSING), BrokenExecutor),
        (CancelledError("scheduler-connection-lost"), CancelledError),
        (ModuleNotFoundError("dpgcli"), ModuleNotFoundError),
    ],
)
def test_errors_of_dask(client: Workers, raised: Exception, seen: type[Exception]) -> None:
    """A worker that closes is a broken one; what nobody has any more is lost."""
    client.closing.append(raised)
    with pytest.raises(seen):
        ClusterExecutor(client).submit(pow, 2, 5).result(timeout=10)


def test_a_client_that_is_closed_has_lost_its_cluster(client: Workers) -> None:
    client.status = "closed"
    with pytest.raises(CancelledError, match="Client is closed"):
        ClusterExecutor(client).submit(pow, 2, 5)


def test_what_is_called_off_is_let_go(client: Workers) -> None:
    """And may still be done."""
    waiting = list[Any]()
    client.loop.add_callback = lambda *call: waiting.append(call)
    future = ClusterExecutor(client).submit(pow, 2, 5)
    assert future.cancel()
    assert client.asked[0].is_released
    ((function, *arguments),) = waiting
    asyncio.run(function(*arguments))
    assert future.cancelled()


def test_what_a_worker_had_that_closed_is_done_by_others(
    client: Workers, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While all are closing a little time is left to them."""
    slept = list[float]()
    monkeypatch.setattr(executors, "sleep", slept.append)
    client.closing += [None, *[RuntimeError(CLOSING)] * 3]
    workplace = Backend("Dask", lambda _: ClusterExecutor(client), 1, is_local=False)
    runner = Runner(workplace, squares, lambda chunk: (chunk,))
    values = {found.chunk.start: found.value for found in runner.run(chunked([(0, 4)], 2))}
    assert values == {0: [0, 1], 2: [4, 9]}
    assert Chunk(2, 4) in runner.deaths
    assert slept == [executors.PERIOD] * 2
