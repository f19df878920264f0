"""Targets of many designs at once: how far each is missed, and how that changes with the keys."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dpgcli.arrays import Array, Codes, Columns, distinct
from dpgcli.design.dimensions import UNITS, Design
from dpgcli.design.resolve import resolve
from dpgcli.errors import NothingSelectedError
from dpgcli.mechanics.terms import chain_potential
from dpgcli.search.descent import Residuals
from dpgcli.search.goal import KINDS, Goal, Target
from dpgcli.search.slopes import EXACT, StateSlopes, key_steps
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Status
from dpgcli.states.patterns import inverted_units, select
from dpgcli.states.quantities import Quantity, declared
from dpgcli.states.rows import RowRequest, solved_rows
from dpgcli.states.settle import settle
from dpgcli.states.solved import Surroundings
from dpgcli.states.units import UnitSolutions
from dpgcli.sweeps.designs import groups_of, placement, units_of
from dpgcli.sweeps.evaluation import by_units

DIFFERENCE = 1e-4  # of a range, either way
STATES_AT_ONCE = 2**15


@dataclass(frozen=True)
class TargetEvaluation:
    """Evaluates the targets of a goal: a target is met by the state of its pattern that is nearest.

    Where there is no such finger, or none of these states is certified, it is NaN.
    """

    goal: Goal

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The columns that the targets are about."""
        return tuple(dict.fromkeys(c for target in self.goal.targets for c in target.columns))

    @cached_property
    def by_differences(self) -> tuple[str, ...]:
        """Those that have no exact slope."""
        return tuple(name for name in self.names if name not in EXACT)

    @cached_property
    def most_states(self) -> int:
        """States of a design that may be nearest, at most."""
        every = self.goal.lists.get(UNITS, (self.goal.base.units,))
        found = (sum(len(_matching(t, int(n))) for t in self.goal.targets) for n in every)
        return max(1, *found)

    def __call__(self, values: Mapping[str, Array]) -> tuple[Residuals, Codes]:
        """Residuals over tolerances and slopes by the ranges' widths; the states, (target, design).

        `values` are by key.
        """
        goal = self.goal
        n_designs, n_ranges = len(next(iter(values.values()))), len(goal.ranges)
        residuals = np.full((goal.n_parts, n_designs), np.nan)
        slopes = np.full((goal.n_parts, n_ranges, n_designs), np.nan)
        if not goal.targets:
            return Residuals(residuals, slopes), np.zeros((0, n_designs), np.uint64)
        codes = np.zeros((len(goal.targets), n_designs), np.uint64)
        for places in groups_of(np.arange(n_designs), STATES_AT_ONCE // self.most_states):
            for some, design in by_units(goal.base, values, places):
                batch = _Batch(self, design, {key: column[some] for key, column in values.items()})
                residuals[:, some], codes[:, some] = batch.nearest()
                slopes[..., some] = batch.slopes(codes[:, some])
        return Residuals(residuals, slopes), codes


@dataclass(frozen=True)
class _Batch:
    """Designs of one number of units, with their values by key."""

    evaluation: TargetEvaluation
    design: Design
    values: Mapping[str, Array]

    @property
    def targets(self) -> tuple[Target, ...]:
        return self.evaluation.goal.targets

    @property
    def n_designs(self) -> int:
        return self.design.n_designs

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """Those that the targets are about, as far as fingers of so many units have them."""
        every = declared(self.design.units, KINDS, bool(self.design.gripper))
        names = ("status", *self.evaluation.names)
        return tuple(quantity for quantity in every if quantity.name in names)

    def nearest(self) -> tuple[Array, Codes]:
        """Residuals (part, design), and the nearest state for each target, (target, design)."""
        own = [_matching(target, self.design.units) for target in self.targets]
        every = distinct(np.concatenate(own))
        found = self.states(np.repeat(every[:, None], self.n_designs, axis=1))
        parts, codes = [], []
        for target, some in zip(self.targets, own, strict=True):
            if not len(some):
                parts.append(np.full((len(target.values), self.n_designs), np.nan))
                codes.append(np.zeros(self.n_designs, np.uint64))
                continue
            misses = _misses(target, found)[:, np.searchsorted(every, some)]
            squares = (misses**2).sum(axis=0)
            place = np.where(np.isnan(squares), np.inf, squares).argmin(axis=0)
            parts.append(np.take_along_axis(misses, place[None, None], axis=1)[:, 0])
            codes.append(some[place])
        return np.concatenate(parts), np.stack(codes)

    def states(self, codes: Codes, design: Design | None = None) -> Columns:
        """Quantities of certified states with these codes (state, design), by column; else NaN."""
        design = self.design if design is None else design
        found = resolve(design)
        rows = {name: np.full(codes.shape, np.nan) for name in self.evaluation.names}
        for some in found.alike(np.flatnonzero(~found.are_wrong)):
            scene = found.batch(some)
            lanes = np.repeat(np.arange(len(some)), len(codes))
            units = units_of(UnitSolutions.of(scene.finger), lanes)
            inverted = inverted_units(codes[:, some].T.ravel(), design.units)
            around = Surroundings(*placement(scene, len(some), lanes))
            request = RowRequest(chain_potential, DEFAULT_TOLERANCE, self.quantities, around)
            solved = solved_rows(units, inverted, request)
            is_stable = solved["status"] == Status.STABLE
            for name in rows.keys() & solved.keys():
                values = np.where(is_stable, solved[name], np.nan)
                rows[name][:, some] = values.reshape(len(some), len(codes)).T
        return rows

    def slopes(self, codes: Codes) -> Array:
        """Slopes of residuals by the ranges' widths, (part, range, design), of these states."""
        ranges = self.evaluation.goal.ranges
        every = self._exact(codes) | self._differences(codes)
        widths = np.array([each.width for each in ranges])[:, None]
        rows = [
            every[name][:, place] * widths / target.tolerance
            for place, target in enumerate(self.targets)
            for name in target.columns
        ]
        return np.stack(rows)

    def _exact(self, codes: Codes) -> dict[str, Array]:
        """Slopes by the keys of ranges, (range, target, design), by column, as far as exact."""
        names = [name for name in self.evaluation.names if name in EXACT]
        keys = [each.key for each in self.evaluation.goal.ranges]
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
                slopes[name][..., some] = values.reshape(shape).transpose(0, 2, 1)
        return slopes

    def _differences(self, codes: Codes) -> dict[str, Array]:
        """The same of all others, by central differences within the ranges."""
        names, ranges = self.evaluation.by_differences, self.evaluation.goal.ranges
        if not names or not ranges:
            return {}
        step = np.array([DIFFERENCE * each.width for each in ranges])
        n, k = self.n_designs, len(ranges)
        columns = {key: np.tile(column, 2 * k) for key, column in self.values.items()}
        for place, each in enumerate(ranges):
            middle = np.clip(self.values[each.key], each.low + step[place], each.high - step[place])
            for way in (0, 1):
                part = slice((2 * place + way) * n, (2 * place + way + 1) * n)
                columns[each.key][part] = middle + (step[place] if way else -step[place])
        (_, moved), *_ = by_units(self.evaluation.goal.base, columns, np.arange(2 * k * n))
        found = self.states(np.tile(codes, (1, 2 * k)), moved)
        slopes = {}
        for name in names:
            down, up = found[name].reshape(len(codes), k, 2, n).transpose(2, 1, 0, 3)
            slopes[name] = (up - down) / (2.0 * step[:, None, None])
        return slopes


def reason_against(goal: Goal) -> str:
    """What is wrong with the design in the middle of all ranges; empty where it can exist."""
    choice = {key: np.array([value]) for key, value in next(goal.choices()).items()}
    values = goal.values(choice, np.full((len(goal.ranges), 1), 0.5))
    ((_, design),) = by_units(goal.base, values, np.zeros(1, np.int64))
    return "; ".join(issue.statement for issue in resolve(design).problems.of(0))


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
