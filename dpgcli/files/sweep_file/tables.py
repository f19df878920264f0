"""Tables of designs, CSV or Parquet: their columns as numbers, none lost and none changed."""

import csv
import io
import re
import warnings
from collections.abc import Callable
from itertools import islice, zip_longest
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from dpgcli.errors import SpecError
from dpgcli.files.csv_file import text_of
from dpgcli.files.frames import with_index
from dpgcli.files.layout import doubtful_point, marks_in, rows_in, separator_of
from dpgcli.files.places import Location, shown
from dpgcli.files.sweep_file.models import MOST_KEYS
from dpgcli.files.table_reader import DAMAGED, undamaged

LARGEST_WHOLE = 2**63 - 1
PARQUET = b"PAR1"
TOP = re.compile(rb"\A(?:\xef\xbb\xbf)?(?:[ \t]*(?:#[^\n]*)?\n)+")
COMMENT = re.compile(rb"^[ \t]*#+(?:[ \t][^\n]*)?$", re.MULTILINE)
EMPTY_LINE = re.compile(rb"\n[ \t]*\n")
UNNAMED = re.compile(r"__index_level_[0-9]+__")  # an index of pandas, which is no column
FIRST = 1000  # rows
SAMPLE = 2**16  # bytes
UNREADABLE = (  # what pandas and pyarrow raise for content that is no table
    OSError,
    csv.Error,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    NotImplementedError,
    pa.ArrowException,
    pd.errors.ParserWarning,
)


def frame_in(content: bytes, has_room: Callable[[int, int], bool]) -> pd.DataFrame | None:
    """The table in a file's content, None where there is no room; raises one of UNREADABLE.

    An index with a name is a column like the others, as it was before it was made the index.
    """
    if not content.startswith(PARQUET):
        rows = _csv(content, has_room)
        return rows if rows is not None and has_room(*rows.shape) else None
    file = undamaged(io.BytesIO(content))
    if file is None:
        raise ValueError(DAMAGED)
    if not has_room(file.metadata.num_rows, file.metadata.num_columns):
        return None
    return with_index(_parquet(file))


def _parquet(file: Any) -> pd.DataFrame:
    """The table in a Parquet file; of one with text, which is refused, no more than first rows.

    A text that repeats takes no room in the file, and 4 GB where it is read.
    """
    numbers = [field.name for field in file.schema_arrow if _is_number(field.type)]
    others = [name for name in file.schema_arrow.names if name not in numbers]
    if not others:
        whole: pd.DataFrame = _with_floats(file.read()).to_pandas()
        return whole
    first = pa.Table.from_batches(islice(file.iter_batches(FIRST), 1), file.schema_arrow)
    head: pd.DataFrame = _with_floats(first).to_pandas()
    if _has_names(head.index) or not all(map(UNNAMED.fullmatch, others)):
        return head
    rest: pd.DataFrame = _with_floats(file.read(columns=numbers)).to_pandas()
    return rest


def _with_floats(table: Any) -> Any:
    """A table with numbers in the place of decimals, which databases write."""
    for place, field in enumerate(table.schema):
        if pa.types.is_decimal(field.type):
            table = table.set_column(place, field.name, table.column(place).cast(pa.float64()))
    return table


def _has_names(index: "pd.Index[Any]") -> bool:
    return any(name is not None for name in index.names)


def _is_number(kind: Any) -> bool:
    """Whether a type may be read in full: one of numbers, whatever it is refused for later."""
    types = pa.types
    if types.is_dictionary(kind):
        kind = kind.value_type
    kinds = (types.is_integer, types.is_floating, types.is_boolean, types.is_decimal)
    return any(is_kind(kind) for is_kind in kinds)


class NoTableError(ValueError):
    """A file is no table: what was found, and a hint."""


def _csv(content: bytes, has_room: Callable[[int, int], bool]) -> pd.DataFrame | None:
    """The table, None for more keys than there is room for: pandas takes a minute for a million.

    Comments leave empty lines, so that the others keep their numbers.

    Lines end as pandas ends them: where a comment went on behind a lone CR, rows would be lost.
    """
    content = _utf8(content).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    given = content
    if b"#" in content:
        content = TOP.sub(lambda top: b"\n" * top[0].count(b"\n"), content)
        content = COMMENT.sub(b"", content)
    ends = _ends(content)
    separator = separator_of(ends)
    n_rows, n_keys = _size(content, separator)
    if n_keys > MOST_KEYS and not has_room(n_rows, n_keys):
        return None
    _check_gaps(given, separator)
    mark = separator if separator.strip() else "\t"
    if b'"' in content:  # pandas reads "3"4 as 34
        for _ in csv.reader(io.StringIO(content.decode()), delimiter=mark, strict=True):
            pass
    parted = separator if mark == separator else r"\s+"
    decimal = _decimal_mark(ends, separator)
    with warnings.catch_warnings():  # rows that do not fit the header
        warnings.simplefilter("error", pd.errors.ParserWarning)
        try:
            content = _without_ends(content, separator)
            if re.search(re.escape(mark.encode()) + rb" *(\n|\Z)", content):
                _check_rows(content, mark)  # pandas drops an empty cell too many
            stream = io.BytesIO(content)
            return pd.read_csv(stream, index_col=False, sep=parted, decimal=decimal)
        except (pd.errors.ParserError, pd.errors.ParserWarning):
            _check_rows(content, mark)
            raise


