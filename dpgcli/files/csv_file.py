"""CSV and data frames read strictly: what each cell says, where it stands, all problems at once."""

import hashlib
import io
import math
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import field, replace
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias, Union

import numpy as np

from dpgcli.arrays import Array
from dpgcli.design.dimensions import LARGEST
from dpgcli.errors import Field, Message, Problem, SpecError
from dpgcli.files.content import content_of, decoded
from dpgcli.files.frames import frame_of
from dpgcli.files.headers import headed, may_be_titles
from dpgcli.files.layout import (
    COMMENT,
    GROUPED,
    NUMBER,
    Marks,
    doubtful_point,
    is_number,
    marks_in,
    rows_in,
    separator_of,
)
from dpgcli.files.places import Location, few, in_order, located, shown
from dpgcli.files.units import are_alike, is_same, name_and_unit, stem_and_unit
from dpgcli.records import dataclass

if TYPE_CHECKING:
    import pandas as pd

Tabular: TypeAlias = Union[str, Path, "pd.DataFrame", Mapping[str, Any]]
"""A CSV file, a data frame (of pandas, or what has `to_pandas`), or columns by name."""

FRAME = "data frame"
NO_NUMBERS = "a file without numbers"
MAX_BYTES = 64 * 1024 * 1024
MOST_NAMED = 100  # columns
MOST_LINES, MOST_CELLS = 1_000_000, 2_000_000  # in 600 MB of memory
UTF_16 = (b"\xff\xfe", b"\xfe\xff")  # its marks
FOREIGN = {
    b"PK\x03\x04": "an Excel workbook or an archive",
    b"\xd0\xcf\x11\xe0": "an Excel workbook",
    b"PAR1": "a Parquet file",
}
WESTERN = frozenset("äöüÄÖÜßéèêàâçñáíóúåøæÅØÆôîïëìòùõãÉÈÇÑ°µ²³·±–—’“”…€×«»§® ")
TO_COMMENT = "behind the # of a comment stands a space"
CUT = Message(
    "a title that blanks or commas cut in two goes into quotes; or ",
    Field("skip"),
    " the lines above the numbers, and choose columns by place",
)
DECIMALS = "with decimal commas? write decimal points, or part cells by semicolons"
WHICH_MARK = (
    "thousands, or a decimal comma? write a decimal point",
    "thousands, or decimals? write as many decimals everywhere, or none",
)
TO_BEGIN = Message(
    "a title that stands there once, or a column's place; ",
    Field("skip"),
    " N if the table begins below N lines",
)


