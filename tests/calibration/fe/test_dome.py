"""The dome's mesh, its strain energy and the volume it sweeps, against closed forms."""

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.calibration.fe.dome import DomeMesh, DomeShape, dome_mesh, impossible, sphere_radius
from dpgcli.calibration.fe.elements import gauss, quad_shapes, quad_slopes
from dpgcli.calibration.fe.energy import moduli, strain_energy, swept_volume

REFERENCE = DomeShape(height=6.5, thickness=0.75, elastic_modulus=26.0)
SHAPES = [
    REFERENCE,
    replace(REFERENCE, height=2.0, thickness=1.5),
    replace(REFERENCE, height=0.3),
    replace(REFERENCE, height=8.0),  # half a sphere
    replace(REFERENCE, height=11.0, rim_radius=14.0),  # more than half
]
VOLUME = math.pi * 0.75 * (6.5**2 + 10**2)
"""Of the reference: caps of one height on two spheres differ by pi h^2 t, a slab adds pi r^2 t."""


@pytest.fixture
def mesh() -> DomeMesh:
    return dome_mesh(REFERENCE, 20, 3, 1)


def determinants(mesh: DomeMesh) -> Array:
    points, _ = gauss(3)
    tangents = np.einsum("enx,pnl->epxl", mesh.nodes[mesh.elements], quad_slopes(points))
    return np.linalg.det(tangents)


def volume(mesh: DomeMesh) -> float:
    points, weights = gauss(3)
    radius = mesh.nodes[mesh.elements][..., 0] @ quad_shapes(points).T
    return float((2 * np.pi * radius * determinants(mesh) * weights).sum())


def stretched(mesh: DomeMesh, radial: float, axial: float) -> Array:
    return mesh.nodes * np.array([radial - 1, axial - 1])


@pytest.mark.parametrize("dome", SHAPES)
@pytest.mark.parametrize("cells", [(20, 3, 1), (28, 4, 2), (56, 8, 4)])
def test_elements_are_not_turned_over_and_fill_the_dome(
    dome: DomeShape, cells: tuple[int, int, int]
) -> None:
    mesh = dome_mesh(dome, *cells)
    exact = math.pi * dome.thickness * (dome.height**2 + dome.rim_radius**2)
    assert determinants(mesh).min() > 0
    assert volume(mesh) == pytest.approx(exact, rel=2e-5)


def test_elements_share_their_edges(mesh: DomeMesh) -> None:
    corners = mesh.elements[:, :4]
    edges = [
        (*sorted((int(a), int(b))), int(middle))
        for element, middles in zip(corners, mesh.elements[:, 4:], strict=True)
        for a, b, middle in zip(element, np.roll(element, -1), middles, strict=True)
    ]
    counts = Counter(edges)
    assert set(counts.values()) == {1, 2}
    assert sum(count == 1 for count in counts.values()) == 2 * 23 + 2, "the outline"
    assert len({(a, b) for a, b, _ in counts}) == len(counts), "one middle for each edge"
    assert len(np.unique(mesh.nodes.round(9), axis=0)) == len(mesh.nodes)
    assert set(mesh.elements.ravel()) == set(range(len(mesh.nodes)))


def test_nodes_of_importance(mesh: DomeMesh) -> None:
    assert mesh.nodes[mesh.pole] == pytest.approx([0.0, 6.5])
    assert (mesh.nodes[mesh.axis, 0] == 0.0).all()
    assert (mesh.nodes[mesh.fixed, 0] == 10.0).all()
    assert np.sort(mesh.nodes[mesh.fixed, 1]) == pytest.approx([-0.375, 0.0, 0.375])
    convex = mesh.nodes[mesh.elements[mesh.loaded][:, [1, 2, 5]].ravel()]
    on_sphere = np.hypot(convex[:, 0], convex[:, 1] - 6.5 + sphere_radius(REFERENCE))
    is_cap = convex[:, 1] > 0.375 + 1e-9
    assert on_sphere[is_cap] == pytest.approx(sphere_radius(REFERENCE) + 0.375)
    assert convex[~is_cap, 1] == pytest.approx(0.375)


@pytest.mark.parametrize(
    ("dome", "reason"),
    [
        (REFERENCE, ""),
        (replace(REFERENCE, rim_radius=8.0), "its rim lies within r = 8.299 mm"),
        (replace(REFERENCE, height=11.0, rim_radius=8.5), "its rim lies within r = 8.784 mm"),
        (replace(REFERENCE, thickness=17.0), "it is too thick"),
    ],
)
def test_domes_that_cannot_be(dome: DomeShape, reason: str) -> None:
    said = impossible(dome)
    assert said.startswith(reason)
    assert bool(said) == bool(reason)


