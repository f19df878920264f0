"""One unit between rigid bars: energy, force and stiffness by its dome's extension.

Both corners open by m, so that the opening is x = 2H sin m, and the hinge's energy ½ k_θ (2m)².
Walls take the rest of the dome's extension y: w = y − x.
"""

from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array
from dpgcli.equilibrium.contracts import Response
from dpgcli.mechanics import laws
from dpgcli.mechanics.finger import Finger

SHORT_OF_LEVER = 1.0 - 1e-9  # of 2H, where bars end all opening
NEWTON_STEPS = 60  # for an opening; a handful does but where bars nearly end it


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
        return turned_unit(finger, turn_of(finger, extension)).response
    return _with_hinge(finger, extension, *_hinge(finger, extension))


class TurnedUnit(NamedTuple):
    """Extension y (mm), the response by it as of `rigid_unit`, and dy/dm, mm/rad."""

    extension: Array
    response: Response
    rate: Array


def turned_unit(finger: Finger, turn: Array) -> TurnedUnit:
    """A unit by the turn m (rad) of either corner.

    y = 2H sin m + c_w h' is explicit in m and rises with it, where m by y takes a search.
    """
    lever = 2.0 * finger.segment_height
    opening = lever * np.sin(turn)
    turn, pull, stiffness = _hinge(finger, opening)
    extension = opening + finger.wall_compliance * pull
    yields = 1.0 + finger.wall_compliance * stiffness
    energy, *derivatives = _with_hinge(finger, extension, turn, pull, stiffness / yields)
    response = Response(energy + 0.5 * finger.wall_compliance * pull * pull, *derivatives)
    return TurnedUnit(extension, response, lever * np.cos(turn) * yields)


def _with_hinge(
    finger: Finger, extension: Array, turn: Array, pull: Array, stiffness: Array
) -> Response:
    spring = finger.springs(extension)
    energy = spring.energy + laws.quadratic(2.0 * turn, finger.hinge_stiffness).energy
    return Response(energy, spring.force + pull, spring.stiffness + stiffness)


def turn_of(finger: Finger, extension: Array) -> Array:
    """The turn m (rad) of either corner of a unit with rigid bars whose dome extends by y (mm).

    Walls take the rest: y − x = c_w h'(x), h' being the hinge's pull on the opening. With
    x = 2H sin m, and times cos m, nothing in it grows without bound where bars end the opening:
    (y − 2H sin m) cos m = 2 m c_w k_θ/H, whose left side less the right falls from m = 0 to its
    root. Newton's method, kept between what is known to be below the root and above it.
    """
    lever = 2.0 * finger.segment_height
    softness = 2.0 * finger.wall_compliance * finger.hinge_stiffness / finger.segment_height
    reached, lever, softness = np.broadcast_arrays(np.abs(extension), lever, softness)
    low, high = np.zeros(reached.shape), np.full(reached.shape, 0.5 * np.pi)
    turn = np.arcsin(np.minimum(reached / (lever + softness), SHORT_OF_LEVER))
    is_running = np.ones(reached.shape, bool)
    for _ in range(NEWTON_STEPS):
        sine, cosine = np.sin(turn), np.cos(turn)
        excess = (reached - lever * sine) * cosine - softness * turn
        slope = -lever * cosine * cosine - (reached - lever * sine) * sine - softness
        low = np.where(excess >= 0.0, turn, low)
        high = np.where(excess <= 0.0, turn, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            further = turn - excess / slope
        is_running &= ~(np.abs(further - turn) <= 1e-15 * turn)  # what has arrived stays
        if not is_running.any():
            break
        inside = (further > low) & (further < high)
        further = np.where(inside, further, 0.5 * (low + high))
        turn = np.where(is_running, further, turn)
    return np.asarray(np.copysign(turn, extension))


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
    return finger.with_units([0]).changed(**flat, end_moment=np.zeros((1, 1))), (units, designs)
