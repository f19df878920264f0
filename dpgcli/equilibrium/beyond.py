"""Branches of equilibria beyond a fold, followed by one cell until they are stable again.

The load goes back there. A branch begins beside a stable point before the fold, as far beyond it in
the cell: loads are nearly the same, and what else is near its own fold stays where it is.
"""

from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.equilibrium.banded import in_lanes
from dpgcli.equilibrium.contracts import Coordinates
from dpgcli.equilibrium.corrector import Corrected, corrected, of_cell, slope_by
from dpgcli.equilibrium.loaded import LoadedLaw, LoadedPotential, along

STEP, SMALLEST = 0.05, 1e-3  # of the cell's scale
FURTHEST = 2.5  # steps: what else moves further has left its branch
MOST_POINTS = 400


class Branch(NamedTuple):
    """Unstable equilibria in their order: coordinates (size, point), loads (point,)."""

    coordinates: Array
    load: Array


class _Tangent(NamedTuple):
    """How coordinates and load go on, per step of one scale of the cell."""

    motion: Array
    slope: Array


@in_lanes
def beyond(
    family: LoadedPotential[Coordinates, LoadedLaw],
    before: Array,
    load: Array,
    cell: int,
    fold: float,
) -> Branch:
    """The branch beyond the fold at which a cell's scalar is `fold`, (size, 1) and (1,) before it.

    It is sought from a stable point before the fold and its load, and ends where it is stable
    again, where another law begins, or where there is no equilibrium. Empty where there is none
    beside that point.
    """
    depth, which = max(family.column_depths), np.array([cell])
    values = family.followed(before).value
    here = corrected(family, before, load, which, values[cell], depth)
    scale = of_cell(family, here, which)[1]
    step = 2.0 * float((fold - values[cell, 0]) / scale[0])
    sense = np.sign(step)
    rises = np.sign(slope_by(family, here, which))
    way = _Tangent(_alone(family, here, which), 0.0 * load)
    found: list[Corrected] = []
    while len(found) < MOST_POINTS:
        values = here.measured.value
        guess = family.coordinates.moved(here.coordinates, way.motion * step)
        target, there_load = values[cell] + step * scale, here.load + way.slope * step
        there = corrected(family, guess, there_load, which, target, depth)
        is_unstable = (slope_by(family, there, which) * rises < 0.0)[0]
        moved = np.abs((there.measured.value - values) / family.scale).max()
        is_near = moved <= FURTHEST * abs(step)
        if there.is_fine[0] and is_unstable and is_near and not _is_left(family, there):
            found.append(there)
            here, way = there, _tangent(family, there, which)
            step = sense * (STEP if len(found) == 1 else min(2.0 * abs(step), STEP))
            continue
        step *= 0.5
        if not found or abs(step) < SMALLEST:
            break
    coordinates = [before[:, :0], *(point.coordinates for point in found)]
    loads = [load[:0], *(point.load for point in found)]
    return Branch(np.concatenate(coordinates, axis=1), np.concatenate(loads))


def _alone(
    family: LoadedPotential[Coordinates, LoadedLaw], here: Corrected, cell: Indices
) -> Array:
    """The motion by which a force on the cell alone moves it by one scale."""
    _, scale, chosen = of_cell(family, here, cell)
    own = (chosen * along(family.followed.rows, here.measured, here.by_hold)).sum(axis=0)
    return np.asarray(here.by_hold / own * scale)


def _tangent(
    family: LoadedPotential[Coordinates, LoadedLaw], here: Corrected, cell: Indices
) -> _Tangent:
    """Along the branch."""
    stiffness, scale, _ = of_cell(family, here, cell)
    slope = slope_by(family, here, cell)
    return _Tangent(stiffness * here.by_hold * scale + slope * here.along_load, slope)


def _is_left(family: LoadedPotential[Coordinates, LoadedLaw], there: Corrected) -> bool:
    """Whether another law holds there."""
    margin = family.law.margin(there.loaded, there.load)
    return margin is not None and bool((margin < 0.0).any())
