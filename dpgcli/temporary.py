"""Temporary files and folders; what a killed process leaves of them goes with the next run.

Whoever works on one holds a lock on it for as long as it is there: one that nobody holds is an
orphan. On a file system without locks orphans stay.
"""

import fcntl
import os
import shutil
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import count, islice
from pathlib import Path

AT_ONCE = 16  # of one name that orphans are looked for among


@contextmanager
def temporary_file(path: Path) -> Iterator[tuple[Path, int]]:
    """An empty file beside `path`, and its handle; gone at the end unless it was renamed."""
    drop_orphans(path)
    name, handle = _made(path, lambda new: os.open(new, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600))
    try:
        yield name, handle
    finally:
        with suppress(OSError):
            if _stands(name, handle):
                name.unlink()
        os.close(handle)


@contextmanager
def temporary_folder(path: Path) -> Iterator[Path]:
    """An empty folder beside `path` for this process alone; gone at the end."""
    _drop_unheld(path, stat.S_ISDIR, shutil.rmtree)
    name, handle = _made(path, _new_folder)
    try:
        yield name
    finally:
        shutil.rmtree(name, ignore_errors=True)
        os.close(handle)


def drop_orphans(path: Path) -> None:
    """Remove temporary files for `path` that killed processes have left."""
    _drop_unheld(path, stat.S_ISREG, os.unlink)


def _drop_unheld(
    path: Path, is_kind: Callable[[int], bool], remove: Callable[[Path], None]
) -> None:
    """Only of the kind that is made for `path`: another one is somebody's."""
    for name in islice(_names(path), AT_ONCE):
        with suppress(OSError):
            handle = os.open(name, os.O_RDONLY | os.O_NONBLOCK)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if is_kind(os.fstat(handle).st_mode) and _stands(name, handle):
                    remove(name)
            finally:
                os.close(handle)


def _made(path: Path, new: Callable[[Path], int]) -> tuple[Path, int]:
    """A new one under the first name that is free, and the handle that holds its lock."""
    for name in _names(path):
        with suppress(FileExistsError):
            handle = new(name)
            with suppress(OSError):  # no locks here
                fcntl.flock(handle, fcntl.LOCK_EX)
            if _stands(name, handle):
                return name, handle
            os.close(handle)  # taken for an orphan before it was locked
    raise AssertionError("names do not end")


def _new_folder(name: Path) -> int:
    name.mkdir(mode=0o700)
    try:
        return os.open(name, os.O_RDONLY)
    except FileNotFoundError as error:  # as above
        raise FileExistsError from error


def _names(path: Path) -> Iterator[Path]:
    return (path.with_name(f".{path.name[:40]}.dpg{number}.tmp") for number in count())


def _stands(name: Path, handle: int) -> bool:
    """Whether a name is still that of an open file or folder."""
    try:
        return os.path.samestat(name.lstat(), os.fstat(handle))
    except FileNotFoundError:
        return False
