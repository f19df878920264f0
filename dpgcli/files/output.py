"""Files appear whole or not at all."""

import fcntl
import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from dpgcli.errors import OutputError, UsageError
from dpgcli.text import control_character


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary file beside `path`; sync it and rename it when all went well.

    A link stays one: what it points to is written.
    Whatever interrupts the block leaves `path` as it was and no temporary file. Raises
    OutputError where the file cannot be written: no folder, no permission, no space.
    """
    target = Path(os.path.realpath(path))
    try:
        temporary = _beside(target)
        try:
            yield temporary
            _sync(temporary, os.O_RDWR)
            temporary.replace(target)
            _sync(target.parent, os.O_RDONLY)
        except BaseException:
            with suppress(OSError):
                temporary.unlink()
            raise
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from error


def check_outputs(sources: Iterable[Path], *paths: Path | None) -> None:
    """Fail before the work: files that can be written, under names of their own.

    Raises OutputError for what cannot be written, UsageError for one name twice or for one of
    the files that are read.
    """
    given = [path for path in paths if path is not None]
    for path in given:
        check_writable(path)
    if len({os.path.realpath(path) for path in given}) < len(given):
        raise UsageError(f"{', '.join(map(str, given))}: expected names that differ")
    check_not_read(sources, given)


def check_not_read(sources: Iterable[Path], paths: Iterable[Path]) -> None:
    """Raise UsageError for a file to write that is one of those that are read."""
    read = [source for source in sources if source.exists()]
    for path in paths:
        if path.exists() and any(path.samefile(source) for source in read):
            raise UsageError(f"{path} is the spec or data that is read: give another name")


def check_table_name(path: Path | None) -> None:
    """Refuse a name that promises another format than Parquet; raises UsageError."""
    if path is not None and path.suffix.lower() in (".csv", ".json", ".svg", ".png"):
        raise UsageError(
            f"--output {path}: writes Parquet; for {path.suffix} use --format with > FILE, "
            "or --plot for figures"
        )


def check_appendable(path: Path, sources: Iterable[Path]) -> None:
    """Fail before the work rather than after it.

    Raises OutputError for what cannot be written, UsageError for one of the files that are read.
    """
    check_not_read(sources, (path,))
    try:
        path.open("ab").close()
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror}") from error


def check_writable(path: Path) -> None:
    """Fail before the work rather than after it."""
    try:
        if path.is_dir():
            raise IsADirectoryError(None, "is a folder")
        _beside(Path(os.path.realpath(path))).unlink()
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from error


@contextmanager
def sole_use(folder: Path) -> Iterator[None]:
    """Make a folder if need be, and keep every other process that asks out of it.

    Raises UsageError where another is at work there, OutputError where there can be no such
    folder. A folder that was made and stayed empty is removed.
    """
    if control := control_character(str(folder)):
        raise OutputError(f"cannot write {folder}: {control} in it")
    is_new = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY)
    except FileExistsError as error:
        raise OutputError(f"cannot write {folder}: it is no folder") from error
    except OSError as error:
        raise OutputError(f"cannot write {folder}: {error.strerror}") from error
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(handle)
        raise UsageError(f"another dpg is at work in {folder}: wait, or name another") from error
    except OSError:
        pass  # a file system without locks
    try:
        yield
    finally:
        if is_new:
            with suppress(OSError):
                folder.rmdir()
        os.close(handle)


def _beside(path: Path) -> Path:
    """An empty file in the same folder, with the permissions a new file gets.

    Renaming over a device or pipe would replace it, /dev/null for the whole machine.
    """
    if control := control_character(str(path)):
        raise OSError(None, f"{control} in it")
    if path.exists() and not path.is_file() and not path.is_dir():
        raise OSError(None, "is a device or pipe, not a file")
    handle, name = tempfile.mkstemp(prefix=f".{path.name[:40]}.", suffix=".tmp", dir=path.parent)
    try:
        mask = os.umask(0)
        os.umask(mask)
        os.fchmod(handle, 0o666 & ~mask)
    except BaseException:
        Path(name).unlink()
        raise
    finally:
        os.close(handle)
    return Path(name)


def _sync(path: Path, flags: int) -> None:
    handle = os.open(path, flags)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
