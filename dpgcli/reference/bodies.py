"""Bodies in the way of a finger in extended precision: the places of its face, and their gaps.

The face is drawn from the finger's nodes here. A disc meets the nearest place of each side. A
body with straight sides meets sides of the face with its corners, and corners of the face with the
side that these are furthest in front of, or with notches any; nothing else of two polygons can
touch.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from dpgcli.records import dataclass
from dpgcli.reference.equilibria import extended
from dpgcli.reference.vectors import Vector, cross, measured

if TYPE_CHECKING:
    from mpmath import mpf


@dataclass(frozen=True)
class RoundBody:
    """A disc in the finger's frame, and the thickness of the finger's layer, mm."""

    center: tuple[float, float]
    radius: float
    thickness: float

    @property
    def name(self) -> str:
        """What it is, with its size."""
        return f"disc of {2.0 * self.radius:g} mm"

    def smaller(self, by: float) -> "RoundBody":
        """With its edge moved inwards, mm."""
        return replace(self, radius=self.radius - by)


@dataclass(frozen=True)
class StraightBody:
    """A body by its corners in the finger's frame, itself to the left of its sides; mm.

    Where it has notches nodes of the face may touch each side that they are over. `thickness` is
    that of the finger's layer. It yields along −y with a `stiffness`, N/mm.
    """

    corners: tuple[tuple[float, float], ...]
    thickness: float
    stiffness: float = np.inf

    @property
    def name(self) -> str:
        """What it is, with its size."""
        width, height = np.ptp(np.array(self.corners), axis=0)
        return f"{len(self.corners)} corners within {width:g} x {height:g} mm"

    def lowered(self, by: float) -> "StraightBody":
        """Where it is once it has yielded, mm."""
        return replace(self, corners=tuple((x, y - by) for x, y in self.corners))

    def smaller(self, by: float) -> "StraightBody":
        """With its sides moved inwards, mm.

        >>> StraightBody(((0.0, 0.0), (4.0, 0.0), (0.0, 3.0)), 0.0).smaller(0.5).corners[0]
        (0.5, 0.5)
        """
        corners = np.array(self.corners)
        side = np.roll(corners, -1, axis=0) - corners
        inwards = np.stack((-side[:, 1], side[:, 0]), axis=1) / np.hypot(*side.T)[:, None]
        reach = (corners * inwards).sum(axis=1) + by
        moved = [
            np.linalg.solve(inwards[[place - 1, place]], reach[[place - 1, place]])
            for place in range(len(corners))
        ]
        return replace(self, corners=tuple((float(x), float(y)) for x, y in moved))


Body = RoundBody | StraightBody
BEHIND = 1.0  # mm: what is further behind a side is not at it


class Place(NamedTuple):
    """A place of the face: a side, the first is 0, or the corner at the end of so many sides.

    And the corner of the body that the side meets, or the side that the corner does; of a disc 0.
    """

    number: int
    is_corner: bool
    part: int = 0


class ExactBody(Protocol):
    """A body in mpmath numbers."""

    def lowered(self, by: "mpf") -> "ExactBody":
        """Further along −y."""

    @property
    def middle(self) -> Vector:
        """The center of its area."""

    def seen(self, place: Callable[[Vector], Vector], side: int) -> "ExactBody":
        """With every point at its `place`; a mirror image if the side is −1."""

    def face(self, stations: Sequence["mpf"]) -> list[Vector]:
        """F_0 … F_n by the nodes B_0, T_0, B_1, …"""

    def gap_of(self, stations: list["mpf"], place: Place) -> "mpf":
        """The gap at a place by the nodes: of those beside it only, the others far from it."""

    def places(self, face: list[Vector]) -> list[Place]:
        """Where the body may touch the face, each once, in the order of pushes."""

    def gap(self, face: list[Vector], place: Place) -> "mpf":
        """Distance of the body from a place, negative where it is in or behind the face."""


def exact(body: Body) -> ExactBody:
    """The same in mpmath numbers."""
    (thickness,) = extended(np.array([body.thickness]))
    if isinstance(body, RoundBody):
        x, y, radius = extended(np.array([*body.center, body.radius]))
        return _Round(thickness, (x, y), radius)
    numbers = extended(np.array(body.corners).ravel())
    return _Straight(thickness, list(zip(numbers[::2], numbers[1::2], strict=True)))


def face_of(thickness: "mpf", stations: Sequence["mpf"]) -> list[Vector]:
    """The face of a finger with a layer of a thickness, by its nodes."""
    nodes = []
    for k in range(0, len(stations), 4):
        x, y, top_x, top_y = stations[k : k + 4]
        _, along = measured((top_x - x, top_y - y))
        nodes.append((x - thickness * along[0] / 2, y - thickness * along[1] / 2))
    return nodes


@dataclass(frozen=True)
class _Faced:
    """Base of bodies: the face of a finger with a layer of some thickness."""

    thickness: "mpf"

    def face(self, stations: Sequence["mpf"]) -> list[Vector]:
        """Half a layer inside B on the line to T."""
        return face_of(self.thickness, stations)

    def gap_of(self, stations: list["mpf"], place: Place) -> "mpf":
        """By the part of the face beside it."""
        first = max(0, place.number - place.is_corner)
        beside = self.face(stations[4 * first : 4 * place.number + 8])
        return self.gap(beside, place._replace(number=place.number - first))

    def gap(self, face: list[Vector], place: Place) -> "mpf":
        """Each body's own."""
        raise NotImplementedError