@dataclass(frozen=True)
class Choice:
    """What of a file is read, where a machine wrote it: `columns` have our names for its titles.

    A title with a minus before it is that of a column whose numbers are reversed, a number that of
    the column at this place. `skip` lines lie above the table, `units` are those of quantities.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    skip: int | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_by_place(self) -> bool:
        """Whether columns are chosen by their places, and nobody says where the table begins."""
        sources = (source.removeprefix("-") for source in self.columns.values())
        return self.skip is None and any(map(str.isdigit, sources))


AS_IT_IS = Choice()


@dataclass(frozen=True)
class Sheet:
    """The cells of a CSV file by row, the line of each row, and the SHA-256 of the file.

    `names` are ours for columns that were chosen. By name, `units` are those that the file says
    itself, `titles` what it calls a column that was chosen; `reversed` are those whose sign is.
    `remarks` are lines above the header, comments below it as well, and their numbers.
    """

    file: str
    names: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]
    sha256: str
    separator: str = ","
    units: Mapping[str, str] = field(default_factory=dict)
    titles: Mapping[str, str] = field(default_factory=dict)
    reversed: frozenset[str] = frozenset()
    remarks: tuple[tuple[int, str], ...] = ()

    def cells(self, name: str) -> list[str]:
        """The texts of one column."""
        place = self._places[name]
        return [row[place] for row in self.rows]

    @cached_property
    def _places(self) -> dict[str, int]:
        """Where each column stands, by name: a table may have a million."""
        return {name: place for place, name in enumerate(self.names)}

    def chosen(self, kept: Sequence[int]) -> "Sheet":
        """The sheet with some of its rows."""
        rows, lines = [self.rows[i] for i in kept], [self.lines[i] for i in kept]
        return replace(self, rows=rows, lines=lines)

    def renamed(self, names: Mapping[str, str]) -> "Sheet":
        """The sheet with other names, by those that it has; units and titles go with them."""
        return replace(
            self,
            names=tuple(names.get(name, name) for name in self.names),
            units={names.get(name, name): unit for name, unit in self.units.items()},
            titles={names.get(name, name): title for name, title in self.titles.items()},
            reversed=frozenset(names.get(name, name) for name in self.reversed),
        )

    def problem(
        self, row: int | None, key: str, expected: str, found: str, hint: str = ""
    ) -> Problem:
        """A problem in a row, or with the whole file."""
        line = None if row is None else self.lines[row]
        return located(Location(self.file, line), key, expected, found, hint)

    def numbers(
        self,
        names: Sequence[str],
        *,
        may_lack: bool = False,
        factors: Mapping[str, float] = MappingProxyType({}),
    ) -> dict[str, Array]:
        """Columns as numbers by name; empty cells are NaN if they may be lacking.

        Where a caller has looked at a column's unit it says the factor of its numbers. All others
        are in the unit of their name: Raises SpecError where the file says another one, with every
        cell that holds no number.
        """
        cells = {name: self.cells(name) for name in names}
        columns = {
            name: [_number(self.marks.plain(cell), may_lack) for cell in cells[name]]
            for name in names
        }
        problems = [
            problem
            for name, values in columns.items()
            for problem in few(
                self.problem(row, name, *self._no_number(cells[name][row]))
                for row, value in enumerate(values)
                if value is None
            )
        ]
        problems += self._other_units([name for name in names if name not in factors])
        if problems:
            raise SpecError(in_order(problems))
        signs = {name: -1.0 if name in self.reversed else 1.0 for name in names}
        return {
            name: np.array(values, np.float64) * signs[name] * factors.get(name, 1.0)
            for name, values in columns.items()
        }

    def _other_units(self, names: Sequence[str]) -> Iterator[Problem]:
        """Columns that the file says another unit of than their names."""
        for name in names:
            unit, own = self.units.get(name, ""), stem_and_unit(name_and_unit(name)[0])[1]
            if unit and own is not None and not is_same(unit, own):
                expected = f"{own or 'no unit'}, as the name has it"
                yield self.problem(None, name, expected, f"{shown(unit)} beside it")

    @cached_property
    def marks(self) -> Marks:
        """The marks of its numbers: those of the columns that are mostly numbers."""
        columns = [[row[place] for row in self.rows] for place in range(len(self.names))]
        mostly = [cells for cells in columns if 2 * sum(map(is_number, cells)) >= len(cells)]
        marks = marks_in([cell for cells in mostly for cell in cells], self.separator)
        return replace(marks, doubtful=marks.doubtful or doubtful_point(mostly))

    def _no_number(self, cell: str) -> tuple[str, str, str]:
        """Expected, found and hint where there is no number."""
        plain = self.marks.plain(cell)
        if NUMBER.fullmatch(plain):
            expected = f"a number from {-LARGEST:g} to {LARGEST:g}"
            return expected, shown(cell), "is the unit another one?"
        if self.marks.doubtful and GROUPED.fullmatch(cell):
            return "a number", shown(cell), WHICH_MARK["." in cell]
        if is_number(cell):
            mark = "point" if self.marks.decimal == "." else "comma, as elsewhere"
            return "a number", shown(cell), f"write a decimal {mark}"
        return "a number", shown(cell), TO_COMMENT if cell.startswith("#") else ""

    def check_names(self, needed: Sequence[str]) -> None:
        """Raise SpecError for columns that are missing."""
        if problems := [self.missing(name) for name in needed if name not in self.names]:
            raise SpecError(tuple(problems))

    def missing(self, *wanted: str, hint: str = "") -> Problem:
        """The problem that there is no column of any of these names."""
        close = [near for name in wanted for near in get_close_matches(name, self.names, n=1)]
        hint = f"is it {close[0]}?" if close else hint
        expected = f"a column {' or '.join(wanted)}"
        return located(Location(self.file), "header", expected, self._named(), hint)

    @cached_property
    def has_numbers(self) -> bool:
        """Whether a cell is one. A file without any may be no table, and its header a password.

        Messages end up in logs: they do not quote such a header.
        """
        return self.file == FRAME or any(is_number(cell) for row in self.rows for cell in row)

    def _named(self) -> str:
        if not self.has_numbers:
            return NO_NUMBERS
        names = [self.titles.get(name, name) for name in self.names if name]
        more = f" and {len(names) - MOST_NAMED:,} more" if len(names) > MOST_NAMED else ""
        return ", ".join(names[:MOST_NAMED]) + more


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
    return FRAME, frame_of(source).to_csv(index=False).encode(errors="backslashreplace")


def text_of(content: bytes, place: Location) -> str:
    """The text of a table, in UTF-8, in UTF-16 with its mark, or as Windows writes in the West.

    Raises SpecError for what is no text.
    """
    if b"\0" in content[:1000] and not content.startswith(UTF_16):
        raise SpecError((located(place, "file", "text", "zero bytes", "save it as UTF-8"),))
    if kind := next((kind for mark, kind in FOREIGN.items() if content.startswith(mark)), None):
        raise SpecError((located(place, "file", "text", kind, "save it as CSV"),))
    try:
        if content.startswith(UTF_16):
            return content.decode("utf-16")
        return decoded(content, place)
    except UnicodeDecodeError as error:
        raise SpecError((located(place, "file", "text in UTF-16", error.reason),)) from None
    except SpecError:
        text = content.decode("cp1252", errors="replace")
        if WESTERN.issuperset(c for c in text if c > "\x7f"):
            return text
        raise


def read_sheet(
    source: Tabular, wanted: Collection[str] = frozenset(), choice: Choice = AS_IT_IS
) -> Sheet:
    """Read a CSV file with a header; lines that start with # are comments.

    A file may have its own separators and marks, titles above the header and units below it: see
    `files.layout`. The header is the row with the titles that are chosen or names that are
    `wanted`, with their units behind them or without. A data frame is read as the CSV that it
    would be written to, header in line 1, but for comments: it has none, and every row counts.

    Below the header a comment has a space behind the #: spreadsheets write #DIV/0!, and of a row
    such as #5,0.2 nobody knows whether it is meant.
    Raises SpecError for what cannot be read, names that repeat, rows of another length, and
    columns that are called as one that is wanted and not there, but for the unit.
    """
    file, content = _content(source)
    is_file = isinstance(source, str | Path)
    text = text_of(content, Location(file)) if is_file else content.decode()
    _check_size(text, file)
    lines = list(io.StringIO(text, newline=None))
    lines[: choice.skip or 0] = ["\n"] * min(choice.skip or 0, len(lines))
    separator = separator_of(lines) if is_file else ","
    rows, problems = rows_in(lines, separator, file, has_comments=is_file)
    if not rows:
        found = problems or [located(Location(file), "file", "a header and rows", "nothing")]
        raise SpecError(in_order(found))
    is_first = choice.skip is not None or not is_file
    is_parted_by_tabs = separator == "\t"  # which stand in no title
    head = headed(rows, wanted, choice.columns, is_first=is_first, may_be_longer=is_parted_by_tabs)
    line = head.line
    below = [row for row in head.rows if is_file or row.line > 1]  # names that are numbers are none
    problems = list(few(problem for problem in problems if (problem.line or 0) > line))
    sheet = Sheet(
        file,
        head.names,
        [row.cells for row in below],
        [row.line for row in below],
        hashlib.sha256(content).hexdigest(),
        separator,
        head.units,
        head.titles,
        head.reversed,
        tuple(_remarks(lines, line)) if is_file else (),
    )
    problems += [*_unfound(sheet, choice), *_form_problems(sheet, line)]
    problems += _renamed(sheet, wanted, line)
    if is_file and below and choice.is_by_place and may_be_titles(below):
        problems.append(_asked(sheet, 0))
    if is_file and separator == ",":
        problems += _untitled(sheet, head.untitled, line)
    if problems:
        raise SpecError(in_order(problems))
    return sheet


def _check_size(text: str, file: str) -> None:
    """Raise SpecError for more lines or cells than a curve has: each is an object in memory."""
    n_lines = max(text.count("\n"), text.count("\r"))
    n_blanks = text.count(" ")
    if n_lines + n_blanks > MOST_CELLS:
        n_blanks = sum(1 for _ in re.finditer(" +", text))
    n_cells = n_lines + max(n_blanks, *map(text.count, ",;\t|"))
    for most, what, found in ((MOST_LINES, "lines", n_lines), (MOST_CELLS, "cells", n_cells)):
        if found > most:
            expected, hint = f"at most {most:,} {what}", "keep every tenth row"
            problem = located(Location(file), "file", expected, f"about {found:,}", hint)
            raise SpecError((problem,))


def _asked(sheet: Sheet, row: int) -> Problem:
    """The question whether a row has titles or numbers."""
    line, cells = sheet.lines[row], ", ".join(sheet.rows[row])
    answers = f" {line} if these are titles", f" {line - 1} if not"
    hint = Message(Field("skip"), answers[0], ", ", Field("skip"), answers[1])
    return sheet.problem(row, "row", "numbers, not what may be titles", shown(cells), hint)


def _remarks(lines: Sequence[str], header: int) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(map(str.strip, lines), start=1):
        if number < header or (number > header and COMMENT.match(line)):
            yield number, line


def _unfound(sheet: Sheet, choice: Choice) -> Iterator[Problem]:
    """Columns that were chosen, and are not there, or more than once."""
    for name, title in choice.columns.items():
        if name not in sheet.titles:
            yield sheet.missing(title, hint=TO_BEGIN)


def _untitled(sheet: Sheet, places: Sequence[int], header: int) -> Iterator[Problem]:
    """Columns of numbers without a title, between commas: they may be decimals of those before.

    The index that a data frame is written with, which has no title, is the first.
    """
    for place in places:
        cells = (row[place] for row in sheet.rows if len(row) > place)
        if number := next(filter(is_number, cells), ""):
            expected, found = f"a title for column {place + 1}", f"none above {number}"
            yield located(Location(sheet.file, header), "header", expected, found, DECIMALS)


def _renamed(sheet: Sheet, wanted: Collection[str], header: int) -> Iterator[Problem]:
    """Columns called as one that is wanted and not there, but for the unit: they would be lost."""
    lacking = {
        stem.casefold(): (name, unit)
        for name in wanted
        if name not in sheet.names
        for stem, unit in [stem_and_unit(name)]
        if unit
    }
    for name in (name for name in sheet.names if name not in wanted):
        stem, unit = stem_and_unit(re.split(r"\W", name, maxsplit=1)[0])
        known, own = lacking.get(stem.casefold(), ("", ""))
        if unit and own and are_alike(unit, own):
            yield located(Location(sheet.file, header), "header", f"{known}, in {own}", shown(name))


def _form_problems(sheet: Sheet, header: int) -> Iterator[Problem]:
    top = Location(sheet.file, header)
    for name in (name for name, count in Counter(sheet.names).items() if name and count > 1):
        found = shown(name) if sheet.has_numbers else "one"
        yield located(top, "header", "each column once", f"{found} again")
    longest = max(map(len, sheet.rows), default=0)
    if sheet.titles and sheet.separator != "\t" and 0 < longest < len(sheet.names):
        expected = f"{longest} titles, as many as cells below"
        yield located(top, "header", expected, str(len(sheet.names)), CUT)
        return
    yield from few(_row_problems(sheet))
    if not sheet.rows:
        yield located(top, "file", "rows below the header", "none")


def _row_problems(sheet: Sheet) -> Iterator[Problem]:
    for row, cells in enumerate(sheet.rows):
        if len(cells) != len(sheet.names):
            hint = TO_COMMENT if cells[0].startswith("#") else ""
            yield sheet.problem(row, "row", f"{len(sheet.names)} cells", str(len(cells)), hint)


def _number(cell: str, may_lack: bool) -> float | None:
    """The number in a cell, None if there is none."""
    if may_lack and not cell:
        return math.nan
    if not NUMBER.fullmatch(cell):
        return None
    value = float(cell)
    return value if abs(value) <= LARGEST else None
