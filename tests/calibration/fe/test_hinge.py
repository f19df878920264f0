"""The chambers' mesh, the couple that bends them and the rotation that is read off."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.calibration.fe.bricks import Bricks
from dpgcli.calibration.fe.elements import BRICK
from dpgcli.calibration.fe.hinge import (
    HingeChambers,
    chamber_bricks,
    chamber_turn,
    couple,
    moment,
    on_plane,
)

REFERENCE = HingeChambers(9.0, 20.0, 0.75, 3.0, 1.5, 26.0)
FACES = ([0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7])


@pytest.fixture
def mesh() -> Bricks:
    return chamber_bricks(REFERENCE, 1)


def edges(mesh: Bricks) -> Array:
    """Lengths of all elements along x, y and z: (m, 3)."""
    corners = mesh.nodes[mesh.elements]
    return np.stack([corners[:, 1, 0] - corners[:, 0, 0], corners[:, 3, 1] - corners[:, 0, 1],
                     corners[:, 4, 2] - corners[:, 0, 2]], axis=1)  # fmt: skip


def turned(mesh: Bricks, angle: float, place: float) -> Array:
    """Displacements of a rigid turn, clockwise, of all beyond a place."""
    cos, sin = np.cos(angle), np.sin(angle)
    rest = mesh.nodes - [place, 0.75, 0.0]
    moved = rest @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return np.where(mesh.nodes[:, :1] > place, moved - rest, 0.0)


@pytest.mark.parametrize("density", [1, 2, 4])
@pytest.mark.parametrize("chambers", [REFERENCE, replace(REFERENCE, separation=0.1)])
def test_bricks_are_upright_and_fill_the_chambers(chambers: HingeChambers, density: int) -> None:
    mesh = chamber_bricks(chambers, density)
    sizes = edges(mesh)
    assert sizes.min() > 0
    n, width, length = 2, chambers.width, chambers.length
    layer = (n * chambers.pitch - chambers.separation) * chambers.layer_thickness * (width / 2 + 1)
    hull = chambers.outer_length * (width + 1) * (width / 2 + 1)
    exact = layer + n * (hull - length * width * width / 2)
    assert sizes.prod(axis=1).sum() == pytest.approx(exact)


def test_every_node_stands_where_its_brick_has_it(mesh: Bricks) -> None:
    first = mesh.nodes[mesh.elements[:, :1]]
    expected = first + BRICK / 2 * edges(mesh)[:, None, :]
    assert mesh.nodes[mesh.elements] == pytest.approx(expected)


def test_bricks_share_their_faces(mesh: Bricks) -> None:
    counts = Counter(tuple(sorted(element[face])) for element in mesh.elements for face in FACES)
    assert set(counts.values()) == {1, 2}
    surface = np.array([face for face, count in counts.items() if count == 1])
    spans = np.ptp(mesh.nodes[surface], axis=1)
    area = np.where(spans > 0, spans, 1.0).prod(axis=1).sum()
    assert area == pytest.approx(_surface(REFERENCE)), "no gap within, where faces would not meet"
    assert len(np.unique(mesh.nodes.round(9), axis=0)) == len(mesh.nodes)
    assert set(mesh.elements.ravel()) == set(range(len(mesh.nodes)))


def _surface(c: HingeChambers) -> float:
    """Area of one half of two chambers and their layer, cut and cavities included."""
    depth, total = c.width / 2 + 1, 2 * c.pitch - c.separation
    layer = total * (2 * depth + c.layer_thickness) + 2 * c.layer_thickness * depth
    layer += total * c.layer_thickness  # the plane of symmetry
    hull = (c.width + 1) * (2 * depth + 2 * c.outer_length)  # walls and both sides
    cavity = c.width / 2 * (2 * c.width + 2 * c.length) + c.length * c.width
    # the roofs replace the layer's face below them; of the cavity one side is open
    return layer + 2 * (hull + cavity - c.length * c.width)


def test_the_couple_is_a_moment_without_a_force(mesh: Bricks) -> None:
    forces = couple(REFERENCE, mesh)
    assert forces.sum() == pytest.approx(0.0, abs=1e-12)
    assert moment(mesh, forces, np.zeros_like(mesh.nodes)) == pytest.approx(1.0)
    loaded = mesh.nodes[np.flatnonzero(forces)]
    assert loaded[:, 0] == pytest.approx(24.5)
    assert loaded[:, 1].max() == pytest.approx(1.5)


def test_the_moment_wanes_as_the_arms_turn(mesh: Bricks) -> None:
    forces = couple(REFERENCE, mesh)
    found = moment(mesh, forces, turned(mesh, 0.3, 12.25))
    assert found == pytest.approx(np.cos(0.3))


@pytest.mark.parametrize("angle", [-0.2, 0.0, 1e-3, 0.5, 2.0])
def test_a_rigid_turn_is_read_off(mesh: Bricks, angle: float) -> None:
    moved = turned(mesh, angle, 12.25)
    assert chamber_turn(REFERENCE, mesh, moved, 0) == 0.0
    assert chamber_turn(REFERENCE, mesh, moved, 1) == pytest.approx(angle, abs=1e-12)
    both = np.stack([moved, 0.0 * moved])
    assert chamber_turn(REFERENCE, mesh, both, 1) == pytest.approx([angle, 0.0], abs=1e-12)


def test_sections_through_the_middles_have_nodes(mesh: Bricks) -> None:
    for number in (0, 1):
        section = mesh.nodes[on_plane(mesh, 0, REFERENCE.middle(number))]
        assert section[:, 1].min() == 0.0
        assert section[:, 1].max() == 22.5
