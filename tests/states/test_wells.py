"""The rigid single unit: closed forms, the loss of bistability, and extreme units."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq, minimize_scalar

from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.guess import FirstOrder, first_order, geometric_guess
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions
from dpgcli.states.wells import inverted_wells

Reference = Callable[..., Finger]


def slope(opening: float, linearity: float, hinge: float = 24.2) -> float:
    """de/dφ of a rigid unit, written from the model; x = 2H sin(φ/2)."""
    x, u = 21.5 * np.sin(opening / 2), 21.5 * np.sin(opening / 2) / 3.5
    force = 12.84 * x * (1 + (1 - linearity) * (2 * u * u - 3 * u))
    return float(force * 10.75 * np.cos(opening / 2) + hinge * opening)


def lowest_slope(linearity: float) -> float:
    """The least moment over the middle of the range; below zero the unit is bistable."""
    found = minimize_scalar(
        lambda opening: slope(opening, linearity) / opening, bounds=(0.1, 0.4), method="bounded"
    )
    return float(found.fun)


@given(linearity=st.floats(0.0, 0.111), stroke=st.floats(1e-3, 5.0))
def test_without_hinge_the_wells_are_in_closed_form(
    reference_finger: Reference, linearity: float, stroke: float
) -> None:
    finger = reference_finger(1, force_linearity=linearity, hinge_stiffness=0.0, stroke=stroke)
    wells = inverted_wells(finger)
    beta = 1.0 - linearity
    root = np.sqrt(9.0 * beta**2 - 8.0 * beta)
    assert wells.exists.all()
    assert wells.extension / stroke == pytest.approx((3 * beta + root) / (4 * beta), rel=1e-10)
    assert wells.barrier / stroke == pytest.approx((3 * beta - root) / (4 * beta), rel=1e-10)


def test_bistability_is_lost_where_an_independent_search_says(
    reference_finger: Reference,
) -> None:
    low, high = 0.09, 0.1
    while high - low > 1e-13:
        middle = 0.5 * (low + high)
        exists = inverted_wells(reference_finger(1, force_linearity=middle)).exists.all()
        low, high = (middle, high) if exists else (low, middle)
    assert low == pytest.approx(0.096, abs=5e-4)
    assert low == pytest.approx(brentq(lowest_slope, 0.09, 0.1, xtol=1e-14), abs=1e-10)


@pytest.mark.parametrize("margin", [1e-3, 1e-6, 1e-9, 1e-12])
def test_near_the_loss_the_well_is_still_a_zero_of_the_moment(
    reference_finger: Reference, margin: float
) -> None:
    linearity = 0.0964682337467354 - margin
    wells = inverted_wells(reference_finger(1, force_linearity=linearity))
    assert wells.exists.all() and (wells.barrier < wells.extension).all()
    for x in (wells.extension, wells.barrier):
        moment = slope(2 * np.arcsin(float(x[0, 0]) / 21.5), linearity)
        assert moment == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("linearity", [0.098, 0.2, 0.5, 0.9])
def test_a_unit_past_the_loss_has_no_well(reference_finger: Reference, linearity: float) -> None:
    with np.errstate(invalid="ignore"):
        assert not inverted_wells(reference_finger(1, force_linearity=linearity)).exists.any()


@pytest.mark.parametrize("changes", [{"force_linearity": 1.0}, {"hinge_stiffness": 1e9}])
def test_looking_for_a_well_that_is_not_there_warns_of_nothing(
    reference_finger: Reference, changes: dict[str, float]
) -> None:
    assert not inverted_wells(reference_finger(1, **changes)).exists.any()


@given(
    stroke=st.floats(-3.0, 1.5),
    hinge=st.floats(-6.0, 0.0),
    height=st.floats(-1.0, 2.0),
    linearity=st.floats(0.0, 0.11),
)
def test_a_well_exists_where_the_moment_changes_sign(
    reference_finger: Reference, stroke: float, hinge: float, height: float, linearity: float
) -> None:
    """Against a scan of the closed form over the whole range of openings."""
    h, d = 10.0**height, 10.0**stroke
    finger = reference_finger(
        1,
        segment_height=h,
        stroke=d,
        hinge_stiffness=10.0**hinge * 12.84 * h * h,
        force_linearity=linearity,
    )
    with np.errstate(invalid="ignore"):
        exists = bool(inverted_wells(finger).exists.all())
    u = np.linspace(1e-6, min(1.5, 2.0 * h / d * (1 - 1e-12)), 20_001)
    opening = 2.0 * np.arcsin(np.minimum(u * d / (2.0 * h), 1.0))
    moment = 1 + (1 - linearity) * (2 * u * u - 3 * u) + 10.0**hinge * opening / np.sin(opening)
    if abs(moment.min()) > 1e-6:
        assert exists == (moment < 0.0).any()


def test_units_are_solved_as_if_each_were_alone(graded_finger: Callable[..., Finger]) -> None:
    finger = graded_finger(6, 21, np.inf)
    together = inverted_wells(finger)
    for i in range(6):
        alone = inverted_wells(finger.section(i, i + 1))
        assert together.extension[i] == pytest.approx(alone.extension[0], rel=1e-15)
        assert together.barrier[i] == pytest.approx(alone.barrier[0], rel=1e-15)


@pytest.mark.parametrize("linear_stiffness", [np.inf, 1e4])
def test_the_guess_of_a_hingeless_finger_is_finite(
    reference_finger: Reference, linear_stiffness: float
) -> None:
    finger = reference_finger(1, linear_stiffness, hinge_stiffness=0.0)
    unit: FirstOrder = first_order(finger, inverted_wells(finger))
    guess = geometric_guess(finger, np.ones((1, 1), bool), unit)
    assert all(np.isfinite(part).all() for part in guess)


def test_the_first_order_guess_errs_at_second_order(reference_finger: Reference) -> None:
    """Guess against the converged state: a tenfold k_L leaves a hundredth of the error."""
    errors = []
    for linear_stiffness in (1e4, 1e5):
        units = UnitSolutions.of(reference_finger(3, linear_stiffness))
        inverted = np.array([[True], [False], [True]])
        solved = settle(units, chain_potential, inverted, 1e-13).equilibrium.coordinates
        guess = Chain(units.finger).of_shape(
            geometric_guess(units.finger, inverted, units.first_order)
        )
        errors.append(np.abs(solved - guess).max())
    assert errors[0] / errors[1] == pytest.approx(100.0, rel=0.05)
