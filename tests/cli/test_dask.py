"""`dpg sweep --executor dask` on a real scheduler with two real workers."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import dpgcli
from dpgcli.cli.exits import ExitCode
from dpgcli.sweeps.maker import HERE

pytest.importorskip("distributed")

PROGRAM = (
    sys.executable,
    "-c",
    "import dpgcli.studies.sweep as s; s.STATES_PER_CHUNK = 2**12; "
    "from dpgcli.__main__ import main; main()",
)
SWEEP = """base: eight_unit.yaml
space:
  - {key: finger.geometry.dome_height_mm, linear: {from: 2.5, to: 7, count: 30}}
  - {key: finger.geometry.unit_separation_mm, linear: {from: 2, to: 3, count: 30}}
"""
Cluster = tuple[str, list["subprocess.Popen[bytes]"]]


def until(happened: Callable[[], Any], seconds: float = 30) -> Any:
    end = time.monotonic() + seconds
    while not (found := happened()):
        assert time.monotonic() < end, "too slow"
        time.sleep(0.02)
    return found


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """The address of a scheduler on this machine, and its two workers."""
    file = tmp_path / "scheduler.json"
    common = ("--no-dashboard", "--host", "127.0.0.1", "--scheduler-file", os.fspath(file))
    environment = {**os.environ, "DASK_DISTRIBUTED__DIAGNOSTICS__NVML": "False"}

    def started(tool: str, *options: str) -> "subprocess.Popen[bytes]":
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{tool}", *options, *common],
            cwd=tmp_path,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    processes = [started("dask_scheduler", "--port", "0")]
    try:
        until(lambda: file.exists() and file.read_text().strip().endswith("}"))
        address = json.loads(file.read_text())["address"]
        place = ("--local-directory", os.fspath(tmp_path / "dask"))
        options = ("--nthreads", "1", "--no-nanny", *place)
        processes += [started("dask_worker", *options) for _ in range(2)]
        until(lambda: len(list((tmp_path / "dask").rglob("*.dirlock"))) == 2)
        yield address, processes[1:]
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait()


@pytest.fixture
def sweep(folder: Path) -> Path:
    configs = Path(__file__).parents[2] / "configs"
    (folder / "eight_unit.yaml").write_bytes((configs / "eight_unit.yaml").read_bytes())
    (folder / "sweep.yaml").write_text(SWEEP)
    return folder


def start(folder: Path, *options: str) -> "subprocess.Popen[str]":
    command = [*PROGRAM, "sweep", "sweep.yaml", "-q", *options]
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, cwd=folder, text=True, **pipes)


def on_dask(address: str) -> tuple[str, ...]:
    return ("-o", "out", "--executor", "dask", "--scheduler", address)


def tables(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.parquet")}


@pytest.mark.slow
@pytest.mark.parametrize("end", [0, signal.SIGKILL, signal.SIGTERM])
def test_the_bytes_of_a_serial_run(cluster: Cluster, sweep: Path, end: int) -> None:
    """Also when a worker is killed on the way, or closed, as batch systems have it."""
    address, workers = cluster
    process = start(sweep, *on_dask(address))
    if end:
        until(lambda: list((sweep / "out").rglob("*.part")))
        workers[0].send_signal(end)
    assert process.communicate(timeout=60) == ("", "")
    assert process.returncode == ExitCode.DONE
    serial = start(sweep, "-o", "serial", "--executor", "serial")
    assert serial.communicate(timeout=60) == ("", "")
    assert tables(sweep / "out") == tables(sweep / "serial")
    assert len(tables(sweep / "out")) == 2


@pytest.mark.slow
def test_python_leaves_nothing_open(cluster: Cluster, sweep: Path) -> None:
    """Neither sockets nor threads, however often a program sweeps, and whatever comes of it."""
    address, _ = cluster
    space = [{"key": "finger.units", "values": [1, 2]}]
    data = {"base": str(sweep / "three_unit.yaml"), "space": space}

    def left() -> tuple[int, int]:
        dpgcli.sweep(data, executor="dask", scheduler=address)
        return len(os.listdir("/proc/self/fd")), threading.active_count()  # noqa: PTH208  names

    left()  # what is opened once for all
    first = left()
    assert [left() for _ in range(3)] == [first] * 3


@pytest.mark.slow
def test_an_interrupt_on_a_cluster(cluster: Cluster, sweep: Path) -> None:
    """A plain message, a quick end, and the cluster is free for others."""
    address, _ = cluster
    long = SWEEP.replace("to: 3, count: 30", "to: 3, count: 300")  # ten times as many designs
    (sweep / "sweep.yaml").write_text(long)
    process = start(sweep, *on_dask(address))
    until(lambda: list((sweep / "out").rglob("*.part")))
    process.terminate()
    output, errors = process.communicate(timeout=30)
    assert (process.returncode, output) == (ExitCode.TERMINATED, "")
    assert len(errors.splitlines()) == 1, errors
    process = start(sweep, *on_dask(address))
    assert process.communicate(timeout=60) == ("", "")
    assert process.returncode == ExitCode.DONE


@pytest.mark.slow
def test_a_lost_scheduler_ends_the_sweep_with_a_message(cluster: Cluster, sweep: Path) -> None:
    address, _ = cluster
    process = start(sweep, *on_dask(address))
    until(lambda: list((sweep / "out").rglob("*.part")))
    scheduler = int(subprocess.check_output(["pgrep", "-P", str(os.getpid()), "-f", "dask_sched"]))
    os.kill(scheduler, signal.SIGKILL)
    output, errors = process.communicate(timeout=60)
    assert (process.returncode, output) == (ExitCode.USAGE, "")
    assert "Traceback" not in errors


@pytest.mark.slow
@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM])
def test_lost_workers_are_said_and_waited_for(cluster: Cluster, sweep: Path, end: int) -> None:
    """Not for ever; what was done is kept."""
    address, workers = cluster
    process = start(sweep, *on_dask(address), "--wait", "12s")
    until(lambda: list((sweep / "out").rglob("*.part")))
    for worker in workers:
        worker.send_signal(end)
    output, errors = process.communicate(timeout=60)
    assert (process.returncode, output) == (ExitCode.FAILED_CASES, "")
    first, second = errors.splitlines()
    assert first.endswith(f"{address}: no worker answers; waiting 12 s for one (--wait)")
    assert re.search(r"no worker for 1\d s \(--wait\)\. What is done is kept", second)
    assert list((sweep / "out").rglob("*.part"))


LOCAL = """
from distributed import LocalCluster

