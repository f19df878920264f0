"""How a command ends: exit codes, and what becomes of each kind of error."""

import atexit
import errno
import functools
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterable
from enum import IntEnum
from types import FrameType
from typing import NoReturn, ParamSpec

import typer

from dpgcli.cli.spelling import problem_with_options, with_options
from dpgcli.cli.streams import OUTPUT, open_streams, say
from dpgcli.cli.usage import refusal
from dpgcli.errors import (
    ActuationError,
    FitError,
    NothingSelectedError,
    NoWorkerError,
    OutputError,
    SolverError,
    SpecError,
    UsageError,
    WorkplaceError,
)
from dpgcli.signals import STOP_SIGNALS
from dpgcli.temporary import working_folder_is_gone
from dpgcli.text import printable

P = ParamSpec("P")
_stops: list[BaseException] = []  # what a signal has raised; the first is the last

NOTHING_HALF = "nothing half-written is left"
SOON = 0.01  # s
MOST_ROWS = 10  # of data whose problems are shown
# open files, disk, processes, memory
EXHAUSTED = (errno.EMFILE, errno.ENFILE, errno.ENOSPC, errno.EROFS, errno.EAGAIN, errno.ENOMEM)
CLOSED = (errno.EACCES, errno.EPERM, errno.ELOOP, errno.ENAMETOOLONG)  # names
REFUSALS = (  # of memory, by the loader of libraries and by those that start threads
    "failed to map segment",
    "annot allocate memory",
    "can't start new thread",
    "Failed to launch worker thread",
)

REFUSED = (UsageError, FitError, OutputError, WorkplaceError, SolverError, ActuationError)


class ExitCode(IntEnum):
    """Exit codes of every command."""

    DONE = 0
    REQUIREMENT = 1
    USAGE = 2
    INTERNAL = 3
    FAILED_CASES = 4
    NOTHING_SELECTED = 5
    INTERRUPTED = 130
    TERMINATED = 143


class Terminated(BaseException):
    """SIGTERM or SIGHUP, raised so that half-written files are cleaned up on the way out."""


def command(function: Callable[P, None]) -> Callable[P, None]:
    """Run a command so that every outcome has its message and its exit code."""

    @functools.wraps(function)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        try:
            function(*args, **kwargs)
            sys.stdout.flush()  # while a signal still stops it
        except typer.Exit:
            raise
        except (KeyboardInterrupt, Terminated) as stop:
            _fail_stopped(isinstance(stop, Terminated), str(stop))
        except Exception as error:
            if _stops:  # extension modules make errors of their own of what is raised in them
                _fail_stopped(isinstance(_stops[0], Terminated))
            _fail_by_kind(error)

    return run


def _fail_stopped(terminated: bool, message: str = "") -> NoReturn:
    code = ExitCode.TERMINATED if terminated else ExitCode.INTERRUPTED
    fail(code, f"{'terminated' if terminated else 'interrupted'}; {message or NOTHING_HALF}")


def _fail_by_kind(error: Exception) -> NoReturn:
    match error:
        case SpecError():
            say_problems(error)
            raise typer.Exit(ExitCode.USAGE) from None
        case NoWorkerError():
            fail(ExitCode.FAILED_CASES, error.message)
        case NothingSelectedError():
            fail(ExitCode.NOTHING_SELECTED, error.message)
    if isinstance(error, REFUSED):
        fail(ExitCode.USAGE, error.message)
    _fail_if_refused(error)
    _internal_error()


def say_problems(error: SpecError) -> None:
    """Say the problems, each of which starts with its place, and how many there are.

    What is wrong in one row of data may be wrong in thousands: of these the first are enough.
    """
    rows = [p for p in error.problems if p.line is not None and p.column is None]
    hidden = {id(problem) for problem in rows[MOST_ROWS:]}
    for problem in error.problems:
        if id(problem) not in hidden:
            say(str(problem_with_options(problem)))
    count = len(error.problems)
    rest = f"; of those in rows of data the first {MOST_ROWS} are shown" if hidden else ""
    say(f"dpg: {count:,} problem{'s' * (count != 1)}{rest}")


def say_warnings(warnings: Iterable[str]) -> None:
    """Say each on standard error, in a line of its own."""
    for warning in warnings:
        say(f"warning: {printable(with_options(warning))}")


def fail(code: ExitCode, message: str) -> NoReturn:
    """Say why on standard error and end."""
    for line in with_options(message).split("\n") if message else ():
        say(f"dpg: {line}")
    raise typer.Exit(code)


