"""Pareto fronts: what nothing else is better than in every objective at once."""

from functools import reduce

import numpy as np

from dpgcli.arrays import Array, Flags

AT_ONCE = 2**22  # pairs that are compared
ROWS_AT_ONCE = 2**11


def on_front(values: Array) -> Flags:
    """Which rows of objectives, (row, objective), are not dominated; the least values are best.

    A row is dominated by one that is nowhere worse and somewhere better, so that rows which are
    alike are on the front together. None of the values is NaN.

    >>> on_front(np.array([[1.0, 3.0], [2.0, 2.0], [2.0, 3.0], [1.0, 3.0]])).tolist()
    [True, True, False, True]

    Rows are taken in lexicographic order, in which none is dominated by a later one: each has to
    be compared with the front so far alone (Kung, Luccio and Preparata, J. ACM 22, 1975, 469).
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
    found = np.ones(len(rows), bool)
    front = np.empty((0, rows.shape[1]))
    for first in range(0, len(rows), ROWS_AT_ONCE):
        block = rows[first : first + ROWS_AT_ONCE]
        place = np.flatnonzero(~_have_one_below(block, front))
        place = place[~np.triu(_are_below(block[place], block[place]), 1).any(axis=0)]
        found[first : first + len(block)] = False
        found[first + place] = True
        front = np.concatenate([front, block[place]])
    return found


def _have_one_below(rows: Array, front: Array) -> Flags:
    """Which rows have one of the front that is nowhere larger."""
    found = np.zeros(len(rows), bool)
    step = max(1, AT_ONCE // max(1, len(rows)))
    for first in range(0, len(front), step):
        left = np.flatnonzero(~found)
        found[left] = _are_below(front[first : first + step], rows[left]).any(axis=0)
    return found


def _are_below(rows: Array, others: Array) -> Flags:
    """Which rows are nowhere larger than which others, (row, other)."""
    pairs = (row[:, None] <= other for row, other in zip(rows.T, others.T, strict=True))
    return reduce(np.logical_and, pairs)
