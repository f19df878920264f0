"""Strain energy and volume of a deformed axisymmetric mesh, from displacements alone.

CalculiX sums its own energies over increments, and they drift when it cuts one back.
"""

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.fe.dome import DomeMesh, DomeShape
from dpgcli.calibration.fe.elements import QUAD, gauss, quad_shapes, quad_slopes


def moduli(elastic_modulus: float, poisson: float) -> tuple[float, float]:
    """Shear and bulk modulus, G = E/(2 (1 + nu)) and K = E/(3 (1 - 2 nu)), in MPa.

    >>> moduli(3.0, 0.25)
    (1.2, 2.0)
    """
    return elastic_modulus / (2 * (1 + poisson)), elastic_modulus / (3 * (1 - 2 * poisson))


def strain_energy(dome: DomeShape, mesh: DomeMesh, displacements: Array) -> Array:
    """Strain energy in mJ of the whole dome at displacements (..., n, 2) in mm.

    W = G/2 (J^(-2/3) tr C - 3) + K/2 (J - 1)^2 per volume at rest, CalculiX's neo-Hookean form,
    at the four points of reduced integration, where its forces are this energy's derivatives.
    """
    points, weights = gauss(2)
    shapes, slopes = quad_shapes(points), quad_slopes(points)
    rest = mesh.nodes[mesh.elements]
    shift = displacements[..., mesh.elements, :]
    tangents = np.einsum("enx,pnl->epxl", rest, slopes)
    strain = np.einsum("...enx,pnl->...epxl", shift, slopes) @ np.linalg.inv(tangents)
    gradient = np.eye(2) + strain
    radius = rest[..., 0] @ shapes.T
    hoop = 1 + (shift[..., 0] @ shapes.T) / radius
    volume = 2 * np.pi * radius * np.linalg.det(tangents) * weights
    shear, bulk = moduli(dome.elastic_modulus, dome.poisson)
    dilation = np.linalg.det(gradient) * hoop
    squares = (gradient**2).sum(axis=(-2, -1)) + hoop**2
    density = shear / 2 * (np.cbrt(dilation) ** -2 * squares - 3) + bulk / 2 * (dilation - 1) ** 2
    return np.asarray((density * volume).sum(axis=(-2, -1)))


def swept_volume(mesh: DomeMesh, displacements: Array) -> Array:
    """Volume in mm^3 that the convex side has swept towards inversion at displacements (..., n, 2).

    The loss of V = integral of pi r^2 dz below the loaded edges. Its end is fixed, so a pressure p
    does the work of integral p dV on it.
    """
    edge = mesh.elements[mesh.loaded][:, QUAD[:, 0] == 1]
    rest = mesh.nodes[edge]
    moved = rest + displacements[..., edge, :]
    return np.asarray(_below(moved) - _below(rest))


def _below(edges: Array) -> Array:
    """Minus the volume below edges (..., m, 3, 2), nodes in the order corner, corner, middle."""
    points, weights = np.polynomial.legendre.leggauss(3)  # exact: degree 2 + 2 + 1
    local = np.stack([np.ones_like(points), points], axis=1)
    on_edge = QUAD[:, 0] == 1
    r = edges[..., 0] @ quad_shapes(local)[:, on_edge].T
    slope = edges[..., 1] @ quad_slopes(local)[:, on_edge, 1].T
    return np.asarray(-(np.pi * r**2 * slope * weights).sum(axis=(-2, -1)))
