"""Two mirrored fingers in the gripper's frame: approach along +x, symmetry plane y = 0."""

from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.design.scene import Gripper
from dpgcli.mechanics.coordinates import Stations


class Grip(NamedTuple):
    """Aperture (mm) and overlap, (state,), and the upper finger's nodes; y → −y is the lower."""

    aperture: Array
    overlaps: Flags
    upper: Stations


def grip(gripper: Gripper, layer_thickness: float | Array, nodes: Stations) -> Grip:
    """Place a finger, whose nodes are given in its own frame, as the upper of two.

    The contact surface is the limiting layer's face, half its thickness (mm) inside the B
    nodes. The aperture is the distance of the two faces at the tips, negative once they have
    crossed; mirrored fingers overlap where any of one's outline is beyond the symmetry plane.
    """
    upper = _placed(gripper, nodes)
    rise = upper.top_y - upper.base_y
    upright = rise / np.hypot(upper.top_x - upper.base_x, rise)
    face = upper.base_y - 0.5 * layer_thickness * upright
    lowest = np.minimum(face, upper.top_y).min(axis=0)
    return Grip(2.0 * face[-1], np.asarray(lowest < 0.0), upper)


def _placed(gripper: Gripper, nodes: Stations) -> Stations:
    cos, sin = np.cos(gripper.mounting_angle), np.sin(gripper.mounting_angle)
    offset = 0.5 * gripper.base_spacing
    return Stations(
        cos * nodes.base_x - sin * nodes.base_y,
        sin * nodes.base_x + cos * nodes.base_y + offset,
        cos * nodes.top_x - sin * nodes.top_y,
        sin * nodes.top_x + cos * nodes.top_y + offset,
    )
