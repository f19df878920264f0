"""How far each unit is from losing its second well.

With rigid bars a unit has one exactly where r(u) < 0 for some u (see `states.wells`). At each
such u, r grows with α, with k_θ, and with d through φ/sin φ. So each of the three has a limit, a
fold r = r' = 0, that it must stay below, and none of them loses the well by falling (our
derivation). Elastic bars make room for the dome: with them the limits are a little higher. Walls
that give way, and a dome's own curve, may keep the well at any k_θ or d; α is no value of a curve.
"""

from collections.abc import Callable

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.states.rigid_unit import single_units
from dpgcli.states.wells import inverted_wells

BISECTIONS = 60
WIDENINGS = 20  # each by a factor of 4: no value that is a trillion times as large is a limit
SHORTEST = 1e-9  # strokes in heights: the hinge then turns as good as not at all

NAMES = ("force_linearity", "hinge_stiffness", "stroke")


@dataclass(frozen=True)
class Margins:
    """Of each unit's α (1), k_θ (N mm/rad) and d (mm), arrays of shape (unit,).

    The limits below which there is a second well, or how far the unit's own values are below
    them: negative where they would have to fall, −∞ where even that would not help; ∞ where no
    value loses the well.
    """

    force_linearity: Array
    hinge_stiffness: Array
    stroke: Array


def margins(finger: Finger) -> Margins:
    """How far each value of a finger of one design may rise; falling does no harm.

    >>> from dpgcli.mechanics.finger import uniform_finger
    >>> unit = uniform_finger(
    ...     1, segment_length=13.5, segment_height=10.75, stroke=3.5,
    ...     bistable_stiffness=12.84, force_linearity=0.043, hinge_stiffness=24.2)
    >>> print(margins(unit).force_linearity.round(6))
    [0.053468]
    """
    found, shape = limits(finger), (finger.n_units, 1)
    own = {name: np.broadcast_to(finger.arrays()[name], shape)[:, 0] for name in NAMES}
    return Margins(**{name: getattr(found, name) - own[name] for name in NAMES})


def limits(finger: Finger) -> Margins:
    """Where each value of a finger of one design is lost, all others kept; bars as if rigid.

    >>> from dpgcli.mechanics.finger import uniform_finger
    >>> unit = uniform_finger(
    ...     1, segment_length=13.5, segment_height=10.75, stroke=3.5,
    ...     bistable_stiffness=12.84, force_linearity=0.043, hinge_stiffness=0.0)
    >>> print(limits(unit).force_linearity.round(6))
    [0.111111]
    """
    if finger.n_designs != 1:
        raise ValueError(f"{finger.n_designs} designs, not one")
    units, _ = single_units(finger)
    height = units.segment_height[0]
    none = np.zeros_like(height)
    low = np.stack((none, none, SHORTEST * height))
    high = np.stack((none + 1.0, units.bistable_stiffness[0] * height**2, 4.0 * height))

    def are_bistable(values: Array) -> Flags:
        return _are_bistable(units, values)

    bounds = _wide(are_bistable, low, high)
    last = np.where(are_bistable(low), last_where(are_bistable, *bounds), -np.inf)
    return Margins(*np.broadcast_to(last, (len(last), finger.n_units)))


def _wide(hold: Callable[[Array], Flags], low: Array, high: Array) -> tuple[Array, Array]:
    """Bounds (value, unit) of limits, widened where the second well is not lost; α ends at 1."""
    wider = np.array([[1.0], [4.0], [4.0]])
    for _ in range(WIDENINGS):
        held = hold(high)
        if not held[1:].any():
            break
        low, high = np.where(held, high, low), np.where(held, high * wider, high)
    return low, high


def _are_bistable(units: Finger, values: Array) -> Flags:
    """Which units have a second well with one other value each, (value, unit), as in `NAMES`."""
    arrays = {
        name: np.broadcast_to(own, (1, units.n_designs)).repeat(len(NAMES), axis=0)
        for name, own in units.arrays().items()
    }
    for row, name in enumerate(NAMES):
        arrays[name][row] = values[row]
    flat = {name: own.reshape(1, -1) for name, own in arrays.items()}
    flat["branch"] = np.zeros((1, 1))
    wells = inverted_wells(units.with_units([0]).changed(**flat))
    return wells.exists.reshape(values.shape)


def last_where(hold: Callable[[Array], Flags], low: Array, high: Array) -> Array:
    """The last values between `low` and `high` at which something holds, by bisection.

    Infinite where it holds at `high`, too.

    >>> last_where(lambda x: x * x < 2.0, np.zeros(2), np.array([2.0, 1.0])).round(12).tolist()
    [1.414213562373, inf]
    """
    is_endless = hold(high)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        held = hold(middle)
        low, high = np.where(held, middle, low), np.where(held, high, middle)
    return np.where(is_endless, np.inf, low)
