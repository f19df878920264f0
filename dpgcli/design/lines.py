"""Pressure lines of a finger and pressures over steps: arrays, and what is wrong with them."""

import re
from collections.abc import Iterator, Mapping

import numpy as np

from dpgcli.arrays import Indices
from dpgcli.design.dimensions import GivenPressure, range_issues
from dpgcli.design.pressure import History
from dpgcli.design.problems import Issue, number
from dpgcli.text import KeyPath, dotted

DEFAULT_LINE = "A"
TIME = "time_s"
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
PRESSURE: KeyPath = ("pressure",)
LINES: KeyPath = (*PRESSURE, "lines")
HISTORY: KeyPath = (*PRESSURE, "history")


def units_by_line(given: GivenPressure, n_units: int) -> Mapping[str, tuple[int, ...]]:
    """The units of each line; one line has all where none is given.

    >>> units_by_line(GivenPressure(), 3)
    {'A': (1, 2, 3)}
    """
    return given.lines or {DEFAULT_LINE: tuple(range(1, n_units + 1))}


def line_of(given: GivenPressure, n_units: int) -> Indices:
    """The place of each unit's line among the lines, (unit,)."""
    found = np.zeros(n_units, np.int64)
    for place, units in enumerate(units_by_line(given, n_units).values()):
        found[np.array(units) - 1] = place
    return found


def history_of(given: GivenPressure, n_units: int) -> History | None:
    """The pressures of all lines by step."""
    if not given.history:
        return None
    times = given.history.get(TIME)
    columns = [given.history[line] for line in units_by_line(given, n_units)]
    return History(np.array(columns, float).T, None if times is None else np.array(times, float))


def line_issues(given: GivenPressure, n_units: int) -> Iterator[Issue]:
    """What is wrong between lines, units, overrides and history, whatever the pressures are."""
    yield from _unit_issues(given.lines, n_units)
    yield from range_issues(n_units, given.overrides, PRESSURE)
    yield from _history_issues(given, n_units)


def _unit_issues(lines: Mapping[str, tuple[int, ...]], n_units: int) -> Iterator[Issue]:
    taken: dict[int, str] = {}
    for line, units in lines.items():
        path = (*LINES, line)
        if line == TIME or not NAME.fullmatch(line):
            expected = "a name such as A or left: a letter, then letters, digits, _ or -"
            yield Issue(path, expected, dotted((line,)))
        if foreign := [unit for unit in units if not 1 <= unit <= n_units]:
            yield Issue(path, f"units within 1-{n_units}", str(foreign[0]))
        if twice := [unit for unit in units if unit in taken]:
            found = f"unit {twice[0]}, which is on line {taken[twice[0]]} too"
            yield Issue(path, "units on no other line", found)
        taken.update({unit: line for unit in units if unit not in taken})
    missing = [unit for unit in range(1, n_units + 1) if unit not in taken]
    if lines and missing:
        hint = "a unit on a line that stays at 0 MPa is not pressurized"
        yield Issue(LINES, "every unit on a line", f"none for unit {missing[0]}", hint)


def _history_issues(given: GivenPressure, n_units: int) -> Iterator[Issue]:
    lines = units_by_line(given, n_units)
    lengths = {column: len(values) for column, values in given.history.items()}
    first = next(iter(lengths), "")
    for column, length in lengths.items():
        path = (*HISTORY, column)
        if column not in lines and column != TIME:
            yield Issue(path, f"a line: {', '.join(lines)}", dotted((column,)))
        if length != lengths[first]:
            yield Issue(path, f"{lengths[first]} numbers, as {first}", str(length))
    left = [line for line in lines if line not in lengths]
    if lengths and left and lengths.keys() <= {*lines, TIME}:
        zeros = ":".join("0" * max(length for length in lengths.values()))
        expected = f"pressures for each line: {', '.join(lines)}"
        hint = f"{left[0]}: {zeros} keeps it at 0 MPa"
        yield Issue(HISTORY, expected, f"none for {', '.join(left)}", hint)
    times = np.array(given.history.get(TIME, ()), float)
    for place in np.flatnonzero(np.diff(times) < 0.0)[:1].tolist():
        expected = f"a time from {number(times[place])} s on"
        yield Issue((*HISTORY, TIME, place + 1), expected, number(times[place + 1]))
