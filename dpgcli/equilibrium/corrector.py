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
from dpgcli.equilibrium.contracts import Coordinates, Measured, WideMeasured
from dpgcli.equilibrium.loaded import LoadedLaw, LoadedPotential, along, spread

TOLERANCE = 1e-12  # of the forces in play, and of a cell's scale
SETTLED_STEP = 1e-5  # of the step cap: what is left to go
COMPACTING_SHARE = 0.25  # of ended lanes: from it on, dropping them pays for the copy
MAX_CORRECTIONS = 8


class Corrected(NamedTuple):
    """Points on paths, with derivatives there; `is_fine` says which belong to a stable path."""

    coordinates: Array
    load: Array
    measured: Measured | WideMeasured
    loaded: Measured | WideMeasured
    along_load: Array  # −H'⁻¹ ∂g/∂λ
    by_hold: Array  # H'⁻¹ ∇q
    is_fine: Flags


class _Points(NamedTuple):
    """Points under way, (size, batch) and (batch,), and the cell of each that is held at a target.

    `stiffness` (cell, batch) is zero where nothing is held.
    """

    coordinates: Array
    load: Array
    chosen: Flags
    stiffness: Array
    target: Array

    def only(self, lanes: Indices) -> "_Points":
        """Some lanes."""
        return _Points(*(np.take(getattr(self, f), lanes, axis=-1) for f in self._fields))


class _Look(NamedTuple):
    """What there is at points: which are solutions, which stable; and Newton's step from them."""

    measured: Measured | WideMeasured
    loaded: Measured | WideMeasured
    along_load: Array
    by_hold: Array
    is_there: Flags
    is_stable: Flags
    step: Array
    change: Array


@in_lanes
def corrected(
    family: LoadedPotential[Coordinates, LoadedLaw],
    guess: Array,
    load: Array,
    cell: Indices,
    target: Array,
    depth: int,
    fewest: int = 0,
) -> Corrected:
    """Solve g(x, λ) = 0 with q of a cell at its target, or with λ as it is where `cell` is −1.

    By so many steps at the `fewest`: each squares what is left, and loads at folds need more digits
    than the balance does. Lanes that have ended are put aside where they are many.
    """
    n, lanes, own = len(load), np.arange(len(load)), family
    chosen = np.arange(family.followed.n_cells)[:, None] == cell
    stiffness = np.where(chosen, np.broadcast_to(family.stiffness, chosen.shape), 0.0)
    here = _Points(guess, load, chosen, stiffness, np.where(cell >= 0, target, 0.0))
    coordinates, by_load, by_hold = np.zeros((3, *guess.shape))
    loads, is_fine = np.zeros(n), np.zeros(n, bool)
    for count in range(MAX_CORRECTIONS + 1):
        look = _look(own, here, depth)
        ended = (look.is_there & (count >= fewest)) | (count == MAX_CORRECTIONS)
        rest = np.flatnonzero(~ended)
        is_crowded = ended.mean() > COMPACTING_SHARE
        if is_crowded:
            done = lanes[ended]
            coordinates[:, done], loads[done] = here.coordinates[:, ended], here.load[ended]
            by_load[:, done], by_hold[:, done] = look.along_load[:, ended], look.by_hold[:, ended]
            is_fine[done] = (look.is_there & look.is_stable)[ended]
        if not len(rest):
            break
        step, change = np.where(ended, 0.0, look.step), np.where(ended, 0.0, look.change)
        moved = own.coordinates.moved(here.coordinates, step)
        here = here._replace(coordinates=moved, load=here.load + change)
        if is_crowded:
            lanes, own, here = lanes[rest], own.take_lanes(rest), here.only(rest)
    both = look.measured, look.loaded
    if len(lanes) < n:
        loaded, measured = family.looked_at(coordinates)
        both = measured, loaded
    return Corrected(coordinates, loads, *both, by_load, by_hold, is_fine)


def _look(family: LoadedPotential[Coordinates, LoadedLaw], here: _Points, depth: int) -> _Look:
    coordinates, is_held = family.coordinates, here.chosen.any(axis=0)
    linear = family.linearized(here.coordinates, here.load, here.stiffness, here.target, depth)
    measured, rows = linear.followed, family.followed.rows
    away = np.where(here.chosen, measured.value - here.target, 0.0).sum(axis=0)
    factors = factorize(linear.hessian, family.column_depths)
    selector = spread(rows, measured, here.chosen.astype(float), here.coordinates)
    sides = np.stack((-linear.gradient, -linear.rate, selector), axis=1)
    by_residual, by_load, by_hold = np.moveaxis(_solved(factors, sides), 1, 0)
    change = (-away - total(selector * by_residual)) / total(selector * by_load)
    change = np.where(is_held, change, 0.0)
    step = by_residual + change * by_load
    scale = np.where(here.chosen, np.broadcast_to(family.scale, here.chosen.shape), 0.0).sum(axis=0)
    residual = np.abs(linear.gradient / coordinates.gradient_scale).max(axis=0)
    is_held_there = np.abs(away) <= TOLERANCE * np.where(is_held, scale, 1.0)
    is_settled = np.abs(step / coordinates.step_cap).max(axis=0) <= SETTLED_STEP
    is_there = np.asarray((residual <= TOLERANCE) & is_held_there & is_settled)
    n_positive = (factors.pivots > 0.0).sum(axis=0)
    is_stable = np.asarray(n_positive == coordinates.size - family.n_multipliers)
    return _Look(measured, linear.loaded, by_load, by_hold, is_there, is_stable, step, change)


def _solved(factors: Factorization, sides: Array) -> Array:
    """A⁻¹ b for right-hand sides (size, number, batch)."""
    y = forward(factors, sides)
    y /= factors.pivots[:, None]
    return backward(factors, y)


def slope_by(
    family: LoadedPotential[Coordinates, LoadedLaw], here: Corrected, cell: Indices
) -> Array:
    """dλ per step of one scale of the cell; NaN where none is followed.

    With H' = H + k ∇q∇qᵀ the motion per q is k H'⁻¹∇q + λ' z, z = −H'⁻¹ ∂g/∂λ, and ∇q · of it is 1.
    """
    stiffness, scale, chosen = of_cell(family, here, cell)
    rows, measured = family.followed.rows, here.measured
    by_hold = (chosen * along(rows, measured, here.by_hold)).sum(axis=0)
    by_load = (chosen * along(rows, measured, here.along_load)).sum(axis=0)
    return np.where(cell >= 0, (1.0 - stiffness * by_hold) / by_load * scale, np.nan)


def motion_by(
    family: LoadedPotential[Coordinates, LoadedLaw], here: Corrected, cell: Indices
) -> tuple[Array, Array]:
    """How coordinates and load move per q of a cell, or per λ where none is followed."""
    stiffness, scale, _ = of_cell(family, here, cell)
    slope = slope_by(family, here, cell) / scale
    along_cell = stiffness * here.by_hold + slope * here.along_load
    is_held = cell >= 0
    return np.where(is_held, along_cell, here.along_load), np.where(is_held, slope, 1.0)


def of_cell(
    family: LoadedPotential[Coordinates, LoadedLaw], here: Corrected, cell: Indices
) -> tuple[Array, Array, Array]:
    """Stiffness and scale of a cell of each lane, (batch,), and where it is, (cell, batch)."""
    shape = here.measured.value.shape
    chosen = (np.arange(shape[0])[:, None] == cell).astype(float)
    stiffness = (chosen * family.stiffness).sum(axis=0)
    return stiffness, (chosen * family.scale).sum(axis=0), chosen
