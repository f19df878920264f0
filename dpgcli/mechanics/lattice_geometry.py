"""The shape behind a finger's node coordinates: the four vectors of every cell."""

from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array


class Vectors(NamedTuple):
    """The vectors c, t, p and q of every cell in mm, each (2, unit, batch)."""

    chord: Array
    top: Array
    near: Array
    far: Array


def vectors(coordinates: Array, height: Array) -> Vectors:
    """Every cell's vectors at `coordinates`, (size, batch) in mm; the clamped strut has length H.

    >>> cell = vectors(np.array([[13.5], [0.0], [13.5], [10.0]]), np.array([[10.0]]))
    >>> cell.chord.ravel().tolist(), cell.far.ravel().tolist()  # straight
    ([13.5, 0.0], [0.0, 10.0])
    """
    nodes = np.zeros((len(coordinates) // 4 + 1, 2, 2, coordinates.shape[1]), coordinates.dtype)
    nodes[0, 1, 1] = height[0]
    nodes[1:] = coordinates.reshape(nodes[1:].shape)
    base, top = nodes.transpose(1, 2, 0, 3)
    strut = top - base
    return Vectors(np.diff(base, axis=1), np.diff(top, axis=1), strut[:, :-1], strut[:, 1:])


def dot(first: Array, second: Array) -> Array:
    """First · second, of vectors (2, …).

    >>> float(dot(np.array([1.0, 2.0]), np.array([3.0, 4.0])))
    11.0
    """
    return np.asarray(first[0] * second[0] + first[1] * second[1])


def cross(first: Array, second: Array) -> Array:
    """First × second, of vectors (2, …).

    >>> float(cross(np.array([1.0, 2.0]), np.array([3.0, 4.0])))
    -2.0
    """
    return np.asarray(first[0] * second[1] - first[1] * second[0])


def left(vector: Array) -> Array:
    """The vector (2, …) turned by +90°.

    >>> left(np.array([1.0, 2.0]))
    array([-2.,  1.])
    """
    return np.stack((-vector[1], vector[0]))


def extension(vector: Array, rest: Array, axis: int) -> Array:
    """|v| − r as ((v∥ − r)(v∥ + r) + v⊥²)/(|v| + r), with v∥ along the straight finger's `axis`.

    Exact to rounding where the bar lies as in the straight finger.

    >>> float(extension(np.array([3.0, 4.0]), np.array(4.0), 0))
    1.0
    """
    along, across = vector[axis], vector[1 - axis]
    length = np.sqrt(along * along + across * across)
    return np.asarray(((along - rest) * (along + rest) + across * across) / (length + rest))


def swung(vector: Array, change: Array) -> Array:
    """A vector turned and stretched at the rates of a change of it, (2, …).

    It turns by v × Δ/|v|² and stretches by v · Δ/|v|².

    >>> swung(np.array([1.0, 0.0]), np.array([0.5, np.pi / 2.0])).round(9)
    array([0. , 1.5])
    """
    squared = dot(vector, vector)
    turn, stretch = cross(vector, change) / squared, 1.0 + dot(vector, change) / squared
    return stretch * (np.cos(turn) * vector + np.sin(turn) * left(vector))


class Corners(NamedTuple):
    """Corner angles at the near and far station in rad, (unit, batch), positive when open."""

    near: Array
    far: Array


def corners(cell: Vectors) -> Corners:
    """a = ∠p − ∠c − π/2 and b = ∠c + π/2 − ∠q, from products that vanish at rest.

    >>> cell = vectors(np.array([[13.5], [0.0], [14.5], [1.0]]), np.array([[10.0]]))
    >>> round(float(corners(cell).far[0, 0]), 9)  # the far strut leans by 45°
    0.785398163
    """
    chord, near, far = cell.chord, cell.near, cell.far
    return Corners(
        np.arctan2(-dot(chord, near), cross(chord, near)),
        np.arctan2(dot(chord, far), cross(chord, far)),
    )
