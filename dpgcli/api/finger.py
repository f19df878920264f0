"""`uniform_finger`: a finger of equal units as a value, with the bounds that specs have."""

import math

from dpgcli.api.arguments import check_numbers, check_whole
from dpgcli.design.dimensions import LARGEST, MAX_UNITS, SMALLEST, STIFFEST
from dpgcli.errors import UsageError
from dpgcli.mechanics import finger as mechanics
from dpgcli.mechanics.finger import Finger
from dpgcli.text import quoted

BOUNDS = {  # where they are not those of a length, or of a stiffness
    "force_linearity": (0.0, 1.0),
    "hinge_stiffness": (0.0, LARGEST),
    "linear_stiffness": (SMALLEST, STIFFEST),
}


def uniform_finger(
    n_units: int,
    *,
    segment_length: float,
    segment_height: float,
    stroke: float,
    bistable_stiffness: float,
    force_linearity: float,
    hinge_stiffness: float,
    linear_stiffness: float = math.inf,
) -> Finger:
    """One finger of n equal units; mm, N/mm, N mm/rad. Bars are rigid unless they have a stiffness.

    Raises UsageError for what no spec could have: more than 64 units, a length that is none.

    >>> finger = uniform_finger(
    ...     3, segment_length=13.5, segment_height=10.75, stroke=3.5,
    ...     bistable_stiffness=12.84, force_linearity=0.043, hinge_stiffness=24.2)
    >>> finger.n_units, finger.is_rigid
    (3, True)
    """
    values = {
        "segment_length": segment_length,
        "segment_height": segment_height,
        "stroke": stroke,
        "bistable_stiffness": bistable_stiffness,
        "force_linearity": force_linearity,
        "hinge_stiffness": hinge_stiffness,
        "linear_stiffness": linear_stiffness,
    }
    check_units(n_units)
    for name, value in values.items():
        _check(name, value)
    return mechanics.uniform_finger(int(n_units), **{n: float(v) for n, v in values.items()})


def check_units(n_units: int) -> None:
    """Raise UsageError for what is no number of units."""
    check_whole(n_units=n_units)
    if n_units is None or not 1 <= n_units <= MAX_UNITS:
        expected = f": expected a whole number from 1 to {MAX_UNITS}"
        raise UsageError(f"n_units {quoted(n_units)}{expected}")


def _check(name: str, value: float) -> None:
    """Raise UsageError for what is no value of a finger; bars may be rigid."""
    check_numbers(**{name: value})
    low, high = BOUNDS.get(name, (SMALLEST, LARGEST))
    is_rigid = name == "linear_stiffness" and value == math.inf
    if value is None or not (low <= value <= high or is_rigid):
        or_rigid = ", or inf" * (name == "linear_stiffness")
        expected = f": expected a number from {low:g} to {high:g}{or_rigid}"
        raise UsageError(f"{name} {quoted(value)}{expected}")
