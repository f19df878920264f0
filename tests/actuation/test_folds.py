"""Folds and what comes after them, by SciPy in node coordinates: another way to both."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize, root

from dpgcli.actuation.pressed import Halt, Halted, Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.snaps import after as what_follows
from dpgcli.arrays import Array, Flags
from dpgcli.equilibrium.contracts import Term
from dpgcli.equilibrium.potential import Potential
from dpgcli.mechanics.coordinates import FingerCoordinates
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.pressure import PressureWork
from dpgcli.mechanics.terms import lattice_potential
from dpgcli.states.certify import Status

Made = Callable[..., Pressed]
N_FINGERS = 30
OFF = 1e-4  # of the pressure, where SciPy begins


def graded(seed: int) -> tuple[Finger, Flags, Array]:
    """A finger of one to three units, a pattern and pressures that go one way; a unit may flip."""
    random = np.random.default_rng(seed)
    n = 1 + seed % 3

    def around(value: float, share: float = 0.2) -> Array:
        return value * random.uniform(1.0 - share, 1.0 + share, (n, 1))

    finger = uniform_finger(n, **STUDY, linear_stiffness=12.84 * 10.0 ** random.uniform(0.5, 3.5))
    finger = finger.changed(
        stroke=around(3.5),
        bistable_stiffness=around(12.84),
        force_linearity=random.uniform(0.0, 0.06, (n, 1)),
        hinge_stiffness=around(24.2),
        segment_length=around(13.5),
    )
    if seed % 4 == 0:
        finger = finger.changed(wall_compliance=10.0 ** random.uniform(-2.0, 1.0, (n, 1)) / 12.84)
    pattern, sign = random.random((n, 1)) < 0.5, random.choice([-1.0, 1.0])
    pattern[random.integers(n)] = sign < 0.0
    return finger, pattern, sign * random.uniform(0.5, 1.0, (n, 1))


def by_nodes(pressed: Pressed, pressure: Array) -> Potential[FingerCoordinates]:
    """The energy of nodes less the work of pressures, (unit, 1)."""
    lattice = lattice_potential(pressed.finger)
    work = PressureWork(pressure, pressed.volumes, pressed.finger.domes)
    return Potential(
        lattice.coordinates, (*lattice.terms, Term("pressure", lattice.coordinates.dome, work))
    )


def nodes_of(pressed: Pressed, coordinates: Array) -> Array:
    """A shape of the chain by its nodes, walls among them where they give way."""
    chain, lattice = pressed.coordinates, lattice_potential(pressed.finger).coordinates
    stations = np.stack(chain.stations(coordinates), axis=1).reshape(-1, coordinates.shape[1])
    if not pressed.finger.has_walls:
        return stations
    nodes = np.zeros((lattice.size, coordinates.shape[1]))
    width = lattice.size // pressed.finger.n_units
    walls = np.arange(lattice.size) % width == 0
    own_width = chain.size // pressed.finger.n_units
    nodes[~walls], nodes[walls] = stations, coordinates[::own_width]
    return nodes


def derivatives(potential: Potential[FingerCoordinates], nodes: Array) -> tuple[Array, Array]:
    """Gradient and full Hessian at nodes, (size,)."""
    there = potential.evaluate(nodes[:, None])
    size = len(nodes)
    full = np.zeros((size, size))
    for depth in range(min(len(there.hessian), size)):
        rows = np.arange(size - depth)
        entries = there.hessian[depth, : size - depth, 0]
        full[rows + depth, rows] = full[rows, rows + depth] = entries
    return there.gradient[:, 0], full


def at_fold(pressed: Pressed, pattern: Flags, direction: Array) -> Halted:
    """Where a finger stops on the way from rest."""
    shapes, settled = at_rest(pressed, pattern)
    halted = pressed.followed(shapes, 0.5 * direction)
    assert settled.status.tolist() == [Status.STABLE]
    assert halted.reason.tolist() == [Halt.FOLD]
    return halted


@pytest.mark.parametrize("seed", range(N_FINGERS))
def test_a_fold_solves_the_extended_system_in_nodes(seed: int, pressed: Made) -> None:
    """g = 0, H v = 0, |v| = 1 in the nodes, λ and v, from a start that is off."""
    finger, pattern, direction = graded(seed)
    under = pressed(finger)
    halted = at_fold(under, pattern, direction)
    at = halted.shapes.pressure
    nodes = nodes_of(under, halted.shapes.coordinates)[:, 0]
    size = len(nodes)

    def extended(unknowns: Array) -> Array:
        x, share, v = unknowns[:size], unknowns[size], unknowns[size + 1 :]
        gradient, hessian = derivatives(by_nodes(under, share * at), x)
        return np.concatenate((gradient, hessian @ v / scale, [v @ v - 1.0]))

    hessian = derivatives(by_nodes(under, at), nodes)[1]
    scale = np.abs(hessian).max()
    flat = np.linalg.eigh(hessian)[1][:, np.abs(np.linalg.eigvalsh(hessian)).argmin()]
    off = 1e-6 * np.random.default_rng(seed).standard_normal(size)
    start = np.concatenate((nodes + off, [1.0 + OFF], flat))
    found = root(extended, start, method="hybr", options={"xtol": 1e-14, "maxfev": 20000})
    assert np.abs(extended(found.x)[:size]).max() < 1e-7
    assert found.x[size] == pytest.approx(1.0, abs=1e-9)
    assert np.abs(found.x[:size] - nodes).max() < 1e-4 * finger.stroke.max()


@pytest.mark.parametrize("seed", range(0, N_FINGERS, 3))
def test_after_a_fold_scipy_goes_down_to_the_same_state(seed: int, pressed: Made) -> None:
    finger, pattern, direction = graded(seed)
    under = pressed(finger)
    halted = at_fold(under, pattern, direction)
    _, after, ending = what_follows(under, halted)
    potential = by_nodes(under, halted.shapes.pressure)
    ways: dict[str, Any] = {
        "jac": lambda x: derivatives(potential, x)[0],
        "hess": lambda x: derivatives(potential, x)[1],
        "method": "trust-exact",
        "options": {"initial_trust_radius": 1e-3, "max_trust_radius": 0.2, "gtol": 1e-7},
    }
    start = nodes_of(under, halted.start)[:, 0]
    found = minimize(lambda x: float(potential.evaluate(x[:, None]).energy[0]), start, **ways)
    assert ending.tolist() == [Halt.ARRIVED]
    own = nodes_of(under, after.coordinates)[:, 0]
    np.testing.assert_allclose(found.x, own, atol=1e-5)
