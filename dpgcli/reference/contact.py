"""Equilibria of a finger against a body in extended precision: the reference for contact.

The finger's energy is that of `reference.energy`; gaps are those of `reference.bodies`, and are
differentiated by differences, which cost no digits that are missed. A state is what Newton's method
makes of the optimality conditions of a set of contacts: balance with their pushes, no gap at them.
The set is right where no contact pulls and no other place is penetrated.
"""

from collections.abc import Callable, Hashable
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.reference.bodies import Body, ExactBody, Place, StraightBody, exact
from dpgcli.reference.equilibria import (
    Energy,
    ExtendedArray,
    digits_lost,
    energy_of,
    extended,
    factorize,
    long_doubles,
    pose_in_pattern,
)
from dpgcli.reference.expansion import Expansion
from dpgcli.reference.units import Unit, extended_units

if TYPE_CHECKING:
    from mpmath import mpf

NEAR = 1e-10  # mm: gaps that the search begins to close
MOST_STEPS, MOST_SETS = 60, 12  # of Newton's method for one set of contacts; of sets
BENT_AGAIN = 1e-6  # of the finger's length: after a longer step gaps are differentiated twice anew
LARGEST_OPENING = 0.25  # strokes that one step may open a unit by
STIFFENED = 15  # digits by which contacts are stiffer than bars where curvature is looked at


@dataclass(frozen=True)
class ExtendedContact:
    """An equilibrium against a body, known to more digits than doubles have.

    `pose` is tip x, y (mm) and angle (rad), (3,), `energy` in mJ. `push` (contact,) N are those at
    `places`, in their order along the face. `is_minimum`: positive curvature on the motions that
    contacts leave. `in_pattern` as in `ExtendedStates`. `nodes` (4 n,) and `walls` (unit,), mm, are
    rounded to doubles, and so is by how much the body has `yielded`, mm.
    """

    pose: ExtendedArray
    energy: np.longdouble
    push: ExtendedArray
    places: tuple[Place, ...]
    is_minimum: bool
    in_pattern: bool
    nodes: Array
    walls: Array
    yielded: float = 0.0


def extended_contact(
    finger: Finger,
    pattern: Flags,
    body: Body,
    nodes: Array,
    walls: Array,
    yielded: float = 0.0,
    digits: int = 50,
) -> ExtendedContact | None:
    """The equilibrium of a pattern (unit,) against a body, next to `nodes` (4 n,) and `walls`, mm.

    A body that yields has done so by `yielded`, mm. None where there is none. As many digits as the
    bars are stiffer than the springs are carried on top.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.reference.bodies import RoundBody
    >>> straight = np.array([13.5, 0.0, 13.5, 10.75])
    >>> body = RoundBody((9.0, -8.0), 8.0, 0.0)  # it touches a straight unit without a layer
    >>> finger, ground, rigid = uniform_finger(1, **STUDY), np.array([False]), np.zeros(1)
    >>> extended_contact(finger, ground, body, straight, rigid).push.astype(float).tolist()
    [0.0]
    """
    import mpmath

    lost = digits_lost(finger)
    with mpmath.workdps(digits + lost):
        bars = energy_of(finger, extended_units(finger), extended(walls))
        start = bars.unknowns(extended(nodes))
        whole: Energy | _Yielding = bars
        if isinstance(body, StraightBody) and np.isfinite(body.stiffness):
            whole = _Yielding(bars, *extended(np.array([body.stiffness])))
            start = [*start, *extended(np.array([yielded]))]
        alone, here = Alone(whole, exact(body)), start
        search = Search(whole, alone, digits, lost)
        try:
            found = search.with_contacts(here, alone.closed(here, mpmath.mpf(NEAR)))
        except (ZeroDivisionError, ValueError):  # nodes that coincide, or a mechanism
            return None
        if found is None:
            return None
        own = found.unknowns if whole is bars else found.unknowns[:-1]
        pose, _, in_pattern = pose_in_pattern(bars, own, pattern)
        return ExtendedContact(
            pose=pose,
            energy=long_doubles([whole.at(found.unknowns).energy])[0],
            push=long_doubles(found.push.values()),
            places=tuple(found.push),
            is_minimum=search.is_minimum(found),
            in_pattern=in_pattern,
            nodes=np.array(bars.nodes(own), float),
            walls=np.array(bars.walls(own), float),
            yielded=0.0 if whole is bars else float(found.unknowns[-1]),
        )


def penetration(body: Body, nodes: Array, height: float) -> float:
    """How deep a body is in the face of a finger with these nodes (4 n,), mm; 0 where it is not."""
    import mpmath

    with mpmath.workdps(30):
        own = exact(body)
        face = own.face([mpmath.mpf(0)] * 3 + [mpmath.mpf(height), *extended(nodes)])
        gaps = (own.gap(face, place) for place in own.places(face))
        return max(0.0, -float(min(gaps, default=0)))


