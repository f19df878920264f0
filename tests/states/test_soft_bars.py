"""States between soft bars, against an independent minimizer that holds the domes open first."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from dpgcli.arrays import Array, Flags
from dpgcli.benchmark.network import SpringNetwork
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.lattice import Lattice
from dpgcli.mechanics.terms import Formulate, chain_potential
from dpgcli.states.certify import Status, certify
from dpgcli.states.guess import stroke_guess
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]


def random_fingers(seed: int, count: int, softest: float) -> Iterator[tuple[Finger, Flags]]:
    """Fingers of up to three units with k_L/k_b from `softest` to ten times that, and patterns."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        n = int(random.integers(1, 4))
        shape = (n, 1) if random.random() < 0.5 else (1, 1)
        height = random.uniform(5.0, 20.0, (1, 1))
        stiffness = 10.0 ** random.uniform(-1.0, 1.7) * random.uniform(0.6, 1.6, shape)
        finger = Finger(
            n,
            segment_length=random.uniform(0.3, 1.5, shape) * height,
            segment_height=height,
            stroke=height * 10.0 ** random.uniform(-1.3, 0.2, shape),
            bistable_stiffness=stiffness,
            force_linearity=random.uniform(0.0, 0.12, shape),
            hinge_stiffness=10.0 ** random.uniform(-3.0, -0.5, shape) * stiffness * height**2,
            linear_stiffness=stiffness.max(axis=0, keepdims=True)
            * softest
            * 10.0 ** random.uniform(0.0, 1.0, (1, 1)),
        )
        inverted = random.random((n, 1)) < 0.6
        inverted[0] |= not inverted.any()
        yield finger, inverted


def by_unit(finger: Finger, name: str) -> Array:
    return np.broadcast_to(getattr(finger, name), (finger.n_units, 1))[:, 0]


def turning_points(finger: Finger) -> Array:
    """Where each dome's spring turns over, in closed form; 3/4 stroke where it never does."""
    beta = 1.0 - by_unit(finger, "force_linearity")
    squared = 9.0 * beta**2 - 8.0 * beta
    root = np.sqrt(np.maximum(squared, 0.0))
    share = np.where(squared > 0.0, (3.0 * beta - root) / (4.0 * beta), 0.75)
    return share * by_unit(finger, "stroke")


def is_state(finger: Finger, inverted: Flags, nodes: Array) -> bool:
    """A minimum of the network in its pattern, with no corner beyond 90° or strut crossed."""
    network, n = SpringNetwork.of(finger), finger.n_units
    scale = (by_unit(finger, "bistable_stiffness") * by_unit(finger, "stroke")).max()
    strains = network._strains(nodes)
    top, strut = strains.along[-n:], strains.along[n : 2 * n + 1]
    swings = [top[:, 0] * side[:, 1] - top[:, 1] * side[:, 0] for side in (strut[:-1], strut[1:])]
    sides = strains.extension[-n:] > turning_points(finger)
    return bool(
        np.abs(network.energy_and_gradient(nodes)[1]).max() < 1e-8 * scale
        and np.linalg.eigvalsh(network.hessian(nodes))[0] > 0.0
        and (sides == inverted[:, 0]).all()
        and np.abs(strains.corner).max() < 0.5 * np.pi
        and min(swing.min() for swing in swings) > 0.0
    )


def independent(finger: Finger, inverted: Flags) -> Array | None:
    """Nodes of the pattern's state by SciPy, or None: domes held at full stroke, then let go."""
    network, n = SpringNetwork.of(finger), finger.n_units
    stroke = by_unit(finger, "stroke")
    target, hold = stroke * inverted[:, 0], 100.0 * network.stiffness.max()

    def held(nodes: Array) -> tuple[float, Array]:
        energy, gradient = network.energy_and_gradient(nodes)
        strains = network._strains(nodes)
        off = strains.extension[-n:] - target
        slope = hold * off @ network._rates(strains).length[-n:]
        return energy + 0.5 * hold * float(off @ off), gradient + slope

    start = Lattice(finger).of_shape(stroke_guess(finger, inverted, 1.0))[:, 0]
    settled = minimize(held, start, jac=True, method="BFGS", options={"maxiter": 400}).x
    scale = (by_unit(finger, "bistable_stiffness") * stroke).max()
    found = minimize(
        network.energy_and_gradient,
        settled,
        jac=True,
        hess=network.hessian,
        method="trust-exact",
        options={
            "gtol": 1e-10 * scale,
            "initial_trust_radius": 0.05 * stroke.min(),
            "max_trust_radius": 0.2 * stroke.min(),
        },
    )
    return found.x if is_state(finger, inverted, found.x) else None


def solved(
    finger: Finger, inverted: Flags, formulation: Formulate = chain_potential
) -> tuple[Status, Array]:
    units = UnitSolutions.of(finger)
    batch = settle(units, formulation, inverted, 1e-12)
    nodes = np.stack(batch.potential.coordinates.stations(batch.equilibrium.coordinates), axis=1)
    return Status(certify(batch, units, 1e-12)[0]), nodes.ravel()


