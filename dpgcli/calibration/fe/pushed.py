"""Chambers that pushes on their domes' axes open: mesh, patches, openings and angles.

What stands for a dome is one spring between its apex, which moves with the lid that bears the
dome, and the mean position of a patch of the neighbor's wall, so that the push can turn freely.
At rest the apex lies the dome's height behind the lid; the spring is a stroke too long.
"""

from dataclasses import dataclass

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.calibration.fe.bricks import Bricks, bricks, grid_lines
from dpgcli.calibration.fe.hinge import Chambers, is_solid, on_plane
from dpgcli.design.geometry import WALL_THICKNESS

PATCH_RADIUS = 0.21
"""Radius of the patch over the chamber's width: 4.2 mm of a chamber 20 mm wide."""

LINE_HEIGHT, LINE_DEPTH = 1 / 6, 1 / 8
"""Lines of the mesh about the patch, from the axis, over the chamber's width."""


@dataclass(frozen=True)
class Push:
    """A spring (N/mm) that is a stroke (mm) too long, in the place of a dome of a height (mm)."""

    stiffness: float
    stroke: float
    dome_height: float


@dataclass(frozen=True)
class Cells:
    """Cells of a mesh: along a chamber and a gap, up from the layer to the roof, across."""

    chamber: int
    gap: int
    up: tuple[int, int, int, int]
    across: tuple[int, int]


def pushed_bricks(chambers: Chambers, cells: Cells, n_chambers: int) -> Bricks:
    """Chambers on their layer, one brick through walls, lids and layer, with lines at the patch."""
    lines = _lines(chambers, cells, n_chambers)
    x, y, z = np.meshgrid(*((line[1:] + line[:-1]) / 2 for line in lines), indexing="ij")
    return bricks(lines, is_solid(chambers, x, y, z))


def _lines(chambers: Chambers, cells: Cells, n_chambers: int) -> tuple[Array, Array, Array]:
    wall, outer, width = WALL_THICKNESS, chambers.outer_length, chambers.width
    starts = chambers.pitch * np.arange(n_chambers)
    along = starts[:, None] + np.array([0.0, wall, wall + chambers.length, outer])
    counts = ((1, cells.chamber, 1, cells.gap) * n_chambers)[:-1]
    near, far = LINE_HEIGHT * width, (0.5 - LINE_HEIGHT) * width
    heights = np.cumsum([0.0, chambers.layer_thickness, far, near, near, far, wall])
    depths = np.cumsum([0.0, LINE_DEPTH * width, (0.5 - LINE_DEPTH) * width, wall])
    return (
        grid_lines(along.ravel(), counts),
        grid_lines(heights, (1, *cells.up, 1)),
        grid_lines(depths, (*cells.across, 1)),
    )


def lever(chambers: Chambers) -> float:
    """Height H in mm of the domes' axis over the middle of the layer.

    >>> lever(Chambers(9.0, 20.0, 0.75, 3.0, 1.5, 26.0))
    10.75
    """
    return (chambers.width + chambers.layer_thickness) / 2


def lid_nodes(chambers: Chambers, mesh: Bricks, gap: int) -> Indices:
    """Nodes of the lid before a gap, counted from 0, that move the dome: within W_c/2 of its axis.

    So far the dome's annulus reaches, out to the walls.
    """
    return _disc(chambers, mesh, gap * chambers.pitch + chambers.outer_length, 0.5)


def patch_nodes(chambers: Chambers, mesh: Bricks, gap: int) -> Indices:
    """Nodes of the patch of the wall behind a gap, counted from 0."""
    return _disc(chambers, mesh, (gap + 1) * chambers.pitch, PATCH_RADIUS)


def _disc(chambers: Chambers, mesh: Bricks, place: float, radius: float) -> Indices:
    """Nodes on a plane across the dome's axis, about it; the radius over the chamber's width."""
    axis = chambers.layer_thickness / 2 + lever(chambers)
    away = np.hypot(mesh.nodes[:, 1] - axis, mesh.nodes[:, 2])
    return np.flatnonzero(on_plane(mesh, 0, place) & (away < (radius + 1e-9) * chambers.width))


def ends(chambers: Chambers, push: Push, gap: int) -> Array:
    """Places at rest (2, 3) in mm of apex and patch of a gap, counted from 0."""
    lid = gap * chambers.pitch + chambers.outer_length
    axis = chambers.layer_thickness / 2 + lever(chambers)
    wall = lid + chambers.separation
    return np.array([[lid - push.dome_height, axis, 0.0], [wall, axis, 0.0]])


def opening(chambers: Chambers, mesh: Bricks, push: Push, displacements: Array, gap: int) -> Array:
    """How much farther apart in mm apex and patch are than at rest; displacements (..., n, 3)."""
    nodes = (lid_nodes(chambers, mesh, gap), patch_nodes(chambers, mesh, gap))
    rest = ends(chambers, push, gap)
    # z is a plane of symmetry: the other half moves the other way
    apex, patch = (
        rest[end, :2] + displacements[..., nodes[end], :2].mean(axis=-2) for end in (0, 1)
    )
    length = np.linalg.norm(patch - apex, axis=-1)
    return np.asarray(length - np.linalg.norm(rest[1] - rest[0]))


def floor_angle(chambers: Chambers, mesh: Bricks, displacements: Array, number: int) -> Array:
    """Angle in rad, counterclockwise, of the chord of a chamber's floor, counted from 0.

    Along the lower edge of the layer in the plane of symmetry, from wall to lid.
    """
    start, end = (
        np.flatnonzero(_is_at(mesh, (place, 0.0, 0.0))).item()
        for place in (
            number * chambers.pitch,
            number * chambers.pitch + chambers.outer_length,
        )
    )
    moved = mesh.nodes + displacements
    chord = moved[..., end, :] - moved[..., start, :]
    return np.asarray(np.arctan2(chord[..., 1], chord[..., 0]))


def clamped(mesh: Bricks) -> Flags:
    """Flags of the nodes of the first chamber's end face."""
    return on_plane(mesh, 0, 0.0)


def loaded(mesh: Bricks) -> Flags:
    """Flags of the nodes of the last chamber's end face."""
    return on_plane(mesh, 0, mesh.nodes[:, 0].max())


def _is_at(mesh: Bricks, point: tuple[float, float, float]) -> Flags:
    x, y, z = (on_plane(mesh, axis, place) for axis, place in enumerate(point))
    return x & y & z
