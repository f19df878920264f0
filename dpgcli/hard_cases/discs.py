"""The family of discs in the way of a finger: large and small, grazing, in corners, at the clamp.

Each is placed by the face of the free state, and reaches into it by so much.
"""

from collections.abc import Callable, Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array
from dpgcli.hard_cases.variants import Variant, changed, repeated, rigid, with_bars
from dpgcli.mechanics.face import Face
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.reference.contact import RoundBody
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Status
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions

N_UNITS = 3
LAYER = 1.5 / 10.75  # of the segment height: the study's
DIAMETERS = (1.0, 3.0, 10.0, 40.0, 150.0, 500.0)  # mm
DIAMETER = 25.0  # mm, where others are varied
RATIOS = (1.0, 1e3, 1e6, 1e9, 1e12, 1e15)  # k_L/k_b
GRAZING = (1e-9, 1e-8, 1e-7, 1e-6)  # mm, in touch and not
DEEP, AT_CLAMP, RESETTING = 0.1, 1e-3, 5.0  # mm into the free shape
NEXT_TO_CLAMP = 0.02  # of the first phalanx


class Spot(NamedTuple):
    """A place of a face (2,), mm, and the way from there to the center of a disc, by its radius."""

    place: Array
    way: Array

    def disc(self, diameter: float, depth: float, thickness: float) -> RoundBody:
        """The disc that reaches so deep into the face."""
        x, y = self.place + (0.5 * diameter - depth) * self.way
        return RoundBody((float(x), float(y)), 0.5 * diameter, thickness)


Choose = Callable[[Array], Spot]  # by the nodes of a face (2, node)


def _along(face: Array, side: int) -> Array:
    way = face[:, side + 1] - face[:, side]
    return np.asarray(way / np.hypot(*way))


def _inwards(face: Array, side: int) -> Array:
    x, y = _along(face, side)
    return np.array([y, -x])


def on_side(side: int, share: float = 0.5) -> Choose:
    """A spot on a side."""

    def choose(face: Array) -> Spot:
        start, end = face[:, side], face[:, side + 1]
        return Spot(start + share * (end - start), _inwards(face, side))

    return choose


def at_tip(face: Array) -> Spot:
    """The corner at the tip, from below and ahead."""
    last = face.shape[1] - 2
    return Spot(face[:, -1], (_inwards(face, last) + _along(face, last)) / np.sqrt(2.0))


def in_corner(corner: int) -> Choose:
    """A corner whose two sides are both touched."""

    def choose(face: Array) -> Spot:
        before, after = _inwards(face, corner - 1), _inwards(face, corner)
        return Spot(face[:, corner], (before + after) / (1.0 + before @ after))

    return choose


def below_base(face: Array) -> Spot:
    """The clamped corner, from below and behind."""
    return Spot(face[:, 0], np.array([-0.6, -0.8]))


SPOTS: dict[str, tuple[str, Choose]] = {
    "under phalanx 2": ("000", on_side(1)),
    "under phalanx 3": ("111", on_side(2)),
    "at the tip": ("101", at_tip),
    "between phalanges 1 and 2": ("110", in_corner(1)),
    "between phalanges 2 and 3": ("011", in_corner(2)),
}


def discs(base: Finger) -> Iterator[Variant]:
    """All of them, about three units of a finger."""
    finger = repeated(base, N_UNITS)
    stiff = {"k_L/k_b = 1e3": with_bars(finger, 1e3), "k_L = ∞": rigid(finger)}
    for (bars, own), diameter, spot in product(stiff.items(), DIAMETERS, SPOTS):
        yield from _placed(spot, bars, own, diameter)
    for ratio, spot in product(RATIOS, SPOTS):
        yield from _placed(spot, f"k_L/k_b = {ratio:g}", with_bars(finger, ratio), DIAMETER)
    for (bars, own), by, spot in product(stiff.items(), GRAZING, tuple(SPOTS)[1:4]):
        for depth in (by, -by):
            yield from _placed(spot, bars, own, DIAMETER, depth)
    for bars, own in stiff.items():
        clamp = "next to the clamp", "000", on_side(0, NEXT_TO_CLAMP)
        yield from _at(*clamp, bars, own, DIAMETER, AT_CLAMP)
        for by in GRAZING:
            yield from _at("clear of the clamp", "111", below_base, bars, own, DIAMETER, -by)
    for words, values in _others(base).items():
        own = rigid(changed(finger, **values))
        for spot in SPOTS:
            yield from _placed(spot, f"{words}, k_L = ∞", own, DIAMETER)
    for spot in tuple(SPOTS)[1:]:
        yield from _placed(spot, "k_L = ∞", rigid(finger), DIAMETER, RESETTING)


def _others(base: Finger) -> dict[str, dict[str, float]]:
    """What else a finger may have, by name."""
    return {
        "walls": {"wall_compliance": 1.0 / float(base.bistable_stiffness.min())},
        "coupled hinges": {"hinge_coupling": 0.05 * float(base.hinge_stiffness.min())},
        "tip force": {"tip_force_y": -0.1},
    }


def _placed(
    spot: str, bars: str, finger: Finger, diameter: float, depth: float = DEEP
) -> Iterator[Variant]:
    pattern, choose = SPOTS[spot]
    return _at(spot, pattern, choose, bars, finger, diameter, depth)


def _at(
    spot: str,
    pattern: str,
    choose: Choose,
    bars: str,
    finger: Finger,
    diameter: float,
    depth: float,
) -> Iterator[Variant]:
    """A disc at a spot of the free state, if there is one and the base is not in the disc."""
    thickness = LAYER * float(finger.segment_height[0, 0])
    face = _free_face(finger, pattern, thickness)
    if face is None:
        return
    disc = choose(face).disc(diameter, depth, thickness)
    if np.hypot(*(face[:, 0] - disc.center)) > disc.radius:
        side = f"{abs(depth):g} mm {'deep' if depth > 0.0 else 'away'}"
        label = f"disc of {diameter:g} mm {spot}, {side}, {bars}"
        yield Variant(label, finger, (pattern,), disc=disc)


def _free_face(finger: Finger, pattern: str, thickness: float) -> Array | None:
    """The nodes of the face (2, node) of a free state, None if there is none."""
    inverted = np.array([[digit == "1"] for digit in pattern])
    free = settle(UnitSolutions.of(finger), chain_potential, inverted, DEFAULT_TOLERANCE)
    if free.status[0] != Status.STABLE:
        return None
    face = Face.of(free.potential.coordinates, np.array([[thickness]]))
    return face.shape(free.equilibrium.coordinates).nodes[..., 0]
