"""Bodies that fingers meet: a disc, the jaws of a mechanism, a polygon.

Of a batch of designs centers are (2, design), sizes (design,) and corners (2, corner, design).
"""

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, rotated
from dpgcli.design.loads import GRAVITY
from dpgcli.mechanics.aperture import ForceCurve
from dpgcli.records import dataclass

DIAMETER, GAP, HEIGHT = "disc.diameter_mm", "jaws.gap_mm", "jaws.height_mm"
COMPLIANCE = "compliance.stiffness_N_per_mm"
PLACES = "at_x_mm", "at_y_mm"  # these are keys of a spec's object
FRICTION, MASS = "friction", "mass_g"


@dataclass(frozen=True)
class Disc:
    """A round body: its center (2,) in the gripper's frame, and its radius, mm."""

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
        return Disc(_moved(self.center, key, column), self.radius)

    def take_lanes(self, index: Indices) -> "Disc":
        """Those of some designs of a batch; one that is alike in all is repeated."""
        return Disc(_centers(self.center, index), _sizes(self.radius, index))

    @property
    def name(self) -> str:
        """What it is, with its size; of a single one."""
        return f"a disc of {2.0 * self.radius:g} mm"

    @property
    def inner_radius(self) -> float | Array:
        """The radius of the largest circle in it, mm."""
        return self.radius

    @property
    def middle(self) -> Array:
        """Its center of area, (2,) or (2, design), mm."""
        return self.center

    @property
    def nearest_x(self) -> float | Array:
        """The least x of it, mm."""
        nearest: float | Array = self.center[0] - self.radius
        return nearest

    @property
    def is_mirrored(self) -> Flags:
        """Whether both fingers of a gripper meet the same, () or (design,)."""
        return np.asarray(self.center[1] == 0.0)


@dataclass(frozen=True)
class Polygon:
    """A body with straight sides: a reference point (2,), and corners from there, (2, corner), mm.

    Of bodies that have turned corners are (2, corner, design).

    >>> wedge = np.array([[0.0, 3.0, 3.0], [0.0, -4.0, 4.0]])
    >>> bool(Polygon(np.array([40.0, 0.0]), wedge).is_mirrored)
    True
    """

    center: Array
    around: Array

    def with_value(self, key: str, column: Array) -> "Polygon":
        """With values of designs, (design,), at a key of a spec's object: of its place."""
        return Polygon(_moved(self.center, key, column), self.around)

    def take_lanes(self, index: Indices) -> "Polygon":
        """Those of some designs of a batch; one that is alike in all is repeated."""
        around = self.around if self.around.ndim == 2 else _taken(self.around, index)
        return Polygon(_centers(self.center, index), around)

    def turned(self, angle: float | Array) -> "Polygon":
        """The same, turned counterclockwise about its reference point, by angles (design,), rad.

        >>> bar = Polygon(np.zeros(2), np.array([[0.0, 8.0, 8.0, 0.0], [0.0, 0.0, 2.0, 2.0]]))
        >>> bar.turned(0.5 * np.pi).corners.round(12).tolist()
        [[0.0, 0.0, -2.0, -2.0], [0.0, 8.0, 8.0, 0.0]]
        """
        around = self.around[..., None] if np.ndim(angle) else self.around
        return Polygon(self.center, rotated(around, angle))

    @property
    def name(self) -> str:
        """What it is, with its size; of a single one."""
        return f"a polygon of {self.around.shape[1]} corners"

    @cached_property
    def corners(self) -> Array:
        """The corners in the gripper's frame, (2, corner) or (2, corner, design), mm."""
        if self.center.ndim + 1 == self.around.ndim:
            return np.asarray(self.center[:, None] + self.around)
        around = self.around.reshape(*self.around.shape[:2], -1)
        return np.asarray(self.center.reshape(2, 1, -1) + around)

    @property
    def middle(self) -> Array:
        """Its center of area, (2,) or (2, design), mm."""
        return np.asarray((self.center.T + self._to_middle.T).T)

    @cached_property
    def _to_middle(self) -> Array:
        """The center of area from the reference point, (2,) or (2, design), mm."""
        first = self.around[:, :1]
        x, y = self.around - first
        after_x, after_y = np.roll(x, -1, axis=0), np.roll(y, -1, axis=0)
        area = x * after_y - after_x * y
        moment = np.stack(((x + after_x) * area, (y + after_y) * area)).sum(axis=1)
        return np.asarray(first[:, 0] + moment / (3.0 * area.sum(axis=0)))

    @property
    def outer_radius(self) -> float:
        """The distance of the furthest corner from its center of area, mm."""
        x, y = self.around - self._to_middle[:, None]
        return float(np.hypot(x, y).max())

    @property
    def nearest_x(self) -> float | Array:
        """The least x of it, mm."""
        nearest: float | Array = self.corners[0].min(axis=0)
        return nearest

    @cached_property
    def inner_radius(self) -> float:
        """The radius of the largest circle in it, mm."""
        import shapely

        first = self.around.reshape(*self.around.shape[:2], -1)[..., 0]  # of those that turn
        return float(shapely.maximum_inscribed_circle(shapely.Polygon(first.T)).length)

    @property
    def is_mirrored(self) -> Flags:
        """Whether both fingers of a gripper meet the same, () or (design,)."""
        x, y = self.corners[:, ::-1]
        mirrored = np.stack((x, -y))
        turned = (np.roll(mirrored, shift, axis=1) for shift in range(len(x)))
        are_alike = [(self.corners == other).all(axis=(0, 1)) for other in turned]
        return np.asarray(np.any(are_alike, axis=0))


