"""After SIGKILL: what it left behind goes with the next run, and nothing works on."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dpgcli.cli.exits import ExitCode

pytestmark = pytest.mark.slow
SWEEP = """base: twenty_unit.yaml
space:
  - {key: finger.linear_stiffness_N_per_mm, linear: {from: 1.0e3, to: 1.0e5, count: 20}}
constraints: [linear_stiffness_N_per_mm > 2.0e3]
"""


def until(happened: Callable[[], Any]) -> Any:
    end = time.monotonic() + 60
    while not (found := happened()):
        assert time.monotonic() < end, "too slow"
        time.sleep(0.005)
    return found


def is_running(number: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{number}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_half_a_table(start: Any, run: Any, folder: Path) -> None:
    process = start("predict", "twenty_unit.yaml", "-o", "states.parquet")
    until(lambda: any(path.stat().st_size for path in folder.glob(".states.parquet.*")))
    process.kill()
    process.wait()
    assert [path.name for path in folder.glob(".states*")] == [".states.parquet.dpg0.tmp"]
    assert run("predict", "three_unit.yaml", "-o", "states.parquet").returncode == ExitCode.DONE
    assert not list(folder.glob(".states*"))


def test_the_pool_of_a_sweep(
    start: Any,
    run: Any,
    folder: Path,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    place = tmp_path_factory.mktemp("t")
    monkeypatch.setenv("TMPDIR", os.fspath(place))
    (folder / "sweep.yaml").write_text(SWEEP)
    command = ("sweep", "sweep.yaml", "-o", "out", "-j", "2", "-q", "-s", "finger.units=5")
    process = start(*command)
    until(lambda: list(place.rglob("listener-*")))
    process.kill()
    process.wait()
    assert [path.name for path in place.iterdir()] == [f".pool{os.getuid()}.dpg0.tmp"]
    assert run(*command).returncode == ExitCode.DONE
    assert not list(place.iterdir())


@pytest.mark.skipif(not Path("/dev/shm").is_dir(), reason="semaphores have no names to be seen")
def test_the_semaphores_of_a_sweep_whose_processes_are_all_killed(
    start: Any,
    run: Any,
    folder: Path,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    place = tmp_path_factory.mktemp("t")
    monkeypatch.setenv("TMPDIR", os.fspath(place))
    (folder / "sweep.yaml").write_text(SWEEP)
    command = ("sweep", "sweep.yaml", "-o", "out", "-j", "2", "-q", "-s", "finger.units=5")
    process = start(*command, start_new_session=True)
    prefix = until(lambda: [path.name for path in place.rglob("dpg-*")])[0]
    until(lambda: list(Path("/dev/shm").glob(f"sem.{prefix}-*")))
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert list(Path("/dev/shm").glob(f"sem.{prefix}-*"))
    assert run(*command).returncode == ExitCode.DONE
    assert not list(Path("/dev/shm").glob(f"sem.{prefix}-*"))
    assert not list(place.iterdir())


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_a_solver_and_its_folder(
    start: Any, run: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With all processes that the solver has started itself."""
    solver = folder / "bin" / "ccx"
    solver.parent.mkdir()
    solver.write_text(
        "#!/bin/sh\nsleep 100 &\necho $$ $! > ../pids.part\nmv ../pids.part ../pids\nwait\n"
    )
    solver.chmod(0o755)
    monkeypatch.setenv("PATH", f"{solver.parent}{os.pathsep}{os.environ['PATH']}")
    fe = ("fe", "hinge", "three_unit.yaml", "--output", "deck", "--mesh", "coarse")
    process = start(*fe, "--run")
    until((folder / "deck" / "pids").exists)
    numbers = [int(word) for word in (folder / "deck" / "pids").read_text().split()]
    assert all(map(is_running, numbers))
    process.send_signal(signal.SIGKILL)
    process.wait()
    until(lambda: not any(map(is_running, numbers)))
    assert (folder / "deck" / ".hinge.inp.dpg0.tmp").is_dir()
    solver.write_text("#!/bin/sh\nexit 1\n")
    assert run(*fe, "--run").returncode == ExitCode.USAGE
    assert not list((folder / "deck").glob(".*"))
