"""Points on paths of equilibria: one cell's scalar, or the load, kept; the rest solved by Newton.

g(x, λ) = 0 with q = q* is a bordered system. The cell is held by a spring of stiffness k, which
adds k ∇q (∇q · δx − δq) = 0 to the first equation, so that the matrix stays positive definite
through a fold (Rheinboldt, Numerical Analysis of Parametrized Nonlinear Equations, 1986, chapter 5;
the spring is ours).
"""

from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, total
from dpgcli.equilibrium.banded import Factorization, backward, factorize, forward, in_lanes
from dpgcli.equilibrium.contracts import Coordinates
from dpgcli.equilibrium.family import Family, Linearized, LoadedLaw, along, spread

TOLERANCE = 1e-12  # of the forces in play, and of a cell's scale
SETTLED_STEP = 1e-5  # of the step cap; Newton squares it
MAX_CORRECTIONS = 8


class Corrected(NamedTuple):
    """Points on paths, with derivatives there; `is_fine` says which belong to a stable path."""

    coordinates: Array
    load: Array
    linear: Linearized
    along_load: Array  # −H'⁻¹ ∂g/∂λ
    by_hold: Array  # H'⁻¹ ∇q
    is_fine: Flags


@in_lanes
def corrected(
    family: Family[Coordinates, LoadedLaw],
    guess: Array,
    load: Array,
    cell: Indices,
    target: Array,
    depth: int,
) -> Corrected:
    """Solve g(x, λ) = 0 with q of a cell at its target, or with λ as it is where `cell` is −1."""
    shape = family.measure(guess).value.shape
    chosen = np.arange(shape[0])[:, None] == cell
    is_held = cell >= 0
    stiffness = np.where(chosen, np.broadcast_to(family.stiffness, shape), 0.0)
    target = np.where(is_held, target, 0.0)
    scale = np.where(chosen, np.broadcast_to(family.scale, shape), 0.0).sum(axis=0)
    x, n = guess, len(load)
    settled, done = np.zeros(n, bool), np.zeros(n, bool)
    coordinates = family.coordinates
    for count in range(MAX_CORRECTIONS + 1):
        linear = family.linearized(x, load, stiffness, target, depth)
        residual = np.abs(linear.gradient / coordinates.gradient_scale).max(axis=0)
        away = np.where(chosen, linear.measured.value - target, 0.0).sum(axis=0)
        is_there = (residual <= TOLERANCE) & (
            np.abs(away) <= TOLERANCE * np.where(is_held, scale, 1.0)
        )
        done |= is_there & settled
        factors = factorize(linear.hessian, family.column_depths)
        selector = spread(family.measure.rows, linear.measured, chosen.astype(float), x)
        sides = np.stack((-linear.gradient, -linear.rate, selector), axis=1)
        by_residual, by_load, by_hold = np.moveaxis(_solved(factors, sides), 1, 0)
        if done.all() or count == MAX_CORRECTIONS:
            break
        change = (-away - total(selector * by_residual)) / total(selector * by_load)
        change = np.where(is_held, change, 0.0)
        step = np.where(done, 0.0, by_residual + change * by_load)
        settled = np.abs(step / coordinates.step_cap).max(axis=0) <= SETTLED_STEP
        x, load = coordinates.moved(x, step), np.where(done, load, load + change)
    is_fine = done & (factors.pivots > 0.0).all(axis=0)
    return Corrected(x, load, linear, by_load, by_hold, is_fine)


def _solved(factors: Factorization, sides: Array) -> Array:
    """A⁻¹ b for right-hand sides (size, number, batch)."""
    y = forward(factors, sides)
    y /= factors.pivots[:, None]
    return backward(factors, y)


def slope_by(family: Family[Coordinates, LoadedLaw], here: Corrected, cell: Indices) -> Array:
    """dλ per step of one scale of the cell; NaN where none is followed.

    With H' = H + k ∇q∇qᵀ the motion per q is k H'⁻¹∇q + λ' z, z = −H'⁻¹ ∂g/∂λ, and ∇q · of it is 1.
    """
    stiffness, scale, chosen = of_cell(family, here, cell)
    rows, measured = family.measure.rows, here.linear.measured
    by_hold = (chosen * along(rows, measured, here.by_hold)).sum(axis=0)
    by_load = (chosen * along(rows, measured, here.along_load)).sum(axis=0)
    return np.where(cell >= 0, (1.0 - stiffness * by_hold) / by_load * scale, np.nan)


def motion_by(
    family: Family[Coordinates, LoadedLaw], here: Corrected, cell: Indices
) -> tuple[Array, Array]:
    """How coordinates and load move per q of a cell, or per λ where none is followed."""
    stiffness, scale, _ = of_cell(family, here, cell)
    slope = slope_by(family, here, cell) / scale
    along_cell = stiffness * here.by_hold + slope * here.along_load
    is_held = cell >= 0
    return np.where(is_held, along_cell, here.along_load), np.where(is_held, slope, 1.0)


def of_cell(
    family: Family[Coordinates, LoadedLaw], here: Corrected, cell: Indices
) -> tuple[Array, Array, Array]:
    """Stiffness and scale of a cell of each lane, (batch,), and where it is, (cell, batch)."""
    shape = here.linear.measured.value.shape
    chosen = (np.arange(shape[0])[:, None] == cell).astype(float)
    stiffness = (chosen * family.stiffness).sum(axis=0)
    return stiffness, (chosen * family.scale).sum(axis=0), chosen
