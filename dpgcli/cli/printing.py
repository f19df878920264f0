"""Rows on standard output, as they come: a table for people, CSV and JSON for programs."""

import csv
import json
import math
import shutil
import sys
from collections.abc import Callable, Container, Iterable, Iterator
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from dpgcli.cli.streams import put, put_json, say, unobeyed
from dpgcli.states.columns import Column, Kind
from dpgcli.text import printable

if TYPE_CHECKING:
    from dpgcli.arrays import Columns

ROWS_SHOWN = 64
PRINCIPAL = (
    "pattern",
    "status",
    "tip_x_mm",
    "tip_y_mm",
    "tip_angle_deg",
    "energy_mJ",
    "tip_x_uncertainty_mm",
    "tip_y_uncertainty_mm",
    "tip_angle_uncertainty_rad",
    "aperture_mm",
    "aperture_uncertainty_mm",
    "fingers_overlap",
    "numerical_error_mm",
)
IN_SUMMARY = "uncertainty_covers"  # the same in all rows
TABLE_WIDTH = 100  # characters, where there is no terminal
DROPPED_FIRST = (
    "numerical_error_mm",
    "tip_angle_uncertainty_rad",
    "energy_mJ",
    "tip_angle_deg",
    "fingers_overlap",
)
TOO_SMALL = 1e-3  # for fixed decimals: such as the tips of a finger of micrometers
ROUNDED = {
    "residual_N": ".1e",
    "penetration_mm": ".1e",
    "numerical_error_mm": ".1e",
    "min_eigenvalue_N_per_mm": ".5f",
    "mm": ".5f",
    "rad": ".5f",
    "deg": ".3f",
    "N": ".4f",
    "mJ": ".5f",
    "%": ".1f",
    "standard_error": ".2g",
}


class Format(StrEnum):
    """How rows are printed."""

    TABLE = "table"
    JSON = "json"
    CSV = "csv"


Printer = Callable[[tuple[Column, ...], Iterable["Columns"]], Iterator["Columns"]]


def print_csv(columns: tuple[Column, ...], blocks: Iterable["Columns"]) -> Iterator["Columns"]:
    """Print and pass on; numbers in full, NaN where a pattern has no state.

    Texts of others are spelled as in a table: a cell may begin a line.
    """
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow([unobeyed(column.name) for column in columns])
    for block in blocks:
        for row in _rows(columns, block):
            writer.writerow([unobeyed(cell) if isinstance(cell, str) else cell for cell in row])
        yield block


def print_json(columns: tuple[Column, ...], blocks: Iterable["Columns"]) -> Iterator["Columns"]:
    """Print one array of row objects and pass on; null for what is not a finite number."""
    names = [column.name for column in columns]
    first = separator = "[\n"
    for block in blocks:
        for row in _rows(columns, block):
            finite = (None if isinstance(v, float) and not math.isfinite(v) else v for v in row)
            text = json.dumps(dict(zip(names, finite, strict=True)))
            put_json(f"{separator}  {text}")
            separator = ",\n"
        yield block
    sys.stdout.write("[]\n" if separator == first else "\n]\n")


def table_printer(*, principal: bool) -> Printer:
    """Print the first rows for reading; of many columns only the principal ones."""

    def print_table(
        columns: tuple[Column, ...], blocks: Iterable["Columns"]
    ) -> Iterator["Columns"]:
        first: list[list[Any]] = []
        n_rows = 0
        strays = False
        for block in blocks:
            first += _rows(columns, block, ROWS_SHOWN - len(first))
            n_rows += len(block[columns[0].name])
            strays |= principal and bool((block["status"] != 0).any())
            yield block
        shown = {
            column.name: _shown(column, [row[place] for row in first])
            for place, column in enumerate(columns)
            if column.name in PRINCIPAL
            or (strays and column.name == "reached_pattern")
            or not (principal or column.name == IN_SUMMARY)
        }
        right = (Kind.NUMBER, Kind.FLAG)
        left = {column.name for column in columns if column.kind not in right}
        print_grid(shown, left=left, may_drop=principal)
        if n_rows > len(first):
            say(f"first {len(first)} of {n_rows:,} rows; all with --format csv or --output")

    return print_table


