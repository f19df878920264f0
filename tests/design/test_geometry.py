"""The rules from geometry to lattice, against the published finger and their own exponents."""

import pytest

from dpgcli.design import geometry
from dpgcli.design.scene import ORIGINS, Origin


def test_the_reference_geometry_gives_the_published_lattice_exactly():
    assert geometry.stroke(6.5, 3.0) == 3.5
    assert geometry.segment_height(geometry.chamber_width(22.0), 1.5) == 10.75
    assert geometry.segment_length(9.0, 0.75, 3.0) == 13.5
    assert geometry.bistable_stiffness(6.5, 0.75, 26.0) == 12.84
    assert geometry.hinge_stiffness(26.0, 10.0, 1.5, 3.0) == 24.2
    assert geometry.FORCE_LINEARITY == 0.043


@pytest.mark.parametrize(
    ("dome", "factor"),
    [
        ((13.0, 0.75, 26.0), 2**-0.25),
        ((6.5, 1.5, 26.0), 2**2.8),
        ((6.5, 0.75, 52.0), 2.0),
        ((7.5, 0.75, 26.0), (7.5 / 6.5) ** -0.25),
    ],
)
def test_bistable_stiffness_scales_with_each_dimension(dome, factor):
    assert geometry.bistable_stiffness(*dome) == pytest.approx(12.84 * factor, rel=1e-14)


@pytest.mark.parametrize(
    ("hinge", "factor"),
    [
        ((52.0, 10.0, 1.5, 3.0), 2.0),
        ((26.0, 20.0, 1.5, 3.0), 2.0),
        ((26.0, 10.0, 3.0, 3.0), 8.0),
        ((26.0, 10.0, 1.5, 6.0), 0.5),
    ],
)
def test_hinge_stiffness_scales_with_each_dimension(hinge, factor):
    assert geometry.hinge_stiffness(*hinge) == pytest.approx(24.2 * factor, rel=1e-14)


def test_the_strip_formula_is_within_one_percent_of_the_published_hinge():
    strip = 26.0 * 10.0 * 1.5**3 / (12 * 3.0)
    assert strip == pytest.approx(geometry.REFERENCE.hinge_stiffness, rel=0.01)


@pytest.mark.parametrize(
    ("dome", "origin"),
    [
        ((6.5, 0.75, 26.0), Origin.CALIBRATED),
        ((6.5, 0.75, 27.0), Origin.SCALED),
        ((6.500001, 0.75, 26.0), Origin.SCALED),
        ((4.5, 0.5, 26.0), Origin.SCALED),
        ((7.5, 1.0, 26.0), Origin.SCALED),
        ((7.51, 0.75, 26.0), Origin.EXTRAPOLATED),
        ((4.49, 0.75, 26.0), Origin.EXTRAPOLATED),
        ((6.5, 0.49, 26.0), Origin.EXTRAPOLATED),
        ((6.5, 1.01, 26.0), Origin.EXTRAPOLATED),
    ],
)
def test_dome_origin_tells_the_reference_from_the_grid_and_from_beyond(dome, origin):
    assert ORIGINS[geometry.dome_origin(*dome)] is origin


@pytest.mark.parametrize("changed", range(4))
def test_hinge_origin_is_calibrated_at_the_reference_only(changed):
    reference = [26.0, 10.0, 1.5, 3.0]
    assert ORIGINS[geometry.hinge_origin(*reference)] is Origin.CALIBRATED
    reference[changed] *= 1.1
    assert ORIGINS[geometry.hinge_origin(*reference)] is Origin.SCALED
