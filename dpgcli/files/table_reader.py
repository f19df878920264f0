"""Tables of designs and facts of runs, read back."""

import json
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from dpgcli.errors import UsageError
from dpgcli.files.content import opened
from dpgcli.files.seal import is_whole_in

TEXTS = ("calibration", "status", "reason", "rung")
COUNTS = ("design", "n_stable")
NEEDED = ("design", "calibration", "status", "reason", "n_stable")
MOST_FACTS = 2**26  # bytes
DAMAGED = "damaged: its bytes are not those of its SHA-256; make it again"


def read_designs(path: Path) -> tuple[pd.DataFrame, dict[str, str]]:
    """A table of designs and the unit of each of its columns, empty where there is none.

    Columns are text, whole numbers or numbers, whatever types they were stored as; what is
    neither is left out. Raises UsageError for what is damaged, or no table of designs.
    """
    if path.is_dir():
        raise UsageError(f"{path} is a folder: name the table in it, designs.parquet")
    return designs_in(read_undamaged(path), str(path))


def designs_in(table: Any, name: str) -> tuple[pd.DataFrame, dict[str, str]]:
    """The same of a pyarrow Table; `name` is what messages call it."""
    missing = [name for name in NEEDED if name not in table.column_names]
    if missing:
        raise UsageError(
            f"{name} is no table of designs: no column {', '.join(missing)}; "
            "dpg sweep writes one, designs.parquet"
        )
    if twice := sorted({name for name in table.column_names if table.column_names.count(name) > 1}):
        raise UsageError(f"{name}: expected each column once, found {', '.join(twice)} again")
    units = {
        field.name: (field.metadata or {}).get(b"unit", b"").decode(errors="replace")
        for field in table.schema
    }
    return _plain(name, table), units


def read_undamaged(path: Path) -> Any:
    """A Parquet file as a pyarrow Table, its bytes held against its seal if `dpg` wrote it.

    Raises UsageError for what is damaged, or no Parquet file.
    """
    try:
        with opened(path) as stream:  # pyarrow takes no name that is not text
            file = undamaged(stream)
            if file is not None:
                table = file.read()
                _ = table.column_names  # raises where they are no text
                return table
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror or 'damaged'}") from error
    except (pa.ArrowException, UnicodeDecodeError) as error:
        raise UsageError(f"cannot read {path}: not a Parquet file") from error
    raise UsageError(f"{path} is {DAMAGED}")


def undamaged(stream: BinaryIO) -> Any:
    """A ParquetFile whose bytes are those of its seal, if `dpg` wrote it; None where they are not.

    Raises OSError and ArrowException for what is no Parquet file.
    """
    is_whole = is_whole_in(stream)
    if is_whole is False:  # nothing damaged is decoded
        return None
    file = pq.ParquetFile(stream, page_checksum_verification=True)
    is_ours = b"dpg.content_sha256" in (file.metadata.metadata or {})
    return file if is_whole or not is_ours else None


def _plain(source: str, table: Any) -> pd.DataFrame:
    """The columns of three plain types."""
    names = table.column_names
    swept = names[names.index("design") + 1 : names.index("calibration")]
    columns = {}
    for name in names:
        column = table.column(name)
        if pa.types.is_dictionary(column.type):
            column = column.cast(column.type.value_type)
        kind = "text" if name in TEXTS else "whole numbers" if name in COUNTS else "numbers"
        plain = READERS[kind](column)
        if plain is not None:
            columns[name] = plain
        elif name in (*NEEDED, *swept):
            raise UsageError(f"{source}: column {name}: expected {kind}, found {column.type}")
    return pd.DataFrame(columns)


def _text(column: Any) -> Any:
    """Text, empty where there is none; None for a column of anything else."""
    if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
        try:
            return column.to_pandas().astype(object).fillna("")
        except UnicodeDecodeError:
            return None
    numbers = _numbers(column)
    is_empty = column.null_count == len(column) or (numbers is not None and numbers.isna().all())
    return pd.Series([""] * len(column), dtype=object) if is_empty else None


def _whole(column: Any) -> Any:
    """Whole numbers, none missing; None for a column of anything else."""
    numbers = _numbers(column)
    if numbers is None or (numbers % 1 != 0).any() or (numbers.abs() >= 2**63).any():
        return None
    return numbers.astype("int64")


def _numbers(column: Any) -> Any:
    """Whole numbers if all are there and fit, else numbers; None for a column of neither."""
    kind = column.type
    if pa.types.is_integer(kind) or pa.types.is_boolean(kind):
        kinds = ["float64"] if column.null_count else ["int64", "float64"]
    elif pa.types.is_floating(kind) or pa.types.is_decimal(kind):
        kinds = ["float64"]
    else:
        return None
    for plain in kinds:
        with suppress(pa.ArrowException):  # more than 63 bits
            return column.cast(plain, safe=plain == "int64").to_pandas()
    return None


READERS = {"text": _text, "whole numbers": _whole, "numbers": _numbers}


def read_run(path: Path) -> dict[str, Any] | None:
    """The facts of a run; None if there is no such file. Raises UsageError for other content."""
    return _facts(path) if path.is_file() or path.is_dir() else None


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
    return isinstance(row.get("way"), str) and isinstance(time, int | float | None)
