"""Tables of designs and facts of runs, read back."""

import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from dpgcli.arrays import Columns
from dpgcli.design.outputs import Trust
from dpgcli.errors import UsageError
from dpgcli.files.access import reading
from dpgcli.files.content import opened
from dpgcli.files.seal import is_whole_in
from dpgcli.files.trust import outputs_of, trusts_in
from dpgcli.sweeps.metrics import METRICS
from dpgcli.text import counted

TEXTS = ("calibration", "status", "reason", "accuracy_level", "reachable_patterns")
TEXT, WHOLE, NUMBERS = "text", "whole numbers", "numbers"
NEEDED = {
    "design": WHOLE,
    "calibration": TEXT,
    "status": TEXT,
    "reason": TEXT,
    "n_stable": WHOLE,
}
COUNTS = {metric.unknown for metric in METRICS if metric.unknown}
OTHERS = {*NEEDED, *TEXTS, "error_bound_mm", *(metric.name for metric in METRICS)}  # not swept
MOST_FACTS = 2**26  # bytes
DAMAGED = (
    "damaged: its bytes are not those of its SHA-256, or it has none any more; "
    "make it again, or, if you edited it, take its dpg.* metadata away"
)
PLAIN = frozenset(("PLAIN", "PLAIN_DICTIONARY", "RLE_DICTIONARY", "RLE", "BIT_PACKED"))
NOT_YET = "Not yet implemented"  # of pyarrow
ROWS_AT_ONCE = 1000  # of texts in full
NO_VALUE = "no value in any row"
NO_ROOM = "it takes more memory than there is"


class DesignTable(NamedTuple):
    """A table of designs: its columns, the unit of each, and what those that say it rest on.

    Units are empty where there is none; `trusts` are of the outputs that a column shows.
    """

    columns: Columns
    units: dict[str, str]
    trusts: dict[str, tuple[Trust, ...]]


def read_designs(path: Path) -> DesignTable:
    """A table of designs.

    Columns are text, whole numbers or numbers, whatever types they were stored as; what is
    neither is left out. Raises UsageError for what is damaged, or no table of designs.
    """
    with reading(path):
        is_folder = path.is_dir()
    if is_folder:
        raise UsageError(f"{path} is a folder: name the table in it, designs.parquet")
    return designs_in(read_undamaged(path, partial(_readable, str(path))), str(path))


def designs_in(table: Any, name: str) -> DesignTable:
    """The same of a pyarrow Table; `name` is what messages call it."""
    table = table.select(_readable(name, table.schema))
    units = {
        field.name: (field.metadata or {}).get(b"unit", b"").decode(errors="replace")
        for field in table.schema
    }
    return DesignTable(_plain(name, table), units, trusts_of(table.schema))


def trusts_of(described: Any) -> dict[str, tuple[Trust, ...]]:
    """What the columns of a schema rest on, as far as it says so."""
    metadata = (described.metadata or {}).items()
    known = trusts_in({k.decode(errors="replace"): v.decode(errors="replace") for k, v in metadata})
    found = {field.name: outputs_of(field) for field in described}
    return {
        name: tuple(known[output] for output in outputs if output in known)
        for name, outputs in found.items()
        if known
    }


def _all(described: Any) -> list[str]:
    names: list[str] = described.names
    return names


def read_undamaged(path: Path, chosen: Callable[[Any], list[str]] = _all) -> Any:
    """A Parquet file as a pyarrow Table, its bytes checked by its seal if `dpg` wrote it.

    Only the columns that are `chosen` from its schema are read, their `TEXTS` as dictionaries: a
    text that repeats is there once. Raises UsageError for what is damaged, no Parquet file, or
    larger than memory.
    """
    with undamaged_file(path) as (stream, file):
        names = chosen(file.schema_arrow)
        _check_room(path, file.metadata, names)
        return file.read(names) if chosen is _all else with_dictionaries(stream, file, names)


