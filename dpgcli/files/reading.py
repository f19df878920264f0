"""Tables of designs and facts of runs, read back."""

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from dpgcli.errors import UsageError

NEEDED = ("design", "calibration", "status", "reason", "n_stable")


def read_designs(path: Path) -> tuple[pd.DataFrame, dict[str, str]]:
    """A table of designs and the unit of each of its columns, empty where there is none.

    Raises UsageError for what is no table of designs.
    """
    if path.is_dir():
        raise UsageError(f"{path} is a folder: name the table in it, designs.parquet")
    try:
        with path.open("rb") as stream:  # pyarrow takes no name that is not text
            table = pq.read_table(stream)
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror or 'damaged'}") from error
    except pa.ArrowException as error:
        raise UsageError(f"cannot read {path}: not a Parquet file") from error
    missing = [name for name in NEEDED if name not in table.column_names]
    if missing:
        raise UsageError(
            f"{path} is no table of designs: no column {', '.join(missing)}; "
            "dpg sweep writes one, designs.parquet"
        )
    units = {
        field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema
    }
    return table.to_pandas(), units


def read_run(path: Path) -> dict[str, Any] | None:
    """The facts of a run; None if there is no such file. Raises UsageError for other content."""
    if path.is_fifo():  # it would be waited for
        return None
    try:
        facts = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror}") from error
    except ValueError as error:
        raise UsageError(f"cannot read {path}: not JSON") from error
    if not isinstance(facts, dict):
        raise UsageError(f"{path} holds no facts of a run: expected a JSON object")
    return facts


def read_record(path: Path) -> dict[str, Any]:
    """A benchmark that was recorded. Raises UsageError for other content."""
    facts = read_run(path)
    rows = None if facts is None else facts.get("rows")
    if facts is None or not isinstance(rows, list) or not all(map(_is_measured, rows)):
        raise UsageError(f"{path} is no record of dpg bench --json")
    return facts


def _is_measured(row: Any) -> bool:
    if not isinstance(row, dict):
        return False
    time = row.get("relative_time")
    return isinstance(row.get("way"), str) and isinstance(time, int | float | None)
