"""Pressures by step in a CSV file that a spec names, read and put in the place of its name."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dpgcli.arrays import Array
from dpgcli.design.lines import DEFAULT_LINE, HISTORY, LINES, TIME
from dpgcli.errors import Field, Message, Problem, SpecError
from dpgcli.files.content import beside
from dpgcli.files.csv_file import Sheet, Tabular, read_sheet
from dpgcli.files.places import few, in_order, shown
from dpgcli.files.scene_file.settings import SETTING, changed
from dpgcli.files.units import OWN, factor_of, listed, name_and_unit
from dpgcli.files.yaml_file import MAX_NODES, Document
from dpgcli.text import dotted

MOST_NUMBERS = MAX_NODES * 9 // 10  # as many as a spec holds beside the rest of it
FEWEST_ROWS = 2
WITHOUT_CONTENT = ('""', "none")
TO_SEE = Message("dpg actuate shows it with ", Field("pressure"), " FILE")
UNIT = "_MPa"  # may end the name of a column


def with_history(document: Document, folder: Path) -> Document:
    """The document with pressures instead of their file's name, and that file.

    The name is relative to the spec's folder, in `--set` to the current one. What is wrong in the
    file joins the document's problems.
    """
    pressure = document.data.get("pressure")
    name = pressure.get(HISTORY[-1]) if isinstance(pressure, dict) else None
    if not isinstance(name, str):
        return document
    path = beside(Path() if document.place(HISTORY) == SETTING else folder, name)
    lines = pressure.get(LINES[-1]) if isinstance(pressure, dict) else None
    lines = [*lines] if isinstance(lines, dict) else [DEFAULT_LINE]
    said, problems = None, document.problems
    try:
        columns = read_history(path, lines)
        n_numbers = sum(map(len, columns.values()))
        if n_numbers <= MOST_NUMBERS:
            said = {column: values.tolist() for column, values in columns.items()}
        else:
            expected = f"at most {MOST_NUMBERS:,} numbers, as many as a spec holds"
            wrong = document.problem(HISTORY, expected, f"{n_numbers:,} in {name}")
            problems = (*problems, wrong)
    except SpecError as error:
        problems = (*problems, *(_concealed(problem, lines) for problem in error.problems))
    embedded = changed(document, {dotted(HISTORY): said})
    return replace(embedded, problems=problems, files=(*document.files, path))


def _concealed(problem: Problem, lines: Sequence[str]) -> Problem:
    """The problem without what the file says there, or what it calls its columns.

    Whoever names a file in a spec, and lines as its columns, need not be allowed to read it.
    """
    key = problem.key if problem.key in (*lines, TIME, "file") else "header"
    is_said = problem.key == "file" or problem.found in WITHOUT_CONTENT
    found = problem.found if is_said else "something else"
    return replace(problem, key=key, found=found, hint=problem.hint if is_said else TO_SEE)


def read_history(source: Tabular, lines: Sequence[str]) -> dict[str, Array]:
    """Pressures (MPa) by line, and times (s) by `time_s` where the table has them.

    Each column is that of a line, named as it is, or with _MPa behind; units in brackets, as in
    A (kPa), or below the header count. Raises SpecError for other columns, cells without a number,
    unknown units, times that go back and fewer than two rows, all at once.

    >>> table = {"time": [0, 1], "A_MPa": [0, 0.15], "B (kPa)": [0, 100]}
    >>> read_history(table, ["A", "B"])["B"].tolist()
    [0.0, 0.1]
    """
    sheet = read_sheet(source)
    names = dict.fromkeys(name for name in sheet.names if name)
    if not any(_line(name) in lines for name in names):
        expected = f"a column for a line: {', '.join(lines)}"
        raise SpecError((sheet.problem(None, "header", expected, "none"),))
    problems = [*few(_header_problems(sheet, names, lines))]
    numbers: dict[str, Array] = {}
    try:
        factors = {name: _factor(sheet, name) for name in names}
        numbers = sheet.numbers(list(names), factors=factors)
    except SpecError as error:
        problems += error.problems
    for name in filter(lambda name: _line(name) == TIME, numbers):
        problems += few(_time_problems(sheet, numbers[name]))
    if problems:
        raise SpecError(in_order(problems))
    return {_line(name): values for name, values in numbers.items()}


def _line(title: str) -> str:
    """The line that a column is of, or `time_s`."""
    name = name_and_unit(title)[0]
    return TIME if name == "time" else name.removesuffix(UNIT)


def _quantity(title: str) -> str:
    return "time" if _line(title) == TIME else "pressure"


def _factor(sheet: Sheet, name: str) -> float:
    quantity = _quantity(name)
    return factor_of(quantity, sheet.units.get(name, OWN[quantity])) or 1.0


def _header_problems(sheet: Sheet, names: Iterable[str], lines: Sequence[str]) -> Iterator[Problem]:
    """Lines that are unknown or there twice, units likewise, and too few rows."""
    met: dict[str, str] = {}
    for name in names:
        if _line(name) not in (*lines, TIME):
            expected = f"a line: {', '.join(lines)}; or {TIME}"
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


def _time_problems(sheet: Sheet, times: Array) -> Iterator[Problem]:
    for row in np.flatnonzero(np.diff(times) < 0.0).tolist():
        expected = f"a time from {times[row]:.10g} s on"
        yield sheet.problem(row + 1, TIME, expected, f"{times[row + 1]:.10g}")
