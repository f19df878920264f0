"""The energy of a finger in mpmath numbers, written from the model's definition.

Of the package it shares nothing but the finger's parameters. The unknowns are the free nodes
(B_1x, B_1y, T_1x, T_1y, B_2x, …) in mm, for rigid bars the corner angles (a_1, b_1, a_2, …) in
rad. Unit i has the chord c = B_i − B_{i-1}, the top t = T_i − T_{i-1}, and the struts
p = T_{i-1} − B_{i-1} (near) and q = T_i − B_i (far). Its corners open by a = ∠p − ∠c − π/2 and
b = ∠c + π/2 − ∠q, its hinge turns by θ = a + b = ∠p − ∠q. Neighboring hinges may have −κ θ θ'.
"""

from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from dpgcli.arrays import Array
from dpgcli.records import dataclass
from dpgcli.reference.expansion import ExactResponse, Expansion, Rate, linear
from dpgcli.reference.units import Unit
from dpgcli.reference.vectors import (
    ExactCell,
    Vector,
    cells,
    corners,
    cross,
    direction_rates,
    dot,
    left,
    measured,
    times,
)

if TYPE_CHECKING:
    from mpmath import mpf

ENDS = ExactCell((-4, 0), (-2, 2), (-4, -2), (0, 2))  # x rows of what they join, from B_i's


def corner_under(unit: Unit, angle: "mpf", moment: "mpf") -> ExactResponse:
    """E = k_θ θ² − M θ of a corner under a moment M."""
    spring = linear(2 * unit.hinge, angle)
    return spring._replace(energy=spring.energy - moment * angle, force=spring.force - moment)


def bistable(unit: Unit, x: "mpf") -> ExactResponse:
    """E = ½ k_b x² [1 + β(u² − 2u)] − P x with u = x/d, β = 1−α and a constant push P."""
    u, softening, stiffness = x / unit.stroke, 1 - unit.linearity, unit.bistable
    return ExactResponse(
        stiffness * x * x * (1 + softening * (u * u - 2 * u)) / 2 - unit.push * x,
        stiffness * x * (1 + softening * (2 * u * u - 3 * u)) - unit.push,
        stiffness * (1 + 6 * softening * (u * u - u)),
    )


def _spread(unit: int, *parts: tuple[Vector, Vector]) -> Rate:
    """Spread slopes by vectors between nodes, (ends, slope) each, over these nodes."""
    rate: Rate = {}
    for (start, stop), slope in parts:
        for axis in (0, 1):
            for row, part in ((start, -slope[axis]), (stop, slope[axis])):
                place = 4 * unit + row + axis
                if place >= 0:  # the base is clamped
                    rate[place] = rate.get(place, 0) + part
    return rate


