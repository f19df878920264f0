"""Least squares: exact answers, honest errors, bounds, outliers, and every way to fail."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import curve_fit

from dpgcli.arrays import Array
from dpgcli.calibration import search
from dpgcli.calibration.choices import Loss
from dpgcli.calibration.fits import Fit, Parameter, fit, fit_linear
from dpgcli.calibration.losses import TUNING, growth, influence
from dpgcli.errors import FitError

TIME = np.linspace(0.0, 4.0, 60)
TRUE = np.array([3.0, 0.7])
PARAMETERS = (Parameter("size", 1.0, 1e-6, 1e3), Parameter("rate", 0.2, 0.0, 10.0))
SIGMA = 0.05


def decay(values: Array) -> Array:
    return np.asarray(values[0] * np.exp(-values[1] * TIME))


def slopes(values: Array) -> Array:
    fall = np.exp(-values[1] * TIME)
    return np.stack((fall, -values[0] * TIME * fall), axis=1)


def fitted(
    observed: Array, parameters: tuple[Parameter, ...] = PARAMETERS, **options: object
) -> Fit:
    return fit(parameters, lambda v: decay(v) - observed, slopes, observed=observed, **options)  # type: ignore[arg-type]


def noisy(seed: int, sigma: float = SIGMA) -> Array:
    return decay(TRUE) + np.random.default_rng(seed).normal(0.0, sigma, len(TIME))


def test_exact_data_give_the_values_back() -> None:
    found = fitted(decay(TRUE))
    assert found.values == pytest.approx(TRUE, rel=1e-12)
    assert found.r_squared == pytest.approx(1.0, abs=1e-14)
    assert found.rms < 1e-12
    assert found.warnings == ()
    assert found.by_key == pytest.approx({"size": 3.0, "rate": 0.7})


def test_scipys_curve_fit_agrees() -> None:
    observed = noisy(1)
    values, covariance = curve_fit(
        lambda t, a, b: a * np.exp(-b * t), TIME, observed, [1.0, 0.2], ftol=1e-14, xtol=1e-14
    )
    found = fitted(observed)
    assert found.values == pytest.approx(values, rel=1e-8)
    assert found.covariance == pytest.approx(covariance, rel=1e-5)
    correlation = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert found.correlation == pytest.approx(np.array([[1.0, correlation], [correlation, 1.0]]))


@pytest.mark.slow
@pytest.mark.parametrize("loss", list(Loss))
def test_standard_errors_are_the_scatter_over_repeated_noise(loss: Loss) -> None:
    """300 repetitions know a standard deviation to 4 %; robust errors are rough at 60 points."""
    repeated = [fitted(noisy(seed), loss=loss) for seed in range(300)]
    scatter = np.std([f.values for f in repeated], axis=0, ddof=1)
    stated = np.sqrt(np.mean([f.standard_errors**2 for f in repeated], axis=0))
    assert stated == pytest.approx(scatter, rel=0.1)
    errors = np.array([(f.values - TRUE) / f.standard_errors for f in repeated])
    assert (np.abs(errors) < 2.0).mean(axis=0) == pytest.approx([0.9502, 0.9502], abs=0.03)


@pytest.mark.slow
def test_the_bootstrap_agrees_with_the_standard_errors() -> None:
    """Over several data sets: in each, drawing points anew knows no more than its residuals."""
    ratios = []
    for seed in range(12):
        found = fitted(noisy(seed), resamples=100, seed=seed)
        assert found.intervals is not None
        assert (found.intervals[:, 0] < found.values).all()
        assert (found.values < found.intervals[:, 1]).all()
        ratios.append(np.diff(found.intervals)[:, 0] / (2 * 1.96 * found.standard_errors))
    assert np.mean(ratios, axis=0) == pytest.approx([1.0, 1.0], abs=0.1)


def test_a_seed_gives_the_same_intervals() -> None:
    first, again, other = (fitted(noisy(3), resamples=20, seed=s).intervals for s in (1, 1, 2))
    assert first is not None and again is not None and other is not None
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("loss", [Loss.SOFT_L1, Loss.HUBER, Loss.CAUCHY])
def test_robust_losses_shrug_off_outliers(loss: Loss) -> None:
    observed = noisy(4, 0.01)
    observed[::10] += 2.0
    plain, robust = fitted(observed), fitted(observed, loss=loss)
    assert abs(plain.values[0] - 3.0) > 0.1
    assert robust.values == pytest.approx(TRUE, rel=0.02)
    assert 0.01 < robust.loss_scale < 0.06, "from the clean points' scatter of 0.01"


def test_a_given_scale_is_taken() -> None:
    assert fitted(noisy(4), loss=Loss.HUBER, loss_scale=0.2).loss_scale == 0.2


def test_a_huge_scale_is_plain_least_squares() -> None:
    plain, robust = fitted(noisy(4)), fitted(noisy(4), loss=Loss.CAUCHY, loss_scale=1e6)
    assert robust.values == pytest.approx(plain.values, rel=1e-9)
    assert robust.covariance == pytest.approx(plain.covariance, rel=1e-9)


@pytest.mark.parametrize("loss", list(Loss))
def test_influence_is_the_slope_of_the_cost(loss: Loss) -> None:
    residuals, scale, step = np.array([-3.0, -0.4, 0.3, 2.5]), 0.8, 1e-3

    def cost(r: Array) -> Array:
        return 0.5 * scale**2 * growth(loss, (r / scale) ** 2)

    def differences(function: Callable[[Array], Array]) -> Array:
        parts = [
            weight * function(residuals + k * step)
            for k, weight in zip((-2, -1, 1, 2), (1, -8, 8, -1), strict=True)
        ]
        return np.asarray(sum(parts)) / (12 * step)

    pull, curvature = influence(loss, residuals, scale)
    assert pull == pytest.approx(differences(cost), rel=1e-7)
    assert curvature == pytest.approx(
        differences(lambda r: influence(loss, r, scale)[0]), rel=1e-7, abs=1e-10
    )


@pytest.mark.parametrize("loss", [Loss.SOFT_L1, Loss.HUBER, Loss.CAUCHY])
def test_the_tuning_is_95_percent_efficient(loss: Loss) -> None:
    errors = np.linspace(-8.0, 8.0, 200_001)
    density = np.exp(-0.5 * errors**2) / np.sqrt(2.0 * np.pi) * (errors[1] - errors[0])
    pull, curvature = influence(loss, errors, TUNING[loss])
    efficiency = (curvature * density).sum() ** 2 / (pull**2 * density).sum()
    assert efficiency == pytest.approx(0.95, abs=1e-4)


def test_a_fixed_value_stays_and_has_no_error() -> None:
    held = (Parameter("size", 2.9, is_free=False), PARAMETERS[1])
    found = fitted(noisy(1), held)
    assert found.values[0] == 2.9
    assert np.isnan(found.standard_errors[0])
    assert found.standard_errors[1] > 0.0
    assert found.covariance[0].tolist() == [0.0, 0.0]
    assert found.correlation.tolist() == [[1.0, 0.0], [0.0, 1.0]]
    assert found.warnings == ()


def test_nothing_free_is_a_check_of_given_values() -> None:
    held = tuple(Parameter(p.key, v, is_free=False) for p, v in zip(PARAMETERS, TRUE, strict=True))
    found = fitted(decay(TRUE) + 0.1, held)
    assert found.rms == pytest.approx(0.1)
    assert np.isnan(found.standard_errors).all()


@pytest.mark.parametrize(("lower", "upper", "at"), [(0.9, 2.0, 0.9), (0.0, 0.5, 0.5)])
def test_a_value_at_its_bound_is_said_and_has_no_error(
    lower: float, upper: float, at: float
) -> None:
    bounded = (PARAMETERS[0], Parameter("rate", 0.5 * (lower + upper), lower, upper))
    found = fitted(noisy(1), bounded)
    assert found.values[1] == at
    assert found.at_bound.tolist() == [False, True]
    assert np.isnan(found.standard_errors[1])
    assert "rate ended at its bound" in found.warnings[0]
    held = fitted(noisy(1), (PARAMETERS[0], Parameter("rate", at, is_free=False)))
    assert found.values[0] == pytest.approx(held.values[0], rel=1e-9)
    assert found.standard_errors[0] == pytest.approx(held.standard_errors[0], rel=1e-9)


def test_a_value_beside_its_bound_is_not_at_it() -> None:
    bounded = (PARAMETERS[0], Parameter("rate", 1.0, 0.6999, 2.0))
    found = fitted(decay(TRUE), bounded)
    assert found.values[1] == pytest.approx(0.7, rel=1e-9)
    assert found.warnings == ()


def test_as_many_points_as_values_have_no_error_estimate() -> None:
    line = (Parameter("offset", 0.0), Parameter("slope", 1.0))
    x, y = np.array([1.0, 2.0]), np.array([5.0, 7.0])
    jacobian = np.stack((np.ones(2), x), axis=1)
    found = fit(line, lambda v: jacobian @ v - y, lambda v: jacobian, observed=y)
    assert found.values == pytest.approx([3.0, 2.0])
    assert np.isnan(found.standard_errors).all()
    assert found.warnings == ("2 points for as many free values: no error estimate",)


def test_a_scale_that_makes_outliers_of_most_points_is_said() -> None:
    found = fitted(noisy(4), loss=Loss.CAUCHY, loss_scale=1e-4 * SIGMA)
    assert any("residuals lie within the scale of the loss" in text for text in found.warnings)
    assert not fitted(noisy(4), loss=Loss.CAUCHY).warnings


def test_too_few_points() -> None:
    y = np.array([1.0])
    with pytest.raises(FitError, match="1 point for 2 free values"):
        fit(PARAMETERS, lambda v: v[:1] - y, lambda v: np.eye(2)[:1], observed=y)


def test_values_that_cannot_be_told_apart_are_named() -> None:
    alike = (Parameter("first", 1.0), Parameter("second", 2.0), Parameter("third", 1.0))
    jacobian = np.stack((TIME, 2.0 * TIME, np.ones_like(TIME)), axis=1)
    with pytest.raises(FitError, match="cannot tell first and second apart: fix one"):
        fit(alike, lambda v: jacobian @ v - TIME, lambda v: jacobian, observed=TIME)


def test_a_value_without_influence_is_named() -> None:
    idle = (Parameter("first", 1.0), Parameter("second", 2.0))
    jacobian = np.stack((TIME, np.zeros_like(TIME)), axis=1)
    with pytest.raises(FitError, match="do not depend on second"):
        fit(idle, lambda v: jacobian @ v - TIME, lambda v: jacobian, observed=TIME)


def test_a_search_that_does_not_end_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "MOST_STEPS", 2)
    with pytest.raises(FitError, match=r"no convergence after 2 steps, at size = .*, rate = "):
        fitted(noisy(1))


def test_what_a_search_without_end_hardly_tells_apart_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By the cosine of two effects, whatever the third value does."""
    monkeypatch.setattr(search, "MOST_STEPS", 2)
    starts = {"level": 1.0, "size": 1.0, "rate": 0.2}
    three = tuple(Parameter(key, start, 1e-6, 1e3) for key, start in starts.items())
    last: list[Array] = []

    def jacobian(v: Array) -> Array:
        last.append(np.column_stack((np.cos(9.0 * TIME), slopes(v[1:]))))
        return last[-1]

    def residual(v: Array) -> Array:
        return v[0] * np.cos(9.0 * TIME) + decay(v[1:]) - noisy(1)

    with pytest.raises(FitError, match=r"size and rate apart worst .*: fix one of them") as said:
        fit(three, residual, jacobian, observed=noisy(1))
    _, size, rate = last[-1].T
    cosine = abs(size @ rate) / np.sqrt((size @ size) * (rate @ rate))
    assert f"alike by {100.0 * cosine:.4g} %" in str(said.value)


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_units_do_not_matter(unit: float) -> None:
    """The same data in units that are a billion times larger or smaller, from a far start."""
    observed = unit * noisy(1)
    scaled = (Parameter("size", unit * 100.0, 0.0), Parameter("rate", 5.0, 0.0, 10.0))
    found = fit(scaled, lambda v: decay(v) - observed, slopes, observed=observed)
    assert found.values == pytest.approx(fitted(noisy(1)).values * [unit, 1.0], rel=1e-7)