@dataclass(frozen=True)
class _Yielding:
    """The energy of a finger and of a body: the last unknown is how far this has yielded."""

    own: Energy
    stiffness: "mpf"

    @property
    def units(self) -> list[Unit]:
        """Those of the finger."""
        return self.own.units

    @property
    def scale(self) -> "mpf":
        """The finger's length."""
        return self.own.scale

    def at(self, unknowns: list["mpf"]) -> Expansion:
        """With ½ k u² on top."""
        *others, yielded = unknowns
        expansion = self.own.at(others)
        expansion.energy += self.stiffness * yielded**2 / 2
        expansion.gradient.append(self.stiffness * yielded)
        expansion.band.append([self.stiffness])
        return expansion

    def nodes(self, unknowns: list["mpf"]) -> list["mpf"]:
        """Those of the finger."""
        return self.own.nodes(unknowns[:-1])

    def moved(self, unknowns: list["mpf"], step: list["mpf"]) -> list["mpf"]:
        """The finger's own update, and a sum."""
        return [*self.own.moved(unknowns[:-1], step[:-1]), unknowns[-1] + step[-1]]

    def strokes_opened(self, unknowns: list["mpf"], step: list["mpf"]) -> "mpf":
        """By the finger's part of a step."""
        return self.own.strokes_opened(unknowns[:-1], step[:-1])


@dataclass(frozen=True)
class Alone:
    """A finger and its body: where they may touch."""

    bars: Energy | _Yielding
    body: ExactBody

    def closed(self, unknowns: list["mpf"], within: "mpf") -> list[Place]:
        """The places at which the body is within so much, mm."""
        body = self._body_at(unknowns)
        face = body.face(self._stations(unknowns))
        return [p for p in body.places(face) if body.gap(face, p) <= within]

    def gap(self, unknowns: list["mpf"], place: Place) -> "mpf":
        """The gap at a place, mm."""
        return self._body_at(unknowns).gap_of(self._stations(unknowns), place)

    def _stations(self, unknowns: list["mpf"]) -> list["mpf"]:
        """The nodes B_0, T_0, B_1, … at unknowns."""
        return [0, 0, 0, self.bars.units[0].height, *self.bars.nodes(unknowns)]

    def _body_at(self, unknowns: list["mpf"]) -> ExactBody:
        """The body where it is."""
        yields = isinstance(self.bars, _Yielding)
        return self.body.lowered(unknowns[-1]) if yields else self.body


P = TypeVar("P", bound=Hashable)


class Whole(Protocol):
    """The energy of all that touches."""

    @property
    def scale(self) -> "mpf":
        """The length that steps are compared with, mm."""

    def at(self, unknowns: list["mpf"]) -> Expansion:
        """The energy, expanded along `moved`."""

    def moved(self, unknowns: list["mpf"], step: list["mpf"]) -> list["mpf"]:
        """Unknowns a step further."""

    def strokes_opened(self, unknowns: list["mpf"], step: list["mpf"]) -> "mpf":
        """The largest opening of a unit by a step, in strokes."""


class Touched(Protocol[P]):
    """Where things may touch."""

    def closed(self, unknowns: list["mpf"], within: "mpf") -> list[P]:
        """The places at which gaps are at most so large, mm."""

    def gap(self, unknowns: list["mpf"], place: P) -> "mpf":
        """The gap at a place, mm."""


@dataclass(frozen=True)
class Balance(Generic[P]):
    """Unknowns in balance with pushes at places, and the Lagrangian's expansion there."""

    unknowns: list["mpf"]
    push: dict[P, "mpf"]
    slopes: list[list["mpf"]]
    hessian: list[list["mpf"]]


