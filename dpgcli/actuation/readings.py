"""What a finger is like in its shapes under pressure, all at once, and how far they differ."""

from functools import cached_property

import numpy as np

from dpgcli.actuation.pressed import Pressed, Shapes
from dpgcli.arrays import Array, Indices, total
from dpgcli.equilibrium.newton import Equilibrium, looked_at
from dpgcli.mechanics.coordinates import Stations
from dpgcli.records import dataclass
from dpgcli.states.gripper import GripperPose, place_in_gripper
from dpgcli.states.patterns import texts
from dpgcli.states.solved import Surroundings, all_nodes


@dataclass(frozen=True)
class Readings:
    """Quantities of shapes, each computed when asked for, arrays (…, shape)."""

    pressed: Pressed
    shapes: Shapes
    around: Surroundings

    @cached_property
    def pose(self) -> Array:
        """Tip x, y (mm) and angle (rad), (3, shape)."""
        return self.pressed.coordinates.tip(self.shapes.coordinates)[0]

    @cached_property
    def openings(self) -> Array:
        """Openings of the units at their domes' axes, mm, (unit, shape)."""
        return self.pressed.coordinates.openings(self.shapes.coordinates)

    @cached_property
    def travels(self) -> Array:
        """Travels of the domes' poles, mm, (unit, shape)."""
        return self.pressed.travels(self.shapes)

    @cached_property
    def potential_energy(self) -> Array:
        """Energy less the work of the pressures, mJ: what falls at an event."""
        return self.pressed.energy(self.shapes)

    @cached_property
    def energy(self) -> Array:
        """Energy of springs, hinges, walls and bars, mJ: without pressure that of the state."""
        pressed, domes = self.pressed, self.pressed.finger.domes
        swept = pressed.volumes.swept(self.travels - domes.contact, domes).volume
        return np.asarray(self.potential_energy + total(self.shapes.pressure * swept))

    @cached_property
    def balance(self) -> Equilibrium:
        """Unbalanced forces and pivots of the shapes as they are."""
        return looked_at(self.pressed.as_touching(self.shapes), self.shapes.coordinates)

    @cached_property
    def nodes(self) -> Stations:
        """Positions of all nodes, the clamped ones first, mm, each (unit + 1, shape)."""
        return all_nodes(self.pressed.coordinates, self.shapes.coordinates)

    @cached_property
    def in_gripper(self) -> GripperPose | None:
        """The finger as the upper one of its gripper, if it has one."""
        around = self.around
        if around.gripper is None:
            return None
        return place_in_gripper(around.gripper, around.layer_thickness, self.nodes)


@dataclass(frozen=True)
class Drift:
    """How far shapes that should be the same are apart, mm at most: the tip, and any node.

    `patterns` are those in which cycles end, in order, each once.
    """

    tip: float
    nodes: float
    patterns: tuple[str, ...]


def drift(readings: Readings, ends: Indices) -> Drift:
    """How far the ends of cycles are from the first that ended in the same pattern."""
    nodes = np.stack(readings.nodes)[..., ends]  # (4, unit + 1, cycle)
    tip = readings.pose[:2, ends]
    patterns = texts(readings.shapes.inverted[:, ends]).astype(str).tolist()
    first = [patterns.index(pattern) for pattern in patterns]
    apart, tips = np.abs(nodes - nodes[..., first]), np.abs(tip - tip[:, first])
    return Drift(float(tips.max()), float(apart.max()), tuple(dict.fromkeys(patterns)))
