"""Two fingers with a body between them, or none, in extended precision.

Both fingers' unknowns are one vector, behind them how far the body has moved along x and y, mm, and
turned, rad, as far as it may. A node of one finger meets a side of the other: the face's, and that
of the end along the last strut. Fingers do not touch node to node here.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.reference.bodies import BEHIND, Body, ExactBody, Place, exact, face_of
from dpgcli.reference.contact import NEAR, Search
from dpgcli.reference.equilibria import (
    Energy,
    ExtendedArray,
    digits_lost,
    energy_of,
    extended,
    long_doubles,
    pose_in_pattern,
)
from dpgcli.reference.expansion import Expansion
from dpgcli.reference.units import Unit, extended_units, inverted_rest
from dpgcli.reference.vectors import Vector, cross, dot, measured

if TYPE_CHECKING:
    from mpmath import mpf


@dataclass(frozen=True)
class Grip:
    """Two mirrored fingers with bases so far apart, layers of a thickness, and a body; mm.

    The body is in the frame between the bases. It moves in the first `n_motions` of x, y and angle.
    """

    spacing: float
    thickness: float
    body: Body | None = None
    n_motions: int = 0

    @property
    def name(self) -> str:
        """What is between the fingers."""
        held = ("fixed", "guided", "free", "free to turn")[self.n_motions]
        return "nothing between" if self.body is None else f"{self.body.name}, {held}"

    def with_motions(self, number: int) -> "Grip":
        """With a body that has so many."""
        return replace(self, n_motions=number)

    def smaller(self, by: float) -> "Grip":
        """With the body's edge moved inwards, mm."""
        assert self.body is not None, "a grip with a body"
        return replace(self, body=self.body.smaller(by))


@dataclass(frozen=True)
class ExtendedGrip:
    """An equilibrium of both fingers: tips (finger, 3) as in `ExtendedContact`, and pushes, N.

    Those of the upper and of the lower finger on the body, and between them, smallest first.
    `nodes` (finger, 4 n) and `walls` (finger, unit), mm, and `moved` (3,), mm and rad, are rounded.
    """

    pose: ExtendedArray
    push: tuple[ExtendedArray, ExtendedArray, ExtendedArray]
    is_minimum: bool
    in_pattern: bool
    nodes: Array
    walls: Array
    moved: Array


class Between(NamedTuple):
    """A node of the other finger at a side of this one; the first are 0."""

    finger: int
    side: int
    node: int


class OnBody(NamedTuple):
    """A place of a finger's face that the body may touch."""

    finger: int
    place: Place


Spot = Between | OnBody