@dataclass(frozen=True)
class ElasticBars:
    """The energy of a finger whose bars are springs; its unknowns are the nodes."""

    units: list[Unit]
    coupling: "mpf" = 0

    @property
    def base(self) -> list["mpf"]:
        return [0, 0, 0, self.units[0].height]

    @property
    def scale(self) -> "mpf":
        """The length that a step of an unknown is compared with, mm."""
        return sum(unit.length for unit in self.units) + self.units[0].height

    def unknowns(self, nodes: list["mpf"]) -> list["mpf"]:
        return nodes

    def nodes(self, unknowns: list["mpf"]) -> list["mpf"]:
        return unknowns

    def walls(self, unknowns: list["mpf"]) -> list["mpf"]:
        """None gives way."""
        return [0] * len(self.units)

    def at(self, unknowns: list["mpf"], walls: Sequence["mpf"] = ()) -> Expansion:
        """The energy at nodes, expanded along the curved update `moved`; domes behind `walls`."""
        size = len(unknowns) + len(walls)
        bandwidth = (13 if walls else 11) if self.coupling else (8 if walls else 7)
        expansion = Expansion(size, bandwidth, 4 if walls else 0)
        shape = list(cells(self.base, unknowns))
        for i, (unit, cell) in enumerate(zip(self.units, shape, strict=True)):
            _add_springs(expansion, i, unit, cell, walls[i] if walls else 0)
            _add_corners(expansion, i, unit, cell)
            for k, pull in enumerate(unit.pulls):
                expansion.energy -= pull * unknowns[4 * i + k]
                expansion.gradient[expansion.row(4 * i + k)] -= pull
        if self.coupling:
            _add_couplings(expansion, self.coupling, shape)
        _add_swings(expansion, shape)
        return expansion

    def strokes_opened(self, unknowns: list["mpf"], step: list["mpf"]) -> "mpf":
        """The largest opening of a unit by a step, in strokes."""
        strokes = []
        changes = cells([0] * 4, step)
        for unit, cell, change in zip(self.units, cells(self.base, unknowns), changes, strict=True):
            turns = [dot(direction_rates(v)[0], w) for v, w in zip(cell, change, strict=True)]
            opening = max(abs(turns[2] - turns[0]), abs(turns[3] - turns[0]))
            stretch = dot(direction_rates(cell.top)[1], change.top)
            strokes.append(opening * max(unit.height / unit.stroke, 1))
            strokes.append(abs(stretch) * unit.length / unit.stroke)
        return max(strokes)

    def moved(self, unknowns: list["mpf"], step: list["mpf"]) -> list["mpf"]:
        """Turn and stretch each bar at the step's rates; straight motion would stretch bars."""
        x, y = self.base[:2]
        nodes = []
        for cell, change in zip(cells(self.base, unknowns), cells([0] * 4, step), strict=True):
            chord, strut = _swung(cell.chord, change.chord), _swung(cell.far, change.far)
            x, y = x + chord[0], y + chord[1]
            nodes += [x, y, x + strut[0], y + strut[1]]
        return nodes

    def node_rates(self, unknowns: list["mpf"]) -> Array:
        """Derivatives of the node coordinates by the unknowns, (4 n, size)."""
        return np.eye(len(unknowns))


def _add_springs(expansion: Expansion, i: int, unit: Unit, cell: ExactCell, wall: "mpf") -> None:
    """Bars and dome, each with the Hessian K n nᵀ + (F/ℓ) m mᵀ by its vector ℓ n."""
    behind: Rate = {-1 - i: 1} if unit.wall else {}  # the dome extends as its wall gives way
    still: Rate = {}
    laws = (
        (ENDS.chord, cell.chord, unit.length, partial(linear, unit.bar), still),
        (ENDS.far, cell.far, unit.height, partial(linear, unit.bar), still),
        (ENDS.top, cell.top, unit.length - wall, partial(bistable, unit), behind),
    )
    for ends, vector, rest, law, more in laws:
        length, direction = measured(vector)
        spring = law(length - rest)
        across = _spread(i, (ends, left(direction)))
        expansion.add(spring, {**_spread(i, (ends, direction)), **more})
        expansion.add_square(spring.force / length, across)


def _add_corners(expansion: Expansion, i: int, unit: Unit, cell: ExactCell) -> None:
    """E = k_θ θ² − M θ, θ = ∠s − ∠c − π/2, s either strut; ∠v bends by −(g hᵀ + h gᵀ).

    M turns its sign with θ, at the far strut; g and h are the `_rates`.
    """
    a, b = corners(cell)
    turn, stretch = direction_rates(cell.chord)
    chord, along_chord = (_spread(i, (ENDS.chord, rate)) for rate in (turn, stretch))
    sides = ((a, ENDS.near, cell.near, unit.moment), (-b, ENDS.far, cell.far, -unit.moment))
    for angle, ends, vector, moment in sides:
        corner = corner_under(unit, angle, moment)
        rates = direction_rates(vector)
        expansion.add(corner, _spread(i, (ends, rates[0]), (ENDS.chord, times(-1, turn))))
        expansion.add_bend(-corner.force, *(_spread(i, (ends, rate)) for rate in rates))
        expansion.add_bend(corner.force, chord, along_chord)


