"""The family of contact with two fingers: such as touch each other, and bodies between them.

Bases are so far apart that the free fingers would be in each other by so much. Sizes and places of
bodies are by a segment's length: they are such as fingers of the study's proportions hold.
"""

from collections.abc import Iterator
from itertools import product

import numpy as np

from dpgcli.design.scene import Gripper
from dpgcli.grasping.frames import frames
from dpgcli.grasping.meeting import along_axis, way_of
from dpgcli.hard_cases.discs import GRAZING, LAYER, N_UNITS, free_state, others
from dpgcli.hard_cases.variants import Variant, changed, repeated, rigid, with_bars
from dpgcli.mechanics.finger import Finger
from dpgcli.reference.bodies import RoundBody, StraightBody
from dpgcli.reference.gripper import Grip

MEETING = ("111/110", "110/011", "101/110", "111/001")
RATIOS = (1.0, 1e3, 1e6, 1e12)  # k_L/k_b
HOLDING = ("010/100", "010/001", "110/100")
ON_DISC = ("000/001", "001/101", "000/010", "110/011")
DEEP, DEEPER, RESETTING = 0.5, 5.0, 20.0  # mm: fingers in each other; where units reset
IN_WAY = 0.1  # mm: a body in the upper finger
SIZES = (2.0, 10.0)  # mm: of discs beside which fingers meet


def two_fingers(base: Finger) -> Iterator[Variant]:
    """All of them, about three units of a finger."""
    finger = repeated(base, N_UNITS)
    stiff, hard = ("k_L/k_b = 1e3", with_bars(finger, 1e3)), ("k_L = ∞", rigid(finger))
    for pattern in MEETING:
        for deep in (DEEP, DEEPER):
            yield _met(pattern, *hard, deep)
    for pattern in MEETING[:2]:
        yield _met(pattern, *hard, RESETTING)
    for by, side in product(GRAZING, (1.0, -1.0)):
        yield _met(MEETING[0], *hard, side * by)
    for ratio in RATIOS:
        yield _met(MEETING[0], f"k_L/k_b = {ratio:g}", with_bars(finger, ratio), DEEP)
    for words, values in others(base).items():
        yield _met(MEETING[0], f"{words}, k_L = ∞", rigid(changed(finger, **values)), DEEP)
    for pattern, size in product(MEETING, SIZES):
        yield _met(pattern, *hard, DEEP, size)
    yield _met(MEETING[0], *stiff, DEEP, SIZES[1])
    for n_motions, pattern in product((1, 2), ON_DISC):
        yield _on_disc(pattern, *hard, n_motions)
    yield _on_disc(ON_DISC[0], *stiff, 2)
    for pattern in HOLDING:
        yield _in_notches(pattern, *hard, IN_WAY)
    for bars in (hard, stiff):
        yield _in_notches(HOLDING[0], *bars, DEEP)


def _on_disc(pattern: str, bars: str, finger: Finger, n_motions: int) -> Variant:
    """About a large disc, not quite on the axis, that moves."""
    thickness = LAYER * float(finger.segment_height[0, 0])
    length = float(finger.segment_length[0, 0])
    disc = RoundBody((1.85 * length, 0.02 * length), 1.667 * length, thickness)
    grip = Grip(3.333 * length, thickness, disc, n_motions)
    return Variant(f"{grip.name}, {bars}", finger, (pattern,), grip=grip)


def _in_notches(pattern: str, bars: str, finger: Finger, deep: float) -> Variant:
    """About a block that turns, with a notch for each tip, as deep in both, mm."""
    thickness = LAYER * float(finger.segment_height[0, 0])
    upper, lower = (free_state(finger, half, thickness).face[:, -1] for half in pattern.split("/"))
    length, half = float(finger.segment_length[0, 0]), 2.5 * float(finger.segment_height[0, 0])
    wide, high = 0.6 * length, 0.4 * length
    top, bottom = half + upper[1] + deep, -half - lower[1] - deep
    corners = (
        (lower[0] - wide, bottom - high),
        (lower[0], bottom),
        (lower[0] + wide, bottom - high),
        (upper[0] + wide, top + high),
        (upper[0], top),
        (upper[0] - wide, top + high),
    )
    body = StraightBody(tuple((float(x), float(y)) for x, y in corners), thickness)
    grip = Grip(2.0 * half, thickness, body, 3)
    label = f"block with notches, {deep:g} mm deep, free to turn, {bars}"
    return Variant(label, finger, (pattern,), grip=grip)


def _met(pattern: str, bars: str, finger: Finger, deep: float, size: float = 0.0) -> Variant:
    """Fingers that meet, beside a disc of a size under the upper one's first phalanx, if any."""
    thickness = LAYER * float(finger.segment_height[0, 0])
    free = [free_state(finger, half, thickness) for half in pattern.split("/")]
    axis = frames(Gripper(0.0, 0.0))[0].axis
    nodes = (own.bare.with_end().shape(own.settled.equilibrium.coordinates).nodes for own in free)
    spacing = float(way_of(*(along_axis(axis, own) for own in nodes))[0]) - deep
    side = f"{abs(deep):g} mm {'deep' if deep > 0.0 else 'away'}"
    if not size:
        return Variant(
            f"fingers that meet, {side}, {bars}", finger, (pattern,), grip=Grip(spacing, thickness)
        )
    radius, face = 0.5 * size, free[0].face
    middle = 0.5 * (face[:, 0] + face[:, 1]) + (radius - IN_WAY) * free[0].inwards(0)
    x, y = middle + np.array([0.0, 0.5 * spacing])
    disc = RoundBody((float(x), float(y)), radius, thickness)
    label = f"fingers that meet beside a disc of {size:g} mm, {side}, {bars}"
    return Variant(label, finger, (pattern,), grip=Grip(spacing, thickness, disc))
