"""Designs that a search has come to, and which of them are the best."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Codes, Flags, Indices
from dpgcli.records import dataclass
from dpgcli.search.descent import Residuals, held
from dpgcli.search.goal import Goal
from dpgcli.search.maps import MapEvaluation
from dpgcli.search.targets import TargetEvaluation
from dpgcli.sweeps.fronts import on_front

MOST_FOUND = 10
MOST_ON_FRONT = 100
ALIKE = 1e-6  # of the box: closer designs are one
GRAIN = 1e-2  # of a front's span: points closer in each objective are one
SAME = 1e-6  # which of two is less by so little says nothing


@dataclass(frozen=True)
class Designs:
    """Designs at points (range, design), with listed values by key, and how they do.

    `codes` are the states nearest to the targets, (target, design). `columns` are those of maps
    that matter, `objectives` (objective, design) all to be least, `hold` (constraint, design).
    `are_finished` where no limit ended the search, (design,).
    """

    choice: Mapping[str, Array]
    points: Array
    residuals: Residuals
    codes: Codes
    columns: Mapping[str, Array]
    objectives: Array
    hold: Flags
    are_finished: Flags

    @classmethod
    def at(cls, goal: Goal, choice: Mapping[str, Array], points: Array) -> "Designs":
        """Designs at points, evaluated."""
        values = goal.values(choice, points)
        residuals, codes = TargetEvaluation(goal)(values)
        maps = MapEvaluation(goal)
        n = points.shape[1]
        if not goal.has_maps:
            nothing, every = np.zeros((0, n)), np.ones(n, bool)
            return cls(choice, points, residuals, codes, {}, nothing, nothing > 0.0, every)
        known = maps.columns(values)
        columns = {name: known[name] for name in sorted(maps.names)}
        objectives, hold = maps.objectives(known), maps.hold(known)
        every = np.ones(n, bool)
        return cls(choice, points, residuals, codes, columns, objectives, hold, every)

    def with_finished(self, are_finished: Flags) -> "Designs":
        """The same, of searches that a limit ended or not."""
        return replace(self, are_finished=are_finished)

    def __len__(self) -> int:
        return int(self.points.shape[1])

    @property
    def misfits(self) -> Array:
        """The norm of each one's misses in tolerances, (design,)."""
        return np.asarray(np.sqrt((self.residuals.values**2).sum(axis=0)))

    def misses(self, goal: Goal) -> Array:
        """By how many tolerances each target is missed, (target, design)."""
        found = [np.sqrt((self.residuals.values[part] ** 2).sum(axis=0)) for part in goal.parts]
        return np.array(found).reshape(len(goal.targets), len(self))

    @property
    def exist(self) -> Flags:
        """Which are fingers with all the states and columns that matter."""
        return ~(np.isnan(self.misfits) | np.isnan(self.objectives).any(axis=0))

    def take(self, index: Indices) -> "Designs":
        """Some of them."""
        values, slopes = self.residuals
        return replace(
            self,
            choice={key: column[index] for key, column in self.choice.items()},
            points=self.points[:, index],
            residuals=Residuals(values[:, index], slopes[..., index]),
            codes=self.codes[:, index],
            columns={name: column[index] for name, column in self.columns.items()},
            objectives=self.objectives[:, index],
            hold=self.hold[:, index],
            are_finished=self.are_finished[index],
        )

    @classmethod
    def joined(cls, parts: Sequence["Designs"]) -> "Designs":
        """All of several."""

        def last(arrays: Sequence[NDArray[Any]]) -> NDArray[Any]:
            return np.concatenate(arrays, axis=-1)

        first = parts[0]
        return cls(
            {key: last([part.choice[key] for part in parts]) for key in first.choice},
            last([part.points for part in parts]),
            Residuals(*(last(pair) for pair in zip(*(p.residuals for p in parts), strict=True))),
            last([part.codes for part in parts]),
            {name: last([part.columns[name] for part in parts]) for name in first.columns},
            last([part.objectives for part in parts]),
            last([part.hold for part in parts]),
            last([part.are_finished for part in parts]),
        )

    @property
    def held(self) -> Flags:
        """Bounds that designs are on, and beyond which targets would be missed by less."""
        gradient = (self.residuals.slopes * self.residuals.values[:, None]).sum(axis=0)
        return held(self.points, np.asarray(gradient))

    def n_broken(self, goal: Goal) -> Indices:
        """How many constraints, and with objectives targets, each does not meet, (design,)."""
        broken = (~self.hold).sum(axis=0)
        if goal.objectives:
            broken = broken + (self.misses(goal) > 1.0).sum(axis=0)
        return np.asarray(broken)


def best_of(goal: Goal, every: Designs) -> Designs:
    """The best of all designs, each once: what meets most, then by objective or misfit.

    With several objectives the front of what meets all, along the first. Of searches that a limit
    ended, those alone that have come further than what is finished: others were on their way.
    """
    every = every.take(np.flatnonzero(every.exist))
    broken, misfit = every.n_broken(goal), np.rint(every.misfits / SAME)
    keys = [misfit] if not goal.objectives else [np.where(broken > 0, misfit, 0.0)]
    if goal.objectives:
        keys.append(every.objectives[0])
    most = MOST_FOUND
    is_front = len(goal.objectives) > 1 and bool((broken == 0).any())
    if is_front:
        met = np.flatnonzero(broken == 0)
        front = met[on_front(every.objectives[:, met].T)]
        every, most = every.take(front), MOST_ON_FRONT
        broken, keys = broken[front], [key[front] for key in keys]
    grain = GRAIN * np.ptp(every.objectives, axis=1)[:, None] if is_front else 0.0
    listed = np.array([*every.choice.values()], float).reshape(len(every.choice), len(every))
    ties = (*np.round(every.points, 6)[::-1], *listed[::-1])
    order = np.lexsort((*ties, *keys[::-1], broken))
    kept: list[int] = []
    for place in order.tolist():
        if len(kept) == most:
            break
        if not (is_front or every.are_finished[place]) and every.are_finished[kept].any():
            continue
        apart = np.abs(every.points[:, kept] - every.points[:, [place]]).max(axis=0, initial=0.0)
        alike = (listed[:, kept] == listed[:, [place]]).all(axis=0) & (apart <= ALIKE)
        if is_front:
            beside = np.abs(every.objectives[:, kept] - every.objectives[:, [place]])
            alike |= (beside <= grain).all(axis=0)
        if not alike.any():
            kept.append(place)
    return every.take(np.array(kept, np.int64))
