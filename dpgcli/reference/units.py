"""Single units in mpmath numbers: their parameters, and the wells they have with rigid bars."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dpgcli.mechanics.finger import Finger

if TYPE_CHECKING:
    from mpmath import mpf

TANGENT = 1e30  # of a turn of 90 degrees: where nothing else ends it
BISECTIONS = 60


class Unit(NamedTuple):
    """One unit's L, H and d (mm), k_b (N/mm), α, k_θ (N mm/rad), k_L (N/mm) and c_w (mm/N).

    `push` (N) is that of a pressure on its dome, the same wherever the dome is. Dead loads:
    `moment` (N mm) opens its gap, `pulls` (N) act on B_i and T_i, each along x and y.
    """

    length: "mpf"
    height: "mpf"
    stroke: "mpf"
    bistable: "mpf"
    linearity: "mpf"
    hinge: "mpf"
    bar: "mpf"
    wall: "mpf" = 0
    push: "mpf" = 0
    moment: "mpf" = 0
    pulls: tuple["mpf", ...] = (0, 0, 0, 0)


def extended_units(finger: Finger) -> list[Unit]:
    """The units of a finger of one design, their doubles taken as exact."""
    from mpmath import mpf

    parameters = finger.arrays()
    own = Unit._fields.index("wall")
    arrays = [*list(parameters.values())[:own], parameters["wall_compliance"]]
    columns = (np.broadcast_to(v, (finger.n_units, 1))[:, 0] for v in arrays)
    units = [Unit(*map(mpf, values)) for values in zip(*(c.tolist() for c in columns), strict=True)]
    return _under_loads(finger, units)


def _under_loads(finger: Finger, units: list[Unit]) -> list[Unit]:
    """The units under the finger's dead loads; those without any stay as they are."""
    from mpmath import mpf

    if not finger.is_loaded:
        return units
    loads = {name: values[:, 0].tolist() for name, values in finger.conditions().items()}
    weights = np.broadcast_to(finger.unit_weight, (finger.n_units, 1))[:, 0].tolist()
    (x,), (y,) = loads["gravity_x"], loads["gravity_y"]
    loaded = []
    for place, (unit, weight) in enumerate(zip(units, weights, strict=True), start=1):
        tip = (loads["tip_force_x"][0], loads["tip_force_y"][0])
        on_base = map(mpf, tip if place == len(units) else (0, 0))
        on_top = (mpf(weight) * mpf(x), mpf(weight) * mpf(y))
        moment = mpf(loads["end_moment"][0])
        loaded.append(unit._replace(moment=moment, pulls=(*on_base, *on_top)))
    return loaded


def inverted_angle(unit: Unit) -> "mpf":
    """The corner angle m (rad) of a unit with rigid bars at rest in its second well.

    Both corners are open by m; without a second well, by the angle of the full stroke. With
    x = 2H sin m the unit's moment is 2 H² k_b times sin 2m P(u) + 2κm, where u = x/d, β = 1−α,
    P = 1 + β(2u² − 3u) and κ = k_θ/(k_b H²). P is at least α outside 1/2 < u < 1, so both roots
    are between, and they are told apart where P + 2κm/sin 2m is smallest (our derivation).
    """
    from mpmath import asin, cos, sin

    widest = 2 * unit.height / unit.stroke
    softening = 1 - unit.linearity
    hinge = unit.hinge / (unit.bistable * unit.height**2)

    def moment(m: "mpf") -> "mpf":
        u = widest * sin(m)
        return sin(2 * m) * (1 + softening * (2 * u**2 - 3 * u)) + 2 * hinge * m

    def trend(m: "mpf") -> "mpf":
        u, turn = widest * sin(m), 2 * m
        bend = 2 * hinge * (sin(turn) - turn * cos(turn))
        return softening * (4 * u - 3) * widest * cos(m) * sin(turn) ** 2 + bend

    def opened(strokes: float) -> "mpf":
        return asin(min(strokes / widest, 1))

    least = _bisected(trend, opened(0.25), opened(0.75))
    if not moment(least) < 0:
        return opened(1.0)
    return _bisected(moment, least, opened(1.25))


def inverted_rest(unit: Unit) -> tuple["mpf", "mpf"]:
    """The corner angle m (rad) and how far the wall gives way (mm), where an inverted unit rests.

    Between rigid bars. With y the dome's extension, x = y − w = 2H sin m and h' the hinge's pull on
    the opening, w = c_w h'(x) and F(y) + h'(x) = 0. The left side of the second has one least value
    beyond half a stroke, and the well beyond that (our derivation).
    """
    from mpmath import atan, eps, pi, sqrt

    if not unit.wall:
        return inverted_angle(unit), unit.wall
    lever, hinge = 2 * unit.height, unit.hinge / unit.height**2
    yields = unit.wall * lever * hinge

    def opened(t: "mpf") -> tuple["mpf", "mpf"]:
        """The dome's extension and its slope by t = tan m."""
        secant = sqrt(1 + t * t)
        slope = lever / secant**3 + yields * (1 + atan(t) * t) / secant
        return lever * t / secant + yields * atan(t) * secant, slope

    def tangent(y: "mpf") -> "mpf":
        """Of the corner's turn: Newton's method where it stays between two bounds."""
        low, high = 0 * y, max(1 + 0 * y, 4 * y / (pi * yields)) if yields else TANGENT + 0 * y
        t = high / 2
        for _ in range(BISECTIONS):
            reached, slope = opened(t)
            low, high = (low, t) if reached > y else (t, high)
            further = t - (reached - y) / slope
            if abs(further - t) <= 8 * eps * t:
                break
            t = further if low < further < high else (low + high) / 2
        return t

    def force(y: "mpf") -> "mpf":
        u, softening, t = y / unit.stroke, 1 - unit.linearity, tangent(y)
        own = unit.bistable * y * (1 + softening * (2 * u * u - 3 * u))
        return own + lever * hinge * atan(t) * sqrt(1 + t * t)

    def stiffness(y: "mpf") -> "mpf":
        u, t = y / unit.stroke, tangent(y)
        bent = hinge * (1 + t * t) * (1 + atan(t) * t)
        own = unit.bistable * (1 + 6 * (1 - unit.linearity) * (u * u - u))
        return own + bent / (1 + unit.wall * bent)

    least = _bisected(stiffness, unit.stroke / 2, unit.stroke)
    y = unit.stroke if not force(least) < 0 else _bisected(force, least, unit.stroke * 5 / 4)
    t = tangent(y)
    return atan(t), y - lever * t / sqrt(1 + t * t)


def spring_barrier(unit: Unit) -> "mpf":
    """The opening (mm) of the spring's energy barrier, infinite if it has none.

    A root of 1 + β(2u² − 3u) with β = 1 − α. Bars and hinges pull an open unit back, so that it
    rests inverted only beyond.
    """
    from mpmath import inf, sqrt

    beta = 1 - unit.linearity
    squared = 9 * beta**2 - 8 * beta
    if not squared > 0:
        return inf
    return (3 * beta - sqrt(squared)) / (4 * beta) * unit.stroke


def _bisected(function: Callable[["mpf"], "mpf"], low: "mpf", high: "mpf") -> "mpf":
    """The root of a function that goes from negative to positive, `high` if it stays negative."""
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if function(middle) < 0 else (low, middle)
    return high
