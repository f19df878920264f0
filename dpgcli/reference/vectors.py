"""The vectors of a unit in mpmath numbers, their lengths, directions and corners."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from mpmath import mpf

Vector = tuple["mpf", "mpf"]


class ExactCell(NamedTuple):
    """The vectors c, t, p and q of a unit."""

    chord: Vector
    top: Vector
    near: Vector
    far: Vector


def cells(base: Sequence["mpf"], nodes: Sequence["mpf"]) -> Iterator[ExactCell]:
    """The vectors of every unit by the nodes of the base station and the others."""
    stations = [base, *(nodes[k : k + 4] for k in range(0, len(nodes), 4))]
    for before, after in pairwise(stations):
        yield ExactCell(
            (after[0] - before[0], after[1] - before[1]),
            (after[2] - before[2], after[3] - before[3]),
            (before[2] - before[0], before[3] - before[1]),
            (after[2] - after[0], after[3] - after[1]),
        )


def dot(v: Vector, w: Vector) -> "mpf":
    """The scalar product of two plane vectors."""
    return v[0] * w[0] + v[1] * w[1]


def cross(v: Vector, w: Vector) -> "mpf":
    """The cross product of two plane vectors."""
    return v[0] * w[1] - v[1] * w[0]


def left(v: Vector) -> Vector:
    """A vector turned to the left."""
    return -v[1], v[0]


def times(factor: "mpf", v: Vector) -> Vector:
    """A vector times a number."""
    return factor * v[0], factor * v[1]


def direction_rates(vector: Vector) -> tuple[Vector, Vector]:
    """Derivatives m/ℓ of a vector's direction and n/ℓ of log ℓ, n along it and m to the left."""
    stretch = times(1 / dot(vector, vector), vector)
    return left(stretch), stretch


def measured(vector: Vector) -> tuple["mpf", Vector]:
    """Length and direction."""
    from mpmath import sqrt

    length = sqrt(dot(vector, vector))
    return length, times(1 / length, vector)


def corners(cell: ExactCell) -> Vector:
    """The angles a and b."""
    from mpmath import atan2

    chord, near, far = cell.chord, cell.near, cell.far
    a = atan2(-dot(chord, near), cross(chord, near))
    return a, atan2(dot(chord, far), cross(chord, far))
