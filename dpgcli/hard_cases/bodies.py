"""The family of bodies in the way of a finger: discs, and such as have straight sides.

Those are a plate along a phalanx and shorter than it, so that it meets both ends of the plate; a
wedge that points at a phalanx; and a block that the end of the face comes down on. Each is placed
by the face of the free state, and reaches into it by so much.
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
from dpgcli.hard_cases.variants import Variant, changed, repeated, rigid, with_bars
from dpgcli.mechanics.finger import Finger
from dpgcli.reference.bodies import StraightBody
from dpgcli.states.certify import Status

SIZES = (1.0, 5.0, 25.0, 100.0, 500.0)  # mm
SIZE, NARROW = 20.0, 8.0  # mm, where others are varied; of a plate, less than a phalanx


class Spot(NamedTuple):
    """Where a body meets the free state of a pattern, and its corners by size.

    Corners (corner, 2) are counted along the face and inwards from where it is touched.
    """

    words: str
    pattern: str
    where: Callable[[Free], tuple[Array, Array]]  # a point of the face, and a direction inwards
    corners: Callable[[float], Array]


def plate(size: float) -> Array:
    """Flat towards the face."""
    return np.array([[-0.5, 0.0], [0.5, 0.0], [0.5, 0.6], [-0.5, 0.6]]) * size


def wedge(size: float) -> Array:
    """With its edge towards the face."""
    return np.array([[0.0, 0.0], [0.6, 1.0], [-0.4, 0.8]]) * size


def on_side(side: int, share: float) -> Callable[[Free], tuple[Array, Array]]:
    """On a side, straight in front of it."""

    def where(free: Free) -> tuple[Array, Array]:
        start, end = free.face[:, side], free.face[:, side + 1]
        return start + share * (end - start), free.inwards(side)

    return where


def at_tip(free: Free) -> tuple[Array, Array]:
    """At the end of the face, from below and ahead."""
    last = free.face.shape[1] - 2
    way = free.inwards(last) + 0.4 * free.along(last)
    return free.face[:, -1], way / np.hypot(*way)


PLATE = Spot("plate along phalanx 2", "000", on_side(1, 0.45), plate)
WEDGE = Spot("wedge at phalanx 3", "111", on_side(2, 0.6), wedge)
BLOCK = Spot("block below the tip", "011", at_tip, plate)
SPOTS = (PLATE, WEDGE, BLOCK)
SIZED = (WEDGE, BLOCK)
UNDER_ALL = Spot("plate along all phalanges", "000", on_side(1, 0.5), plate)
NEXT_TO_CLAMP = Spot("wedge next to the clamp", "000", on_side(0, 0.05), wedge)


def bodies(base: Finger) -> Iterator[Variant]:
    """All of them, about three units of a finger."""
    yield from discs(base)
    finger = repeated(base, N_UNITS)
    stiff, hard = ("k_L/k_b = 1e3", with_bars(finger, 1e3)), ("k_L = ∞", rigid(finger))
    for bars, spot, size in product((hard, stiff), SIZED, SIZES):
        yield from _at(spot, *bars, size)
    for ratio, spot in product(RATIOS, SPOTS):
        yield from _at(spot, f"k_L/k_b = {ratio:g}", with_bars(finger, ratio), _size(spot))
    for spot, by, side in product(SPOTS, GRAZING, (1.0, -1.0)):
        yield from _at(spot, *hard, _size(spot), side * by)
    for bars in (hard, stiff):
        yield from _at(UNDER_ALL, *bars, 80.0)
        yield from _at(NEXT_TO_CLAMP, *bars, 4.0, AT_CLAMP)
    for words, values in others(base).items():
        for spot in SPOTS:
            own = f"{words}, k_L = ∞", rigid(changed(finger, **values))
            yield from _at(spot, *own, _size(spot))
    for spot in SPOTS:
        yield from _at(spot, *hard, _size(spot), RESETTING)


def _size(spot: Spot) -> float:
    return NARROW if spot is PLATE else SIZE


def _at(
    spot: Spot, bars: str, finger: Finger, size: float, depth: float = DEEP
) -> Iterator[Variant]:
    """A body so deep in the free state, if there is one and the base is not in the body."""
    thickness = LAYER * float(finger.segment_height[0, 0])
    free = free_state(finger, spot.pattern, thickness)
    if free.settled.status[0] != Status.STABLE:
        return
    point, inwards = spot.where(free)
    along = np.array([-inwards[1], inwards[0]])
    corners = spot.corners(size)[::-1]  # inwards is to the right: the body to the left of its sides
    placed = point + corners[:, :1] * along + (corners[:, 1:] - depth) * inwards
    height = float(finger.segment_height[0, 0])
    base = shapely.LineString([free.face[:, 0], (0.0, height)])
    if shapely.Polygon(placed).intersects(base):
        return
    body = StraightBody(tuple((float(x), float(y)) for x, y in placed), thickness)
    side = f"{abs(depth):g} mm {'deep' if depth > 0.0 else 'away'}"
    label = f"{spot.words}, {size:g} mm, {side}, {bars}"
    yield Variant(label, finger, (spot.pattern,), body=body)
