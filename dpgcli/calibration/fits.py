"""Least squares with free, fixed and bounded parameters, and the errors of fitted values.

With residuals r (point,), the cost is ½ Σ C² ρ((r/C)²), see `losses`. With ψ = ρ' r, ψ' its
derivative by r, J the Jacobian of m points by n free parameters and H = Jᵀ diag(ψ') J, the
covariance of the values is

    Σψ²/(m−n) H⁻¹ JᵀJ H⁻¹,    for plain least squares s² (JᵀJ)⁻¹

(Huber and Ronchetti, Robust Statistics, 2009, section 7.6). It holds for independent errors of
equal size; a curve that the model cannot follow has neither. Residuals that are integrals of such
errors e (point,), r = T e with T the trapezoids, have s² S Sᵀ with S = H⁻¹ Jᵀ diag(ψ') T, and s²
from their increments, which are means of two errors times a step (our derivation).
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.calibration.choices import Loss
from dpgcli.calibration.losses import influence
from dpgcli.calibration.search import Function, Parameter, Search
from dpgcli.errors import FitError
from dpgcli.records import dataclass

__all__ = ["CONFIDENCE", "Fit", "Loss", "Parameter", "fit", "fit_linear"]

CONFIDENCE = 0.95  # of bootstrap intervals


@dataclass(frozen=True)
class Fit:
    """Fitted values and their errors; arrays by parameter, in the order of `parameters`.

    `standard_errors` (n,) are NaN where there are none: of a fixed value, of one that ended at a
    bound, and of all where there are no more points than free values. `covariance` (n, n) is zero
    in rows of values that were held, NaN where errors are not known. `residuals` (point,) as
    the model gave them, `rms` their root mean square, `r_squared` 1 − Σr²/Σ(y − ȳ)², NaN if all
    observations y are equal. `at_bound` (n,) marks values that ended at a bound.
    `loss_scale` is the C of the loss. `intervals` (n, 2) hold 95 % of the bootstrap, or None.
    """

    parameters: tuple[Parameter, ...]
    values: Array
    standard_errors: Array
    covariance: Array
    residuals: Array
    r_squared: float
    rms: float
    n_points: int
    loss: Loss
    loss_scale: float
    at_bound: Flags
    warnings: tuple[str, ...] = ()
    intervals: Array | None = None

    @property
    def by_key(self) -> dict[str, float]:
        """Values by key."""
        return dict(zip((p.key for p in self.parameters), self.values.tolist(), strict=True))

    @property
    def correlation(self) -> Array:
        """Correlation matrix of the values, (n, n): 1 on the diagonal, 0 for missing errors."""
        deviation = np.sqrt(np.diag(self.covariance))
        scale = np.outer(deviation, deviation)
        known = np.isfinite(scale) & (scale > 0.0)
        found = np.where(known, self.covariance, 0.0) / np.where(known, scale, 1.0)
        np.fill_diagonal(found, 1.0)
        return found


def fit(
    parameters: Sequence[Parameter],
    residual: Function,
    jacobian: Function,
    *,
    observed: Array,
    loss: Loss = Loss.LINEAR,
    loss_scale: float | None = None,
    resamples: int = 0,
    seed: int = 0,
    along: Array | None = None,
) -> Fit:
    """Fit the free parameters so that the residuals become small.

    `residual` and `jacobian` take the values of all parameters, fixed ones included, (n,), and
    give residuals (point,), predicted less `observed` and in its unit, and their derivatives
    (point, n). `loss_scale` is the size from which a residual counts less; by default a multiple
    of the median residual.
    `resamples` asks for bootstrap intervals: points drawn anew with replacement, each time
    fitted again; the same `seed` gives the same intervals. `along` (point,) says that observations
    are integrals over it, whose errors add up; it changes no value, only standard errors.

    Raises FitError if there are fewer points than free parameters, if some of them cannot be
    told apart, or if the search does not converge; ValueError for a start outside its bounds.

    >>> through_origin = Parameter("stiffness", 1.0)
    >>> x, y = np.array([1.0, 2.0]), np.array([2.0, 4.0])
    >>> found = fit([through_origin], lambda v: v[0] * x - y, lambda v: x[:, None], observed=y)
    >>> round(float(found.values[0]), 9)
    2.0
    """
    if not all(p.lower <= p.start <= p.upper for p in parameters):
        raise ValueError(f"a start outside its bounds in {parameters}")
    search = Search(tuple(parameters), residual, jacobian, loss, np.arange(len(observed)))
    free = np.array([p.is_free for p in parameters])
    start = np.array([p.start for p in parameters])
    _check_points(observed, int(free.sum()))
    values, scale = search.scaled(start, free, loss_scale)
    values, still_free = search.solved(values, free, scale)
    found = _judged(search, values, still_free, scale, observed, along)
    found = replace(found, at_bound=free & ~still_free)
    found = replace(found, warnings=_warnings(found))
    return _bootstrapped(search, found, free, resamples, seed) if resamples else found


def fit_linear(
    parameters: Sequence[Parameter], design: Array, observed: Array, **options: Any
) -> Fit:
    """Fit y = X v with X the `design` (point, n); options as of `fit`.

    >>> line = [Parameter("offset", 0.0), Parameter("slope", 1.0)]
    >>> design = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]])
    >>> fit_linear(line, design, np.array([1.0, 3.0, 5.0])).values.round(9).tolist()
    [1.0, 2.0]
    """
    return fit(
        parameters,
        lambda values: design @ values - observed,
        lambda _: design,
        observed=observed,
        **options,
    )


def _check_points(observed: Array, n_free: int) -> None:
    if len(observed) < n_free:
        points = f"{len(observed)} point{'s' * (len(observed) != 1)}"
        raise FitError(f"{points} for {n_free} free values: give more, or fix some")


def _judged(
    search: Search,
    values: Array,
    free: Flags,
    scale: float,
    observed: Array,
    along: Array | None,
) -> Fit:
    """Errors of values at a minimum."""
    residuals = search.residual(values)
    covariance = np.zeros((len(values), len(values)))
    if free.any():
        block = _covariance(search, values, free, scale, along)
        covariance[np.ix_(free, free)] = block
    spread = float(((observed - observed.mean()) ** 2).sum())
    squares = float((residuals**2).sum())
    return Fit(
        parameters=search.parameters,
        values=values,
        standard_errors=np.where(free, np.sqrt(np.diag(covariance)), np.nan),
        covariance=covariance,
        residuals=residuals,
        r_squared=1.0 - squares / spread if spread > 0.0 else float("nan"),
        rms=float(np.sqrt(squares / len(residuals))),
        n_points=len(residuals),
        loss=search.loss,
        loss_scale=scale,
        at_bound=np.zeros(len(values), bool),
    )


def _covariance(
    search: Search, values: Array, free: Flags, scale: float, along: Array | None
) -> Array:
    """Covariance of the free values; NaN without spare points or positive curvature."""
    slopes = search.jacobian(values)[:, free]
    residuals = search.residual(values)
    pull, curvature = influence(search.loss, residuals, scale)
    n_spare = len(pull) - slopes.shape[1]
    size = np.array([p.size for p in search.parameters])[free]
    slopes = slopes * size  # of order one in every direction, so that nothing is lost in H
    hessian = (slopes.T * curvature) @ slopes
    unknown = np.full((len(size), len(size)), np.nan)
    if n_spare <= 0 or np.linalg.eigvalsh(hessian)[0] <= 0.0:
        return unknown
    spread = np.linalg.solve(hessian, slopes.T)
    if along is not None:
        pull = np.sqrt(2.0) * mean_errors(residuals, along)  # of two errors each
        spread = _of_errors(spread * curvature, along)
    return np.asarray((pull**2).sum() / n_spare * (spread @ spread.T) * np.outer(size, size))


def mean_errors(residuals: Array, along: Array) -> Array:
    """Errors whose integral residuals are, as means between neighbors, (step,).

    >>> mean_errors(np.array([0.0, 1.0, 1.0, 4.0]), np.array([0.0, 2.0, 2.0, 3.0])).tolist()
    [0.5, 3.0]
    """
    steps = np.diff(along)
    return np.asarray(np.diff(residuals)[steps != 0.0] / steps[steps != 0.0])


def _of_errors(weights: Array, along: Array) -> Array:
    """Weights (n, point) of integrals, by trapezoids, as weights of what is integrated."""
    later = np.cumsum(weights[:, :0:-1], axis=1)[:, ::-1]  # of all points from each step's end on
    halves = 0.5 * np.diff(along) * later
    none = np.zeros((len(weights), 1))
    return np.concatenate((halves, none), axis=1) + np.concatenate((none, halves), axis=1)


def _warnings(found: Fit) -> tuple[str, ...]:
    said = []
    n_free = sum(parameter.is_free for parameter in found.parameters)
    for parameter, value, is_at_bound, error in zip(
        found.parameters, found.values, found.at_bound, found.standard_errors, strict=True
    ):
        if is_at_bound:
            said.append(
                f"{parameter.key} ended at its bound {value:g}: it has no standard error, and "
                "those of the others are as if it were known"
            )
        elif parameter.is_free and np.isnan(error) and found.n_points > n_free:
            said.append(f"{parameter.key}: too many outliers for a standard error")
        elif parameter.is_free and error > abs(value):
            said.append(
                f"{parameter.key}: its standard error, {error:.2g}, is larger than the value: "
                "the data hardly determine it"
            )
    n_within = int((np.abs(found.residuals) <= found.loss_scale).sum())
    if found.loss is not Loss.LINEAR and 2 * n_within < found.n_points:
        said.append(
            f"{n_within} of {found.n_points} residuals lie within the scale of the loss, "
            f"{found.loss_scale:.3g}: it takes most points for outliers, and standard errors are "
            "too small"
        )
    if found.n_points == n_free:
        points = "1 point" if found.n_points == 1 else f"{found.n_points} points"
        said.append(f"{points} for as many free values: no error estimate")
    return tuple(said)


def _bootstrapped(search: Search, found: Fit, free: Flags, resamples: int, seed: int) -> Fit:
    """The fit with percentile intervals over points drawn with replacement.

    Davison and Hinkley, Bootstrap Methods and their Application, 1997, section 6.2.4.
    """
    random = np.random.default_rng(seed)
    fitted = []
    for _ in range(resamples):
        rows = random.integers(found.n_points, size=found.n_points)
        try:
            again = replace(search, rows=rows)
            fitted.append(again.solved(found.values, free, found.loss_scale)[0])
        except FitError:
            continue  # counted below
    if resamples == 1:
        raise FitError("bootstrap: one sample gives no interval, draw a few hundred")
    if len(fitted) < max(2, resamples // 2):
        raise FitError(f"bootstrap: {resamples - len(fitted)} of {resamples} samples have no fit")
    edges = (0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE))
    intervals = np.quantile(np.array(fitted), edges, axis=0).T
    warnings = found.warnings
    if n_failed := resamples - len(fitted):
        warnings += (f"bootstrap: {n_failed} of {resamples} samples had no fit and are left out",)
    return replace(found, warnings=warnings, intervals=np.where(free[:, None], intervals, np.nan))
