"""Calibration files that a spec names, read and put in the place of their names."""

from collections.abc import Callable
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import dpgcli
from dpgcli.design.calibrations import FINITE_ELEMENTS, PUBLISHED
from dpgcli.design.dimensions import HINGE_COUPLING, LINEAR_STIFFNESS, WALL_COMPLIANCE
from dpgcli.design.rules import DERIVATIONS
from dpgcli.errors import Problem, SpecError
from dpgcli.files.calibration import Calibration, calibration_in, read_calibration
from dpgcli.files.content import beside, quoted_if
from dpgcli.files.places import shown
from dpgcli.files.scene_file.settings import SETTING, changed
from dpgcli.files.yaml_file import Document
from dpgcli.records import dataclass
from dpgcli.text import KeyPath

BUILT_IN = (PUBLISHED, FINITE_ELEMENTS)
EXPECTED = '"published", "finite_elements" or the name of a calibration file'
KEY, LAW = ("finger", "calibration"), ("finger", "law")
SHIPPED = Path(dpgcli.__file__).parent / FINITE_ELEMENTS
SHIPPED_FILES = ("domes.yaml", "units.yaml")
SHIPPED_LAW = "push_only"  # that of its curve


def with_calibrations(document: Document, said: object, folder: Path) -> Document:
    """The document with calibrations instead of what it says, and the files that they are from.

    `finite_elements` names those that ship, and their law where the spec has none. Names are
    relative to the spec's folder, in `--set` to the current one. What is wrong in a
    calibration joins the document's problems.
    """
    origin = Path() if document.place(KEY) == SETTING else folder
    reader = _Reader(document, origin)
    value: Any = reader.listed(said) if isinstance(said, list) else reader.found(KEY, said)
    if reader.problems:  # what is wrong with the values is said once the files are right
        value = PUBLISHED
    changes = {".".join(KEY): value}
    if FINITE_ELEMENTS in (said if isinstance(said, list) else [said]):
        changes[".".join(LAW)] = document.data["finger"].get("law") or SHIPPED_LAW
    embedded = changed(document, changes)
    problems = (*document.problems, *reader.problems)
    return replace(embedded, problems=problems, files=tuple(reader.files))


def recalibrated(document: Document, calibration: Calibration | str) -> Document:
    """The document, before its calibrations are read, with another one's values instead of its own.

    `calibration` is one that was read, or the name of one that is built in. Its values come before
    those of the other calibrations, and lattice sections lose what it gives. The published springs
    come alone: what others give is what they are held against.
    """
    finger = document.data["finger"]
    said = finger.get("calibration")
    before = said if isinstance(said, list) else [] if said is None else [said]
    is_given = _given_by(calibration)

    def without(section: dict[str, Any]) -> dict[str, Any]:
        kept = (section.get("lattice") or {}).items()
        return {**section, "lattice": {k: v for k, v in kept if not is_given(k)}}

    listed = PUBLISHED if calibration == PUBLISHED else [calibration, *before]
    changes = {**without(finger), "calibration": listed}
    for key in (LINEAR_STIFFNESS, WALL_COMPLIANCE, HINGE_COUPLING):
        if is_given(key):
            changes.pop(key, None)
    overrides = finger.get("overrides") or {}
    changes["overrides"] = {units: without(own or {}) for units, own in overrides.items()}
    return replace(document, data={**document.data, "finger": changes})


def _given_by(calibration: Calibration | str) -> Callable[[str], bool]:
    """Whether a key of the lattice is given by a calibration, which may be one that is built in."""
    if calibration == PUBLISHED:
        return {rule.key for rule in DERIVATIONS if rule.origin is not None}.__contains__
    if calibration == FINITE_ELEMENTS:
        known = [_shipped(name).known for name in SHIPPED_FILES]
        return lambda key: any(one.has(key) for one in known)
    assert isinstance(calibration, Calibration), "a file is read before"
    return calibration.known.has


def _shipped(name: str) -> Calibration:
    """One of the calibrations of the package."""
    return read_calibration(SHIPPED / name).model_copy(update={"file": f"{FINITE_ELEMENTS}/{name}"})


@dataclass
class _Reader:
    """Reads calibrations by name, or as a table keeps them; what is wrong gathers."""

    document: Document
    folder: Path
    problems: list[Problem] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)

    def wrong(self, path: KeyPath, found: str) -> None:
        self.problems.append(self.document.problem(path, EXPECTED, found))

    def listed(self, said: list[object]) -> list[object]:
        """The calibrations of a list."""
        if not said:
            self.wrong(KEY, "an empty list")
        parts = [self.found((*KEY, place), part) for place, part in enumerate(said)]
        return [one for part in parts for one in (part if isinstance(part, list) else [part])]

    def found(self, path: KeyPath, said: object) -> object:
        """The calibration that is said, or those of the package; "published" remains."""
        if isinstance(said, Calibration):
            return said
        try:
            if isinstance(said, dict):
                return calibration_in(self.document.section(path, said))
            if said == FINITE_ELEMENTS:
                return [_shipped(name) for name in SHIPPED_FILES]
            if isinstance(said, str) and said != PUBLISHED:
                return self.named(path, said)
        except SpecError as error:
            self.problems += error.problems
        if not isinstance(said, dict | str):
            self.wrong(path, shown(said))
        return said

    def named(self, path: KeyPath, name: str) -> Calibration | None:
        file = beside(self.folder, name)
        try:
            is_file = file.is_file()
        except OSError:  # a name too long, a folder that is closed
            is_file = False
        if not is_file:
            self.wrong(path, f"{shown(name)}: no such file")
            return None
        self.files.append(file)
        with quoted_if(file, "calibration_version", "a calibration file of dpg fit"):
            return read_calibration(file).model_copy(update={"file": file.name})
