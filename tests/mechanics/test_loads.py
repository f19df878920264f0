"""Terms of dead loads: their derivatives in all coordinates, and which there are."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.equilibrium.loaded import LoadedPotential, Unchanged
from dpgcli.equilibrium.potential import Potential
from dpgcli.mechanics.coordinates import FingerPotential, Internal
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import LOAD, Formulate, chain_potential, lattice_potential

Fingers = Callable[..., Finger]
LOADS = {
    "tip_force_x": 0.3,
    "tip_force_y": -0.2,
    "end_moment": 4.0,
    "gravity_x": -0.6,
    "gravity_y": 0.8,
}
WEIGHTS = np.array([[0.1], [0.0], [0.3]])  # N a unit
CASES = pytest.mark.parametrize(
    ("formulate", "linear_stiffness", "compliance"),
    [
        (chain_potential, 1e3, 0.0),
        (chain_potential, 1e3, 0.5),
        (chain_potential, np.inf, 0.0),
        (chain_potential, np.inf, 0.5),
        (lattice_potential, 1e3, 0.0),
        (lattice_potential, 1e3, 0.5),
    ],
)


def loaded(finger: Finger) -> Finger:
    loads = {name: np.array([[value]]) for name, value in LOADS.items()}
    return finger.changed(**loads, unit_weight=WEIGHTS)


def loads_of(potential: FingerPotential) -> FingerPotential:
    terms = tuple(term for term in potential.terms if term.kind == LOAD)
    return Potential(potential.coordinates, terms)


@CASES
def test_derivatives(
    formulate: Formulate,
    linear_stiffness: float,
    compliance: float,
    graded_finger: Fingers,
    random_shape: Callable[..., Internal],
    central_difference: Callable[..., Array],
    dense: Callable[[Array], Array],
) -> None:
    finger = graded_finger(3, 4, linear_stiffness=linear_stiffness)
    finger = finger.changed(wall_compliance=np.full((3, 1), compliance))
    load = loads_of(formulate(loaded(finger)))
    assert len(load.terms) == 6, "two corners, two forces, two ways of gravity"
    at = load.coordinates.of_shape(random_shape(3, 5))
    scale = 1.0 / np.broadcast_to(load.coordinates.force_unit, at.shape)[:, 0]
    here = load.evaluate(at)
    slope = central_difference(lambda x: load.evaluate(x).energy, at, scale)
    assert here.gradient * scale[:, None] == pytest.approx(slope, rel=1e-7, abs=1e-9)
    exact = dense(here.hessian)[:, :, 0] * scale[:, None]
    bend = central_difference(lambda x: load.evaluate(x).gradient, at, scale)[:, :, 0]
    assert exact == pytest.approx(bend, rel=1e-7, abs=1e-8)
    assert np.abs(1.00001 * exact - bend).max() > 1e-7, "a Hessian that is off would show"


@CASES
def test_the_energy_is_minus_the_work(
    formulate: Formulate,
    linear_stiffness: float,
    compliance: float,
    graded_finger: Fingers,
    random_shape: Callable[..., Internal],
) -> None:
    finger = graded_finger(3, 4, linear_stiffness=linear_stiffness)
    finger = finger.changed(wall_compliance=np.full((3, 1), compliance))
    load = loads_of(formulate(loaded(finger)))
    at = load.coordinates.of_shape(random_shape(3, 6))
    nodes, tip = load.coordinates.stations(at), load.coordinates.tip(at)[0]
    fallen = WEIGHTS * (-0.6 * nodes.top_x + 0.8 * nodes.top_y)
    work = 0.3 * tip[0] - 0.2 * tip[1] - 4.0 * tip[2] + fallen.sum(axis=0)
    assert load.evaluate(at).energy == pytest.approx(-work, rel=1e-12)


@CASES
def test_loads_that_grow(
    formulate: Formulate,
    linear_stiffness: float,
    compliance: float,
    graded_finger: Fingers,
    random_shape: Callable[..., Internal],
) -> None:
    """The family's energy, its derivatives, and ∂g/∂λ: the gradient is linear in the share."""
    finger = graded_finger(3, 4, linear_stiffness=linear_stiffness)
    finger = finger.changed(wall_compliance=np.full((3, 1), compliance))
    whole, bare = formulate(loaded(finger)), formulate(finger)
    dome, *others = bare.terms
    family = LoadedPotential(
        whole.coordinates,
        tuple(others),
        dome.measure,
        Unchanged(dome.law),
        dome.measure,
        finger.stroke,
        np.ones((3, 1)),
        loads_of(whole).terms,
    )
    at, share = whole.coordinates.of_shape(random_shape(3, 7)), np.array([0.3])
    full, none = whole.evaluate(at), bare.evaluate(at)
    found = family.at(share).evaluate(at)
    assert found.energy == pytest.approx(none.energy + 0.3 * (full.energy - none.energy), rel=1e-12)
    free = np.zeros((3, 1)), np.zeros(1)
    linear = family.linearized(at, share, *free, max(family.column_depths))
    rate = full.gradient - none.gradient
    assert linear.rate == pytest.approx(rate, rel=1e-9, abs=1e-9)
    assert linear.gradient == pytest.approx(none.gradient + 0.3 * rate, rel=1e-9, abs=1e-9)
    assert linear.gradient == pytest.approx(found.gradient, rel=1e-12, abs=1e-12)
    assert linear.hessian == pytest.approx(found.hessian, rel=1e-12, abs=1e-12)


def test_only_couples_leave_a_finger_separable(graded_finger: Fingers) -> None:
    finger, strut = graded_finger(4, 4), slice(7, 8)
    couple = finger.changed(end_moment=np.array([[4.0]]))
    weighed = finger.changed(unit_weight=np.array([[0.1]]), gravity_x=np.array([[-1.0]]))
    pulled = finger.changed(tip_force_x=np.array([[0.1]]))
    found = [chain_potential(f).is_separable(strut) for f in (finger, couple, weighed, pulled)]
    assert found == [True, True, False, False]


def test_loads_follow_their_lanes(graded_finger: Fingers) -> None:
    forces = np.array([[0.1, 0.2, 0.3]])
    finger = graded_finger(3, 4).changed(tip_force_y=forces, unit_weight=WEIGHTS)
    taken = finger.take_lanes(np.array([2, 0]))
    assert taken.tip_force_y.tolist() == [[0.3, 0.1]]
    assert finger.section(1, 3).unit_weight.tolist() == [[0.0], [0.3]]
    assert finger.unloaded.conditions()["unit_weight"].tolist() == [[0.0]]
    assert not finger.unloaded.is_loaded
