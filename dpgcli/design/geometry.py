"""From the geometry of a molded finger to the constants of its lattice.

Three kinds of rule, told apart because they deserve different trust: *published* ones are
stated by the study of the reference finger, *inferred* ones are ours and reproduce its published
numbers, and *finite-element* ones are power laws fitted to a grid of 3-D dome simulations.
Lengths in mm, moduli in MPa = N/mm^2, stiffness in N/mm or N mm/rad.

Dimensions are numbers or arrays that broadcast. The rules take complex ones too, so that a complex
step differentiates them.
"""

from typing import Any, TypeVar

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.design.scene import ORIGINS, Origin
from dpgcli.records import dataclass

Size = TypeVar("Size", float, Array)  # or complex ones

WALL_THICKNESS = 1.0
"""Thickness in mm of each of the two side walls of a unit cell (inferred)."""

FORCE_LINEARITY = 0.043
"""Published force linearity of the reference dome; kept at other geometries."""

HULL = {"dome_height": (4.5, 7.5), "dome_thickness": (0.5, 1.0)}
"""Range (mm) of the finite-element grid; beyond it the power laws are extrapolations."""


@dataclass(frozen=True)
class Reference:
    """The finger of the study, at which the springs were calibrated: mm, MPa, N/mm, N mm/rad.

    The snap pressure is not published: it is that of finite elements of this dome.
    """

    dome_height: float = 6.5
    dome_thickness: float = 0.75
    channel_width: float = 10.0
    limiting_layer_thickness: float = 1.5
    unit_separation: float = 3.0
    elastic_modulus: float = 26.0
    bistable_stiffness: float = 12.84
    hinge_stiffness: float = 24.2
    snap_pressure: float = 0.1495


REFERENCE = Reference()


def stroke(dome_height: Size, unit_separation: Size) -> Size:
    """Opening d = h - s of the inverted dome, in mm. Published.

    >>> stroke(6.5, 3.0)
    3.5
    """
    return dome_height - unit_separation


def chamber_width(unit_cell: Size) -> Size:
    """Inner width W_c = UC - 2 mm of the chamber: the cell less its two walls. Inferred.

    >>> chamber_width(22.0)
    20.0
    """
    return unit_cell - 2 * WALL_THICKNESS


def segment_height(chamber_width: Size, limiting_layer_thickness: Size) -> Size:
    """Height H = W_c/2 + t_L/2 in mm, from the middle of the layer to the dome axis. Inferred.

    >>> segment_height(20.0, 1.5)
    10.75
    """
    return chamber_width / 2 + limiting_layer_thickness / 2


def segment_length(chamber_length: Size, dome_thickness: Size, unit_separation: Size) -> Size:
    """Length L = L_c + 2 t + s of one segment, in mm: chamber, two walls, gap. Inferred.

    >>> segment_length(9.0, 0.75, 3.0)
    13.5
    """
    return chamber_length + 2 * dome_thickness + unit_separation


def bistable_stiffness(dome_height: Size, dome_thickness: Size, elastic_modulus: Size) -> Size:
    """Stiffness k_b in N/mm, proportional to E t^2.8 h^-0.25 from 12.84 at the reference.

    The reference number is published. The exponents are from finite elements: the energy of the
    inverted dome grows as t^2.8 h^1.75 and its opening as h.

    >>> bistable_stiffness(6.5, 0.75, 26.0)
    12.84
    """
    by_thickness: Size = (dome_thickness / REFERENCE.dome_thickness) ** 2.8
    by_height: Size = (dome_height / REFERENCE.dome_height) ** -0.25
    by_modulus = elastic_modulus / REFERENCE.elastic_modulus
    return REFERENCE.bistable_stiffness * by_modulus * by_thickness * by_height


def softness(elastic_modulus: Size) -> Size:
    """1/E in 1/MPa, by which everything yields that is of one material and of one shape.

    >>> softness(25.0)
    0.04
    """
    return 1.0 / elastic_modulus


