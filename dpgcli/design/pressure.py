"""Pressure on a finger: its lines, how large domes are to it, and a history where one is given."""

from dataclasses import replace

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.equilibrium.contracts import take_lanes
from dpgcli.mechanics.curve import Spline
from dpgcli.records import dataclass


@dataclass(frozen=True)
class History:
    """Pressures (MPa) of each line in the order of its steps, (step, line).

    `time` (step,) is in s, None where the steps alone are known.
    """

    pressure: Array
    time: Array | None = None


@dataclass(frozen=True)
class Pressure:
    """The lines of a finger, by name, and how its domes answer to them.

    `line_of` (unit,) are places in `lines`. Of domes either the effective area (mm²) is known or
    the pressure (MPa) at which they snap, (1 or unit, 1 or design); the other is None, and follows
    from the dome's law. `shape` v is the volume that a dome has swept over its travel, both without
    dimension, with v' = 1 where E'/v' is largest on the way from rest; None where the area is the
    same all the way.
    """

    lines: tuple[str, ...]
    line_of: Indices
    effective_area: Array | None
    snap_pressure: Array | None
    shape: Spline | None = None
    history: History | None = None

    @property
    def units_by_line(self) -> dict[str, list[int]]:
        """Units of each line, counted from 1."""
        return {
            line: [1 + int(unit) for unit in np.flatnonzero(self.line_of == place)]
            for place, line in enumerate(self.lines)
        }

    def take_lanes(self, index: Indices) -> "Pressure":
        """The same of some designs."""
        area, snap = self.effective_area, self.snap_pressure
        return replace(
            self,
            effective_area=None if area is None else take_lanes(area, index),
            snap_pressure=None if snap is None else take_lanes(snap, index),
        )
