"""What a document is, by its keys: a spec or a sweep."""

from difflib import get_close_matches

from dpgcli.errors import Problem, SpecError
from dpgcli.files.places import in_order
from dpgcli.files.scene_file import Spec
from dpgcli.files.sweep_file.models import SweepSpec
from dpgcli.files.yaml_file import Document

OF_SPECS, OF_SWEEPS = Spec.model_fields, SweepSpec.model_fields
EITHER = "a spec, with the key finger, or a sweep, with the keys base and space"
CALIBRATION = "a calibration is named by a spec, under finger.calibration"


def is_sweep(document: Document) -> bool:
    """Whether a document is a sweep, and no spec. Raises SpecError for what is neither, or both.

    >>> is_sweep(Document("wide.yaml", {"base": "finger.yaml", "space": []}, {}))
    True
    """
    of_specs = [key for key in document.data if key in OF_SPECS]
    of_sweeps = [key for key in document.data if key in OF_SWEEPS]
    if bool(of_specs) == bool(of_sweeps):
        problem = _both(document, of_specs, of_sweeps) if of_specs else _neither(document)
        raise SpecError(in_order([*document.problems, problem]))
    return bool(of_sweeps)


def _both(document: Document, of_specs: list[str], of_sweeps: list[str]) -> Problem:
    found = f"{', '.join(of_specs)} beside {', '.join(of_sweeps)}"
    hint = "the spec that a sweep varies is a file of its own, which base names"
    return document.problem((of_specs[0],), EITHER, found, hint)


def _neither(document: Document) -> Problem:
    """With the key that was probably mistyped."""
    for key in document.data:
        if close := get_close_matches(key, [*OF_SPECS, *OF_SWEEPS], n=1):
            return document.problem((key,), EITHER, key, f"did you mean {close[0]}?")
    hint = CALIBRATION if "calibration_version" in document.data else ""
    return document.problem(("document",), EITHER, "neither", hint)
