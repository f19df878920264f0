"""A spec or a sweep, as it is given: told apart by its keys, and read once."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

from dpgcli.api.inputs import (
    SceneInput,
    Settings,
    SpecInput,
    by_text,
    path_of,
    plain,
    scene_input,
    scene_input_in,
    setting_texts,
    spec_document,
)
from dpgcli.design.scene import Scene
from dpgcli.errors import UsageError
from dpgcli.files.frames import frame_of
from dpgcli.files.kind import is_sweep
from dpgcli.files.sweep_file import Sweep, read_sweep, sweep_in, sweep_of
from dpgcli.files.yaml_file import Document, read_document, without_free_keys
from dpgcli.mechanics.finger import Finger

SweepInput: TypeAlias = str | Path | Mapping[str, Any]
"""A sweep's file, or its data."""


def scene_or_sweep(given: SpecInput, settings: Settings = ()) -> SceneInput | Sweep:
    """Read a spec or a sweep; `settings` change the spec, that of a sweep being its base.

    Raises SpecError with all problems, also for what is neither.

    >>> scene_or_sweep({"fingers": {}})
    Traceback (most recent call last):
        ...
    dpgcli.errors.SpecError: spec: fingers: expected a spec, with the key finger, or a sweep, with \
the keys base and space, found fingers (did you mean finger?)
    """
    texts = setting_texts(settings)
    if isinstance(given, SceneInput | Scene | Finger):
        return scene_input(given, texts)
    if isinstance(given, Mapping):
        own = without_free_keys(by_text("spec", given))
        is_swept = is_sweep(Document("spec", own, {}))
        return sweep_input(given, texts) if is_swept else scene_input(given, texts)
    path = path_of("spec", given)
    document = read_document(given)
    if is_sweep(document):
        return sweep_of(document, path, texts)
    return scene_input_in(document, path, texts)


def sweep_input(sweep: SweepInput, settings: Settings = ()) -> Sweep:
    """Read a sweep, or take its data, in which the base may be data, too; raises SpecError."""
    texts = setting_texts(settings)
    if not isinstance(sweep, Mapping):
        return read_sweep(path_of("sweep", sweep), texts)
    base = sweep.get("base")
    if isinstance(base, Finger | Scene):
        raise UsageError("base: a finger's values have no keys that could vary: give a spec")
    data = without_free_keys(plain({**sweep, "space": _axes(sweep.get("space"))}))
    if not isinstance(base, Mapping):
        return sweep_in(Document("sweep", data, {}), Path(), texts)
    document = Document("sweep", {**data, "base": "base"}, {})
    return sweep_in(document, Path(), texts, base=spec_document(base, texts))


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
