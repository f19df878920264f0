"""Forces of jaws in a CSV file that an object names, read and put in the place of its name."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dpgcli.arrays import Array
from dpgcli.errors import Problem, SpecError
from dpgcli.files.content import beside
from dpgcli.files.csv_file import Sheet, Tabular, read_sheet
from dpgcli.files.places import few, in_order
from dpgcli.files.scene_file.histories import WITHOUT_CONTENT
from dpgcli.files.scene_file.objects import FORCE, GAP, MOST_POINTS, TABLE
from dpgcli.files.scene_file.settings import SETTING, changed
from dpgcli.files.units import OWN, factor_of, listed, name_and_unit
from dpgcli.files.yaml_file import Document
from dpgcli.mechanics.aperture import FEWEST_POINTS
from dpgcli.text import KeyPath, dotted

QUANTITIES = {GAP: "travel", FORCE: "force"}


def with_forces(document: Document, folder: Path, path: KeyPath = ("object", *TABLE)) -> Document:
    """The document with forces by aperture instead of their file's name, and that file.

    `path` is where the table stands. The name is relative to the folder of the document, in `--set`
    to the current one. What is wrong in the file joins the document's problems.
    """
    name: Any = document.data
    for part in path:
        name = name.get(part) if isinstance(name, dict) else None
    if not isinstance(name, str):
        return document
    file = beside(Path() if document.place(path) == SETTING else folder, name)
    try:
        forces = {column: values.tolist() for column, values in read_forces(file).items()}
        embedded, problems = changed(document, {dotted(path): forces}), document.problems
    except SpecError as error:  # rigid jaws until the file is right
        embedded = changed(document, {dotted(path[:-1]): None})
        problems = (*document.problems, *map(_concealed, error.problems))
    return replace(embedded, problems=problems, files=(*document.files, file))


def _concealed(problem: Problem) -> Problem:
    """The problem without words of the file: who names it need not be allowed to read it."""
    if problem.key == "file" or problem.found in WITHOUT_CONTENT or _is_number(problem.found):
        return problem
    key = problem.key if problem.key in QUANTITIES else "header"
    return replace(problem, key=key, found="something else", hint="")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def read_forces(source: Tabular) -> dict[str, Array]:
    """Apertures (mm), which rise, and forces (N) of a table's two columns; others are left out.

    Units in brackets, as in jaw_gap (cm), or below the header count. Raises SpecError for columns
    that are not there, cells without a number, unknown units, apertures that go back and forth,
    and too few or too many rows, all at once.

    >>> table = {"jaw_gap_mm": [40, 20], "force (mN)": [0, 500]}
    >>> {name: column.tolist() for name, column in read_forces(table).items()}
    {'jaw_gap_mm': [20.0, 40.0], 'force_N': [0.5, 0.0]}
    """
    sheet = read_sheet(source)
    titles = {name: [title for title in sheet.names if _is(title, name)] for name in QUANTITIES}
    problems = [sheet.missing(name) for name, found in titles.items() if not found]
    problems += [
        sheet.problem(None, "header", f"one column {name}", " and ".join(found))
        for name, found in titles.items()
        if len(found) > 1
    ]
    if problems:
        raise SpecError(tuple(problems))
    columns = {name: found[0] for name, found in titles.items()}
    problems = list(_row_problems(sheet))
    numbers: dict[str, Array] = {}
    try:
        factors = {title: _factor(sheet, title, name) for name, title in columns.items()}
        numbers = sheet.numbers(list(factors), factors={t: f or 1.0 for t, f in factors.items()})
        unknown = [name for name, title in columns.items() if factors[title] is None]
        problems += [_wrong_unit(sheet, columns[name], name) for name in unknown]
        problems += few(_steps_back(sheet, numbers[columns[GAP]]))
    except SpecError as error:
        problems += error.problems
    if problems:
        raise SpecError(in_order(problems))
    falls = numbers[columns[GAP]][0] > numbers[columns[GAP]][-1]
    return {name: numbers[title][:: -1 if falls else 1] for name, title in columns.items()}


def _is(title: str, name: str) -> bool:
    """Whether a title is that of a column: its name, or the name without its unit."""
    said = name_and_unit(title)[0]
    return said in (name, name.rpartition("_")[0])


def _factor(sheet: Sheet, title: str, name: str) -> float | None:
    """What makes numbers ours; None for a unit that is not known, or not that of the name."""
    own = OWN[QUANTITIES[name]]
    factor = factor_of(QUANTITIES[name], sheet.units.get(title, own))
    is_named = name_and_unit(title)[0] == name
    return None if is_named and factor != 1.0 else factor


def _wrong_unit(sheet: Sheet, title: str, name: str) -> Problem:
    quantity, unit = QUANTITIES[name], sheet.units[title]
    is_known = factor_of(quantity, unit) is not None
    expected = f"{OWN[quantity]}, as the name has it" if is_known else listed(quantity)
    return sheet.problem(None, name, expected, unit)


def _row_problems(sheet: Sheet) -> Iterator[Problem]:
    if not FEWEST_POINTS <= len(sheet.rows) <= MOST_POINTS:
        expected = f"{FEWEST_POINTS} to {MOST_POINTS:,} rows"
        yield sheet.problem(None, "file", expected, f"{len(sheet.rows):,}")


def _steps_back(sheet: Sheet, gap: Array) -> Iterator[Problem]:
    """Apertures that do not go on the way that the first two go."""
    steps = np.diff(gap)
    onwards = -1.0 if len(steps) and steps[0] < 0.0 else 1.0
    for row in np.flatnonzero(onwards * steps <= 0.0).tolist():
        expected = f"an aperture {'above' if onwards > 0.0 else 'below'} {gap[row]:.10g} mm"
        yield sheet.problem(row + 1, GAP, expected, f"{gap[row + 1]:.10g}")
