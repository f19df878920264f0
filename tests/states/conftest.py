"""What the tests of the states share: fingers, patterns, and a lattice of their own.

`extended_state` is written from the lattice's definition in node coordinates, with 50 digits
and derivatives by differences: it has nothing in common with the package but the model.
"""

from collections.abc import Callable
from typing import NamedTuple

import mpmath
import numpy as np
import pytest

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.finger import Finger


@pytest.fixture(scope="session")
def units_of() -> Callable[..., Flags]:
    """Patterns as flags, (unit, pattern): `units_of("101", "110")`."""
    return lambda *patterns: np.array([[digit == "1" for digit in p] for p in patterns]).T


@pytest.fixture(scope="session")
def all_patterns() -> Callable[[int], Flags]:
    """All 2^n patterns as flags, (unit, pattern), in the order of the table."""
    return lambda n: (np.arange(2**n) >> np.arange(n - 1, -1, -1)[:, None]) % 2 == 1


class ExtendedState(NamedTuple):
    """An equilibrium of 50 digits: nodes, tip (x, y), energy, and whether it is a minimum."""

    nodes: list[mpmath.mpf]
    tip: tuple[mpmath.mpf, mpmath.mpf]
    energy: mpmath.mpf
    is_minimum: bool


@pytest.fixture(scope="session")
def extended_state() -> Callable[[Finger, Array], ExtendedState]:
    """The equilibrium next to given nodes (B_1x, B_1y, T_1x, T_1y, B_2x, …) in mm."""

    def find(finger: Finger, nodes: Array) -> ExtendedState:
        with mpmath.workdps(50):
            return _equilibrium(_cells(finger), nodes)

    return find


def _cells(finger: Finger) -> list[dict[str, mpmath.mpf]]:
    return [
        {
            name: mpmath.mpf(float(np.broadcast_to(values, (finger.n_units, 1))[i, 0]))
            for name, values in finger.arrays().items()
        }
        for i in range(finger.n_units)
    ]


def _equilibrium(cells: list[dict[str, mpmath.mpf]], start: Array) -> ExtendedState:
    nodes = [mpmath.mpf(float(value)) for value in start]
    columns = [
        [
            (up - down) / mpmath.mpf("2e-12")
            for up, down in zip(
                _gradient(cells, _shifted(nodes, j, mpmath.mpf("1e-12"))),
                _gradient(cells, _shifted(nodes, j, mpmath.mpf("-1e-12"))),
                strict=True,
            )
        ]
        for j in range(len(nodes))
    ]
    hessian = mpmath.matrix(columns)
    hessian = (hessian + hessian.T) / 2
    inverse = hessian**-1
    step = mpmath.mpf(1)
    for _ in range(40):
        change = inverse * mpmath.matrix(_gradient(cells, nodes))
        nodes = [value - change[i] for i, value in enumerate(nodes)]
        step = max(abs(value) for value in change)
        if step < mpmath.mpf("1e-28"):
            break
    assert step < mpmath.mpf("1e-28"), "the reference itself must converge"
    energy = sum(_cell_energy(cells[i], nodes, i) for i in range(len(cells)))
    return ExtendedState(nodes, (nodes[-4], nodes[-3]), energy, _is_positive(hessian))


def _is_positive(matrix: mpmath.matrix) -> bool:
    try:
        mpmath.cholesky(matrix)
    except ValueError:
        return False
    return True


def _shifted(nodes: list[mpmath.mpf], j: int, by: mpmath.mpf) -> list[mpmath.mpf]:
    return [*nodes[:j], nodes[j] + by, *nodes[j + 1 :]]


def _gradient(cells: list[dict[str, mpmath.mpf]], nodes: list[mpmath.mpf]) -> list[mpmath.mpf]:
    step = mpmath.mpf("1e-17")
    gradient = []
    for j in range(len(nodes)):
        touched = [i for i in (j // 4, j // 4 + 1) if i < len(cells)]
        up, down = _shifted(nodes, j, step), _shifted(nodes, j, -step)
        change = sum(
            _cell_energy(cells[i], up, i) - _cell_energy(cells[i], down, i) for i in touched
        )
        gradient.append(change / (2 * step))
    return gradient


def _cell_energy(cell: dict[str, mpmath.mpf], nodes: list[mpmath.mpf], i: int) -> mpmath.mpf:
    length, height = cell["segment_length"], cell["segment_height"]
    before = (
        nodes[4 * i - 4 : 4 * i] if i else (mpmath.mpf(0), mpmath.mpf(0), mpmath.mpf(0), height)
    )
    after = nodes[4 * i : 4 * i + 4]
    chord = mpmath.mpc(after[0] - before[0], after[1] - before[1])
    top = mpmath.mpc(after[2] - before[2], after[3] - before[3])
    near = mpmath.mpc(before[2] - before[0], before[3] - before[1])
    far = mpmath.mpc(after[2] - after[0], after[3] - after[1])
    x, d = abs(top) - length, cell["stroke"]
    well = 1 + (1 - cell["force_linearity"]) * (x**2 / d**2 - 2 * x / d)
    bars = (abs(chord) - length) ** 2 + (abs(far) - height) ** 2
    corners = mpmath.arg(near / chord / 1j) ** 2 + mpmath.arg(far / chord / 1j) ** 2
    return (
        cell["bistable_stiffness"] * x**2 * well / 2
        + cell["linear_stiffness"] * bars / 2
        + cell["hinge_stiffness"] * corners
    )
