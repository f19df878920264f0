"""Pressures by step in a CSV file that a spec names, read and put in the place of its name."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from dpgcli.design.lines import DEFAULT_LINE, HISTORY, LINES, TIME
from dpgcli.errors import Field, Message, Problem, SpecError
from dpgcli.files.content import beside
from dpgcli.files.scene_file.settings import SETTING, changed
from dpgcli.files.yaml_file import MAX_NODES, Document
from dpgcli.text import dotted

MOST_NUMBERS = MAX_NODES * 9 // 10  # as many as a spec holds beside the rest of it
WITHOUT_CONTENT = ('""', "none")
TO_SEE = Message("dpg actuate shows it with ", Field("pressure"), " FILE")


def with_history(document: Document, folder: Path) -> Document:
    """The document with pressures instead of their file's name, and that file.

    The name is relative to the spec's folder, in `--set` to the current one. What is wrong in the
    file joins the document's problems.
    """
    pressure = document.data.get("pressure")
    name = pressure.get(HISTORY[-1]) if isinstance(pressure, dict) else None
    if not isinstance(name, str):
        return document
    from dpgcli.files.histories import read_history  # tables of all kinds, which few specs name

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
