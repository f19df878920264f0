"""Boxes cut along the lines of a grid into twenty-node bricks."""

from collections.abc import Sequence

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.calibration.fe.elements import BRICK
from dpgcli.records import dataclass


@dataclass(frozen=True)
class Bricks:
    """Nodes (n, 3) at rest in mm and elements (m, 20), numbered from 0."""

    nodes: Array
    elements: Indices


def grid_lines(cuts: Array, counts: Sequence[int]) -> Array:
    """Lines that cut each piece between neighboring cuts (sorted, in mm) into so many cells.

    >>> grid_lines(np.array([0.0, 1.0, 4.0]), [1, 2]).tolist()
    [0.0, 1.0, 2.5, 4.0]
    """
    pieces = [
        np.linspace(start, end, count + 1)[1:]
        for start, end, count in zip(cuts[:-1], cuts[1:], counts, strict=True)
    ]
    return np.concatenate([cuts[:1], *pieces])


def bricks(lines: tuple[Array, Array, Array], is_solid: Flags) -> Bricks:
    """The solid cells of a grid, `is_solid` by cell (x, y, z), as bricks that share their nodes."""
    shape = tuple(2 * n + 1 for n in is_solid.shape)
    cells = np.argwhere(is_solid)
    places = 2 * cells[:, None, :] + BRICK
    flat = np.ravel_multi_index(tuple(np.moveaxis(places, -1, 0)), shape)
    used, elements = np.unique(flat, return_inverse=True)
    at = np.unravel_index(used, shape)
    halves = (_with_middles(axis)[index] for axis, index in zip(lines, at, strict=True))
    return Bricks(np.stack(list(halves), axis=1), elements.reshape(places.shape[:2]))


def _with_middles(lines: Array) -> Array:
    refined = np.empty(2 * len(lines) - 1)
    refined[::2], refined[1::2] = lines, (lines[:-1] + lines[1:]) / 2
    return refined
