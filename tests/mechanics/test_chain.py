"""Both formulations: derivatives, lanes and published equilibria; one unit in closed form."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.equilibrium.potential import Potential
from dpgcli.mechanics.coordinates import FingerPotential, Internal
from dpgcli.mechanics.curve import spline
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.laws import PUBLISHED, DomeLaw, PushOnly, Tabulated
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential

FORMULATIONS: dict[str, tuple[Formulate, float]] = {
    "chain": (chain_potential, 1e4),
    "rigid": (chain_potential, np.inf),
    "lattice": (lattice_potential, 1e4),
}
WALLS = {"no walls": 0.0, "walls": 0.05, "soft walls": 3.0}  # mm/N
OPENING_ANGLE = np.deg2rad(17.36175941)  # of an inverted unit with rigid bars
Case = tuple[FingerPotential, Array, Array]


def energy_of(u: Array) -> Array:
    """A smooth dimensionless energy with a second well that is not the study's."""
    return np.asarray(0.5 * u**2 * (0.06 + 0.9 * (1.0 - u) ** 2) * (1.0 + 0.1 * np.sin(u)))


TRAVEL = np.linspace(0.0, 1.4, 8)  # few: the stiffness has a kink at each
TABULATED = Tabulated(spline(tuple(TRAVEL), tuple(energy_of(TRAVEL))))
LAWS: dict[str, DomeLaw] = {
    "published": PUBLISHED,
    "tabulated": TABULATED,
    "pushes": PushOnly(PUBLISHED),
    "pushes as tabulated": PushOnly(TABULATED),
}


@pytest.fixture(
    params=[
        *((name, n, "published") for name in FORMULATIONS for n in (1, 2, 4)),
        *((name, 2, law) for name in FORMULATIONS for law in list(LAWS)[1:]),
        *((name, n, law, "walls") for name in FORMULATIONS for n in (1, 3) for law in LAWS),
        *((name, 2, "published", "soft walls") for name in FORMULATIONS),
    ],
    ids=str,
)
def case(
    request: pytest.FixtureRequest,
    graded_finger: Callable[..., Finger],
    random_shape: Callable[..., Internal],
) -> Case:
    """A graded finger's formulation, a shape far from equilibrium, the scale of each row."""
    name, n_units, law, *walls = request.param
    formulation, stiffness = FORMULATIONS[name]
    finger = graded_finger(n_units, 11, linear_stiffness=stiffness)
    finger = replace(finger, law=LAWS[law])
    if walls:  # the last unit's are rigid
        compliance = WALLS[walls[0]] * (np.arange(n_units)[::-1, None] + (n_units == 1))
        finger = finger.changed(wall_compliance=compliance)
    potential = formulation(finger)
    shape = random_shape(n_units, 12)
    if isinstance(finger.law, PushOnly):  # where domes and neighbors touch
        corner = np.arcsin(0.75 * finger.stroke / (2.0 * finger.segment_height))
        chord, near, far, strut = (0.05 * part for part in shape[:4])
        shape = Internal(chord, corner + near, corner + far, strut)
    shape = shape._replace(wall=0.05 * finger.stroke)
    coordinates = potential.coordinates.of_shape(shape)
    lever = np.broadcast_to(potential.coordinates.force_unit, coordinates.shape)[:, 0]
    return potential, coordinates, 1.0 / lever  # 1 mm, or as much of an angle


def agree(exact: Array, numeric: Array) -> bool:
    """Within 1e-7 of the largest entry."""
    return bool(np.abs(exact - numeric).max() <= 1e-7 * np.abs(numeric).max())


def derivatives(potential: FingerPotential, kind: str, coordinates: Array) -> tuple[Array, ...]:
    """Energy, gradient and band of the terms of one kind."""
    terms = tuple(term for term in potential.terms if term.kind == kind)
    evaluation = Potential(potential.coordinates, terms).evaluate(coordinates)
    return evaluation.energy, evaluation.gradient, evaluation.hessian


@pytest.mark.parametrize("kind", ["bistable", "hinge", "bar"])
def test_gradient_is_the_derivative_of_the_energy(
    case: Case, kind: str, central_difference: Callable[..., Array]
) -> None:
    potential, coordinates, scale = case
    if kind not in {term.kind for term in potential.terms}:
        assert potential.coordinates.finger.is_rigid and kind == "bar"
        return
    _, gradient, _ = derivatives(potential, kind, coordinates)
    numeric = central_difference(lambda x: derivatives(potential, kind, x)[0], coordinates, scale)
    assert agree(gradient * scale[:, None], numeric)


