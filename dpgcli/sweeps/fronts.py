"""Pareto fronts: what nothing else is better than in every objective at once."""

from functools import reduce

import numpy as np

from dpgcli.arrays import Array, Flags

AT_ONCE = 2**16  # pairs that are compared rather than halved
PLANE = 2  # columns in which one pass in order finds what is below


def on_front(values: Array) -> Flags:
    """Which rows of objectives, (row, objective), are not dominated; the least values are best.

    A row is dominated by one that is nowhere worse and somewhere better, so that rows which are
    alike are on the front together. None of the values is NaN.

    >>> on_front(np.array([[1.0, 3.0], [2.0, 2.0], [2.0, 3.0], [1.0, 3.0]])).tolist()
    [True, True, False, True]

    Rows are taken in lexicographic order, in which none is dominated by a later one, and halved:
    what the front of the first half leaves of the second is asked for its own. Of n rows with
    k > 2 objectives that takes a time of n log(n)^(k - 2), also where all are on the front
    (Kung, Luccio and Preparata, J. ACM 22, 1975, 469).
    """
    order = np.lexsort(values.T[::-1])
    ordered = values[order]
    is_new = np.ones(len(ordered), bool)
    is_new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    distinct = ordered[is_new][:, 1:]  # the first is in order, and rows that differ are dominated
    found = _least_yet(distinct[:, 0]) if distinct.shape[1] == 1 else _undominated(distinct)
    is_on_front = np.empty(len(values), bool)
    is_on_front[order] = found[np.cumsum(is_new) - 1]
    return is_on_front


def _least_yet(column: Array) -> Flags:
    """Which values are less than all before."""
    before = np.concatenate(([np.inf], np.minimum.accumulate(column)[:-1]))
    found = column < before
    found[:1] = True
    return np.asarray(found)


def _undominated(rows: Array) -> Flags:
    """Which rows have no earlier one that is nowhere larger."""
    if len(rows) ** 2 <= AT_ONCE:
        return np.asarray(~np.triu(_are_below(rows, rows), 1).any(axis=0))
    middle = len(rows) // 2
    first, rest = rows[:middle], rows[middle:]
    found = np.zeros(len(rows), bool)
    found[:middle] = _undominated(first)
    left = np.flatnonzero(~_have_one_below(rest, first[found[:middle]]))
    found[middle + left] = _undominated(rest[left])
    return found


def _have_one_below(rows: Array, front: Array) -> Flags:
    """Which rows have one of the front that is nowhere larger.

    Halves by the first column: in it the lower one is below the higher, and never the other way.
    """
    if len(rows) * len(front) <= AT_ONCE:
        return np.asarray(_are_below(front, rows).any(axis=0))
    n_front, both = len(front), np.concatenate([front, rows])
    order = np.argsort(both[:, 0], kind="stable")  # of equal ones those of the front are first
    found = np.zeros(len(both), bool)
    if both.shape[1] == PLANE:
        seen = np.where(order < n_front, both[order, 1], np.nan)
        found[order] = np.fmin.accumulate(seen) <= both[order, 1]
        return found[n_front:]
    low, high = np.split(order, [len(order) // 2])
    lower, low_rows = low[low < n_front], low[low >= n_front]
    higher, high_rows = high[high < n_front], high[high >= n_front]
    found[low_rows] = _have_one_below(both[low_rows], both[lower])
    found[high_rows] = _have_one_below(both[high_rows, 1:], both[lower, 1:])
    left = high_rows[~found[high_rows]]
    found[left] = _have_one_below(both[left], both[higher])
    return found[n_front:]


def _are_below(rows: Array, others: Array) -> Flags:
    """Which rows are nowhere larger than which others, (row, other)."""
    pairs = (row[:, None] <= other for row, other in zip(rows.T, others.T, strict=True))
    return reduce(np.logical_and, pairs)
