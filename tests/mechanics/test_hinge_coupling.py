"""Neighboring hinges that turn each other: derivatives in both coordinates, and no term at 0."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.equilibrium.potential import Potential
from dpgcli.mechanics.coordinates import FingerPotential, Internal
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential

COUPLING = 1.7  # N mm/rad
FORMULATIONS = [
    pytest.param(chain_potential, 1e4, id="chain"),
    pytest.param(chain_potential, np.inf, id="rigid"),
    pytest.param(lattice_potential, 1e4, id="lattice"),
]
Fingers = Callable[..., Finger]
Shapes = Callable[..., Internal]


def coupled(finger: Finger, walls: float = 0.0) -> Finger:
    return finger.changed(
        hinge_coupling=np.array([[COUPLING]]), wall_compliance=np.array([[walls]])
    )


def couplings(potential: FingerPotential) -> FingerPotential:
    """The part of an energy that is of neighboring hinges."""
    terms = tuple(term for term in potential.terms if term.kind == "hinge coupling")
    return Potential(potential.coordinates, terms)


@pytest.mark.parametrize(("formulate", "bars"), FORMULATIONS)
@pytest.mark.parametrize("walls", [0.0, 0.5])
@pytest.mark.parametrize("n_units", [2, 3, 5])
def test_its_derivatives(
    formulate: Formulate,
    bars: float,
    walls: float,
    n_units: int,
    graded_finger: Fingers,
    random_shape: Shapes,
    central_difference: Callable[..., Array],
    dense: Callable[[Array], Array],
) -> None:
    finger = coupled(graded_finger(n_units, 4, linear_stiffness=bars), walls)
    part = couplings(formulate(finger))
    at = part.coordinates.of_shape(random_shape(n_units, 5)._replace(wall=np.full((1, 1), 0.1)))
    scale = 1.0 / np.broadcast_to(part.coordinates.force_unit, at.shape)[:, 0]
    here = part.evaluate(at)
    slope = central_difference(lambda x: part.evaluate(x).energy, at, scale)
    assert here.gradient * scale[:, None] == pytest.approx(slope, rel=1e-7, abs=1e-9)
    exact = dense(here.hessian)[:, :, 0] * scale[:, None]
    bend = central_difference(lambda x: part.evaluate(x).gradient, at, scale)[:, :, 0]
    assert exact == pytest.approx(bend, rel=1e-7, abs=1e-8)
    assert np.abs(exact).max() > 1e-3


@pytest.mark.parametrize(("formulate", "bars"), FORMULATIONS)
def test_it_is_the_product_of_the_turns_of_neighbors(
    formulate: Formulate, bars: float, graded_finger: Fingers, random_shape: Shapes
) -> None:
    finger = coupled(graded_finger(4, 4, linear_stiffness=bars))
    shape, part = random_shape(4, 6, 3), couplings(formulate(finger))
    turn = shape.near_angle + shape.far_angle
    energy = part.evaluate(part.coordinates.of_shape(shape)).energy
    assert energy == pytest.approx(-COUPLING * (turn[:-1] * turn[1:]).sum(axis=0), rel=1e-10)


def test_lanes_have_their_own(graded_finger: Fingers, random_shape: Shapes) -> None:
    finger = graded_finger(3, 4, 2).changed(hinge_coupling=np.array([[COUPLING, 0.0]]))
    part = couplings(chain_potential(finger))
    at = part.coordinates.of_shape(random_shape(3, 6, 2))
    both, last = part.evaluate(at), part.take_lanes(np.array([1])).evaluate(at[:, 1:])
    assert both.energy[0] != 0.0 and both.energy[1] == last.energy[0] == 0.0
    assert not both.gradient[:, 1].any() and not last.hessian.any()


def test_without_one_it_is_no_term(reference_finger: Fingers) -> None:
    finger = reference_finger(3, 1e4)
    assert "hinge coupling" not in chain_potential(finger).kinds
    assert max(chain_potential(finger).column_depths) == 4
    assert "hinge coupling" in chain_potential(coupled(finger)).kinds
    assert "hinge coupling" not in chain_potential(coupled(reference_finger(1, 1e4))).kinds


@pytest.mark.parametrize("bars", [1e4, np.inf])
def test_it_joins_halves(bars: float, reference_finger: Fingers) -> None:
    finger = reference_finger(4, bars)
    shared = slice(7, 8) if np.isfinite(bars) else slice(4, 4)
    assert chain_potential(finger).is_separable(shared)
    assert not chain_potential(coupled(finger)).is_separable(shared)


def test_units_share_it(reference_finger: Fingers) -> None:
    with pytest.raises(ValueError, match="hinge_coupling are shared"):
        reference_finger(3).changed(hinge_coupling=np.ones((3, 1)))
