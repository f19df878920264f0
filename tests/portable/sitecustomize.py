"""An interpreter without what only POSIX has: Python imports this at its start, if on PYTHONPATH.

Like Windows, as far as that can be played elsewhere: modules, signals and functions are missing,
folders cannot be opened, an open file can be neither renamed nor removed, and new processes are
spawned.
"""

import multiprocessing
import os
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

MODULES = ("fcntl", "grp", "posixshmem", "pty", "pwd", "resource", "syslog", "termios", "tty")
FUNCTIONS = (
    *("chown", "fchmod", "fchown", "fork", "forkpty", "getegid", "geteuid", "getgid", "getpgid"),
    *("getuid", "kill", "killpg", "lchown", "mkfifo", "setpgid", "setsid", "sysconf"),
    *("O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK", "O_SYNC", "O_TMPFILE"),
)
KEPT = ("SIGABRT", "SIGFPE", "SIGILL", "SIGINT", "SIGSEGV", "SIGTERM", "SIG_DFL", "SIG_IGN")
OF_SIGNALS = ("alarm", "getitimer", "pause", "pthread_kill", "pthread_sigmask", "setitimer")


def _refusing(function: Callable[..., Any], is_refused: Callable[[Any], bool]) -> Any:
    def called(path: Any, *arguments: Any, **named: Any) -> Any:
        if is_refused(path):
            raise PermissionError(13, "Permission denied", str(path))
        return function(path, *arguments, **named)

    return called


def _is_open(path: Any) -> bool:
    """Whether this process has opened the file; never where there is no /proc."""
    handles = Path("/proc/self/fd")
    if not handles.exists() or not os.path.lexists(path):
        return False
    status = os.lstat(path)
    return any(
        os.path.samestat(status, handle.stat()) for handle in handles.iterdir() if handle.exists()
    )


def hide() -> None:
    """Take away what Windows lacks, and refuse what it refuses."""
    sys.modules.update(dict.fromkeys(MODULES))  # type: ignore[arg-type]  # None forbids an import
    shutil._use_fd_functions = False  # type: ignore[attr-defined]
    for name in FUNCTIONS:
        if hasattr(os, name):
            delattr(os, name)
    for name in dir(signal):
        if (name.startswith("SIG") and name not in KEPT) or name in OF_SIGNALS:
            delattr(signal, name)
    multiprocessing.get_all_start_methods = lambda: ["spawn"]  # type: ignore[assignment]
    multiprocessing.context._concrete_contexts.pop("forkserver", None)  # type: ignore[attr-defined]
    os.open = _refusing(os.open, os.path.isdir)
    for name in ("remove", "rename", "replace", "unlink"):
        setattr(os, name, _refusing(getattr(os, name), _is_open))


if __name__ == "sitecustomize":  # not where tests are collected
    hide()