def _add_couplings(expansion: Expansion, coupling: "mpf", shape: list[ExactCell]) -> None:
    """−κ θ θ' of neighbors, θ = ∠p − ∠q; a direction bends by −(g hᵀ + h gᵀ), its `_rates`."""
    turns = [sum(corners(cell)) for cell in shape]
    struts = [
        [
            [_spread(i, (ends, rate)) for rate in direction_rates(vector)]
            for ends, vector in ((ENDS.near, cell.near), (ENDS.far, cell.far))
        ]
        for i, cell in enumerate(shape)
    ]
    rates = [_combined(near[0], far[0], -1) for near, far in struts]
    for first, second in pairwise(range(len(shape))):
        _add_pair(expansion, coupling, (turns[first], turns[second]), (rates[first], rates[second]))
        for own, other in ((first, second), (second, first)):
            moment = -coupling * turns[other]
            near, far = struts[own]
            expansion.add_bend(-moment, *near)
            expansion.add_bend(moment, *far)


def _add_pair(
    expansion: Expansion, coupling: "mpf", turns: tuple["mpf", "mpf"], rates: tuple[Rate, Rate]
) -> None:
    """−κ θ θ' = κ/4 [(θ − θ')² − (θ + θ')²] as two springs, one of which pushes."""
    for sign in (-1, 1):
        spring = linear(-sign * coupling / 2, turns[0] + sign * turns[1])
        expansion.add(spring, _combined(*rates, sign))


def _combined(one: Rate, other: Rate, sign: int) -> Rate:
    """The sum of two rates, or their difference."""
    return {row: one.get(row, 0) + sign * other.get(row, 0) for row in {**one, **other}}


def _add_swings(expansion: Expansion, shape: list[ExactCell]) -> None:
    """Add the second-order term of the curved update `moved`: gradient · ∂²nodes/∂step².

    It is zero at an equilibrium. A bar v that turns by ω and stretches by σ moves all beyond it by
    σω m − ½ω² v, m = v turned to the left. Without this, forces out of balance hide how softly a
    long finger bends.
    """
    pull: Vector = (0, 0)
    for i in reversed(range(len(shape))):
        x, y, *top = (expansion.gradient[expansion.row(4 * i + k)] for k in range(4))
        tip = (top[0], top[1])
        pull = (pull[0] + x + tip[0], pull[1] + y + tip[1])
        bars = ((ENDS.chord, shape[i].chord, pull), (ENDS.far, shape[i].far, tip))
        for ends, vector, beyond in bars:
            turn, stretch = (_spread(i, (ends, rate)) for rate in direction_rates(vector))
            expansion.add_bend(cross(vector, beyond), turn, stretch)
            expansion.add_square(-dot(vector, beyond), turn)


def _swung(vector: Vector, change: Vector) -> Vector:
    """The vector turned and stretched at the rates of a change of it."""
    from mpmath import cos, sin

    turn, stretch = (dot(rate, change) for rate in direction_rates(vector))
    along, across = (1 + stretch) * cos(turn), (1 + stretch) * sin(turn)
    return along * vector[0] - across * vector[1], across * vector[0] + along * vector[1]


