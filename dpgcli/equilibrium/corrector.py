"""Points on paths of equilibria: one cell's scalar, or the load, kept; the rest solved by Newton.

g(x, λ) = 0 with q = q* is a bordered system. The cell is held by a spring of stiffness k, which
adds k ∇q (∇q · δx − δq) = 0 to the first equation, so that the matrix stays positive definite
through a fold (Rheinboldt, Numerical Analysis of Parametrized Nonlinear Equations, 1986, chapter 5;
the spring is ours).
"""

from typing import Any, NamedTuple, cast

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, total
from dpgcli.equilibrium.banded import Factorization, backward, factorize, forward, in_lanes
from dpgcli.equilibrium.contracts import Coordinates, Measured, Row, WideMeasured
from dpgcli.equilibrium.loaded import Linearized, LoadedLaw, LoadedPotential, along, spread

TOLERANCE = 1e-12  # of the forces in play, and of a cell's scale
SETTLED_STEP = 1e-5  # of the step cap: what is left to go
LAST_STEP = 1e-7  # of the step cap: Newton squares it, and what is left is rounding
CROSSED = 1e-11  # of what margins are measured by: as near Newton comes to an event
STRAYING, SHRINKING = 0.05, 0.25  # of the step cap; of a step: what guesses are good for
ASTRAY, GROWING = 1e-2, 0.8  # of the step cap: longer steps have to shrink to so much each
SLIGHT = 1e-4  # mm: by so much scalars move where margins are told to change
COMPACTING_SHARE = 0.25  # of ended lanes: from it on, dropping them pays for the copy
MAX_CORRECTIONS = 8
FEW = 64  # lanes: of no more it takes longer to drop some than to look at all


class Ways(NamedTuple):
    """What is asked of points on a way, (batch,): those that are rough are a step's rest away.

    A point is where the margin of the cell `meeting` vanishes, unless that is −1.
    """

    is_rough: Flags
    meeting: Indices


class Corrected(NamedTuple):
    """Points on paths, with derivatives there; `is_fine` says which belong to a stable path.

    `astray` is 1 for guesses as good as they should be, and more for others: how far Newton first
    went from there, or how little its steps shrank.
    """

    coordinates: Array
    load: Array
    measured: Measured | WideMeasured
    loaded: Measured | WideMeasured
    along_load: Array  # −H'⁻¹ ∂g/∂λ
    by_hold: Array  # H'⁻¹ ∇q
    astray: Array
    is_fine: Flags


class _Points(NamedTuple):
    """Points under way, (size, batch) and (batch,), and the cell of each that is held at a target.

    `stiffness` (cell, batch) is zero where nothing is held; what is met is held where it is.
    """

    coordinates: Array
    load: Array
    chosen: Flags
    stiffness: Array
    target: Array
    is_rough: Flags
    meeting: Indices

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
    length: Array  # of the step, in step caps


