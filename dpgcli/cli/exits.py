"""How a command ends: exit codes, and what becomes of each kind of error."""

import functools
import signal
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from enum import IntEnum
from typing import NoReturn, ParamSpec

import typer

from dpgcli.cli.streams import discard, open_streams, say
from dpgcli.errors import (
    FitError,
    NothingSelectedError,
    OutputError,
    SolverError,
    SpecError,
    UsageError,
    WorkplaceError,
)

P = ParamSpec("P")

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
NOTHING_HALF = "nothing half-written is left"


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
            sys.stdout.flush()
        except typer.Exit:
            raise
        except SpecError as error:
            say(str(error))  # each problem starts with its place
            count = len(error.problems)
            fail(ExitCode.USAGE, f"{count} problem{'s' * (count != 1)}")
        except (UsageError, FitError, OutputError, WorkplaceError, SolverError) as error:
            fail(ExitCode.USAGE, str(error))
        except NothingSelectedError as error:
            fail(ExitCode.NOTHING_SELECTED, str(error))
        except BrokenPipeError:  # the reader, such as head, has had enough
            discard(sys.stdout)
            raise typer.Exit(ExitCode.DONE) from None
        except KeyboardInterrupt as stop:
            fail(ExitCode.INTERRUPTED, f"interrupted; {str(stop) or NOTHING_HALF}")
        except Terminated as stop:
            fail(ExitCode.TERMINATED, f"terminated; {str(stop) or NOTHING_HALF}")
        except OSError as error:
            if error.filename is None:  # what is left without a name is standard output
                fail(_no_output(error), "")
            _internal_error()
        except Exception:
            _internal_error()

    return run


def fail(code: ExitCode, message: str) -> NoReturn:
    """Say why on standard error and end."""
    for line in message.split("\n") if message else ():
        say(f"dpg: {line}")
    raise typer.Exit(code)


def run_and_exit(app: Callable[..., object]) -> NoReturn:
    """Run the program and exit with its code, whatever state the streams are in."""
    open_streams()
    for number in STOP_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup and & in a script want it
            signal.signal(number, _stop)
    code = _code_of(app)
    _ignore_further_signals()
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        discard(sys.stdout)
    except OSError as error:
        code = _no_output(error)
    with suppress(OSError):
        sys.stderr.flush()
        sys.exit(code)
    discard(sys.stderr)
    sys.exit(code)


def _code_of(app: Callable[..., object]) -> int:
    """The exit code of a run; what typer itself meets (usage, help, a closed pipe) included."""
    try:
        code = app(standalone_mode=False)
    except typer.TyperException as error:
        with suppress(OSError):
            getattr(error, "show", traceback.print_exc)()
        return error.exit_code
    except SystemExit:  # typer's way to end when nobody reads its help
        discard(sys.stdout)
        return ExitCode.DONE
    except OSError as error:
        return _no_output(error)
    except Terminated:  # before a command has begun, or after it is done
        say(f"dpg: terminated; {NOTHING_HALF}")
        return ExitCode.TERMINATED
    except (KeyboardInterrupt, typer.Abort):
        say(f"dpg: interrupted; {NOTHING_HALF}")
        return ExitCode.INTERRUPTED
    return code if isinstance(code, int) else ExitCode.DONE


def _no_output(error: OSError) -> ExitCode:
    discard(sys.stdout)
    say(f"dpg: cannot write the output: {error.strerror}")
    return ExitCode.USAGE


def _stop(number: int, _: object) -> NoReturn:
    """Unwind once; what comes after the first signal would only disturb the cleaning up."""
    _ignore_further_signals()
    raise KeyboardInterrupt if number == signal.SIGINT else Terminated


def _ignore_further_signals() -> None:
    for number in STOP_SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _internal_error() -> NoReturn:
    with suppress(OSError):
        traceback.print_exc()
    fail(ExitCode.INTERNAL, "this is a bug in dpg; please report it with the text above")
