"""The contract between an energy and whatever minimizes it.

A term adds its gradient and Hessian to those of the whole and returns its energy. What a
scene does not need is not in the list of terms, rather than multiplied by zero.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dpgcli.arrays import Array, Indices


class Term(Protocol):
    """One kind of energy, over coordinates of shape (size, batch)."""

    @property
    def kind(self) -> str: ...

    def add_to(self, coordinates: Array, gradient: Array, hessian: Array) -> Array:
        """Add to gradient (size, batch) and band (bandwidth + 1, size, batch); return energy."""


@dataclass(frozen=True)
class Evaluation:
    """An energy with its derivatives: `energies` by kind, each of shape (batch,)."""

    energies: dict[str, Array]
    gradient: Array
    hessian: Array

    @property
    def energy(self) -> Array:
        first, *rest = self.energies.values()
        return sum(rest, start=first)


class Potential(Protocol):
    """A sum of terms over one set of coordinates, in the storage of `equilibrium.banded`.

    `reach` is the sparsity of the Hessian, column by column. `force_unit` (size, batch or 1)
    turns a component of the gradient into a force in N: 1 for a length, a lever for an
    angle. `gradient_scale` is the force in play at each coordinate, in the gradient's own unit,
    `stiffness_scale` the stiffness that a coordinate's curvature is measured by, and `step_cap`
    the largest change of a coordinate that one step may make.
    """

    @property
    def terms(self) -> tuple[Term, ...]: ...
    @property
    def reach(self) -> tuple[int, ...]: ...
    @property
    def force_unit(self) -> Array: ...
    @property
    def gradient_scale(self) -> Array: ...
    @property
    def stiffness_scale(self) -> Array: ...
    @property
    def step_cap(self) -> Array: ...

    def designs(self, index: Indices) -> "Potential":
        """The same potential for the lanes at `index`."""

    def moved(self, coordinates: Array, step: Array) -> Array:
        """Where a step leads: coordinates + step, or better where that would strain bars."""


def evaluate(potential: Potential, coordinates: Array) -> Evaluation:
    """Add up the terms at `coordinates`, shape (size, batch)."""
    gradient = np.zeros_like(coordinates)
    bandwidth = max(potential.reach)
    hessian = np.zeros((bandwidth + 1, *coordinates.shape), coordinates.dtype)
    energies = {t.kind: t.add_to(coordinates, gradient, hessian) for t in potential.terms}
    return Evaluation(energies, gradient, hessian)
