"""A spec's scene with another calibration, which may be one that is built in."""

from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

from dpgcli.api.arguments import path_of
from dpgcli.api.inputs import SceneInput
from dpgcli.design.scene import Scene
from dpgcli.errors import Field, Message, Problem, SpecError, UsageError
from dpgcli.files.access import reading
from dpgcli.files.calibration import Calibration, read_calibration
from dpgcli.files.scene_file import checked, scene_of, with_files
from dpgcli.files.scene_file.references import BUILT_IN, EXPECTED, recalibrated

CalibrationInput: TypeAlias = str | Path | Calibration
"""A calibration, its file, or the name of one that is built in; a Path is never such a name."""


def recalibrated_scene(given: SceneInput, calibration: CalibrationInput) -> Scene:
    """The scene with the values of a calibration instead of its own, wherever it has them.

    Raises UsageError where there is no such calibration, and SpecError, with the calibration in
    each hint, where it and the spec do not go together.
    """
    if given.document is None:
        raise UsageError(Field("calibration"), " changes a spec, not a finger's values")
    other = _calibration(calibration)
    try:
        changed = recalibrated(given.document, other)
        return scene_of(checked(with_files(changed, given.folder)))
    except SpecError as error:
        name = other.file if isinstance(other, Calibration) else other
        raise SpecError(tuple(_by(name, problem) for problem in error.problems)) from None


def _calibration(given: CalibrationInput) -> Calibration | str:
    if isinstance(given, Calibration) or (isinstance(given, str) and given in BUILT_IN):
        return given
    path = path_of("calibration", given)
    with reading(path):
        is_there = path.exists()
    if not is_there:
        raise UsageError(Field("calibration"), f" {given}: expected {EXPECTED}, found no such file")
    return read_calibration(path).model_copy(update={"file": path.name})


def _by(calibration: str | None, problem: Problem) -> Problem:
    """A problem that a spec has with a calibration beside its own."""
    hint = (problem.hint, "; ") if problem.hint else ()
    name = f" {calibration}" if calibration else ""
    return replace(problem, hint=Message(*hint, "with ", Field("calibration"), name))