@pytest.mark.slow
@pytest.mark.parametrize("softest", [0.01, 0.1, 1.0, 10.0])
def test_no_state_is_missed_and_none_is_wrong(softest: float) -> None:
    n_states = n_none = 0
    for finger, inverted in random_fingers(1, 60, softest):
        status, nodes = solved(finger, inverted)
        exists = independent(finger, inverted) is not None
        if status is Status.STABLE:
            assert is_state(finger, inverted, nodes)
        else:
            assert not exists, (status, finger, inverted[:, 0])
        if status is Status.NOT_BISTABLE:
            assert not exists
        n_states, n_none = n_states + exists, n_none + (not exists)
    assert min(n_states, n_none) > 5


SOFT = {"segment_length": 12.0, "segment_height": 10.0, "stroke": 4.0, "bistable_stiffness": 10.0}


@pytest.mark.parametrize(
    ("pattern", "changes", "bars"),
    [
        ("1", {"force_linearity": 0.1, "hinge_stiffness": 40.0}, 0.1),
        ("101", {"force_linearity": 0.09, "hinge_stiffness": 80.0}, 0.2),
        ("11", {"force_linearity": 0.02, "hinge_stiffness": 20.0, "stroke": 36.0}, 0.4),
    ],
)
def test_a_state_between_soft_bars_that_rigid_ones_would_not_have(
    pattern: str, changes: dict[str, float], bars: float
) -> None:
    """The last is opened by more than twice its height, which only stretched struts allow."""
    values = {**STUDY, **SOFT, **changes}
    finger = uniform_finger(len(pattern), **values, linear_stiffness=bars)
    inverted = np.array([[digit == "1"] for digit in pattern])
    assert not UnitSolutions.of(finger).wells.exists.any()
    status, nodes = solved(finger, inverted)
    assert status is Status.STABLE
    assert is_state(finger, inverted, nodes)
    assert nodes == pytest.approx(independent(finger, inverted), abs=1e-6)


CHORDS_GIVE_WAY = uniform_finger(
    2,
    segment_length=7.8,
    segment_height=13.3,
    stroke=36.0,
    bistable_stiffness=2.4,
    force_linearity=0.0,
    hinge_stiffness=0.029,
    linear_stiffness=0.11,
)
PULLED_FROM_STRAIGHT = uniform_finger(
    3,
    segment_length=13.8,
    segment_height=11.17,
    stroke=42.8,
    bistable_stiffness=0.14,
    force_linearity=0.1,
    hinge_stiffness=1.11,
    linear_stiffness=0.00168,
)


@pytest.mark.parametrize(
    ("finger", "pattern"),
    [(CHORDS_GIVE_WAY, "01"), (CHORDS_GIVE_WAY, "10"), (PULLED_FROM_STRAIGHT, "001")],
)
def test_a_state_whose_bars_are_strained_far_beyond_the_first_order(
    finger: Finger, pattern: str
) -> None:
    """Chords are stretched by half their length, though to first order corners hardly turn."""
    inverted = np.array([[digit == "1"] for digit in pattern])
    status, nodes = solved(finger, inverted)
    assert status is Status.STABLE
    assert is_state(finger, inverted, nodes)


def test_a_search_that_stalls_between_stiff_bars_is_made_again(
    extended_state: Callable[..., Any],
) -> None:
    """Units of 95 and 0.13 N/mm, and a hinge of 2e-6 N mm/rad: the search from the guess stalls."""
    values = {
        "segment_length": [13.521356261359175, 19.62060533905622],
        "segment_height": [9.240178021868507],
        "stroke": [19.31166805094475, 18.514752183267174],
        "bistable_stiffness": [95.26264629209065, 0.1298985700619414],
        "force_linearity": [0.0001, 0.0],
        "hinge_stiffness": [3.6281941996104354, 2.277576595556012e-06],
        "linear_stiffness": [85157.23504274359],
    }
    columns = {name: np.array(value)[:, None] for name, value in values.items()}
    finger = Finger(2, **columns)
    inverted = np.array([[False], [True]])
    status, nodes = solved(finger, inverted)
    assert status is Status.STABLE
    truth = extended_state(finger, nodes)
    assert truth.is_minimum
    assert np.array(truth.nodes, float) == pytest.approx(nodes, abs=1e-6)


@pytest.mark.parametrize(("share", "is_soft"), [(0.04, False), (0.06, True)])
def test_bars_give_way_before_a_stiff_hinge(
    reference_finger: Callable[..., Finger], share: float, is_soft: bool
) -> None:
    """Of a dome too weak to hold it open: rigid bars prove nothing then."""
    bars = 1e3
    finger = reference_finger(1, bars, hinge_stiffness=share * bars * 10.75**2)
    units = UnitSolutions.of(finger)
    assert not units.wells.exists.any()
    assert units.are_soft.tolist() == [[is_soft]]
    assert units.have_no_well.tolist() == [[not is_soft]]
