"""A search: from random starts for every choice of listed values to the best designs.

It is cut into parts, by choices and sets of starts, each of which any process can do by itself: how
it is cut depends on the goal and the limits alone, so that who does what changes nothing.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from time import time

import numpy as np

from dpgcli.arrays import Array, Columns
from dpgcli.records import dataclass
from dpgcli.search.designs import Designs, best_of
from dpgcli.search.goal import Goal
from dpgcli.search.part import Clock, Found, Part, searched_part

STARTS = 32  # for each choice of listed values, in each round
POLISHED_STARTS = 8  # where a population has found a choice
MOST_LANES = 2**10  # at once
MOST_PARTS = 16  # of a round, as long as choices are few
MOST_CHOICES = 1000  # that are all tried
SHARE = 0.5  # of what is left that a population may use


@dataclass(frozen=True)
class Limits:
    """When a search ends: after so many evaluated designs, or so many seconds; else one round."""

    evaluations: int | None = None
    seconds: float | None = None


@dataclass(frozen=True)
class Task:
    """Does parts of a search: a function that any process can run. `deadline` is in s since 1970.

    Of a part but the first that begins after it there is nothing.
    """

    goal: Goal
    seed: int
    deadline: float | None = None

    def __call__(self, part: Part) -> Found | None:
        clock = Clock(part.evaluations, self.deadline)
        if part.number and clock.is_late:
            return None
        if part.n_starts:
            return searched_part(self.goal, self.seed, part, clock)
        from dpgcli.search.population import chosen

        return chosen(self.goal, np.random.default_rng([self.seed, part.stream]), clock)


Run = Callable[[Task, Sequence[Part]], Iterable[Found | None]]


def in_turn(task: Task, parts: Sequence[Part]) -> Iterator[Found | None]:
    """Do parts one after the other, in this process."""
    yield from map(task, parts)


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


def search(goal: Goal, seed: int = 1, limits: Limits | None = None, run: Run = in_turn) -> Searched:
    """Search for designs that meet a goal: the same ones for the same seed, if time allows.

    `run` does the parts, in whatever order, and gives what they come to in theirs.
    """
    rounds = _Rounds(goal, seed, limits or Limits(), run)
    while rounds.may_go_on:
        rounds.do_next()
    found = rounds.found
    return Searched(
        goal,
        best_of(goal, Designs.joined([part.designs for part in found])),
        _trace(found),
        sum(part.n_starts for part in found),
        sum(part.n_empty for part in found),
        rounds.is_cut or any(part.is_stopped for part in found),
        rounds.n_evaluated,
    )


class _Rounds:
    """Rounds of parts, one after the other; the parts of a round are independent."""

    def __init__(self, goal: Goal, seed: int, limits: Limits, run: Run) -> None:
        self.goal, self.limits, self.run = goal, limits, run
        deadline = None if limits.seconds is None else time() + limits.seconds
        self.task = Task(goal, seed, deadline)
        self.found: list[Found] = []
        self.n_parts = self.n_streams = 0
        self.is_cut = False  # whether parts were left out as time was up

    @property
    def n_evaluated(self) -> int:
        return sum(part.n_evaluated for part in self.found)

    @property
    def left(self) -> int | None:
        """Designs that may still be evaluated; None where there is no such limit."""
        most = self.limits.evaluations
        return None if most is None else max(most - self.n_evaluated, 0)

    @property
    def may_go_on(self) -> bool:
        """Whether there is a round to do: the first, or one more within the limits."""
        if not self.found:
            return True
        is_limited = self.limits != Limits()
        can_differ = bool(self.goal.ranges) or self.goal.n_choices > MOST_CHOICES
        is_late = Clock(None, self.task.deadline).is_late
        return is_limited and can_differ and self.left != 0 and not is_late

    def do_next(self) -> None:
        """A round: of all choices, or of those that a population has found."""
        if self.goal.n_choices <= MOST_CHOICES:
            self._do(self.goal.listed(), None, STARTS)
            return
        most = None if self.left is None else max(1, int(SHARE * self.left))
        self._run([Part(self.n_parts, self.n_streams, {}, None, 0, most)])
        best = self.found[-1].designs
        if len(best):
            self._do({**best.choice}, best.points, POLISHED_STARTS)

    def _do(self, choices: Mapping[str, Array], begin: Array | None, n_starts: int) -> None:
        n = len(next(iter(choices.values()))) if choices else 1
        size = min(MOST_LANES // STARTS, -(-n // MOST_PARTS))
        firsts = range(0, n, size)
        n_sets = self._n_sets(len(firsts))
        left = self.left
        most = None if left is None else max(1, left // (len(firsts) * n_sets))
        parts = []
        for number in range(n_sets * len(firsts)):
            some = np.arange(n)[firsts[number % len(firsts)] :][:size]
            own = {key: column[some] for key, column in choices.items()}
            points = None if begin is None else begin[:, some]
            stream = self.n_streams + number
            parts.append(Part(self.n_parts + number, stream, own, points, n_starts, most))
        self._run(parts)

    def _n_sets(self, n_parts: int) -> int:
        """How many sets of starts a round has: more than one where it is not the last by far."""
        if not self.found or not self.goal.ranges:
            return 1
        most = max(1, MOST_PARTS // n_parts)
        if self.left is None:
            return most
        of_round = max(1, self.n_evaluated // max(1, self.n_parts // n_parts))
        return int(np.clip(self.left // of_round, 1, most))

    def _run(self, parts: Sequence[Part]) -> None:
        found = [*self.run(self.task, parts)]
        self.found += [part for part in found if part is not None]
        self.is_cut |= None in found
        self.n_parts += len(parts)
        self.n_streams += len(parts)


def _trace(found: Sequence[Found]) -> Columns:
    """The rows of all parts, their searches numbered on."""
    first, parts = 0, []
    for part in found:
        parts.append({**part.trace, "search": first + part.trace["search"]})
        first += max(part.n_starts, 1 + int(part.trace["search"].max(initial=-1)))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