def _fail_if_refused(error: Exception) -> None:
    """End where it is no bug: the working folder was deleted, or the system has run out of it."""
    if isinstance(error, OSError) and working_folder_is_gone():
        fail(ExitCode.USAGE, "the working folder was deleted: change to one that is there")
    if isinstance(error, OSError) and error.errno in (*EXHAUSTED, *CLOSED):
        fail(ExitCode.USAGE, f"the system refuses: {error}")
    if isinstance(error, MemoryError):  # of NumPy and pyarrow as well
        fail(ExitCode.USAGE, f"the system refuses more memory: {str(error) or 'there is no more'}")
    if any(text in str(error) for text in REFUSALS):
        fail(ExitCode.USAGE, f"the system refuses: {error}")


def check_failed(n_failed: int, max_failed: int) -> None:
    """End the command with its exit code if more designs failed than may."""
    if n_failed > max_failed:
        designs = "design" if n_failed == 1 else "designs"
        fail(ExitCode.FAILED_CASES, f"{n_failed:,} {designs} failed; --max-failed is {max_failed}")


def run_and_exit(app: Callable[..., object]) -> NoReturn:
    """Run the program and exit with its code, whatever state the streams are in."""
    open_streams()
    for number in STOP_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup and & in a script want it
            signal.signal(number, _stop)
    sys.unraisablehook = _unraisable
    code = _code_of(app)
    _ignore_further_signals()
    if code in (ExitCode.INTERRUPTED, ExitCode.TERMINATED):
        OUTPUT.drop()
    sys.stdout.flush()
    if OUTPUT.error is not None and not isinstance(OUTPUT.error, ConnectionError):
        say(f"dpg: cannot write the output: {OUTPUT.error.strerror}")
        code = code or ExitCode.USAGE
    _end(code)


def _end(code: int) -> NoReturn:
    """End the process once all that was registered for its end is done.

    The interpreter is not taken apart: that takes time, and the threads of libraries that are
    still about may abort it (seen with pyarrow's, in one of fifteen runs of `dpg check`).
    """
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _code_of(app: Callable[..., object]) -> int:
    """The exit code of a run; what typer itself meets (usage, help) included."""
    try:
        code = app(standalone_mode=False)
    except typer.TyperException as error:
        if type(error).__name__ == "NoArgsIsHelpError":
            say(str(error))
        else:
            say(f"dpg: {refusal(error)}")
        return ExitCode.USAGE
    except Terminated:  # before a command has begun, or after it is done
        say(f"dpg: terminated; {NOTHING_HALF}")
        return ExitCode.TERMINATED
    except (KeyboardInterrupt, typer.Abort):
        say(f"dpg: interrupted; {NOTHING_HALF}")
        return ExitCode.INTERRUPTED
    except MemoryError:
        say("dpg: the system refuses more memory")
        return ExitCode.USAGE
    except OSError as error:  # commands answer for their own: these are of shell completion
        say(f"dpg: cannot install completion: {error}")
        return ExitCode.USAGE
    if isinstance(code, ExitCode):
        return code
    if code == ExitCode.INTERRUPTED:  # by typer, which does not say so
        say(f"dpg: interrupted; {NOTHING_HALF}")
        return ExitCode.INTERRUPTED
    return ExitCode.USAGE if code else ExitCode.DONE  # of typer, which knows none of ours


def _stop(number: int, frame: FrameType | None) -> None:
    """Unwind once; what comes after the first signal would only disturb the cleaning up.

    Not in the middle of an import: extension modules make errors of their own of what is raised.
    """
    if any("importlib" in here.f_code.co_filename for here, _ in traceback.walk_stack(frame)):
        _send_again(number)
        return
    _ignore_further_signals()
    _stops.append(KeyboardInterrupt() if number == signal.SIGINT else Terminated())
    raise _stops[0]


def _send_again(number: int) -> None:
    signal.signal(number, _stop)
    if hasattr(signal, "SIGALRM"):
        signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(number))
        signal.setitimer(signal.ITIMER_REAL, SOON)
    else:  # Windows
        threading.Timer(SOON, signal.raise_signal, (number,)).start()


def _unraisable(lost: "sys.UnraisableHookArgs") -> None:
    """A stop that came where nothing can be raised, such as in a destructor, is sent again."""
    if isinstance(lost.exc_value, KeyboardInterrupt | Terminated):
        is_interrupt = isinstance(lost.exc_value, KeyboardInterrupt)
        _send_again(signal.SIGINT if is_interrupt else signal.SIGTERM)
    else:
        sys.__unraisablehook__(lost)


def _ignore_further_signals() -> None:
    for number in STOP_SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _internal_error() -> NoReturn:
    say(traceback.format_exc().rstrip())
    fail(ExitCode.INTERNAL, "this is a bug in dpg; please report it with the text above")
