"""Designs of a sweep, evaluated chunk by chunk: a pure function that any process can run."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Columns, Flags, Indices, distinct, keep_freed_memory
from dpgcli.design.dimensions import UNITS, Design, are_possible, unit_of
from dpgcli.design.outputs import Trust
from dpgcli.design.resolve import Resolution, resolve
from dpgcli.design.scene import ORIGINS, Scene
from dpgcli.records import dataclass
from dpgcli.states.accuracy import exactnesses
from dpgcli.states.columns import Column, Group, Kind
from dpgcli.states.quantities import Quantity, declared
from dpgcli.states.units import UnitSolutions
from dpgcli.sweeps.designs import design_states, joined_rows
from dpgcli.sweeps.expressions import Expression
from dpgcli.sweeps.metrics import METRICS
from dpgcli.sweeps.space import DesignValues, Space


class DesignStatus(StrEnum):
    """The status of a design."""

    STABLE = "stable"  # every pattern has its certified state
    PARTLY_STABLE = "partly_stable"  # some patterns have none
    INVALID = "invalid"  # no such finger can exist; `reason` says why
    EXCLUDED = "excluded"  # a constraint is not met
    FAILED = "failed"  # evaluating it killed its worker, twice


class Tables(NamedTuple):
    """Rows of states and of designs."""

    states: Columns
    designs: Columns


@dataclass(frozen=True)
class DesignEvaluation:
    """Evaluates designs around a base, given the values of its keys that change.

    `known` are the base's numbers by key, for constraints; `reason_against` says what is wrong with
    a design that has a value which its key cannot have, from its values. `values` are the columns
    of the keys that change, by key. With a `target_error` (mm) each design takes the cheapest level
    that is bounded by it. The metrics are all, or `only` those of these names and the counts of
    states.
    """

    base: Design
    known: Mapping[str, float]
    reason_against: Callable[[Mapping[str, float]], str]
    values: Mapping[str, Column]
    constraints: tuple[Expression, ...]
    tolerance: float
    target_error: float | None = None
    only: frozenset[str] | None = None

    @property
    def groups(self) -> frozenset[Group]:
        gripper = {Group.GRIPPER} if self.base.gripper else set()
        grasp = set() if self.base.body is None else {Group.GRASP}
        return frozenset({Group.STATES, Group.STIFFNESS, *gripper, *grasp})

    @property
    def state_columns(self) -> tuple[Column, ...]:
        """Columns of the table of states: the design, its values, what `predict` gives."""
        return (DESIGN, *self.values.values(), CALIBRATION, *self.quantities, *self._of_body)

    @property
    def _of_body(self) -> tuple[Column, ...]:
        """The columns of states about the body, none without one."""
        if self.base.body is None:
            return ()
        from dpgcli.grasping.release import turns
        from dpgcli.sweeps.grasps import grasp_columns

        has_friction, may_turn = (
            self.base.friction is not None,
            turns(self.base.body, self.base.held),
        )
        is_pair = bool(self.base.gripper)
        return grasp_columns(is_pair=is_pair, has_friction=has_friction, may_turn=may_turn)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The quantities of each state."""
        every = declared(1, (), bool(self.base.gripper))
        return tuple(quantity for quantity in every if quantity.group in self.groups)

    @property
    def design_columns(self) -> tuple[Column, ...]:
        """Columns of the table of designs."""
        has_pressure = self.base.pressure is not None
        of_body = {"", *(column.name for column in self._of_body)}
        every = (
            c
            for c in METRICS
            if c.group in self.groups and (c.group is not Group.GRASP or c.over in of_body)
        )
        there = (c for c in every if has_pressure or not c.needs_pressure)
        metrics = (c for c in there if self._told is None or c.name in self._told)
        chosen = () if self.target_error is None else LEVEL_COLUMNS
        return (DESIGN, *self.values.values(), CALIBRATION, STATUS, REASON, *metrics, *chosen)

    @property
    def _told(self) -> frozenset[str] | None:
        return None if self.only is None else self.only | COUNTS_OF_STATES

    def __call__(self, start: int, values: DesignValues) -> Iterator[Tables]:
        """Rows of designs numbered from `start` on, with these values by key.

        One design comes in blocks of its states, the row of the design with the last.
        """
        keep_freed_memory()
        n_designs = len(next(iter(values.values())))
        allowed = self.allowed(values)
        batches, origins, reasons = self._resolved(values, allowed)
        names = np.array([b"", *(origin.encode() for origin in ORIGINS)])
        described = {**self._described(start, values), "calibration": names[origins + 1]}
        waiting: list[_Solved] = []
        for part in (part for batch in batches for part in self._solved(*batch)):
            if part.metrics is None and n_designs == 1:
                yield Tables(self._state_rows(described, [part]), self._no_designs)
            else:
                waiting.append(part)
        yield Tables(
            self._state_rows(described, waiting),
            self._design_rows(described, waiting, allowed, reasons),
        )

    def _resolved(
        self, values: DesignValues, allowed: Flags
    ) -> "tuple[list[tuple[Indices, Scene]], Indices, dict[int, str]]":
        """Designs that share a batch, by their places, with what they describe.

        And by place the gravest origin among a design's values, in `ORIGINS`, −1 for those that are
        wrong, and what is wrong with them.
        """
        batches: list[tuple[Indices, Scene]] = []
        origins = np.full(len(allowed), -1)
        possible = allowed & self._are_possible(values)
        reasons = {
            place: self.reason_against({k: _said(k, v[place].item()) for k, v in values.items()})
            for place in np.flatnonzero(allowed & ~possible).tolist()
        }
        for places, design in by_units(self.base, values, np.flatnonzero(possible)):
            found = resolve(design)
            for index in np.flatnonzero(found.are_wrong).tolist():
                issues = found.problems.of(index)
                reasons[int(places[index])] = "; ".join(issue.statement for issue in issues)
            right = np.flatnonzero(~found.are_wrong)
            obstacle = reasons_against_bodies(found, right)
            reasons |= {int(places[index]): why for index, why in obstacle.items()}
            right = right[~np.isin(right, [*obstacle])]
            origins[places[right]] = found.gravest_origins[right]
            batches += [(places[alike], found.batch(alike)) for alike in found.alike(right)]
        return batches, origins, reasons

    def _are_possible(self, values: DesignValues) -> Flags:
        """Which designs have only values that their keys can have."""
        own = (key.removeprefix("gripper.") for key in values if key.startswith("gripper."))
        gripper = {*self.base.gripper, *own}
        is_placed = not gripper or "base_spacing_mm" in gripper
        possible = np.full(len(next(iter(values.values()))), is_placed)
        for key, column in values.items():
            possible &= are_possible(key.rsplit(".", 1)[-1], column)
        return possible

    def failed(self, design: int, values: DesignValues) -> Tables:
        """The rows of one design that cannot be evaluated at all."""
        described = {**self._described(design, values), "calibration": np.array([b""])}
        rows = self._design_rows(described, [], np.array([True]), {0: "its worker died, twice"})
        rows["status"] = np.array([DesignStatus.FAILED.encode()])
        return Tables(self._state_rows(described, []), rows)

    @property
    def _no_designs(self) -> Columns:
        return {c.name: np.zeros(0, _dtype(c.kind)) for c in self.design_columns}

    def _described(self, start: int, values: DesignValues) -> Columns:
        numbers = np.arange(start, start + len(next(iter(values.values()))))
        return {"design": numbers, **{self.values[key].name: v for key, v in values.items()}}

    def allowed(self, values: DesignValues) -> NDArray[np.bool_]:
        """Which designs meet all constraints; names may be dotted keys or their last part."""
        n_designs = len(next(iter(values.values())))
        known: dict[str, Any] = {**self.known, **values}
        short = {key.rsplit(".", 1)[-1]: value for key, value in known.items()}
        allowed = np.ones(n_designs, bool)
        for rule in self.constraints:
            met = np.asarray(rule({**short, **known}), float)
            allowed &= np.broadcast_to(np.isfinite(met) & (met != 0.0), n_designs)
        return allowed

    def exist(self, values: DesignValues) -> tuple[Flags, Flags]:
        """Which designs meet all constraints, and which of these can exist; nothing is solved."""
        allowed = self.allowed(values)
        right = allowed & self._are_possible(values)
        for places, design in by_units(self.base, values, np.flatnonzero(right)):
            found = resolve(design)
            possible = ~found.are_wrong
            possible[[*reasons_against_bodies(found, np.flatnonzero(possible))]] = False
            right[places] = possible
        return allowed, right

    def reason(self, values: DesignValues) -> str:
        """Why the first design that constraints allow cannot exist; empty where none is wrong."""
        first = np.flatnonzero(self.allowed(values))[:1]
        if not len(first):
            return ""
        one = {key: column[first] for key, column in values.items()}
        reasons = self._resolved(one, np.array([True]))[2]
        return reasons.get(0, "")

    def kinds_of_trust(self, values: DesignValues) -> Iterator[tuple[tuple[Trust, ...], int]]:
        """What outputs of designs that will be solved rest on, and how many of them."""
        right = self.allowed(values) & self._are_possible(values)
        for _, design in by_units(self.base, values, np.flatnonzero(right)):
            found = resolve(design)
            yield from found.kinds_of_trust(np.flatnonzero(~found.are_wrong))

    def _solved(self, places: Indices, scene: Scene) -> "Iterator[_Solved]":
        found = exactnesses(UnitSolutions.of(scene.finger), self.tolerance, self.target_error)
        for some, exactness in found:
            alike = scene if len(some) == len(places) else scene.take_lanes(some)
            for block in design_states(alike, exactness, self.quantities, self._told):
                if block.metrics is not None and exactness.accuracy_level is not None:
                    name = np.full(len(block.places), exactness.accuracy_level.name, "S24")
                    block.metrics["accuracy_level"] = name
                    block.metrics["error_bound_mm"] = exactness.error_bounds[block.places]
                yield _Solved(places[some][block.places], block.rows, block.metrics)

    def _state_rows(self, described: Columns, solved: "list[_Solved]") -> Columns:
        """Rows of all groups, brought back into the order of the designs."""
        if not solved:
            return {c.name: np.zeros(0, _dtype(c.kind)) for c in self.state_columns}
        repeats = [len(part.rows["pattern"]) // len(part.places) for part in solved]
        owner = np.concatenate(
            [np.repeat(part.places, n) for part, n in zip(solved, repeats, strict=True)]
        )
        order: slice | Indices = slice(None)
        if (owner[1:] < owner[:-1]).any():
            order = np.argsort(owner, kind="stable")
            owner = owner[order]
        rows = joined_rows([part.rows for part in solved])
        return {
            column.name: described[column.name][owner]
            if column.name in described
            else rows[column.name][order]
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
        stable, partly, invalid, excluded, _ = (status.encode() for status in DesignStatus)
        status = np.where(allowed, invalid, excluded).astype("S16")
        rows = dict(described)
        finished = [(p.places, p.metrics) for p in solved if p.metrics is not None]
        for column in self.design_columns[len(described) + 2 :]:
            found = [(places, metrics[column.name]) for places, metrics in finished]
            widest = np.result_type(_dtype(column.kind), *(part.dtype for _, part in found))
            values = np.full(n_designs, EMPTY.get(column.kind, np.nan), widest)
            for places, part in found:
                values[places] = part
            rows[column.name] = values
        for places, metrics in finished:
            complete = metrics["n_stable"] == metrics["n_states"]
            status[places] = np.where(complete, stable, partly)
        rows["status"] = status
        texts = [text.encode() for text in reasons.values()]
        reason = np.zeros(n_designs, f"S{max(map(len, texts), default=1)}")
        reason[list(reasons)] = texts
        rows["reason"] = reason
        return {column.name: rows[column.name] for column in self.design_columns}


def reasons_against_bodies(found: Resolution, designs: Indices) -> dict[int, str]:
    """Why fingers of some designs cannot meet their body, by design; nothing without a body."""
    if found.design.body is None or not len(designs):
        return {}
    from dpgcli.grasping.frames import begins_in_base

    reasons: dict[int, str] = {}
    for alike in found.alike(designs):
        scene = found.batch(alike)
        if scene.layer_thickness is None:
            reasons |= dict.fromkeys(alike.tolist(), NO_FACE)
            continue
        assert scene.body is not None, "the design has one"
        begin = begins_in_base(scene, scene.body)
        reasons |= dict.fromkeys(alike[begin].tolist(), IN_BASE)
    return reasons


def by_units(
    base: Design, values: DesignValues, places: Indices
) -> Iterator[tuple[Indices, Design]]:
    """The designs around a base at some places of these values, by their number of units."""
    columns = {key: column[places] for key, column in values.items()}
    units = columns.pop(UNITS, np.full(len(places), base.units))
    for n_units in distinct(units).tolist():
        here = np.flatnonzero(units == n_units)
        own = {key: column[here] for key, column in columns.items()}
        alike = replace(base, units=int(n_units), n_designs=len(here))
        yield places[here], alike.with_values(own)


NO_FACE = (
    "finger.geometry.limiting_layer_thickness_mm: expected a thickness where there is a body: the "
    "face of a finger is half of it inside the lattice"
)
IN_BASE = "object: begins in the base of a finger: move it along x, or take a smaller one"

COUNTS_OF_STATES = frozenset({"n_states", "n_stable"})  # by which a design has its status
DESIGN = Column("design", "", "number in the order of the space", kind=Kind.COUNT)
CALIBRATION = Column("calibration", "", "gravest origin of a spring constant", kind=Kind.TEXT)
STATUS = Column("status", "", "what became of the design", kind=Kind.TEXT)
LEVEL_COLUMNS = (
    Column("accuracy_level", "", "chosen for the target error", kind=Kind.TEXT),
    Column("error_bound_mm", "mm", "bound on the tips' error before the work"),
)
VALUE_OF = "value of "  # begins the description of a column of values, its key behind it
EMPTY = {Kind.COUNT: 0, Kind.TEXT: b""}
REASON = Column("reason", "", "why the design is invalid", kind=Kind.TEXT)


class _Solved(NamedTuple):
    """Designs at some places of a chunk: rows of their states, and, with the last, metrics."""

    places: Indices
    rows: Columns
    metrics: Columns | None


def value_columns(space: Space) -> dict[str, Column]:
    """A column for each key of a space: named by its last part where that is enough.

    What some units override keeps its whole key: the last part is that of the others too.
    """
    first = space.designs(0, 1)
    whole = {key for key in space.keys if first[key].dtype.kind in "iu"}
    return {
        key: Column(
            name,
            unit_of(key),
            f"{VALUE_OF}{key}",
            kind=Kind.COUNT if key in whole else Kind.NUMBER,
        )
        for key, name in short_names(space.keys).items()
    }


def short_names(keys: Sequence[str]) -> dict[str, str]:
    """Names of columns for keys: the last part where that is enough.

    >>> [*short_names(["finger.units", "finger.overrides.4.lattice.stroke_mm"]).values()]
    ['units', 'finger.overrides.4.lattice.stroke_mm']
    """
    last = [key.rsplit(".", 1)[-1] for key in keys]
    return {
        key: short if last.count(short) == 1 and ".overrides." not in key else key
        for key, short in zip(keys, last, strict=True)
    }


def _said(key: str, value: float) -> float:
    """A value as a spec has it: numbers of units are whole, in a list with fractions, too."""
    return int(value) if key == UNITS and float(value).is_integer() else value


def _dtype(kind: Kind) -> str:
    types = {
        Kind.PATTERN: "S1",
        Kind.STATUS: "u1",
        Kind.TEXT: "S24",
        Kind.COUNT: "i8",
        Kind.FLAG: "?",
    }
    return types.get(kind, "f8")
