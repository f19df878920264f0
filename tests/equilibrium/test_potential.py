"""The assembler: terms that nobody planned for, and what elimination fills in between them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from dpgcli.arrays import Array, Indices
from dpgcli.equilibrium.banded import backward, factorize, forward
from dpgcli.equilibrium.contracts import Measured, OwnCoordinate, Response, Row, Term
from dpgcli.equilibrium.potential import Potential


@dataclass(frozen=True)
class Apart:
    """The distance of two coordinates, q_second − q_first."""

    first: int
    second: int
    n_cells: int = 1

    @property
    def rows(self) -> tuple[Row, ...]:
        return Row(1, self.first), Row(1, self.second)

    def __call__(self, coordinates: Array) -> Measured:
        first, second = (coordinates[[row]] for row in (self.first, self.second))
        return Measured(second - first, (-np.ones_like(first), np.ones_like(second)))

    def take_lanes(self, index: Indices) -> "Apart":
        return self


@dataclass(frozen=True)
class Spring:
    stiffness: float

    def __call__(self, scalar: Array) -> Response:
        force = self.stiffness * scalar
        return Response(0.5 * force * scalar, force, np.full_like(scalar, self.stiffness))

    def take_lanes(self, index: Indices) -> "Spring":
        return self


@dataclass(frozen=True)
class Points:
    """As many coordinates as that, of no scale of their own."""

    size: int


def springs(*pairs: tuple[int, int], size: int) -> Potential[Any]:
    anchors = Term("anchor", OwnCoordinate(Row(1, 0), size), Spring(1.0))
    ties = (Term("tie", Apart(*pair), Spring(2.0 + k)) for k, pair in enumerate(pairs))
    return Potential(Points(size), (anchors, *ties))  # type: ignore[arg-type]  # no scales


@pytest.mark.parametrize(
    ("pairs", "depths"),
    [
        (((0, 3), (0, 1)), (3, 2, 1, 0)),  # 1 is tied to 3 once 0 is eliminated
        (((0, 1), (1, 3)), (1, 2, 1, 0)),
        (((2, 3),), (0, 0, 1, 0)),
    ],
)
def test_elimination_fills_in_what_no_term_ties(
    pairs: tuple[tuple[int, int], ...], depths: tuple[int, ...], dense: Callable[[Array], Array]
) -> None:
    potential = springs(*pairs, size=4)
    assert potential.column_depths == depths
    at = np.array([[0.3], [-0.1], [0.5], [0.2]])
    evaluation = potential.evaluate(at)
    full = dense(evaluation.hessian)
    factorization = factorize(evaluation.hessian, potential.column_depths)
    step = forward(factorization, -evaluation.gradient)
    step /= factorization.pivots
    assert backward(factorization, step) == pytest.approx(-at, abs=1e-14), "one Newton step"
    assert full @ at == pytest.approx(evaluation.gradient, abs=1e-14), "a quadratic energy"


def test_energies_are_kept_term_by_term_and_added_by_kind() -> None:
    potential = springs((0, 1), (1, 2), size=3)
    at = np.array([[1.0], [2.0], [4.0]])
    energies = potential.evaluate(at).energies
    assert [float(energy[0]) for energy in energies] == [10.5, 1.0, 6.0]
    by_kind = potential.by_kind(energies)
    assert {kind: float(energy[0]) for kind, energy in by_kind.items()} == {
        "anchor": 10.5,
        "tie": 7.0,
    }
    assert float(potential.evaluate(at).energy[0]) == 17.5
