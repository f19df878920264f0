"""Targets of many designs at once: how far each is missed, and how that changes with the keys."""

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from dpgcli.arrays import Array, Codes, Columns, distinct
from dpgcli.design.dimensions import UNITS, Design
from dpgcli.design.resolve import resolve
from dpgcli.errors import NothingSelectedError
from dpgcli.mechanics.terms import chain_potential
from dpgcli.records import dataclass
from dpgcli.search.columns import (
    STEPWISE,
    body_columns,
    design_columns,
    pressed_columns,
    state_columns,
)
from dpgcli.search.descent import Residuals
from dpgcli.search.goal import Goal, Target
from dpgcli.search.maps import DIFFERENCE, around, sloped_columns
from dpgcli.search.slopes import EXACT, StateSlopes, key_steps
from dpgcli.search.states import columns_of_states
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.columns import Column
from dpgcli.states.patterns import inverted_units, select
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions
from dpgcli.sweeps.designs import groups_of, units_of
from dpgcli.sweeps.evaluation import by_units, reasons_against_bodies

STATES_AT_ONCE = 2**15


@dataclass(frozen=True)
class TargetEvaluation:
    """Evaluates the targets of a goal: a target is met by the state of its pattern that is nearest.

    Where there is no such finger, or none of these states is certified, it is NaN.
    """

    goal: Goal

    @cached_property
    def columns(self) -> dict[str, Column]:
        """The columns that the targets are about, by name: of states and of designs."""
        longest = int(max(self.goal.lists.get(UNITS, (self.goal.base.units,))))
        every = {**design_columns(self.goal.base), **state_columns(self.goal.base, longest)}
        return {name: every[name] for target in self.goal.targets for name in target.columns}

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Those of states."""
        return tuple(dict.fromkeys(c for target in self.goal.of_states for c in target.columns))

    @cached_property
    def of_designs(self) -> tuple[str, ...]:
        """Those of designs."""
        return tuple(name for name in self.columns if name not in self.names)

    @cached_property
    def stepwise(self) -> tuple[str, ...]:
        """Those that change at once, by one or from no to yes: they have no slopes."""
        return tuple(name for name, c in self.columns.items() if c.kind in STEPWISE)

    @cached_property
    def by_differences(self) -> tuple[str, ...]:
        """Those that have slopes, and none that are exact."""
        return tuple(n for n in self.columns if n not in EXACT and n not in self.stepwise)

    @cached_property
    def most_states(self) -> int:
        """States of a design that may be nearest, at most."""
        every = self.goal.lists.get(UNITS, (self.goal.base.units,))
        found = (sum(len(_matching(t, int(n))) for t in self.goal.of_states) for n in every)
        return max(1, *found)

    def __call__(
        self, values: Mapping[str, Array], *, with_slopes: bool = True
    ) -> tuple[Residuals, Codes]:
        """Residuals over tolerances and slopes by the ranges' widths; the states, (target, design).

        `values` are by key. Without slopes these are NaN.
        """
        goal, n = self.goal, len(next(iter(values.values())))
        residuals = np.full((goal.n_parts, n), np.nan)
        slopes = np.full((goal.n_parts, len(goal.ranges), n), np.nan)
        codes = np.zeros((len(goal.targets), n), np.uint64)
        if goal.of_states:
            own = np.array([k for k, target in enumerate(goal.targets) if target.pattern])
            rows = np.concatenate([np.arange(goal.n_parts)[goal.parts[k]] for k in own])
            found = self._of_states(values, with_slopes=with_slopes)
            residuals[rows], slopes[rows], codes[own] = found
        if self.of_designs:
            self._add_designs(values, residuals, slopes, with_slopes=with_slopes)
        return Residuals(residuals, slopes), codes

    def _of_states(
        self, values: Mapping[str, Array], *, with_slopes: bool
    ) -> tuple[Array, Array, Codes]:
        """Residuals (part, design), slopes (part, range, design) and states (target, design)."""
        goal, n = self.goal, len(next(iter(values.values())))
        targets = goal.of_states
        residuals = np.full((sum(len(target.values) for target in targets), n), np.nan)
        slopes = np.full((len(residuals), len(goal.ranges), n), np.nan)
        codes = np.zeros((len(targets), n), np.uint64)
        for places in groups_of(np.arange(n), STATES_AT_ONCE // self.most_states):
            for some, design in by_units(goal.base, values, places):
                batch = _Batch(self, design, {key: column[some] for key, column in values.items()})
                residuals[:, some], codes[:, some] = batch.nearest()
                if with_slopes:
                    slopes[..., some] = batch.slopes(codes[:, some])
        return residuals, slopes, codes

    def _add_designs(
        self, values: Mapping[str, Array], residuals: Array, slopes: Array, *, with_slopes: bool
    ) -> None:
        """Put in the rows of targets that are about designs."""
        found, ways = sloped_columns(self.goal, self.of_designs, values, with_slopes=with_slopes)
        for part, target in zip(self.goal.parts, self.goal.targets, strict=True):
            if not target.pattern:
                place = self.of_designs.index(target.quantity)
                residuals[part] = (found[place] - target.values[0]) / target.tolerance
                slopes[part] = ways[place] / target.tolerance


@dataclass(frozen=True)
class _Batch:
    """Designs of one number of units, with their values by key, and the targets about states."""

    evaluation: TargetEvaluation
    design: Design
    values: Mapping[str, Array]

    @property
    def targets(self) -> tuple[Target, ...]:
        return self.evaluation.goal.of_states

    @property
    def n_designs(self) -> int:
        return self.design.n_designs

    def nearest(self) -> tuple[Array, Codes]:
        """Residuals (part, design), and the nearest state for each target, (target, design)."""
        parts, codes = [], []
        known = self._known()
        for target in self.targets:
            own = _matching(target, self.design.units)
            if not len(own):
                parts.append(np.full((len(target.values), self.n_designs), np.nan))
                codes.append(np.zeros(self.n_designs, np.uint64))
                continue
            every, found = known[self._kind(target)]
            misses = _misses(target, found)[:, np.searchsorted(every, own)]
            squares = (misses**2).sum(axis=0)
            place = np.where(np.isnan(squares), np.inf, squares).argmin(axis=0)
            parts.append(np.take_along_axis(misses, place[None, None], axis=1)[:, 0])
            codes.append(own[place])
        return np.concatenate(parts), np.stack(codes)

    def _kind(self, target: Target) -> str:
        """Which columns of states take the same work."""
        base = self.evaluation.goal.base
        of_body, pressed = body_columns(base), pressed_columns(base)
        name = target.quantity
        return "body" if name in of_body else "pressure" if name in pressed else "free"

    def _known(self) -> dict[str, tuple[Codes, Columns]]:
        """States that targets of a kind match, and their columns (state, design), by kind."""
        found = {}
        for kind in dict.fromkeys(map(self._kind, self.targets)):
            own = [target for target in self.targets if self._kind(target) == kind]
            codes = [_matching(target, self.design.units) for target in own]
            every = distinct(np.concatenate(codes))
            names = {name for target in own for name in target.columns}
            each = np.repeat(every[:, None], self.n_designs, axis=1)
            found[kind] = every, columns_of_states(self.design, each, names)
        return found

    def slopes(self, codes: Codes) -> Array:
        """Slopes of residuals by the ranges' widths, (part, range, design), of these states."""
        ranges = self.evaluation.goal.ranges
        every = self._exact(codes) | self._differences(codes)
        nothing = np.zeros((len(ranges), *codes.shape))  # slopes of what changes at once
        rows = [
            every.get(name, nothing)[:, place] / target.tolerance
            for place, target in enumerate(self.targets)
            for name in target.columns
        ]
        return np.stack(rows)

    def _exact(self, codes: Codes) -> dict[str, Array]:
        """Slopes by the ranges' widths, (range, target, design), by column, as far as exact."""
        names = [name for name in self.evaluation.names if name in EXACT]
        keys = [each.key for each in self.evaluation.goal.ranges]
        widths = np.array([each.width for each in self.evaluation.goal.ranges])[:, None, None]
        slopes = {name: np.full((len(keys), *codes.shape), np.nan) for name in names}
        found = resolve(self.design)
        for some in found.alike(np.flatnonzero(~found.are_wrong)) if names and keys else ():
            lanes = np.repeat(np.arange(len(some)), len(codes))
            scene = found.batch(some)
            units = units_of(UnitSolutions.of(scene.finger), lanes)
            inverted = inverted_units(codes[:, some].T.ravel(), self.design.units)
            settled = settle(units, chain_potential, inverted, DEFAULT_TOLERANCE)
            steps = key_steps(self.design, self.values, keys, some[lanes])
            known = StateSlopes(settled, scene.take_lanes(lanes), steps).of(names)
            for name, values in known.items():
                shape = (len(keys), len(some), len(codes))
                slopes[name][..., some] = values.reshape(shape).transpose(0, 2, 1) * widths
        return slopes

    def _differences(self, codes: Codes) -> dict[str, Array]:
        """The same of all others, by central differences within the ranges."""
        ranges, n = self.evaluation.goal.ranges, self.n_designs
        names = [n for n in self.evaluation.by_differences if n in self.evaluation.names]
        slopes = {name: np.full((len(ranges), *codes.shape), np.nan) for name in names}
        if not names or not ranges:
            return slopes
        columns = {key: column[n:] for key, column in around(ranges, self.values).items()}
        (_, moved), *_ = by_units(
            self.evaluation.goal.base, columns, np.arange(2 * len(ranges) * n)
        )
        for kind in dict.fromkeys(map(self._kind, self.targets)):
            own = [k for k, target in enumerate(self.targets) if self._kind(target) == kind]
            told = {name for k in own for name in self.targets[k].columns} & {*names}
            few = np.tile(codes[own], (1, 2 * len(ranges)))
            found = columns_of_states(moved, few, told) if told else {}
            for name, rows in found.items():
                down, up = rows.reshape(len(own), len(ranges), 2, n).transpose(2, 1, 0, 3)
                slopes[name][:, own] = (up - down) / (2.0 * DIFFERENCE)
        return slopes


def reason_against(goal: Goal) -> str:
    """What is wrong with the design in the middle of all ranges; empty where it can exist."""
    choice = {key: np.array([value]) for key, value in next(goal.choices()).items()}
    values = goal.values(choice, np.full((len(goal.ranges), 1), 0.5))
    ((_, design),) = by_units(goal.base, values, np.zeros(1, np.int64))
    found = resolve(design)
    issues = "; ".join(issue.statement for issue in found.problems.of(0))
    return issues or reasons_against_bodies(found, np.zeros(1, np.int64)).get(0, "")


def _matching(target: Target, n_units: int) -> Codes:
    """Codes of the states of so many units that match a target's pattern."""
    try:
        found = select((target.pattern,), n_units)
    except NothingSelectedError:
        return np.zeros(0, np.uint64)
    return found.codes(0, len(found))


def _misses(target: Target, found: Columns) -> Array:
    """By how many tolerances states miss a target, (part, state, design)."""
    pairs = zip(target.columns, target.values, strict=True)
    return np.stack([(found[name] - value) / target.tolerance for name, value in pairs])
