"""Fingers that run into themselves, against the whole outline of every state."""

from collections.abc import Callable

import numpy as np
import pytest
import shapely

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.coordinates import Stations
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential
from dpgcli.states.certify import Status, certify
from dpgcli.states.pairs.compose import paired_states
from dpgcli.states.pairs.halves import Split
from dpgcli.states.settle import settle, settle_from
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
Patterns = Callable[[int], Flags]


def simple(nodes: Stations, height: float) -> Flags:
    """Whether no sides of the outline cross, one polygon at a time."""
    rings = []
    for lane in range(nodes.base_x.shape[1]):
        base = [(0.0, 0.0), *zip(nodes.base_x[:, lane], nodes.base_y[:, lane], strict=True)]
        top = [(0.0, height), *zip(nodes.top_x[:, lane], nodes.top_y[:, lane], strict=True)]
        rings.append(shapely.LinearRing([*base, *top[::-1]]).is_simple)
    return np.array(rings)


def stations(batch_of: UnitSolutions, coordinates: Array) -> Stations:
    return Chain(batch_of.finger).stations(coordinates)


@pytest.mark.parametrize(("n_units", "status"), [(20, "STABLE"), (21, "FOLDED"), (32, "FOLDED")])
@pytest.mark.parametrize("formulation", [chain_potential, lattice_potential])
def test_a_finger_of_the_study_meets_itself_from_21_units_on(
    reference_finger: Fingers, n_units: int, status: str, formulation: Formulate
) -> None:
    """17.36° a unit: 20 turn by 347°, 21 by 365°."""
    units = UnitSolutions.of(reference_finger(n_units, 1e4))
    batch = settle(units, formulation, np.ones((n_units, 1), bool), 1e-12)
    assert certify(batch, units, 1e-12).tolist() == [Status[status]]


def test_no_state_is_certified_that_crosses_itself_and_none_refused_that_does_not() -> None:
    random = np.random.default_rng(8)
    n_crossing = n_open = 0
    for _ in range(25):
        n = int(random.integers(4, 30))
        finger = Finger(
            n,
            segment_length=random.uniform(5.0, 20.0) * random.uniform(0.7, 1.0, (n, 1)),
            segment_height=np.array([[10.75]]),
            stroke=random.uniform(1.0, 12.0) * random.uniform(0.8, 1.0, (n, 1)),
            bistable_stiffness=np.array([[12.84]]),
            force_linearity=np.array([[0.043]]),
            hinge_stiffness=np.array([[24.2]]),
            linear_stiffness=np.array([[1e5]]),
        )
        units = UnitSolutions.of(finger)
        inverted = random.random((n, 60)) < random.random(60) ** 0.3
        batch = settle(units, chain_potential, inverted, 1e-10)
        is_open = simple(stations(units, batch.equilibrium.coordinates), 10.75)
        assert (is_open == ~batch.is_folded).all()
        n_crossing += (~is_open).sum()
        n_open += is_open.sum()
    assert min(n_crossing, n_open) > 300


def test_pairs_say_what_the_whole_finger_says(
    reference_finger: Fingers, all_patterns: Patterns
) -> None:
    units = UnitSolutions.of(reference_finger(12, 1e6, stroke=8.0))
    (pairs,) = paired_states(Split(units, 6, 2, 1e-12))
    direct = certify(settle(units, chain_potential, all_patterns(12), 1e-12), units, 1e-12)
    fits = pairs.status != Status.NOT_CONVERGED
    assert (pairs.status[fits] == direct[fits]).all()
    assert (direct[fits] == Status.FOLDED).sum() > 100
    assert (direct[fits] == Status.STABLE).sum() > 100


def test_a_loop_of_soft_units_is_looked_for_by_their_stroke(reference_finger: Fingers) -> None:
    """Where the rigid well does not tell how far a unit turns, the full stroke does."""
    finger = reference_finger(20, 12.84 * 0.05, force_linearity=0.09)
    units = UnitSolutions.of(finger)
    assert units.are_soft.all()
    assert units.shortest_loop is not None, "20 units of 18.7°"
    stiff = UnitSolutions.of(reference_finger(20, 1e4))
    assert stiff.shortest_loop is None, "20 units of 17.4°"


def test_a_shape_given_as_a_start_is_looked_at_too(reference_finger: Fingers) -> None:
    finger = reference_finger(24, 1e4)
    units, chain = UnitSolutions.of(finger), chain_potential(finger)
    inverted = np.ones((24, 1), bool)
    start = settle(units, chain_potential, inverted, 1e-12).equilibrium.coordinates
    assert settle_from(units, chain, inverted, start, 1e-12).is_folded.tolist() == [True]
