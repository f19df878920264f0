"""A couple on the end phalanx: closed forms, both coordinates, and no term where it is 0."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from dpgcli.calibration.unit import PARABOLA
from dpgcli.mechanics.curve import spline
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.laws import PushOnly, Tabulated
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential
from dpgcli.states.certify import Settled, Status
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
MOMENTS = np.array([[0.0, 2.5, -5.0, 10.0]])  # N mm
SPLINE = 3e-10  # what the top of its curve leaves of a spline's parabola, 20 knots away
HINGE, LEVER, SPRING, TOO_LONG = 31.0, 10.0, 50.0, 3.5


def pushed(reference_finger: Fingers, n_units: int, compliance: float, bars: float) -> Finger:
    """A finger whose domes are springs that are too long."""
    values = {"hinge_stiffness": HINGE, "segment_height": LEVER, "stroke": TOO_LONG}
    finger = reference_finger(n_units, bars, bistable_stiffness=SPRING, **values)
    finger = finger.changed(
        wall_compliance=np.array([[compliance]]),
        end_moment=MOMENTS,
        force_linearity=np.zeros((1, 1)),
    )
    return replace(finger, law=PushOnly(Tabulated(spline(*PARABOLA))))


def solved(finger: Finger, formulate: Formulate, pattern: list[bool]) -> Settled:
    inverted = np.repeat(np.array(pattern)[:, None], MOMENTS.size, axis=1)
    settled = settle(UnitSolutions.of(finger), formulate, inverted, 1e-13)
    assert (settled.status == Status.STABLE).all()
    return settled


def turns(settled: Settled) -> np.ndarray:
    return -settled.potential.coordinates.tip(settled.equilibrium.coordinates)[0][2]


def test_a_ground_unit_turns_by_the_moment_over_its_hinge(reference_finger: Fingers) -> None:
    finger = pushed(reference_finger, 1, 0.0, np.inf)
    found = turns(solved(finger, chain_potential, [False]))
    assert found == pytest.approx(MOMENTS[0] / HINGE, abs=1e-13)


@pytest.mark.parametrize("compliance", [0.0, 0.02, 0.9, 50.0])
def test_an_inverted_unit_balances_load_push_and_hinge(
    reference_finger: Fingers, compliance: float
) -> None:
    """k θ = M + P H cos(θ/2) with P = k (s − 2 H sin(θ/2)) / (1 + c k): a root by SciPy."""
    found = turns(solved(pushed(reference_finger, 1, compliance, np.inf), chain_potential, [True]))
    for moment, turn in zip(MOMENTS[0], found, strict=True):

        def unbalanced(angle: float, moment: float = moment) -> float:
            too_long = max(TOO_LONG - 2.0 * LEVER * np.sin(angle / 2.0), 0.0)
            push = SPRING * too_long / (1.0 + compliance * SPRING)
            return float(HINGE * angle - moment - push * LEVER * np.cos(angle / 2.0))

        assert turn == pytest.approx(brentq(unbalanced, -1.0, 1.0, xtol=1e-14), abs=SPLINE)


@pytest.mark.parametrize("compliance", [0.0, 0.9])
def test_both_coordinates_agree(reference_finger: Fingers, compliance: float) -> None:
    finger = pushed(reference_finger, 3, compliance, 1e4)
    pattern = [True, False, True]
    chain, lattice = (
        turns(solved(finger, formulate, pattern))
        for formulate in (chain_potential, lattice_potential)
    )
    assert chain == pytest.approx(lattice, abs=1e-10)
    assert np.ptp(chain) > 0.3, "and the moment turns it"


def test_no_moment_is_no_term(reference_finger: Fingers) -> None:
    finger = reference_finger(2, 1e4)
    assert "load" not in chain_potential(finger).kinds
    assert "load" in chain_potential(finger.changed(end_moment=np.array([[1.0]]))).kinds
