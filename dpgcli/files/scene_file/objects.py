"""The keys of a spec's object, their types and their meaning."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from dpgcli.design.bodies import FRICTION, MASS, PLACES, Body, Disc, Friction, Jaws, Polygon
from dpgcli.design.problems import Issue, number
from dpgcli.files.sections import Bounded, NotNegative, Positive, Section
from dpgcli.mechanics.aperture import FEWEST_POINTS, ForceCurve
from dpgcli.text import KeyPath

PLACE, POLYGON = "at_mm", "polygon"
TABLE: KeyPath = ("compliance", "table")
GAP, FORCE = "jaw_gap_mm", "force_N"  # columns of such a table
MOST_POINTS = 10_000
KINDS = ("disc", "jaws", POLYGON)
MOST_CORNERS = 64
EXPECTED = {
    PLACE: "two numbers in mm, such as [40, 0]",
    **dict.fromkeys(PLACES, "a number in mm"),
    "held": '"fixed", "guided" (moves along x) or "free"',
    "stiffness_N_per_mm": "a stiffness > 0 in N/mm",
    GAP: f"{FEWEST_POINTS} to {MOST_POINTS:,} apertures in mm",
    FORCE: f"{FEWEST_POINTS} to {MOST_POINTS:,} forces in N",
    FRICTION: "a coefficient >= 0, such as 0.5",
    MASS: "a mass > 0 in g",
    POLYGON: f"three to {MOST_CORNERS} corners in mm, such as [[0, -10], [20, 0], [0, 10]]",
}
OF_TABLE = "the name of a CSV file with the columns jaw_gap_mm and force_N"
LISTS = (PLACE, POLYGON, GAP, FORCE)
NO_FRICTION = Issue(
    (MASS,), "friction beside it, which bears the weight", "none", "give one such as friction: 0.5"
)

Corner = list[float]
Side = tuple[Corner, Corner]
TwoNumbers = Annotated[list[Bounded], Field(min_length=2, max_length=2)]
Numbers = Annotated[list[Bounded], Field(min_length=FEWEST_POINTS, max_length=MOST_POINTS)]


def expected_at(path: KeyPath) -> str:
    """What is expected of tables, and of the parts of lists, of an object, in words; else empty.

    >>> expected_at(("polygon", 2)), expected_at(("polygon", 2, 0)), expected_at(("held",))
    ('a corner, two numbers in mm such as [20, 0]', 'a number in mm', '')
    """
    if path == TABLE:
        return OF_TABLE
    if path[:1] == (POLYGON,) and len(path) > 1:
        is_corner = len(path) == len((POLYGON, 0))
        return "a corner, two numbers in mm such as [20, 0]" if is_corner else "a number in mm"
    parts = {(*TABLE, GAP): "an aperture in mm", (*TABLE, FORCE): "a force in N"}
    return parts.get(path[:-1], "")


class DiscSpec(Section):
    """A round body."""

    diameter_mm: Positive = Field(description="Its diameter, in mm.")


class JawsSpec(Section):
    """Two flat plates along x, which fingers meet from outside."""

    gap_mm: Positive = Field(description="Distance of the plates from each other, in mm.")
    height_mm: Positive = Field(
        description="Length of the plates along x, in mm: half of it on either side of at_mm."
    )


class ForceTableSpec(Section):
    """Forces that keep jaws apart, by aperture."""

    jaw_gap_mm: Numbers = Field(description="Apertures of the jaws, rising, in mm.")
    force_N: Numbers = Field(description="The force that keeps them apart at each, in N.")

    @property
    def known(self) -> ForceCurve:
        """The value that it stands for."""
        return ForceCurve(np.array(self.jaw_gap_mm), np.array(self.force_N))

    def issues(self, gap: float) -> Iterator[Issue]:
        """What is wrong between its keys, or for jaws with a gap; paths begin with its own."""
        gaps = self.jaw_gap_mm
        if len(self.force_N) != len(gaps):
            yield Issue((FORCE,), f"{len(gaps):,} forces, as apertures", f"{len(self.force_N):,}")
        if gaps[0] < 0.0:
            yield Issue((GAP, 0), "an aperture >= 0 in mm", number(gaps[0]))
        falls = [place for place in range(1, len(gaps)) if gaps[place] <= gaps[place - 1]]
        for place in falls[:1]:
            expected = f"an aperture above {number(gaps[place - 1])} mm"
            yield Issue((GAP, place), expected, number(gaps[place]))
        if not falls and not gaps[0] <= gap <= gaps[-1]:
            expected = f"the gap of the jaws, {number(gap)} mm, within the table"
            yield Issue((), expected, f"{number(gaps[0])} to {number(gaps[-1])} mm")


def _table(said: object) -> object:
    """A file's name is another's to read: `forces` has put its columns there by then."""
    return None if isinstance(said, str) else said


class ComplianceSpec(Section):
    """What keeps jaws apart: a linear force against closing, none at their gap, or a table."""

    stiffness_N_per_mm: Positive | None = Field(
        default=None,
        description="Force against closing per mm that the jaws are closer than their gap, N/mm.",
    )
    table: Annotated[
        ForceTableSpec | None,
        BeforeValidator(_table, json_schema_input_type=ForceTableSpec | str | None),
    ] = Field(
        default=None,
        description="Or the force that keeps them apart by their aperture: the name of a CSV file "
        "with the columns jaw_gap_mm and force_N.",
    )

    def issues(self, gap: float) -> list[Issue]:
        """What is wrong between its keys; paths begin with its own."""
        said = self.given()
        if len(said) != 1:
            found = " and ".join(said) or "none of them"
            return [Issue((), "one of stiffness_N_per_mm and table", found)]
        own = () if self.table is None else self.table.issues(gap)
        return [issue._replace(path=("table", *issue.path)) for issue in own]


class ObjectSpec(Section):
    """A body between the fingers, for dpg grasp: a disc, jaws or a polygon."""

    disc: DiscSpec | None = Field(default=None, description="A round body, such as a can.")
    jaws: JawsSpec | None = Field(
        default=None, description="Two flat plates along x, as those of a mechanism."
    )
    polygon: Annotated[list[TwoNumbers], Field(min_length=3, max_length=MOST_CORNERS)] | None = (
        Field(
            default=None,
            description="A body with straight sides: its corners one after the other, x and y in "
            "mm from at_mm.",
        )
    )
    at_mm: TwoNumbers | None = Field(
        default=None,
        description="Where its center is in the gripper's frame, in mm: between the bases, x along "
        "the fingers; of a finger alone in its own frame.",
    )
    at_x_mm: Bounded | None = Field(
        default=None, description="Its part along x, in mm, instead of that in at_mm."
    )
    at_y_mm: Bounded | None = Field(
        default=None, description="Its part along y, in mm, instead of that in at_mm."
    )
    held: Literal["fixed", "guided", "free"] = Field(
        default="fixed",
        description="How it is held: fixed, guided (it moves along x only), or free.",
    )

    compliance: ComplianceSpec | None = Field(
        default=None, description="Jaws only: what keeps them apart; without it they are rigid."
    )
    friction: NotNegative | None = Field(
        default=None,
        description="Coefficient of friction between fingers and body, for its payload alone: "
        "contact forces are without.",
    )
    mass_g: Positive | None = Field(
        default=None, description="Its mass in g, the weight of which is held against the payload."
    )

    @property
    def known_friction(self) -> Friction | None:
        """The friction and the mass that it stands for, if there are any."""
        return None if self.friction is None else Friction(self.friction, self.mass_g)

    @property
    def _place(self) -> list[float | None]:
        """Its place, x and y: None where it is not said."""
        both: list[float] | list[None] = self.at_mm or [None, None]
        own = (self.at_x_mm, self.at_y_mm)
        return [said if part is None else part for said, part in zip(both, own, strict=True)]

    @property
    def known(self) -> Body:
        """The value that it stands for."""
        center = np.array(self._place, float)
        if self.jaws is not None:
            jaws = Jaws(center, self.jaws.gap_mm, self.jaws.height_mm)
            own = self.compliance
            if own is None:
                return jaws
            curve = None if own.table is None else own.table.known
            return replace(jaws, stiffness=own.stiffness_N_per_mm, curve=curve)
        if self.polygon is not None:
            return Polygon(center, np.array(self.polygon, float).T)
        assert self.disc is not None, "one of the three"
        return Disc(center, 0.5 * self.disc.diameter_mm)

    @property
    def issues(self) -> list[Issue]:
        """What is wrong between its keys; paths begin with the object's own keys."""
        said = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(said) != 1:
            found = " and ".join(said) or "none of them"
            return [Issue((), "one of disc, jaws and polygon", found)]
        if self.compliance is not None and self.jaws is None:
            return [Issue(("compliance",), "jaws, which only give way", said[0])]
        if self.compliance is not None and self.jaws is not None:
            wrong = self.compliance.issues(self.jaws.gap_mm)
            if wrong:
                return [issue._replace(path=("compliance", *issue.path)) for issue in wrong]
        if self.mass_g is not None and self.friction is None:
            return [NO_FRICTION]
        if None in self._place:
            return [Issue((PLACE,), EXPECTED[PLACE], "nothing")]
        return list(_wrong_sides(self.polygon or []))


