"""Solutions of single units: wells, barriers and openings, before any pattern is solved."""

from functools import cached_property

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.contracts import take_lanes
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.states.crossing import fewest_in_loop
from dpgcli.states.guess import FirstOrder, first_order
from dpgcli.states.wells import Wells, inverted_wells

LARGEST_TURN = 0.05  # of a unit's own angle: bars that turn it further are soft
LARGEST_STRAIN = 0.05  # of a bar: what the first order says of it is no longer small
PLACES = 128  # of a dome's opening, at which its stiffness is looked at
WIDE_ANGLE = np.pi / 3.0  # of a corner, beyond which strokes come close to twice the height


@dataclass(frozen=True)
class UnitSolutions:
    """Solutions of single units: wells, barriers and openings, before any pattern is solved."""

    finger: Finger
    wells: Wells
    first_order: FirstOrder

    @property
    def are_soft(self) -> Flags:
        """Units that with rigid bars do not show what the finger does, (unit, design).

        Neighbors turn them, bars turn them too far or are strained too much, or give way before a
        stiff hinge turns, or a stroke leads to where only bars that give way can follow.
        """
        if self.finger.is_coupled:
            return np.ones((1, 1), bool)
        if self.finger.is_rigid:
            return np.zeros((1, 1), bool)
        finger, known = self.finger, self.first_order
        with np.errstate(invalid="ignore"):
            is_turned = known.turn > LARGEST_TURN * self.wells.angle
        is_strained = (np.abs(known.chord) > LARGEST_STRAIN * finger.segment_length) | (
            2.0 * np.abs(known.strut) > LARGEST_STRAIN * finger.segment_height
        )
        bars = finger.linear_stiffness * finger.segment_height**2
        is_stiff = finger.hinge_stiffness > LARGEST_TURN * bars  # its hinge, beside the bars
        is_out_of_reach = ~self.wells.exists & (self.wells.angle > WIDE_ANGLE)
        return is_turned | is_strained | is_stiff | is_out_of_reach

    @cached_property
    def holding_stiffness(self) -> Array:
        """A spring that keeps a dome anywhere on its curve, N/mm, (unit, 1 or design)."""
        finger = self.finger
        domes = finger.domes
        start = np.zeros((finger.n_units, 1)) - domes.contact
        way = domes.contact + 1.5 * domes.stroke
        share = np.linspace(0.0, 1.0, PLACES)[:, None, None]
        bend = finger.law.pulling.response(start + share * way, domes).stiffness
        return np.asarray(2.0 * np.abs(bend).max(axis=0))

    @property
    def shortest_loop(self) -> int | None:
        """Units that the finger needs to run into itself; None where it has too few.

        How far a unit between soft bars, or under a load, turns is not known before: any two may
        meet.
        """
        is_free = self.are_soft | self.finger.is_loaded
        turn = np.where(is_free, np.pi, 2.0 * self.wells.angle)
        return fewest_in_loop(turn, self.finger.segment_length, self.finger.n_units)

    @property
    def have_no_well(self) -> Flags:
        """Units that certainly have no second well, (unit, design).

        Between soft bars, or beside neighbors, one may exist where there is none between rigid
        ones, unless the dome by itself has none.
        """
        has_none, soft = ~self.wells.exists, self.are_soft
        if soft.any():
            has_none = has_none & (~soft | np.isnan(self.finger.law.rests(self.finger.domes).well))
        return has_none

    @classmethod
    def of(cls, finger: Finger) -> "UnitSolutions":
        wells = inverted_wells(finger)
        finger = finger.with_branches(wells.extension)
        return cls(finger, wells, first_order(finger, wells))

    def section(self, first: int, stop: int) -> "UnitSolutions":
        """Units first+1 … stop, counted from the base, with all that is known of them."""
        return UnitSolutions(
            self.finger.section(first, stop),
            self.wells.section(first, stop),
            self.first_order.section(first, stop),
        )

    def take_lanes(self, index: Indices) -> "UnitSolutions":
        """One design for each lane, by index, so that designs and patterns share a batch."""
        taken = UnitSolutions(
            self.finger.take_lanes(index),
            self.wells.take_lanes(index),
            self.first_order.take_lanes(index),
        )
        known = self.__dict__.get("holding_stiffness")
        if known is not None:
            taken.__dict__["holding_stiffness"] = take_lanes(known, index)
        return taken
