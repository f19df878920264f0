"""SciPy's minimizers on the lattice's energy find the same states."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.lattice import Lattice
from dpgcli.mechanics.terms import evaluate
from dpgcli.states.guess import geometric_guess
from dpgcli.states.solve import solve
from dpgcli.states.units import Units


@pytest.mark.parametrize(("method", "tolerance"), [("trust-exact", 1e-7), ("BFGS", 1e-4)])
def test_scipy_reaches_the_same_states(
    graded_finger: Callable[..., Finger],
    all_patterns: Callable[[int], Flags],
    dense: Callable[[Array], Array],
    method: str,
    tolerance: float,
) -> None:
    units = Units.of(graded_finger(3, 31, 1e3))
    lattice, inverted = Lattice(units.finger), all_patterns(3)
    guess = lattice.coordinates(geometric_guess(units.finger, inverted, units.first_order))
    solved = solve(units, Chain, inverted, 1e-12)
    nodes = np.stack(solved.formulation.stations(solved.equilibrium.coordinates), axis=1)

    def value_and_slope(x: Array) -> tuple[float, Array]:
        at = evaluate(lattice, x[:, None])
        return float(at.energy[0]), at.gradient[:, 0]

    def hessian(x: Array) -> Array:
        return dense(evaluate(lattice, x[:, None]).hessian)

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
