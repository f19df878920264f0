"""Dependency file for Make: the files that a sweep reads and writes."""

import os
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from dpgcli.records import dataclass

# What no spelling brings past Make: characters, places where more of them have a meaning (users'
# homes, libraries, special targets, grouped targets, members of archives), patterns of both kinds.
UNFIT = re.compile(r"[\x00-\x1f\x7f-\x9f=;|\\]|^~|^-l|^\.[A-Z_]+$|[ &]$|\(.*\)$|%.*[*?[]|[*?[].*%")
SPECIAL = re.compile(r"([ #:*?[])")
HERE = re.compile(r"^(\./+)+")  # Make drops it before it looks at the rest
T = TypeVar("T")
HEAD = "# dpg sweep: what its tables are made from"
# Make's own rules make `finger` from a newer `finger.sh`, and hand names to a shell as they are. An
# empty recipe for each file would stop them too, and with them a rule that makes a calibration.
# A link set to another file is newer than that file may be: Make looks at both where it is told to.
FLAGS = "MAKEFLAGS += --no-builtin-rules --check-symlink-times"


def depfile_text(folder: str, tables: Iterable[str], files: Iterable[Path]) -> str:
    """Targets, what they were made from, and an empty rule for each of those, as gcc -MP does.

    Make's own rules are put aside, with which it would remake what was read; links count too.
    Make knows a target by its letters: `folder` is as it was typed, and the targets are in it
    as a rule has them that names `$(OUT)/states.parquet`, and as they are commonly spelled.
    Raises UsageError for a name that Make would read as something else than a name.
    """
    names = [f"{each}/{name}" for each in (folder, Path(folder)) for name in tables]
    targets = dict.fromkeys(map(_target, names))
    sources = [_plain(source) for source in files if source != Path("-")]
    _check_members(sources)
    text = f"{HEAD}\n{' '.join(targets)}: {' '.join(map(_spelled, sources))}\n"
    text += "".join(f"\n{_target(source)}:\n" for source in sources)
    return f"{text}\n{FLAGS}\n"


@dataclass(frozen=True)
class Depfile:
    """A depfile to write once its tables are."""

    path: Path
    text: str

    def beside(self, carry_out: Callable[[Callable[[], T]], bool], work: Callable[[], T]) -> bool:
        """Carry out work, and write the depfile after it but before its tables.

        New tables beside an old one would stay for good. Where there was nothing to do it is
        written all the same. Raises OutputError, before the work, for a file that is no depfile.
        """
        from dpgcli.files.output import Mark, check_writable

        def with_depfile() -> T:
            done = work()
            self._write()
            return done

        check_writable(self.path, Mark.DEPFILE)
        if carry_out(with_depfile):
            return True
        self._write()
        return False

    def _write(self) -> None:
        from dpgcli.files.output import Mark, whole_file

        with whole_file(self.path, Mark.DEPFILE) as temporary:
            temporary.write_bytes(os.fsencode(self.text))


def _plain(path: Path) -> str:
    """A name without `..` that leads back: not behind a linked folder, whose `..` is elsewhere."""
    plain = os.path.normpath(path)
    is_same = os.path.realpath(Path(plain).parent) == os.path.realpath(path.parent)
    return plain if is_same else os.fspath(path)


def _check_members(names: Sequence[str]) -> None:
    """Raise UsageError for names that together are members of an archive: lib(one two)."""
    from dpgcli.errors import UsageError

    last = max((place for place, name in enumerate(names) if name.endswith(")")), default=0)
    opening = next((name for name in names[:last] if "(" in HERE.sub("", name)[1:]), None)
    if opening is not None:
        raise UsageError(
            f"--depfile: Make cannot take the names {opening} … {names[last]} together"
        )


def _target(name: str) -> str:
    """A name before a colon, where a % would make a pattern of it."""
    return _spelled(name).replace("%", r"\%")


def _spelled(name: str) -> str:
    """A name as Make reads it."""
    from dpgcli.errors import UsageError
    from dpgcli.files.places import shown

    name = HERE.sub("", name)
    if unfit := UNFIT.search(name):
        raise UsageError(f"--depfile: Make cannot take {shown(unfit[0])} in the name {name}")
    return SPECIAL.sub(r"\\\1", name).replace("$", "$$")
