"""One part of a search: from starts for some choices of listed values to where they lead."""

from collections.abc import Mapping
from dataclasses import field
from time import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dpgcli.arrays import Array, Columns, Flags, Indices
from dpgcli.records import dataclass
from dpgcli.search.descent import Descent, Residuals, Step, descend
from dpgcli.search.designs import Designs, best_of
from dpgcli.search.goal import Goal
from dpgcli.search.targets import TargetEvaluation

if TYPE_CHECKING:
    from dpgcli.search.optima import Asked

DRAWS = 8  # of a start, until it is a finger that has the states


class Part(NamedTuple):
    """What to search for in one go: values by key (choice,), so many starts for each of them.

    The first is at `begin` (range, choice), if that is known, the others are drawn from the stream
    of this number. Without starts it is choices that are looked for, by populations. `number` is
    that of the part. It may evaluate so many designs.
    """

    number: int
    stream: int
    choices: Mapping[str, Array]
    begin: Array | None
    n_starts: int
    evaluations: int | None


@dataclass
class Clock:
    """Counts designs, and says whether more may be evaluated: so many, and up to a time (s)."""

    evaluations: int | None = None
    deadline: float | None = None
    n_evaluated: int = field(init=False, default=0)

    @property
    def is_late(self) -> bool:
        """Whether the time is over."""
        return self.deadline is not None and time() >= self.deadline

    def may_go_on(self) -> bool:
        """Whether neither is used up."""
        is_long = self.evaluations is not None and self.n_evaluated >= self.evaluations
        return not (self.is_late or is_long)


@dataclass(frozen=True)
class Found:
    """What a part comes to: designs, and a row for each step of each search in the trace.

    `n_empty` starts are no finger with certified states of all patterns.
    """

    designs: Designs
    trace: Columns
    n_starts: int
    n_empty: int
    n_evaluated: int

    @property
    def is_stopped(self) -> bool:
        """Whether searches were under way when a limit was reached."""
        return not bool(self.designs.are_finished.all())


def searched_part(goal: Goal, seed: int, part: Part, clock: Clock) -> Found:
    """Search from drawn starts, to where each search ends or the clock stops it."""
    return _Search(goal, part, clock).run(np.random.default_rng([seed, part.stream]))


class _Search:
    """Searches from starts of some choices, all in one batch."""

    def __init__(self, goal: Goal, part: Part, clock: Clock) -> None:
        self.goal, self.part, self.clock = goal, part, clock
        self.evaluation = TargetEvaluation(goal)
        self.n_each = part.n_starts if goal.ranges else 1
        n_choices = len(next(iter(part.choices.values()))) if goal.lists else 1
        self.n_starts = n_choices * self.n_each
        self.lists = {key: np.repeat(part.choices[key], self.n_each) for key in goal.lists}
        self.trace: list[Columns] = []
        self.n_asked: dict[int, int] = {}

    def run(self, stream: np.random.Generator) -> Found:
        """Search on from points that the stream has."""
        goal, points = self.goal, self._starts(stream)
        are_done = np.ones(self.n_starts, bool)
        if goal.targets and goal.ranges:
            points, are_done = self._descended(points)
        found = Designs.at(goal, self.lists, points).with_finished(are_done)
        if not self.trace:
            self.clock.n_evaluated += len(found)
            step = Step(np.arange(len(found)), points, found.misfits)
            self.trace.append(self._row(0, step))
        n_empty = int((~found.exist).sum())
        found = found.take(np.flatnonzero(found.exist))
        if goal.has_maps and goal.ranges and len(found):
            from dpgcli.search.optima import Optima

            optima = Optima(goal, found, self._told).found()
            found = Designs.joined([best_of(goal, found).take(np.arange(1)), optima])
        trace = {n: np.concatenate([row[n] for row in self.trace]) for n in self.trace[0]}
        return Found(found, trace, self.n_starts, n_empty, self.clock.n_evaluated)

    def _starts(self, stream: np.random.Generator) -> Array:
        """Points at random, drawn again where there is no finger with states to begin with."""
        start = stream.random((len(self.goal.ranges), self.n_starts))
        if self.part.begin is not None:
            start[:, :: self.n_each] = self.part.begin
        lanes = np.arange(self.n_starts)
        for _ in range(DRAWS if self.goal.ranges and self.goal.targets else 0):
            self.clock.n_evaluated += len(lanes)
            found = self.evaluation(self._values(start[:, lanes], lanes), with_slopes=False)[0]
            lanes = lanes[np.isnan(found.values).any(axis=0)]
            if not len(lanes):
                break
            start[:, lanes] = stream.random((len(start), len(lanes)))
        return start

    def _descended(self, start: Array) -> tuple[Array, Flags]:
        """Points where the targets are missed by least, as far as one gets, and which are ends."""
        for number, (descent, step) in enumerate(
            descend(self._evaluate, start, self.clock.may_go_on)
        ):
            self.trace.append(self._row(number, step))
            last: Descent = descent
        return last.points, last.is_done

    def _values(self, points: Array, lanes: Indices) -> dict[str, Array]:
        return self.goal.values({key: own[lanes] for key, own in self.lists.items()}, points)

    def _evaluate(self, points: Array, lanes: Indices) -> Residuals:
        self.clock.n_evaluated += len(lanes)
        return self.evaluation(self._values(points, lanes))[0]

    def _told(self, asked: "Asked") -> None:
        """Count what a search asked; raises TimeIsUpError where that is enough."""
        from dpgcli.search.optima import TimeIsUpError

        searches = (self.n_starts + asked.searches).tolist()
        for each in searches:
            self.n_asked[each] = self.n_asked.get(each, 0) + 1
        steps = np.array([self.n_asked[each] for each in searches])
        place = {"search": np.array(searches), "step": steps}
        told = self.goal.told(asked.objectives)
        self.trace.append({**place, **asked.values, "misfit": asked.misfits, **told})
        self.clock.n_evaluated += len(asked.searches) * (2 * len(self.goal.ranges) + 1)
        if not self.clock.may_go_on():
            raise TimeIsUpError

    def _row(self, number: int, step: Step) -> Columns:
        known = ~np.isnan(step.misfits)
        lanes, points = step.lanes[known], step.points[:, known]
        place = {"search": lanes, "step": np.full(len(lanes), number)}
        told = self.goal.told(np.full((len(self.goal.objectives), len(lanes)), np.nan))
        return {**place, **self._values(points, lanes), "misfit": step.misfits[known], **told}
