"""A search: descents from random starts for every choice of listed values, and the best of them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from time import monotonic

import numpy as np

from dpgcli.arrays import Array, Codes, Columns, Flags, Indices
from dpgcli.search.descent import Descent, Residuals, Step, descend
from dpgcli.search.goal import Choice, Goal
from dpgcli.search.targets import TargetEvaluation

STARTS = 32  # for each choice of listed values, in each round
MOST_LANES = 2**10  # at once
DRAWS = 8  # of a start, until it is a finger that has the states
MOST_FOUND = 10
ALIKE = 1e-6  # of the box: closer designs are one
SAME_MISFIT = 1e-6  # tolerances: which of two is less by so little says nothing


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
        return self.evaluations is None and self.seconds is None


@dataclass(frozen=True)
class Designs:
    """Designs at points (range, design), with listed values by key, and how they do.

    `held` (range, design) are bounds beyond which the targets would be missed by less.
    """

    choice: Mapping[str, Array]
    points: Array
    residuals: Residuals
    codes: Codes
    held: Flags

    def __len__(self) -> int:
        return self.points.shape[1]

    @property
    def misfits(self) -> Array:
        """The norm of each one's misses in tolerances, (design,)."""
        return np.asarray(np.sqrt((self.residuals.values**2).sum(axis=0)))

    def take(self, index: Indices) -> "Designs":
        """Some of them."""
        values, slopes = self.residuals
        return Designs(
            {key: column[index] for key, column in self.choice.items()},
            self.points[:, index],
            Residuals(values[:, index], slopes[..., index]),
            self.codes[:, index],
            self.held[:, index],
        )


@dataclass(frozen=True)
class Searched:
    """The best designs, the best first, and how they were found.

    `trace` has a row for each step of each descent. `n_empty` starts are no finger with certified
    states of all patterns; `n_stopped` descents were under way when time was up.
    """

    goal: Goal
    best: Designs
    trace: Columns
    n_starts: int
    n_empty: int
    n_stopped: int
    n_evaluated: int


def search(goal: Goal, seed: int = 1, limits: Limits | None = None) -> Searched:
    """Search for designs that meet a goal: the same ones for the same seed, if time allows."""
    limits = limits or Limits()
    rounds: list[_Round] = []
    choices = list(goal.choices())
    n_at_once = max(1, MOST_LANES // STARTS)
    while not rounds or (goal.ranges and limits.may_go_on() and not limits.ends_after_a_round):
        stream = np.random.default_rng([seed, len(rounds)])
        for first in range(0, len(choices), n_at_once):
            if rounds and not limits.may_go_on():
                break
            some = choices[first : first + n_at_once]
            number = sum(each.n_starts for each in rounds)
            rounds.append(_Round(goal, some, limits, number).run(stream))
    return Searched(
        goal,
        _best([each.found for each in rounds]),
        _joined([part for each in rounds for part in each.trace]),
        sum(each.n_starts for each in rounds),
        sum(each.n_empty for each in rounds),
        sum(each.n_stopped for each in rounds),
        limits.n_evaluated,
    )


@dataclass
class _Round:
    """Descents from starts of some choices, all in one batch."""

    goal: Goal
    choices: Sequence[Choice]
    limits: Limits
    first: int
    trace: list[Columns] = field(init=False, default_factory=list)
    n_empty: int = field(init=False, default=0)
    n_stopped: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        self.evaluation = TargetEvaluation(self.goal)
        self.n_each = STARTS if self.goal.ranges else 1
        self.lists = {
            key: np.repeat([choice[key] for choice in self.choices], self.n_each)
            for key in self.goal.lists
        }

    @property
    def n_starts(self) -> int:
        return len(self.choices) * self.n_each

    def run(self, stream: np.random.Generator) -> "_Round":
        """Descend from drawn starts, to where each ends or time is up."""
        start = self._starts(stream)
        steps = descend(self._evaluate, start, self.limits.may_go_on)
        for number, (descent, step) in enumerate(steps):
            self.trace.append(self._row(number, step))
            last: Descent = descent
        self.n_stopped = int((~last.is_done).sum())
        self.n_empty = int(np.isnan(last.misfits).sum())
        values = self._values(last.points, np.arange(self.n_starts))
        residuals, codes = self.evaluation(values)
        found = Designs(self.lists, last.points, residuals, codes, last.held())
        self.found = found.take(np.flatnonzero(~np.isnan(found.misfits)))
        return self

    def _values(self, points: Array, lanes: Indices) -> dict[str, Array]:
        return self.goal.values({key: own[lanes] for key, own in self.lists.items()}, points)

    def _evaluate(self, points: Array, lanes: Indices) -> Residuals:
        self.limits.n_evaluated += len(lanes)
        return self.evaluation(self._values(points, lanes))[0]

    def _starts(self, stream: np.random.Generator) -> Array:
        """Points at random, drawn again where there is no finger with states to begin with."""
        start = stream.random((len(self.goal.ranges), self.n_starts))
        lanes = np.arange(self.n_starts)
        for _ in range(DRAWS if self.goal.ranges else 0):
            found = self._evaluate(start[:, lanes], lanes).values
            lanes = lanes[np.isnan(found).any(axis=0)]
            if not len(lanes):
                break
            start[:, lanes] = stream.random((len(start), len(lanes)))
        return start

    def _row(self, number: int, step: Step) -> Columns:
        known = ~np.isnan(step.misfits)
        lanes, points = step.lanes[known], step.points[:, known]
        place = {"start": self.first + lanes, "step": np.full(len(lanes), number)}
        return {**place, **self._values(points, lanes), "misfit": step.misfits[known]}


def _best(found: Sequence[Designs]) -> Designs:
    """The best of all designs, each once."""
    every = Designs(
        {key: np.concatenate([part.choice[key] for part in found]) for key in found[0].choice},
        np.concatenate([part.points for part in found], axis=1),
        Residuals(*(np.concatenate(parts, axis=-1) for parts in zip(*_residuals(found), strict=True))),
        np.concatenate([part.codes for part in found], axis=1),
        np.concatenate([part.held for part in found], axis=1),
    )
    rounded = np.rint(every.misfits / SAME_MISFIT)
    listed = np.array([*every.choice.values()]).reshape(-1, len(every))
    order = np.lexsort((*np.round(every.points, 6)[::-1], *listed[::-1], rounded))
    kept: list[int] = []
    for place in order.tolist():
        if len(kept) == MOST_FOUND:
            break
        apart = np.abs(every.points[:, kept] - every.points[:, [place]]).max(axis=0, initial=0.0)
        same = (listed[:, kept] == listed[:, [place]]).all(axis=0) & (apart <= ALIKE)
        if not same.any():
            kept.append(place)
    return every.take(np.array(kept, np.int64))


def _residuals(found: Sequence[Designs]) -> Iterator[Residuals]:
    for part in found:
        yield part.residuals


def _joined(parts: Sequence[Columns]) -> Columns:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
