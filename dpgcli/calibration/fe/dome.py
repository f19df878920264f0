"""A dome on a flat annulus as an axisymmetric mesh of eight-node quadrilaterals."""

import math

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.records import dataclass


@dataclass(frozen=True)
class DomeShape:
    """A spherical cap on an annulus whose outer edge is fixed; mm, MPa.

    Height and base diameter are those of the mid-surface; the material is neo-Hookean.
    """

    height: float
    thickness: float
    elastic_modulus: float
    poisson: float = 0.48
    base_diameter: float = 16.0
    rim_radius: float = 10.0


@dataclass(frozen=True)
class DomeMesh:
    """Nodes (n, 2) at rest as (r, z) in mm and elements (m, 8), numbered from 0.

    `loaded` are the elements whose second edge lies on the convex side, from pole to rim; `fixed`
    the nodes of the outer edge, `axis` those on the axis, `pole` the one at mid-thickness.
    """

    nodes: Array
    elements: Indices
    loaded: Indices
    fixed: Indices
    axis: Indices
    pole: int


def sphere_radius(dome: DomeShape) -> float:
    """Radius R = (a^2 + h^2)/(2 h) in mm of the mid-surface over a base of radius a.

    >>> sphere_radius(DomeShape(height=8.0, thickness=0.75, elastic_modulus=26.0))
    8.0
    """
    return ((dome.base_diameter / 2) ** 2 + dome.height**2) / (2 * dome.height)


def edge_angles(dome: DomeShape) -> tuple[float, float]:
    """Polar angles of the joint between the faces of cap and annulus, inner and outer.

    The faces are spheres of radius R -+ t/2, cut by the planes z = -+ t/2: the joint is a miter,
    so the wall has its thickness on both sides. Raises ValueError where they do not meet.
    """
    radius, half = sphere_radius(dome), dome.thickness / 2
    cosines = [
        (side * half - dome.height + radius) / (radius + side * half) for side in (-1.0, 1.0)
    ]
    if not (radius > half and all(-1.0 < cosine < 1.0 for cosine in cosines)):
        raise ValueError("it is too thick: its faces do not meet those of the annulus")
    return math.acos(cosines[0]), math.acos(cosines[1])


def impossible(dome: DomeShape) -> str:
    """Why there can be no such dome, empty if there can."""
    try:
        joint = joint_radius(dome)
    except ValueError as error:
        return str(error)
    if dome.rim_radius <= joint:
        return f"its rim lies within r = {joint:.4g} mm, where the dome ends"
    return ""


def joint_radius(dome: DomeShape) -> float:
    """Largest radius in mm of the joint between cap and annulus; the rim must lie beyond it."""
    _, outer = edge_angles(dome)
    widest = math.sin(min(outer, math.pi / 2))  # more than half a sphere overhangs its base
    return (sphere_radius(dome) + dome.thickness / 2) * widest


def dome_mesh(dome: DomeShape, n_cap: int, n_annulus: int, n_thickness: int) -> DomeMesh:
    """A structured mesh: cells along the cap, along the annulus, and through the wall."""
    n_along = n_cap + n_annulus
    inner, outer = edge_angles(dome)
    side = np.linspace(-1.0, 1.0, 2 * n_thickness + 1)
    angle = inner + (outer - inner) * (side + 1) / 2
    radius = sphere_radius(dome) + side * dome.thickness / 2
    center = dome.height - sphere_radius(dome)
    turned = np.linspace(0.0, 1.0, 2 * n_cap + 1)[:, None] * angle
    cap = np.stack([radius * np.sin(turned), center + radius * np.cos(turned)], axis=-1)
    cap[0, :, 0] = 0.0
    rim = np.stack([np.full_like(side, dome.rim_radius), side * dome.thickness / 2], axis=-1)
    way = np.linspace(0.0, 1.0, 2 * n_annulus + 1)[1:, None, None]
    points = np.concatenate([cap, cap[-1] + way * (rim - cap[-1])])
    return _numbered(points, n_along, n_thickness)


def _numbered(points: Array, n_along: int, n_thickness: int) -> DomeMesh:
    """The mesh of a grid of points (2 n_along + 1, 2 n_thickness + 1, 2), centers left out."""
    first, second = np.indices(points.shape[:2])
    is_node = (first % 2 == 0) | (second % 2 == 0)
    number = np.where(is_node, np.cumsum(is_node).reshape(is_node.shape) - 1, -1)
    # local x runs through the wall and local y backwards along it: counterclockwise in (r, z)
    offsets = [(0, 0), (0, 2), (-2, 2), (-2, 0), (0, 1), (-1, 2), (-2, 1), (-1, 0)]
    i, j = (2 * k for k in np.indices((n_along, n_thickness)).reshape(2, -1))
    elements = np.stack([number[i + 2 + di, j + dj] for di, dj in offsets], axis=1)
    column = np.arange(n_along) * n_thickness + n_thickness - 1
    return DomeMesh(
        nodes=points[is_node],
        elements=elements,
        loaded=column,
        fixed=number[-1],
        axis=number[0],
        pole=int(number[0, n_thickness]),
    )
