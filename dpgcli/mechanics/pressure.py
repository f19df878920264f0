"""Pressure on domes: it does the work p V while a dome sweeps the volume V.

A dome whose pole has travelled by u = ξ + c, with ξ the extension of its spring and c its travel
at contact, has swept V = A D v(u/D), with D the travel of the inverted dome. The effective area
A (mm²) is that of v' = 1; without a shape v the volume is A u.
"""

from functools import cache
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.equilibrium.contracts import Response, take_lanes
from dpgcli.mechanics.curve import Spline, spline_pieces
from dpgcli.mechanics.laws import Dome
from dpgcli.records import dataclass


class Swept(NamedTuple):
    """Volume V (mm³) that a dome has swept, dV/dξ (mm²) and d²V/dξ² (mm)."""

    volume: Array
    area: Array
    widening: Array


@dataclass(frozen=True)
class DomeVolumes:
    """How the volumes beside domes answer to their travel, arrays that broadcast to (unit, batch).

    `area` A in mm²; `shape` v is a function of u/D, None where the area is the same all the way.
    """

    area: Array
    shape: Spline | None = None

    def swept(self, extension: Array, dome: Dome) -> Swept:
        """The volume by the extension of the dome's spring (mm), counted from no travel.

        >>> one, none = np.ones(()), np.zeros(())
        >>> dome = Dome(one, none, 2.0 * one, none)
        >>> [float(part) for part in DomeVolumes(30.0 * one).swept(0.5 * one, dome)]
        [15.0, 30.0, 0.0]
        """
        travel = extension + dome.contact
        if self.shape is None:
            return Swept(self.area * travel, self.area + 0.0 * travel, 0.0 * travel)
        full = dome.stroke + dome.contact
        volume, slope, bend = self.shape(travel / full)
        return Swept(self.area * full * volume, self.area * slope, self.area / full * bend)

    def take_lanes(self, index: Indices) -> Self:
        """The same for some lanes of the batch."""
        return type(self)(take_lanes(self.area, index), self.shape)


@cache  # one for all designs that share a calibration
def volume_shape(travel: tuple[float, ...], slope: tuple[float, ...]) -> Spline:
    """The volume v whose slope goes monotonically between those at travels, from 0 on.

    Beyond the ends the slope goes on as it is. Raises ValueError for fewer than two travels, or
    travels that do not increase.

    >>> shape = volume_shape((0.0, 1.0), (1.0, 1.0))
    >>> [round(float(part), 12) for part in shape(np.array(0.25))]
    [0.25, 1.0, 0.0]
    """
    from scipy.interpolate import CubicSpline, PchipInterpolator

    if len(travel) < 2 or np.any(np.diff(travel) <= 0.0):
        raise ValueError(f"travel: expected 2 or more increasing values: {travel}")
    areas = PchipInterpolator(travel, slope)
    volume = areas.antiderivative()
    knots = np.unique(np.concatenate([np.linspace(a, b, 4) for a, b in pairwise(travel)]))
    cubic = CubicSpline(knots, volume(knots) - volume(0.0), bc_type="natural")
    return Spline(knots, spline_pieces(cubic))


@dataclass(frozen=True)
class PressureWork:
    """The law of a pressure p (MPa) on domes, E = −p V; p of shape (1 or unit, 1 or batch)."""

    pressure: Array
    volumes: DomeVolumes
    dome: Dome

    def __call__(self, scalar: Array) -> Response:
        """Energy (mJ), force (N) and stiffness (N/mm) by the dome's extension."""
        volume, area, widening = self.volumes.swept(scalar, self.dome)
        return Response(-self.pressure * volume, -self.pressure * area, -self.pressure * widening)

    def take_lanes(self, index: Indices) -> Self:
        """The same law for some lanes of the batch."""
        dome = Dome(*(take_lanes(part, index) for part in self.dome))
        pressure = take_lanes(self.pressure, index)
        return type(self)(pressure, self.volumes.take_lanes(index), dome)
