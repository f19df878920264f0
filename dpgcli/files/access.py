"""What the system refuses about files, in our words: questions about a path may fail as well.

Whether a file exists is not known of a folder that one may not enter, nor of a name that is too
long; links may lead in a circle.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dpgcli.errors import OutputError, UsageError


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Raise UsageError, for `path` or the file in it that is refused, where the system does.

    >>> with reading(Path("shard")):
    ...     raise PermissionError(13, "Permission denied", "shard/sweep.json")
    Traceback (most recent call last):
        ...
    dpgcli.errors.UsageError: cannot read shard/sweep.json: Permission denied
    """
    try:
        yield
    except OSError as error:
        raise UsageError(
            f"cannot read {error.filename or path}: {error.strerror or error}"
        ) from error


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Raise OutputError, for `path`, where the system refuses what writing it needs.

    >>> with writing(Path("out")):
    ...     raise PermissionError(13, "Permission denied", "out/.states.parquet.dpg0.tmp")
    Traceback (most recent call last):
        ...
    dpgcli.errors.OutputError: cannot write out: Permission denied
    """
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from error


def inside(folder: Path) -> list[Path]:
    """What is in a folder, by name; nothing where there is no folder. Raises UsageError."""
    with reading(folder):
        try:
            return sorted(folder.iterdir())
        except (FileNotFoundError, NotADirectoryError):
            return []
