"""Plain arguments of the functions: texts, numbers, paths, points, choices."""

import os
from collections.abc import Iterable, Sequence
from enum import StrEnum
from importlib import util
from itertools import islice
from numbers import Integral
from pathlib import Path
from typing import Any, TypeVar

from dpgcli.design.dimensions import LARGEST, SMALLEST
from dpgcli.errors import Field, UsageError
from dpgcli.text import is_number, quoted

N_COORDINATES = 2
BYTES = (bytes, bytearray, memoryview)  # whose items are numbers of letters
MOST_ITEMS = 10**6  # of a sequence that is handed in
LARGEST_WHOLE = 2**1000  # far beyond any seed
NO_TABLE = (".csv", ".json", ".yaml", ".yml", ".svg", ".png")

E = TypeVar("E", bound=StrEnum)
W = TypeVar("W", int, int | None)
R = TypeVar("R", float, float | None)


def each_of(field: str, value: Any) -> tuple[Any, ...]:
    """The items of a sequence; of what is none, such as a text, itself.

    Raises UsageError for more than MOST_ITEMS of them, which may go on without end.

    >>> each_of("only", "abc"), each_of("only", ["a", "b"]), each_of("only", b"ab")
    (('abc',), ('a', 'b'), (b'ab',))
    """
    if isinstance(value, (str, *BYTES)) or not isinstance(value, Iterable):
        return (value,)
    try:
        found = tuple(islice(value, MOST_ITEMS + 1))
    except TypeError:  # an array without axes
        return (value,)
    if len(found) > MOST_ITEMS:
        raise UsageError(Field(field), f": expected at most {MOST_ITEMS:,} items")
    return found


def as_texts(field: str, texts: str | Iterable[str]) -> tuple[str, ...]:
    """Texts; one alone is not a sequence of letters. Raises UsageError for what is none.

    >>> as_texts("only", "abc"), as_texts("only", ["a", "b"])
    (('abc',), ('a', 'b'))
    """
    listed = each_of(field, texts)
    if not all(isinstance(text, str) for text in listed):
        raise UsageError(Field(field), f" {quoted(texts)}: expected a text or several")
    return listed


def path_of(field: str, path: str | os.PathLike[str]) -> Path:
    """The path of a file or folder. Raises UsageError for what is none, or no system can name.

    An empty text is none, though for pathlib it is the current folder.

    >>> path_of("spec", None)
    Traceback (most recent call last):
        ...
    dpgcli.errors.UsageError: spec None: expected a path
    """
    try:
        found = Path(path)
        is_name = b"\0" not in os.fsencode(found) and path != ""
    except (TypeError, UnicodeEncodeError):  # half of a pair in UTF-16
        is_name = False
    if not is_name:
        raise UsageError(Field(field), f" {quoted(path)}: expected a path")
    return found


def files_of(*sources: object) -> tuple[Path, ...]:
    """Those of the sources that are files, wherever the program works by the time of writing."""
    return tuple(Path(s).absolute() for s in sources if isinstance(s, str | os.PathLike))


def check_numbers(**values: float | None) -> None:
    """Raise UsageError for an argument that is no number; none where it is optional.

    >>> check_numbers(tolerance=1e-9, target_error=None)
    """
    for field, value in values.items():
        if value is not None and not is_number(value):
            raise UsageError(Field(field), f" {quoted(value)}: expected a number")


def check_whole(**values: int | None) -> None:
    """Raise UsageError for an argument that is no whole number; none where it is optional.

    >>> check_whole(jobs=2)
    """
    for field, value in values.items():
        is_whole = isinstance(value, Integral) and not isinstance(value, bool)
        if value is not None and not (is_whole and abs(value) < LARGEST_WHOLE):
            raise UsageError(Field(field), f" {quoted(value)}: expected a whole number")


def whole(field: str, value: W) -> W:
    """A whole number as Python's own, which JSON can say too; raises UsageError for what is none.

    >>> import numpy as np
    >>> whole("top", np.int64(3)), whole("top", None)
    (3, None)
    """
    check_whole(**{field: value})
    return value if value is None else int(value)


def number(field: str, value: R) -> R:
    """A number as Python's own, as `whole`; raises UsageError for what is none."""
    check_numbers(**{field: value})
    return value if value is None else float(value)


def check_callable(**values: object) -> None:
    """Raise UsageError for an argument that cannot be called, before any work.

    >>> check_callable(watch=print)
    """
    for field, value in values.items():
        if not callable(value):
            raise UsageError(Field(field), f" {quoted(value)}: expected a function")


def check_texts(**values: str | None) -> None:
    """Raise UsageError for an argument that is no text; none where it is optional.

    >>> check_texts(formulation="chain", shard=None)
    """
    for field, value in values.items():
        if value is not None and not isinstance(value, str):
            raise UsageError(Field(field), f" {quoted(value)}: expected a text")


def check_flags(**values: bool) -> None:
    """Raise UsageError for an argument that is neither True nor False.

    >>> check_flags(restart=False)
    """
    for field, value in values.items():
        if not isinstance(value, bool):
            raise UsageError(Field(field), f" {quoted(value)}: expected True or False")


def point(field: str, place: Sequence[float]) -> tuple[float, float]:
    """A place in some data, mm. Raises UsageError for what is not two numbers.

    >>> point("first_station", [5.375, -0.75])
    (5.375, -0.75)
    """
    is_listed = isinstance(place, Sequence) or hasattr(place, "tolist")  # no set, and no table
    parts = each_of(field, place) if is_listed else ()
    numbers = [float(part) for part in parts if is_number(part) and abs(part) <= LARGEST]
    if not len(numbers) == len(parts) == N_COORDINATES:
        raise UsageError(
            Field(field), f" {quoted(place)}: expected two numbers in mm, such as 5.375, -0.75"
        )
    return numbers[0], numbers[1]


def figure_path(path: str | Path) -> Path:
    """The path of a figure. Raises UsageError for a suffix that cannot be drawn."""
    figure = path_of("path", path)
    if figure.suffix.lower() not in (".svg", ".png"):
        raise UsageError(f"path {path}: expected a name that ends in .svg or .png")
    check_installed("a figure", "matplotlib")
    return figure


def table_path(path: str | Path) -> Path:
    """The path of a Parquet file. Raises UsageError for a suffix that says something else."""
    table = path_of("path", path)
    if table.suffix.lower() in NO_TABLE:
        raise UsageError(f"path {path}: writes Parquet, give a name that ends in .parquet")
    return table


def check_installed(what: str, package: str) -> None:
    """Raise UsageError if what is asked for needs a package that is not there."""
    if util.find_spec(package) is None:
        raise UsageError(f"{what} needs {package}: pip install {package}")


def check_positive(field: str, value: float | None) -> None:
    """Raise UsageError for a number, if there is one, that is not above zero or out of reach."""
    check_numbers(**{field: value})
    if value is not None and not SMALLEST <= value <= LARGEST:
        found = f"{value:g}" if isinstance(value, float) else quoted(value)
        expected = f"expected a number > 0, from {SMALLEST:g} to {LARGEST:g}"
        raise UsageError(Field(field), f" {found}: {expected}")


def chosen(kind: type[E], field: str, value: str) -> E:
    """A member of an enumeration by its text. Raises UsageError for another text."""
    try:
        return kind(value if isinstance(value, str) else quoted(value))
    except ValueError:
        known = ", ".join(map(str, kind))
        raise UsageError(Field(field), f" {quoted(value)}: expected {known}") from None
