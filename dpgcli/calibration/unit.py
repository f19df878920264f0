"""The hinge, the walls and the lever of one unit, from what it turns by under end moments.

A unit that is pushed open at its dome's axis by P, under an end moment M, turns by θ with
k_θ θ = M + P H cos(θ/2), and opens by 2 H sin(θ/2) + c_w P: its rotations, openings and pushes
give k_θ, c_w and the lever H together (our derivation; the fit goes through the equilibrium).
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from dpgcli.calibration.known import KnownStates
from dpgcli.errors import FitError
from dpgcli.mechanics.curve import spline
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.laws import PushOnly, Tabulated

FEWEST_PUSHES = 2
TOUCHING = 0.01  # of the largest push: with less a dome has let go of its neighbor
SMALLEST_RISE = 0.03  # of the opening: less is noise of a pusher that hardly gives way
SMALLEST_STROKE = 1e-6  # of the study's at the same height: less is none
STIFFEST = 2.5e-4  # of the opening over the push: walls yield hundreds of times as much
POWERS = {  # of a length by which the study's values scale, the material and the shape kept
    "segment_length": 1,
    "segment_height": 1,
    "stroke": 1,
    "bistable_stiffness": 1,
    "force_linearity": 0,
    "hinge_stiffness": 3,
}
_BEHIND = tuple(0.05 * step for step in range(1, 31))
PARABOLA = (
    (0.0, *_BEHIND),
    (0.0, *(0.5 * (u - 1.0) ** 2 for u in _BEHIND)),
)  # a top, then a spring


def lever_of(known: KnownStates) -> float | None:
    """How high above the hinge a unit opens (mm), about: its openings over its turns.

    Those of rows at rest, where walls yield nothing, if they have openings. None without any.

    >>> none = np.full((1, 2), np.nan)
    >>> angles = -np.array([0.25, 0.3])
    >>> known = KnownStates.of_tips(np.array([[False, True]]), none.repeat(2, 0), angles)
    >>> lever_of(replace(known, openings=np.array([[1.0, 9.0]]))), lever_of(known)
    (4.0, None)
    """
    opened, turned, is_inverted = known.openings[0], -known.angles[0], known.patterns[0]
    for kind in (~is_inverted, is_inverted):
        is_known = kind & np.isfinite(opened) & np.isfinite(turned)
        squares = float(turned[is_known] @ turned[is_known])
        product = float(opened[is_known] @ turned[is_known])
        if squares > 0.0 and product > 0.0:
            return product / squares
    return None


def study_unit(segment_height: float) -> dict[str, float]:
    """The study's unit (`mechanics.finger.STUDY`), all its lengths scaled to a segment height (mm).

    >>> unit = study_unit(21.5)
    >>> unit["stroke"], unit["bistable_stiffness"], unit["hinge_stiffness"]
    (7.0, 25.68, 193.6)
    """
    scale = segment_height / STUDY["segment_height"]
    return {name: value * scale ** POWERS[name] for name, value in STUDY.items()}


def unit_finger(known: KnownStates, segment_height: float) -> Finger:
    """A finger of one unit with the push that the data show, where fits of it begin.

    Pushes over openings are a line, P = k (s − o): a spring k (N/mm) that is s (mm) too long.
    What the data leave open is the study's, scaled to the segment height (mm).
    Raises FitError where the data do not say what pushes.

    >>> patterns, none = np.array([[False, True, True]]), np.full(3, np.nan)
    >>> known = KnownStates.of_tips(patterns, np.stack((none, none)), -np.array([0.1, 0.27, 0.3]))
    >>> openings, pushes = np.array([[1.0, 3.48, 3.49]]), np.array([[0.0, 1.0, 0.5]])
    >>> finger = unit_finger(replace(known, openings=openings, pushes=pushes), 10.75)
    >>> round(float(finger.bistable_stiffness[0, 0]), 6), round(float(finger.stroke[0, 0]), 6)
    (50.0, 3.5)
    """
    study = study_unit(segment_height)
    stiffness, stroke = _push(known, study)
    values = study | {"stroke": stroke, "bistable_stiffness": stiffness, "force_linearity": 0.0}
    values |= {"hinge_stiffness": _hinge(known, segment_height) or study["hinge_stiffness"]}
    return replace(uniform_finger(1, **values), law=PushOnly(Tabulated(spline(*PARABOLA))))


def _push(known: KnownStates, study: Mapping[str, float]) -> tuple[float, float]:
    """Stiffness and rest length of the spring whose pushes the data have; the study's without.

    Where the dome has let go of its neighbor the gap opens by the hinge alone: that is not of it.
    """
    is_known = known.patterns & np.isfinite(known.pushes) & np.isfinite(known.openings)
    if not known.patterns.any():
        return study["bistable_stiffness"], study["stroke"]
    is_known &= known.pushes > TOUCHING * np.max(known.pushes[is_known], initial=0.0)
    opening, push = known.openings[is_known], known.pushes[is_known]
    if len(np.unique(push)) < FEWEST_PUSHES:
        raise FitError(
            "opening_mm and push_N of an inverted unit under two moments or more say what pushes "
            f"it: the data have {len(np.unique(push))}"
        )
    yielding, stroke = np.polyfit(push, opening, 1)  # pushes differ more, and are known better
    if yielding * np.ptp(push) > SMALLEST_RISE * stroke:
        raise FitError(f"push_N rises with opening_mm, by {1 / yielding:.3g} N/mm: a push falls")
    if not stroke > SMALLEST_STROKE * study["stroke"]:
        raise FitError(
            f"opening_mm and push_N of an inverted unit: its push ends at {stroke:.3g} mm, "
            "expected an opening > 0"
        )
    return 1.0 / max(-yielding, STIFFEST * abs(stroke) / np.abs(push).max()), float(stroke)


def _hinge(known: KnownStates, segment_height: float) -> float:
    """A first k_θ: moments of loads and pushes over rotations, N mm/rad; 0 if they show none."""
    pushed = np.where(np.isfinite(known.pushes[0]), known.pushes[0], 0.0) * segment_height
    turned = -known.angles[0]
    is_known = np.isfinite(turned) & (turned != 0.0)
    moment = (known.moments + pushed)[is_known]
    squares = float(turned[is_known] @ turned[is_known])
    stiffness = float(moment @ turned[is_known]) / squares if squares > 0.0 else 0.0
    return max(stiffness, 0.0)
