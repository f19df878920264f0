"""Files appear whole or not at all, and never in the place of what somebody else wrote."""

import errno
import os
import re
import stat
from codecs import getincrementaldecoder
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from enum import Enum
from pathlib import Path

from dpgcli.errors import OutputError, UsageError
from dpgcli.files.access import reading, writing
from dpgcli.files.edits import is_edited
from dpgcli.files.seal import footer_size
from dpgcli.temporary import lock, temporary_file
from dpgcli.text import control_character

OPENS_FOLDERS = hasattr(os, "O_DIRECTORY")  # not Windows
ENDS = 2**14  # bytes at the head and at the tail of a file among which its mark stands
# by a file system that has no permissions, or cannot be told when to write: Windows drives in WSL,
# FUSE, network drives; a full or broken disk says something else
REFUSED = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EBADF)  # and PermissionError
NO_TEXT = (
    *(".parquet", ".csv", ".yaml", ".yml", ".json", ".html", ".svg", ".png", ".pdf", ".graphml"),
)


class Mark(Enum):
    """How every file of a kind begins, or what stands at its end, by which it is known.

    The same words elsewhere are those of somebody who quotes them.
    """

    NONE = rb"(?!)"  # nothing that is there is replaced
    ANY = rb""  # whatever is there is replaced
    TABLE = rb"\APAR1(?s:.*)dpg\.(content|file)_sha256\x18@"
    FACTS = rb'\A\{\s*"written_by": "dpg '
    REPORT = rb"^<!-- written by dpg -->\n?\Z"
    FIGURE = rb"\A<\?xml (?s:.){,999}<dc:title>drawn by dpg<|\A\x89PNG(?s:.){,99}\x00drawn by dpg"
    GRAPH = rb"\A<\?xml [^>]*>\n<!-- written by dpg -->\n<graphml "
    CALIBRATION = rb"\Acalibration_version: .*\nmade_by: dpg "
    SPEC = rb"\A# Written by dpg: "
    FOUND = rb"\A# Written by dpg: design \d+ of best\.parquet\n"
    DEPFILE = rb"\A# dpg sweep: "
    DECK = rb"\A\*\* dpg fe "
    CURVE = rb"\A# dpg fe "
    CONTROLLER = rb"\A# dpg routine: "
    LOG = rb"\A# dpg fe, .*: words of "
    DISPLACEMENTS = rb"\A# dpg fe, .*: printed by "
    PARTS = rb'\A\{\s*"dpg\.'


EDITED = (Mark.SPEC, Mark.FOUND)  # by people, for whom they are written
Output = tuple[Path | None, Mark]


@contextmanager
def whole_file(path: Path, mark: Mark = Mark.NONE) -> Iterator[Path]:
    """Give a temporary file beside `path`; sync it and rename it when all went well.

    A link stays one: what it points to is written. What is there is replaced only if it is
    empty or has the mark, and no spec that somebody edited; its permissions stay.
    Whatever interrupts the block leaves `path` as it was and no temporary file. Raises
    OutputError where the file cannot be written: no folder, no permission, no space, a file of
    somebody else.
    """
    target = real(path)
    with writing(path), _beside(target) as temporary:
        yield temporary
        with _as_far_as_allowed():
            _sync(temporary, os.O_RDWR)
        _check_replaceable(target, mark)
        temporary.replace(target)
        with _as_far_as_allowed():
            if OPENS_FOLDERS:
                _sync(target.parent, os.O_RDONLY)


def is_own(path: Path, mark: Mark) -> bool:
    """Whether a file has the mark, or is empty."""
    with path.open("rb") as stream:
        head = stream.read(ENDS)
        tail = max(ENDS, footer_size(stream))
        stream.seek(max(len(head), stream.seek(0, os.SEEK_END) - tail))
        ends = head + stream.read()  # what is left out between them is in no mark
        return not head or re.search(mark.value, ends, re.MULTILINE) is not None


