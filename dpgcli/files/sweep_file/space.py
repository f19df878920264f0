"""The space of a sweep: axes from what its file says, and constraints over their keys."""

import hashlib
import os
from collections import Counter
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dpgcli.design.bodies import PLACES
from dpgcli.design.dimensions import UNITS
from dpgcli.errors import Problem, SpecError
from dpgcli.files.content import beside, content_of
from dpgcli.files.places import shown
from dpgcli.files.scene_file.problems import unknown_key
from dpgcli.files.sweep_file.models import (
    MANY_KEYS,
    MOST_BYTES,
    MOST_KEYS,
    MOST_NUMBERS,
    ONE_KEY,
    AxisSpec,
    Between,
    Sample,
)
from dpgcli.files.yaml_file import Document
from dpgcli.records import dataclass
from dpgcli.sweeps.expressions import Expression, ExpressionError, expression
from dpgcli.sweeps.space import Axis, Range, linear, listed, logarithmic, sampled
from dpgcli.text import KeyPath

if TYPE_CHECKING:
    import pandas as pd


LARGEST_UNITS = 2**53  # beyond, a float that is whole need not be the number that was meant
OBJECT = "object"
OPTIONAL = ("gripper", "loads", OBJECT, "pressure")  # sections that a base may leave out
ASIDE = ("uncertainty", "model_error")  # sections that a sweep leaves aside
INDEX = "pandas writes no index where index=False"
TABLE = "a CSV or Parquet file of designs, or a folder of such"


