"""The hinge, the walls and the lever of one unit, from what it turns by under end moments.

A unit that is pushed open at its dome's axis by P, under an end moment M, turns by θ with
k_θ θ = M + P H cos(θ/2), and opens by 2 H sin(θ/2) + c_w P: its rotations, openings and pushes
give k_θ, c_w and the lever H together (our derivation; the fit goes through the equilibrium).
"""

from dataclasses import replace

import numpy as np

from dpgcli.calibration.known import KnownStates
from dpgcli.errors import FitError
from dpgcli.mechanics.curve import spline
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.laws import PushOnly, Tabulated

FEWEST_PUSHES = 2
SMALLEST_RISE = 0.01  # of the opening: less is noise of a pusher that hardly gives way
STIFFEST = 1e-3  # mm/N, of the pusher: what walls yield is hundreds of times as much
_BEHIND = tuple(0.05 * step for step in range(1, 31))
PARABOLA = (
    (0.0, *_BEHIND),
    (0.0, *(0.5 * (u - 1.0) ** 2 for u in _BEHIND)),
)  # a top, then a spring


def unit_finger(known: KnownStates, segment_height: float) -> Finger:
    """A finger of one unit with the push that the data show, where fits of it begin.

    Pushes over openings are a line, P = k (s − o): a spring k (N/mm) that is s (mm) too long.
    Raises FitError where the data do not say what pushes.

    >>> patterns, none = np.array([[False, True, True]]), np.full(3, np.nan)
    >>> known = KnownStates.of_tips(patterns, np.stack((none, none)), -np.array([0.1, 0.27, 0.3]))
    >>> openings, pushes = np.array([[1.0, 3.48, 3.49]]), np.array([[0.0, 1.0, 0.5]])
    >>> finger = unit_finger(replace(known, openings=openings, pushes=pushes), 10.75)
    >>> round(float(finger.bistable_stiffness[0, 0]), 6), round(float(finger.stroke[0, 0]), 6)
    (50.0, 3.5)
    """
    stiffness, stroke = _push(known)
    values = STUDY | {"segment_height": segment_height, "stroke": stroke}
    values |= {"bistable_stiffness": stiffness, "force_linearity": 0.0}
    values |= {"hinge_stiffness": _hinge(known, segment_height)}
    return replace(uniform_finger(1, **values), law=PushOnly(Tabulated(spline(*PARABOLA))))


def _push(known: KnownStates) -> tuple[float, float]:
    """Stiffness and rest length of the spring whose pushes the data have; the study's without."""
    is_known = known.patterns & np.isfinite(known.pushes) & np.isfinite(known.openings)
    if not known.patterns.any():
        return STUDY["bistable_stiffness"], STUDY["stroke"]
    opening, push = known.openings[is_known], known.pushes[is_known]
    if len(np.unique(push)) < FEWEST_PUSHES:
        raise FitError(
            "opening_mm and push_N of an inverted unit under two moments or more say what pushes "
            f"it: the data have {len(np.unique(push))}"
        )
    yielding, stroke = np.polyfit(push, opening, 1)  # pushes differ more, and are known better
    if yielding * np.ptp(push) > SMALLEST_RISE * stroke:
        raise FitError(f"push_N rises with opening_mm, by {1 / yielding:.3g} N/mm: a push falls")
    return 1.0 / max(-yielding, STIFFEST), float(stroke)


def _hinge(known: KnownStates, segment_height: float) -> float:
    """A first k_θ: moments of loads and pushes over rotations, N mm/rad."""
    pushed = np.where(np.isfinite(known.pushes[0]), known.pushes[0], 0.0) * segment_height
    turned = -known.angles[0]
    is_known = np.isfinite(turned) & (turned != 0.0)
    moment = (known.moments + pushed)[is_known]
    squares = float(turned[is_known] @ turned[is_known])
    stiffness = float(moment @ turned[is_known]) / squares if squares > 0.0 else 0.0
    return stiffness if stiffness > 0.0 else STUDY["hinge_stiffness"]
