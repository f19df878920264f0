"""The program's start, with an answer to Ctrl-C before anything else is imported."""

import gc
import os
import signal
import sys
import warnings
from contextlib import suppress
from types import FrameType

import dpgcli

STOPS = {  # numbers by name, since not every system has all of them
    getattr(signal, name): end
    for name, end in {
        "SIGINT": ("interrupted", 130),
        "SIGTERM": ("terminated", 143),
        "SIGHUP": ("terminated", 143),
    }.items()
    if hasattr(signal, name)
}
SELDOM = 10**6  # objects made: what imports make stays, and to look through it takes 30 ms


def main() -> None:
    """Run the program."""
    answer_stops()
    gc.set_threshold(SELDOM)
    if not sys.warnoptions:  # -W, PYTHONWARNINGS: tests take each for an error
        warnings.simplefilter("ignore")  # of libraries; what users should know is said by commands
    with suppress(OSError):  # one that was deleted holds nothing
        _leave_out_working_folder()
    from dpgcli.cli.main import main as run  # signals are met by commands from here on

    run()


def answer_stops() -> None:
    """Meet signals from now on, until commands do."""
    for number in STOPS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup and & in a script want it
            signal.signal(number, _end)


def _leave_out_working_folder() -> None:
    """Import nothing from the working folder: a random.py there is not the library's.

    `python -m` looks there first, as does an empty entry of PYTHONPATH. A folder that holds the
    package itself comes last.
    """
    here = os.path.realpath(os.curdir)
    others = [place for place in sys.path if os.path.realpath(place) != here]
    is_package_here = os.path.realpath(f"{dpgcli.__path__[0]}/..") == here
    sys.path[:] = [*others, here] if is_package_here else others


def _end(number: int, _: FrameType | None) -> None:
    """End at once: nothing has begun, and modules that start make errors of what is raised."""
    word, code = STOPS[number]
    with suppress(OSError):
        os.write(2, f"dpg: {word}; nothing half-written is left\n".encode())
    os._exit(code)


if __name__ == "__main__":
    main()