def test_no_energy_at_rest_or_shifted(mesh: DomeMesh) -> None:
    assert strain_energy(REFERENCE, mesh, np.zeros_like(mesh.nodes)) == 0.0
    lifted = np.tile([0.0, 3.0], (len(mesh.nodes), 1))
    assert strain_energy(REFERENCE, mesh, lifted) == pytest.approx(0.0, abs=1e-10)


def test_uniform_swelling_costs_bulk_energy_alone(mesh: DomeMesh) -> None:
    _, bulk = moduli(26.0, 0.48)
    exact = bulk / 2 * (1.1**3 - 1) ** 2 * VOLUME
    found = strain_energy(REFERENCE, mesh, stretched(mesh, 1.1, 1.1))
    assert found == pytest.approx(exact, rel=2e-4), "reduced integration of the volume"


@pytest.mark.parametrize("stretch", [0.7, 0.99, 1.6])
def test_stretch_at_constant_volume_costs_shear_energy_alone(
    mesh: DomeMesh, stretch: float
) -> None:
    shear, _ = moduli(26.0, 0.48)
    exact = shear / 2 * (2 * stretch**2 + stretch**-4 - 3) * VOLUME
    found = strain_energy(REFERENCE, mesh, stretched(mesh, stretch, stretch**-2))
    assert found == pytest.approx(exact, rel=2e-4)


def test_small_strains_have_linear_elastic_energy(mesh: DomeMesh) -> None:
    """E/(2 (1 + nu)) (e:e + nu/(1 - 2 nu) tr(e)^2) of a uniform strain with shear."""
    radial, axial, slope = 1.0, -0.4, 0.8
    squares = 2 * radial**2 + axial**2 + 2 * (slope / 2) ** 2
    trace = 2 * radial + axial
    density = 26.0 / (2 * 1.48) * (squares + 0.48 / 0.04 * trace**2)
    field = np.stack(
        [radial * mesh.nodes[:, 0], slope * mesh.nodes[:, 0] + axial * mesh.nodes[:, 1]], axis=-1
    )
    sizes = np.array([1e-3, 1e-4])
    found = strain_energy(REFERENCE, mesh, sizes[:, None, None] * field) / sizes**2
    error = np.abs(found / (density * VOLUME) - 1)
    assert error[1] < 3e-4
    limit = found[1] + (found[1] - found[0]) / 9
    assert np.abs(found - limit)[0] == pytest.approx(10 * np.abs(found - limit)[1], rel=0.1)


def test_a_batch_is_its_members(mesh: DomeMesh) -> None:
    moved = np.random.default_rng(1).normal(0.0, 0.01, (3, *mesh.nodes.shape))
    together = strain_energy(REFERENCE, mesh, moved)
    assert together == pytest.approx(
        np.array([strain_energy(REFERENCE, mesh, one) for one in moved])
    )
    assert swept_volume(mesh, moved) == pytest.approx(
        np.array([swept_volume(mesh, one) for one in moved])
    )


def test_full_inversion_sweeps_twice_the_cap(mesh: DomeMesh) -> None:
    """The convex side mirrored in the plane of its edge: a cap of height h and radius R + t/2."""
    mirrored = np.zeros_like(mesh.nodes)
    mirrored[:, 1] = -2 * (mesh.nodes[:, 1] - 0.375)
    cap = math.pi * 6.5**2 * (3 * (sphere_radius(REFERENCE) + 0.375) - 6.5) / 3
    assert swept_volume(mesh, mirrored) == pytest.approx(2 * cap, rel=1e-5)
    assert swept_volume(mesh, np.zeros_like(mirrored)) == 0.0


def test_the_volume_is_what_pressure_works_on(mesh: DomeMesh) -> None:
    """Its derivative at rest is the force of a unit pressure: 2 pi r ds along the normal."""
    push = np.zeros_like(mesh.nodes)
    free = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.fixed)
    push[free] = np.random.default_rng(2).normal(size=(len(free), 2))
    step = 1e-4
    found = (swept_volume(mesh, step * push) - swept_volume(mesh, -step * push)) / (2 * step)
    points, weights = np.polynomial.legendre.leggauss(4)
    local = np.stack([np.ones_like(points), points], axis=1)
    elements = mesh.elements[mesh.loaded]
    shapes, slopes = quad_shapes(local), quad_slopes(local)[..., 1]
    at = np.einsum("enx,pn->epx", mesh.nodes[elements], shapes)
    tangent = np.einsum("enx,pn->epx", mesh.nodes[elements], slopes)
    shift = np.einsum("enx,pn->epx", push[elements], shapes)
    inward = tangent[..., 0] * shift[..., 1] - tangent[..., 1] * shift[..., 0]
    exact = (2 * np.pi * at[..., 0] * inward * weights).sum()
    assert found == pytest.approx(exact, rel=1e-6)
