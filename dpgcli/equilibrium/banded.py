"""Symmetric banded matrices, factorized in batches: A = L D Lᵀ, batch index innermost.

Storage: `band[k, j]` holds A[j+k, j] for the whole batch, shape (bandwidth + 1, size, batch).
`column_depths[j]` says how far down column j may be nonzero, fill-in included; less than the
bandwidth where the matrix is sparser there. There is no pivoting: the signs of D are the
signs of the eigenvalues (Sylvester's law of inertia), and a positive definite matrix
needs none. One singular matrix spoils its own lane only, and nobody is warned of it: the
signs of its pivots tell.
"""

from dataclasses import dataclass

import numpy as np

from dpgcli.arrays import Array, Indices

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
    for column, depth in enumerate(column_depths):
        if depth == 0:
            continue
        below = band[1 : depth + 1, column].copy()
        factors = np.divide(below, band[0, column], out=band[1 : depth + 1, column])
        for k in range(depth):  # along diagonals: rows side by side in memory
            updated = band[k, column + 1 : column + 1 + depth - k]
            updated -= below[k:] * factors[: depth - k]
    return Factorization(band[1:], band[0], column_depths)


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
    for column in range(len(factorization.column_depths) - 1, -1, -1):
        for k in range(factorization.column_depths[column]):
            y[column] -= lower[k, column] * y[column + 1 + k]
    return y
