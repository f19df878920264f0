"""Ties: units that lose their balance at the same pressure, of which the model names no first."""

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.contracts import Term
from dpgcli.equilibrium.loaded import Holding
from dpgcli.equilibrium.newton import minimize
from dpgcli.equilibrium.potential import Potential
from dpgcli.equilibrium.steps import AT_KINK
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.descent import TOLERANCE
from dpgcli.grasping.shapes import ContactShapes

TIE = 1e-6  # of the pressure: thresholds as near are not told apart
LEFT = 0.05  # of a stroke: what has moved further has left its place


def tied(own: Obstructed, at_fold: ContactShapes, load: Array, cell: Indices) -> Flags:
    """Units, (unit, batch), that leave their places where `cell` does, with it, if any others do.

    Each by itself, all others held where they are, as pressures go on by `TIE`: contacts push as
    they do at the fold. `cell` is −1 where the fold was come near to by the load.
    """
    n_units, n = at_fold.inverted.shape
    lanes, unit = np.repeat(np.arange(n), n_units), np.tile(np.arange(n_units), n)
    beyond = load + _further(own, load, cell)
    own, shapes = own.take_lanes(lanes), at_fold.take_lanes(lanes)
    family = own.family(shapes.inverted, shapes.active)
    before = family.followed(shapes.coordinates).value
    is_own = np.arange(family.followed.n_cells)[:, None] == unit
    hold = Term("hold", family.followed, Holding(None, ~is_own * family.stiffness, before))
    pressed = own.pressed(shapes.inverted, shapes.push, beyond[lanes])
    potential = Potential(pressed.coordinates, (*pressed.terms, hold))
    there = minimize(potential, shapes.coordinates, TOLERANCE).coordinates
    moved = np.abs(family.followed(there).value - before) / family.scale
    left = (moved[unit, np.arange(len(unit))] > LEFT).reshape(n, n_units).T
    gone = left | (np.arange(n_units)[:, None] == cell)
    return np.asarray(gone & (gone.sum(axis=0) > 1))


def _further(own: Obstructed, load: Array, cell: Indices) -> Array:
    """By what share of the ramp the pressure of a cell changes by `TIE` of itself, (batch,).

    Without a cell that of the pressure that changes most, and as far as the fold may be away.
    """
    assert own.ramp is not None, "pressures change"
    both = own.ramp.begin, own.ramp.change
    most = np.abs(own.ramp.change[:, 0]).argmax()
    chosen = np.where(cell >= 0, cell % len(own.ramp.change), most)
    begin, change = (part[chosen, 0] for part in both)
    size = np.abs(change)
    share = TIE * np.abs(begin + load * change) / np.where(size > 0.0, size, np.inf)
    return np.asarray(np.where(cell >= 0, share, share + AT_KINK))