def marks_of(path: Path) -> list[Mark]:
    """The kinds of file of this program that a file looks like; none for an empty one."""
    if not path.stat().st_size:
        return []
    return [mark for mark in Mark if mark is not Mark.ANY and is_own(path, mark)]


def check_outputs(sources: Iterable[Path], *outputs: Output) -> None:
    """Check outputs before the work: files that can be written, under names of their own.

    Raises OutputError for what cannot be written, UsageError for one name twice or for one of
    the files that are read.
    """
    given = [(path, mark) for path, mark in outputs if path is not None]
    check_not_read(sources, [path for path, _ in given])
    check_apart(path for path, _ in given)
    for path, mark in given:
        check_writable(path, mark)


def real(path: Path) -> Path:
    """A path without links, as far as they lead somewhere; `Path.resolve` raises in a circle.

    A pipe that a process has open, as /dev/stdout, leads to no path: it is its own.
    """
    target = Path(os.path.realpath(path))
    is_there, leads_on = map(os.path.exists, (path, target))  # no error for what is closed
    return path if is_there and not leads_on else target


def check_apart(paths: Iterable[Path]) -> None:
    """Raise UsageError for one file under two names, also where capitals do not count."""
    seen: dict[tuple[int, int] | str, Path] = {}
    for path in paths:
        with writing(path):
            status = path.stat() if path.exists() else None
        name = os.path.realpath(path).casefold()
        key = (status.st_dev, status.st_ino) if status else name
        if key in seen:
            raise UsageError(f"{seen[key]}, {path}: expected names that differ")
        seen[key] = path


def check_not_read(sources: Iterable[Path], paths: Iterable[Path]) -> None:
    """Raise UsageError for a file to write that is one of those that are read, or would be next."""
    read: list[Path] = []
    for source in sources:
        with reading(source):
            read += [source] if source.exists() else []
    folders = [real(source) for source in read if source.is_dir()]
    for path in paths:
        with writing(path):
            is_read = path.exists() and any(path.samefile(source) for source in read)
        if is_read:
            raise UsageError(f"{path} is the spec or data that is read: give another name")
        if any(real(path).is_relative_to(folder) for folder in folders):
            raise UsageError(f"{path} would lie in a folder that is read: give another name")


def run_file(table: Path) -> Path:
    """The file of what differs between runs: states.parquet, states.run.json.

    >>> run_file(Path("out/states.parquet")).as_posix()
    'out/states.run.json'
    """
    stem = table.stem if table.suffix == ".parquet" else table.name
    return table.parent / f"{stem}.run.json"


def check_appendable(path: Path, sources: Iterable[Path]) -> None:
    """Raise OutputError before the work rather than after it.

    Raises OutputError for what cannot be written, or is no text to append Markdown to;
    UsageError for one of the files that are read.
    """
    check_not_read(sources, (path,))
    if control := control_character(str(path)):
        raise OutputError(f"cannot write {path}: {control} in it")
    if path.suffix.lower() in NO_TEXT:
        hint = "give a name such as summary.md"
        raise OutputError(f"cannot append to {path}: Markdown is no {path.suffix} file; {hint}")
    with writing(path):
        if path.is_fifo():  # it would be waited for
            raise OSError(None, "is a device or pipe, not a file")
        if path.is_file():
            _check_text(path)
        path.open("ab").close()


def _check_text(path: Path) -> None:
    """Raise OutputError for a file that Markdown would destroy."""
    if marks_of(path):
        raise OutputError(f"cannot append to {path}: dpg made it, and would not know it any more")
    decoder = getincrementaldecoder("utf-8")()
    with path.open("rb") as stream:
        try:
            while block := stream.read(ENDS):
                if "\0" in decoder.decode(block):
                    raise OutputError(f"cannot append to {path}: it is no text")
            decoder.decode(b"", final=True)
        except UnicodeDecodeError:
            raise OutputError(f"cannot append to {path}: it is no text in UTF-8") from None


