"""Peers find the states that the package finds, each as well as it can."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.benchmark import peers
from dpgcli.benchmark.network import SpringNetwork
from dpgcli.benchmark.peers import Solve, tip_pose
from dpgcli.design.scene import Scene
from dpgcli.mechanics.coordinates import Internal
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.lattice import Lattice
from dpgcli.mechanics.terms import lattice_potential
from dpgcli.states.guess import stroke_guess
from dpgcli.states.patterns import inverted_units
from dpgcli.states.predict import predict

REFERENCE = {**STUDY, "linear_stiffness": 1e4}
TOLERANCES = {  # mm, of the tip; 10 to 1000 times what was measured
    "SciPy BFGS, numerical gradient": 1e-4,
    "SciPy BFGS, analytic gradient": 5e-6,
    "Newton, state by state": 1e-11,
    "springable": 5e-6,
}


class Task(NamedTuple):
    """All states of a finger: starting shapes (4 n, state), tips (3, state), energies (mJ)."""

    finger: Finger
    starts: Array
    pose: Array
    energies: Array


@pytest.fixture(scope="module")
def task() -> Task:
    """The study's three-unit finger, each inverted unit to begin with opened by its stroke."""
    finger = uniform_finger(3, **REFERENCE)
    inverted = inverted_units(np.arange(8, dtype=np.uint64), 3)
    rows = predict(Scene(finger, sources=())).arrays()
    assert (rows["status"] == "stable").all()
    return Task(
        finger,
        Lattice(finger).of_shape(stroke_guess(finger, inverted, 1.0)),
        np.stack([rows[name] for name in ("tip_x_mm", "tip_y_mm", "tip_angle_rad")]),
        rows["energy_mJ"],
    )


@pytest.fixture(scope="session")
def graded_finger() -> Callable[..., Finger]:
    """Other values in each unit, within 30 % of the study's; changes override the latter."""

    def build(n_units: int, seed: int, **changes: float) -> Finger:
        random = np.random.default_rng(seed)
        shared = {"segment_height", "linear_stiffness"}
        return Finger(
            n_units,
            **{
                name: value * random.uniform(0.7, 1.3, (1 if name in shared else n_units, 1))
                for name, value in (REFERENCE | changes).items()
            },
        )

    return build


def solver(name: str, finger: Finger) -> Solve:
    """The peer of that name, ready; skips the test where its package is not installed."""
    if name == "springable":
        pytest.importorskip("springable")
    return {peer.name: peer for peer in peers.peers()}[name].prepare(finger)


def shaken(finger: Finger, seed: int) -> Array:
    """The straight finger with its nodes moved by about 0.3 mm, (4 n,)."""
    straight = Lattice(finger).of_shape(Internal(*np.zeros((4, 1, 1))))
    return straight[:, 0] + np.random.default_rng(seed).normal(0.0, 0.3, len(straight))


def central_difference(function: Callable[[Array], Array | float], at: Array) -> Array:
    """Fourth-order central differences with a step of 1e-3 mm, (size, *shape of the result)."""
    h, derivatives = 1e-3, []
    for direction in np.eye(len(at)):
        near = np.subtract(function(at + h * direction), function(at - h * direction))
        far = np.subtract(function(at + 2 * h * direction), function(at - 2 * h * direction))
        derivatives.append((8.0 * near - far) / (12.0 * h))
    return np.stack(derivatives)


def agree(first: Array, second: Array) -> bool:
    return bool(np.abs(first - second).max() <= 1e-7 * np.abs(second).max())


@pytest.mark.parametrize("name", TOLERANCES)
def test_peers_reach_the_stable_states(name: str, task: Task) -> None:
    solve = solver(name, task.finger)
    found = np.stack([solve(start) for start in task.starts.T], axis=1)
    error = np.abs(tip_pose(found) - task.pose)
    assert np.hypot(*error[:2]).max() < TOLERANCES[name]
    assert error[2].max() < TOLERANCES[name] / 10.0
    network = SpringNetwork.of(task.finger)
    energies = [network.energy(nodes) for nodes in found.T]
    assert energies == pytest.approx(task.energies, abs=1e-7)