@contextmanager
def undamaged_file(path: Path) -> Iterator[tuple[BinaryIO, Any]]:
    """A Parquet file, open: its stream and a ParquetFile. Raises UsageError as `read_undamaged`."""
    try:
        with opened(path) as stream:  # pyarrow takes no name that is not text
            file = undamaged(stream)
            if file is not None:
                yield stream, file
                return
    except MemoryError as error:  # before those of pyarrow, of which some are this too
        raise UsageError(f"cannot read {path}: {NO_ROOM}") from error
    except OSError as error:
        why = error.strerror or (str(error) if NOT_YET in str(error) else "damaged")
        raise UsageError(f"cannot read {path}: {why}") from error
    except (pa.ArrowException, UnicodeDecodeError) as error:
        # such as no more threads, or a page that pyarrow has no decoder for
        is_of_system = type(error) is pa.ArrowException or NOT_YET in str(error)
        why = str(error).lower() if is_of_system else "not a Parquet file"
        raise UsageError(f"cannot read {path}: {why}") from error
    raise UsageError(f"{path} is {DAMAGED}")


def with_dictionaries(stream: BinaryIO, file: Any, names: list[str]) -> Any:
    """Columns of a file, its `TEXTS` as dictionaries: pyarrow reads those of some encodings so.

    Of the others not more than some rows are there in full: a text that repeats takes no room.
    """
    metadata = file.metadata
    texts = [f.name for f in file.schema_arrow if f.name in TEXTS and _is_string(f.type)]
    texts = [name for name in names if name in texts]
    by_hand = [name for name in texts if not _is_read_as_dictionary(metadata, name)]
    options = {"page_checksum_verification": True, "metadata": metadata}
    read = pq.ParquetFile(stream, read_dictionary=[t for t in texts if t not in by_hand], **options)
    table = read.read([name for name in names if name not in by_hand])
    for name in by_hand:
        blocks = file.iter_batches(ROWS_AT_ONCE, columns=[name])
        kind = pa.dictionary(pa.int32(), file.schema_arrow.field(name).type)
        parts = [block.column(0).dictionary_encode() for block in blocks]
        field = file.schema_arrow.field(name).with_type(kind)
        table = table.append_column(field, pa.chunked_array(parts, kind))
    return table.select(names)


def _is_read_as_dictionary(metadata: Any, name: str) -> bool:
    groups = [metadata.row_group(place) for place in range(metadata.num_row_groups)]
    columns = (group.column(place) for group in groups for place in range(group.num_columns))
    return all(PLAIN.issuperset(c.encodings) for c in columns if c.path_in_schema == name)


def undamaged(stream: BinaryIO) -> Any:
    """A ParquetFile whose bytes are those of its seal, if `dpg` wrote it; None where they are not.

    Raises OSError and ArrowException for what is no Parquet file.
    """
    is_whole = is_whole_in(stream)
    if is_whole is False:  # nothing damaged is decoded
        return None
    file = pq.ParquetFile(stream, page_checksum_verification=True)
    is_ours = any(key.startswith(b"dpg.") for key in file.metadata.metadata or ())
    return file if is_whole or not is_ours else None


def _check_room(path: Path, metadata: Any, names: list[str]) -> None:
    """Raise UsageError for columns that are larger than the machine's memory."""
    if not hasattr(os, "sysconf"):  # Windows
        return
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    groups = [metadata.row_group(place) for place in range(metadata.num_row_groups)]
    columns = (group.column(place) for group in groups for place in range(group.num_columns))
    wanted = frozenset(names)
    needed = sum(c.total_uncompressed_size for c in columns if c.path_in_schema in wanted)
    needed += 8 * metadata.num_rows * len(names)
    if needed > memory:
        found = f"{needed / 1e9:,.1f} GB, and this machine has {memory / 1e9:,.1f} GB"
        raise UsageError(f"cannot read {path}: its columns take {found} of memory")


def _readable(source: str, described: Any) -> list[str]:
    """Columns of a schema to read: numbers and the texts that are known.

    Raises UsageError for what is no table of designs.
    """
    check_names(source, described, "designs", NEEDED)
    swept = swept_in(described)
    check_kinds(source, described, dict.fromkeys(swept, NUMBERS) | NEEDED)
    check_kinds(source, described, counts_in(described))
    names = _in_our_order(described.names, swept)
    return [name for name in names if _may_hold(described.field(name).type, _kind(name))]


