"""Objectives and constraints over whole maps: SciPy's SLSQP from many starts in lockstep.

Several objectives f are brought to one by the largest weighted distance from the ideal point z,
min t with w (f − z) <= t for each: with other weights, to other points of the front, those of its
dents included (Miettinen, Nonlinear Multiobjective Optimization, 1999, section 3.4).
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.records import dataclass
from dpgcli.search.lockstep import Ask, in_lockstep

ROOM = 1e-6  # of its size, by which a margin is kept above zero: rounding must not break a rule
NOWHERE = 1e3  # objective and lack of margin, in their sizes, where there is no such finger
PRECISION = 1e-9
MOST_STEPS = 50
MOST_ASKED = 100  # points of a search: on the kinks of extremes it would turn about for long
MOST_WEIGHTS = 15
MOST_AT_ONCE = 256  # threads
HALVINGS = 12  # of the way: where a count changes is found to so much


class _EnoughError(Exception):
    """A search has asked often enough."""


class Local(NamedTuple):
    """What there is at a point: objectives, margins, and their slopes (…, coordinate); or NaN."""

    objectives: Array
    objective_slopes: Array
    margins: Array
    margin_slopes: Array


Evaluate = Callable[[Array, Indices], Sequence[Local]]


@dataclass(frozen=True)
class Scalar:
    """One number out of several objectives: the largest weighted distance from the ideal point.

    Those of no weight do not count.
    """

    weights: Array
    ideal: Array

    @property
    def places(self) -> Indices:
        """The objectives that count."""
        return np.flatnonzero(self.weights)

    def of(self, objectives: Array) -> Array:
        """That of objectives (objective, …)."""
        return np.asarray(self.distances(objectives).max(axis=0))

    def distances(self, objectives: Array) -> Array:
        """Weighted distances of the objectives that count, (objective, …)."""
        own, shape = self.places, (-1, *([1] * (objectives.ndim - 1)))
        apart = objectives[own] - self.ideal[own].reshape(shape)
        return np.asarray(self.weights[own].reshape(shape) * apart)


def simplex(n_objectives: int) -> list[Array]:
    """Weights of objectives, evenly spread, each above zero; at most `MOST_WEIGHTS` of them.

    >>> [weights.round(2).tolist() for weights in simplex(2)][:2]
    [[0.03, 0.97], [0.1, 0.9]]
    """
    n_steps = MOST_WEIGHTS - 1 if n_objectives == 2 else 4 if n_objectives == 3 else 1
    bars = combinations(range(n_steps + n_objectives - 1), n_objectives - 1)
    found = [np.diff([-1, *each, n_steps + n_objectives - 1]) - 1 for each in bars]
    return [(each + 0.5) / (n_steps + 0.5 * n_objectives) for each in found]


def descend_within(
    evaluate: Evaluate, starts: Array, scalars: Sequence[Scalar], sizes: Array
) -> Array:
    """Ends (coordinate, search) of searches from starts in the unit box, each with its scalar.

    `sizes` are those of margins, by which they are measured.
    """

    ends = starts.copy()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Values in x were outside bounds")  # which it mends
        for first in range(0, starts.shape[1], MOST_AT_ONCE):
            some = np.arange(first, min(first + MOST_AT_ONCE, starts.shape[1]))

            def search(number: int, ask: Ask[Local], some: Indices = some) -> Array:
                place = some[number]
                return _search(ask, starts[:, place], scalars[place], sizes)

            def answers(points: Array, numbers: Indices, some: Indices = some) -> Sequence[Local]:
                return evaluate(points, some[numbers])

            ends[:, some] = np.stack(in_lockstep(search, len(some), answers), axis=1)
    return ends


def _search(ask: Ask[Local], start: Array, scalar: Scalar, sizes: Array) -> Array:
    """One search by SLSQP; with several objectives the bound t is one coordinate more."""
    n = len(start)
    own = scalar.places
    several = len(own) > 1
    asked: dict[bytes, Local] = {}

    def at(x: Array) -> Local:
        point = np.clip(x[:n], 0.0, 1.0)
        key = point.tobytes()
        if key not in asked:
            if len(asked) == MOST_ASKED:
                raise _EnoughError
            asked[key] = _somewhere(ask(point))
        return asked[key]

    def value(x: Array) -> float:
        return float(x[n]) if several else float(scalar.of(at(x).objectives))

    def slope(x: Array) -> Array:
        if several:
            return np.asarray(np.eye(n + 1)[n])
        return np.asarray(scalar.weights[own[0]] * at(x).objective_slopes[own[0]])

    def room(x: Array) -> Array:
        here = at(x)
        rooms = here.margins / sizes - ROOM
        if not several:
            return rooms
        return np.concatenate((rooms, x[n] - scalar.distances(here.objectives)))

    def room_slopes(x: Array) -> Array:
        here = at(x)
        slopes = here.margin_slopes / sizes[:, None]
        if not several:
            return slopes
        rows = np.concatenate((slopes, -scalar.weights[own, None] * here.objective_slopes[own]))
        last = np.concatenate((np.zeros(len(slopes)), np.ones(len(own))))
        return np.column_stack((rows, last))

    begin = np.append(start, scalar.of(at(start).objectives)) if several else start
    bounds = [(0.0, 1.0)] * n + [(None, None)] * several
    has_rules = several or len(at(start).margins)
    rules = [{"type": "ineq", "fun": room, "jac": room_slopes}] if has_rules else []
    options = {"maxiter": MOST_STEPS, "ftol": PRECISION}
    try:
        found = minimize(  # type: ignore[call-overload]  # whose stubs take fewer arrays
            value,
            begin,
            jac=slope,
            bounds=bounds,
            constraints=rules,
            method="SLSQP",
            options=options,
        )
    except _EnoughError:
        return _least(asked, scalar, sizes)
    return np.asarray(np.clip(found.x[:n], 0.0, 1.0))


def _least(asked: Mapping[bytes, Local], scalar: Scalar, sizes: Array) -> Array:
    """The best point of those that were asked about: that lacks least, and is least of these."""

    def rank(point: bytes) -> tuple[float, float]:
        rooms = asked[point].margins / sizes
        return float(np.maximum(-rooms, 0.0).sum()), float(scalar.of(asked[point].objectives))

    return np.frombuffer(min(asked, key=rank))


def _somewhere(here: Local) -> Local:
    """What there is, or far too much where there is no such finger, so that a step is shortened."""
    objectives, objective_slopes, margins, margin_slopes = here
    if np.isnan(objectives).any() or np.isnan(margins).any():
        objectives, margins = np.full(objectives.shape, NOWHERE), np.full(margins.shape, -NOWHERE)
    slopes = (np.nan_to_num(each) for each in (objective_slopes, margin_slopes))
    first, second = slopes
    return Local(objectives, first, margins, second)


def last_that_hold(hold: Callable[[Array], Flags], starts: Array, ends: Array) -> Array:
    """The last points (coordinate, search) on the way from starts to ends where all rules hold.

    Those of starts where they hold; what holds at its end stays there. For rules that have no
    slope, such as those over counts.
    """
    near, far = np.zeros(starts.shape[1]), np.ones(starts.shape[1])
    near = np.where(hold(ends), 1.0, near)
    for _ in range(HALVINGS):
        middle = 0.5 * (near + far)
        holds = hold(starts + middle * (ends - starts))
        near, far = np.where(holds, middle, near), np.where(holds, far, middle)
    return np.asarray(starts + near * (ends - starts))