@dataclass(frozen=True)
class Jaws:
    """Two flat plates along x with a gap between them, about a center (2,); mm.

    Fingers meet them from outside, as the sides of a block. With a `stiffness` k (N/mm) they move
    against a force k (a_0 − a) that keeps their aperture a at the gap a_0, with a `curve` against
    its force, which need not be none at a_0; without they are rigid.

    >>> Jaws(np.array([40.0, 0.0]), gap=30.0, height=40.0).corners.tolist()
    [[20.0, 60.0, 60.0, 20.0], [-15.0, -15.0, 15.0, 15.0]]
    """

    center: Array
    gap: float | Array
    height: float | Array
    stiffness: float | Array | None = None
    curve: ForceCurve | None = None

    def with_value(self, key: str, column: Array) -> "Jaws":
        """With values of designs, (design,), at a key of a spec's object."""
        sizes = {GAP: "gap", HEIGHT: "height", COMPLIANCE: "stiffness"}
        if key in sizes:
            own: dict[str, Any] = {sizes[key]: column}
            return replace(self, **own)
        return replace(self, center=_moved(self.center, key, column))

    def take_lanes(self, index: Indices) -> "Jaws":
        """Those of some designs of a batch; one that is alike in all is repeated."""
        gap, height = _sizes(self.gap, index), _sizes(self.height, index)
        stiffness = None if self.stiffness is None else _sizes(self.stiffness, index)
        return Jaws(_centers(self.center, index), gap, height, stiffness, self.curve)

    @property
    def name(self) -> str:
        """What it is, with its size; of a single one."""
        return f"jaws of {self.gap:g} x {self.height:g} mm"

    @cached_property
    def corners(self) -> Array:
        """The ends of the plates in the gripper's frame, the lower one's first, (2, 4), mm."""
        x, y = 0.5 * self.height, 0.5 * self.gap
        around = np.array([[-x, x, x, -x], [-y, -y, y, y]])
        return np.asarray(self.center[:, None] + around)

    @property
    def middle(self) -> Array:
        """Its center of area, (2,) or (2, design), mm."""
        return self.center

    @property
    def nearest_x(self) -> float | Array:
        """The least x of it, mm."""
        nearest: float | Array = self.corners[0].min(axis=0)
        return nearest

    @property
    def inner_radius(self) -> float | Array:
        """The radius of the largest circle between them, mm."""
        radius: float | Array = 0.5 * np.minimum(self.gap, self.height)
        return radius

    @property
    def is_mirrored(self) -> Flags:
        """Whether both fingers of a gripper meet the same, () or (design,)."""
        return np.asarray(self.center[1] == 0.0)


Body = Disc | Jaws | Polygon


def at_place(body: Body, center: Array, angle: float | Array = 0.0) -> Body:
    """A body with its reference point at another place, (2,) or (2, design) mm, turned there, rad.

    Only polygons turn.
    """
    turned = body.turned(angle) if isinstance(body, Polygon) else body
    return replace(turned, center=center)


def gives_way(body: Body | None) -> bool:
    """Whether a body is jaws that move when they are pushed."""
    return isinstance(body, Jaws) and (body.stiffness is not None or body.curve is not None)


@dataclass(frozen=True)
class Friction:
    """Friction between a body and fingers: its coefficient, and the body's mass, g, if known.

    Numbers, or arrays by design.
    """

    coefficient: float | Array
    mass: float | Array | None = None

    @property
    def weight(self) -> float | Array | None:
        """The weight of the body, N, if its mass is known."""
        return None if self.mass is None else GRAVITY * self.mass

    def with_value(self, key: str, column: Array) -> "Friction":
        """With values of designs, (design,), at a key of a spec's object."""
        return replace(self, **{"coefficient" if key == FRICTION else "mass": column})

    def take_lanes(self, index: Indices) -> "Friction":
        """That of some designs of a batch; one that is alike in all is repeated."""
        mass = None if self.mass is None else _sizes(self.mass, index)
        return Friction(_sizes(self.coefficient, index), mass)


def _moved(center: Array, key: str, column: Array) -> Array:
    """Centers with values of designs, (design,), at the key of a part of their place."""
    assert key in PLACES, f"no key of this body: {key}"
    x, y = (column if key == own else at for own, at in zip(PLACES, center, strict=True))
    return np.stack(np.broadcast_arrays(x, y))


def _centers(center: Array, index: Indices) -> Array:
    """Centers of some designs, (2, design); one for all as many times."""
    return _taken(center.reshape(2, -1), index)


def _sizes(size: float | Array, index: Indices) -> Array:
    """Sizes of some designs, (design,); one for all as many times."""
    return _taken(np.reshape(size, -1), index)


def _taken(values: Array, index: Indices) -> Array:
    return np.take(values, 0 * index if values.shape[-1] == 1 else index, axis=-1)
