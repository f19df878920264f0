"""The frames of a gripper's fingers, in which bodies meet them."""

from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.design.bodies import Body, Disc
from dpgcli.design.scene import Gripper, Scene
from dpgcli.mechanics.mirror import Axis
from dpgcli.mechanics.obstacle import Obstacle


class FingerFrame(NamedTuple):
    """A finger's frame in the gripper's: angle (rad), base (mm) and side, 1 or −1 if mirrored.

    Angle and base are numbers, or arrays by lane.

    >>> upper, lower = frames(Gripper(base_spacing=60.0, mounting_angle=0.0))
    >>> lower.inside(np.array([40.0, -5.0])).tolist()  # 25 mm above the lower base
    [40.0, -25.0]
    """

    angle: float | Array
    offset: float | Array
    side: int

    def take_lanes(self, index: Indices) -> "FingerFrame":
        """The frames of some lanes; one for all stays."""
        angle, offset = (np.take(v, index) if np.ndim(v) else v for v in self[:2])
        return FingerFrame(angle, offset, self.side)

    def inside(self, point: Array) -> Array:
        """A point of the gripper's frame, (2, …), in the finger's."""
        shifted = np.stack((point[0], point[1] - self.side * self.offset))
        return self.along(shifted)

    def along(self, vector: Array) -> Array:
        """A direction of the gripper's frame, (2, …), in the finger's."""
        x, y = vector[0], self.side * vector[1]
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        return np.stack((cos * x + sin * y, cos * y - sin * x))

    def outside(self, vector: Array) -> Array:
        """A direction in the finger's frame, (2, …), in the gripper's."""
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        x, y = cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]
        return np.stack((x, self.side * y))

    def placed(self, point: Array) -> Array:
        """A point of the finger's frame, (2, …), in the gripper's."""
        x, y = self.outside(point)
        return np.stack((x, y + self.side * self.offset))

    @property
    def axis(self) -> Axis:
        """The axis of the gripper in the finger's frame."""
        normal = self.along(np.array([0.0, float(self.side)]))
        return Axis(normal.reshape(2, -1), np.reshape(self.offset, -1).astype(float))

    def obstacle(self, body: Body) -> Obstacle:
        """What a body is to the finger."""
        if isinstance(body, Disc):
            return Obstacle.disc(self.inside(body.center), body.radius)
        return Obstacle.polygon(self.inside(body.corners))


def begins_in_base(scene: Scene, body: Body) -> Flags:
    """Whether a body stands in the base of a finger, (design,), (1,) for a single one.

    Raises ValueError for a scene without the thickness of its layer.
    """
    if scene.layer_thickness is None:
        raise ValueError("the face of a finger needs the thickness of its layer")
    low, high = -0.5 * np.asarray(scene.layer_thickness), scene.finger.segment_height.max(axis=0)
    found = np.zeros(1, bool)
    for frame in frames(scene.gripper):
        if isinstance(body, Disc):
            x, y = frame.inside(body.center)
            beside = np.maximum(np.maximum(low - y, y - high), 0.0)
            found = found | ((np.hypot(x, beside) < body.radius) & (x < body.radius))
        else:
            found = found | _is_in(frame.inside(body.corners), low, high)
    return np.asarray(found)


def _is_in(corners: Array, low: Array, high: Array) -> Flags:
    """Whether polygons, (2, corner[, design]), meet struts from one y to another at x = 0."""
    import shapely  # that discs do not need

    low, high = np.broadcast_arrays(np.reshape(low, -1), np.reshape(high, -1))
    ends = np.stack((np.stack((0.0 * low, low)), np.stack((0.0 * high, high))))
    struts = shapely.linestrings(np.moveaxis(ends, -1, 0))
    areas = shapely.polygons(np.moveaxis(corners.reshape(2, corners.shape[1], -1), (0, 1), (2, 1)))
    return np.asarray(shapely.relate_pattern(struts, areas, "T********"))


def frames(gripper: Gripper | None) -> tuple[FingerFrame, ...]:
    """The frames of the upper and the lower finger; of one alone its own."""
    if gripper is None:
        return (FingerFrame(0.0, 0.0, 1),)
    angle, half = gripper.mounting_angle, 0.5 * gripper.base_spacing
    return FingerFrame(angle, half, 1), FingerFrame(angle, half, -1)
