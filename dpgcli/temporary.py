"""Temporary files and folders; what a killed process leaves of them goes with the next run.

Whoever works on one holds a lock on it for as long as it is there: one that nobody holds is an
orphan. On a file system without locks orphans stay, and on Windows, where what is held open can
be neither renamed nor removed.
"""

import os
import shutil
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import count, islice
from pathlib import Path

AT_ONCE = 16  # of one name that orphans are looked for among
IS_HELD = hasattr(os, "O_NONBLOCK")  # not on Windows


@contextmanager
def temporary_file(path: Path) -> Iterator[tuple[Path, int | None]]:
    """An empty file beside `path`, and its handle if it is held; gone at the end unless renamed."""
    drop_orphans(path)
    name, handle, made = _made(path, _new_file)
    try:
        yield name, handle
    finally:
        with suppress(OSError):
            if _stands(name, made):
                name.unlink()
        _close(handle)


@contextmanager
def temporary_folder(path: Path, drop: Callable[[Path], None] = shutil.rmtree) -> Iterator[Path]:
    """An empty folder beside `path` for this process alone; gone at the end.

    `drop` removes one that a killed process has left, with what belongs to it elsewhere.
    """
    _drop_unheld(path, stat.S_ISDIR, drop)
    name, handle, _ = _made(path, _new_folder)
    try:
        yield name
    finally:
        shutil.rmtree(name, ignore_errors=True)
        _close(handle)


def drop_orphans(path: Path) -> None:
    """Remove temporary files for `path` that killed processes have left."""
    _drop_unheld(path, stat.S_ISREG, os.unlink)


def working_folder_is_gone() -> bool:
    """Whether the folder that this process works in was deleted: then no relative name means any.

    >>> working_folder_is_gone()
    False
    """
    try:
        Path.cwd()
    except FileNotFoundError:
        return True
    return False


def lock(handle: int, *, blocking: bool = True) -> bool:
    """Lock an open file or folder until it is closed, by whatever end of the process.

    Gives False where another holds it; raises OSError where there are no locks.
    """
    import filelock  # half of what NumPy takes to load

    return filelock.lock_descriptor(handle, blocking=blocking)


def _drop_unheld(
    path: Path, is_kind: Callable[[int], bool], remove: Callable[[Path], None]
) -> None:
    """Only of the kind that is made for `path`: another one is somebody's."""
    for name in islice(_names(path), AT_ONCE if IS_HELD else 0):
        with suppress(OSError):
            handle = os.open(name, os.O_RDONLY | os.O_NONBLOCK)
            try:
                is_free = lock(handle, blocking=False)
                found = os.fstat(handle)
                if is_free and is_kind(found.st_mode) and _stands(name, found):
                    remove(name)
            finally:
                os.close(handle)


def _made(path: Path, new: Callable[[Path], int | None]) -> tuple[Path, int | None, os.stat_result]:
    """A new one under the first name that is free, the handle that holds its lock, and its mark."""
    for name in _names(path):
        with suppress(FileExistsError):
            handle = new(name)
            if handle is None:
                return name, None, name.lstat()
            with suppress(OSError):  # no locks here
                lock(handle)
            made = os.fstat(handle)
            if _stands(name, made):
                return name, handle, made
            os.close(handle)  # taken for an orphan before it was locked
    raise AssertionError("names do not end")


def _new_file(name: Path) -> int | None:
    handle = os.open(name, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    if IS_HELD:
        return handle
    os.close(handle)
    return None


def _new_folder(name: Path) -> int | None:
    name.mkdir(mode=0o700)
    try:
        return os.open(name, os.O_RDONLY) if IS_HELD else None
    except FileNotFoundError as error:  # as above
        raise FileExistsError from error


def _names(path: Path) -> Iterator[Path]:
    return (path.with_name(f".{path.name[:40]}.dpg{number}.tmp") for number in count())


def _stands(name: Path, made: os.stat_result) -> bool:
    """Whether a name is still that of a file or folder."""
    try:
        return os.path.samestat(name.lstat(), made)
    except FileNotFoundError:
        return False


def _close(handle: int | None) -> None:
    if handle is not None:
        os.close(handle)
