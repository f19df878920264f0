"""Calibration files that a spec names, read and put in the place of their names."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from dpgcli.errors import Problem, SpecError
from dpgcli.files.calibration import Calibration, read_calibration
from dpgcli.files.places import shown
from dpgcli.files.source import Document
from dpgcli.files.spec.derivations import PUBLISHED
from dpgcli.files.spec.settings import SETTING, changed

EXPECTED = '"published" or the name of a calibration file'
KEY = ("finger", "calibration")


def with_calibrations(document: Document, folder: Path) -> Document:
    """The document with calibrations instead of their files' names, and those files.

    Names are relative to the spec's folder, in `--set` to the current one. What is wrong in a
    calibration joins the document's problems.
    """
    finger = document.data.get("finger")
    said = finger.get("calibration") if isinstance(finger, dict) else None
    if said is None or said == PUBLISHED:
        return document
    origin = Path() if document.place(KEY) == SETTING else folder
    found: list[Any] = []
    files: list[Path] = []
    problems: list[Problem] = []
    for name in said if isinstance(said, list) else [said]:
        if not isinstance(name, str) or name == PUBLISHED:
            found.append(name)
            continue
        path = origin / name
        if not path.is_file():
            problems.append(document.problem(KEY, EXPECTED, f"{shown(name)}: no such file"))
            continue
        files.append(path)
        try:
            found.append(_named(read_calibration(path), path))
        except SpecError as error:
            problems += error.problems
    if problems:  # what is wrong with the values is said once the files are right
        found = [PUBLISHED]
    value = found if isinstance(said, list) else found[0]
    embedded = changed(document, {".".join(KEY): value})
    return replace(embedded, problems=(*document.problems, *problems), files=tuple(files))


def _named(calibration: Calibration, path: Path) -> Calibration:
    return calibration.model_copy(update={"file": path.name})
