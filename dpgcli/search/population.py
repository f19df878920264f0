"""Choices of listed values that are too many to try them all: a population finds good ones.

Differential evolution (Storn and Price, Journal of Global Optimization 11, 1997, 341), as SciPy has
it, over places in the lists and in the ranges; a generation is one batch. With several objectives
there is a population for each alone, and one for all of them. What it finds is where searches
begin: slopes do the rest.
"""

from dataclasses import field
from typing import Any

import numpy as np
from scipy.optimize import Bounds, differential_evolution

from dpgcli.arrays import Array, Columns, Flags, Indices
from dpgcli.records import dataclass
from dpgcli.search.designs import Designs
from dpgcli.search.goal import Goal
from dpgcli.search.maps import MapEvaluation
from dpgcli.search.part import Clock, Found
from dpgcli.search.targets import TargetEvaluation

SIZE = 15  # designs for each key that varies
MOST_GENERATIONS = 200
MOST_CHOSEN = 32  # choices
LACKING, NOWHERE = 1e9, 1e12  # more than any objective: where rules are broken, or nothing exists


def chosen(goal: Goal, stream: np.random.Generator, clock: Clock) -> Found:
    """The best choices that populations come to, each with its best point, the best first."""
    n = max(1, len(goal.objectives))
    weights = [*np.eye(n), *([np.ones(n)] if n > 1 else [])]
    population = _Population(goal, clock)
    score: Any = population  # of many at once, and a truth from the other: not in SciPy's stubs
    is_over: Any = population.is_over
    last = [len(values) - 1 for values in goal.lists.values()] + [1] * len(goal.ranges)
    is_done = True
    for number, own in enumerate(weights):
        population.search, population.weights = number, own
        found = differential_evolution(
            score,
            Bounds(np.zeros(len(last)), np.array(last, float)),
            integrality=[True] * len(goal.lists) + [False] * len(goal.ranges),
            vectorized=True,
            updating="deferred",
            polish=False,
            popsize=SIZE,
            maxiter=MOST_GENERATIONS,
            callback=is_over,
            seed=stream,
        )
        is_done &= bool(found.success)
    return population.found(is_done=is_done)


@dataclass
class _Population:
    """What there is to be least, of many designs at once, and the best design of each choice."""

    goal: Goal
    clock: Clock
    weights: Array = field(init=False)
    search: int = field(init=False, default=0)
    step: dict[int, int] = field(init=False, default_factory=dict)
    spans: Array | None = field(init=False, default=None)
    sizes: Array | None = field(init=False, default=None)
    best: dict[tuple[int, ...], tuple[float, Array]] = field(init=False, default_factory=dict)
    trace: list[Columns] = field(init=False, default_factory=list)

    def __call__(self, places: Array) -> Array:
        """Scores (design,) of places in lists and ranges (key, design)."""
        n_lists = len(self.goal.lists)
        listed, points = np.rint(places[:n_lists]).astype(np.int64), places[n_lists:]
        scores = self._scores(listed, points)
        for choice, point, score in zip(listed.T.tolist(), points.T, scores.tolist(), strict=True):
            key = tuple(choice)
            if key not in self.best or score < self.best[key][0]:
                self.best[key] = score, point.copy()
        return scores

    def is_over(self, intermediate_result: object) -> bool:
        """Whether no more designs may be evaluated; SciPy asks after each generation."""
        return not self.clock.may_go_on()

    def _scores(self, listed: Indices, points: Array) -> Array:
        """What should be least; where rules are broken by how much, beyond all that is not."""
        goal, n = self.goal, points.shape[1]
        values = goal.values(goal.choice_at(listed), points)
        residuals = TargetEvaluation(goal)(values, with_slopes=False)[0].values
        misfits, maps = np.sqrt((residuals**2).sum(axis=0)), MapEvaluation(goal)
        objectives, lack = misfits[None] ** 2, np.zeros(n)
        told = np.zeros((0, n))
        if goal.has_maps:
            columns = maps.columns(values)
            lack = self._lack(maps.margins(columns, n), maps.hold(columns))
            if goal.objectives:
                objectives = told = maps.objectives(columns)
                misses = [np.sqrt((residuals[part] ** 2).sum(axis=0)) for part in goal.parts]
                lack = lack + _some(misses, n, 1.0)
        if self.spans is None:
            self.spans = _spans(objectives)
        exist = ~(np.isnan(misfits) | np.isnan(objectives).any(axis=0))
        score = (self.weights[:, None] * objectives / self.spans).sum(axis=0)
        score = np.where(lack > 0.0, LACKING * (1.0 + lack), score)
        score = np.where(exist & ~np.isnan(score), score, NOWHERE)
        self._tell(values, misfits, told, score)
        return score

    def _lack(self, margins: Array, hold: Flags) -> Array:
        """How many rules are broken, and by how much, in the sizes that margins have at first."""
        if self.sizes is None:
            self.sizes = _spans(margins)
        broken = np.asarray((~hold).sum(axis=0), float)
        return broken + _some([-row for row in margins / self.sizes], hold.shape[1], 0.0)

    def _tell(self, values: Columns, misfits: Array, objectives: Array, score: Array) -> None:
        """Count a generation, and note its best design."""
        self.clock.n_evaluated += len(score)
        step = self.step[self.search] = self.step.get(self.search, -1) + 1
        best = [int(score.argmin())] if score.min() < NOWHERE else []
        place = {"search": np.full(len(best), self.search), "step": np.full(len(best), step)}
        own = {key: column[best] for key, column in values.items()}
        told = self.goal.told(objectives[:, best])
        self.trace.append({**place, **own, "misfit": misfits[best], **told})

    def found(self, *, is_done: bool) -> Found:
        """The best choices."""
        order = sorted(self.best, key=lambda choice: (self.best[choice][0], choice))
        order = [key for key in order if self.best[key][0] < NOWHERE][:MOST_CHOSEN]
        n = len(order)
        listed = np.array(order, np.int64).reshape(n, len(self.goal.lists)).T
        points = np.array([self.best[key][1] for key in order]).reshape(n, len(self.goal.ranges)).T
        choice = self.goal.choice_at(listed)
        designs = Designs.at(self.goal, choice, points).with_finished(np.full(n, is_done))
        trace = {name: np.concatenate([row[name] for row in self.trace]) for name in self.trace[0]}
        return Found(designs, trace, 0, 0, self.clock.n_evaluated)


def _some(amounts: list[Array], n: int, limit: float) -> Array:
    """By how much amounts (design,) are beyond a limit, each counted as less than one."""
    beyond = np.array([np.maximum(amount - limit, 0.0) for amount in amounts]).reshape(-1, n)
    return np.asarray(np.nan_to_num(beyond / (1.0 + beyond), nan=1.0).sum(axis=0))


def _spans(rows: Array) -> Array:
    """What rows (row, design) usually are in size, (row, 1)."""
    known = [np.abs(row[np.isfinite(row)]) for row in rows]
    sizes = [float(np.median(row)) if len(row) else 1.0 for row in known]
    return np.array([size if size > 0.0 else 1.0 for size in sizes]).reshape(-1, 1)
