"""One unit between rigid bars: energy, force and stiffness by its dome's extension.

Both corners open by m, so that the opening is x = 2H sin m, and the hinge's energy ½ k_θ (2m)².
Walls take the rest of the dome's extension y: w = y − x.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array
from dpgcli.equilibrium.banded import in_lanes
from dpgcli.equilibrium.contracts import Response
from dpgcli.mechanics import laws
from dpgcli.mechanics.finger import Finger

SHORT_OF_LEVER = 1.0 - 1e-9  # of 2H, where bars end all opening
LARGEST_TANGENT = 1e15  # of a corner's turn: beyond it all is 90 degrees
NEWTON_STEPS = 100  # for a turn; a handful does but where bars nearly end it


def rigid_unit(finger: Finger, extension: Array) -> Response:
    """Energy (mJ), force (N) and stiffness (N/mm) by the extension y (mm) of the dome's spring.

    E(y) + w²/(2 c_w) + ½ k_θ φ² with φ = 2m and w = c_w h', h' being the hinge's pull on the
    opening: hinge and wall are springs in series. Beyond the lever there is no well to ask for.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> unit = uniform_finger(1, **{**STUDY, "hinge_stiffness": 0.0})
    >>> print(rigid_unit(unit, np.array([[3.5]])).energy.round(8))  # ½ α k_b d²
    [[3.381735]]
    """
    if finger.has_walls:
        return turned_unit(finger, tangent_of(finger, extension)).response
    return _with_hinge(finger, extension, *_hinge(finger, extension))


class TurnedUnit(NamedTuple):
    """Extension y (mm), the response by it as of `rigid_unit`, and dy/dt, mm."""

    extension: Array
    response: Response
    rate: Array


def turned_unit(finger: Finger, tangent: Array) -> TurnedUnit:
    """A unit by the tangent t = tan m of the turn of either corner.

    y = 2H sin m + c_w h' is explicit in t and rises with it, where t by y takes a search. Bars that
    nearly end the opening are told apart by t, where all m are 90 degrees to rounding.
    """
    lever = 2.0 * finger.segment_height
    secant = np.sqrt(1.0 + tangent * tangent)
    turn, opening = np.arctan(tangent), lever * tangent / secant
    hinge = finger.hinge_stiffness / finger.segment_height**2
    pull = lever * hinge * turn * secant
    stiffness = hinge * secant * secant * (1.0 + turn * tangent)
    extension = opening + finger.wall_compliance * pull
    yields = 1.0 + finger.wall_compliance * stiffness
    energy, *derivatives = _with_hinge(finger, extension, turn, pull, stiffness / yields)
    response = Response(energy + 0.5 * finger.wall_compliance * pull * pull, *derivatives)
    return TurnedUnit(extension, response, lever * yields / secant**3)


def _with_hinge(
    finger: Finger, extension: Array, turn: Array, pull: Array, stiffness: Array
) -> Response:
    spring = finger.springs(extension)
    energy = spring.energy + laws.quadratic(2.0 * turn, finger.hinge_stiffness).energy
    return Response(energy, spring.force + pull, spring.stiffness + stiffness)


@in_lanes
def tangent_of(finger: Finger, extension: Array) -> Array:
    """The tangent t of the corners' turn of a unit between rigid bars whose dome extends by y, mm.

    The root of y(t) = 2H t/√(1+t²) + c_w h'(t), which rises with t: by Newton's method, kept
    between what is known to be below it and above. Without hinge or wall bars end all opening.
    """
    lever = 2.0 * finger.segment_height
    softness = 2.0 * finger.wall_compliance * finger.hinge_stiffness / finger.segment_height
    reached, lever, softness = np.broadcast_arrays(np.abs(extension), lever, softness)
    yields, within = softness > 0.0, reached < SHORT_OF_LEVER * lever
    share = np.where(yields, softness, np.inf)
    by_bars = np.where(within | ~yields, _tangent(reached / lever), LARGEST_TANGENT)
    by_walls = np.where(yields, np.maximum(1.0, 4.0 / np.pi * reached / share), np.inf)
    low, high = np.zeros(reached.shape), np.minimum(by_walls, by_bars)
    beyond = 2.0 / np.pi * (reached - lever) / share
    tangent = np.minimum(np.maximum(_tangent(reached / (lever + softness)), beyond), high)
    is_running = np.ones(reached.shape, bool)
    for _ in range(NEWTON_STEPS):
        secant, turn = np.sqrt(1.0 + tangent * tangent), np.arctan(tangent)
        excess = lever * tangent / secant + softness * turn * secant - reached
        slope = lever / secant**3 + softness * (1.0 + turn * tangent) / secant
        low = np.where(excess <= 0.0, tangent, low)
        high = np.where(excess >= 0.0, tangent, high)
        further = tangent - excess / slope
        is_running &= ~(np.abs(further - tangent) <= 1e-15 * tangent)  # what has arrived stays
        if not is_running.any():
            break
        inside = (further > low) & (further < high)
        middle = np.where(low > 0.0, np.sqrt(low * high), 0.5 * high)
        tangent = np.where(is_running, np.where(inside, further, middle), tangent)
    return np.asarray(np.copysign(tangent, extension))


def _tangent(sine: Array) -> Array:
    sine = np.minimum(sine, SHORT_OF_LEVER)
    return np.asarray(sine / np.sqrt(1.0 - sine * sine))


def _hinge(finger: Finger, opening: Array) -> tuple[Array, Array, Array]:
    """m (rad), the hinge's pull on the opening x = 2H sin m, N, and its stiffness, N/mm."""
    sine = opening / (2.0 * finger.segment_height)
    sine = np.minimum(sine, SHORT_OF_LEVER)  # beyond it there is no well to ask for
    half_turn, cosine = np.arcsin(sine), np.sqrt(1.0 - sine * sine)
    stiffness = finger.hinge_stiffness / finger.segment_height**2
    pull = 2.0 * stiffness * finger.segment_height * half_turn / cosine
    return half_turn, pull, stiffness / cosine**2 * (1.0 + half_turn * sine / cosine)


def single_units(finger: Finger) -> tuple[Finger, tuple[int, int]]:
    """Every unit of every design as an unloaded design of its own; number of units, of designs."""
    arrays = {**finger.arrays(), "branch": finger.branch}
    units, designs = np.broadcast_shapes(*(values.shape for values in arrays.values()))
    flat = {k: np.broadcast_to(v, (units, designs)).reshape(1, -1) for k, v in arrays.items()}
    # its parts are the whole finger's
    one = replace(finger.with_units([0]), **flat)  # type: ignore[arg-type]  # all arrays
    return one.unloaded, (units, designs)