@in_lanes
def corrected(
    family: LoadedPotential[Coordinates, LoadedLaw],
    guess: Array,
    load: Array,
    cell: Indices,
    target: Array,
    depth: int,
    ways: Ways | None = None,
) -> Corrected:
    """Solve g(x, λ) = 0 with q of a cell at its target, or with λ as it is where `cell` is −1.

    On `ways` points that are not rough take at least one step, which squares what is left: loads at
    folds need more digits than the balance does; and what does not come nearer is given up. Lanes
    that have ended are put aside where they are many.
    """
    n, lanes, own = len(load), np.arange(len(load)), family
    chosen = np.arange(family.followed.n_cells)[:, None] == cell
    stiffness = np.where(chosen, np.broadcast_to(family.stiffness, chosen.shape), 0.0)
    asked = ways or Ways(np.zeros(n, bool), np.full(n, -1))
    target = np.where(asked.meeting >= 0, np.nan, np.where(cell >= 0, target, 0.0))
    here = _Points(guess, load, chosen, stiffness, target, *asked)
    before, are_done = np.full(n, np.inf), np.zeros(n, bool)
    found: Corrected | None = None
    astray = before
    for count in range(MAX_CORRECTIONS + 1):
        look = _look(own, here, depth)
        if not count:
            astray = look.length / STRAYING
        elif count == 1:
            is_far = (look.length > SETTLED_STEP) & ~are_done
            far = np.where(is_far, look.length / before / SHRINKING, 0.0)
            astray[lanes] = np.maximum(astray[lanes], far)
        is_there = look.is_there & ((count > 0) | (ways is None))
        is_near = np.where(here.is_rough, look.length <= SETTLED_STEP, look.length <= LAST_STEP)
        is_near &= here.is_rough | (count > 0)
        is_lost = np.full(len(lanes), count == MAX_CORRECTIONS)
        if ways is not None:
            is_lost |= ~(look.length <= np.maximum(GROWING * before, ASTRAY))
        stays, ends = are_done | is_there | is_lost, is_there | is_near | is_lost
        step, change = np.where(stays, 0.0, look.step), np.where(stays, 0.0, look.change)
        moved = own.coordinates.moved(here.coordinates, step)
        here = here._replace(coordinates=moved, load=here.load + change)
        newly = np.flatnonzero(ends & ~are_done)
        if len(newly):
            there = _at(own, here, look, step, is_there | is_near)
            found = found or cast("Corrected", _room(there, n))
            _put(found, there, lanes[newly], newly)
        are_done = are_done | ends
        rest, before = np.flatnonzero(~are_done), look.length
        if not len(rest):
            break
        if are_done.mean() > COMPACTING_SHARE and are_done.size > FEW:
            lanes, own, here = lanes[rest], own.take_lanes(rest), here.only(rest)
            before, are_done = before[rest], are_done[rest]
    assert found is not None, "in the end all lanes have ended"
    return found._replace(astray=astray)


def _at(
    family: LoadedPotential[Coordinates, LoadedLaw],
    here: _Points,
    look: _Look,
    step: Array,
    is_solved: Flags,
) -> Corrected:
    """What there is after a last step; derivatives are those before it."""
    measured = loaded = _moved_along(family.followed.rows, look.measured, step)
    if not family.is_by_load:
        loaded = _moved_along(family.measure.rows, look.loaded, step)
    derivatives, is_fine = (look.along_load, look.by_hold), is_solved & look.is_stable
    return Corrected(
        here.coordinates, here.load, measured, loaded, *derivatives, look.length, is_fine
    )


def _moved_along(
    rows: tuple[Row, ...], measured: Measured | WideMeasured, step: Array
) -> Measured | WideMeasured:
    """The same measure after a small step, with its gradient only."""
    value = measured.value + along(rows, measured, step) if step.any() else measured.value
    if isinstance(measured, WideMeasured):
        return measured._replace(value=value)
    slopes = (np.broadcast_to(slope, value.shape) for slope in measured.gradient)
    return Measured(value, tuple(slopes))


def _room(part: Any, n: int) -> Any:
    """Room for so many lanes of what has arrays by lane."""
    if isinstance(part, np.ndarray):
        return np.empty((*part.shape[:-1], n), part.dtype)
    if isinstance(part, tuple):
        parts = [_room(own, n) for own in part]
        return type(part)(*parts) if hasattr(part, "_fields") else tuple(parts)
    return part


def _put(own: Any, others: Any, lanes: Indices, which: Indices) -> None:
    """Put lanes of others where they belong."""
    for part, other in zip(own, others, strict=True):
        if isinstance(part, np.ndarray):
            part[..., lanes] = other[..., which]
        elif isinstance(part, tuple):
            _put(part, other, lanes, which)


