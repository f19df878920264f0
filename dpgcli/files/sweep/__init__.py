"""The file of a sweep: a base spec and a space around it, read and checked."""

import hashlib
import json
import warnings
from collections import Counter
from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ValidationError

from dpgcli.errors import Problem, SpecError
from dpgcli.exploration.expressions import Expression, ExpressionError, expression
from dpgcli.exploration.space import (
    Axis,
    Range,
    Space,
    linear,
    listed,
    logarithmic,
    sampled,
)
from dpgcli.files.places import KeyPath, in_order, located, shown
from dpgcli.files.source import Document, read_document
from dpgcli.files.spec import Spec, canonical_json, read_scene
from dpgcli.files.spec.problems import checked, unknown_key
from dpgcli.files.spec.settings import SETTING
from dpgcli.files.sweep.models import (
    MANY_KEYS,
    ONE_KEY,
    AxisSpec,
    Between,
    Sample,
    SampleRange,
    SweepSpec,
)

__all__ = ["Sweep", "read_sweep"]

UNITS = "finger.units"
TYPES = ("int", "float", "constrained-int", "constrained-float")  # not keys, in a finding's path


@dataclass(frozen=True)
class Sweep:
    """What to compute: the base spec with its plain data, the space, constraints, files read.

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
        said = {"base": canonical_json(self.base), "space": self.said, "tables": self.digests}
        return json.dumps(said, sort_keys=True, separators=(",", ":"))


def read_sweep(path: Path, settings: Sequence[str] = ()) -> Sweep:
    """Read and check a sweep; `settings` change its base spec.

    Raises SpecError with all problems of both files at once, those of content after those of form.
    """
    document = read_document(path)
    spec, problems = _validated(document)
    named = document.data.get("base")
    base_path = path.parent / str(named)
    base_document, base = None, None
    if isinstance(named, str):
        base_document, base = _base(base_path, settings, problems)
    if spec is None or base_document is None:
        raise SpecError(in_order([*document.problems, *problems]))
    reader = _SpaceReader(document, path.parent, "gripper" in base_document.data)
    axes = [reader.axis(place, axis) for place, axis in enumerate(spec.space)]
    rules = [
        reader.constraint(place, text, base_document.data)
        for place, text in enumerate(spec.constraints or ())
    ]
    problems = [*document.problems, *reader.problems, *problems, *_varied(settings, reader.keys)]
    if problems or base is None:
        raise SpecError(in_order(problems))
    return Sweep(
        base,
        base_document.data,
        Space(tuple(axis for axis in axes if axis is not None)),
        tuple(rule for rule in rules if rule is not None),
        base_path,
        (path, base_path, *base_document.files, *reader.tables),
        spec.model_dump(exclude_none=True, exclude={"base"}),
        tuple(hashlib.sha256(table.read_bytes()).hexdigest() for table in reader.tables),
    )


def _base(
    path: Path, settings: Sequence[str], problems: list[Problem]
) -> tuple[Document | None, Spec | None]:
    """The data of the base and what they mean, None where `problems` now say why not."""
    document = None
    try:
        document = read_scene(path, settings)
        return document, checked(document)
    except SpecError as error:
        problems += error.problems
    return document, None


def _varied(settings: Sequence[str], keys: Container[str]) -> Iterator[Problem]:
    """Settings of what the space varies, which would change nothing."""
    for text in settings:
        key = text.partition("=")[0].strip()
        if key in keys:
            yield located(SETTING, key, "a key that the space leaves alone", "one that it varies")


def _validated(document: Document) -> tuple[SweepSpec | None, list[Problem]]:
    try:
        return SweepSpec.model_validate(document.data), []
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


@dataclass
class _SpaceReader:
    """Makes axes from what a file says; what is wrong gathers in `problems`."""

    document: Document
    folder: Path
    has_gripper: bool

    def __post_init__(self) -> None:
        self.problems: list[Problem] = []
        self.tables: list[Path] = []
        self.keys: set[str] = set()

    def wrong(self, path: KeyPath, expected: str, found: str, hint: str = "") -> None:
        self.problems.append(self.document.problem(path, expected, found, hint))

    def axis(self, place: int, said: AxisSpec) -> Axis | None:
        """The axis, or None with a problem."""
        path: KeyPath = ("space", place)
        kinds = [k for k in (*ONE_KEY, *MANY_KEYS) if getattr(said, k) is not None]
        if len(kinds) != 1:
            every = ", ".join((*ONE_KEY, *MANY_KEYS))
            self.wrong(path, f"exactly one of {every}", ", ".join(kinds) or "none")
            return None
        if (kinds[0] in ONE_KEY) != (said.key is not None):
            needs = "a key beside" if said.key is None else "no key beside"
            self.wrong(path, f"{needs} {kinds[0]}", shown(said.key))
            return None
        made = self.made(path, said, kinds[0])
        if made is not None:
            self.check_keys((*path, "key" if said.key else kinds[0]), list(made.values))
        return made

    def made(self, path: KeyPath, said: AxisSpec, kind: str) -> Axis | None:
        if said.key is not None and said.values is not None:
            return listed(said.key, _numbers(said.key, said.values))
        if said.key is not None and (between := said.linear or said.log):
            return self.spaced((*path, kind), said.key, between, is_log=said.log is not None)
        if said.paired is not None:
            return self.paired((*path, kind), said.paired)
        if said.sample is not None:
            return self.sampled((*path, kind), said.sample)
        return self.tabulated((*path, kind), said.table or "")

    def spaced(self, path: KeyPath, key: str, between: Between, *, is_log: bool) -> Axis | None:
        if is_log and min(between.first, between.last) <= 0:
            self.wrong(path, "bounds above zero", f"{between.first:g} and {between.last:g}")
            return None
        make = logarithmic if is_log else linear
        axis = make(key, between.first, between.last, between.count)
        return Axis({key: _numbers(key, axis.values[key].tolist())})

    def paired(self, path: KeyPath, columns: dict[str, list[int | float]]) -> Axis | None:
        lengths = {key: len(values) for key, values in columns.items()}
        if len(set(lengths.values())) > 1:
            self.wrong(path, "lists of one length", ", ".join(map(str, lengths.values())))
            return None
        return Axis({key: _numbers(key, values) for key, values in columns.items()})

    def sampled(self, path: KeyPath, sample: Sample) -> Axis | None:
        for key, bounds in sample.ranges.items():
            if bounds.scale == "log" and min(bounds.first, bounds.last) <= 0:
                self.wrong((*path, "ranges", key), "bounds above zero", "zero or less")
                return None
        ranges = {k: Range(r.first, r.last, r.scale == "log") for k, r in sample.ranges.items()}
        return sampled(sample.method, ranges, sample.count, sample.seed)

    def tabulated(self, path: KeyPath, name: str) -> Axis | None:
        """Columns of a CSV or Parquet file; pandas reads both."""
        import pandas as pd

        table = self.folder / name
        try:
            if table.suffix == ".parquet":
                frame = pd.read_parquet(table)
            else:
                with warnings.catch_warnings():  # rows that do not fit the header
                    warnings.simplefilter("error", pd.errors.ParserWarning)
                    frame = pd.read_csv(table, index_col=False)
        except (OSError, ValueError, pd.errors.ParserWarning) as error:
            self.wrong(path, "a CSV or Parquet file of designs", shown(str(error)))
            return None
        if frame.empty:
            self.wrong(path, "rows of finite numbers", "no rows")
            return None
        columns = {str(key): frame[key].to_numpy() for key in frame.columns}
        n_before = len(self.problems)
        for key, column in columns.items():
            numbers = pd.to_numeric(pd.Series(column), errors="coerce").to_numpy(np.float64)
            wrong = np.flatnonzero(~np.isfinite(numbers))
            if len(wrong) or column.dtype.kind not in "iuf":
                row = int(wrong[0]) if len(wrong) else 0
                found = f"{shown(str(column[row]))} in row {row + 1}"
                self.wrong(path, f"finite numbers in column {key}", found, "no text, no gaps")
        if len(self.problems) > n_before:
            return None
        self.tables.append(table)
        return Axis(columns)

    def check_keys(self, path: KeyPath, keys: list[str]) -> None:
        """Keys must be known to the spec, and vary on one axis only."""
        for key in keys:
            if unknown := unknown_key(tuple(key.split("."))):
                self.wrong(path, *unknown)
            elif key.startswith("gripper.") and not self.has_gripper:
                self.wrong(path, "keys of a base that has them", key, "the base has no gripper")
            if key in self.keys:
                self.wrong(path, "each key on one axis", f"{key} again")
            self.keys.add(key)

    def constraint(self, place: int, text: str, data: dict[str, Any]) -> Expression | None:
        """The rule, with names that are keys of the space or of the base spec."""
        path: KeyPath = ("constraints", place)
        try:
            rule = expression(text)
        except ExpressionError as error:
            self.wrong(path, "an expression over keys", shown(text), str(error))
            return None
        if not rule.is_comparison:
            self.wrong(path, "a comparison, such as dome_height_mm > 5", shown(text))
        numbers = {k for k, v in flattened(data).items() if type(v) in (int, float)}
        known = self.keys | numbers
        last = Counter(name.rsplit(".", 1)[-1] for name in known)
        short = {name for name, count in last.items() if count == 1}
        if unknown := sorted(rule.names - known - short):
            close = get_close_matches(unknown[0], [*known, *short], n=1)
            hint = f"did you mean {close[0]}?" if close else ""
            expected = "numeric keys, by their last part or, if two share that, in full"
            self.wrong(path, expected, ", ".join(unknown), hint)
        return rule


def _numbers(key: str, values: Sequence[int | float]) -> Any:
    """Values as an array: whole numbers stay whole, and those of units become so."""
    whole = all(float(value).is_integer() and abs(value) < 2**53 for value in values)
    counts = whole and (key == UNITS or all(isinstance(value, int) for value in values))
    return np.array(values, np.int64 if counts else np.float64)


def flattened(data: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Values of nested data by dotted key."""
    flat: dict[str, Any] = {}
    for key, value in data.items():
        if isinstance(value, dict):
            flat |= flattened(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat
