"""The energy is open: a dead load on the tip, added from here, solves and certifies."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest
from scipy.optimize import minimize

from dpgcli.arrays import Array, Indices
from dpgcli.equilibrium.contracts import Response, Term
from dpgcli.equilibrium.potential import Potential
from dpgcli.mechanics.coordinates import FingerPotential, Internal
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential
from dpgcli.states.certify import Status
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
FORCE = (0.15, -0.25)  # N
FORMULATIONS = pytest.mark.parametrize(
    ("formulate", "linear_stiffness"),
    [(chain_potential, 1e3), (chain_potential, np.inf), (lattice_potential, 1e3)],
)


@dataclass(frozen=True)
class DeadLoad:
    force: float

    def __call__(self, scalar: Array) -> Response:
        force = np.full_like(scalar, -self.force)
        return Response(force * scalar, force, np.zeros_like(scalar))

    def take_lanes(self, index: Indices) -> "DeadLoad":
        return self


def loaded(formulate: Formulate, finger: Finger) -> FingerPotential:
    bare = formulate(finger)
    forces = [Term("load", bare.coordinates.position(k), DeadLoad(FORCE[k])) for k in (0, 1)]
    return Potential(bare.coordinates, (*bare.terms, *forces))


@FORMULATIONS
@pytest.mark.parametrize("axis", [0, 1])
def test_its_derivatives(
    formulate: Formulate,
    linear_stiffness: float,
    axis: int,
    graded_finger: Callable[..., Finger],
    random_shape: Callable[..., Internal],
    central_difference: Callable[..., Array],
    dense: Callable[[Array], Array],
) -> None:
    whole = loaded(formulate, graded_finger(3, 4, linear_stiffness=linear_stiffness))
    load = Potential(whole.coordinates, (whole.terms[axis - 2],))
    at = load.coordinates.of_shape(random_shape(3, 5))
    scale = 1.0 / np.broadcast_to(load.coordinates.force_unit, at.shape)[:, 0]
    here = load.evaluate(at)
    slope = central_difference(lambda x: load.evaluate(x).energy, at, scale)
    assert here.gradient * scale[:, None] == pytest.approx(slope, rel=1e-7, abs=1e-9)
    exact = dense(here.hessian)[:, :, 0] * scale[:, None]
    bend = central_difference(lambda x: load.evaluate(x).gradient, at, scale)[:, :, 0]
    assert exact == pytest.approx(bend, rel=1e-7, abs=1e-8)
    is_curved = formulate is chain_potential
    assert bool(np.abs(exact).max() > 0.1) is is_curved, "a position is a node coordinate"


@FORMULATIONS
def test_it_solves_and_certifies(
    formulate: Formulate, linear_stiffness: float, reference_finger: Fingers
) -> None:
    """The tip goes where the whole energy is least, by a minimizer that shares no code."""
    units, inverted = (
        UnitSolutions.of(reference_finger(3, linear_stiffness)),
        np.array([[1], [0], [1]]) > 0,
    )
    settled = settle(units, partial(loaded, formulate), inverted, 1e-12)
    assert settled.status.tolist() == [Status.STABLE]
    pose = tip(settled, with_compliance=False).pose
    work = FORCE[0] * pose[0] + FORCE[1] * pose[1]
    assert settled.equilibrium.energies["load"] == pytest.approx(-work, rel=1e-12)
    bare = settle(units, formulate, inverted, 1e-12)
    coordinates = bare.potential.coordinates

    def energy(x: Array) -> tuple[float, Array]:
        spent = bare.potential.evaluate(x[:, None])
        (x_tip, y_tip, _), jacobian = coordinates.tip(x[:, None])
        gained = FORCE[0] * x_tip + FORCE[1] * y_tip
        pull = FORCE[0] * jacobian[:, 0] + FORCE[1] * jacobian[:, 1]
        return float((spent.energy - gained)[0]), (spent.gradient - pull)[:, 0]

    start = bare.equilibrium.coordinates[:, 0]
    found = minimize(energy, start, jac=True, method="BFGS", options={"gtol": 1e-9})
    assert pose == pytest.approx(coordinates.tip(found.x[:, None])[0], abs=1e-5)
    assert np.abs(pose - coordinates.tip(start[:, None])[0]).max() > 0.1


def test_a_load_at_the_tip_does_not_fall_into_two(reference_finger: Fingers) -> None:
    finger = reference_finger(4, 1e3)
    bare, load = chain_potential(finger), loaded(chain_potential, finger)
    strut = slice(7, 8)
    assert bare.is_separable(strut) and not load.is_separable(strut)
    assert not bare.is_separable(slice(6, 7)), "a corner is no cut"
