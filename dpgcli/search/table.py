"""Tables of a search: the designs found, and the steps of every descent."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dpgcli.arrays import Array, Columns
from dpgcli.design.dimensions import UNITS, unit_of
from dpgcli.search.goal import Goal, Target, suffix_of
from dpgcli.search.search import Designs
from dpgcli.states.columns import Column, Kind
from dpgcli.states.quantities import Quantity
from dpgcli.sweeps.evaluation import short_names

DESIGN = Column("design", "", "number, the best first", kind=Kind.COUNT)
MISFIT = Column("misfit", "", "root of the sum of squares of all misses, in tolerances")
MEETS = Column("meets_targets", "", "each target is missed by no more than its tolerance", kind=Kind.FLAG)
ACTIVE = Column(
    "active", "", "bounds beyond which the targets would be missed by less", kind=Kind.TEXT
)
PLACE = (
    Column("start", "", "number of the start", kind=Kind.COUNT),
    Column("step", "", "steps from there", kind=Kind.COUNT),
)


@dataclass(frozen=True)
class Reached:
    """What a design comes to, target by target: the state that is nearest, and its quantities."""

    patterns: tuple[str, ...]
    values: tuple[tuple[float, ...], ...]

    def misses(self, targets: Sequence[Target]) -> Array:
        """By how much each target is missed, in its quantity's unit."""
        pairs = zip(self.values, targets, strict=True)
        return np.array([np.hypot(*_apart(own, target)) for own, target in pairs])


def _apart(values: Sequence[float], target: Target) -> tuple[float, float]:
    first, *rest = (own - wanted for own, wanted in zip(values, target.values, strict=True))
    return first, rest[0] if rest else 0.0


@dataclass(frozen=True)
class GoalTables:
    """The columns and rows of a goal's tables."""

    goal: Goal
    quantities: dict[str, Quantity]

    @property
    def value_columns(self) -> tuple[Column, ...]:
        """A column for each key that varies."""
        names = short_names(self.goal.keys)
        return tuple(
            Column(
                names[key],
                unit_of(key),
                f"value of {key}",
                kind=Kind.COUNT if key == UNITS else Kind.NUMBER,
            )
            for key in self.goal.keys
        )

    @property
    def trace_columns(self) -> tuple[Column, ...]:
        """The columns of the trace."""
        return (*PLACE, *self.value_columns, MISFIT)

    def trace(self, rows: Columns) -> Columns:
        """A row for each step of each descent, start by start."""
        order = np.lexsort((rows["step"], rows["start"]))
        names = short_names(self.goal.keys)
        return {names.get(key, key): column[order] for key, column in rows.items()}

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of the designs found."""
        return (DESIGN, *self.value_columns, MISFIT, MEETS, *self._of_targets(), ACTIVE)

    def _of_targets(self) -> Iterator[Column]:
        for number, target in enumerate(self.goal.targets, start=1):
            head, quantities = f"target_{number}", [self.quantities[n] for n in target.columns]
            what = f"the state of {target.pattern} that is nearest"
            yield Column(f"{head}_pattern", "", what, kind=Kind.PATTERN)
            for quantity in quantities:
                yield replace(_plain(quantity), name=f"{head}_{quantity.name}")
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
        rows |= {short_names(goal.keys)[key]: values[key] for key in goal.keys}
        rows["misfit"] = np.sqrt(((misses / tolerances) ** 2).sum(axis=1))
        rows["meets_targets"] = (misses <= tolerances).all(axis=1)
        told = iter(self._of_targets())
        for place, target in enumerate(goal.targets):
            patterns = [each.patterns[place].encode() for each in reached]
            rows[next(told).name] = np.array(patterns, f"S{max(map(len, patterns), default=1)}")
            for part in range(len(target.values)):
                rows[next(told).name] = np.array([each.values[place][part] for each in reached])
            rows[next(told).name] = misses[:, place]
        texts = [", ".join(active_bounds(goal, designs, place)) for place in range(n)]
        rows["active"] = np.array(texts, np.str_)
        return rows


def _plain(quantity: Quantity) -> Column:
    return Column(quantity.name, quantity.unit, quantity.description, outputs=quantity.outputs)


def active_bounds(goal: Goal, designs: Designs, place: int) -> list[str]:
    """The bounds that hold a design back, in words."""
    names = short_names(goal.keys)
    return [
        f"{names[each.key]} {'<' if designs.points[k, place] > 0.5 else '>'}= "
        f"{each.high if designs.points[k, place] > 0.5 else each.low:g}"
        for k, each in enumerate(goal.ranges)
        if designs.held[k, place]
    ]
