"""The family of bodies in the way of a finger: discs, and such as have straight sides.

Those are plates along a phalanx, shorter than it or beyond its end; a wedge that points at a
phalanx; and a block that the end of the face comes down on. Each is placed by the face of the free
state, and reaches into it by so much. Those of two fingers are in `pairs`.
"""

from collections.abc import Callable, Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
import shapely

from dpgcli.arrays import Array
from dpgcli.hard_cases.discs import (
    AT_CLAMP,
    DEEP,
    GRAZING,
    LAYER,
    N_UNITS,
    RATIOS,
    RESETTING,
    Free,
    discs,
    free_state,
    others,
)
from dpgcli.hard_cases.pairs import two_fingers
from dpgcli.hard_cases.variants import Variant, changed, repeated, rigid, with_bars
from dpgcli.mechanics.finger import Finger
from dpgcli.reference.bodies import RoundBody, StraightBody
from dpgcli.states.certify import Status

STIFFNESSES = (1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9, np.inf)  # N/mm, of jaws
AXIS = 30.0  # mm: of the gripper, below the fingers' bases
SIZES = (1.0, 5.0, 25.0, 100.0, 500.0)  # mm


Corners = Callable[[Free, float, float], Array]  # of a body of a size, so deep, (corner, 2)


class Spot(NamedTuple):
    """Where a body meets the free state of a pattern."""

    words: str
    pattern: str
    corners: Corners
    size: float  # mm, where others are varied


def plate(size: float) -> Array:
    """Flat towards the face; corners along it and inwards from where it is touched, (corner, 2)."""
    return np.array([[-0.5, 0.0], [0.5, 0.0], [0.5, 0.6], [-0.5, 0.6]]) * size


def wedge(size: float) -> Array:
    """With its edge towards the face."""
    return np.array([[0.0, 0.0], [0.6, 1.0], [-0.4, 0.8]]) * size


def on_side(side: int, share: float, shape: Callable[[float], Array]) -> Corners:
    """On a side, straight in front of it."""

    def corners(free: Free, size: float, depth: float) -> Array:
        start, end = free.face[:, side], free.face[:, side + 1]
        return _placed(start + share * (end - start), free.inwards(side), shape(size), depth)

    return corners


def at_tip(free: Free, size: float, depth: float) -> Array:
    """A plate at the end of the face, from below and ahead."""
    last = free.face.shape[1] - 2
    way = free.inwards(last) + 0.4 * free.along(last)
    return _placed(free.face[:, -1], way / np.hypot(*way), plate(size), depth)


def held_twice(side: int, shares: tuple[float, float], end: float) -> Corners:
    """A plate against two places of a side, tilted so that both push alike.

    It ends `end` times as far from the first as the second is.
    """

    def corners(free: Free, size: float, depth: float) -> Array:
        inwards, start = free.inwards(side), free.face[:, side]
        touched = [start + share * (free.face[:, side + 1] - start) for share in shares]
        below = [point + inwards for point in touched]
        discs = [RoundBody((float(x), float(y)), 1.0, 0.0) for x, y in below]
        give = free.yielding(discs, [side, side])
        reach = depth * give / give.max()
        first, second = (at - r * inwards for at, r in zip(touched, reach, strict=True))
        second = first + end * (second - first)
        return np.array([first, first + size * inwards, second + size * inwards, second])

    return corners


def _placed(point: Array, inwards: Array, shape: Array, depth: float) -> Array:
    """Corners of a shape at a point, the body to the left of its sides."""
    along = np.array([-inwards[1], inwards[0]])
    shape = shape[::-1]  # inwards is to the right of the face
    return np.asarray(point + shape[:, :1] * along + (shape[:, 1:] - depth) * inwards)


PLATE = Spot("plate along phalanx 2", "000", on_side(1, 0.45, plate), 8.0)
WEDGE = Spot("wedge at phalanx 3", "111", on_side(2, 0.6, wedge), 20.0)
BLOCK = Spot("block below the tip", "011", at_tip, 20.0)
ENDS = Spot("plate held by phalanx 2 at both ends", "000", held_twice(1, (0.2, 0.8), 1.0), 5.0)
TIP = Spot("plate held by phalanx 3 and its tip", "101", held_twice(2, (0.3, 1.0), 1.5), 5.0)
SPOTS = (PLATE, WEDGE, BLOCK, ENDS, TIP)
SIZED = (WEDGE, BLOCK)
UNDER_ALL = Spot("plate along all phalanges", "000", on_side(1, 0.5, plate), 80.0)
NEXT_TO_CLAMP = Spot("wedge next to the clamp", "000", on_side(0, 0.05, wedge), 4.0)


def jaws(free: Free, size: float, depth: float) -> Array:
    """A block about the axis of a gripper, whose plate the end of the face comes down on."""
    x, y = free.face[:, -1]
    left, right, high = x - size, x + size, y + depth
    low = -2.0 * AXIS - high
    return np.array([[left, low], [right, low], [right, high], [left, high]])


JAWS = Spot("jaws below the tip", "011", jaws, 12.0)


def bodies(base: Finger) -> Iterator[Variant]:
    """All of them, about three units of a finger."""
    yield from discs(base)
    finger = repeated(base, N_UNITS)
    stiff, hard = ("k_L/k_b = 1e3", with_bars(finger, 1e3)), ("k_L = ∞", rigid(finger))
    for bars, spot, size in product((hard, stiff), SIZED, SIZES):
        yield from _at(spot._replace(size=size), *bars)
    for ratio, spot in product(RATIOS, SPOTS):
        yield from _at(spot, f"k_L/k_b = {ratio:g}", with_bars(finger, ratio))
    for spot, by, side in product(SPOTS, GRAZING, (1.0, -1.0)):
        yield from _at(spot, *hard, side * by)
    for bars in (hard, stiff):
        yield from _at(UNDER_ALL, *bars)
        yield from _at(NEXT_TO_CLAMP, *bars, AT_CLAMP)
    for words, values in others(base).items():
        for spot in SPOTS:
            own = f"{words}, k_L = ∞", rigid(changed(finger, **values))
            yield from _at(spot, *own)
    for spot in SPOTS:
        yield from _at(spot, *hard, RESETTING)
    for stiffness, (bars, depth) in product(STIFFNESSES, ((hard, DEEP), (stiff, 1.0))):
        yield from _at(JAWS, *bars, depth, stiffness)
    for by in GRAZING:
        yield from _at(JAWS, *hard, by, 1.0)
    yield from two_fingers(base)


def _at(
    spot: Spot, bars: str, finger: Finger, depth: float = DEEP, stiffness: float = np.inf
) -> Iterator[Variant]:
    """A body so deep in the free state, if there is one and the base is not in the body."""
    height = float(finger.segment_height[0, 0])
    free = free_state(finger, spot.pattern, LAYER * height)
    if free.settled.status[0] != Status.STABLE:
        return
    corners = spot.corners(free, spot.size, depth)
    base = shapely.LineString([free.face[:, 0], (0.0, height)])
    if shapely.Polygon(corners).intersects(base):
        return
    own = tuple((float(x), float(y)) for x, y in corners)
    body = StraightBody(own, LAYER * height, stiffness)
    side = f"{abs(depth):g} mm {'deep' if depth > 0.0 else 'away'}"
    gives = "" if np.isinf(stiffness) else f", {stiffness:g} N/mm"
    label = f"{spot.words}, {spot.size:g} mm, {side}{gives}, {bars}"
    yield Variant(label, finger, (spot.pattern,), body=body)
