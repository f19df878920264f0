"""Designs of a sweep, evaluated chunk by chunk: a pure function that any process can run."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import keep_freed_memory
from dpgcli.design.scene import Origin, Scene
from dpgcli.errors import Problem, SpecError
from dpgcli.files.scene_file import variant
from dpgcli.files.sections import unit_of
from dpgcli.files.sweep_file.space import UNITS, flattened
from dpgcli.mechanics.chain import Chain
from dpgcli.states.columns import Column, Group, Kind, declared
from dpgcli.states.rows import Columns
from dpgcli.sweeps.designs import choices, design_states
from dpgcli.sweeps.expressions import Expression
from dpgcli.sweeps.metrics import DESIGN_COLUMNS
from dpgcli.sweeps.space import Space

Numbers = NDArray[Any]

GRAVEST_FIRST = (
    Origin.EXTRAPOLATED,
    Origin.SCALED,
    Origin.INTERPOLATED,
    Origin.CALIBRATED,
    Origin.GIVEN,
)


class DesignStatus(StrEnum):
    """What became of a design."""

    STABLE = "stable"
    PARTLY_STABLE = "partly_stable"
    INVALID = "invalid"
    EXCLUDED = "excluded"
    FAILED = "failed"


DESIGN_STATUS_MEANINGS = {
    DesignStatus.STABLE: "every pattern has its certified state",
    DesignStatus.PARTLY_STABLE: "some patterns have none",
    DesignStatus.INVALID: "no such finger can exist; `reason` says why",
    DesignStatus.EXCLUDED: "a constraint is not met",
    DesignStatus.FAILED: "evaluating it killed its worker, twice",
}


class Tables(NamedTuple):
    """Rows of states and of designs."""

    states: Columns
    designs: Columns


@dataclass(frozen=True)
class Evaluation:
    """Evaluates designs around a base spec, given the values of its keys that change.

    `values` are the columns of those keys, by key. With a `target_error` (mm) each design takes
    the cheapest rung that is bounded by it.
    """

    base_data: Mapping[str, Any]
    values: Mapping[str, Column]
    constraints: tuple[Expression, ...]
    tolerance: float
    is_gripper: bool
    target_error: float | None = None

    @property
    def groups(self) -> frozenset[Group]:
        gripper = {Group.GRIPPER} if self.is_gripper else set()
        return frozenset({Group.STATES, Group.STIFFNESS, *gripper})

    @property
    def state_columns(self) -> tuple[Column, ...]:
        """Columns of the table of states: the design, its values, what `predict` gives."""
        rows = (c for c in declared(1, (), self.is_gripper) if c.group in self.groups)
        return (DESIGN, *self.values.values(), CALIBRATION, *rows)

    @property
    def design_columns(self) -> tuple[Column, ...]:
        """Columns of the table of designs."""
        metrics = (c for c in DESIGN_COLUMNS if c.group in self.groups)
        rung = () if self.target_error is None else RUNG_COLUMNS
        return (DESIGN, *self.values.values(), CALIBRATION, STATUS, REASON, *metrics, *rung)

    def __call__(self, start: int, values: Mapping[str, Numbers]) -> Iterator[Tables]:
        """Rows of designs numbered from `start` on, with these values by key.

        One design comes in blocks of its states, the row of the design with the last.
        """
        keep_freed_memory()
        n_designs = len(next(iter(values.values())))
        scenes: dict[int, Scene] = {}
        reasons: dict[int, str] = {}
        allowed = self.allowed(values)
        for place in np.flatnonzero(allowed).tolist():
            changes = {key: _said(key, column[place].item()) for key, column in values.items()}
            try:
                scenes[place] = variant(self.base_data, changes)
            except SpecError as error:
                reasons[place] = "; ".join(map(_reason, error.problems))
        described = {
            **self._described(start, values),
            "calibration": np.array([_calibration(scenes.get(p)) for p in range(n_designs)], "S"),
        }
        solved = (part for places in _alike(scenes) for part in self._solved(places, scenes))
        waiting: list[_Solved] = []
        for part in solved:
            if part.metrics is None and n_designs == 1:
                yield Tables(self._state_rows(described, [part]), self._no_designs)
            else:
                waiting.append(part)
        yield Tables(
            self._state_rows(described, waiting),
            self._design_rows(described, waiting, allowed, reasons),
        )

    def failed(self, design: int, values: Mapping[str, Numbers]) -> Tables:
        """The rows of one design that cannot be evaluated at all."""
        described = {**self._described(design, values), "calibration": np.array([b""])}
        rows = self._design_rows(described, [], np.array([True]), {0: "its worker died, twice"})
        rows["status"] = np.array([DesignStatus.FAILED.value])
        return Tables(self._state_rows(described, []), rows)

    @property
    def _no_designs(self) -> Columns:
        return {c.name: np.zeros(0, _dtype(c.kind)) for c in self.design_columns}

    def _described(self, start: int, values: Mapping[str, Numbers]) -> Columns:
        numbers = np.arange(start, start + len(next(iter(values.values()))))
        return {"design": numbers, **{self.values[key].name: v for key, v in values.items()}}

    def allowed(self, values: Mapping[str, Numbers]) -> NDArray[np.bool_]:
        """Which designs meet all constraints; names may be dotted keys or their last part."""
        n_designs = len(next(iter(values.values())))
        known: dict[str, Any] = flattened(dict(self.base_data)) | dict(values)
        short = {key.rsplit(".", 1)[-1]: value for key, value in known.items()}
        allowed = np.ones(n_designs, bool)
        for rule in self.constraints:
            met = np.asarray(rule({**short, **known}), float)
            allowed &= np.broadcast_to(np.isfinite(met) & (met != 0.0), n_designs)
        return allowed

    def _solved(self, places: list[int], scenes: Mapping[int, Scene]) -> "Iterator[_Solved]":
        group = [scenes[place] for place in places]
        if self.target_error is None:
            for block in design_states(group, Chain, self.tolerance, self.groups):
                yield _Solved(np.array(places)[block.places], block.rows, block.metrics)
            return
        for choice in choices(group, self.target_error):
            rung = choice.rung
            chosen = [group[place] for place in choice.places]
            for block in design_states(
                chosen, Chain, rung.tolerance, self.groups, drops_bars=rung.drops_bars
            ):
                if block.metrics is not None:
                    block.metrics["rung"] = np.full(len(block.places), rung.name)
                    block.metrics["error_bound_mm"] = choice.bounds[block.places]
                here = np.array(places)[choice.places][block.places]
                yield _Solved(here, block.rows, block.metrics)

    def _state_rows(self, described: Columns, solved: "list[_Solved]") -> Columns:
        """Rows of all groups, brought back into the order of the designs."""
        if not solved:
            return {c.name: np.zeros(0, _dtype(c.kind)) for c in self.state_columns}
        repeats = [len(part.rows["pattern"]) // len(part.places) for part in solved]
        owner = np.concatenate(
            [np.repeat(part.places, n) for part, n in zip(solved, repeats, strict=True)]
        )
        order = np.argsort(owner, kind="stable")
        owner = owner[order]
        return {
            column.name: described[column.name][owner]
            if column.name in described
            else np.concatenate([part.rows[column.name] for part in solved])[order]
            for column in self.state_columns
        }

    def _design_rows(
        self,
        described: Columns,
        solved: "list[_Solved]",
        allowed: NDArray[np.bool_],
        reasons: Mapping[int, str],
    ) -> Columns:
        n_designs = len(described["design"])
        status = np.where(allowed, DesignStatus.INVALID, DesignStatus.EXCLUDED).astype("U16")
        rows = dict(described)
        finished = [(p.places, p.metrics) for p in solved if p.metrics is not None]
        for column in self.design_columns[len(described) + 2 :]:
            values = np.full(n_designs, EMPTY.get(column.kind, np.nan), _dtype(column.kind))
            for places, metrics in finished:
                values[places] = metrics[column.name]
            rows[column.name] = values
        for places, metrics in finished:
            complete = metrics["n_stable"] == metrics["n_states"]
            status[places] = np.where(complete, DesignStatus.STABLE, DesignStatus.PARTLY_STABLE)
        rows["status"] = status
        rows["reason"] = np.array([reasons.get(place, "") for place in range(n_designs)])
        return {column.name: rows[column.name] for column in self.design_columns}


DESIGN = Column("design", "", "number in the order of the space", Group.STATES, Kind.COUNT)
CALIBRATION = Column(
    "calibration", "", "gravest origin of a spring constant", Group.STATES, Kind.TEXT
)
STATUS = Column("status", "", "what became of the design", Group.STATES, Kind.TEXT)
RUNG_COLUMNS = (
    Column("rung", "", "way chosen for the target error", Group.STATES, Kind.TEXT),
    Column("error_bound_mm", "mm", "bound on the tips' error before the work", Group.STATES),
)
EMPTY = {Kind.COUNT: 0, Kind.TEXT: ""}
REASON = Column("reason", "", "why the design is invalid", Group.STATES, Kind.TEXT)


class _Solved(NamedTuple):
    """Designs at some places of a chunk: rows of their states, and, with the last, metrics."""

    places: Numbers
    rows: Columns
    metrics: Columns | None


def value_columns(space: Space) -> dict[str, Column]:
    """A column for each key of a space: named by its last part where that is enough.

    What some units override keeps its whole key: the last part is that of the others too.
    """
    last = [key.rsplit(".", 1)[-1] for key in space.keys]
    first = space.designs(0, 1)
    return {
        key: Column(
            short if last.count(short) == 1 and ".overrides." not in key else key,
            unit_of(key),
            f"value of {key}",
            Group.STATES,
            Kind.COUNT if first[key].dtype.kind in "iu" else Kind.NUMBER,
        )
        for key, short in zip(space.keys, last, strict=True)
    }


def _alike(scenes: Mapping[int, Scene]) -> list[list[int]]:
    """Places of scenes that can share a batch."""
    groups: dict[tuple[int, bool], list[int]] = {}
    for place, scene in scenes.items():
        kind = (scene.finger.n_units, scene.finger.is_rigid)
        groups.setdefault(kind, []).append(place)
    return list(groups.values())


def _calibration(scene: Scene | None) -> str:
    if scene is None:
        return ""
    origins = {source.origin for source in scene.sources}
    return next(str(origin) for origin in GRAVEST_FIRST if origin in origins)


def _said(key: str, value: float) -> float:
    """A value as a spec has it: numbers of units are whole, in a list with fractions, too."""
    return int(value) if key == UNITS and float(value).is_integer() else value


def _reason(problem: Problem) -> str:
    hint = f" ({problem.hint})" if problem.hint else ""
    return f"{problem.key}: expected {problem.expected}, found {problem.found}{hint}"


def _dtype(kind: Kind) -> str:
    types = {
        Kind.PATTERN: "S1",
        Kind.STATUS: "u1",
        Kind.TEXT: "U24",
        Kind.COUNT: "i8",
        Kind.FLAG: "?",
    }
    return types.get(kind, "f8")
