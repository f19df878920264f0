"""Quadratic elements of the serendipity family: their nodes, shape functions and quadrature.

Nodes are numbered as CalculiX has them: corners first, then midpoints of edges (CalculiX
CrunchiX manual 2.20, sections "Eight-node axisymmetric element" and "Twenty-node brick element").
"""

import numpy as np

from dpgcli.arrays import Array, Indices

QUAD = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0)])
"""Local coordinates of the eight nodes of a quadrilateral, counterclockwise, shape (8, 2)."""

BRICK: Indices = np.array(
    [
        *((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)),
        *((1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2)),
        *((0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1)),
    ]
)
"""The twenty nodes of a brick in half edges from its first corner, shape (20, 3)."""

END_FACE: Indices = np.array([1, 2, 6, 5, 9, 18, 13, 17])
"""The nodes of a brick's face at the end of its first axis, in the order of a quadrilateral."""


def gauss(n_points: int) -> tuple[Array, Array]:
    """Points (n^2, 2) and weights (n^2,) of the product rule on the square from -1 to 1.

    >>> points, weights = gauss(2)
    >>> points.shape, round(float(weights.sum()), 12)
    ((4, 2), 4.0)
    """
    points, weights = np.polynomial.legendre.leggauss(n_points)
    x, y = np.meshgrid(points, points, indexing="ij")
    return np.stack([x.ravel(), y.ravel()], axis=1), np.outer(weights, weights).ravel()


def quad_shapes(points: Array) -> Array:
    """Shape functions of the eight nodes at local points (p, 2): an array (p, 8).

    N = (1 + x x_i)(1 + y y_i)(x x_i + y y_i - 1)/4 at corners, (1 - x^2)(1 + y y_i)/2 and
    (1 + x x_i)(1 - y^2)/2 at midpoints.

    >>> quad_shapes(np.array([[0.0, 0.0]]))[0].tolist()
    [-0.25, -0.25, -0.25, -0.25, 0.5, 0.5, 0.5, 0.5]
    """
    x, y = points[:, :1], points[:, 1:]
    nx, ny = QUAD.T
    corner = (1 + x * nx) * (1 + y * ny) * (x * nx + y * ny - 1) / 4
    across = (1 - x**2) * (1 + y * ny) / 2
    along = (1 + x * nx) * (1 - y**2) / 2
    return np.asarray(np.where(nx * ny != 0, corner, np.where(nx == 0, across, along)))


def quad_slopes(points: Array) -> Array:
    """Derivatives of the shape functions with respect to both local coordinates: (p, 8, 2).

    >>> quad_slopes(np.array([[0.0, 0.0]]))[0, 5:8:2, 0].tolist()
    [0.5, -0.5]
    """
    x, y = points[:, :1], points[:, 1:]
    nx, ny = QUAD.T
    corner = (
        nx * (1 + y * ny) * (2 * x * nx + y * ny) / 4,
        ny * (1 + x * nx) * (2 * y * ny + x * nx) / 4,
    )
    across = (-x * (1 + y * ny), (1 - x**2) * ny / 2)
    along = (nx * (1 - y**2) / 2, -y * (1 + x * nx))
    slopes = [
        np.where(nx * ny != 0, c, np.where(nx == 0, a, b))
        for c, a, b in zip(corner, across, along, strict=True)
    ]
    return np.stack(slopes, axis=-1)
