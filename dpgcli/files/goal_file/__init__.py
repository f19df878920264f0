"""The file of a goal: a base spec, what may vary around it, and what is asked of the designs."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from dpgcli.design.dimensions import LINEAR_STIFFNESS, MAX_UNITS, UNITS, are_possible
from dpgcli.errors import Problem, SpecError
from dpgcli.files.content import beside
from dpgcli.files.goal_file.maps import MapReader
from dpgcli.files.goal_file.models import ASKED, MOST_ASKED, VARIED, GoalSpec
from dpgcli.files.goal_file.targets import MOST_STATES, TargetReader
from dpgcli.files.places import in_order, shown
from dpgcli.files.scene_file import Spec
from dpgcli.files.sweep_file import checked_base, read_base, varied
from dpgcli.files.sweep_file.models import MOST_KEYS
from dpgcli.files.sweep_file.space import SpaceReader, numbers_of
from dpgcli.files.yaml_file import Document, read_document
from dpgcli.records import dataclass
from dpgcli.search.goal import Goal, Objective, Range, Target
from dpgcli.search.maps import MapEvaluation
from dpgcli.sweeps.expressions import Expression
from dpgcli.text import KeyPath, is_finite

__all__ = ["GoalFile", "goal_in", "goal_of", "read_goal"]


@dataclass(frozen=True)
class GoalFile:
    """A goal, its base spec, the data of that with what files hold, the files read, its words."""

    goal: Goal
    base: Spec
    base_document: Document
    files: tuple[Path, ...]
    said: dict[str, Any]


def read_goal(path: Path, settings: Sequence[str] = ()) -> GoalFile:
    """Read and check a goal; `settings` change its base spec.

    Raises SpecError with all problems of both files at once.
    """
    return goal_of(read_document(path), path, settings)


def goal_of(document: Document, path: Path, settings: Sequence[str] = ()) -> GoalFile:
    """The same, of a document that was read from this path."""
    for key, kind, command in (("finger", "a spec", "predict"), ("space", "a sweep", "sweep")):
        if key in document.data and "vary" not in document.data:
            said = "a goal, with the keys base, vary and targets", kind, f"dpg {command} takes it"
            raise SpecError(in_order([*document.problems, document.problem((key,), *said)]))
    found = goal_in(document, path.parent, settings)
    return replace(found, files=(path, *found.files))


def goal_in(
    document: Document, folder: Path, settings: Sequence[str] = (), base: Document | None = None
) -> GoalFile:
    """The goal in a document; names of files are relative to a folder.

    `base` is the base spec where no file holds it. Raises SpecError as `read_goal` does.
    """
    problems = [*document.problems, *_form_problems(document)]
    base_path = beside(folder, str(document.data.get("base")))
    base_spec: Spec | None = None
    own: tuple[Path, ...] = ()
    if base is not None:
        base_spec = checked_base(base, problems)
    elif isinstance(document.data.get("base"), str):
        base, base_spec = read_base(base_path, settings, problems)
        own = (base_path,)
    reader = SpaceReader(document, folder, None if base is None else base.data)
    ranges, lists = _varied(reader, document.data.get("vary"))
    targets: list[Target | None] = []
    constraints: tuple[Expression, ...] = ()
    objectives: tuple[Objective, ...] = ()
    known: dict[str, float] = {}
    if base_spec is not None:
        units = [int(n) for n in lists.get(UNITS, (base_spec.finger.units,))]
        possible = [n for n in units if 1 <= n <= MAX_UNITS]
        of_targets = TargetReader(reader, possible, base_spec.design)
        targets = [of_targets.target(*pair) for pair in enumerate(_listed(document, "targets"))]
        known = {} if base is None else numbers_of(base.data)
        ends = {each.key: (each.low, each.high) for each in ranges}
        ends |= {key: (min(values), max(values)) for key, values in lists.items()}
        of_maps = MapReader(reader, base_spec.design, known, ends)
        constraints = of_maps.constraints(_listed(document, "constraints"))
        objectives = of_maps.objectives(
            _listed(document, "minimize"), _listed(document, "maximize")
        )
    problems += [*reader.problems, *varied(settings, reader.keys)]
    if problems or base is None or base_spec is None:
        raise SpecError(in_order(problems))
    right = tuple(target for target in targets if target is not None)
    goal = Goal(base_spec.design, ranges, lists, right, constraints, objectives, known)
    if problem := _too_many_states(document, goal):
        raise SpecError((problem,))
    files = tuple(dict.fromkeys((*own, *base.files)))
    return GoalFile(goal, base_spec, base, files, dict(document.data))


def _too_many_states(document: Document, goal: Goal) -> Problem | None:
    """Of designs all of whose states matter, for each of very many designs."""
    longest = int(max(goal.lists.get(UNITS, (goal.base.units,))))
    of_all = MapEvaluation(goal).names or any(not target.pattern for target in goal.targets)
    if not of_all or 2**longest <= MOST_STATES:
        return None
    most = MOST_STATES.bit_length() - 1
    expected = f"at most {most} units, as what is asked for is about all states of a design"
    path: KeyPath = ("vary", UNITS) if UNITS in goal.lists else ("base",)
    hint = f"{2**longest:,} states; a sweep takes longer fingers"
    return document.problem(path, expected, f"{longest}", hint)


def _listed(document: Document, key: str) -> list[Any]:
    said = document.data.get(key)
    return said if isinstance(said, list) else []


def _form_problems(document: Document) -> Iterator[Problem]:
    """What is wrong with the keys of the top level."""
    try:
        GoalSpec.model_validate(document.data)
    except ValidationError as error:
        for found in error.errors(include_url=False):
            yield _form_problem(document, found)
        return
    if not document.data["vary"]:
        yield document.problem(("vary",), "a key or more", "none")
    asked = {key: len(_listed(document, key)) for key in ASKED}
    if not sum(asked.values()):
        yield document.problem(("targets",), f"one or more of {', '.join(ASKED)}", "none")
    for key, n in asked.items():
        if n > MOST_ASKED:
            yield document.problem((key,), f"at most {MOST_ASKED} {key}", f"{n:,}")


def _form_problem(document: Document, found: Any) -> Problem:
    path: KeyPath = found["loc"][:1]
    fields = GoalSpec.model_fields
    if found["type"] == "extra_forbidden":
        close = get_close_matches(str(path[0]), fields, n=1)
        hint = f"did you mean {close[0]}?" if close else f"known here: {', '.join(fields)}"
        return document.problem(path, "a known key", shown(path[0]), hint)
    missing = found["type"] == "missing"
    value = "nothing" if missing else shown(document.data.get(str(path[0])))
    return document.problem(path, fields[str(path[0])].description or "", value)


def _varied(
    reader: SpaceReader, said: Any
) -> tuple[tuple[Range, ...], dict[str, tuple[float, ...]]]:
    """The ranges, and values by key of what has a list of them."""
    ranges: list[Range] = []
    lists: dict[str, tuple[float, ...]] = {}
    for key, values in said.items() if isinstance(said, dict) else ():
        path: KeyPath = ("vary", key)
        n_before = len(reader.problems)
        reader.check_keys(path, [key])
        if len(reader.problems) > n_before:
            continue
        if isinstance(values, list):
            if _are_values(reader, path, key, values):
                lists[key] = tuple(dict.fromkeys(values))
        elif (ends := _ends(reader, path, key, values)) is None:
            continue
        elif key == UNITS:
            lists[key] = tuple(range(int(ends[0]), int(ends[1]) + 1))
        else:
            ranges.append(Range(key, *ends))
    if len(ranges) + len(lists) > MOST_KEYS:
        reader.wrong(("vary",), f"at most {MOST_KEYS} keys", f"{len(ranges) + len(lists)}")
    return tuple(ranges), lists


def _are_values(reader: SpaceReader, path: KeyPath, key: str, values: list[Any]) -> bool:
    """Whether a list has values that the key can have; else with a problem."""
    rigid = LINEAR_STIFFNESS if key.endswith(LINEAR_STIFFNESS) else ""
    wrong = [v for v in values if not is_finite(v) and not (rigid and v == float("inf"))]
    if wrong or not values:
        reader.wrong(path, VARIED, shown(wrong[0]) if wrong else "no values")
        return False
    return _are_possible(reader, path, key, values)


def _ends(reader: SpaceReader, path: KeyPath, key: str, said: Any) -> tuple[float, float] | None:
    """Both ends of a range; None, with a problem, where it is none."""
    if not (isinstance(said, dict) and set(said) == {"from", "to"}):
        found = (
            f"keys {', '.join(map(str, said)) or 'none'}" if isinstance(said, dict) else shown(said)
        )
        reader.wrong(path, VARIED, found)
        return None
    for end, value in said.items():
        if not is_finite(value):
            reader.wrong((*path, end), "a number", shown(value))
            return None
    low, high = said["from"], said["to"]
    if not low < high:
        reader.wrong(path, "a range from less to more", f"{low:g} to {high:g}")
        return None
    return (float(low), float(high)) if _are_possible(reader, path, key, [low, high]) else None


def _are_possible(reader: SpaceReader, path: KeyPath, key: str, values: Sequence[float]) -> bool:
    possible = are_possible(key.rsplit(".", 1)[-1], np.array(values, float))
    if possible.all():
        return True
    first = values[int(np.argmin(possible))]
    reader.wrong(path, "values that the key can have", f"{first:g}", "dpg help spec")
    return False
