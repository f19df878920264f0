"""Symmetric banded matrices, factorized in batches: A = L D Lᵀ, batch index innermost.

Storage: `band[k, j]` holds A[j+k, j] for the whole batch, shape (bandwidth + 1, size, batch).
`column_depths[j]` says how far down column j may be nonzero, fill-in included; less than the
bandwidth where the matrix is sparser there. There is no pivoting: the signs of D are the
signs of the eigenvalues (Sylvester's law of inertia), and a positive definite matrix
needs none. One singular matrix spoils its own lane only, and nobody is warned of it: the
signs of its pivots tell.
"""

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.records import dataclass

WIDE, SMALL = 8, 2**14  # of bands: depth; numbers in a column of all lanes

in_lanes = np.errstate(
    divide="ignore", invalid="ignore", over="ignore"
)  # one lane's division by zero is its own


@dataclass(frozen=True)
class Factorization:
    """A = L D Lᵀ: `lower` is L strictly below its diagonal, as a band (bandwidth, size, batch).

    `pivots` are D, (size, batch); all are positive where A is positive definite.
    """

    lower: Array
    pivots: Array
    column_depths: tuple[int, ...]

    @property
    def n_negative(self) -> Indices:
        """How many eigenvalues are negative, (batch,)."""
        return np.asarray((self.pivots < 0.0).sum(axis=0))


@in_lanes
def factorize(band: Array, column_depths: tuple[int, ...]) -> Factorization:
    """Factorize a symmetric band, (bandwidth + 1, size, batch), in place; `band` is used up.

    Golub and Van Loan, Matrix Computations, 4th ed., 2013, sections 4.1.2 and 4.3.

    >>> band = np.array([[[4.0], [3.0]], [[2.0], [0.0]]])  # [[4, 2], [2, 3]]
    >>> factorize(band, (1, 0)).pivots.ravel()
    array([4., 2.])
    """
    if _is_wide(band.shape):
        return _factorize_wide(band, column_depths)
    for column, depth in enumerate(column_depths):
        if depth == 0:
            continue
        below = band[1 : depth + 1, column].copy()
        factors = np.divide(below, band[0, column], out=band[1 : depth + 1, column])
        for k in range(depth):  # along diagonals: rows side by side in memory
            updated = band[k, column + 1 : column + 1 + depth - k]
            updated -= below[k:] * factors[: depth - k]
    return Factorization(band[1:], band[0], column_depths)


def _is_wide(shape: tuple[int, ...]) -> bool:
    """Whether so many small steps would take longer than to work on halves that are not needed."""
    depth, _, batch = shape
    return depth > WIDE + 1 and depth * batch <= SMALL


def _factorize_wide(band: Array, column_depths: tuple[int, ...]) -> Factorization:
    """The same by whole squares, A[r, c] at once for r < c, too: these are in rows before the band.

    Lanes have the same bits as one by one.
    """
    padded = np.concatenate((np.zeros_like(band), band))
    own = padded[len(band) :]
    square = _square(own)
    for column, depth in enumerate(column_depths):
        if depth == 0:
            continue
        below = own[1 : depth + 1, column].copy()
        factors = np.divide(below, own[0, column], out=own[1 : depth + 1, column])
        beyond = slice(column + 1, column + 1 + depth)
        square[beyond, beyond] -= below[:, None] * factors
    return Factorization(own[1:], own[0], column_depths)


def _square(own: Array) -> Array:
    """A[r, c], (size, size, batch), as a view of its band: only within the band is it there."""
    by_depth, by_column, by_lane = own.strides
    shape, strides = (own.shape[1], *own.shape[1:]), (by_depth, by_column - by_depth, by_lane)
    return np.lib.stride_tricks.as_strided(own, shape, strides)


@in_lanes
def forward(factorization: Factorization, right_hand_sides: Array) -> Array:
    """Overwrite b with y = L⁻¹ b; shape (size, batch) or (size, number, batch).

    >>> band = np.array([[[4.0], [3.0]], [[2.0], [0.0]]])  # [[4, 2], [2, 3]], L_21 = 1/2
    >>> forward(factorize(band, (1, 0)), np.array([[8.0], [8.0]])).ravel()
    array([8., 4.])
    """
    y = right_hand_sides
    lower = factorization.lower
    for column, depth in enumerate(factorization.column_depths):
        if depth:
            factors = lower[:depth, column]
            if y.ndim == 3:
                factors = factors[:, None]
            y[column + 1 : column + 1 + depth] -= factors * y[column]
    return y


@in_lanes
def backward(factorization: Factorization, y: Array) -> Array:
    """Overwrite y with x = L⁻ᵀ y, shape (size, batch).

    >>> factorization = factorize(np.array([[[4.0], [3.0]], [[2.0], [0.0]]]), (1, 0))
    >>> y = forward(factorization, np.array([[8.0], [8.0]])) / factorization.pivots
    >>> backward(factorization, y).ravel()  # 4 + 2·2 = 8, 2 + 3·2 = 8
    array([1., 2.])
    """
    lower = factorization.lower
    if len(lower) > WIDE:  # whatever the batch: the order of sums is another
        return _backward_wide(factorization, y)
    for column in range(len(factorization.column_depths) - 1, -1, -1):
        for k in range(factorization.column_depths[column]):
            y[column] -= lower[k, column] * y[column + 1 + k]
    return y


def _backward_wide(factorization: Factorization, y: Array) -> Array:
    """The same, each unknown taken out of all equations before it at once: Lᵀ by columns."""
    below = _square(factorization.lower)  # L from its second row on
    for row in range(len(y) - 1, 0, -1):
        before = slice(max(0, row - len(factorization.lower)), row)
        factors = below[row - 1, before]
        if y.ndim == 3:
            factors = factors[:, None]
        y[before] -= factors * y[row]
    return y
