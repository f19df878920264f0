"""The stiffness of a hinge from moments over rotations, and tests of its linearity."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.choices import Loss
from dpgcli.calibration.fits import Fit, Parameter, fit_linear
from dpgcli.errors import FitError
from dpgcli.records import dataclass

STIFFNESS = "hinge_stiffness_N_mm_per_rad"
SIGNIFICANT_ERRORS = 3.0  # standard errors
AT_REST = 1e-6  # of the largest rotation: with less a moment says nothing of a stiffness
LARGEST_CHANGE = 0.05  # of the secant stiffness over the range


@dataclass(frozen=True)
class HingeFit:
    """The fit of M = k θ, and the secant stiffnesses (N mm/rad) at the smaller and larger end."""

    fit: Fit
    secants: tuple[float, float]


def fit_hinge(
    moment: Array,
    rotation: Array,
    *,
    loss: Loss = Loss.LINEAR,
    loss_scale: float | None = None,
    resamples: int = 0,
    seed: int = 0,
) -> HingeFit:
    """Fit M = k θ through the origin to moments (N mm) over rotations (rad).

    Warns where a quadratic or cubic term is larger than three standard errors, or M/θ changes by
    more than 5 % over the range. Raises FitError where no stiffness above zero comes out.

    >>> found = fit_hinge(np.array([12.1, 24.2]), np.array([0.5, 1.0]))
    >>> round(float(found.fit.values[0]), 9)
    24.2
    """
    turned = rotation != 0.0
    if not turned.any():
        raise FitError("the rotation is 0 throughout")
    slope = float((moment @ rotation) / (rotation @ rotation))
    if slope <= 0.0:
        raise FitError(f"moment over rotation is {slope:.4g} N mm/rad: is one's sign reversed?")
    found = fit_linear(
        [Parameter(STIFFNESS, slope, 0.0)],
        rotation[:, None],
        moment,
        loss=loss,
        loss_scale=loss_scale,
        resamples=resamples,
        seed=seed,
    )
    secants = _secants(moment, rotation)
    warnings = (*found.warnings, *_curvature(moment, rotation, secants))
    return HingeFit(replace(found, warnings=warnings), secants)


def _secants(moment: Array, rotation: Array) -> tuple[float, float]:
    """M/θ of the third of the range next to rest and of the outermost third, least squares."""
    size = np.abs(rotation) / np.abs(rotation).max()
    turned, outer = size > AT_REST, size >= 2.0 / 3.0
    inner = turned & (size <= 1.0 / 3.0)
    inner = inner if inner.any() else turned & (size <= size[turned].min())
    near, far = (
        float(moment[part] @ rotation[part] / (rotation[part] @ rotation[part]))
        for part in (inner, outer)
    )
    return near, far


def _curvature(moment: Array, rotation: Array, secants: tuple[float, float]) -> Iterator[str]:
    """Warnings of nonlinearity: quadratic or cubic terms, and a changing secant stiffness."""
    widest = float(np.abs(rotation).max())
    powers = rotation / widest
    is_known = len(np.unique(np.abs(powers[powers != 0.0]))) >= 3 and len(rotation) >= 4
    for name, power in (("quadratic", 2), ("cubic", 3)) if is_known else ():
        shape = np.stack((powers, powers**power), axis=1)
        terms = (Parameter("linear", secants[0] * widest), Parameter(name, 0.0))
        try:
            found = fit_linear(terms, shape, moment)
        except FitError:  # the rotations hardly differ: nothing to be said of a curvature
            continue
        size, error = float(found.values[1]), float(found.standard_errors[1])
        if abs(size) > SIGNIFICANT_ERRORS * error and abs(size) > 1e-6 * abs(found.values[0]):
            yield (
                f"not linear: a {name} term of {size:.3g} +- {error:.2g} N mm at {widest:.3g} rad, "
                f"beside a linear one of {found.values[0]:.3g} N mm"
            )
    near, far = secants
    if abs(far - near) > LARGEST_CHANGE * abs(near):
        yield (
            f"not linear: moment over rotation changes from {near:.4g} to {far:.4g} N mm/rad "
            f"towards {widest:.3g} rad"
        )
