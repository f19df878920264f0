"""Whole maps of many designs at once: objectives, and how far constraints are from their limits.

A map is all states of a design, as `sweep` computes it. Slopes by the ranges are central
differences, all in one batch: extremes of maps have no others where two states change places.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.design.dimensions import Design, unit_of
from dpgcli.records import dataclass
from dpgcli.search.columns import evaluation_of
from dpgcli.search.goal import Goal, Range
from dpgcli.states.columns import Column, Group, Kind
from dpgcli.sweeps.comparisons import keeps_unit, margins
from dpgcli.sweeps.evaluation import VALUE_OF, DesignStatus
from dpgcli.sweeps.expressions import Expression
from dpgcli.sweeps.metrics import METRICS

DIFFERENCE = 1e-4  # of a range, either way
COUNTS = frozenset(metric.name for metric in METRICS if metric.kind is Kind.COUNT)


class Maps(NamedTuple):
    """Objectives (objective, design), all to be least, and margins (margin, design), with slopes.

    Constraints hold where their margins are above zero. Slopes are (…, range, design), by the
    ranges' widths. Without such a finger, or without a stable state, all is NaN.
    """

    objectives: Array
    objective_slopes: Array
    margins: Array
    margin_slopes: Array


@dataclass(frozen=True)
class MapEvaluation:
    """Evaluates what a goal's constraints and objectives are about."""

    goal: Goal

    @cached_property
    def names(self) -> frozenset[str]:
        """Columns of designs that matter."""
        said = {name for rule in self.goal.constraints for name in rule.names}
        said |= {objective.name for objective in self.goal.objectives}
        return frozenset(metric.name for metric in METRICS if metric.name in said)

    @cached_property
    def smooth(self) -> tuple[Expression, ...]:
        """Margins of constraints that change with the ranges little by little, as counts do not."""
        found = (margin for rule in self.goal.constraints for margin in margins(rule))
        return tuple(margin for margin in found if not margin.names & COUNTS)

    @cached_property
    def sloped(self) -> frozenset[str]:
        """Columns that searches follow: those of margins that are smooth, and of objectives."""
        said = {name for margin in self.smooth for name in margin.names}
        return self.names & (said | {objective.name for objective in self.goal.objectives})

    def keys(self, values: Mapping[str, Array]) -> dict[str, Any]:
        """Values by key and by the last part of keys, those of the base among them."""
        known = {**self.goal.known, **values}
        return {**{key.rsplit(".", 1)[-1]: value for key, value in known.items()}, **known}

    def columns(
        self, values: Mapping[str, Array], names: Collection[str] | None = None
    ) -> dict[str, Array]:
        """Columns that matter, or those of these names, and values by key, (design,)."""
        wanted = self.names if names is None else names
        found = map_columns(self.goal.base, wanted, values) if wanted else {}
        return self.keys(values) | found

    def unit(self, margin: Expression) -> str:
        """The unit of a margin; none where its parts are of several, or no sum."""
        known = {metric.name: metric.unit for metric in METRICS}
        units = {known.get(name, unit_of(name)) for name in margin.names}
        return units.pop() if len(units) == 1 and keeps_unit(margin) else ""

    def margins(self, columns: Mapping[str, Array], n_designs: int) -> Array:
        """How far smooth constraints are from their limits, (margin, design)."""
        with np.errstate(invalid="ignore"):
            rows = [np.broadcast_to(np.asarray(m(columns), float), n_designs) for m in self.smooth]
        return np.array(rows).reshape(len(rows), n_designs)

    def hold(self, columns: Mapping[str, Array]) -> Flags:
        """Which constraints hold, (constraint, design)."""
        n_designs = max((np.size(column) for column in columns.values()), default=1)
        found = np.zeros((len(self.goal.constraints), n_designs), bool)
        for row, rule in zip(found, self.goal.constraints, strict=True):
            truth = np.broadcast_to(np.asarray(rule(columns), float), n_designs)
            is_known = np.ones(n_designs, bool)
            for name in rule.names & self.names:
                is_known &= ~np.isnan(columns[name])
            row[:] = is_known & np.isfinite(truth) & (truth != 0.0)
        return found

    def objectives(self, columns: Mapping[str, Array]) -> Array:
        """Objectives, all to be least, (objective, design)."""
        n_designs = max((np.size(column) for column in columns.values()), default=1)
        rows = [
            np.broadcast_to(columns[each.name] * (-1.0 if each.is_maximized else 1.0), n_designs)
            for each in self.goal.objectives
        ]
        return np.array(rows, float).reshape(len(rows), n_designs)

    def __call__(self, values: Mapping[str, Array]) -> Maps:
        """Objectives, margins and their slopes, of designs with these values by key."""
        k, n = len(self.goal.ranges), len(next(iter(values.values())))
        columns = self.columns(around(self.goal.ranges, values), self.sloped)
        rooms = self.margins(columns, (2 * k + 1) * n)
        return Maps(*_sloped(self.objectives(columns), k, n), *_sloped(rooms, k, n))


