"""The shape behind a finger's internal coordinates: units, stations and bars.

With strut lengths S (near) and P (far), z = e + P sin b + S sin a and
v = P cos b − S cos a, the bistable spring has the length ℓ = √((L+z)² + v²) and, without
cancellation, the extension x = (2Lz + z² + v²)/(ℓ + L). τ is its angle to the chord.
"""

from typing import NamedTuple

import numpy as np

from dpgcli.arrays import Array
from dpgcli.mechanics.coordinates import Internal


def internal(coordinates: Array, is_rigid: bool) -> Internal:
    """Views of the rows e, a, b and s of an array (size, …) over the chain's coordinates.

    Rigid bars have no rows: their e and s are zero.

    >>> internal(np.array([[0.1], [0.2], [0.3], [0.4]]), is_rigid=True).near_angle.ravel()
    array([0.1, 0.3])
    """
    if is_rigid:
        rest = np.zeros((1,) * coordinates.ndim)
        return Internal(rest, coordinates[0::2], coordinates[1::2], rest)
    return Internal(*(coordinates[k::4] for k in range(4)))


class Cell(NamedTuple):
    """One unit's bistable spring: its extension and the first derivatives, (unit, batch).

    `along_*` is the unit vector of a bar or strut's motion along the spring, `across_*`
    across it: ∂x/∂e = along_chord, ∂x/∂a = S·along_near, ∂x/∂b = P·along_far,
    ∂x/∂s_near = −across_near, ∂x/∂s_far = across_far.
    """

    extension: Array
    length: Array
    near_strut: Array
    far_strut: Array
    along_chord: Array
    across_chord: Array
    along_near: Array
    across_near: Array
    along_far: Array
    across_far: Array


def cells(shape: Internal, length: Array, height: Array, is_rigid: bool) -> Cell:
    """Geometry of every unit of a shape, (unit, batch); L and H in mm, angles in rad.

    >>> zero, angle = np.zeros((1, 1)), np.full((1, 1), np.pi / 6.0)
    >>> shape = Internal(zero, angle, angle, zero)
    >>> cell = cells(shape, np.array([[13.5]]), np.array([[10.0]]), is_rigid=True)
    >>> round(float(cell.extension[0, 0]), 9)  # 2 H sin 30°
    10.0
    """
    chord, near, far, strut, _ = shape
    far_strut = height + strut
    near_strut = far_strut
    if not is_rigid:
        near_strut = np.empty_like(far_strut)
        near_strut[0] = height[0]  # the base strut is clamped
        near_strut[1:] = far_strut[:-1]
    sin_near, cos_near = np.sin(near), np.cos(near)
    sin_far, cos_far = np.sin(far), np.cos(far)
    z = far_strut * sin_far + near_strut * sin_near
    if not is_rigid:
        z += chord
    v = far_strut * cos_far - near_strut * cos_near
    span = length + z
    spring = np.sqrt(span * span + v * v)
    cos, sin = span / spring, v / spring
    return Cell(
        extension=(z * (length + span) + v * v) / (spring + length),
        length=spring,
        near_strut=near_strut,
        far_strut=far_strut,
        along_chord=cos,
        across_chord=sin,
        along_near=cos * cos_near + sin * sin_near,
        across_near=sin * cos_near - cos * sin_near,
        along_far=cos * cos_far - sin * sin_far,
        across_far=cos * sin_far + sin * cos_far,
    )


class Pose(NamedTuple):
    """Stations B_i (mm), directions of chords and angles of struts (rad), each (unit, batch)."""

    x: Array
    y: Array
    chord_cos: Array
    chord_sin: Array
    strut_angle: Array


def pose_of(shape: Internal, length: Array) -> Pose:
    """Stations (mm) and directions of a shape; L in mm.

    A corner that opens turns all beyond it by −1: struts are at τ_i = −Σ (a + b), chords at
    τ_(i−1) − a_i.

    >>> zero = np.zeros((1, 1))
    >>> pose = pose_of(Internal(zero, zero + np.pi / 2.0, zero, zero), np.array([[13.5]]))
    >>> round(float(pose.x[0, 0]), 9), round(float(pose.y[0, 0]), 9)  # straight down
    (0.0, -13.5)
    """
    chord, near, far, *_ = shape
    turned = np.cumsum(near + far, axis=0)
    direction = far - turned
    cos, sin = np.cos(direction), np.sin(direction)
    chord_length = length + chord
    x, y = np.cumsum(chord_length * cos, axis=0), np.cumsum(chord_length * sin, axis=0)
    return Pose(x, y, cos, sin, 0.0 - turned)  # no negative zero
