"""Single units in mpmath numbers: their parameters, and the wells they have with rigid bars."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dpgcli.mechanics.finger import Finger

if TYPE_CHECKING:
    from mpmath import mpf

BISECTIONS = 60


class Unit(NamedTuple):
    """One unit's L, H and d (mm), k_b (N/mm), α, k_θ (N mm/rad) and k_L (N/mm)."""

    length: "mpf"
    height: "mpf"
    stroke: "mpf"
    bistable: "mpf"
    linearity: "mpf"
    hinge: "mpf"
    bar: "mpf"


def extended_units(finger: Finger) -> list[Unit]:
    """The units of a finger of one design, their doubles taken as exact."""
    from mpmath import mpf

    arrays = list(finger.arrays().values())[: len(Unit._fields)]
    columns = (np.broadcast_to(v, (finger.n_units, 1))[:, 0] for v in arrays)
    return [Unit(*map(mpf, values)) for values in zip(*(c.tolist() for c in columns), strict=True)]


class Well(NamedTuple):
    """Corner angle m (rad) in the second well, and the opening (mm) at the barrier before it.

    Without a second well they are those of the full stroke and of 3/4 of it.
    """

    angle: "mpf"
    barrier: "mpf"


def inverted_well(unit: Unit) -> Well:
    """Find the second well of a unit with rigid bars, which opens both corners by m.

    With x = 2H sin m its moment is 2 H² k_b times sin 2m P(u) + 2κm, where u = x/d, β = 1−α,
    P = 1 + β(2u² − 3u) and κ = k_θ/(k_b H²). P is at least α outside 1/2 < u < 1, so both roots
    are between, and they are told apart where P + 2κm/sin 2m is smallest (our derivation).
    """
    from mpmath import asin, cos, sin

    reach = 2 * unit.height / unit.stroke
    softening = 1 - unit.linearity
    hinge = unit.hinge / (unit.bistable * unit.height**2)

    def moment(m: "mpf") -> "mpf":
        u = reach * sin(m)
        return sin(2 * m) * (1 + softening * (2 * u**2 - 3 * u)) + 2 * hinge * m

    def trend(m: "mpf") -> "mpf":
        u, turn = reach * sin(m), 2 * m
        bend = 2 * hinge * (sin(turn) - turn * cos(turn))
        return softening * (4 * u - 3) * reach * cos(m) * sin(turn) ** 2 + bend

    def opened(strokes: float) -> "mpf":
        return asin(min(strokes / reach, 1))

    least = _bisected(trend, opened(0.25), opened(0.75))
    if not moment(least) < 0:
        return Well(opened(1.0), 0.75 * unit.stroke)
    barrier = _bisected(lambda m: -moment(m), opened(0.25), least)
    return Well(_bisected(moment, least, opened(1.25)), 2 * unit.height * sin(barrier))


def _bisected(function: Callable[["mpf"], "mpf"], low: "mpf", high: "mpf") -> "mpf":
    """Where a function goes from negative to positive; `high` where it stays negative."""
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if function(middle) < 0 else (low, middle)
    return high