def _utf8(content: bytes) -> bytes:
    try:
        return text_of(content, Location("table")).encode()
    except SpecError as error:
        raise NoTableError(error.problems[0].found, error.problems[0].hint) from None


def _size(content: bytes, separator: str) -> tuple[int, int]:
    """About how many rows and keys there are, before they are read."""
    head, *rows = [line for line in content.split(b"\n") if line.strip()] or [b""]
    cells = head.split(separator.encode() if separator.strip() else None)
    return len(rows), sum(1 for cell in cells if cell.strip())


def _ends(content: bytes) -> list[str]:
    """The first and the last lines of a content: they tell its separator and its marks."""
    parts = (content[:SAMPLE],) if len(content) <= SAMPLE else (content[:SAMPLE], content[-SAMPLE:])
    lines = [part.decode(errors="ignore").split("\n") for part in parts]
    whole = lines if len(lines) == 1 else [lines[0][:-1], lines[1][1:]]
    return [line for part in whole for line in part]


def _decimal_mark(lines: list[str], separator: str) -> str:
    """The mark of decimals, a comma only between cells that others part. Raises NoTableError."""
    rows, _ = rows_in(lines, separator)
    marks = marks_in([cell for row in rows[1:] for cell in row.cells], separator)
    columns = zip_longest(*(row.cells for row in rows[1:]), fillvalue="")
    doubtful = marks.doubtful or doubtful_point(list(columns))
    if doubtful or marks.grouping:
        found = shown(doubtful or f"thousands grouped by {marks.grouping}")
        raise NoTableError(found, "write decimal points, and no groups of thousands")
    return marks.decimal if separator != "," else "."


def _without_ends(content: bytes, separator: str) -> bytes:
    """The content without the separator that ends each of its rows: one more ends no cell."""
    if not separator.strip():
        return content
    mark = separator.encode()
    head, *rows = [line for line in content.split(b"\n") if line.strip()]
    is_habit = len(rows) > 1 or head.rstrip().endswith(mark)
    if rows and is_habit and all(row.rstrip().endswith(mark) for row in rows):
        end = re.compile(re.escape(mark) + rb"[ \t]*$", re.MULTILINE)
        longer = rows[0].count(mark) > head.count(mark) or head.rstrip().endswith(mark)
        return end.sub(b"", content) if longer else content
    return content


def _check_gaps(content: bytes, separator: str) -> None:
    """Raise NoTableError for an empty line among rows of one cell: that cell is empty."""
    if not EMPTY_LINE.search(content.strip()):
        return
    lines = content.rstrip().split(b"\n")
    is_row = [bool(line.strip()) and not COMMENT.fullmatch(line) for line in lines]
    header = is_row.index(True)
    if separator.encode() in lines[header].strip():
        return
    for number, line in enumerate(lines[header:], header + 1):
        if not line.strip():
            raise NoTableError(f"an empty cell in line {number}", "no text, no gaps")


def _check_rows(content: bytes, mark: str) -> None:
    """Raise NoTableError for the first row that is longer than the header."""
    rows = csv.reader(io.StringIO(content.decode("utf-8-sig")), delimiter=mark)
    header = next(row for row in rows if row)
    for row in rows:
        if len(row) > len(header):
            found = f"{len(row)} cells in line {rows.line_num}"
            raise NoTableError(found, f"the header has {len(header)}")


class Wrong(NamedTuple):
    """A wrong column: what it should have, what it has, and a hint."""

    expected: str
    found: str
    hint: str = ""


def numbers_in(column: "pd.Series[Any]") -> NDArray[Any] | Wrong:
    """The numbers of a column, whole ones as such; or what is wrong with the first."""
    types = pd.api.types
    if isinstance(column.dtype, pd.CategoricalDtype):
        column = pd.Series(column.to_numpy())
    is_number = types.is_numeric_dtype(column) and not types.is_bool_dtype(column)
    if not is_number or types.is_complex_dtype(column):
        numbers = pd.to_numeric(column.astype(str), errors="coerce").to_numpy(np.float64)
    else:
        numbers = column.to_numpy(np.float64, na_value=np.nan)
    wrong = np.flatnonzero(~np.isfinite(numbers))
    if len(wrong) or not is_number:
        row = int(wrong[0]) if len(wrong) else 0
        found = f"{shown(str(column.iloc[row]))} in row {row + 1}"
        return Wrong("finite numbers", found, "no text, no gaps")
    if not types.is_integer_dtype(column):
        return numbers
    if column.max() > LARGEST_WHOLE:
        row = int(column.to_numpy().argmax())
        return Wrong("whole numbers below 2^63", f"{column.iloc[row]} in row {row + 1}")
    return column.to_numpy(np.int64)
