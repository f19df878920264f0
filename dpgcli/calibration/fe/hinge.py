"""Two hollow chambers on their limiting layer, as a mesh of twenty-node bricks."""

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.calibration.fe.bricks import Bricks, bricks, grid_lines
from dpgcli.calibration.fe.elements import END_FACE, gauss, quad_shapes
from dpgcli.design.geometry import WALL_THICKNESS
from dpgcli.records import dataclass


@dataclass(frozen=True)
class HingeChambers:
    """Two chambers on a limiting layer, halved by the plane of symmetry z = 0; mm, MPa.

    Along x a chamber is a wall, its inner length and a lid as thick as the dome that it stands
    for; across, an inner width and as much height, within walls. The layer is its floor.
    """

    length: float
    width: float
    lid_thickness: float
    separation: float
    layer_thickness: float
    elastic_modulus: float
    poisson: float = 0.48

    @property
    def outer_length(self) -> float:
        """Length of one chamber with wall and lid, in mm."""
        return WALL_THICKNESS + self.length + self.lid_thickness

    @property
    def pitch(self) -> float:
        """Distance in mm from chamber to chamber."""
        return self.outer_length + self.separation

    def middle(self, number: int) -> float:
        """The x of the middle of a chamber, counted from 0, in mm."""
        return number * self.pitch + self.outer_length / 2


def chamber_bricks(chambers: HingeChambers, density: int) -> Bricks:
    """The mesh: one brick through walls, lid and layer, `density` along a gap or half a chamber."""
    lines = _lines(chambers, density)
    x, y, z = np.meshgrid(*((line[1:] + line[:-1]) / 2 for line in lines), indexing="ij")
    return bricks(lines, is_solid(chambers, x, y, z))


def _lines(chambers: HingeChambers, density: int) -> tuple[Array, Array, Array]:
    """Lines of the grid along x, y and z: every face of the chambers, and their middles."""
    wall, inner, outer = WALL_THICKNESS, chambers.length, chambers.outer_length
    starts = np.array([0.0, chambers.pitch])
    along = starts[:, None] + np.array([0.0, wall, outer / 2, wall + inner, outer])
    one_chamber = (1, density, density, 1)
    half, layer = chambers.width / 2, chambers.layer_thickness
    return (
        grid_lines(along.ravel(), (*one_chamber, density, *one_chamber)),
        grid_lines(np.cumsum([0.0, layer, half, half, wall]), (1, 2 * density, 2 * density, 1)),
        grid_lines(np.cumsum([0.0, half, wall]), (2 * density, 1)),
    )


def is_solid(chambers: HingeChambers, x: Array, y: Array, z: Array) -> Flags:
    """Flags of the points within walls, lids and layer, of chambers however many."""
    within = x % chambers.pitch
    top = chambers.layer_thickness + chambers.width
    is_layer = y < chambers.layer_thickness
    is_chamber = within < chambers.outer_length
    is_cavity = (
        (within > WALL_THICKNESS)
        & (within < WALL_THICKNESS + chambers.length)
        & (y < top)
        & (z < chambers.width / 2)
    )
    return is_layer | (is_chamber & ~is_cavity)


def on_plane(mesh: Bricks, axis: int, place: float) -> Flags:
    """Flags of the nodes on a plane across an axis, but for rounding."""
    span = np.ptp(mesh.nodes[:, axis])
    return np.abs(mesh.nodes[:, axis] - place) < 1e-9 * span


def layer_end(chambers: HingeChambers, mesh: Bricks, place: float) -> Flags:
    """Flags of the nodes on a face across the limiting layer."""
    is_layer = mesh.nodes[:, 1] < (1 + 1e-9) * chambers.layer_thickness
    return on_plane(mesh, 0, place) & is_layer


def couple(chambers: HingeChambers, mesh: Bricks) -> Array:
    """Forces along x (n,) in N on the free end of the layer that make a moment of 1 N mm."""
    return end_couple(mesh, layer_end(chambers, mesh, mesh.nodes[:, 0].max()))


def end_couple(mesh: Bricks, is_loaded: Flags) -> Array:
    """Forces along x (n,) in N on flagged nodes of faces across x that make a moment of 1 N mm.

    It opens the gaps: clockwise, the chambers being above their layer. The traction grows with
    the height over the middle of the faces, as in a bent beam; this half of the model bears one
    half of the moment.
    """
    faces = mesh.elements[:, END_FACE]
    faces = faces[is_loaded[faces].all(axis=1)]
    points, weights = gauss(2)
    shapes = quad_shapes(points)
    corners = mesh.nodes[faces]
    area = np.ptp(corners[..., 1], axis=1) * np.ptp(corners[..., 2], axis=1) / 4
    middle = (corners[..., 1].min() + corners[..., 1].max()) / 2
    height = corners[..., 1] @ shapes.T - middle
    forces = np.zeros(len(mesh.nodes))
    np.add.at(forces, faces, (area[:, None] * height * weights) @ shapes)
    return np.asarray(forces / (2 * forces @ mesh.nodes[:, 1]))


def moment(mesh: Bricks, forces: Array, displacements: Array) -> Array:
    """Moment in N mm on the whole model, opening the gaps, at displacements (..., n, 3) in mm.

    The forces keep their direction, and their arms turn with the end that they act on.
    """
    height = mesh.nodes[:, 1] + displacements[..., 1]
    return np.asarray(2 * (height * forces).sum(axis=-1))


def chamber_turn(chambers: HingeChambers, mesh: Bricks, displacements: Array, number: int) -> Array:
    """Rotation in rad, as gaps open, of the section through the middle of a chamber.

    The plane rotation that fits the displacements (..., n, 3) of its nodes best, by least squares.
    """
    section = on_plane(mesh, 0, chambers.middle(number))
    rest = mesh.nodes[section, :2]
    moved = rest + displacements[..., section, :2]
    rest = rest - rest.mean(axis=0)
    moved = moved - moved.mean(axis=-2, keepdims=True)
    across = (rest[:, 0] * moved[..., 1] - rest[:, 1] * moved[..., 0]).sum(axis=-1)
    return np.asarray(np.arctan2(-across, (rest * moved).sum(axis=(-2, -1))))
