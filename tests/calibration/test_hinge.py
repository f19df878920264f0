"""The hinge: its stiffness, its error, and whether it is linear."""

import numpy as np
import pytest

from dpgcli.calibration.hinge import fit_hinge
from dpgcli.errors import FitError

ROTATION = np.linspace(0.0, 0.3, 13)


def test_a_linear_hinge_comes_back_without_a_warning() -> None:
    found = fit_hinge(24.2 * ROTATION, ROTATION)
    assert found.fit.values[0] == pytest.approx(24.2, rel=1e-12)
    assert found.fit.warnings == ()
    assert found.secants == pytest.approx((24.2, 24.2))


def test_the_standard_error_is_that_of_a_line_through_the_origin() -> None:
    noise = np.random.default_rng(0).normal(0.0, 0.05, len(ROTATION))
    found = fit_hinge(24.2 * ROTATION + noise, ROTATION).fit
    slope = (found.values[0] * ROTATION + -found.residuals) @ ROTATION / (ROTATION @ ROTATION)
    spread = np.sqrt((found.residuals**2).sum() / 12 / (ROTATION @ ROTATION))
    assert found.values[0] == pytest.approx(slope)
    assert found.standard_errors[0] == pytest.approx(spread)
    assert found.warnings == ()


def test_standard_errors_are_the_scatter_over_repeated_noise() -> None:
    draws = np.random.default_rng(1).normal(0.0, 0.05, (300, len(ROTATION)))
    fits = [fit_hinge(24.2 * ROTATION + noise, ROTATION).fit for noise in draws]
    scatter = np.std([f.values[0] for f in fits], ddof=1)
    assert np.sqrt(np.mean([f.standard_errors[0] ** 2 for f in fits])) == pytest.approx(
        scatter, rel=0.12
    )


@pytest.mark.parametrize(("power", "name"), [(2, "quadratic"), (3, "cubic")])
def test_a_curved_hinge_is_said_with_numbers(power: int, name: str) -> None:
    moment = 24.2 * ROTATION * (1.0 - 0.3 * (ROTATION / 0.3) ** (power - 1))
    moment += np.random.default_rng(0).normal(0.0, 0.01, len(ROTATION))
    said = fit_hinge(moment, ROTATION).fit.warnings
    assert any(text.startswith(f"not linear: a {name} term of -") for text in said)
    assert any("moment over rotation changes from" in text for text in said)


def test_one_point_gives_a_value_without_error() -> None:
    found = fit_hinge(np.array([5.0]), np.array([0.180505])).fit
    assert found.values[0] == pytest.approx(27.7001, abs=1e-4)
    assert np.isnan(found.standard_errors[0])
    assert found.warnings == ("1 point for as many free values: no error estimate",)


@pytest.mark.parametrize(
    ("moment", "rotation", "said"),
    [([1.0, 2.0], [0.0, 0.0], "rotation is 0"), ([-1.0, -2.0], [0.1, 0.2], "sign reversed")],
)
def test_hinges_that_are_none(moment: list[float], rotation: list[float], said: str) -> None:
    with pytest.raises(FitError, match=said):
        fit_hinge(np.array(moment), np.array(rotation))


def test_a_hinge_without_moment_at_first_is_not_linear() -> None:
    found = fit_hinge(np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3, 0.4]))
    assert any("changes from 0 to" in text for text in found.fit.warnings), found.fit.warnings


def test_rotations_that_hardly_differ_say_nothing_of_curvature() -> None:
    rotation = 0.2 + 1e-10 * np.arange(4)
    found = fit_hinge(24.2 * rotation, rotation).fit
    assert found.values[0] == pytest.approx(24.2)
    assert found.warnings == ()


def test_three_points_that_stiffen_are_not_linear() -> None:
    found = fit_hinge(np.array([1.0, 5.0, 9.0]), np.array([0.2, 0.3, 0.4]))
    assert any("changes from 5 to 20" in text for text in found.fit.warnings), found.fit.warnings


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("least", [1e-300, 1e-12])
def test_next_to_no_rotation_says_nothing_of_a_stiffness(least: float) -> None:
    found = fit_hinge(np.array([2.0, 7.2, 9.6]), np.array([least, 0.3, 0.4]))
    assert found.secants == pytest.approx((24.0, 24.0))
    assert not found.fit.warnings
