"""The family of discs in the way of a finger: large and small, grazing, in corners, at the clamp.

Each is placed by the face of the free state, and reaches into it by so much.
"""

from collections.abc import Callable, Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.linalg import solveh_banded

from dpgcli.arrays import Array
from dpgcli.hard_cases.variants import Variant, changed, repeated, rigid, with_bars
from dpgcli.mechanics.face import Face
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.gaps import FaceGaps
from dpgcli.mechanics.obstacle import Obstacle
from dpgcli.mechanics.terms import chain_potential
from dpgcli.reference.bodies import RoundBody
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Settled, Status
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions

N_UNITS = 3
LAYER = 1.5 / 10.75  # of the segment height: the study's
DIAMETERS = (1.0, 3.0, 10.0, 40.0, 150.0, 500.0)  # mm
DIAMETER = 25.0  # mm, where others are varied
RATIOS = (1.0, 1e3, 1e6, 1e9, 1e12, 1e15)  # k_L/k_b
GRAZING = (1e-9, 1e-8, 1e-7, 1e-6)  # mm, in touch and not
DEEP, AT_CLAMP, RESETTING = 0.1, 1e-3, 5.0  # mm into the free shape


class Free(NamedTuple):
    """A finger at rest without a disc: coordinates (size, 1), its face and the nodes, (2, node)."""

    settled: Settled
    bare: Face
    face: Array

    def along(self, side: int) -> Array:
        """The direction of a side, (2,)."""
        way = self.face[:, side + 1] - self.face[:, side]
        return np.asarray(way / np.hypot(*way))

    def inwards(self, side: int) -> Array:
        """The direction from a side to what it may touch, (2,)."""
        x, y = self.along(side)
        return np.array([y, -x])

    def yielding(self, discs: list[RoundBody], sides: list[int]) -> Array:
        """How far sides give way to a push of 1 N on each by a disc, mm, (side,)."""
        at = self.settled.equilibrium.coordinates
        met = [Obstacle.disc(np.array(disc.center), disc.radius) for disc in discs]
        pairs = zip(met, sides, strict=True)
        slopes = [FaceGaps(self.bare, body)(at).gradient[:, side, 0] for body, side in pairs]
        slope = np.stack(slopes, axis=1)
        rates = np.zeros((len(at), len(sides)))
        rates[self.bare.places] = slope
        hessian = self.settled.potential.evaluate(at).hessian[..., 0]
        return np.asarray(rates.T @ solveh_banded(hessian, rates.sum(axis=1), lower=True))


Place = Callable[[Free, float, float], Array]  # the center of a disc of a radius, so deep, (2,)


def on_side(side: int, share: float = 0.5) -> Place:
    """On a side."""

    def center(free: Free, radius: float, depth: float) -> Array:
        start, end = free.face[:, side], free.face[:, side + 1]
        return np.asarray(start + share * (end - start) + (radius - depth) * free.inwards(side))

    return center


def at_tip(free: Free, radius: float, depth: float) -> Array:
    """At the corner of the tip, from below and ahead."""
    last = free.face.shape[1] - 2
    way = (free.inwards(last) + free.along(last)) / np.sqrt(2.0)
    return np.asarray(free.face[:, -1] + (radius - depth) * way)


def below_clamp(free: Free, radius: float, depth: float) -> Array:
    """At the clamped corner, from below and behind."""
    return np.asarray(free.face[:, 0] + (radius - depth) * np.array([-0.6, -0.8]))


def in_corner(corner: int) -> Place:
    """Between two sides, as deep in both."""

    def center(free: Free, radius: float, depth: float) -> Array:
        return _between(free, corner, np.full(2, radius - depth))

    return center


def held_by_both(corner: int) -> Place:
    """Between two sides, so deep that both push, and alike."""

    def center(free: Free, radius: float, depth: float) -> Array:
        x, y = _between(free, corner, np.full(2, radius))
        give = free.yielding([RoundBody((x, y), radius, 0.0)] * 2, [corner - 1, corner])
        return _between(free, corner, radius - depth * give / give.max())

    return center


