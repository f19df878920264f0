"""The process that workers are forked from, and its tracker: early, forks of the program itself."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from dpgcli.sweeps import pool

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/cmdline").exists(), reason="needs /proc to look at processes"
)

# prints whether server and tracker go on from here, whether a module is loaded here and in a
# worker, and whether a file of ours is open in the server
PROGRAM = """
import os, signal, sys, threading
from multiprocessing import forkserver, resource_tracker
from pathlib import Path
from dpgcli.__main__ import answer_stops
from dpgcli.sweeps import pool

ENDING, N_THREADS = sys.argv[1:]
answer_stops()
for _ in range(int(N_THREADS)):
    threading.Thread(target=threading.Event().wait, daemon=True).start()
lasts, held = os.pipe()
pool.start_fork_server("colorsys")
server = forkserver._forkserver._forkserver_pid
tracker = resource_tracker._resource_tracker._pid
numbers = (server, tracker, os.getpid())
commands = {Path(f"/proc/{number}/cmdline").read_bytes() for number in numbers}
os.kill(tracker, signal.SIGINT)  # it is used by what comes, and would be missed
workers = pool.process_pool(1)
loaded = workers.submit(eval, "'colorsys' in __import__('sys').modules").result()
workers.shutdown()
files = {os.readlink(f"/proc/{server}/fd/{name}") for name in os.listdir(f"/proc/{server}/fd")}
is_open = os.readlink(f"/proc/self/fd/{held}") in files
print(len(commands) == 1, "colorsys" in sys.modules, loaded, is_open, flush=True)
if ENDING == "SIGTERM":
    os.kill(server, signal.SIGTERM)
    _, status = os.waitpid(server, 0)
    print(os.waitstatus_to_exitcode(status))
else:
    os.kill(server, getattr(signal, ENDING))
    os.kill(os.getpid(), signal.SIGKILL)
"""


def said(ending: str, n_threads: int) -> tuple[list[str], str]:
    """Words and complaints of the program; none of its processes outlives it, or this waits."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, ending, str(n_threads)],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    return done.stdout.split(), done.stderr


def test_it_goes_on_from_the_program_and_ends_with_it() -> None:
    """What was imported is not imported again, no file stays open, and Ctrl-C is for neither."""
    assert said("SIGINT", 0) == (["True", "True", "True", "False"], "")


def test_it_is_terminated_without_a_word() -> None:
    words, complaint = said("SIGTERM", 0)
    assert words == ["True", "True", "True", "False", str(-signal.SIGTERM)]
    assert complaint == ""


def test_beside_other_threads_it_is_a_new_interpreter() -> None:
    """These may hold locks, which nobody would open in a fork."""
    assert said("SIGINT", 1)[0] == ["False", "False", "True", "False"]


def test_semaphores_go_with_the_folder_that_names_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And no others, whatever a folder is said to name."""
    place, folder = tmp_path / "shm", tmp_path / "f"
    for name in ("sem.dpg-0123abcd-x", "sem.dpg-99999999-x", "sem.mp-a", "sem.dpg-0123abcd"):
        place.mkdir(exist_ok=True)
        (place / name).touch()
    monkeypatch.setattr(pool, "SEMAPHORES", place)
    folder.mkdir()
    for name in ("dpg-0123abcd", "dpg-*", "*", "listener-1"):
        (folder / name).touch()
    pool._drop_orphan(folder)
    assert not folder.exists()
    assert sorted(path.name for path in place.iterdir()) == [
        "sem.dpg-0123abcd",
        "sem.dpg-99999999-x",
        "sem.mp-a",
    ]
