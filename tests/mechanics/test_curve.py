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
    assert len(more) == len(travel) + 6
    assert value == pytest.approx(3.0 + more**2, rel=1e-12)


def test_a_gap_before_the_first_piece_is_bridged_towards_rest() -> None:
    travel = np.array([0.0, 6.0, 7.0, 8.0, 9.0])
    more, value = bridged(travel, travel**2, [(0.0, 6.0)])
    assert more.tolist() == pytest.approx([0.0, 4.0, 14.0 / 3.0, 16.0 / 3.0, 6.0, 7.0, 8.0, 9.0])
    assert value == pytest.approx(more**2, rel=1e-12)


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


def test_a_curve_that_ends_while_it_rises_goes_on_as_stiffly_as_from_its_well() -> None:
    """Noise in the last points bends the end down; pressure pushes an inverted dome beyond it."""
    travel = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 5.2, 5.4, 5.6, 5.7)
    value = (0.0, 2.0, 4.0, 3.0, 1.5, 1.0, 1.04, 1.16, 1.36, 1.46)
    curve = spline(travel, value)
    well, (slope, bend) = curve.rests[1], curve(np.array(5.7))[1:]
    assert slope > 0.0
    average = slope / (5.7 - well)
    assert bend == pytest.approx(average, rel=1e-12)
    assert curve(np.array(8.0)).slope == pytest.approx(slope + average * 2.3, rel=1e-12)
    assert curve(np.array(5.7 - 1e-9)).bend < 0.0


def test_a_curve_that_ends_stiffer_than_it_rose_goes_on_with_its_own_curvature() -> None:
    travel = tuple(np.linspace(0.0, 6.0, 13))
    curve = spline(travel, tuple(np.array(travel) ** 2 * (np.array(travel) - 5.0) ** 2))
    assert curve(np.array(9.0)).bend == pytest.approx(curve(np.array(6.0 - 1e-9)).bend, rel=1e-6)