@pytest.mark.parametrize("kind", ["bistable", "hinge", "bar"])
def test_hessian_is_the_derivative_of_the_gradient(
    case: Case,
    kind: str,
    central_difference: Callable[..., Array],
    dense: Callable[[Array], Array],
) -> None:
    potential, coordinates, scale = case
    if kind not in {term.kind for term in potential.terms}:
        assert potential.coordinates.finger.is_rigid and kind == "bar"
        return
    exact = dense(derivatives(potential, kind, coordinates)[2])[:, :, 0] * np.outer(scale, scale)
    numeric = central_difference(
        lambda x: derivatives(potential, kind, x)[1] * scale[:, None], coordinates, scale
    )[:, :, 0]
    assert agree(exact, numeric)
    assert not agree(1.00001 * exact, numeric)  # the check has teeth


def test_pose_jacobians_are_derivatives(
    case: Case, central_difference: Callable[..., Array]
) -> None:
    potential, coordinates, scale = case

    def nodes(x: Array) -> Array:
        return np.stack(potential.coordinates.stations(x), axis=1).reshape(-1, x.shape[1])

    for exact, function in (
        (potential.coordinates.tip(coordinates)[1], lambda x: potential.coordinates.tip(x)[0]),
        (potential.coordinates.station_jacobian(coordinates), nodes),
    ):
        exact = exact * scale[:, None, None]
        numeric = central_difference(function, coordinates, scale)
        assert agree(exact, numeric)
        assert not agree(1.00001 * exact, numeric)


@pytest.mark.parametrize("name", FORMULATIONS)
@pytest.mark.parametrize("has_hinges", [True, False])
@pytest.mark.parametrize("n_units", [1, 2, 5])
def test_reach_covers_the_hessian(
    name: str,
    has_hinges: bool,
    n_units: int,
    graded_finger: Callable[..., Finger],
    random_shape: Callable[..., Internal],
) -> None:
    formulation, stiffness = FORMULATIONS[name]
    arrays = graded_finger(n_units, 1, linear_stiffness=stiffness).arrays()
    arrays["hinge_stiffness"] = arrays["hinge_stiffness"] * has_hinges
    potential = formulation(Finger(n_units, **arrays))
    band = potential.evaluate(potential.coordinates.of_shape(random_shape(n_units, 2))).hessian
    depth = np.arange(len(band))[:, None]
    assert not band[depth[:, 0, None] > np.array(potential.column_depths)].any()
    assert ("hinge" in {term.kind for term in potential.terms}) is has_hinges


def test_single_unit_has_the_closed_form(reference_finger: Callable[..., Finger]) -> None:
    unit = chain_potential(reference_finger(1))
    half = 0.5 * OPENING_ANGLE
    open_unit = np.full((2, 1), half)
    evaluation = unit.evaluate(open_unit)
    assert unit.coordinates.openings(open_unit) == pytest.approx(3.2450151985, abs=1e-9)
    assert unit.coordinates.openings(open_unit) == pytest.approx(
        2 * 10.75 * np.sin(half), rel=1e-15
    )
    assert evaluation.energy == pytest.approx(4.3613588754, abs=1e-10)
    assert np.abs(evaluation.gradient).max() <= 1e-6  # the angle is rounded to 1e-8 degrees


def test_single_unit_turns_over_at_its_barrier(reference_finger: Callable[..., Finger]) -> None:
    unit = chain_potential(reference_finger(1))
    barrier = np.full((2, 1), np.arcsin(0.5 * 2.0041742418 / 10.75))
    evaluation = unit.evaluate(barrier)
    assert evaluation.energy == pytest.approx(6.0382332675, abs=1e-10)
    assert np.abs(evaluation.gradient).max() <= 1e-6


def test_single_unit_snaps_and_resets_at_the_known_forces(
    reference_finger: Callable[..., Finger],
) -> None:
    half = np.linspace(0.0, 0.5 * OPENING_ANGLE, 20_001)
    gradient = chain_potential(reference_finger(1)).evaluate(np.stack((half, half))).gradient
    force = 0.5 * gradient.sum(axis=0) / (10.75 * np.cos(half))  # de/dφ over dx/dφ
    assert force.max() == pytest.approx(4.72618, abs=1e-5)
    assert force.min() == pytest.approx(-2.05467, abs=1e-5)


