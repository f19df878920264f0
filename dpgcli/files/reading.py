"""Tables of designs and facts of runs, read back."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from dpgcli.arrays import Array, Flags
from dpgcli.errors import UsageError

TIP_COLUMNS = ("pattern", "tip_x_mm", "tip_y_mm")
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


def read_tips(path: Path, n_units: int) -> tuple[Flags, Array]:
    """Known tips: patterns, (unit, state), and their tips x, y in mm, (2, state), from CSV.

    Raises UsageError, with the line, for what is no such file.
    """
    try:
        table = pd.read_csv(path, dtype={"pattern": str}, comment="#")
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror}") from error
    except ValueError as error:  # pandas' own are its children
        raise UsageError(f"cannot read {path}: {error}") from error
    missing = [name for name in TIP_COLUMNS if name not in table]
    if missing:
        found = ", ".join(map(str, table.columns))
        raise UsageError(f"{path}: no column {', '.join(missing)}; found {found}")
    tips = table[["tip_x_mm", "tip_y_mm"]].apply(pd.to_numeric, errors="coerce").to_numpy(float)
    for line, (pattern, tip) in enumerate(zip(table["pattern"], tips, strict=True), start=2):
        if not re.fullmatch(f"[01]{{{n_units}}}", str(pattern)):
            raise UsageError(
                f"{path}:{line}: expected a pattern of {n_units} digits 0 and 1, found {pattern}"
            )
        if not np.isfinite(tip).all():
            raise UsageError(f"{path}:{line}: expected numbers in mm, found no number")
    if table.empty:
        raise UsageError(f"{path}: no states in it")
    flags = np.array([[digit == "1" for digit in pattern] for pattern in table["pattern"]]).T
    return flags, tips.T


def read_record(path: Path) -> list[dict[str, Any]]:
    """The rows of a benchmark that was recorded. Raises UsageError for other content."""
    facts = read_run(path)
    rows = None if facts is None else facts.get("rows")
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise UsageError(f"{path} is no record of dpg bench --json")
    return rows