def printer_of(printed_as: Format, *, principal: bool = False) -> Printer:
    """How to print rows; of a table's many columns the principal ones, if asked for."""
    printers = {Format.CSV: print_csv, Format.JSON: print_json}
    return printers.get(printed_as) or table_printer(principal=principal)


def print_rows(columns: tuple[Column, ...], rows: "Columns", printed_as: Format) -> None:
    """Print one block of rows."""
    for _ in printer_of(printed_as)(columns, [rows]):
        pass


def _rows(
    columns: tuple[Column, ...], block: "Columns", limit: int | None = None
) -> list[list[Any]]:
    """Rows of plain values."""
    from dpgcli.states.rows import as_text

    listed = [as_text(column, block[column.name][:limit]).tolist() for column in columns]
    return [list(row) for row in zip(*listed, strict=True)]


def print_grid(
    texts: dict[str, list[str]], *, left: Container[str], may_drop: bool = False
) -> None:
    """Aligned columns; on a terminal with folded heads, without some where there is no room."""
    interactive = sys.stdout.isatty()
    names, is_folded = _fitted(texts, interactive) if may_drop else (list(texts), interactive)
    heads = {name: _head(name, is_folded) for name in names}
    n_folds = max(head.count("\n") for head in heads.values())
    columns = []
    for name, head in heads.items():
        above = "\n" * (n_folds - head.count("\n"))
        cells = [*(above + head).split("\n"), *map(printable, texts[name])]
        columns.append(_aligned(cells, left=name in left))
    lines = ["  ".join(row) for row in zip(*columns, strict=True)]
    if interactive:
        lines.insert(n_folds + 1, "─" * _width(lines[0]))
    put("\n".join(line.rstrip() for line in lines))
    if dropped := [name for name in texts if name not in names]:
        say(f"no room for {', '.join(dropped)}: see --columns, --format")


def _fitted(texts: dict[str, list[str]], interactive: bool) -> tuple[list[str], bool]:
    """What a table has room for, and whether its heads are folded for that."""
    room = shutil.get_terminal_size().columns if interactive else TABLE_WIDTH
    ways = [(True, n) for n in range(len(DROPPED_FIRST) + 1)]
    if not interactive:
        ways = [(False, 0), (False, 1), *ways]
    for is_folded, n_dropped in ways:
        names = [name for name in texts if name not in DROPPED_FIRST[:n_dropped]]
        cells = ([*_head(name, is_folded).split("\n"), *texts[name]] for name in names)
        if sum(max(map(_width, column)) + 2 for column in cells) - 2 <= room:
            break
    return names, is_folded


def _head(name: str, is_folded: bool) -> str:
    return name.replace("_", "_\n") if is_folded else name


def _aligned(cells: list[str], *, left: bool) -> list[str]:
    """Cells filled with spaces to one width."""
    widths = [_width(cell) for cell in cells]
    spaces = [" " * (max(widths) - width) for width in widths]
    pairs = zip(cells, spaces, strict=True)
    return [cell + space if left else space + cell for cell, space in pairs]


def _width(text: str) -> int:
    """How many places of a terminal a text takes."""
    if text.isascii():
        return len(text)
    from rich.cells import cell_len

    return cell_len(text)


def _shown(column: Column, values: list[Any]) -> list[str]:
    """The texts of a column."""
    if column.kind is Kind.FLAG:
        return ["yes" if value else "no" for value in values]
    if column.kind is not Kind.NUMBER:
        return list(map(str, values))
    rounded = _rounded(column, values)
    return ["-" if math.isnan(value) else format(value, f"z{rounded}") for value in values]


def _rounded(column: Column, values: list[float]) -> str:
    """Decimals for the sizes that the unit is usual for; as many digits for much smaller ones."""
    rounded = ROUNDED.get(column.name) or ROUNDED.get(column.unit, ".6g")
    largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
    return ".5e" if rounded.endswith("f") and 0.0 < largest < TOO_SMALL else rounded
