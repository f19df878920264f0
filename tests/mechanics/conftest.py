"""What the tests of the mechanics share: random fingers and shapes, and derivatives to trust.

Scoped to the session, as Hypothesis wants it of what its examples share.
"""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.mechanics.coordinates import Internal
from dpgcli.mechanics.finger import Finger


@pytest.fixture(scope="session")
def graded_finger() -> Callable[..., Finger]:
    """Fingers with other values in each unit and each design, within 30 % of the study's."""

    def build(n_units: int, seed: int, n_designs: int = 1, linear_stiffness: float = 1e4) -> Finger:
        random = np.random.default_rng(seed)

        def around(value: float, rows: int = n_units) -> Array:
            return value * random.uniform(0.7, 1.3, (rows, n_designs))

        return Finger(
            n_units,
            segment_length=around(13.5),
            segment_height=around(10.75, 1),
            stroke=around(3.5),
            bistable_stiffness=around(12.84),
            force_linearity=around(0.043),
            hinge_stiffness=around(24.2),
            linear_stiffness=around(linear_stiffness, 1),
        )

    return build


@pytest.fixture(scope="session")
def random_shape() -> Callable[..., Internal]:
    """Shapes far from equilibrium: bars off by about 0.3 mm, corners by about 0.2 rad."""

    def draw(n_units: int, seed: int, batch: int = 1) -> Internal:
        random = np.random.default_rng(seed)
        deviations = (0.3, 0.2, 0.2, 0.3)
        return Internal(*(random.normal(0.0, s, (n_units, batch)) for s in deviations))

    return draw


@pytest.fixture(scope="session")
def dense() -> Callable[[Array], Array]:
    """The full matrices (size, size, batch) of a band of `equilibrium.banded`."""

    def unfold(band: Array) -> Array:
        size = band.shape[1]
        full = np.zeros((size, size, band.shape[2]))
        for depth in range(min(len(band), size)):
            columns = np.arange(size - depth)
            full[columns + depth, columns] = full[columns, columns + depth] = band[depth, columns]
        return full

    return unfold


@pytest.fixture(scope="session")
def central_difference() -> Callable[..., Array]:
    """Fourth-order central differences, (size, *shape of the function's result).

    (8 [f(h) − f(−h)] − [f(2h) − f(−2h)]) / 12 h with a step of 1e-3 of each coordinate's
    scale, (size,), times that scale: derivatives by coordinates over their scales.
    """

    def differentiate(function: Callable[[Array], Array], at: Array, scale: Array) -> Array:
        derivatives = []
        for direction in np.diag(scale)[:, :, None]:
            h = 1e-3
            near = function(at + h * direction) - function(at - h * direction)
            far = function(at + 2 * h * direction) - function(at - 2 * h * direction)
            derivatives.append((8.0 * near - far) / (12.0 * h))
        return np.stack(derivatives)

    return differentiate