def snap_pressure(dome_height: Size, dome_thickness: Size, elastic_modulus: Size) -> Size:
    """Pressure in MPa that inverts a dome, proportional to E t^2.5 h^1.2 from 0.1495.

    Number and exponents are from finite elements, of domes with a base of 16 mm on an annulus
    that is fixed at a radius of 10 mm: another rim changes it more than anything else.

    >>> snap_pressure(6.5, 0.75, 26.0)
    0.1495
    """
    by_thickness: Size = (dome_thickness / REFERENCE.dome_thickness) ** 2.5
    by_height: Size = (dome_height / REFERENCE.dome_height) ** 1.2
    by_modulus = elastic_modulus / REFERENCE.elastic_modulus
    return REFERENCE.snap_pressure * by_modulus * by_thickness * by_height


def hinge_stiffness(
    elastic_modulus: Size,
    channel_width: Size,
    limiting_layer_thickness: Size,
    unit_separation: Size,
) -> Size:
    """Stiffness k_theta in N mm/rad of one hinge, proportional to E W_ch t_L^3 / s from 24.2.

    The reference number is published. The scaling is inferred: a strip of the limiting layer bent
    over the gap has E W_ch t_L^3 / (12 s) = 24.4 at the reference. It is no derivation, since
    finite elements find much of the flexibility in the chamber floor.

    >>> hinge_stiffness(26.0, 10.0, 1.5, 3.0)
    24.2
    """
    return (
        REFERENCE.hinge_stiffness
        * (elastic_modulus / REFERENCE.elastic_modulus)
        * (channel_width / REFERENCE.channel_width)
        * (limiting_layer_thickness / REFERENCE.limiting_layer_thickness) ** 3
        * (REFERENCE.unit_separation / unit_separation)
    )


def dome_origin(
    dome_height: Array,
    dome_thickness: Array,
    elastic_modulus: Array | float = REFERENCE.elastic_modulus,
) -> Indices:
    """How far to trust the springs of a dome: at the reference, within the grid, or beyond it.

    Places in `ORIGINS`, one for each design.

    >>> [ORIGINS[place].value for place in dome_origin(np.array([6.5, 7.5, 8.0]), np.array(0.75))]
    ['calibrated', 'scaled', 'extrapolated']
    """
    height, thickness = np.real(dome_height), np.real(dome_thickness)
    (lowest, highest), (thinnest, thickest) = HULL["dome_height"], HULL["dome_thickness"]
    is_high = (lowest <= height) & (height <= highest)
    is_thick = (thinnest <= thickness) & (thickness <= thickest)
    origin = _scaled_unless(
        (height == REFERENCE.dome_height)
        & (thickness == REFERENCE.dome_thickness)
        & (np.real(elastic_modulus) == REFERENCE.elastic_modulus)
    )
    return np.where(is_high & is_thick, origin, ORIGINS.index(Origin.EXTRAPOLATED))


def hinge_origin(
    elastic_modulus: Array,
    channel_width: Array,
    limiting_layer_thickness: Array,
    unit_separation: Array,
) -> Indices:
    """Calibrated at the reference hinge, scaled anywhere else (no grid bounds the scaling).

    Places in `ORIGINS`, one for each design.

    >>> separations = np.array([3.0, 4.0])
    >>> [ORIGINS[place].value for place in hinge_origin(26.0, 10.0, 1.5, separations)]
    ['calibrated', 'scaled']
    """
    return _scaled_unless(
        (np.real(elastic_modulus) == REFERENCE.elastic_modulus)
        & (np.real(channel_width) == REFERENCE.channel_width)
        & (np.real(limiting_layer_thickness) == REFERENCE.limiting_layer_thickness)
        & (np.real(unit_separation) == REFERENCE.unit_separation)
    )


def _scaled_unless(is_reference: Any) -> Indices:
    calibrated, scaled = map(ORIGINS.index, (Origin.CALIBRATED, Origin.SCALED))
    return np.where(is_reference, calibrated, scaled)
