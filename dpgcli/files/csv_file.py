"""CSV and data frames read strictly: what each cell says, where it stands, all problems at once."""

import csv
import hashlib
import io
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, Union

import numpy as np

from dpgcli.arrays import Array
from dpgcli.design.dimensions import LARGEST
from dpgcli.errors import Problem, SpecError
from dpgcli.files.content import content_of, decoded
from dpgcli.files.places import Location, in_order, located, shown

if TYPE_CHECKING:
    import pandas as pd

Tabular: TypeAlias = Union[str, Path, "pd.DataFrame", Mapping[str, Any]]
"""A CSV file, a data frame (of pandas, or what has `to_pandas`), or columns by name."""

FRAME = "data frame"
MAX_BYTES = 64 * 1024 * 1024
COMMENT = re.compile(r"#+\s|#$")
TO_COMMENT = "behind the # of a comment stands a space"
NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?", re.ASCII)


@dataclass(frozen=True)
class Sheet:
    """The cells of a CSV file by row, the line of each row, and the SHA-256 of the file."""

    file: str
    names: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]
    sha256: str

    def cells(self, name: str) -> list[str]:
        """The texts of one column."""
        place = self.names.index(name)
        return [row[place] for row in self.rows]

    def chosen(self, kept: Sequence[int]) -> "Sheet":
        """The sheet with some of its rows."""
        rows, lines = [self.rows[i] for i in kept], [self.lines[i] for i in kept]
        return replace(self, rows=rows, lines=lines)

    def problem(
        self, row: int | None, key: str, expected: str, found: str, hint: str = ""
    ) -> Problem:
        """A problem in a row, or with the whole file."""
        line = None if row is None else self.lines[row]
        return located(Location(self.file, line), key, expected, found, hint)

    def numbers(self, names: Sequence[str], *, may_lack: bool = False) -> dict[str, Array]:
        """Columns as numbers by name; empty cells are NaN if they may be lacking.

        Raises SpecError with every cell that holds no number.
        """
        cells = {name: self.cells(name) for name in names}
        columns = {name: [_number(cell, may_lack) for cell in cells[name]] for name in names}
        problems = [
            self.problem(row, name, *_no_number(cells[name][row]))
            for name, values in columns.items()
            for row, value in enumerate(values)
            if value is None
        ]
        if problems:
            raise SpecError(in_order(problems))
        return {name: np.array(values, np.float64) for name, values in columns.items()}

    def check_names(self, needed: Sequence[str]) -> None:
        """Raise SpecError for columns that are missing."""
        if problems := [self.missing(name) for name in needed if name not in self.names]:
            raise SpecError(tuple(problems))

    def missing(self, *wanted: str) -> Problem:
        """The problem that there is no column of any of these names."""
        close = [near for name in wanted for near in get_close_matches(name, self.names, n=1)]
        hint = f"is it {close[0]}?" if close else ""
        expected, found = f"a column {' or '.join(wanted)}", ", ".join(self.names)
        return located(Location(self.file), "header", expected, found, hint)


def name_of(source: Tabular) -> str:
    """The name of the file, or what stands for one.

    >>> name_of("curves/dome.csv"), name_of({"travel_mm": [0.0]})
    ('dome.csv', 'data frame')
    """
    return Path(source).name if isinstance(source, str | Path) else FRAME


def _content(source: Tabular) -> tuple[str, bytes]:
    """The name of the source in messages, and its text as CSV."""
    if isinstance(source, str | Path):
        hint = "a curve or a table of states is short"
        return str(source), content_of(Path(source), Location(str(source)), MAX_BYTES, hint)
    import pandas as pd

    convert: Any = getattr(source, "to_pandas", None)  # as of an Arrow table
    frame = convert() if convert is not None else pd.DataFrame(source)
    return FRAME, frame.to_csv(index=False).encode()


def read_sheet(source: Tabular) -> Sheet:
    """Read a CSV file with a header; lines that start with # are comments.

    A data frame is read as the CSV that it would be written to, header in line 1.

    Below the header a comment has a space behind the #: spreadsheets write #DIV/0!, and of a row
    such as #5,0.2 nobody knows whether it is meant.
    Raises SpecError for what cannot be read, names that repeat, and rows of another length.
    """
    file, content = _content(source)
    rows: list[list[str]] = []
    lines, problems = [], []
    text = io.StringIO(decoded(content, Location(file)), newline=None)
    for number, line in enumerate(map(str.strip, text), start=1):
        if line and not (COMMENT.match(line) if rows else line.startswith("#")):
            try:
                cells = next(csv.reader([line], skipinitialspace=True, strict=True))
            except csv.Error as error:
                problems.append(
                    located(Location(file, number), "row", "cells of a CSV", str(error))
                )
                continue
            rows.append([cell.strip() for cell in cells])
            lines.append(number)
    if not rows and not problems:
        problems.append(located(Location(file), "file", "a header and rows", "nothing"))
    if problems:
        raise SpecError(in_order(problems))
    digest = hashlib.sha256(content).hexdigest()
    sheet = Sheet(file, tuple(rows[0]), rows[1:], lines[1:], digest)
    problems = list(_form_problems(sheet, lines[0]))
    if problems:
        raise SpecError(in_order(problems))
    return sheet


def _form_problems(sheet: Sheet, header: int) -> Iterator[Problem]:
    top = Location(sheet.file, header)
    if len(sheet.names) == 1 and (foreign := [c for c in ";\t" if c in sheet.names[0]]):
        hint = "and write decimal points"
        yield located(top, "header", "columns separated by commas", shown(foreign[0]), hint)
        return
    for name in dict.fromkeys(n for n in sheet.names if sheet.names.count(n) > 1):
        yield located(top, "header", "each column once", f"{shown(name)} again")
    for row, cells in enumerate(sheet.rows):
        if len(cells) != len(sheet.names):
            hint = TO_COMMENT if cells[0].startswith("#") else ""
            yield sheet.problem(row, "row", f"{len(sheet.names)} cells", str(len(cells)), hint)
    if not sheet.rows:
        yield located(top, "file", "rows below the header", "none")


def _number(cell: str, may_lack: bool) -> float | None:
    """The number in a cell, None if there is none."""
    if may_lack and not cell:
        return math.nan
    if not NUMBER.fullmatch(cell):
        return None
    value = float(cell)
    return value if abs(value) <= LARGEST else None


def _no_number(cell: str) -> tuple[str, str, str]:
    """Expected, found and hint where there is no number."""
    if NUMBER.fullmatch(cell):
        return f"a number of at most {LARGEST:g}", shown(cell), "is the unit another one?"
    if NUMBER.fullmatch(cell.replace(",", ".", 1)):
        return "a number", shown(cell), "write a decimal point"
    return "a number", shown(cell), TO_COMMENT if cell.startswith("#") else ""
