"""Loss functions of least squares: plain, and three that limit outliers.

The cost is ½ Σ C² ρ((r/C)²). ρ(z) = z is plain least squares; soft_l1 2(√(1+z) − 1), huber (z up to
one, then 2√z − 1) and cauchy ln(1 + z) grow more slowly, so that outliers count less.
"""

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.choices import Loss

# in standard deviations: estimates are 95 % as efficient as plain ones if errors are normal
# (Holland and Welsch 1977; soft_l1 from the same condition by quadrature)
TUNING = {Loss.SOFT_L1: 1.287, Loss.HUBER: 1.345, Loss.CAUCHY: 2.385}


def growth(loss: Loss, ratio: Array) -> Array:
    """ρ(z) of z = (r/C)², elementwise.

    >>> growth(Loss.HUBER, np.array([0.25, 4.0])).tolist()
    [0.25, 3.0]
    """
    if loss is Loss.SOFT_L1:
        return 2.0 * (np.sqrt(1.0 + ratio) - 1.0)
    if loss is Loss.HUBER:
        return np.where(ratio <= 1.0, ratio, 2.0 * np.sqrt(ratio) - 1.0)
    return np.log1p(ratio) if loss is Loss.CAUCHY else ratio


def influence(loss: Loss, residuals: Array, scale: float) -> tuple[Array, Array]:
    """ψ = ρ'(z) r with z = (r/C)², C the `scale`, and its derivative by r, elementwise.

    >>> influence(Loss.HUBER, np.array([0.5, -3.0]), 1.0)[0].tolist()
    [0.5, -1.0]
    """
    ratio = (residuals / scale) ** 2
    if loss is Loss.SOFT_L1:
        return residuals / np.sqrt(1.0 + ratio), (1.0 + ratio) ** -1.5
    if loss is Loss.HUBER:
        inside = ratio <= 1.0
        return np.clip(residuals, -scale, scale), inside.astype(float)
    if loss is Loss.CAUCHY:
        return residuals / (1.0 + ratio), (1.0 - ratio) / (1.0 + ratio) ** 2
    return residuals, np.ones_like(residuals)
