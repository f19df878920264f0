"""Hinges that turn their neighbors: against extended precision, SciPy and linear algebra."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from dpgcli.arrays import Array, Flags
from dpgcli.design.scene import Scene
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.laws import PUBLISHED, PushOnly, bistable
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential
from dpgcli.reference.equilibria import extended_states
from dpgcli.states.certify import Settled, Status
from dpgcli.states.plan import Request, explain
from dpgcli.states.sensitivities import sensitivities
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

FORMULATIONS = [
    pytest.param(chain_potential, np.inf, id="rigid"),
    pytest.param(chain_potential, 1e4, id="chain"),
    pytest.param(lattice_potential, 1e4, id="lattice"),
    pytest.param(chain_potential, 50.0, id="soft chain"),
]
HINGE = STUDY["hinge_stiffness"]
Patterns = Callable[[int], Flags]


def finger_with(
    n_units: int, coupling: float, bars: float = np.inf, walls: float = 0.0, *, pulls: bool = True
) -> Finger:
    finger = uniform_finger(n_units, **STUDY, linear_stiffness=bars).changed(
        hinge_coupling=np.array([[coupling]]), wall_compliance=np.array([[walls]])
    )
    return finger if pulls else replace(finger, law=PushOnly(PUBLISHED))


def settled(finger: Finger, patterns: Flags, formulate: Formulate = chain_potential) -> Settled:
    return settle(UnitSolutions.of(finger), formulate, patterns, 1e-12)


def turns(found: Settled) -> Array:
    """Of every hinge, (unit, state), rad."""
    stations = found.potential.coordinates.stations(found.equilibrium.coordinates)
    across = np.arctan2(stations.top_y - stations.base_y, stations.top_x - stations.base_x)
    return -np.diff(across, axis=0, prepend=0.5 * np.pi)


@pytest.mark.parametrize(("formulate", "bars"), FORMULATIONS)
@pytest.mark.parametrize("walls", [0.0, 0.7])
@pytest.mark.parametrize("coupling", [1.2, -1.2, 0.499 * HINGE])
@pytest.mark.slow
def test_states_are_those_of_extended_precision(
    formulate: Formulate, bars: float, walls: float, coupling: float, all_patterns: Patterns
) -> None:
    finger, patterns = finger_with(3, coupling, bars, walls), all_patterns(3)
    found, exact = settled(finger, patterns, formulate), extended_states(finger, patterns)
    assert (exact.is_minimum & exact.in_pattern).all()
    assert (found.status == Status.STABLE).all()
    at = tip(found, with_compliance=False)
    error = np.hypot(*(at.pose[:2] - exact.pose[:2].astype(float)))
    assert (error <= at.error).all()
    assert at.error.max() < 1e-10
    energy = sum(found.equilibrium.energies.values())
    assert energy == pytest.approx(exact.energy.astype(float), rel=1e-11, abs=1e-11)


def test_a_hinge_at_rest_follows_its_neighbor(all_patterns: Patterns) -> None:
    """Of units that nothing else holds, k_θ θ_i = κ (θ_{i-1} + θ_{i+1}): a linear system."""
    coupling = 3.0
    finger = finger_with(4, coupling, pulls=False)
    patterns = all_patterns(4)
    found = settled(finger, patterns)
    assert (found.status == Status.STABLE).all()
    turn = turns(found)
    beside = np.zeros_like(turn)
    beside[1:] += turn[:-1]
    beside[:-1] += turn[1:]
    at_rest = ~patterns
    assert (HINGE * turn)[at_rest] == pytest.approx((coupling * beside)[at_rest], abs=1e-11)
    next_to_one = turn[1, (patterns == np.array([[1], [0], [0], [0]])).all(axis=0)]
    assert 0.03 < next_to_one[0] < 0.05


def test_two_units_are_the_minimum_that_scipy_finds() -> None:
    """Over two turns, with nothing of the package but the law."""
    coupling, height = 2.0, STUDY["segment_height"]

    def energy(turn: Array) -> float:
        values = (STUDY["bistable_stiffness"], STUDY["force_linearity"], STUDY["stroke"])
        domes = bistable(2.0 * height * np.sin(turn / 2.0), *map(np.array, values)).energy
        return float((domes + 0.5 * HINGE * turn**2).sum() - coupling * turn[0] * turn[1])

    found = settled(finger_with(2, coupling), np.array([[True], [False]]))
    best = minimize(energy, [0.3, 0.0], method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 0})
    assert turns(found)[:, 0] == pytest.approx(best.x, rel=1e-6)
    assert found.equilibrium.energies["hinge coupling"][0] == pytest.approx(
        -coupling * best.x[0] * best.x[1], rel=1e-5
    )


def test_no_coupling_is_reached_at_first_order(all_patterns: Patterns) -> None:
    patterns = all_patterns(3)
    without = tip(settled(finger_with(3, 0.0), patterns), with_compliance=False).pose
    off = [
        np.abs(tip(settled(finger_with(3, c), patterns), with_compliance=False).pose - without)
        for c in (1e-3, 1e-4)
    ]
    assert off[0].max() / off[1].max() == pytest.approx(10.0, rel=1e-3)


@pytest.mark.parametrize("coupling", [0.0, 1.2])
@pytest.mark.parametrize("walls", [0.0, 0.7])
def test_sensitivities_by_it(coupling: float, walls: float, all_patterns: Patterns) -> None:
    """Also of a finger that has none: what a little of it would do."""
    patterns, step = all_patterns(3), 1e-4

    def pose(value: float) -> Array:
        found = settled(finger_with(3, value, 1e4, walls), patterns)
        return tip(found, with_compliance=False).pose

    found = sensitivities(
        settled(finger_with(3, coupling, 1e4, walls), patterns),
        [{"hinge_coupling": np.ones((1, 1))}],
    )
    slope = (pose(coupling + step) - pose(coupling - step)) / (2.0 * step)
    assert found.pose[:, 0] == pytest.approx(slope, rel=1e-5, abs=1e-8)
    assert np.abs(slope).max() > 0.01


def test_a_neighbor_may_give_a_unit_its_second_well() -> None:
    """Nothing is called impossible because a unit by itself lacks the state."""
    values = {**STUDY, "force_linearity": 0.098}  # a unit by itself is lost near 0.096
    finger = uniform_finger(3, **values).changed(hinge_coupling=np.array([[0.45 * HINGE]]))
    both = np.array([[True], [True], [True]])
    assert settled(finger.changed(hinge_coupling=np.zeros((1, 1))), both).status != Status.STABLE
    found, exact = settled(finger, both), extended_states(finger, both)
    assert exact.is_minimum.all() and exact.in_pattern.all()
    assert (found.status == Status.STABLE).all()


def test_halves_are_no_way_to_it() -> None:
    plan = explain(Scene(finger_with(14, 1.2), ()), Request(columns=("states",)))
    assert plan.method == "direct"
    without = explain(Scene(finger_with(14, 0.0), ()), Request(columns=("states",)))
    assert without.method == "pairs of half-fingers"


def test_no_bound_is_claimed_before_the_work() -> None:
    plan = explain(Scene(finger_with(3, 1.2, 1e4), ()), Request(target_error=0.01))
    assert np.isinf(plan.error_bound)
    for coupling in (0.0, 1.2):
        rigid = explain(Scene(finger_with(3, coupling), ()), Request())
        assert any("do not feel" in o.why for o in rigid.omissions) == (coupling == 0.0)
