"""Least squares in a box, many searches at once: Levenberg and Marquardt's method, batched.

A step solves (JᵀJ + λ μ I) p = −Jᵀr for the coordinates that are free, μ being the mean of their
diagonal, and is cut at the box; coordinates on a bound that the gradient pushes against stay there
(Nocedal and Wright, Numerical Optimization, 2nd ed., 2006, sections 10.3 and 16.7). λ falls with
the share that comes of what a step promises (Madsen, Nielsen and Tingleff, Methods for Non-Linear
Least Squares Problems, 2nd ed., 2004, section 3.2), and grows where a step does not help, or where
there is no finger with that state: then r is NaN. SciPy's least_squares takes one start at a time,
and each of its evaluations costs as much as one of all starts here.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.records import dataclass

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-9, 1e9
LOWERED, RAISED = 0.1, 4.0  # factors of λ
MOST_STEPS = 100
EXACT = 1e-24  # sum of squares in tolerances: below it, rounding of the states decides
SMALLEST_STEP = 1e-13  # of the box
SMALLEST_GAIN = 1e-13  # of the sum of squares


class Residuals(NamedTuple):
    """Residuals (part, lane), NaN where there are none, and slopes (part, coordinate, lane)."""

    values: Array
    slopes: Array


Evaluate = Callable[[Array, Indices], Residuals]
"""Residuals at points (coordinate, lane) of the unit box, of the searches with these numbers."""


class Step(NamedTuple):
    """Where searches are after a step: their numbers, their points, and their residuals' norms."""

    lanes: Indices
    points: Array
    misfits: Array


def held(points: Array, gradient: Array) -> Flags:
    """Coordinates on a bound of the unit box that something would fall beyond, (…, lane)."""
    below = (points <= 0.0) & (gradient > 0.0)
    return np.asarray(below | ((points >= 1.0) & (gradient < 0.0)))


@dataclass
class Descent:
    """Searches on their way: points (coordinate, lane), with what is known there."""

    points: Array
    values: Array
    slopes: Array
    damping: Array
    is_done: Flags

    @classmethod
    def at(cls, evaluate: Evaluate, start: Array) -> "Descent":
        lanes = np.arange(start.shape[1])
        values, slopes = evaluate(start, lanes)
        damping = np.full(len(lanes), FIRST_DAMPING)
        squares = (values**2).sum(axis=0)
        return cls(start.copy(), values, slopes, damping, ~(squares > EXACT))

    @property
    def misfits(self) -> Array:
        """The norm of each search's residuals; NaN where there are none."""
        return np.asarray(np.sqrt((self.values**2).sum(axis=0)))

    @property
    def gradient(self) -> Array:
        """Of half the sum of squares, (coordinate, lane)."""
        return np.asarray((self.slopes * self.values[:, None]).sum(axis=0))

    def _steps(self, lanes: Indices) -> Array:
        """The next step of some searches, (coordinate, lane), not yet cut at the box."""
        slopes = np.where(held(self.points, self.gradient)[:, lanes], 0.0, self.slopes[..., lanes])
        curved = np.einsum("pil,pjl->lij", slopes, slopes)
        size = slopes.shape[1]
        scale = np.trace(curved, axis1=1, axis2=2) / size
        scale = np.where(scale > 0.0, scale, 1.0)
        curved += (self.damping[lanes] * scale)[:, None, None] * np.eye(size)
        downhill = -np.einsum("pil,pl->li", slopes, self.values[:, lanes])
        return np.asarray(np.linalg.solve(curved, downhill[..., None])[..., 0].T)

    def _promised(self, lanes: Indices, step: Array) -> Array:
        """By how much the sum of squares should fall, the residuals being straight, (lane,)."""
        values, changes = self.values[:, lanes], (self.slopes[..., lanes] * step).sum(axis=1)
        fall = (values**2).sum(axis=0) - ((values + changes) ** 2).sum(axis=0)
        return np.asarray(np.maximum(fall, np.finfo(float).tiny))

    def step(self, evaluate: Evaluate) -> Step:
        """One step of all searches under way, those that it does not help aside."""
        lanes = np.flatnonzero(~self.is_done)
        here = self.points[:, lanes]
        there = np.clip(here + self._steps(lanes), 0.0, 1.0)
        promised = self._promised(lanes, there - here)
        values, slopes = evaluate(there, lanes)
        before = (self.values[:, lanes] ** 2).sum(axis=0)
        after = (values**2).sum(axis=0)
        is_better = after < before
        taken = lanes[is_better]
        self.points[:, taken] = there[:, is_better]
        self.values[:, taken] = values[:, is_better]
        self.slopes[..., taken] = slopes[..., is_better]
        factor = np.where(
            is_better, _factor(np.clip(before - after, 0.0, promised) / promised), RAISED
        )
        damping = np.maximum(self.damping[lanes] * factor, LEAST_DAMPING)
        self.damping[lanes] = damping
        is_small = np.abs(there - here).max(axis=0) <= SMALLEST_STEP
        gains_little = is_better & (before - after <= SMALLEST_GAIN * before)
        is_exact = is_better & (after <= EXACT)
        self.is_done[lanes] = is_small | gains_little | is_exact | (damping > MOST_DAMPING)
        return Step(taken, self.points[:, taken], self.misfits[taken])


def _factor(share: Array) -> Array:
    """By what λ changes with the share of the promised fall that came; at least `LOWERED`."""
    return np.maximum(1.0 - (2.0 * share - 1.0) ** 3, LOWERED)


def descend(
    evaluate: Evaluate, start: Array, may_go_on: Callable[[], bool] = lambda: True
) -> Iterator[tuple[Descent, Step]]:
    """Searches from starts (coordinate, lane) in the unit box, step by step, to where they end.

    >>> def evaluate(points, lanes):  # r = 2 x − 1
    ...     return Residuals(2.0 * points - 1.0, np.full((1, 1, len(lanes)), 2.0))
    >>> *_, (descent, _) = descend(evaluate, np.array([[0.0, 0.9]]))
    >>> descent.points.round(9).tolist()
    [[0.5, 0.5]]
    """
    descent = Descent.at(evaluate, start)
    lanes = np.arange(start.shape[1])
    yield descent, Step(lanes, descent.points.copy(), descent.misfits)
    for _ in range(MOST_STEPS):
        if descent.is_done.all() or not may_go_on():
            return
        yield descent, descent.step(evaluate)
