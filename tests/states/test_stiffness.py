"""Eigenvalues, compliance and stiffness of the tip, against dense linear algebra and loads."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.design.scene import Scene
from dpgcli.equilibrium.contracts import Response, Term
from dpgcli.equilibrium.newton import minimize
from dpgcli.equilibrium.potential import Potential
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.lattice import Lattice
from dpgcli.mechanics.terms import chain_potential, lattice_potential
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict
from dpgcli.states.settle import settle
from dpgcli.states.tip import min_eigenvalues
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
Patterns = Callable[..., Flags]
COMPLIANCES = ("xx_mm_per_N", "xy_mm_per_N", "yy_mm_per_N", "x_angle_rad_per_N")
COMPLIANCES += ("y_angle_rad_per_N", "angle_rad_per_N_mm")


def at_nodes(units: UnitSolutions, inverted: Flags) -> tuple[Potential[Lattice], Array]:
    """The lattice and its coordinates at the chain's solution of one pattern."""
    solved = settle(units, chain_potential, inverted, 1e-13)
    stations = solved.potential.coordinates.stations(solved.equilibrium.coordinates)
    return lattice_potential(units.finger), np.stack(stations, axis=1).reshape(-1, 1)


def compliances(finger: Finger, pattern: str) -> dict[str, Array]:
    request = Request((pattern,), ("stiffness", "eigenvalue"))
    return predict(Scene(finger, ()), request).arrays()


@pytest.mark.parametrize("linear_stiffness", [1e2, 1e4, 1e6])
@pytest.mark.parametrize("pattern", ["000", "101", "0110", "11111"])
def test_the_smallest_eigenvalue_is_the_dense_one(
    graded_finger: Fingers,
    units_of: Patterns,
    dense: Callable[[Array], Array],
    pattern: str,
    linear_stiffness: float,
) -> None:
    units = UnitSolutions.of(graded_finger(len(pattern), 61, linear_stiffness))
    lattice, nodes = at_nodes(units, units_of(pattern))
    expected = np.linalg.eigvalsh(dense(lattice.evaluate(nodes).hessian))[0]
    found = min_eigenvalues(settle(units, chain_potential, units_of(pattern), 1e-13))
    assert found == pytest.approx(expected, rel=1e-14 * linear_stiffness / expected)


def test_the_rigid_eigenvalue_is_the_limit_of_elastic_ones(reference_finger: Fingers) -> None:
    rigid = compliances(reference_finger(4), "1011")["min_eigenvalue_N_per_mm"]
    changes = [
        compliances(reference_finger(4, k), "1011")["min_eigenvalue_N_per_mm"] / rigid - 1.0
        for k in (1e6, 1e8)
    ]
    assert abs(changes[0]) < 1e-3
    assert changes[0] / changes[1] == pytest.approx(100.0, rel=1e-2)


@pytest.mark.parametrize("pattern", ["000", "101", "11111"])
def test_tip_compliance_is_that_of_the_dense_lattice(
    graded_finger: Fingers, units_of: Patterns, dense: Callable[[Array], Array], pattern: str
) -> None:
    finger = graded_finger(len(pattern), 62, 1e3)
    lattice, nodes = at_nodes(UnitSolutions.of(finger), units_of(pattern))
    jacobian = lattice.coordinates.tip(nodes)[1][:, :, 0]
    c = jacobian.T @ np.linalg.solve(dense(lattice.evaluate(nodes).hessian), jacobian)
    rows = compliances(finger, pattern)
    expected = (c[0, 0], c[0, 1], c[1, 1], c[0, 2], c[1, 2], c[2, 2])
    for name, value in zip(COMPLIANCES, expected, strict=True):
        size = np.abs(c[:2, :2]).max()
        assert rows[f"tip_compliance_{name}"] == pytest.approx(value, rel=1e-8, abs=1e-10 * size)
    softest, stiffest = np.linalg.eigvalsh(c[:2, :2])[::-1]
    assert rows["tip_stiffness_min_N_per_mm"] == pytest.approx(1.0 / softest, rel=1e-8)
    assert rows["tip_stiffness_max_N_per_mm"] == pytest.approx(1.0 / stiffest, rel=1e-8)


@dataclass(frozen=True)
class DeadLoad:
    """A force that stays the same, N: E = −F q."""

    force: float

    def __call__(self, scalar: Array) -> Response:
        force = np.full_like(scalar, -self.force)
        return Response(force * scalar, force, np.zeros_like(scalar))

    def take_lanes(self, index: Indices) -> "DeadLoad":
        return self


@pytest.mark.parametrize("pattern", ["101", "0110"])
def test_tip_compliance_is_the_answer_to_a_small_load(
    graded_finger: Fingers, units_of: Patterns, pattern: str
) -> None:
    """Central differences of loaded equilibria; third derivatives leave a few in a million."""
    finger = graded_finger(len(pattern), 63, 1e3)
    lattice, nodes = at_nodes(UnitSolutions.of(finger), units_of(pattern))
    rows = compliances(finger, pattern)
    load = 1e-3
    for axis, names in enumerate((("xx", "xy"), ("xy", "yy"))):
        position = lattice.coordinates.position(axis)
        tips = []
        for force in (load, -load):
            terms = (*lattice.terms, Term("load", position, DeadLoad(force)))
            loaded = Potential(lattice.coordinates, terms)
            tips.append(minimize(loaded, nodes, 1e-12).coordinates[-4:-2, 0])
        answer = (tips[0] - tips[1]) / (2.0 * load)
        for value, name in zip(answer, names, strict=True):
            stated = rows[f"tip_compliance_{name}_mm_per_N"]
            assert stated == pytest.approx(value, rel=1e-4, abs=1e-6)


def test_a_rigid_unit_cannot_be_pushed_along_its_chord(reference_finger: Fingers) -> None:
    rows = compliances(reference_finger(1), "1")
    assert rows["tip_stiffness_max_N_per_mm"].tolist() == [np.inf]


@pytest.mark.parametrize("linear_stiffness", [1e4, 1e8])
def test_a_unit_is_as_stiff_along_its_chord_as_the_bar(
    reference_finger: Fingers, linear_stiffness: float
) -> None:
    rows = compliances(reference_finger(1, linear_stiffness), "1")
    stiffest = rows["tip_stiffness_max_N_per_mm"]
    assert stiffest == pytest.approx(linear_stiffness, rel=10.0 / linear_stiffness + 1e-6)


def test_a_stiff_unit_is_as_stiff_along_its_chord_as_the_bar(reference_finger: Fingers) -> None:
    rows = compliances(reference_finger(1, 1e12), "1")
    assert rows["tip_stiffness_max_N_per_mm"] == pytest.approx(1e12, rel=1e-8)


@pytest.mark.parametrize("bars", [np.inf, 1e4])
def test_the_smallest_eigenvalue_of_one_state_is_that_among_others(
    bars: float, reference_finger: Fingers, all_patterns: Patterns
) -> None:
    """To the last bit, whatever else is solved at once."""
    units, patterns = UnitSolutions.of(reference_finger(3, bars)), all_patterns(3)

    def found(which: slice) -> list[float]:
        return min_eigenvalues(settle(units, chain_potential, patterns[:, which], 1e-12)).tolist()

    alone = [value for k in range(8) for value in found(slice(k, k + 1))]
    assert found(slice(None)) == alone
    assert found(slice(2, 5)) == alone[2:5]
