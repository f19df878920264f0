"""Springs of single coordinates as one term: the same energy and derivatives as one by one."""

import numpy as np
import pytest

from dpgcli.equilibrium.potential import Potential
from dpgcli.mechanics.finger import STUDY, uniform_finger
from dpgcli.mechanics.terms import chain_potential, springs_merged


@pytest.mark.parametrize("bars", [np.inf, 30.0])
@pytest.mark.parametrize("walls", [0.0, 0.1])
@pytest.mark.parametrize("coupling", [0.0, 3.0])
def test_merged_springs_have_the_same_derivatives(
    bars: float, walls: float, coupling: float
) -> None:
    finger = uniform_finger(3, **STUDY, linear_stiffness=bars).changed(
        hinge_stiffness=np.array([[24.2, 20.0], [23.0, 21.0], [22.0, 30.0]]),
        wall_compliance=np.array([[walls]]),
        hinge_coupling=np.array([[coupling]]),
    )
    plain = chain_potential(finger)
    merged = Potential(plain.coordinates, springs_merged(plain.coordinates, plain.terms))
    assert sum(term.kind == "springs" for term in merged.terms) == 1
    random = np.random.default_rng(3)
    there = 0.1 * random.standard_normal((plain.coordinates.size, 2))
    one, other = plain.evaluate(there), merged.evaluate(there)
    np.testing.assert_allclose(other.energy, one.energy, rtol=1e-13)
    np.testing.assert_allclose(other.gradient, one.gradient, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(other.hessian, one.hessian, rtol=1e-12, atol=1e-12)