@dataclass(frozen=True)
class RigidBars:
    """The energy of a finger whose bars keep their lengths; its unknowns are the corner angles."""

    units: list[Unit]
    coupling: "mpf" = 0
    scale = 1

    def unknowns(self, nodes: list["mpf"]) -> list["mpf"]:
        base = ElasticBars(self.units).base
        return [angle for cell in cells(base, nodes) for angle in corners(cell)]

    def nodes(self, unknowns: list["mpf"]) -> list["mpf"]:
        from mpmath import cos, sin

        x, y, turned = 0, 0, 0
        nodes = []
        for unit, a, b in zip(self.units, unknowns[0::2], unknowns[1::2], strict=True):
            direction = turned - a
            turned = direction - b
            x, y = x + unit.length * cos(direction), y + unit.length * sin(direction)
            nodes += [x, y, x - unit.height * sin(turned), y + unit.height * cos(turned)]
        return nodes

    def walls(self, unknowns: list["mpf"]) -> list["mpf"]:
        """None gives way."""
        return [0] * len(self.units)

    def at(self, unknowns: list["mpf"], walls: Sequence["mpf"] = ()) -> Expansion:
        """With t = (L + H(sin a + sin b), H(cos b − cos a)), in the frame of the chord."""
        from mpmath import cos, sin

        size = len(unknowns) + len(walls)
        bandwidth = (4 if walls else 3) if self.coupling else (2 if walls else 1)
        if is_pulled := any(any(unit.pulls) for unit in self.units):
            bandwidth = size
        expansion = Expansion(size, bandwidth, 2 if walls else 0)
        for i, unit in enumerate(self.units):
            a, b = unknowns[2 * i : 2 * i + 2]
            rise_near, rise_far = unit.height * sin(a), unit.height * sin(b)
            lean_near, lean_far = unit.height * cos(a), unit.height * cos(b)
            top = (unit.length + rise_near + rise_far, lean_far - lean_near)
            length, n = measured(top)
            spring = bistable(unit, length - unit.length + (walls[i] if walls else 0))
            behind: Rate = {-1 - i: 1} if unit.wall else {}
            slopes = {2 * i: (lean_near, rise_near), 2 * i + 1: (lean_far, -rise_far)}
            across = {row: dot(left(n), slope) for row, slope in slopes.items()}
            rate = {row: dot(n, slope) for row, slope in slopes.items()}
            expansion.add(spring, {**rate, **behind})
            expansion.add_square(spring.force / length, across)
            bends = {2 * i: (-rise_near, lean_near), 2 * i + 1: (-rise_far, -lean_far)}
            for (row, bend), angle in zip(bends.items(), (a, b), strict=True):
                expansion.add(corner_under(unit, angle, unit.moment), {row: 1})
                expansion.add_square(spring.force * dot(n, bend), {row: 1})
        turns = [sum(unknowns[2 * i : 2 * i + 2]) for i in range(len(self.units))]
        for i, pair in enumerate(pairwise(turns) if self.coupling else ()):
            rates = {2 * i: 1, 2 * i + 1: 1}, {2 * i + 2: 1, 2 * i + 3: 1}
            _add_pair(expansion, self.coupling, pair, rates)
        if is_pulled:
            _add_pulls(expansion, self.units, self.nodes(unknowns))
        return expansion

    def strokes_opened(self, unknowns: list["mpf"], step: list["mpf"]) -> "mpf":
        per_turn = [max(unit.height / unit.stroke, 1) for unit in self.units for _ in "ab"]
        return max(abs(turn) * each for turn, each in zip(step, per_turn, strict=True))

    def moved(self, unknowns: list["mpf"], step: list["mpf"]) -> list["mpf"]:
        return [angle + turn for angle, turn in zip(unknowns, step, strict=True)]

    def node_rates(self, unknowns: list["mpf"]) -> Array:
        """An opening corner turns all that lies beyond it by −1 about its own station."""
        n = len(self.units)
        nodes = np.array(self.nodes(unknowns), float).reshape(n, 2, 1, 2)
        stations = np.vstack((np.zeros((1, 2)), nodes[:, 0, 0]))
        away = nodes - np.repeat(stations, 2, axis=0)[1:-1]
        is_beyond = np.arange(n)[:, None] >= np.arange(2 * n) // 2
        rates = np.stack((away[..., 1], -away[..., 0]), axis=2) * is_beyond[:, None, None]
        return np.asarray(rates.reshape(4 * n, 2 * n))


