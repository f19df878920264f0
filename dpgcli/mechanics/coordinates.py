"""The common interface of a finger's coordinates: shapes, scales and measures."""

from typing import NamedTuple, Protocol

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.equilibrium.contracts import Coordinates, Measure
from dpgcli.equilibrium.potential import Potential
from dpgcli.mechanics.finger import Finger


class Internal(NamedTuple):
    """A shape by its bars and corners, each (unit, batch) or broadcasting to it.

    Extensions of the chord and of the far strut in mm; corner angles at the near and the
    far station in rad, positive where the dome side opens; how far walls have given way, mm.
    """

    chord: Array
    near_angle: Array
    far_angle: Array
    strut: Array
    wall: Array = np.zeros((1, 1))  # never written to


class Springs(NamedTuple):
    """Extension of every dome's spring (mm), (unit, batch); impossible shapes, (batch,).

    `is_folded` is true if any cell is `impossible`. `lever` is the extension by the opening of the
    near and of the far corner, mm/rad, (2, unit, batch): H in the straight finger, zero if a strut
    lies along the spring.
    """

    extension: Array
    is_folded: Flags
    lever: Array


class CellShape(NamedTuple):
    """The quantities that decide whether a cell can exist, broadcasting to (unit, batch).

    Lengths of the chord and of the far strut (mm), the corner angles (rad), and how far the
    dome's spring extends as the near and the far corner open (mm/rad).
    """

    chord: Array
    strut: Array
    near_angle: Array
    far_angle: Array
    near_lever: Array
    far_lever: Array


def impossible(cell: CellShape) -> Flags:
    """Shapes that the equations allow and no finger takes, (batch,).

    The energies know neither thickness nor contact, so their minima include

    - bars of no or negative length, turned inside out through their own ends
    - corners turned by 90° or more: a strut lies along the limiting layer or beyond it
    - struts that have crossed: opening one would shorten the dome's spring

    A cell without any of these is a quadrilateral whose sides do not cross (our derivation: both
    tops are above the chord then, so that only the struts could).

    >>> flat = np.zeros((1, 1))
    >>> angles = np.array([[0.3, 1.6]])  # the second is beyond 90°
    >>> impossible(CellShape(flat + 13.5, flat + 10.0, angles, flat, flat + 9.0, flat + 9.0))
    array([False,  True])
    """
    shortest = np.minimum(cell.chord, cell.strut).min(axis=0)
    turned = np.maximum(np.abs(cell.near_angle), np.abs(cell.far_angle)).max(axis=0)
    lever = np.minimum(cell.near_lever, cell.far_lever).min(axis=0)
    return np.asarray((shortest <= 0.0) | (turned >= 0.5 * np.pi) | (lever <= 0.0))


class Stations(NamedTuple):
    """Positions in mm of the nodes B_i (limiting layer) and T_i (dome axis), i = 1…n."""

    base_x: Array
    base_y: Array
    top_x: Array
    top_y: Array


class FingerCoordinates(Coordinates, Protocol):
    """A system of coordinates of a finger, of shape (size, batch)."""

    @property
    def finger(self) -> Finger: ...

    @property
    def opening(self) -> Measure:
        """Opening x of every unit at its dome's axis, mm."""

    @property
    def dome(self) -> Measure:
        """Extension of every dome's own spring, mm: the opening, and what its wall yields."""

    @property
    def walls(self) -> tuple[Measure, ...]:
        """The coordinates of walls that give way, mm; none of rigid ones."""

    @property
    def corners(self) -> tuple[Measure, Measure]:
        """Angles of the near and of the far corners, rad, positive where the dome side opens."""

    @property
    def bars(self) -> tuple[Measure, ...]:
        """Extensions of chords and of far struts, mm; none of rigid ones."""

    def position(self, axis: int) -> Measure:
        """The tip's x (axis 0) or y (axis 1), the last limiting-layer node, mm: one cell."""

    def center(self, axis: int, shares: Array) -> Measure:
        """The x or y of the center of the tops T_i by their shares (unit, 1 or batch), mm."""

    def of_shape(self, shape: Internal) -> Array:
        """The coordinates of a shape, (size, batch)."""

    def without_walls(self, values: Array) -> Array:
        """Rows of an array (size, …) over the coordinates that are not walls'."""

    def openings(self, coordinates: Array) -> Array:
        """Opening x of every unit, without what walls yield, mm, (unit, batch)."""

    def springs(self, coordinates: Array) -> Springs:
        """Extensions and levers of the bistable springs, and flags of impossible shapes."""

    def corner_moments(self, coordinates: Array, gradient: Array) -> Array:
        """Moments of the gradient about the near and the far corners, N mm, (2, unit, batch).

        The energy's derivative as a corner opens and turns all that lies beyond it. Stiff bars do
        no work in that, so that the rounding of their forces drops out.
        """

    def stations(self, coordinates: Array) -> Stations:
        """All node positions but the clamped ones, each (unit, batch)."""

    def tip(self, coordinates: Array) -> tuple[Array, Array]:
        """Tip x, y (mm) and angle (rad), shape (3, batch), and their exact Jacobian.

        The Jacobian, shape (size, 3, batch), is by coordinates.
        """

    def station_jacobian(self, coordinates: Array) -> Array:
        """Derivatives of all node positions by coordinates, shape (size, 4 n, batch)."""


FingerPotential = Potential[FingerCoordinates]