@dataclass(frozen=True)
class _Round(_Faced):
    """A `RoundBody`."""

    center: Vector
    radius: "mpf"

    def lowered(self, by: "mpf") -> "_Round":
        """Further along −y."""
        return replace(self, center=(self.center[0], self.center[1] - by))

    @property
    def middle(self) -> Vector:
        """The center."""
        return self.center

    def seen(self, place: Callable[[Vector], Vector], side: int) -> "_Round":
        """With its center there."""
        return replace(self, center=place(self.center))

    def places(self, face: list[Vector]) -> list[Place]:
        """The nearest place of each side, along the face."""
        found = []
        for number, (start, end) in enumerate(pairwise(face)):
            along, away = _between(start, end), _between(start, self.center)
            reached = _dot(along, away)
            if reached <= 0 or reached >= _dot(along, along):
                found.append(Place(number + int(reached > 0), True))
            else:
                found.append(Place(number, False))
        return sorted(dict.fromkeys(found), key=lambda place: place.number - 0.5 * place.is_corner)

    def gap(self, face: list[Vector], place: Place) -> "mpf":
        """From the center, less the radius."""
        if not place.is_corner:
            start, end = face[place.number : place.number + 2]
            _, along = measured(_between(start, end))
            return cross(_between(start, self.center), along) - self.radius
        corner = face[place.number]
        distance, away = measured(_between(corner, self.center))
        beside = [
            measured(_between(start, end))[1]
            for start, end in pairwise(face[max(0, place.number - 1) : place.number + 2])
        ]
        is_behind = len(beside) == 2 and sum(cross(away, along) for along in beside) < 0
        return (-distance if is_behind else distance) - self.radius


@dataclass(frozen=True)
class _Straight(_Faced):
    """A `StraightBody`."""

    corners: list[Vector]

    def lowered(self, by: "mpf") -> "_Straight":
        """Further along −y."""
        return replace(self, corners=[(x, y - by) for x, y in self.corners])

    @property
    def middle(self) -> Vector:
        """The mean of triangles from the origin to the sides."""
        sides = [self._side(part) for part in range(len(self.corners))]
        areas = [cross(start, end) for start, end in sides]
        pairs = list(zip(areas, sides, strict=True))
        x, y = (sum(a * (start[k] + end[k]) for a, (start, end) in pairs) for k in (0, 1))
        return x / (3 * sum(areas)), y / (3 * sum(areas))

    def seen(self, place: Callable[[Vector], Vector], side: int) -> "_Straight":
        """With corners there, and itself to the left of its sides again."""
        return replace(self, corners=[place(corner) for corner in self.corners][::side])

    def places(self, face: list[Vector]) -> list[Place]:
        """Corner by corner of the body the sides that it is over, then side by side nodes."""
        found = [
            Place(number, False, part)
            for part, corner in enumerate(self.corners)
            for number, side in enumerate(pairwise(face))
            if _is_over(side, corner)
        ]
        return found + [
            Place(number, True, part)
            for part in range(len(self.corners))
            for number, node in enumerate(face)
            if self._is_at(part, node) and _is_over(self._side(part), node)
        ]

    def gap(self, face: list[Vector], place: Place) -> "mpf":
        """Of a corner from the line of a side: the body's, or the face's."""
        if place.is_corner:
            return self._front(place.part, face[place.number])
        start, end = face[place.number : place.number + 2]
        _, along = measured(_between(start, end))
        return cross(_between(start, self.corners[place.part]), along)

    def _is_at(self, part: int, node: Vector) -> bool:
        """Whether a point that is over a side may touch it; with notches more than one may be."""
        if self.is_convex:
            return self._facing(node) == part
        return bool(self._front(part, node) > -BEHIND)

    @cached_property
    def is_convex(self) -> bool:
        """Whether it has no notches."""
        sides = [_between(*self._side(part)) for part in range(len(self.corners))]
        return all(cross(before, after) > 0 for before, after in pairwise([sides[-1], *sides]))

    def _facing(self, node: Vector) -> int:
        """The side that a point is furthest in front of, or least behind."""
        return max(range(len(self.corners)), key=lambda part: self._front(part, node))

    def _side(self, part: int) -> tuple[Vector, Vector]:
        return self.corners[part], self.corners[(part + 1) % len(self.corners)]

    def _front(self, part: int, point: Vector) -> "mpf":
        """How far a point is in front of a side."""
        start, end = self._side(part)
        _, along = measured(_between(start, end))
        return cross(_between(start, point), along)


def _is_over(side: tuple[Vector, Vector], point: Vector) -> bool:
    """Whether the nearest place of a line to a point is within a side."""
    along = _between(*side)
    return bool(0 < _dot(along, _between(side[0], point)) < _dot(along, along))


def _between(start: Vector, end: Vector) -> Vector:
    return end[0] - start[0], end[1] - start[1]


def _dot(v: Vector, w: Vector) -> "mpf":
    return v[0] * w[0] + v[1] * w[1]
