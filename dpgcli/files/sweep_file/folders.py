"""Tables that are folders of files, as databases and Spark write them: their parts, in order."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pandas as pd

from dpgcli.files.sweep_file.tables import NoTableError

SUFFIXES = (".parquet", ".csv")
MOST_PARTS = 10_000


def parts_of(folder: Path) -> list[Path]:
    """The files of a table that is a folder, by name; those that begin with . or _ are no parts.

    Raises NoTableError where there is none, or what may be one and lies elsewhere.
    """
    there = list(islice(_inside(folder), MOST_PARTS + 1))
    if len(there) > MOST_PARTS:
        raise NoTableError(f"a folder of more than {MOST_PARTS:,} files", "join them")
    found = sorted(path for path in there if path.suffix in SUFFIXES)
    if not found:
        raise NoTableError("a folder without any .parquet or .csv file")
    if len({path.suffix for path in found}) > 1:
        raise NoTableError("a folder with .parquet and .csv files", "keep one kind of them")
    return found


def _inside(folder: Path) -> Iterator[Path]:
    for path in folder.iterdir():
        if path.name.startswith((".", "_")):
            continue
        if path.is_symlink():
            raise NoTableError("a folder with links in it", "copy what they point to")
        if path.is_dir():
            yield from _inside(path)
        else:
            yield path


def joined(folder: Path, frames: dict[Path, pd.DataFrame]) -> pd.DataFrame:
    """One table of all parts, with the values that names of folders such as `key=6.5` give.

    Raises NoTableError for parts of other columns than the first.
    """
    parts = []
    for path, frame in frames.items():
        folders = path.relative_to(folder).parts[:-1]
        named = dict(name.split("=", 1) for name in folders if "=" in name)
        parts.append(frame.assign(**{key: _number(value) for key, value in named.items()}))
    columns = list(parts[0].columns)
    for path, part in zip(frames, parts, strict=True):
        if list(part.columns) != columns:
            raise NoTableError(f"other columns in {path.name} than in the first part")
    return pd.concat(parts, ignore_index=True)


def _number(text: str) -> float | int | str:
    """A number where a text is one."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