def test_a_model_without_a_value_is_said() -> None:
    one = (Parameter("far", -1.0),)
    with pytest.raises(FitError, match="no value at its start: far = -1"):
        fit(one, lambda v: np.full(3, np.nan), lambda v: np.ones((3, 1)), observed=np.zeros(3))


def test_a_start_outside_its_bounds_is_misuse() -> None:
    with pytest.raises(ValueError, match="outside its bounds"):
        fitted(noisy(1), (Parameter("size", -1.0, 0.0, 1.0), PARAMETERS[1]))


def test_a_value_that_drowns_in_noise_is_said() -> None:
    x = np.linspace(0.0, 1.0, 30)
    y = 2.0 * x + np.random.default_rng(5).normal(0.0, 0.1, 30)
    terms = np.stack((x, 1e-4 * x**2), axis=1)
    found = fit(
        [Parameter("slope", 1.0), Parameter("bend", 1.0)],
        lambda values: terms @ values - y,
        lambda values: terms,
        observed=y,
    )
    (said,) = found.warnings
    assert said.startswith("bend: its standard error")


@pytest.mark.parametrize("loss", [Loss.LINEAR, Loss.HUBER])
def test_errors_that_add_up_have_the_covariance_of_their_sums(loss: Loss) -> None:
    """The trapezoids as a matrix T: S = H⁻¹ Jᵀ diag(ψ') T, s² by means of two errors each."""
    along = np.array([0.0, 0.5, 0.7, 1.5, 1.5, 2.0, 3.0])
    observed = np.array([0.0, 0.4, 0.9, 1.2, 1.3, 9.0, 2.8])
    design = np.stack((along, along**2), axis=1)
    terms = [Parameter("slope", 1.0), Parameter("bend", 0.1)]
    found = fit_linear(terms, design, observed, loss=loss, loss_scale=0.5, along=along)
    steps = np.diff(along)
    trapezoids = np.zeros((7, 7))
    for step, width in enumerate(steps):
        trapezoids[step + 1 :, step : step + 2] += 0.5 * width
    counted = np.abs(found.residuals) <= (0.5 if loss is Loss.HUBER else np.inf)
    assert counted.all() == (loss is Loss.LINEAR), "one point is an outlier"
    hessian = design.T @ (counted[:, None] * design)
    weights = np.linalg.solve(hessian, (design * counted[:, None]).T) @ trapezoids
    means = np.diff(found.residuals)[steps > 0.0] / steps[steps > 0.0]
    expected = 2.0 * (means**2).sum() / 5.0 * weights @ weights.T
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-9)