def extended_grip(
    finger: Finger,
    pattern: Flags,
    grip: Grip,
    nodes: Array,
    moved: Array,
    walls: Array | None = None,
    apart: float = 0.0,
    digits: int = 50,
) -> ExtendedGrip | None:
    """The equilibrium of patterns (finger, unit) next to `nodes` (finger, 4 n), mm.

    The body has `moved` (3,), mm and rad. Each finger with its body stands further away from the
    axis by half of `apart`, mm. None where there is none.
    """
    import mpmath

    lost = digits_lost(finger)
    with mpmath.workdps(digits + lost):
        units, bars = extended_units(finger), list[Energy]()
        start: list[mpf] = []
        for own, flags in zip(nodes, pattern, strict=True):
            rests = [
                inverted_rest(unit)[1] * int(on) for unit, on in zip(units, flags, strict=True)
            ]
            begin = rests if walls is None else extended(walls[len(bars)])
            bars.append(energy_of(finger, units, begin))
            start += bars[-1].unknowns(extended(own))
        upper, lower = bars
        both = _Both(upper, lower, len(start) // 2)
        here = [*start, *extended(moved[: grip.n_motions])]
        touching = Touching(both, grip, *extended(np.array([grip.spacing, apart, grip.thickness])))
        search = Search(both, touching, digits, lost)
        try:
            found = search.with_contacts(here, touching.closed(here, mpmath.mpf(NEAR)))
        except (ZeroDivisionError, ValueError):  # nodes that coincide, or a mechanism
            return None
        if found is None:
            return None
        *parts, by = both.apart(found.unknowns)
        told = [
            pose_in_pattern(own, part, flags)
            for own, part, flags in zip(bars, parts, pattern, strict=True)
        ]
        push = [
            sorted(value for spot, value in found.push.items() if kind == _kind(spot))
            for kind in range(3)
        ]
        return ExtendedGrip(
            pose=np.stack([pose for pose, *_ in told]),
            push=(long_doubles(push[0]), long_doubles(push[1]), long_doubles(push[2])),
            is_minimum=search.is_minimum(found),
            in_pattern=all(is_so for *_, is_so in told),
            nodes=np.array([o.nodes(p) for o, p in zip(bars, parts, strict=True)], float),
            walls=np.array([o.walls(p) for o, p in zip(bars, parts, strict=True)], float),
            moved=np.array([*by, 0, 0, 0][:3], float),
        )


def _kind(spot: Spot) -> int:
    """Of which pushes one at a spot is."""
    return spot.finger if isinstance(spot, OnBody) else 2


def depth(finger: Finger, grip: Grip, nodes: Array, moved: Array, apart: float = 0.0) -> float:
    """How deep fingers, nodes (finger, 4 n), are in the body and in each other, mm."""
    import mpmath

    with mpmath.workdps(30):
        units = extended_units(finger)
        bars = energy_of(finger, units, [mpmath.mpf(0)] * len(units))
        both = _Both(bars, bars, 0)
        numbers = extended(np.array([grip.spacing, apart, grip.thickness]))
        touching = Touching(both, grip, *numbers)
        outlines = [touching.outline(extended(own)) for own in nodes]
        body = touching.bodies(extended(moved))
        faces = [outline[:-1] for outline in outlines]
        gaps = [
            own.gap(face, place)
            for own, face in zip(body, faces, strict=False)
            for place in own.places(face)
        ]
        gaps += [gap for _, gap in touching.met(outlines)]
        return max(0.0, -float(min(gaps, default=0)))


@dataclass(frozen=True)
class _Both:
    """The energy of two fingers; behind `size` unknowns of each those of the body's motions."""

    upper: Energy
    lower: Energy
    size: int

    @property
    def units(self) -> list[Unit]:
        """Those of a finger."""
        return self.upper.units

    @property
    def scale(self) -> "mpf":
        """A finger's length."""
        return self.upper.scale

    def apart(self, unknowns: list["mpf"]) -> tuple[list["mpf"], list["mpf"], list["mpf"]]:
        """Those of each finger, and the body's."""
        n = self.size
        return unknowns[:n], unknowns[n : 2 * n], unknowns[2 * n :]

    def at(self, unknowns: list["mpf"]) -> Expansion:
        """The sum; bodies have no energy."""
        upper, lower, by = self.apart(unknowns)
        whole, other = self.upper.at(upper), self.lower.at(lower)
        whole.energy += other.energy
        whole.gradient += [*other.gradient, *(0 * value for value in by)]
        whole.band += [*other.band, *([0 * value] for value in by)]
        return whole

    def moved(self, unknowns: list["mpf"], step: list["mpf"]) -> list["mpf"]:
        """Each finger's own update, and a sum."""
        (upper, lower, by), (first, second, more) = self.apart(unknowns), self.apart(step)
        sums = [value + part for value, part in zip(by, more, strict=True)]
        return [*self.upper.moved(upper, first), *self.lower.moved(lower, second), *sums]

    def strokes_opened(self, unknowns: list["mpf"], step: list["mpf"]) -> "mpf":
        """The most that either finger's units open by."""
        (upper, lower, _), (first, second, _) = self.apart(unknowns), self.apart(step)
        return max(
            self.upper.strokes_opened(upper, first), self.lower.strokes_opened(lower, second)
        )


@dataclass(frozen=True)
class Touching:
    """What two fingers may touch, in mpmath numbers."""

    both: _Both
    grip: Grip
    spacing: "mpf"
    aside: "mpf"
    thickness: "mpf"

    def closed(self, unknowns: list["mpf"], within: "mpf") -> list[Spot]:
        """Where gaps are at most so large, mm."""
        *fingers, by = self.both.apart(unknowns)
        stations = [self._stations(own) for own in self._nodes(fingers)]
        found: list[Spot] = []
        for finger, body in enumerate(self.bodies(by)):
            face = body.face(stations[finger])
            places = (place for place in body.places(face) if body.gap(face, place) <= within)
            found += [OnBody(finger, place) for place in places]
        outlines = [self.outline(own) for own in self._nodes(fingers)]
        return found + [spot for spot, gap in self.met(outlines) if gap <= within]

    def gap(self, unknowns: list["mpf"], spot: Spot) -> "mpf":
        """The gap at a spot, mm."""
        *fingers, by = self.both.apart(unknowns)
        nodes = self._nodes(fingers)
        if isinstance(spot, OnBody):
            body = self.bodies(by)[spot.finger]
            return body.gap_of(self._stations(nodes[spot.finger]), spot.place)
        side = self.outline(nodes[spot.finger])[spot.side : spot.side + 2]
        return self._distance(side, self.outline(nodes[1 - spot.finger])[spot.node])

    def met(self, outlines: list[list[Vector]]) -> Iterator[tuple[Spot, "mpf"]]:
        """Nodes of one finger that are over a side of the other, and their gaps."""
        for finger, outline in enumerate(outlines):
            for side, (start, end) in enumerate(pairwise(outline)):
                for node, point in enumerate(outlines[1 - finger]):
                    along = _between(start, end)
                    share = dot(along, _between(start, self._mirrored(point)))
                    gap = self._distance([start, end], point)
                    if 0 < share < dot(along, along) and gap > -BEHIND:
                        yield Between(finger, side, node), gap

    def bodies(self, by: list["mpf"]) -> list[ExactBody]:
        """The body as each finger has it; none without one."""
        body = self.grip.body
        if body is None:
            return []
        x, y, angle = [*by, 0, 0, 0][:3]
        own = exact(body)
        return [_seen(own, side, self.spacing / 2, (x, y), angle) for side in (1, -1)]

    def outline(self, nodes: list["mpf"]) -> list[Vector]:
        """F_0 … F_n, and the end of the last strut at the domes' axis."""
        stations = self._stations(nodes)
        face = face_of(self.thickness, stations)
        x, y, top_x, top_y = stations[-4:]
        _, up = measured((top_x - x, top_y - y))
        height = self.both.units[0].height
        return [*face, (x + height * up[0], y + height * up[1])]

    def _nodes(self, fingers: list[list["mpf"]]) -> list[list["mpf"]]:
        pairs = zip((self.both.upper, self.both.lower), fingers, strict=True)
        return [bars.nodes(own) for bars, own in pairs]

    def _stations(self, nodes: list["mpf"]) -> list["mpf"]:
        return [0, 0, 0, self.both.units[0].height, *nodes]

    def _mirrored(self, point: Vector) -> Vector:
        """A point of one finger's frame in the other's."""
        return point[0], -point[1] - self.spacing - self.aside

    def _distance(self, side: list[Vector], point: Vector) -> "mpf":
        """Of the other finger's point from the line of a side, on its inner one."""
        start, end = side
        _, along = measured(_between(start, end))
        return cross(_between(start, self._mirrored(point)), along)


def _seen(body: ExactBody, side: int, half: "mpf", by: Vector, angle: "mpf") -> ExactBody:
    """A body, moved and turned about the center of its area, in a finger's frame."""
    from mpmath import cos, sin

    (x, y), c, s = body.middle, cos(angle), sin(angle)

    def place(point: Vector) -> Vector:
        right, up = point[0] - x, point[1] - y
        turned = x + by[0] + c * right - s * up, y + by[1] + s * right + c * up
        return turned[0], side * turned[1] - half

    return body.seen(place, side)


def _between(start: Vector, end: Vector) -> Vector:
    return end[0] - start[0], end[1] - start[1]
