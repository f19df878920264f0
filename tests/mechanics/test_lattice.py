"""The lattice against the chain, its invariances, and the rounding of node coordinates."""

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dpgcli.arrays import Array
from dpgcli.mechanics.coordinates import FingerPotential, Internal
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.lattice import FINEST_TOLERANCE, Lattice
from dpgcli.mechanics.lattice_geometry import vectors
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential

FORMULATIONS = pytest.mark.parametrize("formulation", [chain_potential, lattice_potential])
LENGTHS = {"segment_length", "segment_height", "stroke"}


@pytest.mark.parametrize("seed", range(20))
def test_a_shape_is_the_same_in_both_formulations(
    seed: int, graded_finger: Callable[..., Finger], random_shape: Callable[..., Internal]
) -> None:
    n_units = 1 + seed % 8
    finger, shape = graded_finger(n_units, seed), random_shape(n_units, 100 + seed, batch=3)
    chain, lattice = chain_potential(finger), lattice_potential(finger)
    bars, nodes = chain.coordinates.of_shape(shape), lattice.coordinates.of_shape(shape)
    energies = chain.by_kind(chain.evaluate(bars).energies)
    of_lattice = lattice.by_kind(lattice.evaluate(nodes).energies)
    assert list(energies) == list(of_lattice)
    for kind, energy in of_lattice.items():
        assert energy == pytest.approx(energies[kind], rel=1e-12)
    assert lattice.coordinates.openings(nodes) == pytest.approx(
        chain.coordinates.openings(bars), abs=1e-12
    )
    assert lattice.coordinates.tip(nodes)[0] == pytest.approx(
        chain.coordinates.tip(bars)[0], abs=1e-12
    )
    assert (
        lattice.coordinates.springs(nodes).is_folded == chain.coordinates.springs(bars).is_folded
    ).all()
    for mine, other in zip(
        lattice.coordinates.stations(nodes), chain.coordinates.stations(bars), strict=True
    ):
        assert mine == pytest.approx(other, abs=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_forces_are_the_same_in_both_formulations(
    seed: int, graded_finger: Callable[..., Finger], random_shape: Callable[..., Internal]
) -> None:
    finger, shape = graded_finger(4, seed), random_shape(4, 50 + seed)
    chain, lattice = chain_potential(finger), lattice_potential(finger)
    bars = chain.coordinates.of_shape(shape)
    on_nodes = lattice.evaluate(lattice.coordinates.of_shape(shape)).gradient[:, 0]
    on_bars = chain.evaluate(bars).gradient[:, 0]
    through_nodes = chain.coordinates.station_jacobian(bars)[:, :, 0] @ on_nodes
    assert through_nodes == pytest.approx(on_bars, rel=1e-11, abs=1e-11 * np.abs(on_bars).max())


@pytest.mark.parametrize("seed", range(5))
def test_corner_moments_are_the_same_in_both_formulations(
    seed: int, graded_finger: Callable[..., Finger], random_shape: Callable[..., Internal]
) -> None:
    finger, shape = graded_finger(4, seed), random_shape(4, 60 + seed)
    chain, lattice = chain_potential(finger), lattice_potential(finger)
    bars, nodes = chain.coordinates.of_shape(shape), lattice.coordinates.of_shape(shape)
    on_nodes = lattice.coordinates.corner_moments(nodes, lattice.evaluate(nodes).gradient)
    on_bars = chain.coordinates.corner_moments(bars, chain.evaluate(bars).gradient)
    assert on_nodes == pytest.approx(on_bars, rel=1e-10, abs=1e-10 * np.abs(on_bars).max())


def test_forces_along_bars_do_no_work_at_corners(
    graded_finger: Callable[..., Finger], random_shape: Callable[..., Internal]
) -> None:
    """100 N between the ends of every bar, as rounding leaves them: no corner feels it."""
    finger = graded_finger(5, 7)
    lattice = lattice_potential(finger)
    nodes = lattice.coordinates.of_shape(random_shape(5, 8))
    cell = vectors(nodes, finger.segment_height)
    pulls = np.zeros((5, 4, 1))
    for vector, ends in ((cell.chord, (None, 0)), (cell.far, (0, 2))):
        along = (100.0 * vector / np.hypot(*vector)).transpose(1, 0, 2)
        start, stop = ends
        pulls[:, stop : stop + 2] += along
        if start is None:
            pulls[:-1, 0:2] -= along[1:]
        else:
            pulls[:, start : start + 2] -= along
    moments = lattice.coordinates.corner_moments(nodes, pulls.reshape(-1, 1))
    assert np.abs(pulls).max() > 50.0
    assert np.abs(moments).max() < 1e-10


def test_tip_angle_counts_full_turns(reference_finger: Callable[..., Finger]) -> None:
    finger = reference_finger(20, 1e4)
    rest, corner = np.zeros((1, 1)), np.full((20, 1), 0.2)
    for formulation in (chain_potential(finger), lattice_potential(finger)):
        tip, _ = formulation.coordinates.tip(
            formulation.coordinates.of_shape(Internal(rest, corner, corner, rest))
        )
        assert tip[2] == pytest.approx(-8.0, rel=1e-13)


def test_coordinates_broadcast_over_units_and_lanes(
    graded_finger: Callable[..., Finger],
) -> None:
    lattice = lattice_potential(graded_finger(3, 1, n_designs=4))
    rest = np.zeros((1, 1))
    nodes = lattice.coordinates.of_shape(Internal(rest, rest, rest, rest))
    stations = np.cumsum(lattice.coordinates.finger.segment_length, axis=0)
    assert nodes.shape == (12, 4)
    assert np.array_equal(nodes[0::4], stations) and np.array_equal(nodes[2::4], stations)
    assert not nodes[1::4].any()
    assert np.array_equal(nodes[3::4], np.tile(lattice.coordinates.finger.segment_height, (3, 1)))


@FORMULATIONS
@given(n_units=st.integers(1, 6), seed=st.integers(0, 2**32 - 1))
def test_energies_survive_a_mirror(
    formulation: Formulate,
    n_units: int,
    seed: int,
    graded_finger: Callable[..., Finger],
    random_shape: Callable[..., Internal],
) -> None:
    """Read from its tip, a finger is its own mirror image: near and far corners trade places."""
    finger = graded_finger(n_units, seed)
    chord, near, far, strut, _ = random_shape(n_units, seed + 1)
    strut[-1] = 0.0  # as that of the clamped station
    mirrored_strut = np.concatenate((strut[:-1][::-1], strut[-1:]))
    mirrored_shape = Internal(chord[::-1], far[::-1], near[::-1], mirrored_strut)
    mirrored = Finger(n_units, **{k: v[::-1] for k, v in finger.arrays().items()})
    there = _energies(formulation(finger), Internal(chord, near, far, strut))
    back = _energies(formulation(mirrored), mirrored_shape)
    assert list(there) == ["bistable", "hinge", "bar"]
    for kind, energy in there.items():
        assert back[kind] == pytest.approx(energy, rel=1e-11)


@FORMULATIONS
@given(n_units=st.integers(1, 6), seed=st.integers(0, 2**32 - 1), unit=st.floats(1e-3, 1e3))
def test_energies_do_not_depend_on_the_unit_of_length(
    formulation: Formulate,
    n_units: int,
    seed: int,
    unit: float,
    graded_finger: Callable[..., Finger],
    random_shape: Callable[..., Internal],
) -> None:
    """Lengths times s, forces as they were: stiffnesses over s, hinges and energies times s."""
    finger, shape = graded_finger(n_units, seed), random_shape(n_units, seed + 1)
    arrays = {
        name: values * unit if name in LENGTHS | {"hinge_stiffness"} else values / unit
        for name, values in finger.arrays().items()
    }
    arrays["force_linearity"] = finger.force_linearity
    rescaled = formulation(Finger(n_units, **arrays))
    longer = Internal(unit * shape.chord, shape.near_angle, shape.far_angle, unit * shape.strut)
    before = _energies(formulation(finger), shape)
    for kind, energy in _energies(rescaled, longer).items():
        assert energy == pytest.approx(unit * before[kind], rel=1e-11)


@pytest.mark.parametrize("linear_stiffness", [1e4, 1e9])
def test_newton_gets_below_the_rounding_floor(
    linear_stiffness: float,
    reference_finger: Callable[..., Finger],
    dense: Callable[[Array], Array],
) -> None:
    lattice = lattice_potential(reference_finger(5, linear_stiffness))
    half = 0.5 * np.deg2rad(17.36175941) * np.array(list(product((0.0, 1.0), repeat=5))).T
    rest = np.zeros((1, 1))
    x = lattice.coordinates.of_shape(Internal(rest, half, half, rest))
    for _ in range(5):
        evaluation = lattice.evaluate(x)
        matrices = dense(evaluation.hessian).transpose(2, 0, 1)
        x = x - np.linalg.solve(matrices, evaluation.gradient.T[:, :, None])[:, :, 0].T
    residual = np.abs(lattice.evaluate(x).gradient)
    assert (residual.max(axis=0) <= lattice.coordinates.rounding_floor).all()
    assert (residual <= FINEST_TOLERANCE * lattice.coordinates.gradient_scale).all()
    assert (
        residual.max() > 0.01 * lattice.coordinates.rounding_floor
    )  # and the floor is not far below


def test_scales_by_head(reference_finger: Callable[..., Finger]) -> None:
    """ε k_L times twice a length of 3·13.5 + 10.75 mm; a fifth of the stroke as a turn."""
    lattice = Lattice(reference_finger(3, 1e4))
    floor = 2.0 * 2.0**-52 * 1e4 * (3 * 13.5 + 10.75)
    unit_force = (12.84 + 24.2 / 10.75**2) * 3.5
    assert lattice.rounding_floor == pytest.approx(floor, rel=1e-14)
    assert lattice.gradient_scale == pytest.approx(unit_force + floor / 1e-12, rel=1e-14)
    assert (lattice.force_unit == 1.0).all()
    reach = np.repeat([24.25, 37.75, 51.25], 4)[:, None]
    assert lattice.step_cap == pytest.approx(0.2 * 3.5 / 10.75 * reach, rel=1e-14)


def test_a_shared_node_feels_the_stronger_unit(graded_finger: Callable[..., Finger]) -> None:
    lattice = Lattice(graded_finger(3, 2))
    first, second, third = lattice.finger.force_scale[:, 0]
    stronger = np.repeat([max(first, second), max(second, third), third], 4)
    shared = lattice.gradient_scale - lattice.rounding_floor / FINEST_TOLERANCE
    assert shared[:, 0] == pytest.approx(stronger, rel=1e-12)


def test_rigid_bars_are_refused(reference_finger: Callable[..., Finger]) -> None:
    with pytest.raises(ValueError, match="linear_stiffness is infinite"):
        Lattice(reference_finger(2))


def _energies(potential: FingerPotential, shape: Internal) -> dict[str, Array]:
    return potential.by_kind(potential.evaluate(potential.coordinates.of_shape(shape)).energies)
