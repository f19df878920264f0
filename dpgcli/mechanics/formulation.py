"""What both formulations of a finger offer: a potential, and the shape behind its coordinates."""

from typing import NamedTuple, Protocol

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import Potential


class Internal(NamedTuple):
    """A shape by its bars and corners, each (unit, batch) or broadcasting to it.

    Extensions of the chord and of the far strut in mm; corner angles at the near and the
    far station in rad, positive where the dome side opens.
    """

    chord: Array
    near_angle: Array
    far_angle: Array
    strut: Array


class Springs(NamedTuple):
    """Extension x (mm) of every bistable spring, (unit, batch), and what is no finger, (batch,).

    Folded through is a unit with a corner turned by 90° or more, or whose strut's opening
    would shorten the spring: minima of the equations, but struts and dome would have crossed.
    """

    extension: Array
    is_folded: Flags


class Stations(NamedTuple):
    """Positions in mm of the nodes B_i (limiting layer) and T_i (dome axis), i = 1…n."""

    base_x: Array
    base_y: Array
    top_x: Array
    top_y: Array


class Formulation(Potential, Protocol):
    """A finger's potential in some coordinates of shape (size, batch)."""

    @property
    def finger(self) -> Finger: ...

    def designs(self, index: Indices) -> "Formulation": ...

    def coordinates(self, shape: Internal) -> Array:
        """The coordinates of a shape, (size, batch)."""

    def openings(self, coordinates: Array) -> Array:
        """Extension x of every bistable spring, mm, (unit, batch)."""

    def springs(self, coordinates: Array) -> Springs:
        """Extensions, and whether any unit is folded through."""

    def stations(self, coordinates: Array) -> Stations:
        """All node positions but the clamped ones, each (unit, batch)."""

    def tip(self, coordinates: Array) -> tuple[Array, Array]:
        """Tip x, y (mm) and angle (rad), shape (3, batch), and their exact Jacobian.

        The Jacobian, shape (size, 3, batch), is by coordinates.
        """

    def station_jacobian(self, coordinates: Array) -> Array:
        """Derivatives of all node positions by coordinates, shape (size, 4 n, batch)."""