def check_names(source: str, described: Any, what: str, needed: Iterable[str]) -> None:
    """Raise UsageError where a schema lacks columns that it needs, or has some twice."""
    counts = Counter(described.names)
    if missing := [name for name in needed if name not in counts]:
        raise UsageError(
            f"{source} is no table of {what}: no column {', '.join(missing)}; "
            f"dpg sweep writes one, {what}.parquet"
        )
    if twice := sorted(name for name, count in counts.items() if count > 1):
        raise UsageError(f"{source}: expected each column once, found {', '.join(twice)} again")


def counts_in(described: Any) -> dict[str, str]:
    """Columns that count failed searches, and what they hold: others are only bounds by them."""
    return {name: NUMBERS for name in described.names if name in COUNTS}


def check_kinds(source: str, described: Any, kinds: Mapping[str, str]) -> None:
    """Raise UsageError where a column is of a type that cannot hold what it should."""
    for name, kind in kinds.items():
        found = described.field(name).type
        if not _may_hold(found, kind):
            raise _wrong_type(source, name, kind, found)


def _may_hold(kind: Any, wanted: str) -> bool:
    """Whether a type may hold values: empty texts come back from CSV as numbers, or as nothing."""
    if wanted == TEXT and (is_text(kind) or _is_bytes(kind) or pa.types.is_null(kind)):
        return True
    return is_number(kind)


def swept_in(described: Any) -> list[str]:
    """Columns of the swept values: between the design's number and its calibration.

    In a table whose columns were put into another order, those that are none of our others.
    """
    names = described.names
    between: list[str] = names[names.index("design") + 1 : names.index("calibration")]
    if between and not OTHERS.intersection(between):
        return between
    numbers = (field.name for field in described if is_number(field.type))
    return [name for name in numbers if name not in OTHERS]


def _in_our_order(names: list[str], swept: list[str]) -> list[str]:
    first = dict.fromkeys(("design", *swept, "calibration"))
    return [*first, *(name for name in names if name not in first)]


def is_number(kind: Any) -> bool:
    """Whether values of a type may be numbers: those of an empty column are none at all."""
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    types = pa.types
    kinds = (types.is_integer, types.is_boolean, types.is_floating, types.is_decimal)
    return any(is_kind(kind) for is_kind in kinds)


def is_text(kind: Any) -> bool:
    """Whether values of a type are texts."""
    return _is_string(kind) or bool(pa.types.is_string_view(kind))


def _is_string(kind: Any) -> bool:
    """The same of types that PyArrow makes dictionaries of."""
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))


def _is_bytes(kind: Any) -> bool:
    """Whether values of a type are bytes, which may be those of texts."""
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    kinds = (pa.types.is_binary, pa.types.is_large_binary, pa.types.is_binary_view)
    return any(is_kind(kind) for is_kind in kinds)


def _kind(name: str) -> str:
    return NEEDED.get(name, TEXT if name in TEXTS else NUMBERS)


def _wrong_type(source: str, name: str, kind: str, found: Any) -> UsageError:
    said = NO_VALUE if pa.types.is_null(found) else found
    return UsageError(f"{source}: column {name}: expected {kind}, found {said}")


def _misfit(kind: str, column: Any) -> str:
    """What a column of numbers has that whole ones have not; for others its type."""
    if len(column) and column.null_count == len(column):
        return NO_VALUE
    if kind != WHOLE or not is_number(column.type):
        return str(column.type)
    if column.null_count:
        return f"{counted(column.null_count, 'row')} without one"
    return f"{column.type} beyond 63 bits" if pa.types.is_integer(column.type) else "others as well"


def column_of(source: str, name: str, column: Any, kind: str) -> NDArray[Any]:
    """The values of a column that has to be there, of a kind. Raises UsageError for others."""
    plain = READERS[kind](column)
    if plain is None:
        found = _misfit(kind, column)
        raise UsageError(f"{source}: column {name}: expected {kind}, found {found}")
    return plain


def _plain(source: str, table: Any) -> Columns:
    """The columns of three plain types."""
    names = table.column_names
    needed = {*NEEDED, *swept_in(table.schema)}
    columns: Columns = {}
    for name in names:
        column = table.column(name)
        if name in needed:
            columns[name] = column_of(source, name, column, _kind(name))
        elif (plain := READERS[_kind(name)](column)) is not None:
            columns[name] = plain
    return columns


