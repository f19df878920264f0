"""Quantities over geometries: exact laws, honest errors, hulls."""

from pathlib import Path

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.calibration.choices import GridMethod
from dpgcli.calibration.grid import FittedGridLaw, GridPoints
from dpgcli.errors import FitError
from dpgcli.files.measured import read_table

DATA = Path(__file__).parents[2] / "configs" / "calibration" / "dome_grid.csv"
OVER = ("dome_height_mm", "dome_thickness_mm")
HEIGHT, THICKNESS = (a.ravel() for a in np.meshgrid([4.0, 5.0, 6.0, 7.0], [0.5, 0.75, 1.0]))
GEOMETRY = np.stack((HEIGHT, THICKNESS), axis=1)
BETWEEN = np.array([[4.7, 0.6], [6.3, 0.9]])


def power(geometry: Array) -> Array:
    return np.asarray(3.0 * geometry[:, 0] ** 1.75 * geometry[:, 1] ** 2.8)


def points(geometry: Array = GEOMETRY, noise: float = 0.0, seed: int = 0) -> GridPoints:
    scatter = np.random.default_rng(seed).normal(0.0, noise, len(geometry))
    return GridPoints(OVER, geometry, {"energy": power(geometry) * np.exp(scatter)})


def test_the_finite_element_domes_scale_as_stated() -> None:
    """Inverted energy as t^2.8 h^1.75, limit pressure as t^2.5 h^1.2, well position as h."""
    table = read_table(DATA)
    law = FittedGridLaw(
        GridMethod.SCALING, GridPoints(table.over, table.geometry, table.quantities)
    )
    assert table.over == OVER
    energy, pressure = law.scaling("inverted_energy_mJ"), law.scaling("limit_pressure_MPa")
    assert energy.values[1:] == pytest.approx([1.75, 2.8], abs=0.02)
    assert energy.standard_errors[1:] == pytest.approx([0.018, 0.013], abs=0.001)
    assert pressure.values[1:] == pytest.approx([1.2, 2.5], abs=0.04)
    well = law.scaling("inverted_pole_travel_mm")
    assert well.values[1:] == pytest.approx([1.0, 0.0], abs=0.02)
    assert law.leave_one_out("inverted_energy_mJ") == pytest.approx((0.022, 0.013), abs=1e-3)
    assert law.leave_one_out("limit_pressure_MPa") == pytest.approx((0.046, 0.025), abs=1e-3)


@pytest.mark.parametrize("method", list(GridMethod))
@pytest.mark.parametrize("kept", [slice(None), slice(1, None)], ids=["grid", "scattered"])
def test_products_of_powers_are_exact(method: GridMethod, kept: slice) -> None:
    law = FittedGridLaw(method, points(GEOMETRY[kept]))
    found = law.at("energy", BETWEEN)
    assert found.value == pytest.approx(power(BETWEEN), rel=1e-9)
    assert found.is_inside.tolist() == [True, True]
    assert law.leave_one_out("energy")[0] < 1e-8


@pytest.mark.parametrize("kept", [slice(None), slice(1, None)], ids=["grid", "scattered"])
def test_an_interpolation_meets_its_points(kept: slice) -> None:
    known = points(GEOMETRY[kept], noise=0.2)
    found = FittedGridLaw(GridMethod.INTERPOLATION, known).at("energy", known.geometry)
    assert found.value == pytest.approx(known.quantities["energy"], rel=1e-9)
    assert found.is_inside.all(), "corners and edges are inside"


def test_the_order_of_the_points_does_not_matter() -> None:
    known, shuffled = points(noise=0.2), np.random.default_rng(1).permutation(12)
    mixed = GridPoints(OVER, GEOMETRY[shuffled], {"energy": known.quantities["energy"][shuffled]})
    for method in GridMethod:
        first, second = (
            FittedGridLaw(method, p).at("energy", BETWEEN).value for p in (known, mixed)
        )
        assert first == pytest.approx(second, rel=1e-9)


@pytest.mark.slow
def test_stated_errors_are_the_scatter_of_one_more_point() -> None:
    """300 noisy grids, each asked for a further noisy point."""
    truth, noise = np.log(power(BETWEEN)), 0.05
    more = np.random.default_rng(99).normal(0.0, noise, (300, 2))
    found = [
        FittedGridLaw(GridMethod.SCALING, points(noise=noise, seed=s)).at("energy", BETWEEN)
        for s in range(300)
    ]
    errors = np.array([np.log(f.value) for f in found]) - truth - more
    stated = np.sqrt(np.mean([f.relative_error**2 for f in found], axis=0))
    assert stated == pytest.approx(np.sqrt((errors**2).mean(axis=0)), rel=0.12)


def test_leaving_one_out_predicts_it_from_the_others() -> None:
    known = points(noise=0.1)
    law = FittedGridLaw(GridMethod.SCALING, known)
    design = np.concatenate((np.ones((12, 1)), np.log(GEOMETRY)), axis=1)
    hat = design @ np.linalg.solve(design.T @ design, design.T)
    residual = -law.scaling("energy").residuals / (1.0 - np.diag(hat))  # known less predicted
    expected = np.expm1(-residual)
    assert law.leave_one_out("energy") == pytest.approx(
        (np.abs(expected).max(), np.sqrt((expected**2).mean()))
    )


@pytest.mark.parametrize(
    ("geometry", "is_inside"),
    [
        ((4.0, 0.5), True),
        ((7.0, 1.0), True),
        ((7.1, 0.75), False),
        ((5.0, 1.01), False),
        ((3.99, 0.5), False),
    ],
)
def test_the_hull_of_a_grid(geometry: tuple[float, float], is_inside: bool) -> None:
    assert points().are_inside(np.array([geometry])).tolist() == [is_inside]


def test_the_hull_is_not_the_box() -> None:
    """Without the corner (7, 0.5) its neighborhood is outside, within the ranges of both keys."""
    cut = points(GEOMETRY[~((HEIGHT == 7.0) & (THICKNESS == 0.5))])
    asked = np.array([[6.9, 0.52], [6.6, 0.64], [6.6, 0.66], [7.0, 0.75]])
    assert cut.are_inside(asked).tolist() == [False, False, True, True]


def test_one_key_has_a_range() -> None:
    line = GridPoints(
        ("dome_height_mm",), np.array([[4.0], [5.0], [7.0]]), {"stroke_mm": np.ones(3)}
    )
    assert line.are_inside(np.array([[4.0], [6.0], [7.5]])).tolist() == [True, True, False]


@pytest.mark.parametrize("method", list(GridMethod))
def test_points_on_a_line_cannot_tell_two_keys_apart(method: GridMethod) -> None:
    heights = np.array([4.0, 5.0, 6.0, 7.0])
    line = np.stack((heights, 0.1 * heights), axis=1)
    with pytest.raises(FitError, match="dome_thickness_mm"):
        FittedGridLaw(method, points(line)).at("energy", BETWEEN)


def test_too_few_points_for_errors() -> None:
    few = FittedGridLaw(GridMethod.SCALING, points(GEOMETRY[[0, 1, 4]]))
    found = few.at("energy", BETWEEN)
    assert found.value == pytest.approx(power(BETWEEN))
    assert np.isnan(found.relative_error).all()
    assert np.isnan(few.leave_one_out("energy")).all()


def test_only_positive_points() -> None:
    with pytest.raises(ValueError, match="positive"):
        GridPoints(OVER, GEOMETRY, {"energy": -power(GEOMETRY)})
