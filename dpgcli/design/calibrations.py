"""Calibrations as values: numbers for one geometry, a scaling law over several, a dome's curve."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from dpgcli.arrays import Array, Flags

PUBLISHED = "published"
FINITE_ELEMENTS = "finite_elements"


class Fitted(NamedTuple):
    """A value in the unit of its key, and its standard error if it has one."""

    value: float
    standard_error: float | None = None


class Estimate(NamedTuple):
    """Values, their relative standard errors, and whether they lie inside the hull; (design,).

    NaN for an error where there are too few points to know.
    """

    value: Array
    relative_error: Array
    is_inside: Flags


class GridLaw(Protocol):
    """A way between geometries at which quantities are known."""

    def at(self, key: str, geometry: Array) -> Estimate:
        """A quantity at geometries (design, key), complex ones too."""


@dataclass(frozen=True)
class Grid:
    """Quantities over some keys of the geometry, by a scaling law or by interpolation."""

    over: tuple[str, ...]
    quantities: frozenset[str]
    is_scaling: bool
    law: GridLaw


@dataclass(frozen=True)
class DomeCurve:
    """The dome's own energy (mJ) over its travel (mm), and the travels between which none is known.

    `opening_per_travel` is the opening of a unit over the travel of its dome.
    """

    travel: Sequence[float]
    energy: Sequence[float]
    opening_per_travel: float
    gaps: Sequence[Sequence[float]] = ()


@dataclass(frozen=True, eq=False)
class Calibration:
    """Lattice values by key, for one geometry (by key) or over several, and the dome's curve.

    `correlation` is that of the values that have an error, in their order; `leave_one_out` are the
    root mean square and the largest error of tips of states, each predicted from the others, as
    shares of their deflection.
    """

    file: str | None
    values: Mapping[str, Fitted]
    geometry: Mapping[str, float]
    correlation: Sequence[Sequence[float]] | None = None
    curve: DomeCurve | None = None
    grid: Grid | None = None
    leave_one_out: tuple[float, float] | None = None

    def has(self, key: str) -> bool:
        """Whether it gives a key of the lattice, at one geometry or over several."""
        return key in self.values or (self.grid is not None and key in self.grid.quantities)

    def correlation_of(self, first: str, second: str) -> float:
        """Correlation of the errors of two values; those of a grid have none (assumed)."""
        keys = [key for key, fitted in self.values.items() if fitted.standard_error is not None]
        if first == second or self.correlation is None or not {first, second} <= set(keys):
            return float(first == second)
        return self.correlation[keys.index(first)][keys.index(second)]
