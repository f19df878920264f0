"""Waiting for the workers of a cluster: a word in time, an end in time, and never too early."""

import pytest

from dpgcli.errors import NoWorkerError
from dpgcli.sweeps import cluster
from dpgcli.sweeps.cluster import Watch


class Scene:
    """A clock, a number of workers, and what was said."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, limit: float) -> None:
        self.now, self.n_workers = 1000.0, 2
        self.said: list[str] = []
        monkeypatch.setattr(cluster, "monotonic", lambda: self.now)
        self.watch = Watch("Dask", lambda: self.n_workers, limit, self.said.append, self.now)

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