@dataclass
class SpaceReader:
    """Makes axes from what a file says; what is wrong gathers in `problems`.

    `base` is the data of the base spec, None where they are not known.
    """

    document: Document
    folder: Path
    base: dict[str, Any] | None

    def __post_init__(self) -> None:
        self.problems: list[Problem] = []
        self.files: dict[Path, str] = {}  # tables with the SHA-256 of what was read
        self.folders: list[Path] = []  # in which parts of tables were looked for
        self.keys: set[str] = set()
        self.n_numbers = self.n_keys = 0

    def wrong(self, path: KeyPath, expected: str, found: str, hint: str = "") -> None:
        self.problems.append(self.document.problem(path, expected, found, hint))

    def has_room(
        self, path: KeyPath, n_points: int, n_keys: int, is_more_of_it: bool = False
    ) -> bool:
        """Count an axis in, before it is made; False, with a problem, where it is too large.

        A part of an axis whose keys are counted already `is_more_of_it`.
        """
        self.n_numbers += n_points * n_keys
        self.n_keys += 0 if is_more_of_it else n_keys
        has_room = self.n_numbers <= MOST_NUMBERS and self.n_keys <= MOST_KEYS
        if not has_room:
            expected = f"at most {MOST_NUMBERS:,} numbers of {MOST_KEYS} keys in all axes"
            found = f"{self.n_numbers:,} numbers of {self.n_keys:,} keys up to here"
            self.wrong(path, expected, found, "take fewer points or keys, or several sweeps")
        return has_room

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
        made = self.made(path, said, kinds[0]) if self.has_room(path, *_size(said)) else None
        if made is not None:
            self.check_keys((*path, "key" if said.key else kinds[0]), list(made.values))
            made = self.whole((*path, kinds[0]), made)
        return made

    def whole(self, path: KeyPath, axis: Axis) -> Axis | None:
        """The axis with numbers of units as whole numbers; None with a problem.

        Fractions that a list or a table has are designs of their own, invalid ones.
        """
        if UNITS not in axis.values:
            return axis
        units = np.asarray(axis.values[UNITS])
        fractions = units[(units != np.rint(units)) | ~(np.abs(units) < LARGEST_UNITS)]
        if not len(fractions):
            return Axis({**axis.values, UNITS: units.astype(np.int64)})
        if path[-1] in ("linear", "log", "sample"):
            expected = f"steps that are whole numbers of {UNITS}"
            self.wrong(path, expected, f"{fractions[0]:g}", "list them under values")
        return axis

    def made(self, path: KeyPath, said: AxisSpec, kind: str) -> Axis | None:
        if said.key is not None and said.values is not None:
            return listed(said.key, _numbers(said.values))
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
        return make(key, between.first, between.last, between.count)

    def paired(self, path: KeyPath, columns: dict[str, list[int | float]]) -> Axis | None:
        lengths = {key: len(values) for key, values in columns.items()}
        if len(set(lengths.values())) > 1:
            self.wrong(path, "lists of one length", ", ".join(map(str, lengths.values())))
            return None
        return Axis({key: _numbers(values) for key, values in columns.items()})

    def sampled(self, path: KeyPath, sample: Sample) -> Axis | None:
        for key, bounds in sample.ranges.items():
            if bounds.scale == "log" and min(bounds.first, bounds.last) <= 0:
                self.wrong((*path, "ranges", key), "bounds above zero", "zero or less")
                return None
        ranges = {k: Range(r.first, r.last, r.scale == "log") for k, r in sample.ranges.items()}
        return sampled(sample.method, ranges, sample.count, sample.seed)

    def tabulated(self, path: KeyPath, name: str) -> Axis | None:
        """Columns of a CSV or Parquet file, or of a folder of such, which is read once."""
        from dpgcli.files.sweep_file.tables import UNREADABLE, NoTableError, Wrong, numbers_in

        try:
            frame = self.read(path, beside(self.folder, name))
        except SpecError as error:
            self.wrong(path, TABLE, error.problems[0].found)
            return None
        except NoTableError as error:
            self.wrong(path, TABLE, *error.args)
            return None
        except UNREADABLE as error:
            self.wrong(path, TABLE, shown(str(error)))
            return None
        if frame is None or not self.is_of_designs(path, frame):
            return None
        columns: dict[str, Any] = {str(key): numbers_in(frame[key]) for key in frame}
        wrong = {key: found for key, found in columns.items() if isinstance(found, Wrong)}
        for key, (kind, found, hint) in wrong.items():
            self.wrong(path, f"{kind} in column {key}", found, hint)
        return None if wrong else Axis(columns)

    def read(self, path: KeyPath, file: Path) -> "pd.DataFrame | None":
        """The table in a file or a folder; None, with a problem, where there is no room for it."""
        from dpgcli.files.sweep_file.folders import joined, parts_of
        from dpgcli.files.sweep_file.tables import frame_in

        parts, folders = parts_of(file) if file.is_dir() else ([file], [])
        size = sum(part.stat().st_size for part in parts if part.is_file())
        if size > MOST_BYTES:
            expected = f"at most {MOST_BYTES // 2**20} MiB of CSV or Parquet"
            found = f"{size // 2**20:,} MiB"
            self.wrong(path, expected, found, "take fewer designs, or several sweeps")
            return None
        frames: dict[Path, pd.DataFrame] = {}
        for part in parts:
            content = content_of(part, self.document.place(path))
            frame = frame_in(content, lambda n, keys: self.has_room(path, n, keys, bool(frames)))
            if frame is None:
                return None
            frames[part] = frame
            self.files[part] = hashlib.sha256(content).hexdigest()
        if parts == [file]:
            return frames[file]
        names = "\n".join(part.relative_to(file).as_posix() for part in parts)
        self.files[file] = hashlib.sha256(os.fsencode(names)).hexdigest()  # one more is a change
        self.folders += folders
        return joined(file, frames)

    def is_of_designs(self, path: KeyPath, frame: "pd.DataFrame") -> bool:
        """Whether there are rows, and keys as columns, each once; False with a problem.

        Of a file that has no such column nothing is quoted: anything may have been named.
        """
        keys = [str(key) for key in frame.columns]
        if all(unknown_key(tuple(key.split("."))) for key in keys):
            found = f"none in {len(keys)}"
            self.wrong(path, f"columns that are keys of the spec, such as {UNITS}", found)
        elif twice := [key for key, count in Counter(keys).items() if count > 1]:
            self.wrong(path, "each column once", f"{twice[0]} again")
        elif frame.empty:
            self.wrong(path, "rows of finite numbers", "no rows")
        else:
            return True
        return False

    def check_keys(self, path: KeyPath, keys: list[str]) -> None:
        """Keys must be known to the spec, and vary on one axis only."""
        for key in keys:
            if unknown := unknown_key(tuple(key.split("."))):
                expected, found, hint = unknown
                self.wrong(path, expected, found, INDEX if key.startswith("Unnamed: ") else hint)
            elif absent := self.absent_section(key):
                hint = f"the base has no {absent}"
                self.wrong(path, "keys of a base that has them", key, hint)
            if key in self.keys:
                self.wrong(path, "each key on one axis", f"{key} again")
            self.keys.add(key)

    def absent_section(self, key: str) -> str:
        """What a key needs of the base that is not there; empty where all is.

        A body has the keys of its kind, and of what it has beside its place.
        """
        section, *others = key.split(".")
        if self.base is None or section not in OPTIONAL:
            return ""
        if section not in self.base:
            return section
        own = self.base[section]
        if section != OBJECT or not isinstance(own, dict) or others[0] in PLACES:
            return ""
        kept = own.get(others[0])
        if kept is None:
            return f"{section}.{others[0]}"
        return key if isinstance(kept, dict) and others[1] not in kept else ""

    def constraint(self, place: int, text: str, data: dict[str, Any] | None) -> Expression | None:
        """The rule, with names that are keys of the space or of the base spec, if it is known."""
        path: KeyPath = ("constraints", place)
        try:
            rule = expression(text)
        except ExpressionError as error:
            self.wrong(path, "an expression over keys", shown(text), str(error))
            return None
        if not rule.is_comparison:
            self.wrong(path, "a comparison, such as dome_height_mm > 5", shown(text))
        if data is None:
            return rule
        known = self.keys | numbers_of(data).keys()
        last = Counter(name.rsplit(".", 1)[-1] for name in known)
        short = {name for name, count in last.items() if count == 1}
        if unknown := sorted(rule.names - known - short):
            close = get_close_matches(unknown[0], [*known, *short], n=1)
            hint = f"did you mean {close[0]}?" if close else ""
            expected = "numeric keys, by their last part or, if two share that, in full"
            self.wrong(path, expected, ", ".join(unknown), hint)
        return rule


def _size(said: AxisSpec) -> tuple[int, int]:
    """Points and keys of an axis, as far as they are known before it is made."""
    if said.sample is not None:
        return said.sample.count, len(said.sample.ranges)
    if said.paired is not None:
        return max(map(len, said.paired.values())), len(said.paired)
    between = said.linear or said.log
    return (between.count if between else len(said.values or ())), int(said.key is not None)


def _numbers(values: Sequence[int | float]) -> Any:
    """Values as an array: whole numbers stay whole."""
    counts = all(isinstance(value, int) and abs(value) < 2**53 for value in values)
    return np.array(values, np.int64 if counts else np.float64)


def numbers_of(data: dict[str, Any], prefix: str = "") -> dict[str, float]:
    """The numbers in nested data by dotted key, but for those that say how exact others are."""
    flat: dict[str, float] = {}
    for key, value in data.items():
        if not prefix and key in ASIDE:
            continue
        if isinstance(value, dict):
            flat |= numbers_of(value, f"{prefix}{key}.")
        elif type(value) in (int, float):
            flat[f"{prefix}{key}"] = value
    return flat
