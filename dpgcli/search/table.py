"""Tables of a search: the designs found, and the steps of every search."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np

from dpgcli.arrays import Array, Columns
from dpgcli.design.dimensions import UNITS, unit_of
from dpgcli.records import dataclass
from dpgcli.search.columns import plain, renamed
from dpgcli.search.designs import Designs
from dpgcli.search.goal import Goal, Target, suffix_of
from dpgcli.search.maps import MapEvaluation
from dpgcli.search.targets import TargetEvaluation
from dpgcli.search.unmet import Standing
from dpgcli.states.columns import Column, Kind
from dpgcli.sweeps.evaluation import VALUE_OF, short_names
from dpgcli.sweeps.metrics import METRICS

DESIGN = Column("design", "", "number, the best first", kind=Kind.COUNT)
MISFIT = Column("misfit", "", "root of the sum of squares of all misses, in tolerances")
MEETS = Column(
    "meets_all", "", "each target is met within its tolerance, constraints hold", kind=Kind.FLAG
)
ACTIVE = Column("active", "", "bounds and constraints that hold it back", kind=Kind.TEXT)
FINISHED = Column(
    "finished", "", "whether its search ended by itself; no: a limit ended it", kind=Kind.FLAG
)
DTYPES: Mapping[Kind, type] = {Kind.COUNT: np.int64, Kind.FLAG: np.bool_}
PLACE = (
    Column("search", "", "number of the search", kind=Kind.COUNT),
    Column("step", "", "its steps so far", kind=Kind.COUNT),
)


@dataclass(frozen=True)
class Reached:
    """What a design comes to: for each target the nearest state and its quantities; columns.

    Targets about designs have no state. Those in `overlapping` are the states of targets in which
    the fingers of a gripper overlap.
    """

    patterns: tuple[str, ...]
    values: tuple[tuple[float, ...], ...]
    columns: Mapping[str, float]
    overlapping: tuple[str, ...] = ()

    def misses(self, targets: Sequence[Target]) -> Array:
        """By how much each target is missed, in its quantity's unit."""
        pairs = zip(self.values, targets, strict=True)
        apart = [np.subtract(own, target.values) for own, target in pairs]
        return np.array([float(np.linalg.norm(each)) for each in apart])


@dataclass(frozen=True)
class GoalTables:
    """The columns and rows of a goal's tables.

    `has_unfinished` where a limit ended the search of one of the designs.
    """

    goal: Goal
    has_unfinished: bool = False

    @cached_property
    def quantities(self) -> Mapping[str, Column]:
        """The columns that targets are about, by name."""
        return TargetEvaluation(self.goal).columns

    @property
    def units(self) -> tuple[str, ...]:
        """The unit of each target's quantity."""
        return tuple(self.quantities[each.columns[0]].unit for each in self.goal.targets)

    @property
    def value_columns(self) -> tuple[Column, ...]:
        """A column for each key that varies."""
        return tuple(
            Column(
                name,
                unit_of(key),
                f"{VALUE_OF}{key}",
                kind=Kind.COUNT if key == UNITS else Kind.NUMBER,
            )
            for key, name in short_names(self.goal.keys).items()
        )

    @property
    def map_columns(self) -> tuple[Column, ...]:
        """The columns of designs that constraints and objectives are about."""
        names = MapEvaluation(self.goal).names
        return tuple(plain(metric) for metric in METRICS if metric.name in names)

    @property
    def trace_columns(self) -> tuple[Column, ...]:
        """The columns of the trace."""
        own = {column.name: column for column in (*self.map_columns, *self.value_columns)}
        objectives = (
            own.get(each.name, Column(each.name, unit_of(each.name), f"{VALUE_OF}{each.name}"))
            for each in self.goal.objectives
        )
        told = (*PLACE, *self.value_columns, MISFIT, *objectives)
        return tuple({column.name: column for column in told}.values())

    def trace(self, rows: Columns) -> Columns:
        """A row for each step of each search, search by search."""
        order = np.lexsort((rows["step"], rows["search"]))
        names = short_names(self.goal.keys)
        return {names.get(key, key): column[order] for key, column in rows.items()}

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of the designs found."""
        misfit = (MISFIT,) if self.goal.targets else ()
        own = (DESIGN, *self.value_columns, *self.map_columns, *misfit, MEETS)
        return (*own, *self._of_targets(), ACTIVE, *((FINISHED,) if self.has_unfinished else ()))

    def _of_targets(self) -> Iterator[Column]:
        for number, target in enumerate(self.goal.targets, start=1):
            head, quantities = f"target_{number}", [self.quantities[n] for n in target.columns]
            if target.pattern:
                what = f"the state of {target.pattern} that is nearest"
                yield Column(f"{head}_pattern", "", what, kind=Kind.PATTERN)
            for quantity in quantities:
                yield renamed(quantity, f"{head}_{quantity.name}")
            unit, outputs = quantities[0].unit, quantities[0].outputs
            missed = f"{head}_miss{suffix_of(unit)}"
            yield Column(missed, unit, "by how much it is missed", outputs=outputs)

    def rows(self, designs: Designs, reached: Sequence[Reached]) -> Columns:
        """A row for each design, with what was found for it."""
        goal, n = self.goal, len(designs)
        values = goal.values(designs.choice, designs.points)
        tolerances = np.array([target.tolerance for target in goal.targets])
        misses = np.array([each.misses(goal.targets) for each in reached]).reshape(n, -1)
        rows: Columns = {"design": np.arange(1, n + 1)}
        rows |= {name: values[key] for key, name in short_names(goal.keys).items()}
        for column in self.map_columns:
            kind = DTYPES.get(column.kind, np.float64)
            rows[column.name] = np.array([each.columns[column.name] for each in reached], kind)
        rows["misfit"] = np.sqrt(((misses / tolerances) ** 2).sum(axis=1))
        is_met = (misses <= tolerances).all(axis=1)
        rows["meets_all"] = np.asarray(is_met & designs.hold.all(axis=0))
        told = iter(self._of_targets())
        for place, target in enumerate(goal.targets):
            if target.pattern:
                patterns = [each.patterns[place].encode() for each in reached]
                rows[next(told).name] = np.array(patterns, f"S{max(map(len, patterns), default=1)}")
            for part in range(len(target.values)):
                column = next(told)
                told_of = [each.values[place][part] for each in reached]
                rows[column.name] = np.array(told_of, DTYPES.get(column.kind, np.float64))
            rows[next(told).name] = misses[:, place]
        standings = [self.standing(designs, place) for place in range(n)]
        rows["active"] = np.array([each.active for each in standings], np.str_)
        return rows | ({"finished": designs.are_finished} if self.has_unfinished else {})

    def standing(self, designs: Designs, place: int) -> Standing:
        """How one of the designs stands."""
        return Standing(self.goal, designs.take(np.array([place])), self.units)
