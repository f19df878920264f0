"""Waiting for the workers of a cluster: a word in time, an end in time, and never too early."""

import time

import pytest

from dpgcli.api.place import Place
from dpgcli.errors import NoWorkerError, UsageError
from dpgcli.sweeps import cluster
from dpgcli.sweeps.cluster import WorkerWatch, check_address, dask_cluster


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