def _add_pulls(expansion: Expansion, units: list[Unit], nodes: list["mpf"]) -> None:
    """−Σ f · p by corners: each turns all that lies beyond by −1 about its station B.

    So ∂/∂θ = −Σ f × (p − B), and once more by a corner before it Σ f · (p − B).
    """
    stations: list[Vector] = [(0, 0), *zip(nodes[0::4], nodes[1::4], strict=True)]
    for i in range(len(units)):
        pulled = [
            ((unit.pulls[k], unit.pulls[k + 1]), (nodes[4 * j + k], nodes[4 * j + k + 1]))
            for j, unit in enumerate(units)
            for k in (0, 2)
            if j >= i
        ]
        expansion.energy -= sum(dot(pull, node) for pull, node in pulled[:2])
        for row, (x, y) in ((2 * i, stations[i]), (2 * i + 1, stations[i + 1])):
            away = [(pull, (node[0] - x, node[1] - y)) for pull, node in pulled]
            place = expansion.row(row)
            expansion.gradient[place] -= sum(cross(pull, arm) for pull, arm in away)
            for column in range(row + 1):
                depth = place - expansion.row(column)
                expansion.band[place][depth] += sum(dot(pull, arm) for pull, arm in away)


@dataclass(frozen=True)
class YieldingWalls:
    """The energy of a finger whose walls give way; before each unit's unknowns stands its w, mm.

    `rest` is where the search begins. A rigid wall among them stays where it is.
    """

    frame: ElasticBars | RigidBars
    rest: list["mpf"]

    @property
    def units(self) -> list[Unit]:
        return self.frame.units

    @property
    def scale(self) -> "mpf":
        return self.frame.scale

    def _apart(self, unknowns: list["mpf"]) -> tuple[list["mpf"], list["mpf"]]:
        """The frame's unknowns, and the walls'."""
        step = len(unknowns) // len(self.units)
        others = [value for k, value in enumerate(unknowns) if k % step]
        return others, unknowns[::step]

    def _joined(self, others: list["mpf"], walls: list["mpf"]) -> list["mpf"]:
        width = len(others) // len(walls)
        parts = ([wall, *others[k * width : (k + 1) * width]] for k, wall in enumerate(walls))
        return [value for part in parts for value in part]

    def unknowns(self, nodes: list["mpf"]) -> list["mpf"]:
        return self._joined(self.frame.unknowns(nodes), self.rest)

    def nodes(self, unknowns: list["mpf"]) -> list["mpf"]:
        return self.frame.nodes(self._apart(unknowns)[0])

    def walls(self, unknowns: list["mpf"]) -> list["mpf"]:
        """How far each gives way, mm."""
        return self._apart(unknowns)[1]

    def at(self, unknowns: list["mpf"]) -> Expansion:
        """The frame's energy and E = w²/(2 c_w)."""
        others, walls = self._apart(unknowns)
        expansion = self.frame.at(others, walls)
        for i, (unit, wall) in enumerate(zip(self.units, walls, strict=True)):
            expansion.add(linear(1 / unit.wall if unit.wall else 1, wall), {-1 - i: 1})
        return expansion

    def strokes_opened(self, unknowns: list["mpf"], step: list["mpf"]) -> "mpf":
        others, walls = self._apart(step)
        yielded = [abs(w) / unit.stroke for w, unit in zip(walls, self.units, strict=True)]
        return max(self.frame.strokes_opened(self._apart(unknowns)[0], others), *yielded)

    def moved(self, unknowns: list["mpf"], step: list["mpf"]) -> list["mpf"]:
        (others, walls), (change, more) = self._apart(unknowns), self._apart(step)
        yielded = [wall + part for wall, part in zip(walls, more, strict=True)]
        return self._joined(self.frame.moved(others, change), yielded)

    def node_rates(self, unknowns: list["mpf"]) -> Array:
        """Those of the frame; no wall moves a node by itself."""
        others = self._apart(unknowns)[0]
        rates = self.frame.node_rates(others)
        width = len(others) // len(self.units)
        by_unit = rates.reshape(len(rates), -1, width)
        walls = np.zeros((*by_unit.shape[:2], 1))
        return np.concatenate((walls, by_unit), axis=2).reshape(len(rates), -1)