@dataclass(frozen=True)
class Search(Generic[P]):
    """Newton's method on the optimality conditions of contacts."""

    bars: Whole
    touched: Touched[P]
    digits: int
    lost: int

    @property
    def tolerance(self) -> "mpf":
        """What is no step any more, of the finger's length."""
        from mpmath import mpf

        return mpf(10) ** -(2 * self.digits // 5)

    def with_contacts(self, here: list["mpf"], active: list[P]) -> Balance[P] | None:
        """The equilibrium with the right set of contacts; None where there is none."""
        for _ in range(MOST_SETS):
            found = self._balanced(here, active)
            if found is None:
                return None
            held = [place for place in active if found.push[place] >= 0]
            closed = self.touched.closed(found.unknowns, self.tolerance * self.bars.scale * 100)
            pulling = set(active) - set(held)
            now = [place for place in closed if place not in pulling]
            if set(now) == set(active):
                return found
            here, active = found.unknowns, now
        return None

    def _balanced(self, here: list["mpf"], active: list[P]) -> Balance[P] | None:
        """Newton's method on balance and closed gaps."""
        from mpmath import lu_solve, matrix

        size, push = len(here), [0 * self.bars.scale] * len(active)
        bent: list[list[list[mpf]]] | None = None
        for _ in range(MOST_STEPS):
            expansion = self.bars.at(here)
            gaps = [self._gap_by_steps(here, place) for place in active]
            steps = [_slope(gap, size, self._small) for gap in gaps]
            bent = bent or [_bend(gap, size, self._small) for gap in gaps]
            hessian = _lagrangian(expansion, push, bent)
            system, right = _conditions(hessian, expansion.gradient, steps, gaps)
            (*step,) = lu_solve(matrix(system), matrix(right))
            own, push = step[:size], step[size:]
            largest = max(map(abs, own)) / self.bars.scale
            if largest <= self.tolerance:
                return Balance(here, dict(zip(active, push, strict=True)), steps, hessian)
            fraction = 1 / max(1, self.bars.strokes_opened(here, own) / LARGEST_OPENING)
            here = self.bars.moved(here, [fraction * part for part in own])
            bent = None if largest > BENT_AGAIN else bent
        return None

    @property
    def _small(self) -> "mpf":
        from mpmath import mpf

        return mpf(10) ** -(self.digits // 3)

    def _gap_by_steps(self, here: list["mpf"], place: P) -> Callable[[dict[int, "mpf"]], "mpf"]:
        """The gap at a place by steps of single unknowns, along the curved update."""

        def gap(steps: dict[int, "mpf"]) -> "mpf":
            whole = [steps.get(row, 0) for row in range(len(here))]
            moved = self.bars.moved(here, whole) if steps else here
            return self.touched.gap(moved, place)

        return gap

    def is_minimum(self, found: Balance[P]) -> bool:
        """Whether the Lagrangian bends upwards along all motions that contacts leave.

        It does where it does everywhere with contacts as very stiff springs.
        """
        from mpmath import mpf

        size = len(found.unknowns)
        stiff = mpf(10) ** STIFFENED * max(found.hessian[row][row] for row in range(size))
        band = [
            [
                found.hessian[row][column]
                + stiff * sum(slope[row] * slope[column] for slope in found.slopes)
                for column in range(row, -1, -1)
            ]
            for row in range(size)
        ]
        smallest = mpf(10) ** -(self.digits // 2 + STIFFENED + self.lost)
        return factorize(band, smallest).is_positive


Gap = Callable[[dict[int, "mpf"]], "mpf"]


def _slope(gap: Gap, size: int, small: "mpf") -> list["mpf"]:
    """∂g by central differences."""
    return [(gap({row: small}) - gap({row: -small})) / (2 * small) for row in range(size)]


def _bend(gap: Gap, size: int, small: "mpf") -> list[list["mpf"]]:
    """∂²g by differences of the lower triangle, [row][column ≤ row]."""
    still, single = gap({}), [gap({row: small}) for row in range(size)]
    bent = []
    for row in range(size):
        entries = [
            gap({row: small, column: small}) - single[row] - single[column] + still
            for column in range(row)
        ]
        twice = single[row] - 2 * still + gap({row: -small})
        bent.append([entry / small**2 for entry in (*entries, twice)])
    return bent


def _lagrangian(
    expansion: Expansion, push: list["mpf"], bent: list[list[list["mpf"]]]
) -> list[list["mpf"]]:
    """∇²E − Σ μ ∇²g as a full matrix."""
    size = len(expansion.gradient)
    full = [[0 * expansion.energy] * size for _ in range(size)]
    for row, entries in enumerate(expansion.band):
        for depth, entry in enumerate(entries):
            full[row][row - depth] = entry
    for row in range(size):
        for column in range(row + 1):
            full[row][column] -= sum(
                mu * own[row][column] for mu, own in zip(push, bent, strict=True)
            )
            full[column][row] = full[row][column]
    return full


def _conditions(
    hessian: list[list["mpf"]],
    gradient: list["mpf"],
    slopes: list[list["mpf"]],
    gaps: list[Gap],
) -> tuple[list[list["mpf"]], list["mpf"]]:
    """∇²L s − Σ μ ∇g = −∇E and ∇g · s = −g, for s and μ."""
    none = [0] * len(slopes)
    rows = [[*own, *(-slope[row] for slope in slopes)] for row, own in enumerate(hessian)]
    rows += [[*slope, *none] for slope in slopes]
    return rows, [*(-pull for pull in gradient), *(-gap({}) for gap in gaps)]