@pytest.mark.parametrize("name", TOLERANCES)
def test_peers_take_graded_fingers(name: str, graded_finger: Callable[..., Finger]) -> None:
    finger = graded_finger(2, 5)
    start = Lattice(finger).of_shape(stroke_guess(finger, np.array([[True], [True]]), 1.0))
    rows = predict(Scene(finger, sources=())).arrays()
    assert rows["status"][3] == "stable"
    pose = tip_pose(solver(name, finger)(start[:, 0])[:, None])
    assert np.hypot(pose[0] - rows["tip_x_mm"][3], pose[1] - rows["tip_y_mm"][3]) < TOLERANCES[name]


@pytest.mark.parametrize("seed", range(5))
def test_energy_and_gradient_are_those_of_the_lattice(
    seed: int, graded_finger: Callable[..., Finger]
) -> None:
    finger = graded_finger(1 + seed, seed)
    nodes = shaken(finger, seed)
    expected = lattice_potential(finger).evaluate(nodes[:, None])
    value, gradient = SpringNetwork.of(finger).energy_and_gradient(nodes)
    assert value == pytest.approx(expected.energy[0], rel=1e-12)
    largest = np.abs(gradient).max()
    assert gradient == pytest.approx(expected.gradient[:, 0], rel=0.0, abs=1e-12 * largest)


@pytest.mark.parametrize("n_units", [1, 2, 4])
def test_derivatives(n_units: int, graded_finger: Callable[..., Finger]) -> None:
    """With soft bars and stiff hinges, so that every term weighs."""
    finger = graded_finger(n_units, n_units, linear_stiffness=20.0, hinge_stiffness=500.0)
    network, nodes = SpringNetwork.of(finger), shaken(finger, 7)
    gradient, hessian = network.energy_and_gradient(nodes)[1], network.hessian(nodes)
    assert agree(gradient, central_difference(network.energy, nodes))
    numeric = central_difference(lambda x: network.energy_and_gradient(x)[1], nodes)
    assert agree(hessian, numeric)
    assert not agree(1.00001 * hessian, numeric)  # the check has teeth


def test_newton_gives_up_after_the_last_step(task: Task, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "MOST_STEPS", 1)
    nodes = solver("Newton, state by state", task.finger)(task.starts[:, 7])
    assert np.isnan(nodes).all() and np.isnan(tip_pose(nodes[:, None])).all()


def test_springable_gives_up_in_silence(task: Task, capsys: pytest.CaptureFixture[str]) -> None:
    solve = solver("springable", task.finger)
    flat = task.starts[:, 0].copy()
    flat[2:4] = 5.0, 0.0  # T_1 on the chord: a corner of 0°, which springable refuses
    assert np.isnan(solve(flat)).all()
    assert not capsys.readouterr().out
    assert tip_pose(solve(task.starts[:, 0])[:, None]) == pytest.approx(task.pose[:, :1])


def test_tip_angle_counts_full_turns() -> None:
    finger = uniform_finger(20, **REFERENCE)
    rest, corner = np.zeros((1, 1)), np.full((20, 1), 0.2)
    nodes = Lattice(finger).of_shape(Internal(rest, corner, corner, rest))
    assert tip_pose(nodes)[2] == pytest.approx(-8.0, rel=1e-13)


def test_a_peer_needs_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peers, "find_spec", lambda name: None)
    assert [peer.name for peer in peers.peers()] == list(TOLERANCES)[:3]


@pytest.mark.parametrize("change", [{"linear_stiffness": np.inf}, {"stroke": [3.0, 3.5]}])
def test_peers_refuse_what_they_cannot_take(change: dict[str, float | list[float]]) -> None:
    values = {name: np.reshape(value, (1, -1)) for name, value in (REFERENCE | change).items()}
    with pytest.raises(ValueError, match="one design with elastic bars"):
        SpringNetwork.of(Finger(2, **values))
