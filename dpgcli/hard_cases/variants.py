"""Variants of a finger among the hard cases, and what families make them of."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.reference.bodies import Body
from dpgcli.reference.gripper import Grip

LONG_FINGER = 30  # units, from which on one pattern has to do: extended precision is slow


@dataclass(frozen=True)
class Start:
    """The start of a search; by default, the pattern's own geometric guess.

    Else each inverted unit is opened by `strokes` strokes, or the corners of every unit, near
    and far, are at `corners` (rad).
    """

    strokes: float | None = None
    corners: tuple[float, float] | None = None


@dataclass(frozen=True)
class Variant:
    """A finger of one design with the patterns to solve; none stand for `few_patterns`.

    The solver gets lengths in another unit, with `scale` of these units in a mm. With a sign
    `pressure` the pressure on all domes goes that way, and what is asked for is where the first of
    them loses its place. With a `body` in the way the state is one against it, with a `grip` one of
    two fingers, and patterns are those of the upper and the lower one, such as "110/011".
    """

    label: str
    finger: Finger
    patterns: tuple[str, ...] = ()
    start: Start = Start()
    scale: float = 1.0
    pressure: int = 0
    body: Body | None = None
    grip: Grip | None = None


class Family(NamedTuple):
    """Variants of a base finger in one property."""

    name: str
    variants: Callable[[Finger], Iterator[Variant]]


def repeated(finger: Finger, n_units: int) -> Finger:
    """A finger of n units that repeats those of another in turn."""
    return finger.with_units([unit % finger.n_units for unit in range(n_units)])


def changed(finger: Finger, **values: Array | float) -> Finger:
    """The finger with other values, one for all units or one for each."""
    columns = {name: np.reshape(np.asarray(v, float), (-1, 1)) for name, v in values.items()}
    return finger.changed(**columns)


def rigid(finger: Finger) -> Finger:
    """The finger with bars that keep their lengths."""
    return changed(finger, linear_stiffness=np.inf)


def with_bars(finger: Finger, ratio: float) -> Finger:
    """The finger with bars so many times as stiff as its stiffest dome."""
    return changed(finger, linear_stiffness=ratio * finger.bistable_stiffness.max())


def few_patterns(n_units: int, *, with_ground: bool = False) -> tuple[str, ...]:
    """All units inverted, and every other one; of a long finger one unit in four.

    With all inverted a long finger would run into itself.

    >>> few_patterns(3), few_patterns(1, with_ground=True)
    (('111', '101'), ('1', '0'))
    """
    if n_units >= LONG_FINGER:
        return (("1000" * n_units)[:n_units],)
    ground = ("0" * n_units,) if with_ground else ()
    patterns = ("1" * n_units, ("10" * n_units)[:n_units], *ground)
    return tuple(dict.fromkeys(patterns))
