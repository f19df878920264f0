"""Splines of a dome's energy: through their points, smooth, and at rest where they say."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from dpgcli.mechanics.curve import bridged, spline

TRAVEL = np.array([0.0, 0.2, 0.45, 0.7, 0.9, 1.0, 1.1, 1.3])
ENERGY = 0.5 * TRAVEL**2 * (0.043 + 0.957 * (1.0 - TRAVEL) ** 2)
CURVE = spline(tuple(TRAVEL), tuple(ENERGY))


def test_it_is_scipy_s_spline_between_its_ends() -> None:
    peer = CubicSpline(TRAVEL, ENERGY, bc_type=((1, 0.0), "not-a-knot"))
    travel = np.linspace(0.0, 1.3, 101)
    for order, part in enumerate(CURVE(travel)):
        assert part == pytest.approx(peer(travel, order), rel=1e-12, abs=1e-15)


def test_it_goes_through_its_points_and_rests_at_zero() -> None:
    energy, force, _ = CURVE(TRAVEL)
    assert energy == pytest.approx(ENERGY, abs=1e-15)
    assert force[0] == 0.0


@pytest.mark.parametrize("knot", TRAVEL)
def test_energy_force_and_stiffness_have_no_jump(knot: float) -> None:
    """At inner knots and at both ends, where the spline is continued."""
    before, after = CURVE(knot * (1.0 + 1e-9) - 1e-9), CURVE(knot * (1.0 + 1e-9) + 1e-9)
    for left, right in zip(before, after, strict=True):
        assert abs(left - right) < 1e-7


@pytest.mark.parametrize(("start", "end"), [(-1.0, -0.2), (1.4, 3.0)])
def test_beyond_its_ends_the_curvature_stays(start: float, end: float) -> None:
    bend = CURVE(np.linspace(start, end, 5)).bend
    assert bend == pytest.approx(np.full(5, bend[0]), rel=1e-14)


def test_rests_are_where_an_independent_search_finds_them() -> None:
    peer = CubicSpline(TRAVEL, ENERGY, bc_type=((1, 0.0), "not-a-knot"))
    found = [brentq(lambda u: float(peer(u, 1)), *around) for around in ((0.3, 0.7), (0.8, 1.2))]
    assert CURVE.rests == pytest.approx(found, rel=1e-10)


def test_without_a_second_well_there_is_no_rest() -> None:
    travel = tuple(np.linspace(0.0, 1.0, 9))
    assert np.isnan(spline(travel, tuple(u * u for u in travel)).rests).all()


@pytest.mark.parametrize("travel", [(0.0, 0.1, 0.2), (0.0, 0.1, 0.1, 0.2), (0.0, 0.2, 0.1, 0.3)])
def test_points_that_make_no_curve(travel: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="4 or more increasing"):
        spline(travel, travel)


def test_complex_travels_carry_their_derivative() -> None:
    travel = np.array([-0.1, 0.3, 0.77, 1.25, 1.5])
    moved = CURVE(travel + 1e-100j)
    assert moved.value.imag / 1e-100 == pytest.approx(CURVE(travel).slope, rel=1e-13)
    assert moved.slope.imag / 1e-100 == pytest.approx(CURVE(travel).bend, rel=1e-13)


def test_a_piece_goes_on_from_its_own_end_wherever_the_gap_is_said_to_begin() -> None:
    """Points beside a gap may have been averaged, away from where the samples ended."""
    travel = np.array([0.0, 1.0, 2.0, 2.9, 9.2, 10.0, 11.0, 12.0])
    more, value = bridged(travel, 3.0 + travel**2, [(3.0, 9.0)])
    assert len(more) == len(travel) + 9  # each way in the gap, and beyond the end
    assert value == pytest.approx(3.0 + more**2, rel=1e-12)


def test_a_gap_before_the_first_piece_is_bridged_towards_rest() -> None:
    travel = np.array([0.0, 6.0, 7.0, 8.0, 9.0])
    more, value = bridged(travel, travel**2, [(0.0, 6.0)])
    towards_rest = [4.0, 14.0 / 3.0, 16.0 / 3.0]
    beyond = [10.0, 11.0, 12.0]
    assert more.tolist() == pytest.approx([0.0, *towards_rest, *travel[1:], *beyond])
    assert value == pytest.approx(more**2, rel=1e-12)


def test_noise_at_the_end_does_not_soften_what_lies_beyond() -> None:
    first, last = np.linspace(0.0, 1.0, 6), np.linspace(9.0, 10.0, 15)
    travel = np.concatenate((first, last))
    energy = 4.0 * travel - 0.2 * travel**2 + np.where(travel > 8.0, 3.0 * (travel - 9.0) ** 2, 0.0)
    energy[-1] -= 0.02  # a kink of noise: a spline through it bends down at its end
    assert spline(tuple(travel), tuple(energy))(np.array(11.0)).bend < -3.0
    more, value = bridged(travel, energy, [(1.0, 9.0)])
    assert spline(tuple(more), tuple(value))(np.array([10.3, 11.0, 15.0])).bend.min() > 2.0


def test_a_softening_end_is_left_as_it_is() -> None:
    travel = np.array([0.0, 1.0, 2.0, 3.0, 9.0, 10.0, 11.0, 12.0])
    more, _ = bridged(travel, -(travel**2), [(3.0, 9.0)])
    assert more.max() == 12.0


@pytest.mark.parametrize("before", [(-0.4, -0.2), (-0.4, -0.2, 0.0), (-0.3, -1e-9, 1e-9)])
@pytest.mark.parametrize("offset", [0.0, 100.0, -3.0])
def test_a_curve_from_before_rest_is_counted_from_rest(
    before: tuple[float, ...], offset: float
) -> None:
    """A polynomial of third degree near rest, which every spline through it follows there."""
    travel = np.concatenate((before, TRAVEL[1:]))
    found = spline(tuple(travel), tuple(2.0 * travel**2 - travel**3 + offset))
    inside = np.linspace(0.0, 1.3, 27)
    assert found(inside).value == pytest.approx(2.0 * inside**2 - inside**3, abs=1e-12)
    at_rest = found(np.array(0.0))
    assert (at_rest.value, at_rest.slope) == (0.0, 0.0)
    assert at_rest.bend == pytest.approx(4.0, rel=1e-9)
    assert found.knots[0] == 0.0


def test_too_few_points_from_rest_on() -> None:
    with pytest.raises(ValueError, match="4 or more increasing"):
        spline((-2.0, -1.0, 0.0, 1.0, 2.0), (4.0, 1.0, 0.0, 1.0, 4.0))


@pytest.mark.parametrize("end", [(2.4, 3.4, 5.0), (2.3, 2.5), (2.3, 2.5, 2.5), (2.3, 2.5, 2.4)])
def test_what_comes_after_a_well_does_not_make_it_shallow(end: tuple[float, ...]) -> None:
    """Beside a ripple of 0.8 mJ, wherever the curve ends, and if its spline turns over there."""
    energy = [0.0, 5.0, 10.0, 9.0, 9.8, 7.0, 3.5, 2.0, *end]
    travel = [0.0, 0.5, 1.0, 1.3, 1.6, 2.2, 2.9, 3.5, 3.9, 4.2, 4.5][: len(energy)]
    found = spline(tuple(travel), tuple(energy))
    assert found.rests == pytest.approx((1.0, 3.5), abs=0.1)
    assert len(found.branches) == 2, "the ripple is a branch of its own"
