"""The laws of single springs against their closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dpgcli.equilibrium.contracts import Response
from dpgcli.mechanics import laws
from dpgcli.mechanics.curve import spline

relative_extensions = st.floats(-2.0, 3.0)
linearities = st.floats(0.0, 1.0)
sizes = st.floats(0.1, 100.0)


def bistable(extension: float, stiffness: float, linearity: float, stroke: float) -> Response:
    return laws.bistable(*map(np.array, (extension, stiffness, linearity, stroke)))


@given(relative_extensions, sizes, linearities, sizes)
def test_bistable_is_the_published_polynomial(
    u: float, stiffness: float, alpha: float, stroke: float
) -> None:
    beta, x = 1.0 - alpha, u * stroke
    energy, force, slope = bistable(x, stiffness, alpha, stroke)
    scale = stiffness * (1.0 + u * u)  # the terms that cancel near the wells
    assert energy == pytest.approx(
        0.5 * stiffness * x * x * (1.0 + beta * (u * u - 2.0 * u)),
        rel=1e-12,
        abs=1e-14 * scale * x * x,
    )
    assert force == pytest.approx(
        stiffness * x * (1.0 + beta * (2.0 * u * u - 3.0 * u)),
        rel=1e-12,
        abs=1e-14 * scale * abs(x),
    )
    assert slope == pytest.approx(
        stiffness * (1.0 + beta * (6.0 * u * u - 6.0 * u)), rel=1e-12, abs=1e-14 * scale
    )


@given(relative_extensions, sizes, sizes)
def test_linearity_of_one_is_a_linear_spring(u: float, stiffness: float, stroke: float) -> None:
    x = np.array(u * stroke)
    nonlinear = bistable(float(x), stiffness, 1.0, stroke)
    assert nonlinear == laws.quadratic(x, np.array(stiffness))


@given(sizes, linearities, sizes)
def test_inverted_well_costs_half_alpha_k_d_squared(
    stiffness: float, alpha: float, stroke: float
) -> None:
    energy = bistable(stroke, stiffness, alpha, stroke).energy
    assert energy == pytest.approx(0.5 * alpha * stiffness * stroke**2, rel=1e-14, abs=1e-300)


@given(st.floats(0.0, 1.0), sizes, sizes)
def test_without_linearity_both_wells_are_alike(u: float, stiffness: float, stroke: float) -> None:
    well, mirrored = (bistable(x, stiffness, 0.0, stroke) for x in (u * stroke, (1 - u) * stroke))
    scale = stiffness * stroke * np.array((stroke, 1.0))
    assert abs(well.energy - mirrored.energy) <= 1e-14 * scale[0]
    assert abs(well.force + mirrored.force) <= 1e-14 * scale[1]


@given(st.floats(0.0, 0.111), sizes, sizes)
def test_force_vanishes_at_the_closed_form_points(
    alpha: float, stiffness: float, stroke: float
) -> None:
    beta = 1.0 - alpha
    root = np.sqrt(9.0 * beta**2 - 8.0 * beta)
    for u in (0.0, (3.0 * beta - root) / (4.0 * beta), (3.0 * beta + root) / (4.0 * beta)):
        force = bistable(u * stroke, stiffness, alpha, stroke).force
        assert abs(force) <= 1e-14 * stiffness * stroke


@pytest.mark.parametrize(("alpha", "is_bistable"), [(0.110, True), (0.112, False)])
def test_bistable_exactly_below_one_ninth(alpha: float, is_bistable: bool) -> None:
    x = np.linspace(1e-3, 4.0, 40_001)
    force = laws.bistable(x, *map(np.array, (12.84, alpha, 3.5))).force
    assert bool((force < 0.0).any()) is is_bistable


@pytest.mark.parametrize("u", [-0.7, 0.31, 1.4])
def test_force_and_stiffness_are_the_energy_s_derivatives(u: float) -> None:
    h, x = 1e-3 * 3.5, u * 3.5 + 1e-3 * 3.5 * np.array([-2.0, -1.0, 1.0, 2.0])
    near = laws.bistable(x, *map(np.array, (12.84, 0.043, 3.5)))
    here = bistable(u * 3.5, 12.84, 0.043, 3.5)
    weights = np.array([1.0, -8.0, 8.0, -1.0]) / (12.0 * h)
    assert weights @ near.energy == pytest.approx(here.force, rel=1e-9)
    assert weights @ near.force == pytest.approx(here.stiffness, rel=1e-9)


def test_quadratic_by_head() -> None:
    assert np.array_equal(laws.quadratic(np.array(-2.0), np.array(3.0)), (6.0, -6.0, 3.0))


DOME = laws.Dome(*map(np.array, (12.84, 0.043, 3.5, 0.0)))
TRAVEL = np.linspace(0.0, 1.5, 301)
SAMPLED = laws.bistable(TRAVEL * 3.5, *DOME[:3]).energy / (12.84 * 3.5**2)
TABULATED = laws.Tabulated(spline(tuple(TRAVEL), tuple(SAMPLED)))


def test_a_table_of_the_published_law_is_the_published_law() -> None:
    """To the order of the spline: h^4 in energy, h^3 in force, h^2 in stiffness, h = 1/200."""
    extension = np.linspace(0.0, 5.0, 1001)
    found, exact = TABULATED.response(extension, DOME), laws.PUBLISHED.response(extension, DOME)
    for part, known, error in zip(found, exact, (1e-8, 1e-5, 1e-3), strict=True):
        assert np.abs(part - known).max() < error * 12.84 * 3.5**2


@pytest.mark.parametrize("law", [laws.PUBLISHED, TABULATED])
def test_a_dome_that_pushes_only_pushes(law: laws.Published | laws.Tabulated) -> None:
    extension = np.linspace(-1.0, 6.0, 2001)
    top, well = law.rests(DOME)
    response, own = laws.PushOnly(law).response(extension, DOME), law.response(extension, DOME)
    touches = (extension > top) & (extension < well)
    assert (response.force <= 0.0).all()
    for part, same in zip(response, own, strict=True):
        assert np.array_equal(part[touches], same[touches])
    assert not response.force[~touches].any() and not response.stiffness[~touches].any()
    assert np.ptp(response.energy[extension > well]) == 0.0
    assert np.ptp(response.energy[extension < top]) == 0.0
    steps = np.abs(np.diff(response.energy))
    assert steps.max() < 1.1 * np.abs(response.force).max() * (extension[1] - extension[0])


def test_rests_of_the_published_law_are_its_zeros_of_force() -> None:
    for rest in laws.PUBLISHED.rests(DOME):
        assert abs(laws.PUBLISHED.response(rest, DOME).force) < 1e-13
    not_bistable = DOME._replace(linearity=np.array(0.2))
    assert np.isnan(laws.PUBLISHED.rests(not_bistable)).all()
    response = laws.PushOnly(laws.PUBLISHED).response(np.linspace(0.0, 5.0, 9), not_bistable)
    assert not np.any(response), "a dome that has no second well never pushes"


def test_contact_shifts_the_travel_of_the_pole() -> None:
    """x = u - c: with c = 9.5 mm and the well at 13.7 mm the push ends at 4.2 mm."""
    dome = laws.Dome(*map(np.array, (12.84, 0.0, 4.2, 9.5)))
    curve = TABULATED.curve
    law = laws.Tabulated(curve)
    travel = np.linspace(0.2, 1.4, 50)
    response = law.response(travel * 13.7 - 9.5, dome)
    assert response.energy == pytest.approx(12.84 * 13.7**2 * curve(travel).value, rel=1e-12)
    assert law.rests(dome).well == pytest.approx(curve.rests[1] * 13.7 - 9.5, rel=1e-14)
