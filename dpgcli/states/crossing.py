"""Self-intersection: far parts of one finger in the same place.

The energies know no contact, so a long finger may curl through itself: the sides of its outline
cross. That takes a closed loop, which with turns of at most φ a unit has 2π/φ units or more (our
derivation: a bend of radius R = L/φ meets itself after 2πR, and later if it turns by less than
2π, since it then needs straight legs). Shorter fingers are not looked at.
"""

from math import ceil

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.coordinates import Stations
from dpgcli.records import dataclass

FULL_TURN = 2.0 * np.pi
FEWEST_APART = 2  # cells that share no station


def fewest_in_loop(turn: Array, length: Array, n_units: int) -> int | None:
    """The fewest units of a closed loop; None for a finger too short for one.

    `turn` is the largest by which each unit may turn the next, rad, `length` its L, (unit or 1,
    design or 1).

    >>> fewest_in_loop(np.array([[0.303]]), np.array([[13.5]]), 20) is None
    True
    >>> fewest_in_loop(np.array([[0.303]]), np.array([[13.5]]), 32)
    21
    """
    radius = (length / np.maximum(turn, np.finfo(float).tiny)).min(axis=0)
    whole = np.broadcast_to(length, (n_units, length.shape[1])).sum(axis=0)
    if not (whole >= FULL_TURN * radius).any():
        return None
    fewest = ceil(float((FULL_TURN * radius / length.max(axis=0)).min()))
    return max(FEWEST_APART, fewest)


@dataclass(frozen=True)
class Outline:
    """Stations on the limiting layer and on the dome axis, complex, mm, (unit + 1, …, batch)."""

    base: Array
    top: Array


def outline(nodes: Stations, height: Array) -> Outline:
    """The outline of a finger by its free nodes, each (unit, batch); H in mm.

    >>> one = np.ones((1, 1))
    >>> around = outline(Stations(3.0 * one, 0.0 * one, 3.0 * one, 4.0 * one), 4.0 * one)
    >>> around.base.ravel().tolist(), around.top.ravel().tolist()
    ([0j, (3+0j)], [4j, (3+4j)])
    """
    base, top = nodes.base_x + 1j * nodes.base_y, nodes.top_x + 1j * nodes.top_y
    clamped = np.zeros_like(base[:1])
    return Outline(np.concatenate((clamped, base)), np.concatenate((clamped + 1j * height, top)))


def crosses_itself(around: Outline, apart: int) -> Flags:
    """Whether far parts of a finger are in the same place, (batch,).

    Parts fewer than `apart` units from each other are not looked at.

    >>> angle = np.exp(-0.5j * np.arange(15))[:, None]  # more than a full turn
    >>> crosses_itself(Outline(20.0 * angle, 30.0 * angle), 12).tolist()
    [True]
    """
    base, touching = around.base, diagonals(around)
    near = np.zeros(base.shape[1], bool)
    for stop in range(apart, len(base)):
        near |= (np.abs(base[stop] - base[: stop - apart + 1]) < touching).any(axis=0)
    crosses = np.zeros_like(near)
    lanes = np.flatnonzero(near)
    if len(lanes):
        crosses[lanes] = ~is_simple(Outline(base[:, lanes], around.top[:, lanes]))
    return crosses


def diagonals(around: Outline) -> Array:
    """Twice the longest diagonal of a cell, mm, (batch,): cells further apart cannot touch.

    >>> square = Outline(np.array([[0j], [3 + 0j]]), np.array([[4j], [3 + 4j]]))
    >>> diagonals(square).tolist()  # 2 · √(3² + 4²)
    [10.0]
    """
    chord = np.abs(np.diff(around.base, axis=0)).max(axis=0)
    return np.asarray(2.0 * np.hypot(chord, np.abs(around.top - around.base).max(axis=0)))


def is_simple(around: Outline) -> Flags:
    """Whether no sides of the outline cross, (batch,): along the layer, back along the domes.

    >>> base, top = np.array([[0j], [3 + 0j]]), np.array([[4j], [3 + 4j]])
    >>> is_simple(Outline(base, top)).tolist(), is_simple(Outline(base, top[::-1])).tolist()
    ([True], [False])
    """
    import shapely

    ring = np.concatenate((around.base, around.top[::-1])).T
    points = np.stack((ring.real, ring.imag), axis=-1)
    return np.asarray(shapely.is_simple(shapely.linearrings(points)))
