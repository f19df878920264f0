"""The file of a sweep: a base spec and a space around it, read and checked."""

import json
import math
from collections.abc import Container, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from difflib import get_close_matches
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from dpgcli.errors import Problem, SpecError
from dpgcli.files.content import beside, quoted_if
from dpgcli.files.places import in_order, located, shown
from dpgcli.files.scene_file import Spec, canonical, canonical_json, read_scene
from dpgcli.files.scene_file.problems import checked
from dpgcli.files.scene_file.settings import SETTING
from dpgcli.files.sweep_file.models import (
    MOST_AXES,
    MOST_DESIGNS,
    AxisSpec,
    Between,
    Sample,
    SampleRange,
    SweepSpec,
)
from dpgcli.files.sweep_file.space import SpaceReader
from dpgcli.files.yaml_file import Document, read_document
from dpgcli.records import dataclass
from dpgcli.sweeps.expressions import Expression
from dpgcli.sweeps.space import Space
from dpgcli.text import KeyPath

__all__ = [
    "Sweep",
    "checked_base",
    "read_base",
    "read_sweep",
    "starter",
    "sweep_in",
    "sweep_of",
    "varied",
]

MOST_DIGITS = 30
TYPES = ("int", "float", "constrained-int", "constrained-float")  # not keys, in a finding's path


@dataclass(frozen=True)
class Sweep:
    """A sweep: its base spec with the plain data, space, constraints, and the files read.

    `said` is the space as the file says it, `digests` the SHA-256 of the tables it names.
    """

    base: Spec
    base_data: dict[str, Any]
    space: Space
    constraints: tuple[Expression, ...]
    base_path: Path
    files: tuple[Path, ...]
    said: dict[str, Any]
    digests: tuple[str, ...]

    def canonical_json(self) -> str:
        """One line of JSON, the same for sweeps that say the same."""
        space = canonical(self.said)
        said = {"base": canonical_json(self.base), "space": space, "tables": self.digests}
        return json.dumps(said, sort_keys=True, separators=(",", ":"), allow_nan=False)


def read_sweep(path: Path, settings: Sequence[str] = ()) -> Sweep:
    """Read and check a sweep; `settings` change its base spec.

    Raises SpecError with all problems of both files at once.
    """
    return sweep_of(read_document(path), path, settings)


def sweep_of(document: Document, path: Path, settings: Sequence[str] = ()) -> Sweep:
    """The same, of a document that was read from this path."""
    found = sweep_in(document, path.parent, settings)
    return replace(found, files=(path, *found.files))


def sweep_in(
    document: Document, folder: Path, settings: Sequence[str] = (), base: Document | None = None
) -> Sweep:
    """The sweep in a document; names of files are relative to a folder.

    `base` is the base spec where no file holds it. Raises SpecError as `read_sweep` does.
    """
    spec, problems = _validated(document)
    base_path = beside(folder, str(document.data.get("base")))
    base_files: tuple[Path, ...] = ()
    base_spec = None
    if base is not None:
        base_spec = checked_base(base, problems)
    elif isinstance(document.data.get("base"), str):
        base, base_spec = read_base(base_path, settings, problems)
        base_files = (base_path,)
    reader = SpaceReader(document, folder, None if base is None else base.data)
    axes = [reader.axis(place, axis) for place, axis in _axes(document)]
    known = None if base is None or spec is None else base.data
    rules = [reader.constraint(place, text, known) for place, text in _constraints(document)]
    problems = [*document.problems, *reader.problems, *problems, *varied(settings, reader.keys)]
    space = Space(tuple(axis for axis in axes if axis is not None))
    if space.size > MOST_DESIGNS:
        expected, found = f"at most {MOST_DESIGNS:,} designs", _many(space.size)
        problems.append(document.problem(("space",), expected, found, "take fewer values"))
    if problems or spec is None or base is None or base_spec is None:
        raise SpecError(in_order(problems))
    return Sweep(
        base_spec,
        base.data,
        space,
        tuple(rule for rule in rules if rule is not None),
        base_path,
        tuple(dict.fromkeys((*base_files, *base.files, *reader.files, *reader.folders))),
        spec.model_dump(exclude_none=True, exclude={"base"}),
        tuple(reader.files.values()),
    )