def test_hinge_stiffens_the_closed_unit_by_its_share(
    reference_finger: Callable[..., Finger], dense: Callable[[Array], Array]
) -> None:
    closed = chain_potential(reference_finger(1)).evaluate(np.zeros((2, 1)))
    per_angle = 0.25 * dense(closed.hessian).sum()  # d²e/dφ² with a = b = φ/2
    assert per_angle / 10.75**2 == pytest.approx(12.84 + 24.2 / 10.75**2, rel=1e-14)


@pytest.mark.parametrize(
    ("pattern", "tip_x", "tip_y", "chord_angle", "energy"),
    [
        ("111", 35.28310873, -17.24079693, -43.40343683, 13.08400032),
        ("101", 38.35981703, -11.99285355, -26.04208016, 8.72266851),
        ("11111", 44.65422600, -42.23246372, -78.12616759, 21.80666611),
    ],
)
@pytest.mark.parametrize("formulation", [chain_potential, lattice_potential])
def test_equilibria_are_the_reference_ones(
    formulation: Formulate,
    pattern: str,
    tip_x: float,
    tip_y: float,
    chord_angle: float,
    energy: float,
    reference_finger: Callable[..., Finger],
    dense: Callable[[Array], Array],
) -> None:
    potential = formulation(reference_finger(len(pattern), 1e4))
    half = np.array([[0.5 * OPENING_ANGLE * int(c)] for c in pattern])
    rest = np.zeros((1, 1))
    x = potential.coordinates.of_shape(Internal(rest, half, half, rest))
    for _ in range(5):  # plain Newton, independent of the package's solver
        evaluation = potential.evaluate(x)
        x = x - np.linalg.solve(dense(evaluation.hessian)[:, :, 0], evaluation.gradient)
    nodes = potential.coordinates.stations(x)
    base = np.concatenate((np.zeros((1, 2)), np.stack((nodes.base_x, nodes.base_y), 1)[:, :, 0]))
    last = base[-1] - base[-2]
    assert base[-1] == pytest.approx([tip_x, tip_y], abs=1e-8)
    assert np.degrees(np.arctan2(last[1], last[0])) == pytest.approx(chord_angle, abs=1e-8)
    assert potential.evaluate(x).energy == pytest.approx(energy, abs=1e-8)


@pytest.mark.parametrize("name", FORMULATIONS)
def test_designs_are_picked_in_order(
    name: str, graded_finger: Callable[..., Finger], random_shape: Callable[..., Internal]
) -> None:
    formulation, stiffness = FORMULATIONS[name]
    potential = formulation(graded_finger(3, 5, n_designs=6, linear_stiffness=stiffness))
    index = np.array([4, 0, 4])
    picked = potential.take_lanes(index)
    for attribute in ("gradient_scale", "step_cap"):
        taken = getattr(potential.coordinates, attribute)[:, index]
        assert np.array_equal(getattr(picked.coordinates, attribute), taken)
    coordinates = potential.coordinates.of_shape(random_shape(3, 6, batch=6))
    whole = potential.evaluate(coordinates)
    part = picked.evaluate(coordinates[:, index])
    assert np.array_equal(part.hessian, whole.hessian[:, :, index])


@pytest.mark.parametrize("name", FORMULATIONS)
@pytest.mark.parametrize("n_units", [1, 5, 10])
@pytest.mark.parametrize("batch", [1, 7])
def test_lane_has_the_same_bits_in_any_batch(
    name: str,
    n_units: int,
    batch: int,
    graded_finger: Callable[..., Finger],
    random_shape: Callable[..., Internal],
) -> None:
    formulation, stiffness = FORMULATIONS[name]
    potential = formulation(graded_finger(n_units, 7, n_designs=1000, linear_stiffness=stiffness))
    coordinates = potential.coordinates.of_shape(random_shape(n_units, 8, batch=1000))
    whole = potential.evaluate(coordinates)
    tip, openings = (
        potential.coordinates.tip(coordinates),
        potential.coordinates.openings(coordinates),
    )
    for first in (0, 500, 993):
        lanes = np.arange(first, first + batch)
        alone, x = potential.take_lanes(lanes), np.ascontiguousarray(coordinates[:, lanes])
        part = alone.evaluate(x)
        assert np.array_equal(part.gradient, whole.gradient[:, lanes])
        assert np.array_equal(part.hessian, whole.hessian[:, :, lanes])
        for energy, of_whole in zip(part.energies, whole.energies, strict=True):
            assert np.array_equal(energy, of_whole[lanes])
        assert np.array_equal(alone.coordinates.openings(x), openings[:, lanes])
        assert np.array_equal(alone.coordinates.tip(x)[0], tip[0][:, lanes])
        assert np.array_equal(alone.coordinates.tip(x)[1], tip[1][:, :, lanes])
