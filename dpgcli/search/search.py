"""A search: from random starts for every choice of listed values to the best designs."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from time import monotonic
from typing import TYPE_CHECKING

import numpy as np

from dpgcli.arrays import Array, Columns, Indices
from dpgcli.search.descent import Descent, Residuals, Step, descend
from dpgcli.search.designs import Designs, best_of
from dpgcli.search.goal import Choice, Goal
from dpgcli.search.targets import TargetEvaluation

if TYPE_CHECKING:
    from dpgcli.search.optima import Asked

STARTS = 32  # for each choice of listed values, in each round
MOST_LANES = 2**10  # at once
DRAWS = 8  # of a start, until it is a finger that has the states


@dataclass
class Limits:
    """When a search ends: after so many evaluated designs, or so many seconds; else one round."""

    evaluations: int | None = None
    seconds: float | None = None
    n_evaluated: int = field(init=False, default=0)
    began: float = field(init=False, default_factory=monotonic)

    def may_go_on(self) -> bool:
        """Whether neither is used up."""
        is_late = self.seconds is not None and monotonic() - self.began >= self.seconds
        is_long = self.evaluations is not None and self.n_evaluated >= self.evaluations
        return not (is_late or is_long)

    @property
    def ends_after_a_round(self) -> bool:
        """Whether there is none."""
        return self.evaluations is None and self.seconds is None


@dataclass(frozen=True)
class Searched:
    """The best designs, the best first, and how they were found.

    `trace` has a row for each step of each search. `n_empty` starts are no finger with certified
    states of all patterns; `is_stopped` where searches were under way when a limit was reached.
    """

    goal: Goal
    best: Designs
    trace: Columns
    n_starts: int
    n_empty: int
    is_stopped: bool
    n_evaluated: int


def search(goal: Goal, seed: int = 1, limits: Limits | None = None) -> Searched:
    """Search for designs that meet a goal: the same ones for the same seed, if time allows."""
    limits = limits or Limits()
    rounds: list[_Round] = []
    choices = list(goal.choices())
    n_at_once = max(1, MOST_LANES // STARTS)
    while not rounds or (goal.ranges and limits.may_go_on() and not limits.ends_after_a_round):
        for first in range(0, len(choices), n_at_once):
            stream = np.random.default_rng([seed, len(rounds)])
            if rounds and not limits.may_go_on():
                break
            some = choices[first : first + n_at_once]
            number = sum(each.n_searches for each in rounds)
            rounds.append(_Round(goal, some, limits, number).run(stream))
    return Searched(
        goal,
        best_of(goal, Designs.joined([each.found for each in rounds])),
        _joined([part for each in rounds for part in each.trace]),
        sum(each.n_starts for each in rounds),
        sum(each.n_empty for each in rounds),
        any(each.is_stopped for each in rounds),
        limits.n_evaluated,
    )


@dataclass
class _Round:
    """Searches from starts of some choices, all in one batch."""

    goal: Goal
    choices: Sequence[Choice]
    limits: Limits
    first: int
    trace: list[Columns] = field(init=False, default_factory=list)
    n_empty: int = field(init=False, default=0)
    is_stopped: bool = field(init=False, default=False)

    def __post_init__(self) -> None:
        self.evaluation = TargetEvaluation(self.goal)
        self.n_each = STARTS if self.goal.ranges else 1
        self.n_starts = self.n_searches = len(self.choices) * self.n_each
        self.n_asked: dict[int, int] = {}
        self.lists = {
            key: np.repeat([choice[key] for choice in self.choices], self.n_each)
            for key in self.goal.lists
        }

    def run(self, stream: np.random.Generator) -> "_Round":
        """Search from drawn starts, to where each search ends or time is up."""
        points = self._starts(stream)
        if self.goal.targets and self.goal.ranges:
            points = self._descended(points)
        found = Designs.at(self.goal, self.lists, points)
        if not self.trace:
            self.limits.n_evaluated += len(found)
            self.trace.append(self._row(0, Step(np.arange(len(found)), points, found.misfits)))
        self.n_empty = int((~found.exist).sum())
        self.found = found.take(np.flatnonzero(found.exist))
        if self.goal.has_maps and self.goal.ranges and len(self.found):
            from dpgcli.search.optima import Optima

            optima = Optima(self.goal, self.found, self._told).found()
            best = best_of(self.goal, self.found).take(np.arange(1))
            self.found = Designs.joined([best, optima])
        return self

    def _descended(self, start: Array) -> Array:
        """Points where the targets are missed by least, as far as one gets from each start."""
        steps = descend(self._evaluate, start, self.limits.may_go_on)
        for number, (descent, step) in enumerate(steps):
            self.trace.append(self._row(number, step))
            last: Descent = descent
        self.is_stopped |= not last.is_done.all()
        return last.points

    def _values(self, points: Array, lanes: Indices) -> dict[str, Array]:
        return self.goal.values({key: own[lanes] for key, own in self.lists.items()}, points)

    def _evaluate(self, points: Array, lanes: Indices) -> Residuals:
        self.limits.n_evaluated += len(lanes)
        return self.evaluation(self._values(points, lanes))[0]

    def _starts(self, stream: np.random.Generator) -> Array:
        """Points at random, drawn again where there is no finger with states to begin with."""
        start = stream.random((len(self.goal.ranges), self.n_starts))
        lanes = np.arange(self.n_starts)
        for _ in range(DRAWS if self.goal.ranges and self.goal.targets else 0):
            found = self._evaluate(start[:, lanes], lanes).values
            lanes = lanes[np.isnan(found).any(axis=0)]
            if not len(lanes):
                break
            start[:, lanes] = stream.random((len(start), len(lanes)))
        return start

    def _told(self, asked: "Asked") -> None:
        """Count what a search asked; raises TimeIsUpError where that is enough."""
        from dpgcli.search.optima import TimeIsUpError

        signs = [-1.0 if each.is_maximized else 1.0 for each in self.goal.objectives]
        names = [each.name for each in self.goal.objectives]
        searches = (self.first + self.n_starts + asked.searches).tolist()
        for each in searches:
            self.n_asked[each] = self.n_asked.get(each, 0) + 1
        self.n_searches = self.n_starts + len(self.n_asked)
        place = {
            "search": np.array(searches),
            "step": np.array([self.n_asked[each] for each in searches]),
        }
        told = dict(zip(names, asked.objectives * np.array(signs)[:, None], strict=False))
        self.trace.append({**place, **asked.values, "misfit": asked.misfits, **told})
        self.limits.n_evaluated += len(asked.searches) * (2 * len(self.goal.ranges) + 1)
        if not self.limits.may_go_on():
            self.is_stopped = True
            raise TimeIsUpError

    def _row(self, number: int, step: Step) -> Columns:
        known = ~np.isnan(step.misfits)
        lanes, points = step.lanes[known], step.points[:, known]
        place = {"search": self.first + lanes, "step": np.full(len(lanes), number)}
        unknown = np.full(len(lanes), np.nan)
        told = {each.name: unknown for each in self.goal.objectives}
        return {**place, **self._values(points, lanes), "misfit": step.misfits[known], **told}


def _joined(parts: Sequence[Columns]) -> Columns:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
