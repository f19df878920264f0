"""Chambers that pushes on their domes' axes open: mesh, patches, openings and angles.

What stands for a dome is one spring between its apex and the mean position of a patch of the
neighbor's wall, so that the push can turn freely. The apex lies the dome's height behind the lid
that bears the dome, as at rest, and shifts and turns with chamber and lid; the spring is a stroke
too long.
"""

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.calibration.fe.bricks import Bricks, bricks, grid_lines
from dpgcli.calibration.fe.hinge import HingeChambers, is_solid, on_plane
from dpgcli.design.geometry import WALL_THICKNESS, segment_height
from dpgcli.records import dataclass

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
class MeshCells:
    """Cells of a mesh: along a chamber and a gap, up from the layer to the roof, across."""

    chamber: int
    gap: int
    up: tuple[int, int, int, int]
    across: tuple[int, int]


def pushed_bricks(chambers: HingeChambers, cells: MeshCells, n_chambers: int) -> Bricks:
    """Chambers on their layer, one brick through walls, lids and layer, with lines at the patch."""
    lines = _lines(chambers, cells, n_chambers)
    x, y, z = np.meshgrid(*((line[1:] + line[:-1]) / 2 for line in lines), indexing="ij")
    return bricks(lines, is_solid(chambers, x, y, z))


def _lines(
    chambers: HingeChambers, cells: MeshCells, n_chambers: int
) -> tuple[Array, Array, Array]:
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


def lever(chambers: HingeChambers) -> float:
    """Height H in mm of the domes' axis over the middle of the layer.

    >>> lever(HingeChambers(9.0, 20.0, 0.75, 3.0, 1.5, 26.0))
    10.75
    """
    return segment_height(chambers.width, chambers.layer_thickness)


@dataclass(frozen=True)
class End:
    """An end of a spring: a point that shifts by the mean of nodes and turns with them.

    Its displacement is (sum s u_x - r u_y, sum s u_y + r u_x), linear, and that of a body where
    the nodes move as one, however far they turn. `place` (3,) in mm at rest; `shifts` and `turns`
    are s and r of the nodes.
    """

    place: Array
    nodes: Indices
    shifts: Array
    turns: Array

    def moved(self, displacements: Array) -> Array:
        """The place (..., 2) in mm at displacements (..., n, 3).

        The other half of the model moves as this one in the plane of symmetry.
        """
        x, y = displacements[..., self.nodes, 0], displacements[..., self.nodes, 1]
        across = self.place[0] + x @ self.shifts - y @ self.turns
        up = self.place[1] + y @ self.shifts + x @ self.turns
        return np.stack([across, up], axis=-1)


def apex(chambers: HingeChambers, mesh: Bricks, push: Push, gap: int) -> End:
    """The apex of the dome before a gap, counted from 0.

    It shifts with the lid within W_c/2 of the dome's axis, as far as the dome's annulus reaches,
    and turns with the upper and lower edges of the chamber's side.
    """
    lid = gap * chambers.pitch + chambers.outer_length
    disc, edges = _disc(chambers, mesh, lid, 0.5), _side_edges(chambers, mesh, gap)
    up = mesh.nodes[edges, 1] - _axis(chambers)
    return End(
        place=np.array([lid - push.dome_height, _axis(chambers), 0.0]),
        nodes=np.concatenate([disc, edges]),
        shifts=np.concatenate([_equal(disc), np.zeros(len(edges))]),
        turns=np.concatenate([np.zeros(len(disc)), push.dome_height * up / (up @ up)]),
    )


def patch(chambers: HingeChambers, mesh: Bricks, gap: int) -> End:
    """The middle of the patch of the wall behind a gap, counted from 0."""
    wall = (gap + 1) * chambers.pitch
    nodes = _disc(chambers, mesh, wall, PATCH_RADIUS)
    place = np.array([wall, _axis(chambers), 0.0])
    return End(place, nodes, _equal(nodes), np.zeros(len(nodes)))


def opening(
    chambers: HingeChambers, mesh: Bricks, push: Push, displacements: Array, gap: int
) -> Array:
    """How much farther apart in mm apex and patch are than at rest; displacements (..., n, 3)."""
    start, end = apex(chambers, mesh, push, gap), patch(chambers, mesh, gap)
    length = np.linalg.norm(end.moved(displacements) - start.moved(displacements), axis=-1)
    return np.asarray(length - (chambers.separation + push.dome_height))


def floor_angle(chambers: HingeChambers, mesh: Bricks, displacements: Array, number: int) -> Array:
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


def _axis(chambers: HingeChambers) -> float:
    """Height in mm of the domes' axis over the lower face of the layer."""
    return chambers.layer_thickness / 2 + lever(chambers)


def _disc(chambers: HingeChambers, mesh: Bricks, place: float, radius: float) -> Indices:
    """Nodes on a plane across the domes' axis, about it; the radius over the chamber's width."""
    away = np.hypot(mesh.nodes[:, 1] - _axis(chambers), mesh.nodes[:, 2])
    return np.flatnonzero(on_plane(mesh, 0, place) & (away < (radius + 1e-9) * chambers.width))


def _side_edges(chambers: HingeChambers, mesh: Bricks, number: int) -> Indices:
    """Nodes of a chamber's outer side on a level with its inner roof and with its floor."""
    start, end = number * chambers.pitch, number * chambers.pitch + chambers.outer_length
    slack = 1e-9 * end
    is_along = (mesh.nodes[:, 0] > start - slack) & (mesh.nodes[:, 0] < end + slack)
    is_outside = on_plane(mesh, 2, chambers.width / 2 + WALL_THICKNESS)
    floor = chambers.layer_thickness
    is_edge = on_plane(mesh, 1, floor) | on_plane(mesh, 1, floor + chambers.width)
    return np.flatnonzero(is_along & is_outside & is_edge)


def _equal(nodes: Indices) -> Array:
    return np.full(len(nodes), 1 / len(nodes))


def _is_at(mesh: Bricks, point: tuple[float, float, float]) -> Flags:
    x, y, z = (on_plane(mesh, axis, place) for axis, place in enumerate(point))
    return x & y & z