def told_of(body: Body, held: str, friction: Friction | None = None) -> dict[str, Any]:
    """A body as a spec's object says it, in plain values.

    >>> told_of(Disc(np.array([40.0, 0.0]), 20.0), "free")
    {'disc': {'diameter_mm': 40.0}, 'at_mm': [40.0, 0.0], 'held': 'free'}
    """
    if isinstance(body, Disc):
        kind: dict[str, Any] = {"disc": {"diameter_mm": 2.0 * body.radius}}
    elif isinstance(body, Jaws):
        kind = {"jaws": {"gap_mm": body.gap, "height_mm": body.height}}
        if body.stiffness is not None:
            kind["compliance"] = {"stiffness_N_per_mm": body.stiffness}
        if body.curve is not None:
            table = {GAP: body.curve.gap.tolist(), FORCE: body.curve.force.tolist()}
            kind["compliance"] = {"table": table}
    else:
        kind = {POLYGON: body.around.T.tolist()}
    rubs = {} if friction is None else {FRICTION: friction.coefficient, MASS: friction.mass}
    told = {**kind, PLACE: body.center.tolist(), "held": held, **rubs}
    return {key: value for key, value in told.items() if value is not None}


def _wrong_sides(corners: list[Corner]) -> Iterator[Issue]:
    """Sides of a polygon without a length, or if there are none those that cross each other."""
    sides = list(zip(corners, [*corners[1:], *corners[:1]], strict=True))
    path: KeyPath = (POLYGON,)
    is_any = False
    for place, (start, end) in enumerate(sides):
        if start == end:
            is_any = True
            found = f"{_side(place, sides)} of 0 mm"
            yield Issue((*path, place), "sides with a length", found, "leave out one of its ends")
    for (one, a), (other, b) in combinations(enumerate(sides), 2):
        are_next = other - one in (1, len(sides) - 1)
        if not is_any and (_folds_back(a, b) if are_next else _meet(a, b)):
            found = f"{_side(one, sides)} crosses {_side(other, sides)}"
            yield Issue(path, "a polygon that does not cross itself", found, "list corners in turn")