def texts_in(column: Any) -> NDArray[Any] | None:
    """Text, empty where there is none; None for a column of anything else."""
    if is_text(column.type) or _is_bytes(column.type):
        try:
            return _looked_up(column if _is_string(column.type) else column.cast(pa.string()))
        except (UnicodeDecodeError, pa.ArrowInvalid):
            return None
    numbers = numbers_in(column)
    is_empty = column.null_count == len(column) or (numbers is not None and np.isnan(numbers).all())
    return np.full(len(column), "", object) if is_empty else None


def _looked_up(column: Any) -> NDArray[Any]:
    """The texts of a column, each of them once in memory."""
    parts = [np.empty(0, object)]
    is_dictionary = pa.types.is_dictionary(column.type)
    for chunk in (column if is_dictionary else column.dictionary_encode()).chunks:
        known = np.array([*(text or "" for text in chunk.dictionary.to_pylist()), ""], object)
        codes = chunk.indices.fill_null(len(known) - 1) if chunk.null_count else chunk.indices
        parts.append(known[np.from_dlpack(codes)])
    return np.concatenate(parts)


def _whole(column: Any) -> NDArray[Any] | None:
    """Whole numbers, none missing; None for a column of anything else."""
    numbers = numbers_in(column)
    if numbers is None or numbers.dtype == np.int64:
        return numbers
    is_whole = (np.abs(numbers) < 2**63) & (np.trunc(numbers) == numbers)
    return numbers.astype(np.int64) if is_whole.all() else None


def numbers_in(column: Any) -> NDArray[Any] | None:
    """Whole numbers if all are there and fit, else numbers; None for a column of neither."""
    if pa.types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    kind = column.type
    if pa.types.is_integer(kind) or pa.types.is_boolean(kind):
        kinds = [pa.float64()] if column.null_count else [pa.int64(), pa.float64()]
    elif pa.types.is_floating(kind) or pa.types.is_decimal(kind):
        kinds = [pa.float64()]
    else:
        return None
    for plain in kinds:
        with suppress(pa.ArrowException):  # more than 63 bits
            return _unboxed(column if plain == kind else column.cast(plain, plain == pa.int64()))
    return None


def _unboxed(column: Any) -> NDArray[Any]:
    """A column of 64 bits as an array, NaN where there is nothing; `to_numpy` loads pandas."""
    if column.null_count:
        column = column.fill_null(np.nan)
    empty = np.empty(0, np.int64 if pa.types.is_integer(column.type) else np.float64)
    return np.concatenate([empty, *map(np.from_dlpack, column.chunks)])


READERS = {TEXT: texts_in, WHOLE: _whole, NUMBERS: numbers_in}


def _facts(path: Path) -> dict[str, Any]:
    try:
        with opened(path) as stream:
            content = stream.read(MOST_FACTS + 1)
        if len(content) > MOST_FACTS:
            raise UsageError(f"cannot read {path}: larger than {MOST_FACTS >> 20} MiB")
        facts = json.loads(content.decode())
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise UsageError(f"cannot read {path}: not JSON, or nested too deeply") from error
    if not isinstance(facts, dict) or not _is_shallow(facts):
        raise UsageError(
            f"{path} holds no facts of a run: expected a JSON object, a few levels deep"
        )
    return facts


def _is_shallow(value: Any, levels: int = 8) -> bool:
    """Whether no value is nested deeper than some levels."""
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return levels > 0 and all(_is_shallow(part, levels - 1) for part in parts)


def read_record(path: Path) -> dict[str, Any]:
    """A benchmark that was recorded. Raises UsageError for other content."""
    facts = _facts(path)
    rows = facts.get("rows")
    if not isinstance(rows, list) or not all(map(_is_measured, rows)):
        raise UsageError(f"{path} is no record of dpg bench --json")
    return facts


def _is_measured(row: Any) -> bool:
    if not isinstance(row, dict):
        return False
    time = row.get("relative_time")
    return isinstance(row.get("method"), str) and isinstance(time, int | float | None)
