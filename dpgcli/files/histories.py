"""Pressures by step, of a CSV file or a table in memory."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.design.lines import TIME
from dpgcli.errors import Problem, SpecError
from dpgcli.files.csv_file import Sheet, Tabular, read_sheet
from dpgcli.files.places import few, in_order, shown
from dpgcli.files.units import OWN, factor_of, listed, name_and_unit

FEWEST_ROWS = 2
UNIT = "_MPa"  # may end the name of a column
LINE, PRESSURE = "line", "pressure"  # columns of a table with a row for each line and time


def read_history(source: Tabular, lines: Sequence[str]) -> dict[str, Array]:
    """Pressures (MPa) by line, and times (s) by `time_s` where the table has them.

    Each column is that of a line, named as it is, or with _MPa behind; units in brackets, as in
    A (kPa), or below the header count. Or the table has a row for each line and time, as a
    controller's: time_s, line and pressure_MPa, with straight ways between the rows of a line.
    Raises SpecError for other columns, cells without a number, unknown units, times that go back
    and fewer than two rows, all at once.

    >>> table = {"time": [0, 1], "A_MPa": [0, 0.15], "B (kPa)": [0, 100]}
    >>> read_history(table, ["A", "B"])["B"].tolist()
    [0.0, 0.1]
    >>> table = {"time_s": [0, 2, 1], "line": ["A", "A", "B"], "pressure_MPa": [0, 0.2, 0.1]}
    >>> {name: values.tolist() for name, values in read_history(table, ["A", "B"]).items()}
    {'time_s': [0.0, 1.0, 2.0], 'A': [0.0, 0.1, 0.2], 'B': [0.1, 0.1, 0.1]}
    """
    sheet = read_sheet(source)
    if LINE in sheet.names and LINE not in lines:
        return _by_rows(sheet, lines)
    names = dict.fromkeys(name for name in sheet.names if name)
    if not any(_line(name) in lines for name in names):
        expected = f"a column for a line: {', '.join(lines)}"
        raise SpecError((sheet.problem(None, "header", expected, "none"),))
    expected = f"a line: {', '.join(lines)}; or {TIME}"
    problems = [*few(_header_problems(sheet, names, lines, expected))]
    numbers: dict[str, Array] = {}
    try:
        factors = {name: _factor(sheet, name) for name in names}
        numbers = sheet.numbers(list(names), factors=factors)
    except SpecError as error:
        problems += error.problems
    for name in filter(lambda name: _line(name) == TIME, numbers):
        problems += few(_time_problems(sheet, numbers[name], np.arange(len(sheet.rows))))
    if problems:
        raise SpecError(in_order(problems))
    return {_line(name): values for name, values in numbers.items()}


def _by_rows(sheet: Sheet, lines: Sequence[str]) -> dict[str, Array]:
    """Of a table with a row for each line and time; at every time that any line has."""
    names = [name for name in sheet.names if name and name != LINE]
    expected = f"{TIME}, {LINE} and {PRESSURE}{UNIT}"
    problems = [*few(_header_problems(sheet, names, [PRESSURE], expected))]
    titles = {_line(name): name for name in names}
    problems += [sheet.missing(own) for own in (TIME, PRESSURE + UNIT) if _line(own) not in titles]
    if problems:
        raise SpecError(in_order(problems))
    time, pressure = titles[TIME], titles[PRESSURE]
    factors = {name: _factor(sheet, name) for name in (time, pressure)}
    numbers, of_rows = sheet.numbers([time, pressure], factors=factors), sheet.cells(LINE)
    unknown = (
        sheet.problem(row, LINE, f"a line: {', '.join(lines)}", shown(line))
        for row, line in enumerate(of_rows)
        if line not in lines
    )
    problems = [*few(unknown)]
    rows = {line: np.array([k for k, own in enumerate(of_rows) if own == line]) for line in lines}
    for own in rows.values():
        problems += few(_time_problems(sheet, numbers[time], own, may_stay=False))
    if problems:
        raise SpecError(in_order(problems))
    times = np.unique(numbers[time])
    return {TIME: times} | {
        line: np.interp(times, numbers[time][own], numbers[pressure][own])
        for line, own in rows.items()
        if len(own)
    }


def _line(title: str) -> str:
    """The line that a column is of, or `time_s`."""
    name = name_and_unit(title)[0]
    return TIME if name == "time" else name.removesuffix(UNIT)


def _quantity(title: str) -> str:
    return "time" if _line(title) == TIME else "pressure"


def _factor(sheet: Sheet, name: str) -> float:
    quantity = _quantity(name)
    return factor_of(quantity, sheet.units.get(name, OWN[quantity])) or 1.0


def _header_problems(
    sheet: Sheet, names: Iterable[str], lines: Sequence[str], expected: str
) -> Iterator[Problem]:
    """Lines that are unknown or there twice, units likewise, and too few rows."""
    met: dict[str, str] = {}
    for name in names:
        if _line(name) not in (*lines, TIME):
            yield sheet.problem(None, "header", expected, shown(name))
            continue
        quantity, unit = _quantity(name), sheet.units.get(name, "")
        factor = factor_of(quantity, unit) if unit else 1.0
        if factor is None:
            yield sheet.problem(None, name, listed(quantity), unit)
        elif factor != 1.0 and name_and_unit(name)[0].endswith((UNIT, TIME)):
            yield sheet.problem(None, name, f"{OWN[quantity]}, as the name has it", unit)
        if other := met.get(_line(name)):
            yield sheet.problem(None, "header", "each line once", f"{other} and {name}")
        met[_line(name)] = name
    if len(sheet.rows) < FEWEST_ROWS:
        yield sheet.problem(None, "file", f"{FEWEST_ROWS} rows or more", str(len(sheet.rows)))


def _time_problems(
    sheet: Sheet, times: Array, rows: Indices, *, may_stay: bool = True
) -> Iterator[Problem]:
    """Times of some rows that go back, or stay."""
    for before, row in pairwise(rows.tolist()):
        if times[row] < times[before] or (times[row] == times[before] and not may_stay):
            expected = f"a time {'from' if may_stay else 'after'} {times[before]:.10g} s"
            yield sheet.problem(row, TIME, expected + " on" * may_stay, f"{times[row]:.10g}")
