"""SciPy's minimizers on the lattice's energy find the same states."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential, lattice_potential
from dpgcli.states.guess import geometric_guess
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions


@pytest.mark.parametrize(("method", "tolerance"), [("trust-exact", 1e-7), ("BFGS", 1e-4)])
def test_scipy_reaches_the_same_states(
    graded_finger: Callable[..., Finger],
    all_patterns: Callable[[int], Flags],
    dense: Callable[[Array], Array],
    method: str,
    tolerance: float,
) -> None:
    units = UnitSolutions.of(graded_finger(3, 31, 1e3))
    lattice, inverted = lattice_potential(units.finger), all_patterns(3)
    guess = lattice.coordinates.of_shape(geometric_guess(units.finger, inverted, units.first_order))
    solved = settle(units, chain_potential, inverted, 1e-12)
    nodes = np.stack(solved.potential.coordinates.stations(solved.equilibrium.coordinates), axis=1)

    def value_and_slope(x: Array) -> tuple[float, Array]:
        at = lattice.evaluate(x[:, None])
        return float(at.energy[0]), at.gradient[:, 0]

    def hessian(x: Array) -> Array:
        return dense(lattice.evaluate(x[:, None]).hessian)

    for k in range(8):
        options = {"gtol": 1e-7, "maxiter": 500}
        found = minimize(
            value_and_slope,
            guess[:, k] + 1e-3,
            jac=True,
            hess=None if method == "BFGS" else hessian,
            method=method,
            options=options,
        )
        expected = nodes[:, :, k].reshape(-1)
        np.testing.assert_allclose(found.x, expected, rtol=0, atol=tolerance)