def _look(family: LoadedPotential[Coordinates, LoadedLaw], here: _Points, depth: int) -> _Look:
    coordinates, is_held, meets = family.coordinates, here.chosen.any(axis=0), here.meeting >= 0
    linear = family.linearized(here.coordinates, here.load, here.stiffness, here.target, depth)
    measured, rows, gradient = linear.followed, family.followed.rows, linear.gradient
    away = np.where(here.chosen & ~meets, measured.value - here.target, 0.0).sum(axis=0)
    factors = factorize(linear.hessian, family.column_depths)
    selector = spread(rows, measured, here.chosen.astype(float), here.coordinates)
    sides = np.stack((-gradient, -linear.rate, selector), axis=1)
    by_residual, by_load, by_hold = np.moveaxis(_solved(factors, sides), 1, 0)
    change = (-away - total(selector * by_residual)) / total(selector * by_load)
    change = np.where(is_held, change, 0.0)
    step = by_residual + change * by_load
    scale = np.where(here.chosen, np.broadcast_to(family.scale, here.chosen.shape), 0.0).sum(axis=0)
    is_held_there = np.abs(away) <= TOLERANCE * np.where(is_held, scale, 1.0)
    if meets.any():
        found = _met(family, here, linear, selector, (by_residual, by_load, by_hold))
        change, step = np.where(meets, found.change, change), np.where(meets, found.step, step)
        is_held_there = np.where(meets, np.abs(found.margin) <= CROSSED, is_held_there)
    residual = np.abs(gradient / coordinates.gradient_scale).max(axis=0)
    length = np.abs(step / coordinates.step_cap).max(axis=0)
    is_there = np.asarray((residual <= TOLERANCE) & is_held_there & (length <= SETTLED_STEP))
    n_positive = (factors.pivots > 0.0).sum(axis=0)
    is_stable = np.asarray(n_positive == coordinates.size - family.n_multipliers)
    return _Look(
        measured, linear.loaded, by_load, by_hold, is_there, is_stable, step, change, length
    )


class _Meeting(NamedTuple):
    """A margin, and the step to where it vanishes, (batch,) and (size, batch)."""

    margin: Array
    step: Array
    change: Array


def _met(
    family: LoadedPotential[Coordinates, LoadedLaw],
    here: _Points,
    linear: Linearized,
    selector: Array,
    solved: tuple[Array, Array, Array],
) -> _Meeting:
    """Newton's step to where the margins of cells vanish: q is free, and the load is.

    With r, b and c = H'⁻¹ (−g, −∂g/∂λ, ∇q) and a spring of k that is at rest here it is
    r + δλ b + u c, so that ∇q · δx = u/k; the other equation is that of the margin m, linear in a
    small step. Where no cell is held u = 0.
    """
    by_residual, by_load, by_hold = solved
    cell = np.maximum(here.meeting, 0), np.arange(len(here.load))
    loaded, before = linear.loaded, family.law.margin(linear.loaded, here.load)
    assert before is not None, "what is met has a margin"
    margin = before[cell]

    def rate(direction: Array, change: float) -> Array:
        return margin_rate(family, loaded, here.load, direction, change)[cell]

    by_target = total(selector * by_residual)
    stiffness = here.stiffness.sum(axis=0)
    is_held = stiffness > 0.0
    a = np.where(is_held, 1.0 / np.where(is_held, stiffness, 1.0) - total(selector * by_hold), 1.0)
    b, d, e = -total(selector * by_load), rate(by_hold, 0.0), rate(by_load, 1.0)
    f = -margin - rate(by_residual, 0.0)
    determinant = a * e - b * d
    pull = np.where(is_held, by_target * e - b * f, 0.0) / determinant
    change = (a * f - np.where(is_held, by_target, 0.0) * d) / determinant
    return _Meeting(margin, by_residual + change * by_load + pull * by_hold, change)


def margin_rate(
    family: LoadedPotential[Coordinates, LoadedLaw],
    loaded: Measured | WideMeasured,
    load: Array,
    direction: Array,
    change: float | Array,
) -> Array:
    """How margins to events change, (cell, batch), in a direction, (size, batch), with the load."""
    by_cell = along(family.measure.rows, loaded, direction)
    furthest = np.maximum(np.abs(by_cell).max(axis=0), np.maximum(np.abs(change), TOLERANCE))
    share = SLIGHT / furthest
    before = family.law.margin(loaded, load)
    moved = loaded._replace(value=loaded.value + share * by_cell)
    after = family.law.margin(moved, load + share * change)
    assert before is not None and after is not None, "what is met has a margin"
    return np.asarray((after - before) / share)


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
