"""Tables of designs and facts of runs, read back."""

import csv
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from dpgcli.accuracy.comparison import KnownTips
from dpgcli.errors import UsageError

TIP_COLUMNS = ("pattern", "tip_x_mm", "tip_y_mm")
LARGEST = 1e12
MORE_TIP_COLUMNS = ("tip_angle_rad", "seconds")
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


def read_tips(path: Path, n_units: int) -> KnownTips:
    """Known tips from CSV; columns for the angle and the time of a state may be missing.

    Lines that start with # are comments. Raises UsageError, with the line, for what is no such
    file.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"cannot read {path}: not UTF-8 text") from error
    lines = enumerate(text.splitlines(), start=1)
    rows = [
        (number, [cell.strip() for cell in next(csv.reader([line]))])
        for number, line in lines
        if line.strip() and not line.startswith("#")
    ]
    (_, names), *states = rows or [(1, [""])]
    missing = [name for name in TIP_COLUMNS if name not in names]
    if missing:
        hint = "; separate columns with commas" if ";" in names[0] else ""
        found = ", ".join(names)
        raise UsageError(f"{path}: no column {', '.join(missing)}; found {found}{hint}")
    if not states:
        raise UsageError(f"{path}: no states in it")
    tips: dict[str, tuple[float, ...]] = {}
    for number, cells in states:
        if len(cells) != len(names):
            raise UsageError(f"{path}:{number}: expected {len(names)} cells, found {len(cells)}")
        pattern, tip = _tip(dict(zip(names, cells, strict=True)), n_units, f"{path}:{number}")
        if pattern in tips:
            raise UsageError(f"{path}:{number}: {pattern} for the second time")
        tips[pattern] = tip
    patterns = np.array([[digit == "1" for digit in pattern] for pattern in tips]).T
    x, y, angle, seconds = np.array(list(tips.values())).T
    return KnownTips(patterns, np.stack((x, y)), angle, seconds)


def _tip(cells: dict[str, str], n_units: int, place: str) -> tuple[str, tuple[float, ...]]:
    """The pattern of one line, and its tip x, y, angle and time."""
    pattern = cells["pattern"]
    if not re.fullmatch(f"[01]{{{n_units}}}", pattern):
        raise UsageError(f"{place}: pattern: expected {n_units} digits 0 and 1, found {pattern!r}")
    needed = [_number(cells, name, place) for name in TIP_COLUMNS[1:]]
    more = [_number(cells, n, place) if cells.get(n) else math.nan for n in MORE_TIP_COLUMNS]
    return pattern, (*needed, *more)


def _number(cells: dict[str, str], name: str, place: str) -> float:
    try:
        value = float(cells[name])
    except ValueError:
        value = math.nan
    if not abs(value) < LARGEST:
        raise UsageError(f"{place}: {name}: expected a number, found {cells[name]!r}")
    return value


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
