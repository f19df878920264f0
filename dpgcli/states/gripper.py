"""Two mirrored fingers in the gripper's frame: approach along +x, symmetry plane y = 0."""

from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.design.scene import Gripper
from dpgcli.mechanics.coordinates import Stations


class GripperPose(NamedTuple):
    """Aperture (mm) and overlap, (state,), and the upper finger's nodes, mm.

    The lower finger is the mirror image, y → −y.
    """

    aperture: Array
    overlaps: Flags
    upper: Stations


def place_in_gripper(
    gripper: Gripper, layer_thickness: float | Array, nodes: Stations
) -> GripperPose:
    """Place a finger, whose nodes are given in its own frame, as the upper of two.

    The contact surface is the limiting layer's face, half its thickness (mm) inside the B
    nodes. The aperture is the distance of the two faces at the tips, negative once they have
    crossed; mirrored fingers overlap where any of one's outline is beyond the symmetry plane.

    >>> one = np.ones((1, 1))
    >>> straight = Stations(40.5 * one, 0.0 * one, 40.5 * one, 10.0 * one)
    >>> pose = place_in_gripper(Gripper(base_spacing=20.0, mounting_angle=0.0), 2.0, straight)
    >>> pose.aperture.tolist(), pose.overlaps.tolist()  # 20 − 2 · 2/2 mm
    ([18.0], [False])
    """
    upper = _placed(gripper, nodes)
    rise = upper.top_y - upper.base_y
    upright = rise / np.hypot(upper.top_x - upper.base_x, rise)
    face = upper.base_y - 0.5 * layer_thickness * upright
    lowest = np.minimum(face, upper.top_y).min(axis=0)
    return GripperPose(2.0 * face[-1], np.asarray(lowest < 0.0), upper)


def _placed(gripper: Gripper, nodes: Stations) -> Stations:
    cos, sin = np.cos(gripper.mounting_angle), np.sin(gripper.mounting_angle)
    offset = 0.5 * gripper.base_spacing
    return Stations(
        cos * nodes.base_x - sin * nodes.base_y,
        sin * nodes.base_x + cos * nodes.base_y + offset,
        cos * nodes.top_x - sin * nodes.top_y,
        sin * nodes.top_x + cos * nodes.top_y + offset,
    )
