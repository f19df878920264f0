"""Forces by aperture: derivatives, the integral by SciPy, and what the points say between them."""

import numpy as np
import pytest
from scipy.integrate import quad

from dpgcli.mechanics.aperture import ForceCurve, KeptApart

GAP = np.array([10.0, 12.0, 13.0, 17.0, 20.0])
FORCE = np.array([2.0, 1.5, 1.6, 0.7, 0.0])


def test_energy_is_the_integral_and_slopes_are_its_derivatives() -> None:
    curve, at = ForceCurve(GAP, FORCE), np.linspace(8.3, 22.1, 41)
    energy, force, stiffness = curve.response(at)
    for first, last, rise in zip(at, at[1:], np.diff(energy), strict=False):
        whole, _ = quad(lambda a: -float(curve.response(np.array(a)).force), first, last)
        assert rise == pytest.approx(-whole, rel=1e-8, abs=1e-8)
    step = 1e-3
    for values, slopes, place in ((0, force, at), (1, stiffness, at)):
        near, far = (
            curve.response(place + n * step)[values] - curve.response(place - n * step)[values]
            for n in (1, 2)
        )
        assert slopes == pytest.approx((8.0 * near - far) / (12.0 * step), rel=1e-6, abs=1e-6)


def test_points_are_met_and_nothing_rises_where_they_fall() -> None:
    curve = ForceCurve(GAP, FORCE)
    assert -curve.response(GAP).force == pytest.approx(FORCE, abs=1e-14)
    at = np.linspace(10.0, 20.0, 2001)
    rises = np.diff(-curve.response(at).force) > 1e-14
    assert set(np.flatnonzero(rises)) <= set(np.flatnonzero((at[1:] > 12.0) & (at[:-1] < 13.0)))
    assert curve.not_falling == ((12.0, 13.0),)
    assert curve.softening is not None and curve.softening.scale == 2.0
    assert ForceCurve(GAP, np.sort(FORCE)[::-1]).softening is None
    assert ForceCurve(GAP, np.sort(FORCE)).not_falling == ((10.0, 20.0),)
    slopes = curve.response(np.linspace(10.0, 20.0, 2001)).stiffness
    assert np.abs(slopes).max() < curve.softening.stiffness


def test_beyond_its_points_it_is_straight_and_says_so() -> None:
    curve = ForceCurve(GAP, FORCE)
    at = np.array([-500.0, 9.0, 21.0, 500.0])
    _, force, stiffness = curve.response(at)
    ends = curve.response(GAP[[0, 0, -1, -1]])
    assert stiffness == pytest.approx(ends.stiffness, rel=1e-12)
    expected = ends.force + stiffness * (at - GAP[[0, 0, -1, -1]])
    assert force == pytest.approx(expected, rel=1e-12)
    assert curve.is_beyond(np.array([9.9, 10.0, 20.0, 20.1])).tolist() == [True, False, False, True]


def test_lanes_have_gaps_of_their_own() -> None:
    law = KeptApart(ForceCurve(GAP, FORCE), np.array([12.0, 17.0, 20.0]))
    whole = law(np.zeros((1, 3)))
    assert whole.force[0] == pytest.approx([-1.5, -0.7, 0.0], abs=1e-14)
    few = law.take_lanes(np.array([2, 0]))(np.zeros((1, 2)))
    assert few.force[0].tolist() == whole.force[0, [2, 0]].tolist()


@pytest.mark.parametrize("gap", [[10.0], [10.0, 10.0], [12.0, 10.0]])
def test_apertures_that_do_not_rise_are_refused(gap: list[float]) -> None:
    with pytest.raises(ValueError, match="rising apertures"):
        ForceCurve(np.array(gap), np.zeros(len(gap)))