def around(ranges: Sequence[Range], values: Mapping[str, Array]) -> dict[str, Array]:
    """Values by key of designs, and behind them those a little less and more, range by range."""
    n, k = len(next(iter(values.values()))), len(ranges)
    stacked = {key: np.tile(column, 2 * k + 1) for key, column in values.items()}
    for place, each in enumerate(ranges):
        step = DIFFERENCE * each.width
        middle = np.clip(values[each.key], each.low + step, each.high - step)
        first = (2 * place + 1) * n
        stacked[each.key][first : first + n] = middle - step
        stacked[each.key][first + n : first + 2 * n] = middle + step
    return stacked


def _sloped(rows: Array, k: int, n: int) -> tuple[Array, Array]:
    """Values (row, design), and slopes (row, range, design), from values around designs."""
    beside = rows[:, n:].reshape(len(rows), k, 2, n)
    return rows[:, :n], (beside[:, :, 1] - beside[:, :, 0]) / (2.0 * DIFFERENCE)


def sloped_columns(
    goal: Goal, names: Sequence[str], values: Mapping[str, Array], *, with_slopes: bool = True
) -> tuple[Array, Array]:
    """Columns of designs with these values by key, and slopes by the ranges' widths.

    (name, design) and (name, range, design); counts have slopes of zero, as all have without.
    """
    k, n = len(goal.ranges), len(next(iter(values.values())))
    rows, slopes = np.full((len(names), n), np.nan), np.zeros((len(names), k, n))
    for is_smooth in (True, False):
        few = [name for name in names if (name not in COUNTS) == is_smooth]
        own = [names.index(name) for name in few]
        if few and is_smooth and with_slopes:
            found = map_columns(goal.base, few, around(goal.ranges, values))
            rows[own], slopes[own] = _sloped(np.array([found[name] for name in few]), k, n)
        elif few:
            found = map_columns(goal.base, few, values)
            rows[own] = [found[name] for name in few]
    return rows, slopes


def map_columns(
    base: Design, names: Collection[str], values: Mapping[str, Array]
) -> dict[str, Array]:
    """Columns of designs around a base with these values by key; NaN without a stable state.

    What takes its time and does not matter is left out.
    """
    used = [metric for metric in METRICS if metric.name in names]
    if not any(metric.needs_pressure for metric in used):
        base = replace(base, pressure=None)
    if not any(metric.group is Group.GRASP for metric in used):
        base = replace(base, body=None)
    columns = {key: Column(key, unit_of(key), f"{VALUE_OF}{key}") for key in values}
    evaluation = replace(evaluation_of(base, columns), only=frozenset(names))
    blocks = [tables.designs for tables in evaluation(0, values)]
    rows = {name: np.concatenate([block[name] for block in blocks]) for name in (*names, "status")}
    stable, partly, *_ = (status.encode() for status in DesignStatus)
    is_there = (rows["status"] == stable) | (rows["status"] == partly)
    return {name: np.where(is_there, rows[name], np.nan) for name in names}
