"""What a sweep reads and writes, as a dependency file for Make."""

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dpgcli.studies.sweep import Study


# What no spelling brings past Make: characters, places where more of them have a meaning (users'
# homes, libraries, special targets, grouped targets, members of archives), patterns of both kinds.
UNFIT = re.compile(r"[\x00-\x1f\x7f-\x9f=;|\\]|^~|^-l|^\.[A-Z_]+$|[ &]$|\(.*\)$|%.*[*?[]|[*?[].*%")
SPECIAL = re.compile(r"([ #:*?[])")
HEAD = "# dpg sweep: what its tables are made from"


def write_depfile(path: Path, study: "Study") -> None:
    """Targets, what they were made from, and an empty rule for each of those, as gcc -MP does.

    Raises UsageError for a name that Make would read as something else than a name.
    """
    from dpgcli.files.output import Mark, check_not_read, whole_file
    from dpgcli.studies.sweep import DESIGNS, STATES

    check_not_read(study.sweep.files, (path,))
    targets = " ".join(_target(study.folder / name) for name in (STATES, DESIGNS))
    sources = [source for source in study.sweep.files if source != Path("-")]
    text = f"{HEAD}\n{targets}: {' '.join(map(_spelled, sources))}\n"
    text += "".join(f"\n{_target(source)}:\n" for source in sources)
    study.folder.mkdir(parents=True, exist_ok=True)
    with whole_file(path, Mark.DEPFILE) as temporary:
        temporary.write_bytes(os.fsencode(text))


def _target(path: Path) -> str:
    """A name before a colon, where a % would make a pattern of it."""
    return _spelled(path).replace("%", r"\%")


def _spelled(path: Path) -> str:
    """A name as Make reads it."""
    from dpgcli.errors import UsageError
    from dpgcli.files.places import shown

    name = os.path.normpath(path)
    if unfit := UNFIT.search(name):
        raise UsageError(f"--depfile: Make cannot take {shown(unfit[0])} in the name {name}")
    return SPECIAL.sub(r"\\\1", name).replace("$", "$$")
