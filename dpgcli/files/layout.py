"""How a table stands in a text: what parts its cells, its decimal mark, where it begins.

Spreadsheets and testing machines of other languages write semicolons or tabs and decimal commas,
and put titles above the header and units below it.
"""

import csv
import re
from collections.abc import Container, Iterator, Sequence
from itertools import groupby, pairwise

from dpgcli.errors import Problem
from dpgcli.files.places import MOST_ALIKE, Location, located
from dpgcli.files.unit_words import are_units
from dpgcli.files.units import is_unit, name_and_unit
from dpgcli.records import dataclass

COMMENT = re.compile(r"#+\s|#$")
SEPARATORS = (",", ";", "\t", "|", "  ", " ")  # a pair of blanks stands for two or more
BLANKS = re.compile("  +")  # no tabs, and none that group thousands
IN_BRACKETS = r"[\[(<{][^\[\]()<>{}]{0,30}[\])>}]"
WORD = re.compile(f"{IN_BRACKETS}|[^ ]+(?: {IN_BRACKETS})?")  # a title has its unit behind it
PARTED = "\x1f"  # between cells that blanks part: a tab may stand within one
QUOTED = re.compile('"[^"]*"')
SAMPLE = 200  # of the last lines, which are of the table
NUMBER = re.compile(r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?", re.ASCII)
GROUPED = re.compile(r"[-+]?[1-9][0-9]{0,2}([.,'\u00a0\u202f])[0-9]{3}(?:\1[0-9]{3})*", re.ASCII)
GROUP = 3  # digits
LOOSE = ("'", "\u00a0", "\u202f")  # which can be nothing but groups
ANY_MARK = re.compile(
    r"[-+]?(?:[0-9]+(?:[.,'\u00a0\u202f][0-9]{3})*(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eE][-+]?[0-9]+)?",
    re.ASCII,
)


@dataclass(frozen=True)
class SheetRow:
    """The cells of a row, and the line it begins in."""

    cells: list[str]
    line: int


@dataclass(frozen=True)
class Marks:
    """The decimal mark of numbers, and what groups their thousands: empty if nothing does.

    `doubtful` is a number that may be read in two ways, empty if there is none.
    """

    decimal: str = "."
    grouping: str = ""
    doubtful: str = ""

    def plain(self, cell: str) -> str:
        """A cell with a decimal point, and without groups.

        >>> Marks(",", ".").plain("1.234,5"), Marks().plain("1,5")
        ('1234.5', '1,5')
        """
        if self.doubtful and GROUPED.fullmatch(cell):
            return f"?{cell}"  # which is no number
        whole, mark, rest = cell.partition(self.decimal)
        groups = GROUPED.fullmatch(whole)
        if groups is not None and groups[1] in (self.grouping, *LOOSE):
            whole = whole.replace(groups[1], "")
        if self.decimal == "," and "." in whole:
            return f"?{cell}"
        return f"{whole}.{rest}" if mark else whole


@dataclass
class _Lines:
    """Lines for a reader of rows; those of comments are empty, but not within a row's quotes."""

    lines: Sequence[str]
    separator: str
    has_comments: bool
    number: int = 0
    is_inside: bool = False
    has_rows: bool = False

    def __iter__(self) -> Iterator[str]:
        for number, line in enumerate(self.lines, start=1):
            self.number = number
            yield line if self.is_inside else f"{self._first(line)}\n"

    def _first(self, line: str) -> str:
        """The first line of a row, empty if it is that of none."""
        text = line.strip(" \r\n") if self.separator == "\t" else line.strip()
        is_comment = COMMENT.match(text) is not None if self.has_rows else text.startswith("#")
        self.is_inside = bool(text) and not (is_comment and self.has_comments)
        return _parted(text, self.separator) if self.is_inside else ""


def _parted(text: str, separator: str) -> str:
    """A line with a mark where the blanks between its cells were."""
    if separator == " ":
        return PARTED.join(WORD.findall(text))
    return text if separator.strip(" ") else BLANKS.sub(PARTED, text)


def rows_in(
    lines: Sequence[str], separator: str, file: str = "", *, has_comments: bool = True
) -> tuple[list[SheetRow], list[Problem]]:
    """The rows of a text without those that are empty, and what is not the row of any table.

    Without comments, as a data frame is, rows of empty cells count.
    """
    source = _Lines(lines, separator, has_comments)
    mark = separator if separator.strip(" ") else PARTED
    reader = csv.reader(source, delimiter=mark, skipinitialspace=True, strict=True)
    rows: list[SheetRow] = []
    problems: list[Problem] = []
    while True:
        before, source.is_inside = source.number, False
        try:
            cells = next(reader)
        except StopIteration:
            return rows, problems
        except csv.Error as error:
            place = Location(file, before + 1)
            del problems[MOST_ALIKE:]  # the first are kept and the last, as some may be no rows
            problems.append(located(place, "row", "cells of a CSV", str(error)))
            continue
        if cells and (any(cells) or not has_comments):
            rows.append(SheetRow([_in_one_line(cell) for cell in cells], before + 1))
            source.has_rows = True


def _in_one_line(cell: str) -> str:
    return " ".join(cell.split()) if "\n" in cell else cell.strip()


def separator_of(lines: Sequence[str]) -> str:
    r"""What parts the cells: tabs, or that by which the last lines have the most numbers.

    >>> separator_of(["Kraft in N;Weg", "0,5;1,5"]), separator_of(["a\tb", "1\t2"])
    (';', '\t')
    >>> separator_of(["a b", "1  2.5"]), separator_of(["a", "1"])
    ('  ', ',')
    >>> separator_of(["No.\tForce", "Dome 1\t2"])  # by blanks it has as many numbers
    '\t'
    """
    last = [line for line in lines if line.strip()][-SAMPLE:]
    if 2 * sum(map(_has_tab_between_cells, last)) > len(last):
        return "\t"

    def score(separator: str) -> int:
        rows, _ = rows_in(last, separator)
        parted = (row for row in rows if len(row.cells) > 1 and has_numbers(row))
        cells = [cell for row in parted for cell in row.cells if cell]
        n_numbers = sum(map(is_number, cells))
        return 2 * n_numbers - len(cells)

    return max(SEPARATORS, key=score)


def _has_tab_between_cells(line: str) -> bool:
    """Whether a tab parts two cells, rather than stand in one or beside another separator."""
    parts = [part for cell in QUOTED.sub("q", line).split("\t") if (part := cell.strip())]
    return any(a[-1] not in ",;|" and b[0] not in ",;|" for a, b in pairwise(parts))


def header_in(rows: Sequence[SheetRow], wanted: Container[str], sources: Sequence[str]) -> int:
    """The place of the header: the first row that has all sources, else one that is wanted.

    Without either it is the row before the numbers, so that a message can say what there is.
    """
    sources = [source for source in sources if not is_number(source)]  # those are places
    for place, row in enumerate(rows):
        titles = {part for cell in row.cells for part in (cell, name_and_unit(cell)[0])}
        if sources and all(source in titles for source in sources):
            return place
    for place, row in enumerate(rows):
        if any(cell in wanted or name_and_unit(cell)[0] in wanted for cell in row.cells if cell):
            return place
    return _before_numbers(rows)


def _before_numbers(rows: Sequence[SheetRow]) -> int:
    """The place of the row above the longest run of rows with as many cells, and numbers."""
    lengths = [len(row.cells) if has_numbers(row) else 0 for row in rows]
    begin, longest, start = 0, 0, 0
    for length, run in groupby(lengths):
        size = len(list(run))
        if length and size > longest:
            begin, longest = start, size
        start += size
    place = begin - 1
    while place > 0 and is_of_units(rows[place]):
        place -= 1
    return max(place, 0)


def is_number(cell: str) -> bool:
    """Whether a cell is a number, whatever its marks."""
    return ANY_MARK.fullmatch(cell) is not None


def has_numbers(row: SheetRow) -> bool:
    """Whether a cell of a row is a number."""
    return any(map(is_number, row.cells))


def is_of_units(row: SheetRow) -> bool:
    """Whether a row names units: it has no number beside them, but for the 1 of no unit."""
    is_any = not has_numbers(row) and any(is_unit(cell) for cell in row.cells if cell)
    return is_any or are_units(row.cells)


def marks_in(cells: Sequence[str], separator: str) -> Marks:
    """The marks of the numbers among some cells.

    A comma between cells parted by commas was in quotes: one alone is a slip of the pen.

    >>> marks_in(["0,5", "12"], ";"), marks_in(["1,234.5", "0.5"], ",")
    (Marks(decimal=',', grouping='', doubtful=''), Marks(decimal='.', grouping=',', doubtful=''))
    >>> marks_in(["1,234", "2,345"], ";").doubtful
    '1,234'
    """
    numbers = [cell for cell in cells if is_number(cell)]
    marked = {mark: [cell for cell in numbers if mark in cell] for mark in ".,"}
    both = [cell for cell in marked["."] if "," in cell]
    if both:
        decimal = max(both[0].rpartition("."), both[0].rpartition(","), key=lambda p: len(p[0]))[1]
        return Marks(decimal, ",."[decimal == ","])
    if marked["."] or 2 * len(marked[","]) <= (len(numbers) if separator == "," else 0):
        return Marks()
    if all(GROUPED.fullmatch(cell) for cell in marked[","]):
        return Marks(doubtful=marked[","][0])
    return Marks(",")


def doubtful_point(columns: Sequence[Sequence[str]]) -> str:
    """The first number of some columns whose point may group thousands; empty if there is none.

    Points that are all followed by three digits, in a column where others have none, as in 950,
    1.000: a machine that writes decimals writes as many of each.

    >>> doubtful_point([["950", "1.000"]]), doubtful_point([["1.125", "1.250"], ["1", "2"]])
    ('1.000', '')
    """
    numbers = [list(filter(is_number, cells)) for cells in columns]
    flat = [cell for cells in numbers for cell in cells]
    are_groups = all(GROUPED.fullmatch(cell) for cell in flat if "." in cell)
    if not are_groups or any(cell.isdigit() and len(cell) > GROUP for cell in flat):
        return ""
    mixed = (cells for cells in numbers if not all("." in cell for cell in cells))
    return next((cell for cells in mixed for cell in cells if "." in cell), "")