def _between(free: Free, corner: int, away: Array) -> Array:
    """The place so far from the two sides at a corner, (2,)."""
    normals = np.stack((free.inwards(corner - 1), free.inwards(corner)))
    return np.asarray(free.face[:, corner] + np.linalg.solve(normals, away))


class Spot(NamedTuple):
    """Where a disc meets the free state of a pattern."""

    words: str
    pattern: str
    center: Place


SPOTS = {
    "straight": Spot("under phalanx 2", "000", on_side(1)),
    "side": Spot("under phalanx 3", "111", on_side(2)),
    "tip": Spot("at the tip", "101", at_tip),
    "corner": Spot("between phalanges 1 and 2", "110", in_corner(1)),
    "both": Spot("held by phalanges 2 and 3", "011", held_by_both(2)),
}
NEXT_TO_CLAMP = Spot("next to the clamp", "000", on_side(0, 0.02))
BELOW_CLAMP = Spot("below the clamp", "111", below_clamp)


def discs(base: Finger) -> Iterator[Variant]:
    """All of them, about three units of a finger."""
    finger = repeated(base, N_UNITS)
    stiff, hard = ("k_L/k_b = 1e3", with_bars(finger, 1e3)), ("k_L = ∞", rigid(finger))
    for bars, diameters in ((hard, DIAMETERS), (stiff, DIAMETERS[1::2])):
        for diameter, spot in product(diameters, SPOTS):
            yield from _at(SPOTS[spot], *bars, diameter)
    for ratio, spot in product(RATIOS, SPOTS.values()):
        yield from _at(spot, f"k_L/k_b = {ratio:g}", with_bars(finger, ratio))
    for bars, spots in ((hard, ("side", "tip", "corner")), (stiff, ("corner",))):
        for spot, by, side in product(spots, GRAZING, (1.0, -1.0)):
            yield from _at(SPOTS[spot], *bars, depth=side * by)
    for bars in (hard, stiff):
        yield from _at(NEXT_TO_CLAMP, *bars, depth=AT_CLAMP)
        for by in GRAZING:
            yield from _at(BELOW_CLAMP, *bars, depth=-by)
    for words, values in others(base).items():
        for spot in SPOTS.values():
            yield from _at(spot, f"{words}, k_L = ∞", rigid(changed(finger, **values)))
    for name in ("side", "tip", "corner"):
        yield from _at(SPOTS[name], *hard, depth=RESETTING)


def others(base: Finger) -> dict[str, dict[str, float]]:
    """What else a finger may have, by name."""
    return {
        "walls": {"wall_compliance": 1.0 / float(base.bistable_stiffness.min())},
        "coupled hinges": {"hinge_coupling": 0.05 * float(base.hinge_stiffness.min())},
        "tip force": {"tip_force_y": -0.1},
    }


def _at(
    spot: Spot, bars: str, finger: Finger, diameter: float = DIAMETER, depth: float = DEEP
) -> Iterator[Variant]:
    """A disc so deep in the free state, if there is one and the base is not in the disc."""
    thickness = LAYER * float(finger.segment_height[0, 0])
    free, radius = free_state(finger, spot.pattern, thickness), 0.5 * diameter
    if free.settled.status[0] != Status.STABLE:
        return
    x, y = spot.center(free, radius, depth)
    if np.hypot(x - free.face[0, 0], y - free.face[1, 0]) > radius:
        side = f"{abs(depth):g} mm {'deep' if depth > 0.0 else 'away'}"
        disc = RoundBody((float(x), float(y)), radius, thickness)
        label = f"disc of {diameter:g} mm {spot.words}, {side}, {bars}"
        yield Variant(label, finger, (spot.pattern,), body=disc)


def free_state(finger: Finger, pattern: str, thickness: float) -> Free:
    """The free state of a pattern of a finger whose layer is so thick, mm."""
    inverted = np.array([[digit == "1"] for digit in pattern])
    free = settle(UnitSolutions.of(finger), chain_potential, inverted, DEFAULT_TOLERANCE)
    bare = Face.of(free.potential.coordinates, np.array([[thickness]]))
    return Free(free, bare, bare.shape(free.equilibrium.coordinates).nodes[..., 0])