def _side(place: int, sides: list[Side]) -> str:
    return f"side {place + 1}-{(place + 1) % len(sides) + 1}"


def _meet(one: Side, other: Side) -> bool:
    """Whether two segments have a point in common."""
    turns = (
        [_turn(one, point) for point in other],
        [_turn(other, point) for point in one],
    )
    if all(first * second < 0.0 for first, second in turns):
        return True
    ends = [(one, point) for point in other] + [(other, point) for point in one]
    return any(_turn(side, point) == 0.0 and _is_beside(side, point) for side, point in ends)


def _folds_back(one: Side, other: Side) -> bool:
    """Whether a side lies on its neighbor."""
    shared = next(point for point in one if point in other)
    (a,), (b,) = ([p for p in side if p != shared][:1] for side in (one, other))
    lies_on = _is_beside((shared, b), a) or _is_beside((shared, a), b)
    return _turn((a, shared), b) == 0.0 and lies_on


def _turn(side: Side, point: Corner) -> float:
    """Twice the area of a triangle, positive where the point is to the left of a side."""
    (x0, y0), (x1, y1) = side
    return (x1 - x0) * (point[1] - y0) - (y1 - y0) * (point[0] - x0)


def _is_beside(side: Side, point: Corner) -> bool:
    """Whether a point on the line of a segment is on it."""
    (x0, y0), (x1, y1) = side
    is_within = min(x0, x1) <= point[0] <= max(x0, x1)
    return is_within and min(y0, y1) <= point[1] <= max(y0, y1)
