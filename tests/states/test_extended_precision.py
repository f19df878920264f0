"""States against a lattice of 50 digits that shares no code with the package."""

from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential
from dpgcli.states.certify import Status, certify
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

Extended = Callable[[Finger, Array], Any]
FOLD = 0.0964682337467354  # α at which the reference unit loses its second well


def true_and_stated_errors(
    finger: Finger,
    inverted: Flags,
    formulate: Formulate,
    extended_state: Extended,
) -> tuple[float, float]:
    units = UnitSolutions.of(finger)
    batch = settle(units, formulate, inverted, 1e-12)
    assert certify(batch, units, 1e-12).tolist() == [Status.STABLE]
    at_tip = tip(batch, with_compliance=False)
    stations = batch.potential.coordinates.stations(batch.equilibrium.coordinates)
    nodes = np.stack(stations, axis=1).reshape(-1)
    truth = extended_state(finger, nodes)
    assert truth.is_minimum
    energy = sum(batch.equilibrium.energies.values())
    assert energy == pytest.approx(float(truth.energy), rel=1e-9, abs=1e-12)
    error = np.hypot(*(float(truth.tip[k] - float(at_tip.pose[k, 0])) for k in (0, 1)))
    return float(error), float(at_tip.error[0])


@pytest.mark.parametrize("relative_stiffness", [1e1, 1e3, 1e5, 1e7, 1e9])
@pytest.mark.parametrize("pattern", ["1", "101"])
def test_tip_error_covers_the_true_error(
    graded_finger: Callable[..., Finger],
    units_of: Callable[..., Flags],
    extended_state: Extended,
    relative_stiffness: float,
    pattern: str,
) -> None:
    finger = graded_finger(len(pattern), 11, 12.84 * relative_stiffness)
    error, stated = true_and_stated_errors(
        finger, units_of(pattern), chain_potential, extended_state
    )
    assert error <= stated < 1e-9


@pytest.mark.parametrize("relative_stiffness", [1e1, 1e4])
def test_tip_error_of_the_lattice_covers_the_true_error(
    graded_finger: Callable[..., Finger],
    units_of: Callable[..., Flags],
    extended_state: Extended,
    relative_stiffness: float,
) -> None:
    finger = graded_finger(2, 12, 12.84 * relative_stiffness)
    error, stated = true_and_stated_errors(
        finger, units_of("11"), lattice_potential, extended_state
    )
    assert error <= stated < 1e-6


@pytest.mark.parametrize("margin", [1e-2, 1e-4, 1e-6])
def test_tip_error_covers_the_true_error_near_the_loss_of_bistability(
    reference_finger: Callable[..., Finger],
    units_of: Callable[..., Flags],
    extended_state: Extended,
    margin: float,
) -> None:
    finger = reference_finger(2, 1e6, force_linearity=FOLD - margin)
    error, stated = true_and_stated_errors(finger, units_of("11"), chain_potential, extended_state)
    assert error <= stated


@pytest.mark.parametrize("margin", [1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize("linear_stiffness", [1e6, 1e9])
def test_tip_error_is_of_the_right_size_at_the_loss_of_bistability(
    reference_finger: Callable[..., Finger],
    units_of: Callable[..., Flags],
    extended_state: Extended,
    margin: float,
    linear_stiffness: float,
) -> None:
    finger = reference_finger(1, linear_stiffness, force_linearity=FOLD - margin)
    error, stated = true_and_stated_errors(finger, units_of("1"), chain_potential, extended_state)
    assert error <= 4.0 * stated


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_tip_error_covers_the_true_error_of_random_four_unit_fingers(
    graded_finger: Callable[..., Finger], extended_state: Extended, seed: int
) -> None:
    random = np.random.default_rng(seed)
    finger = graded_finger(4, seed, 12.84 * 10.0 ** random.uniform(1, 9))
    inverted = random.random((4, 1)) < 0.6
    error, stated = true_and_stated_errors(finger, inverted, chain_potential, extended_state)
    assert error <= stated < 1e-9


def tip_of_a_rigid_finger(pattern: str, stroke: float) -> tuple[mpmath.mpf, mpmath.mpf]:
    """Each inverted unit turns by 2m, where the moment k_θ φ + F H cos m of x = 2H sin m is 0."""
    height, stiffness, hinge, beta = map(mpmath.mpf, (10.75, 12.84, 24.2, 1.0 - 0.043))

    def moment(m: mpmath.mpf) -> mpmath.mpf:
        x = 2 * height * mpmath.sin(m)
        u = x / mpmath.mpf(stroke)
        force = stiffness * x * (1 + beta * (2 * u * u - 3 * u))
        return force * height * mpmath.cos(m) + 2 * hinge * m

    corner = mpmath.findroot(moment, 0.927 * stroke / 21.5)
    x = y = turn = mpmath.mpf(0)
    for digit in pattern:
        turn -= corner * int(digit)
        x += mpmath.mpf(13.5) * mpmath.cos(turn)
        y += mpmath.mpf(13.5) * mpmath.sin(turn)
        turn -= corner * int(digit)
    return x, y


@pytest.mark.parametrize("stroke", [0.1, 3.5, 8.0])
@pytest.mark.parametrize("n_units", [5, 20, 64])
def test_tip_error_covers_the_rounding_of_long_rigid_fingers(
    reference_finger: Callable[..., Finger],
    n_units: int,
    stroke: float,
) -> None:
    inverted = np.random.default_rng(13).random((n_units, 40)) < np.linspace(0.0, 1.0, 40)
    units = UnitSolutions.of(reference_finger(n_units, stroke=stroke))
    at_tip = tip(settle(units, chain_potential, inverted, 1e-12), with_compliance=False)
    for state in range(40):
        with mpmath.workdps(40):
            pattern = "".join(str(int(digit)) for digit in inverted[:, state])
            x, y = tip_of_a_rigid_finger(pattern, stroke)
            error = mpmath.hypot(x - float(at_tip.pose[0, state]), y - float(at_tip.pose[1, state]))
        assert float(error) <= at_tip.error[state]
