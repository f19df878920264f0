"""From points that a search has come to, on to optima under constraints, choice by choice."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.records import dataclass
from dpgcli.search.constrained import Local, Scalar, descend_within, last_that_hold, simplex
from dpgcli.search.designs import Designs
from dpgcli.search.goal import Goal
from dpgcli.search.maps import COUNTS, MapEvaluation
from dpgcli.search.targets import TargetEvaluation

STARTS_EACH = 6  # of a choice, for each objective alone
STARTS_ON_FRONT = 2  # of a choice, for each point of a front
TINY = 1e-12


class TimeIsUpError(Exception):
    """A search may not go on."""


class Asked(NamedTuple):
    """Points that searches of these numbers asked about, and what was found there.

    `values` are by key, `objectives` (objective, point) all to be least, `misfits` in tolerances.
    """

    searches: Indices
    values: Mapping[str, Array]
    objectives: Array
    misfits: Array


@dataclass(frozen=True)
class Optima:
    """Searches on from designs that are known, under the constraints of a goal.

    `tell` hears of all that is asked, and may raise `TimeIsUpError`.
    """

    goal: Goal
    known: Designs
    tell: Callable[[Asked], None]

    def evaluate(self, points: Array, choice: Mapping[str, Array]) -> list[Local]:
        """Objectives, margins and slopes at points (range, design).

        Without objectives it is the misfit that should be least; with them a target is met within
        its tolerance, one rule more.
        """
        goal, values = self.goal, self.goal.values(choice, points)
        maps = MapEvaluation(goal)(values)
        residuals, slopes = TargetEvaluation(goal)(values)[0]
        if not goal.objectives:
            half = 0.5 * (residuals**2).sum(axis=0)
            maps = maps._replace(
                objectives=half[None],
                objective_slopes=(slopes * residuals[:, None]).sum(axis=0)[None],
            )
        elif goal.targets:
            rooms = [1.0 - (residuals[part] ** 2).sum(axis=0) for part in goal.parts]
            products = -2.0 * slopes * residuals[:, None]
            ways = [products[part].sum(axis=0) for part in goal.parts]
            maps = maps._replace(
                margins=np.concatenate((maps.margins, rooms)),
                margin_slopes=np.concatenate((maps.margin_slopes, ways)),
            )
        return [Local(*(part[..., k] for part in maps)) for k in range(points.shape[1])]

    def _misfits(self, found: Sequence[Local]) -> Array:
        """Root of the sum of squares of all misses, in tolerances, of what was evaluated."""
        if not self.goal.objectives:
            return np.sqrt([2.0 * each.objectives[0] for each in found])
        n = len(self.goal.targets)
        rooms = [each.margins[len(each.margins) - n :] for each in found]
        return np.sqrt([(1.0 - room).sum() for room in rooms])

    def found(self) -> Designs:
        """The designs that searches end in; they begin at the best of each choice."""
        known, goal = self.known, self.goal
        maps = MapEvaluation(goal)
        columns = maps.keys(goal.values(known.choice, known.points)) | {**known.columns}
        objectives, margins = known.objectives, maps.margins(columns, len(known))
        if not goal.objectives:
            objectives = 0.5 * known.misfits[None] ** 2
        elif goal.targets:
            margins = np.concatenate((margins, 1.0 - known.misses(goal) ** 2))
        sizes = np.array([_size(row) for row in margins])
        lack = np.maximum(-margins / sizes[:, None], 0.0).sum(axis=0) + (~known.hold).sum(axis=0)
        n = len(objectives)
        spread = np.ptp(objectives, axis=1)
        spread = np.where(spread > TINY, spread, 1.0)
        alone = [Scalar(row / spread, np.zeros(n)) for row in np.eye(n)]
        ends = self._run(alone, STARTS_EACH, objectives, lack, sizes)
        if len(goal.objectives) < 2:
            return ends
        met = ends.take(np.flatnonzero(ends.exist & (ends.n_broken(goal) == 0)))
        if not len(met):
            return ends
        ideal, worst = met.objectives.min(axis=1), met.objectives.max(axis=1)
        span = np.where(worst - ideal > TINY, worst - ideal, 1.0)
        scalars = [Scalar(weights / span, ideal) for weights in simplex(n)]
        front = self._run(scalars, STARTS_ON_FRONT, objectives, lack, sizes, len(ends))
        return Designs.joined([ends, front])

    def _run(
        self,
        scalars: Sequence[Scalar],
        n_each: int,
        objectives: Array,
        lack: Array,
        sizes: Array,
        n_before: int = 0,
    ) -> Designs:
        """Where searches end that begin, for each scalar and choice, at the best known designs.

        They are numbered after `n_before` others.
        """
        known, goal = self.known, self.goal
        listed = np.array([*known.choice.values()], float).reshape(len(known.choice), len(known))
        choices = np.unique(listed, axis=1, return_inverse=True)[1].reshape(-1)
        lanes: list[int] = []
        own: list[Scalar] = []
        for scalar in scalars:
            order = np.lexsort((scalar.of(objectives), lack))
            for number in range(choices.max() + 1):
                best = order[choices[order] == number][:n_each]
                lanes += best.tolist()
                own += [scalar] * len(best)
        begin = known.take(np.array(lanes, np.int64))
        latest = begin.points.copy()

        def evaluate(points: Array, numbers: Indices) -> list[Local]:
            choice = {key: column[numbers] for key, column in begin.choice.items()}
            found = self.evaluate(points, choice)
            latest[:, numbers] = points
            values = goal.values(choice, points)
            told = np.stack([each.objectives for each in found], axis=1)
            self.tell(Asked(n_before + numbers, values, told, self._misfits(found)))
            return found

        are_done = np.ones(len(begin), bool)
        try:
            ends = descend_within(evaluate, begin.points, own, sizes)
        except TimeIsUpError:
            ends, are_done = latest, ~are_done
        if any(rule.names & COUNTS for rule in goal.constraints):
            ends = last_that_hold(
                lambda points: np.asarray(Designs.at(goal, begin.choice, points).hold.all(axis=0)),
                begin.points,
                ends,
            )
        return Designs.at(goal, begin.choice, ends).with_finished(are_done)


def _size(margins: Array) -> float:
    """The usual size of a margin."""
    known = np.abs(margins[np.isfinite(margins)])
    size = float(np.median(known)) if len(known) else 0.0
    return size if size > TINY else 1.0
