"""Tables that are folders of files, as databases and Spark write them: their parts, in order."""

from pathlib import Path

import pandas as pd

from dpgcli.files.layout import NUMBER
from dpgcli.files.places import shown
from dpgcli.files.sweep_file.tables import NoTableError

SUFFIXES = (".parquet", ".csv")
MOST_PARTS = 10_000


def parts_of(folder: Path) -> tuple[list[Path], list[Path]]:
    """The files of a table that is a folder, by name, and the folders where they were looked for.

    Those that begin with . or _ are no parts. Raises NoTableError where there is none, or what may
    be one, as it lies elsewhere or has another name, or more than MOST_PARTS of them all.
    """
    folders: list[Path] = [folder]
    files: list[Path] = []
    for place in folders:  # which grows
        for path in place.iterdir():
            if path.name.startswith((".", "_")):
                continue
            if path.is_symlink():
                raise NoTableError("a folder with links in it", "copy what they point to")
            (folders if path.is_dir() else files).append(path)
            if len(folders) + len(files) > MOST_PARTS:
                raise NoTableError(f"a folder of more than {MOST_PARTS:,} files", "join them")
    found = sorted(path for path in files if path.suffix.lower() in SUFFIXES)
    if not found:
        raise NoTableError("a folder without any .parquet or .csv file")
    if others := sorted({*files} - {*found}):
        more = f" and {len(others) - 1:,} more" if len(others) > 1 else ""
        name = shown(others[0].relative_to(folder).as_posix())
        raise NoTableError(f"{name}{more} beside its parts", "take out what is no part")
    if len({path.suffix.lower() for path in found}) > 1:
        raise NoTableError("a folder with .parquet and .csv files", "keep one kind of them")
    return found, sorted(folders)


def joined(folder: Path, frames: dict[Path, pd.DataFrame]) -> pd.DataFrame:
    """One table of all parts, with the values that names of folders such as `key=6.5` give.

    Raises NoTableError for parts of other columns than the first.
    """
    parts = []
    for path, frame in frames.items():
        folders = path.relative_to(folder).parts[:-1]
        named = [name.split("=", 1) for name in folders if "=" in name]
        twice = {key for key, _ in named if key in frame or [k for k, _ in named].count(key) > 1}
        if twice:
            raise NoTableError(f"{', '.join(sorted(twice))} twice, for {path.name}", "name it once")
        parts.append(frame.assign(**{key: _number(value) for key, value in named}))
    _check_alike(dict(zip(frames, parts, strict=True)))
    return pd.concat([part for part in parts if len(part)] or parts[:1], ignore_index=True)


def _check_alike(parts: dict[Path, pd.DataFrame]) -> None:
    """Raise NoTableError for parts of other columns, or types, than the first that has rows."""
    first = next((part for part in parts.values() if len(part)), next(iter(parts.values())))
    for path, part in parts.items():
        if list(part.columns) != list(first.columns):
            raise NoTableError(f"other columns in {path.name} than in the first part")
        kinds = ({part[name].dtype.kind, first[name].dtype.kind} for name in part)
        if len(part) and any(len(kind) > 1 and kind != {"i", "f"} for kind in kinds):
            raise NoTableError(f"other types in {path.name} than in the first part")


def _number(text: str) -> float | int | str:
    """A number where a text is one, as in a cell."""
    if NUMBER.fullmatch(text) is None:
        return text
    return int(text) if text.lstrip("+-").isdigit() else float(text)
