"""Jaws that open and close between fingers: force by aperture, with every unit that resets.

Each plate moves half of the way, along y. The fingers meet the jaws at the first aperture, where
these grow from nothing as any body; then the aperture goes to the last one and back. What it takes
to keep the jaws apart is a multiplier: the squeeze of the fingers, to the last digit, and its
slope by the aperture is that of the path. Every rest that is told is certified: a way ends where
there is none.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Codes, Flags
from dpgcli.design.bodies import Jaws
from dpgcli.design.scene import Scene
from dpgcli.equilibrium.corrector import corrected
from dpgcli.grasping.approach import Approach, approach
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.descent import finished
from dpgcli.grasping.frames import FingerFrame
from dpgcli.grasping.grasp import described, judged, placed
from dpgcli.grasping.shapes import ContactShapes, Motion, with_lost
from dpgcli.mechanics.terms import Formulate
from dpgcli.records import dataclass
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of

STEPS = 50  # of the aperture, each way
NOTHING = 1e-11  # of the forces in play: a smaller squeeze is none


@dataclass(frozen=True)
class Halt:
    """Units of a `lane` that left their wells, (unit,), at an aperture (mm) and a squeeze (N).

    `step` is the first one after it.
    """

    lane: int
    step: int
    gap: float
    squeeze: float
    flipped: Flags


@dataclass(frozen=True)
class JawPath:
    """What fingers, (lane,), bear as jaws open and close through apertures `gap`, (step,), mm.

    `squeeze` N and `stiffness` N/mm, (step, lane), are those of two such fingers, `code` is the
    state there and `status` the result of its certification; NaN from where it is not stable.
    """

    codes: Codes
    gap: Array
    squeeze: Array
    stiffness: Array
    code: Codes
    status: NDArray[np.uint8]
    halts: tuple[Halt, ...]


def jaw_path(
    scene: Scene,
    formulate: Formulate,
    jaws: Jaws,
    frame: FingerFrame,
    codes: Codes,
    gaps: tuple[float, float],
    n_steps: int = STEPS,
) -> JawPath:
    """Fingers in these states at jaws that go from the first aperture to the last, and back.

    A lane ends at the first aperture without a certified rest.
    """
    begun = placed(scene, formulate, replace(jaws, gap=gaps[0]), frame, codes)
    shapes = begun.grown.shapes
    (finger,) = described(begun.own, [codes], begun.grown, begun.status, with_margins=False)
    is_other = (finger.status == Status.STABLE) & (finger.after != codes)
    status = np.where(is_other, np.uint8(Status.ANOTHER_PATTERN), finger.status)
    shapes = replace(shapes, is_there=shapes.is_there & (status == Status.STABLE))
    share, halts = np.arange(n_steps + 1) / n_steps, list[Halt]()
    told: list[tuple[float, Array, Array, Codes, NDArray[np.uint8]]] = []
    for begin, end in (gaps, gaps[::-1]):
        own = _with_jaws(begun.own, jaws, frame, begin, end)
        shapes = _with_motion(own, shapes)
        status = with_lost(status, shapes.is_there)
        if not told:
            told.append((begin, *_told(own, shapes, 0.0, end - begin), status))
        for before, load in pairwise(share):
            at = np.full(len(codes), before)
            came = approach(own, shapes, at, np.full(len(codes), load), unfolded=True)
            halts += _halts(came, len(told), begin, end)
            status = with_lost(judged(own, came, status)[2], came.shapes.is_there)
            shapes = replace(came.shapes, is_there=status == Status.STABLE)
            gap = begin + load * (end - begin)
            told.append((gap, *_told(own, shapes, load, end - begin), status))
        shapes = own.at_rest(shapes)
    way, squeeze, stiffness, code, found = (np.array(values) for values in zip(*told, strict=True))
    return JawPath(codes, way, squeeze, stiffness, code, found, tuple(halts))


def _with_jaws(
    own: Obstructed, jaws: Jaws, frame: FingerFrame, begin: float, end: float
) -> Obstructed:
    """Fingers at jaws that open or close, up to the end."""
    along = frame.along(np.array([0.0, 0.5 * frame.side]))[:, None, None]
    motion = Motion((along,), travel=np.full((1, 1), end - begin))
    body = frame.obstacle(replace(jaws, gap=end))
    return replace(own, bodies=(body,), depth=np.zeros(1), motion=motion)


def _with_motion(own: Obstructed, shapes: ContactShapes) -> ContactShapes:
    """Shapes at jaws that stand still, as those of jaws that begin to move; at rest once more."""
    assert own.motion is not None and own.motion.travel is not None, "they move"
    n = shapes.coordinates.shape[1]
    from_there = np.broadcast_to(-own.motion.travel, (1, n))
    coordinates = np.concatenate((shapes.coordinates, from_there))
    push = np.concatenate((shapes.push, np.ones((1, n))))
    begun = finished(own, coordinates, shapes.inverted, push, np.zeros(n))
    return replace(begun, is_there=begun.is_there & shapes.is_there)


def _halts(came: Approach, step: int, begin: float, end: float) -> Iterator[Halt]:
    for reset in came.resets:
        for place, lane in enumerate(reset.lanes):
            gap = begin + reset.load[place] * (end - begin)
            squeeze = 2.0 * reset.push[-1, place]
            yield Halt(int(lane), step, float(gap), float(squeeze), reset.flipped[:, place])


def _told(
    own: Obstructed, shapes: ContactShapes, load: float, travel: float
) -> tuple[Array, Array, Codes]:
    """Squeeze, its slope by the aperture, and the states, (lane,)."""
    here, n = own.relabeled(shapes), len(shapes.is_there)
    family = own.family(here.inverted, here.active)
    nothing, free = np.full(n, -1), np.zeros(n)
    depth = max(family.column_depths)
    there = corrected(family, own.stacked(here), np.full(n, load), nothing, free, depth)
    slopes = own.pushes(here.active, there.along_load[len(here.coordinates) :])
    slope = slopes[-1] / travel
    least = NOTHING * own.units.finger.force_scale.min()
    push = np.where(np.abs(shapes.push[-1]) > least, shapes.push[-1], 0.0)
    squeeze = np.where(shapes.is_there, push, np.nan)
    stiffness = np.where(shapes.is_there, slope, np.nan)
    return 2.0 * squeeze, 2.0 * stiffness, codes_of(own.is_open(shapes))
