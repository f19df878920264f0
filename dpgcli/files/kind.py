"""What a document is, by its keys: a spec, a sweep or a goal."""

from difflib import get_close_matches
from enum import Enum

from dpgcli.errors import Problem, SpecError
from dpgcli.files.goal_file.models import GoalSpec
from dpgcli.files.places import in_order
from dpgcli.files.scene_file import Spec
from dpgcli.files.sweep_file.models import SweepSpec
from dpgcli.files.yaml_file import Document


class FileKind(Enum):
    """The kinds of files that people write, by the keys of their top level."""

    SPEC = frozenset(Spec.model_fields)
    SWEEP = frozenset(SweepSpec.model_fields)
    GOAL = frozenset(GoalSpec.model_fields)


OF_SPECS, OF_OTHERS = FileKind.SPEC.value, FileKind.SWEEP.value | FileKind.GOAL.value
OF_GOALS_ALONE = FileKind.GOAL.value - FileKind.SWEEP.value
ANY = (
    "a spec, with the key finger, a sweep, with the keys base and space, or a goal, with the keys "
    "base, vary and targets"
)
CALIBRATION = "a calibration is named by a spec, under finger.calibration"


def kind_of(document: Document) -> FileKind:
    """What a document is. Raises SpecError for what is none of them, or a spec and another.

    >>> kind_of(Document("wide.yaml", {"base": "finger.yaml", "space": []}, {})).name
    'SWEEP'
    """
    of_specs = [key for key in document.data if key in OF_SPECS]
    of_others = [key for key in document.data if key in OF_OTHERS]
    if bool(of_specs) == bool(of_others):
        problem = _both(document, of_specs, of_others) if of_specs else _neither(document)
        raise SpecError(in_order([*document.problems, problem]))
    if of_specs:
        return FileKind.SPEC
    is_goal = "space" not in document.data and OF_GOALS_ALONE & document.data.keys()
    return FileKind.GOAL if is_goal else FileKind.SWEEP


def _both(document: Document, of_specs: list[str], of_others: list[str]) -> Problem:
    found = f"{', '.join(of_specs)} beside {', '.join(of_others)}"
    hint = "the spec that a sweep or a goal varies is a file of its own, which base names"
    return document.problem((of_specs[0],), ANY, found, hint)


def _neither(document: Document) -> Problem:
    """With the key that was probably mistyped."""
    known = sorted(OF_SPECS | OF_OTHERS)
    for key in document.data:
        if close := get_close_matches(key, known, n=1):
            return document.problem((key,), ANY, key, f"did you mean {close[0]}?")
    hint = CALIBRATION if "calibration_version" in document.data else ""
    return document.problem(("document",), ANY, "neither", hint)
