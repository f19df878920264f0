"""Bodies that fingers meet: a disc, the jaws of a mechanism, a polygon."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dpgcli.arrays import Array, Indices

DIAMETER, PLACES = "disc.diameter_mm", ("at_x_mm", "at_y_mm")  # keys of a spec's object


@dataclass(frozen=True)
class Disc:
    """A round body: its center (2,) in the gripper's frame, and its radius, mm.

    Of a batch (2, design) and (design,).
    """

    center: Array
    radius: float | Array

    def with_value(self, key: str, column: Array) -> "Disc":
        """With values of designs, (design,), at a key of a spec's object.

        >>> disc = Disc(np.array([40.0, 0.0]), 20.0).with_value("at_x_mm", np.array([30.0, 50.0]))
        >>> disc.center.tolist(), disc.radius
        ([[30.0, 50.0], [0.0, 0.0]], 20.0)
        """
        if key == DIAMETER:
            return Disc(self.center, 0.5 * column)
        x, y = (column if key == own else at for own, at in zip(PLACES, self.center, strict=True))
        return Disc(np.stack(np.broadcast_arrays(x, y)), self.radius)

    def take_lanes(self, index: Indices) -> "Disc":
        """Those of some designs of a batch; one that is alike in all is repeated."""
        center, radius = np.reshape(self.center, (2, -1)), np.reshape(self.radius, -1)
        return Disc(*(_taken(values, index) for values in (center, radius)))

    @property
    def inner_radius(self) -> float | Array:
        """The radius of the largest circle in it, mm."""
        return self.radius

    @property
    def nearest_x(self) -> float | Array:
        """The least x of it, mm."""
        nearest: float | Array = self.center[0] - self.radius
        return nearest

    @property
    def is_mirrored(self) -> bool:
        """Whether both fingers of a gripper meet the same."""
        return bool((self.center[1] == 0.0).all())


@dataclass(frozen=True)
class Polygon:
    """A body with straight sides: a reference point (2,), and corners from there, (2, corner), mm.

    >>> Polygon(np.array([40.0, 0.0]), np.array([[0.0, 3.0, 3.0], [0.0, -4.0, 4.0]])).is_mirrored
    True
    """

    center: Array
    around: Array

    def take_lanes(self, index: Indices) -> "Polygon":
        """Itself: nothing in it is by design."""
        return self

    @cached_property
    def corners(self) -> Array:
        """The corners in the gripper's frame, (2, corner), mm."""
        return np.asarray(self.center[:, None] + self.around)

    @property
    def nearest_x(self) -> float:
        """The least x of it, mm."""
        return float(self.corners[0].min())

    @cached_property
    def inner_radius(self) -> float:
        """The radius of the largest circle in it, mm."""
        import shapely

        return float(shapely.maximum_inscribed_circle(shapely.Polygon(self.around.T)).length)

    @property
    def is_mirrored(self) -> bool:
        """Whether both fingers of a gripper meet the same."""
        mirrored = self.corners[:, ::-1] * np.array([[1.0], [-1.0]])
        n = mirrored.shape[1]
        turned = (np.roll(mirrored, shift, axis=1) for shift in range(n))
        return any(np.array_equal(self.corners, other) for other in turned)


@dataclass(frozen=True)
class Jaws:
    """Two flat plates along x with a gap between them, about a center (2,); mm.

    Fingers meet them from outside, as the sides of a block.

    >>> Jaws(np.array([40.0, 0.0]), gap=30.0, height=40.0).corners.tolist()
    [[20.0, 60.0, 60.0, 20.0], [-15.0, -15.0, 15.0, 15.0]]
    """

    center: Array
    gap: float
    height: float

    def take_lanes(self, index: Indices) -> "Jaws":
        """Itself: nothing in it is by design."""
        return self

    @cached_property
    def corners(self) -> Array:
        """The ends of the plates in the gripper's frame, the lower one's first, (2, 4), mm."""
        x, y = 0.5 * self.height, 0.5 * self.gap
        around = np.array([[-x, x, x, -x], [-y, -y, y, y]])
        return np.asarray(self.center[:, None] + around)

    @property
    def nearest_x(self) -> float:
        """The least x of it, mm."""
        return float(self.corners[0].min())

    @property
    def inner_radius(self) -> float:
        """The radius of the largest circle between them, mm."""
        return 0.5 * min(self.gap, self.height)

    @property
    def is_mirrored(self) -> bool:
        """Whether both fingers of a gripper meet the same."""
        return bool(self.center[1] == 0.0)


Body = Disc | Jaws | Polygon


def _taken(values: Array, index: Indices) -> Array:
    """Values of some lanes; of an array with one lane for all as many times."""
    one_for_all = values.shape[-1] == 1
    return np.take(values, 0 * index if one_for_all else index, axis=-1)