if __name__ == "__main__":
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with LocalCluster(**options) as cluster:
        print(cluster.scheduler_address, flush=True)
        input()
"""


@pytest.mark.slow
@pytest.mark.parametrize("attempt", range(3))
def test_a_cluster_that_closes_in_an_orderly_way(sweep: Path, attempt: int) -> None:
    """Its workers refuse what they are still sent: they are none any more, whoever is first."""
    (sweep / "sweep.yaml").write_text(SWEEP.replace("to: 3, count: 30", "to: 3, count: 3000"))
    (sweep / "local.py").write_text(LOCAL)
    pipes: dict[str, Any] = dict.fromkeys(("stdin", "stdout"), subprocess.PIPE)
    command = (sys.executable, "local.py")
    local = subprocess.Popen(command, cwd=sweep, text=True, stderr=subprocess.DEVNULL, **pipes)
    try:
        assert local.stdout is not None
        process = start(sweep, *on_dask(local.stdout.readline().strip()), "--wait", "3s")
        until(lambda: list((sweep / "out").rglob("*.part")))
        time.sleep(0.1 * attempt)
        local.communicate("\n", timeout=60)
        output, errors = process.communicate(timeout=60)
        assert process.returncode in (ExitCode.USAGE, ExitCode.FAILED_CASES), errors
        assert output == ""
        assert re.search(r"(is lost|no worker for [0-9]+ s \(--wait\))\. What is done is", errors)
        assert len(errors.splitlines()) <= 2, errors
        assert list((sweep / "out").rglob("*.part"))
    finally:
        local.kill()
        local.wait()


BARE = (
    "import sys; sys.modules['dpgcli'] = None\nfrom distributed.cli.dask_worker import main; main()"
)


@pytest.mark.slow
def test_a_worker_without_the_package_is_named(
    cluster: Cluster, sweep: Path, tmp_path: Path
) -> None:
    options = ("--nthreads", "1", "--no-nanny", "--no-dashboard")
    place = ("--local-directory", os.fspath(tmp_path / "bare"))
    bare = subprocess.Popen(
        [sys.executable, "-c", BARE, cluster[0], *options, *place],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        until(lambda: list((tmp_path / "bare").rglob("*.dirlock")))
        time.sleep(1)  # until the scheduler knows it
        process = start(sweep, *on_dask(cluster[0]))
        output, errors = process.communicate(timeout=60)
        assert (process.returncode, output) == (ExitCode.USAGE, "")
        named = r"worker tcp://127\.0\.0\.1:[0-9]+ of .* has another dpg, or none \(.*dpgcli.*\)"
        assert re.search(named, errors)
        assert len(errors.splitlines()) == 1
        assert bare.poll() is None, "asking does it no harm"
    finally:
        bare.kill()
        bare.wait()


@pytest.mark.slow
def test_a_scheduler_that_says_nothing(sweep: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        process = start(sweep, *on_dask(f"tcp://127.0.0.1:{server.getsockname()[1]}"))
        output, errors = process.communicate(timeout=60)
    assert (process.returncode, output) == (ExitCode.USAGE, "")
    assert "no scheduler or no worker answers: time is up" in errors
    assert len(errors.splitlines()) == 1


@pytest.mark.slow
def test_no_scheduler(sweep: Path) -> None:
    process = start(sweep, *on_dask("tcp://127.0.0.1:1"))
    output, errors = process.communicate(timeout=60)
    assert (process.returncode, output) == (ExitCode.USAGE, "")
    assert errors.startswith("dpg: --scheduler tcp://127.0.0.1:1: no scheduler or no worker")
    assert len(errors.splitlines()) == 1
    assert not (sweep / "out").exists()


@pytest.fixture
def add_other_worker(tmp_path: Path) -> Iterator[Callable[[str], None]]:
    """Start workers, at an address, whose package differs by one line."""
    shutil.copytree(Path(dpgcli.__file__).parent, tmp_path / "other" / "dpgcli")
    with (tmp_path / "other" / "dpgcli" / "mechanics" / "laws.py").open("a") as laws:
        laws.write("\nCHANGED = True\n")
    processes = []

    def started(address: str) -> None:
        options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
        place = ("--local-directory", os.fspath(tmp_path / "others"))
        command = (sys.executable, "-m", "distributed.cli.dask_worker", address, *options, *place)
        here = {"cwd": tmp_path / "other"}  # of all folders, modules are looked for there first
        environment = {**os.environ, "DASK_DISTRIBUTED__DIAGNOSTICS__NVML": "False"}
        pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        processes.append(subprocess.Popen(command, env=environment, **here, **pipes))
        until(lambda: len(list((tmp_path / "others").rglob("*.dirlock"))) == len(processes))

    yield started
    for process in processes:
        process.kill()
        process.wait()


def is_refused(process: "subprocess.Popen[str]") -> bool:
    output, errors = process.communicate(timeout=60)
    assert (process.returncode, output) == (ExitCode.USAGE, ""), errors
    assert len(errors.splitlines()) == 1, errors
    assert str(HERE) in errors
    return len(set(re.findall("code ([0-9a-f]{8})", errors))) == 2


@pytest.mark.slow
def test_a_mixed_cluster_is_refused(
    cluster: Cluster, sweep: Path, add_other_worker: Callable[[str], None]
) -> None:
    add_other_worker(cluster[0])
    time.sleep(1)  # until the scheduler knows it
    assert is_refused(start(sweep, *on_dask(cluster[0])))
    assert not list((sweep / "out").rglob("*.part"))


@pytest.mark.slow
def test_a_worker_that_joins_later_is_held_to_the_same(
    cluster: Cluster, sweep: Path, add_other_worker: Callable[[str], None]
) -> None:
    """What the others have done is kept, and is theirs alone."""
    address, workers = cluster
    (sweep / "sweep.yaml").write_text(SWEEP.replace("to: 3, count: 30", "to: 3, count: 600"))
    process = start(sweep, *on_dask(address))
    until(lambda: list((sweep / "out").rglob("*.part")))
    add_other_worker(address)
    for worker in workers:
        worker.kill()  # what they had under way goes to the one that came
    assert is_refused(process)
    assert list((sweep / "out").rglob("*.part"))
