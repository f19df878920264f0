"""How a command ends: exit codes, and what becomes of each kind of error."""

import functools
import os
import signal
import sys
import traceback
from collections.abc import Callable
from enum import IntEnum
from typing import NoReturn, ParamSpec

import typer

from dpgcli.errors import NothingSelectedError, OutputError, SpecError, UsageError

P = ParamSpec("P")


class ExitCode(IntEnum):
    """Exit codes of every command."""

    DONE = 0
    USAGE = 2
    INTERNAL = 3
    NOTHING_SELECTED = 5
    INTERRUPTED = 130
    TERMINATED = 143


class Terminated(BaseException):
    """SIGTERM, raised so that half-written files are cleaned up on the way out."""


def command(function: Callable[P, None]) -> Callable[P, None]:
    """Run a command so that every outcome has its message and its exit code."""

    @functools.wraps(function)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        signal.signal(signal.SIGTERM, _terminate)
        try:
            function(*args, **kwargs)
            sys.stdout.flush()
        except typer.Exit:
            raise
        except SpecError as error:
            count = len(error.problems)
            fail(ExitCode.USAGE, f"{error}\n{count} problem{'s' * (count != 1)}")
        except (UsageError, OutputError) as error:
            fail(ExitCode.USAGE, str(error))
        except NothingSelectedError as error:
            fail(ExitCode.NOTHING_SELECTED, str(error))
        except BrokenPipeError:  # the reader, such as head, has had enough
            _discard_output()
            raise typer.Exit(ExitCode.DONE) from None
        except KeyboardInterrupt:
            fail(ExitCode.INTERRUPTED, "interrupted; nothing half-written is left")
        except Terminated:
            fail(ExitCode.TERMINATED, "terminated; nothing half-written is left")
        except OSError as error:
            if error.filename is None:  # what is left without a name is standard output
                _discard_output()
                fail(ExitCode.USAGE, f"cannot write the output: {error.strerror}")
            _internal_error()
        except Exception:
            _internal_error()

    return run


def fail(code: ExitCode, message: str) -> NoReturn:
    """Say why on standard error and end."""
    for line in message.splitlines():
        print(line if ": expected " in line else f"dpg: {line}", file=sys.stderr)
    raise typer.Exit(code)


def _terminate(*_: object) -> NoReturn:
    raise Terminated


def _discard_output() -> None:
    """Keep the interpreter from flushing into a closed pipe on its way out."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _internal_error() -> NoReturn:
    traceback.print_exc()
    fail(ExitCode.INTERNAL, "this is a bug in dpg; please report it with the text above")
