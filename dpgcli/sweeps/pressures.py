"""What pressure does to designs: thresholds of their units, and the states that pulses reach."""

from functools import cached_property

import numpy as np

from dpgcli.actuation.alone import Thresholds, thresholds_alone
from dpgcli.actuation.graph import Reached, reached_from_rest, stable_states
from dpgcli.actuation.pressed import TIE, Pressed
from dpgcli.arrays import Array, Indices
from dpgcli.design.pressure import Pressure
from dpgcli.records import dataclass
from dpgcli.states.patterns import inverted_units, texts
from dpgcli.states.units import UnitSolutions


@dataclass(frozen=True)
class PressedDesigns:
    """Some designs under pressure; each of what follows is found when it is asked for.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> finger = uniform_finger(2, **STUDY).changed(stroke=np.array([[3.5], [4.5]]))
    >>> line = Pressure(("A",), np.array([0, 0]), np.array([[31.61]]), None)
    >>> found = PressedDesigns(UnitSolutions.of(finger), line, 1)
    >>> found.n_reachable.tolist(), found.reachable_patterns.tolist()
    ([4], [b'00,01,10,11'])
    >>> found.smallest_gap.round(4).tolist()  # of the snap pressures, and of the others
    [0.0184]
    """

    units: UnitSolutions
    pressure: Pressure
    n_designs: int

    @cached_property
    def pressed(self) -> Pressed:
        """The fingers of the designs."""
        return Pressed.of(self.units, self.pressure)

    @cached_property
    def thresholds(self) -> Thresholds:
        """Pressures at which units by themselves snap and reset, (unit, design), MPa."""
        found = thresholds_alone(self.pressed)
        shape = self.units.finger.n_units, self.n_designs
        snap, reset = (np.broadcast_to(part, shape) for part in (found.snap, found.reset))
        return Thresholds(snap, reset, np.broadcast_to(found.furthest, self.n_designs))

    @cached_property
    def snap_and_reset(self) -> Array:
        """Snap and reset pressures (2, unit, design), NaN for units that hold but one state."""
        found = np.stack([self.thresholds.snap, self.thresholds.reset])
        return np.where(np.isnan(found).any(axis=0), np.nan, found)

    @cached_property
    def reached(self) -> Reached:
        """Which states pulses lead to from rest, and where more may be."""
        is_stable = stable_states(self.pressed, self.n_designs)
        reach = self.thresholds.reach
        return reached_from_rest(self.pressed, self.pressure.line_of, reach, is_stable)

    @property
    def n_reachable(self) -> Indices:
        """How many states pulses lead to from rest, that one among them, (design,)."""
        return np.asarray(self.reached.is_reached.sum(axis=1))

    @property
    def n_unknown_directions(self) -> Indices:
        """In how many directions searches failed, so that more states may be reached, (design,)."""
        return self.reached.n_unknown

    @property
    def reachable_patterns(self) -> np.ndarray[tuple[int], np.dtype[np.bytes_]]:
        """Their patterns in order, with commas between them, (design,)."""
        n_units = self.units.finger.n_units
        patterns = texts(inverted_units(np.arange(2**n_units, dtype=np.uint64), n_units))
        return np.array([b",".join(patterns[own].tolist()) for own in self.reached.is_reached])

    @property
    def smallest_gap(self) -> Array:
        """The smallest difference of two snap pressures, or of two reset pressures, of a line, MPa.

        Thresholds that are tied count as one; NaN where no line has two, (design,).
        """
        gap = np.full(self.n_designs, np.nan)
        for line in range(len(self.pressure.lines)):
            for values in (self.thresholds.snap, self.thresholds.reset):
                own = np.sort(values[self.pressure.line_of == line], axis=0)  # NaN last
                apart = np.diff(own, axis=0)
                apart = np.where(apart > TIE * np.abs(own[1:]), apart, np.nan)
                gap = np.fmin(gap, np.fmin.reduce(apart, axis=0, initial=np.nan))
        return gap
