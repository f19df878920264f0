"""A spec, a sweep or a goal, as it is given: told apart by its keys, and read once."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

from dpgcli.api.arguments import path_of
from dpgcli.api.inputs import (
    SceneInput,
    Settings,
    SpecInput,
    by_text,
    plain,
    scene_input,
    scene_input_in,
    setting_texts,
    spec_document,
)
from dpgcli.design.scene import Scene
from dpgcli.errors import UsageError
from dpgcli.files.frames import frame_of
from dpgcli.files.goal_file import GoalFile, goal_in, goal_of, read_goal
from dpgcli.files.kind import FileKind, kind_of
from dpgcli.files.scene_file import Spec
from dpgcli.files.sweep_file import Sweep, read_sweep, sweep_in, sweep_of
from dpgcli.files.yaml_file import Document, read_document, without_free_keys
from dpgcli.mechanics.finger import Finger

SweepInput: TypeAlias = str | Path | Mapping[str, Any]
"""A sweep's file, or its data."""

GoalInput: TypeAlias = str | Path | Mapping[str, Any]
"""A goal's file, or its data."""


def any_input(given: SpecInput, settings: Settings = ()) -> SceneInput | Sweep | GoalFile:
    """Read a spec, a sweep or a goal; `settings` change the spec, that of others being their base.

    Raises SpecError with all problems, also for what is none of them.

    >>> any_input({"fingers": {}})
    Traceback (most recent call last):
        ...
    dpgcli.errors.SpecError: spec: fingers: expected a spec, with the key finger, a sweep, with \
the keys base and space, or a goal, with the keys base, vary and targets, found fingers (did you \
mean finger?)
    """
    texts = setting_texts(settings)
    if isinstance(given, SceneInput | Spec | Scene | Finger):
        return scene_input(given, texts)
    if isinstance(given, Mapping):
        own = without_free_keys(by_text("spec", given))
        kind = kind_of(Document("spec", own, {}))
        if kind is FileKind.GOAL:
            return goal_input(given, texts)
        return (sweep_input if kind is FileKind.SWEEP else scene_input)(given, texts)
    path = path_of("spec", given)
    document = read_document(given)
    kind = kind_of(document)
    if kind is FileKind.SPEC:
        return scene_input_in(document, path, texts)
    return (sweep_of if kind is FileKind.SWEEP else goal_of)(document, path, texts)


def sweep_input(sweep: SweepInput, settings: Settings = ()) -> Sweep:
    """Read a sweep, or take its data, in which the base may be data, too; raises SpecError."""
    texts = setting_texts(settings)
    if not isinstance(sweep, Mapping):
        return read_sweep(path_of("sweep", sweep), texts)
    document, base = _around_base("sweep", {**sweep, "space": _axes(sweep.get("space"))}, texts)
    return sweep_in(document, Path(), texts, base=base)


def goal_input(goal: GoalInput, settings: Settings = ()) -> GoalFile:
    """Read a goal, or take its data, in which the base may be data, too; raises SpecError."""
    texts = setting_texts(settings)
    if not isinstance(goal, Mapping):
        return read_goal(path_of("goal", goal), texts)
    document, base = _around_base("goal", goal, texts)
    return goal_in(document, Path(), texts, base=base)


def _around_base(
    name: str, given: Mapping[str, Any], settings: Settings
) -> tuple[Document, Document | None]:
    """Data with a base, and the base where it is data, too."""
    base = given.get("base")
    if isinstance(base, Finger | Scene):
        raise UsageError("base: a finger's values have no keys that could vary: give a spec")
    data = without_free_keys(plain(given))
    if not isinstance(base, Mapping):
        return Document(name, data, {}), None
    return Document(name, {**data, "base": "base"}, {}), spec_document(base, settings)


def _axes(space: Any) -> Any:
    """Axes of a space, data frames among them as values that go together."""
    if not isinstance(space, list | tuple):
        return space
    return [{"paired": _columns(axis["table"])} if _is_frame(axis) else axis for axis in space]


def _is_frame(axis: Any) -> bool:
    """Whether an axis is a table of pandas, of Arrow, or ours."""
    table = axis.get("table") if isinstance(axis, Mapping) else None
    return hasattr(table, "to_dict") or hasattr(table, "to_pandas")


def _columns(table: Any) -> dict[Any, list[Any]]:
    frame = frame_of(table)
    if twice := [str(name) for name in frame.columns[frame.columns.duplicated()]]:
        raise UsageError(f"table: expected each column once, found {', '.join(twice)} again")
    return {name: frame[name].tolist() for name in frame}
