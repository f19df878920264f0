"""A pool of processes on this machine: started from a fork server where there is one.

Its workers end with their parent, leave signals to it, import nothing from the working folder and
keep their sockets where the next run finds what a killed one left.
"""

import atexit
import os
import re
import shutil
import signal
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from functools import cache
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import ParamSpec, TypeVar

from dpgcli.errors import Field, WorkplaceError
from dpgcli.signals import STOP_SIGNALS
from dpgcli.sweeps.executors import GO_ON, Backend
from dpgcli.sweeps.guard import OF_POOL, said_of_guards
from dpgcli.temporary import temporary_folder, working_folder_is_gone

R = TypeVar("R")
P = ParamSpec("P")

SEMAPHORES = Path("/dev/shm")  # on Linux; elsewhere their names are nowhere to be seen
SEMAPHORE_PREFIX = re.compile("dpg-[0-9a-f]{8}")
LONGEST_SOCKET_PLACE = 72  # characters; the whole name of a socket may have about 100


def processes(n_workers: int) -> Backend:
    """A pool of processes on this machine."""
    hint = said_of_guards()
    return Backend("the pool of processes", process_pool, n_workers, hint=hint)


def process_pool(n_workers: int) -> Executor:
    """A pool of fresh processes: BLAS on one thread, deaf to Ctrl-C, gone with their parent."""
    from multiprocessing import get_context

    method = "forkserver" if _has_fork_server() else "spawn"
    start_fork_server()
    # a signal between making a semaphore and noting it would leave it behind
    with _held_signals(), _refusals_said(", for semaphores (/dev/shm on Linux)"):
        return _Pool(n_workers, mp_context=get_context(method), initializer=_start_worker)


def start_fork_server(*modules: str) -> None:
    """Start the process that workers are forked from, with these modules imported once for all.

    Called early, while this process has one thread and no files open, it is a fork of this one,
    and what both need is imported once; else a new interpreter. On Windows there is none, and
    every worker imports for itself. Raises WorkplaceError where it cannot be.
    """
    if not _has_fork_server():
        return
    with _refusals_said():
        _own_temporary_folder()
        if modules:
            from multiprocessing import forkserver

            forkserver.set_forkserver_preload(list(modules))
        is_early = bool(modules) and len(sys._current_frames()) == 1
        if is_early:
            for module in modules:
                import_module(module)
        with _safe_path():
            _ensure_fork_server(_forking() if is_early else nullcontext())


@contextmanager
def _refusals_said(purpose: str = "") -> Iterator[None]:
    """Raise WorkplaceError for what the system refuses to a pool: semaphores, sockets, a place.

    One process alone needs none of it.
    """
    try:
        yield
    except (OSError, ImportError, NotImplementedError) as error:
        why = f"{getattr(error, 'strerror', None) or error}{purpose}"
        if working_folder_is_gone():
            why = "the working folder was deleted; change to one that is there"
        said = f"workers cannot be started: {why}. Without workers: "
        raise WorkplaceError(said, Field("jobs"), " 1") from error


def _ensure_fork_server(way: AbstractContextManager[None]) -> None:
    from multiprocessing import forkserver, resource_tracker

    # what a terminal sends to all its processes is for this one to answer: the others inherit
    # that it is blocked; the tracker comes first, since starting it unblocks Ctrl-C
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT, signal.SIGHUP])
    try:
        with way:
            resource_tracker.ensure_running()
            signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
            forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _forking() -> Iterator[None]:
    """Have `multiprocessing` fork this process where it would start a new interpreter."""
    from multiprocessing import util

    known = vars(util)
    before = known["spawnv_passfds"]
    known["spawnv_passfds"] = _fork
    try:
        yield
    finally:
        known["spawnv_passfds"] = before


def _fork(_: object, arguments: Sequence[str], passed: Sequence[int]) -> int:
    """Run the code of an interpreter's last argument in a fork; its process."""
    process = os.fork()
    if process:
        return process
    try:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)  # Ctrl-C and hang-ups are blocked
        for last, following in pairwise([2, *sorted(passed), os.sysconf("SC_OPEN_MAX")]):
            os.closerange(last + 1, following)  # among them the pipe that says who is alive
        exec(arguments[-1], {})
    except Exception:
        sys.excepthook(*sys.exc_info())
    finally:
        os._exit(0)  # what is to be done at the end is for the parent to do


