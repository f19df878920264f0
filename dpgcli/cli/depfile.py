"""What a sweep reads and writes, as a dependency file for Make."""

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dpgcli.studies.sweep import Study


def write_depfile(path: Path, study: "Study") -> None:
    """Targets, what they were made from, and an empty rule for each of those, as gcc -MP does."""
    from dpgcli.files.output import Mark, check_not_read, whole_file
    from dpgcli.studies.sweep import DESIGNS, STATES

    check_not_read(study.sweep.files, (path,))
    study.folder.mkdir(parents=True, exist_ok=True)
    targets = " ".join(_escaped(study.folder / name) for name in (STATES, DESIGNS))
    sources = [_escaped(source) for source in study.sweep.files if source != Path("-")]
    text = f"{targets}: {' '.join(sources)}\n" + "".join(f"\n{source}:\n" for source in sources)
    with whole_file(path, Mark.DEPFILE) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _escaped(path: Path) -> str:
    """A name as Make reads it."""
    return re.sub(r"([ #\\])", r"\\\1", os.path.normpath(path)).replace("$", "$$")
