"""The damped Newton walk: order, damping, exhaustion, and lanes that do not feel each other."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from dpgcli.arrays import Array
from dpgcli.equilibrium.banded import factorize
from dpgcli.equilibrium.newton import Equilibrium, minimize, stationary
from dpgcli.mechanics.coordinates import FingerPotential, Internal
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential

N_UNITS = 4
FORMULATIONS = pytest.mark.parametrize("formulate", [chain_potential, lattice_potential])
Reference = Callable[..., Finger]


def opened(potential: FingerPotential, strokes: Array) -> Array:
    """All units opened by that many strokes, one lane per number."""
    angle = np.arcsin(strokes * 3.5 / 21.5)[None]
    rest = np.zeros((1, 1))
    shape = (rest, angle, angle, rest)
    spread = (np.broadcast_to(part, (N_UNITS, len(strokes))) for part in shape)
    return potential.coordinates.of_shape(Internal(*spread))


def assert_same_lane(all_lanes: Equilibrium, lane: int, alone: Equilibrium) -> None:
    assert_array_equal(all_lanes.coordinates[:, lane], alone.coordinates[:, 0])
    assert_array_equal(all_lanes.gradient[:, lane], alone.gradient[:, 0])
    assert_array_equal(all_lanes.factorization.pivots[:, lane], alone.factorization.pivots[:, 0])
    for name in ("residual", "relative_residual", "curvature", "iterations"):
        assert getattr(all_lanes, name)[lane] == getattr(alone, name)[0]
    for kind, energy in all_lanes.energies.items():
        assert energy[lane] == alone.energies[kind][0]


@FORMULATIONS
@pytest.mark.parametrize("batch", [7, 1000])
def test_a_lane_alone_and_in_a_batch_has_the_same_bits(
    reference_finger: Reference, formulate: Formulate, batch: int
) -> None:
    potential = formulate(reference_finger(N_UNITS, 1e4))
    guess = opened(potential, np.linspace(0.7, 1.8, batch))
    together = minimize(potential, guess, 1e-11)
    assert together.iterations.max() > together.iterations.min() + 3
    for lane in (0, batch // 2, batch - 1):
        assert_same_lane(together, lane, minimize(potential, guess[:, [lane]], 1e-11))


@FORMULATIONS
def test_slow_lanes_leave_the_bits_of_fast_ones(
    reference_finger: Reference, formulate: Formulate
) -> None:
    potential = formulate(reference_finger(N_UNITS, 1e4))
    guess = opened(potential, np.array([0.94, 0.4, 2.5, 0.55]))
    together = minimize(potential, guess, 1e-11)
    assert together.iterations[1:].max() > together.iterations[0]
    for lane in range(4):
        assert_same_lane(together, lane, minimize(potential, guess[:, [lane]], 1e-11))


@FORMULATIONS
def test_a_nan_lane_does_not_spoil_its_neighbors(
    reference_finger: Reference, formulate: Formulate
) -> None:
    potential = formulate(reference_finger(N_UNITS, 1e4))
    guess = opened(potential, np.array([0.9, 1.0, 1.2]))
    spoiled = guess.copy()
    spoiled[2, 1] = np.nan
    result = minimize(potential, spoiled, 1e-11)
    for lane in (0, 2):
        assert_same_lane(result, lane, minimize(potential, guess[:, [lane]], 1e-11))
    assert not result.relative_residual[1] <= 1e-11


def test_convergence_is_quadratic(reference_finger: Reference) -> None:
    potential = chain_potential(reference_finger(N_UNITS, 1e4))
    guess = opened(potential, np.array([1.05]))
    end = minimize(potential, guess, 1e-14).coordinates
    errors = np.array(
        [
            np.abs(minimize(potential, guess, 1e-14, max_iterations=k).coordinates - end).max()
            for k in range(1, 7)
        ]
    )
    steps = np.log(errors[errors > 1e-13])
    orders = np.diff(steps)[1:] / np.diff(steps)[:-1]
    assert orders[-1] == pytest.approx(2.0, abs=0.05)


@FORMULATIONS
@pytest.mark.parametrize("max_iterations", [1, 2, 3, 5, 8])
def test_an_exhausted_lane_is_no_worse_than_its_guess(
    reference_finger: Reference, formulate: Formulate, max_iterations: int
) -> None:
    potential = formulate(reference_finger(N_UNITS, 1e4))
    guess = opened(potential, np.linspace(0.7, 2.5, 40))
    before = potential.evaluate(guess).energy
    result = minimize(potential, guess, 1e-12, max_iterations=max_iterations)
    exhausted = result.iterations == max_iterations
    assert exhausted.any()
    assert (result.relative_residual[exhausted] > 1e-9).any()
    assert (sum(result.energies.values()) <= before + 1e-12).all()


def test_an_exhausted_lane_is_factorized_where_it_stands(reference_finger: Reference) -> None:
    potential = chain_potential(reference_finger(N_UNITS, 1e4))
    guess = opened(potential, np.array([1.1]))
    result = minimize(potential, guess, 1e-12, max_iterations=2)
    hessian = potential.evaluate(result.coordinates).hessian
    pivots = factorize(hessian, potential.column_depths).pivots
    np.testing.assert_allclose(result.factorization.pivots, pivots, rtol=1e-12)


def test_from_a_maximum_the_walk_goes_down_to_a_minimum(reference_finger: Reference) -> None:
    """All units at their barriers: a stationary point of highest index but for rounding."""
    potential = chain_potential(reference_finger(N_UNITS))
    barrier = 2.0041742418
    guess = opened(potential, np.array([barrier / 3.5 - 1e-6, barrier / 3.5 + 1e-6]))
    assert (factorize(potential.evaluate(guess).hessian, potential.column_depths).pivots < 0).any()
    result = minimize(potential, guess, 1e-12)
    assert (result.relative_residual <= 1e-12).all()
    assert (result.curvature > 0.0).all()
    openings = potential.coordinates.openings(result.coordinates)
    np.testing.assert_allclose(openings[:, 0], 0.0, atol=1e-9)
    np.testing.assert_allclose(openings[:, 1], 3.2450151985, rtol=1e-9)


@FORMULATIONS
def test_energy_never_rises_on_the_way(reference_finger: Reference, formulate: Formulate) -> None:
    potential = formulate(reference_finger(N_UNITS, 1e3))
    guess = opened(potential, np.linspace(0.6, 2.5, 20))
    energies = np.array(
        [
            sum(minimize(potential, guess, 1e-12, max_iterations=k).energies.values())
            for k in range(1, 15)
        ]
    )
    assert (np.diff(energies, axis=0) <= 1e-11).all()


def test_undamped_steps_reach_the_saddle_and_the_minimum_next_to_them() -> None:
    """One unit between rigid bars: its top at x = 2.0041742418 mm, its well at 3.2450151985."""
    potential = chain_potential(uniform_finger(1, **STUDY))
    corners = np.arcsin(np.array([2.0041742418, 3.2450151985]) / 21.5)
    away = np.array([[0.01, -0.004], [0.002, 0.003]])
    there = stationary(potential, corners + away, 1e-12)
    np.testing.assert_allclose(there.coordinates, np.stack((corners, corners)), atol=1e-10)
    assert there.factorization.n_negative.tolist() == [1, 0]
    assert (there.relative_residual <= 1e-12).all()
    assert (there.iterations <= 8).all()  # quadratic
    alone = [stationary(potential, (corners + away)[:, [lane]], 1e-12) for lane in (0, 1)]
    assert [float(one.energy[0]) for one in alone] == there.energy.tolist()


def test_undamped_steps_that_are_too_few_say_so() -> None:
    potential = chain_potential(uniform_finger(1, **STUDY))
    there = stationary(potential, np.array([[0.11], [0.08]]), 1e-12, max_iterations=1)
    assert there.relative_residual[0] > 1e-6
    assert there.iterations.tolist() == [1]