def _axes(document: Document) -> Iterator[tuple[int, AxisSpec]]:
    """The axes whose keys are right, each with its place; the others are problems already."""
    said = document.data.get("space")
    if not isinstance(said, list) or len(said) > MOST_AXES:
        return
    for place, axis in enumerate(said):
        with suppress(ValidationError):
            yield place, AxisSpec.model_validate(axis)


def _constraints(document: Document) -> Iterator[tuple[int, str]]:
    said = document.data.get("constraints")
    for place, text in enumerate(said if isinstance(said, list) else ()):
        if isinstance(text, str):
            yield place, text


def read_base(
    path: Path, settings: Sequence[str], problems: list[Problem]
) -> tuple[Document | None, Spec | None]:
    """The data of the base and what they mean, None where `problems` now say why not."""
    document = None
    try:
        with quoted_if(path, "finger", "a spec, with a section finger"):
            document = read_scene(path, settings)
            return document, checked(document)
    except SpecError as error:
        problems += error.problems
    return document, None


def checked_base(base: Document, problems: list[Problem]) -> Spec | None:
    """What the data of a base mean, None where `problems` now say why not."""
    try:
        return checked(base)
    except SpecError as error:
        problems += error.problems
    return None


def starter(base: str) -> str:
    """A commented sweep to start from, around the spec of this name."""
    resource = resources.files("dpgcli.files.sweep_file").joinpath("starter.yaml")
    return resource.read_text(encoding="utf-8").replace("base: finger.yaml", f"base: {base}", 1)


def _many(number: int) -> str:
    """A large number in digits, or where these are many its power of ten."""
    power = math.log10(number)
    return f"{number:,}" if power < MOST_DIGITS else f"about 10^{power:.0f}"


def varied(settings: Sequence[str], keys: Container[str]) -> Iterator[Problem]:
    """Settings of what the space varies, which would change nothing."""
    for text in settings:
        key = text.partition("=")[0].strip()
        if key in keys:
            yield located(SETTING, key, "a key that the space leaves alone", "one that it varies")


def _validated(document: Document) -> tuple[SweepSpec | None, list[Problem]]:
    """The sweep, None where it is none; a key without a value is a problem, not an absent one."""
    try:
        spec = SweepSpec.model_validate(document.data)
        said = [(path, _model_at(path)[1] or "a value") for path in document.empty()]
        return spec, [document.problem(path, expected, "nothing") for path, expected in said]
    except ValidationError as error:
        return None, [_problem(document, e) for e in error.errors(include_url=False)]


def _problem(document: Document, error: Any) -> Problem:
    """One finding of the models as a problem with a place, for all types that a value may have."""
    path: KeyPath = tuple(part for part in error["loc"] if part not in TYPES)
    section, field = _model_at(path)
    if error["type"] == "extra_forbidden":
        known = [f.alias or name for name, f in section.model_fields.items()]
        close = get_close_matches(str(path[-1]), known, n=1)
        hint = f"did you mean {close[0]}?" if close else "known here: " + ", ".join(known)
        return document.problem(path, "a known key", shown(path[-1]), hint)
    found = "nothing" if error["type"] == "missing" else shown(error["input"])
    return document.problem(path, field or "a mapping of keys", found)


def _model_at(path: KeyPath) -> tuple[type[BaseModel], str]:
    """The section that a key path stands in, and what its key describes."""
    section: type[BaseModel] = SweepSpec
    described = ""
    sections: dict[str, type[BaseModel]] = {
        "space": AxisSpec,
        "linear": Between,
        "log": Between,
        "sample": Sample,
    }
    for part in path:
        if isinstance(part, str):
            by_alias = {f.alias or name: f for name, f in section.model_fields.items()}
            if part in by_alias:
                described = by_alias[part].description or ""
            if part in sections and part != path[-1]:
                section = sections[part]
            elif part == "ranges":
                section = SampleRange
    return section, described
