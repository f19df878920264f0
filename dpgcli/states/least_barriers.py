"""Ways between states by flips of single units, over the least barriers.

Of all ways the best is that whose largest barrier is the least, and of those the one whose barriers
add up to the least. Barriers within `barriers.TIE` are taken as equal, so that rounding decides
nothing: of ways as good the one whose first units come first is taken, and their number is told.
"""

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, distinct
from dpgcli.records import dataclass
from dpgcli.states.barriers import TIE

LEVELS = 2.0**40  # whole numbers, so that sums are exact


@dataclass(frozen=True)
class BestWay:
    """The units to flip one after the other, and how many ways are as good, itself among them."""

    units: tuple[int, ...]
    n_ways: int


def best_way(barrier: Array, start: int, end: int) -> BestWay | None:
    """The way over the least barriers from one state to another, by their codes; None if none.

    `barrier` (unit, state) is that of each unit in each of the 2^n states, NaN where there is none.

    >>> up = [[1.0, 4.0, np.nan, np.nan], [2.0, np.nan, 3.0, np.nan]]  # unit 1, unit 2
    >>> best_way(np.array(up), 0b00, 0b11)
    BestWay(units=(0, 1), n_ways=1)
    """
    if start == end:
        return BestWay((), 1)
    weights = _levels(barrier)
    known = distinct(weights[np.isfinite(weights)])
    low, high = 0, len(known)  # the least threshold that lets a way through is within
    while low < high:
        middle = (low + high) // 2
        is_through = np.isfinite(_distances(weights, known[middle], end)[start])
        low, high = (low, middle) if is_through else (middle + 1, high)
    if low == len(known):
        return None
    onward = _onward(weights, known[low], end)
    return BestWay(_first(onward, start, end), _count(onward, start, end))


def _levels(barrier: Array) -> Array:
    """Barriers as whole numbers, those that tie by the same; infinite where there is none."""
    known = distinct(barrier[np.isfinite(barrier)])
    if not len(known):
        return np.full(barrier.shape, np.inf)
    is_first = np.concatenate(([True], known[1:] > (1.0 + TIE) * known[:-1]))
    level = known[is_first][np.cumsum(is_first) - 1]
    level = np.maximum(np.round(level / known[-1] * LEVELS), 1.0)
    place = np.searchsorted(known, np.where(np.isfinite(barrier), barrier, known[0]))
    return np.where(np.isfinite(barrier), level[place], np.inf)


def _neighbors(shape: tuple[int, ...]) -> Indices:
    """Codes of the states with one unit flipped, (unit, state)."""
    n_units, n_states = shape
    return np.arange(n_states) ^ (1 << np.arange(n_units - 1, -1, -1))[:, None]


def _distances(weights: Array, most: float, end: int) -> Array:
    """The least sum of weights, none above `most`, from each state to the end."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    unit, state = np.nonzero(weights <= most)
    n_states = weights.shape[1]
    backwards = _neighbors(weights.shape)[unit, state], state
    graph = coo_array((weights[unit, state], backwards), shape=(n_states, n_states))
    return np.asarray(dijkstra(graph.tocsr(), indices=np.array([end]))[0])


@dataclass(frozen=True)
class _Onward:
    """Which units' flips lead on, (unit, state), to which states, and how far these are."""

    leads: Flags
    neighbor: Indices
    distance: Array


def _onward(weights: Array, most: float, end: int) -> _Onward:
    distance, neighbor = _distances(weights, most, end), _neighbors(weights.shape)
    is_next = (weights <= most) & np.isfinite(distance)
    return _Onward(is_next & (weights + distance[neighbor] == distance), neighbor, distance)


def _first(onward: _Onward, start: int, end: int) -> tuple[int, ...]:
    """The way whose first units come first."""
    units, here = [], start
    while here != end:
        units.append(int(onward.leads[:, here].argmax()))
        here = int(onward.neighbor[units[-1], here])
    return tuple(units)


def _count(onward: _Onward, start: int, end: int) -> int:
    """How many ways are as good: those of all neighbors that lead on, from the end backwards."""
    ways = {end: 1}
    for state in np.argsort(onward.distance, kind="stable").tolist():
        leading = onward.neighbor[onward.leads[:, state], state].tolist()
        if leading:
            ways[state] = sum(ways[one] for one in leading)
    return ways[start]