@contextmanager
def _safe_path() -> Iterator[None]:
    """Have new interpreters import nothing from the working folder, such as somebody's random.py.

    What the program that starts them may import, they get from it later.
    """
    safe = {"PYTHONSAFEPATH": "1", OF_POOL: "1"}  # the option -P
    with suppress(OSError):  # a working folder that was deleted
        here = os.path.realpath(os.curdir)
        places = os.environ.get("PYTHONPATH", "").split(os.pathsep)
        kept = [place for place in places if os.path.realpath(place) != here]
        safe["PYTHONPATH"] = os.pathsep.join(kept)
    before = {name: os.environ.get(name) for name in safe}
    os.environ.update(safe)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _has_fork_server() -> bool:
    from multiprocessing import get_all_start_methods

    return "forkserver" in get_all_start_methods()


@cache
def _own_temporary_folder() -> None:
    """Have `multiprocessing` keep its sockets where the next run finds what a killed one left.

    And have it call semaphores by what an empty file there is called: workers find them by name,
    so they have names for as long as the pool is there.
    """
    from multiprocessing import current_process

    place = tempfile.gettempdir()
    place = place if len(place) < LONGEST_SOCKET_PLACE else "/tmp"
    held = ExitStack()
    named = Path(place) / f"pool{os.getuid()}"
    folder = held.enter_context(temporary_folder(named, _drop_orphan))
    atexit.register(held.close)
    prefix = f"dpg-{os.urandom(4).hex()}"
    (folder / prefix).touch()
    settings = vars(current_process())["_config"]
    settings |= {"tempdir": os.fspath(folder), "semprefix": f"/{prefix}"}


def _drop_orphan(folder: Path) -> None:
    """Remove the folder of a killed run, and its semaphores, which outlive all its processes."""
    for prefix in filter(SEMAPHORE_PREFIX.fullmatch, [path.name for path in folder.iterdir()]):
        for semaphore in SEMAPHORES.glob(f"sem.{prefix}-*"):
            with suppress(OSError):  # somebody else's, or gone
                semaphore.unlink()
    shutil.rmtree(folder)


class _Pool(ProcessPoolExecutor):
    """A pool that no signal stops halfway through starting or ending its processes."""

    def submit(self, fn: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> Future[R]:
        """Submit as the base does; without a fork server the pool is broken.

        Raises WorkplaceError where the system allows no more processes.
        """
        with _held_signals(), _safe_path():
            try:
                future = super().submit(fn, *args, **kwargs)
            except (ConnectionError, FileNotFoundError, EOFError) as error:
                raise BrokenExecutor("the fork server is gone") from error
            except OSError as error:
                if self._broken:  # its pipes are closed meanwhile
                    raise BrokenExecutor("a worker died while another was started") from error
                why = f"cannot start a process: {error.strerror}. Take fewer "
                raise WorkplaceError(why, Field("jobs"), f". {GO_ON}") from error
        if self._broken:
            # of a broken pool all processes are ended and waited for: one that was just being
            # started escapes the first, and would be waited for without end (seen in CPython 3.11)
            for process in list((self._processes or {}).values()):
                process.terminate()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Shut down as the base does."""
        with _held_signals():
            super().shutdown(wait, cancel_futures=cancel_futures)


@contextmanager
def _held_signals() -> Iterator[None]:
    """Hold back signals to the main thread until the end of the block."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    handlers = {
        number: signal.signal(number, lambda caught, _: held.append(caught))
        for number in STOP_SIGNALS
    }
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler or signal.SIG_DFL)
        for caught in held[:1]:
            signal.raise_signal(caught)


def _start_worker() -> None:
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # of libraries, as in the program itself
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End with the parent: a killed one cannot end its workers, which would wait forever."""
    from multiprocessing import parent_process
    from multiprocessing.connection import wait as wait_for

    parent = parent_process()
    if parent is not None:
        wait_for([parent.sentinel])
        os._exit(1)