def check_writable(path: Path, mark: Mark = Mark.NONE) -> None:
    """Raise OutputError before the work rather than after it."""
    target = real(path)
    with writing(path), _beside(target):
        _check_replaceable(target, mark)


@contextmanager
def sole_use(folder: Path) -> Iterator[None]:
    """Make a folder if need be, and keep every other process that asks out of it.

    Raises UsageError where another is at work there, OutputError where there can be no such
    folder. A folder that was made and stayed empty is removed, but not on Windows.
    """
    if control := control_character(str(folder)):
        raise OutputError(f"cannot write {folder}: {control} in it")
    with writing(folder):
        is_new = not folder.exists()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except FileExistsError:
            raise OSError(None, "it is no folder") from None
        except RecursionError:  # pathlib calls itself for each
            raise OSError(None, "too many folders in one another") from None
        handle = _handle(folder)
    is_free = True
    with suppress(OSError):  # a file system without locks
        is_free = lock(handle, blocking=False)
    if not is_free:
        os.close(handle)
        raise UsageError(f"another dpg is at work in {folder}: wait, or name another")
    try:
        yield
    finally:
        if is_new:
            with suppress(OSError):
                folder.rmdir()
        os.close(handle)


def _handle(folder: Path) -> int:
    """The path that is locked for a folder: itself; on Windows a file in it."""
    if OPENS_FOLDERS:
        return os.open(folder, os.O_RDONLY)
    return os.open(folder / ".dpg.lock", os.O_RDWR | os.O_CREAT | getattr(os, "O_TEMPORARY", 0))


def _check_replaceable(target: Path, mark: Mark) -> None:
    """Raise OSError for what is not of this program, or was edited, or its owner protects."""
    if not target.is_file():
        return
    if not os.access(target, os.W_OK):
        raise PermissionError(None, "it is write-protected")
    hint = "move it away, or give another name"
    if not is_own(target, mark):
        whose = "of dpg, but another kind of file" if marks_of(target) else "not of dpg"
        raise FileExistsError(None, f"it is there and {whose}; {hint}")
    if mark in EDITED and is_edited(target):
        raise FileExistsError(None, f"it was edited since dpg wrote it; {hint}")


@contextmanager
def _beside(path: Path) -> Iterator[Path]:
    """An empty file in the same folder, with the permissions of the old one or of a new one.

    Renaming over a device or pipe would replace it, /dev/null for the whole machine.
    """
    if control := control_character(str(path)):
        raise OSError(None, f"{control} in it")
    if path.is_dir():
        raise IsADirectoryError(None, "is a folder")
    if path.exists() and not path.is_file():
        raise OSError(None, "is a device or pipe, not a file")
    if path.is_symlink():  # none is left in a real path
        raise OSError(None, "its links lead in a circle")
    with temporary_file(path) as (temporary, handle):
        _permit(handle, path)
        yield temporary


def _permit(handle: int | None, old: Path) -> None:
    """Give a new file the permissions and, as far as one may, the owners of an old one."""
    if handle is None:  # Windows, where a file has those of its folder
        return
    if not old.exists():
        mask = os.umask(0)
        os.umask(mask)
        with _as_far_as_allowed():
            os.fchmod(handle, 0o666 & ~mask)
        return
    status = old.stat()
    for owner, group in ((status.st_uid, -1), (-1, status.st_gid)):
        with _as_far_as_allowed():
            os.fchown(handle, owner, group)
    is_same_group = os.fstat(handle).st_gid == status.st_gid
    with _as_far_as_allowed():
        os.fchmod(handle, stat.S_IMODE(status.st_mode) & (0o777 if is_same_group else 0o707))


@contextmanager
def _as_far_as_allowed() -> Iterator[None]:
    """Go on where the file system refuses what is only nice to have; losing data is an error."""
    try:
        yield
    except OSError as error:
        if not isinstance(error, PermissionError) and error.errno not in REFUSED:
            raise


def _sync(path: Path, flags: int) -> None:
    handle = os.open(path, flags)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
