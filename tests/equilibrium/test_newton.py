"""The damped Newton walk: order, damping, exhaustion, and lanes that do not feel each other."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from dpgcli.arrays import Array
from dpgcli.equilibrium.banded import factorize
from dpgcli.equilibrium.newton import Equilibrium, minimize
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.formulation import Formulation, Internal
from dpgcli.mechanics.lattice import Lattice
from dpgcli.mechanics.terms import evaluate

N_UNITS = 4
FORMULATIONS = pytest.mark.parametrize("formulate", [Chain, Lattice])
Reference = Callable[..., Finger]


def opened(formulation: Formulation, strokes: Array) -> Array:
    """All units opened by that many strokes, one lane per number."""
    angle = np.arcsin(strokes * 3.5 / 21.5)[None]
    rest = np.zeros((1, 1))
    shape = (rest, angle, angle, rest)
    spread = (np.broadcast_to(part, (N_UNITS, len(strokes))) for part in shape)
    return formulation.coordinates(Internal(*spread))


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
    reference_finger: Reference, formulate: type[Chain | Lattice], batch: int
) -> None:
    formulation = formulate(reference_finger(N_UNITS, 1e4))
    guess = opened(formulation, np.linspace(0.7, 1.8, batch))
    together = minimize(formulation, guess, 1e-11)
    assert together.iterations.max() > together.iterations.min() + 3
    for lane in (0, batch // 2, batch - 1):
        assert_same_lane(together, lane, minimize(formulation, guess[:, [lane]], 1e-11))


@FORMULATIONS
def test_slow_lanes_leave_the_bits_of_fast_ones(
    reference_finger: Reference, formulate: type[Chain | Lattice]
) -> None:
    formulation = formulate(reference_finger(N_UNITS, 1e4))
    guess = opened(formulation, np.array([0.94, 0.4, 2.5, 0.55]))
    together = minimize(formulation, guess, 1e-11)
    assert together.iterations[1:].max() > together.iterations[0]
    for lane in range(4):
        assert_same_lane(together, lane, minimize(formulation, guess[:, [lane]], 1e-11))


@FORMULATIONS
def test_a_nan_lane_does_not_spoil_its_neighbors(
    reference_finger: Reference, formulate: type[Chain | Lattice]
) -> None:
    formulation = formulate(reference_finger(N_UNITS, 1e4))
    guess = opened(formulation, np.array([0.9, 1.0, 1.2]))
    spoiled = guess.copy()
    spoiled[2, 1] = np.nan
    result = minimize(formulation, spoiled, 1e-11)
    for lane in (0, 2):
        assert_same_lane(result, lane, minimize(formulation, guess[:, [lane]], 1e-11))
    assert not result.relative_residual[1] <= 1e-11


def test_convergence_is_quadratic(reference_finger: Reference) -> None:
    formulation = Chain(reference_finger(N_UNITS, 1e4))
    guess = opened(formulation, np.array([1.05]))
    end = minimize(formulation, guess, 1e-14).coordinates
    errors = np.array(
        [
            np.abs(minimize(formulation, guess, 1e-14, max_iterations=k).coordinates - end).max()
            for k in range(1, 7)
        ]
    )
    steps = np.log(errors[errors > 1e-13])
    orders = np.diff(steps)[1:] / np.diff(steps)[:-1]
    assert orders[-1] == pytest.approx(2.0, abs=0.05)


@FORMULATIONS
@pytest.mark.parametrize("max_iterations", [1, 2, 3, 5, 8])
def test_an_exhausted_lane_is_no_worse_than_its_guess(
    reference_finger: Reference, formulate: type[Chain | Lattice], max_iterations: int
) -> None:
    formulation = formulate(reference_finger(N_UNITS, 1e4))
    guess = opened(formulation, np.linspace(0.7, 2.5, 40))
    before = evaluate(formulation, guess).energy
    result = minimize(formulation, guess, 1e-12, max_iterations=max_iterations)
    exhausted = result.iterations == max_iterations
    assert exhausted.any()
    assert (result.relative_residual[exhausted] > 1e-9).any()
    assert (sum(result.energies.values()) <= before + 1e-12).all()


def test_an_exhausted_lane_is_factorized_where_it_stands(reference_finger: Reference) -> None:
    formulation = Chain(reference_finger(N_UNITS, 1e4))
    guess = opened(formulation, np.array([1.1]))
    result = minimize(formulation, guess, 1e-12, max_iterations=2)
    hessian = evaluate(formulation, result.coordinates).hessian
    pivots = factorize(hessian, formulation.reach).pivots
    np.testing.assert_allclose(result.factorization.pivots, pivots, rtol=1e-12)


def test_from_a_maximum_the_walk_goes_down_to_a_minimum(reference_finger: Reference) -> None:
    """All units at their barriers: a stationary point of highest index but for rounding."""
    formulation = Chain(reference_finger(N_UNITS))
    barrier = 2.0041742418
    guess = opened(formulation, np.array([barrier / 3.5 - 1e-6, barrier / 3.5 + 1e-6]))
    assert (factorize(evaluate(formulation, guess).hessian, formulation.reach).pivots < 0).any()
    result = minimize(formulation, guess, 1e-12)
    assert (result.relative_residual <= 1e-12).all()
    assert (result.curvature > 0.0).all()
    openings = formulation.openings(result.coordinates)
    np.testing.assert_allclose(openings[:, 0], 0.0, atol=1e-9)
    np.testing.assert_allclose(openings[:, 1], 3.2450151985, rtol=1e-9)


@FORMULATIONS
def test_energy_never_rises_on_the_way(
    reference_finger: Reference, formulate: type[Chain | Lattice]
) -> None:
    formulation = formulate(reference_finger(N_UNITS, 1e3))
    guess = opened(formulation, np.linspace(0.6, 2.5, 20))
    energies = np.array(
        [
            sum(minimize(formulation, guess, 1e-12, max_iterations=k).energies.values())
            for k in range(1, 15)
        ]
    )
    assert (np.diff(energies, axis=0) <= 1e-11).all()
