"""Calibrations as values: numbers for one geometry, a scaling law over several, a dome's curve."""

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import NamedTuple, Protocol

from dpgcli.arrays import Array, Flags
from dpgcli.records import dataclass

PUBLISHED = "published"
FINITE_ELEMENTS = "finite_elements"


class Fitted(NamedTuple):
    """A value in the unit of its key, and its standard error if it has one."""

    value: float
    standard_error: float | None = None


class Estimate(NamedTuple):
    """Values, their relative standard errors, and whether they lie inside the hull; (design,).

    NaN for an error where there are too few points to know. `is_sample` says which are those of a
    point itself: never by a scaling law.
    """

    value: Array
    relative_error: Array
    is_inside: Flags
    is_sample: Flags


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

    `opening_per_travel` is the opening of a unit over the travel of its dome. `pressure` (MPa) and
    `volume` (mm³) that the dome has swept are by travel too, None where they were not measured;
    `snap_pressure` (MPa) is the largest that the dome bore before it snapped.
    """

    travel: Sequence[float]
    energy: Sequence[float]
    opening_per_travel: float
    gaps: Sequence[Sequence[float]] = ()
    pressure: Sequence[float | None] | None = None
    volume: Sequence[float | None] | None = None
    snap_pressure: float | None = None


class KnownError(NamedTuple):
    """Errors of one kind of output, as shares of it: the largest, and their root mean square.

    `against` says what it was compared with; of states that a fit has left out it is empty.
    """

    largest: float
    rms: float | None = None
    against: str = ""

    @property
    def text(self) -> str:
        """The errors in percent.

        >>> KnownError(0.08, 0.056).text
        '5.6 % (rms), 8 % at most'
        """
        largest = f"{100.0 * self.largest:.2g} % at most"
        return largest if self.rms is None else f"{100.0 * self.rms:.2g} % (rms), {largest}"


@dataclass(frozen=True, eq=False)
class Calibration:
    """Lattice values by key, for one geometry (by key) or over several, and the dome's curve.

    `correlation` is that of the values that have an error, in their order; `leave_one_out` are the
    root mean square and the largest error of tips of states, each predicted from the others, as
    shares of their deflection. `known_errors` are by kind of output, as `outputs.Output.key`;
    `residual` is what a fit leaves of its data, in words; `warnings` are the fit's own.
    """

    file: str | None
    values: Mapping[str, Fitted]
    geometry: Mapping[str, float]
    correlation: Sequence[Sequence[float]] | None = None
    curve: DomeCurve | None = None
    grid: Grid | None = None
    leave_one_out: tuple[float, float] | None = None
    known_errors: Mapping[str, KnownError] = field(default_factory=dict)
    residual: str = ""
    warnings: Sequence[str] = ()

    @property
    def source(self) -> str:
        """The name of its file, or the key that it stands at."""
        return self.file or "finger.calibration"

    @property
    def shape_error(self) -> KnownError | None:
        """That of tips, as shares of their deflection."""
        if self.leave_one_out is None:
            return self.known_errors.get("shapes")
        rms, largest = self.leave_one_out
        return KnownError(largest, rms)

    def has(self, key: str) -> bool:
        """Whether it gives a key of the lattice, at one geometry or over several."""
        return key in self.values or (self.grid is not None and key in self.grid.quantities)

    def correlation_of(self, first: str, second: str) -> float:
        """Correlation of the errors of two values; those of a grid have none (assumed)."""
        keys = [key for key, fitted in self.values.items() if fitted.standard_error is not None]
        if first == second or self.correlation is None or not {first, second} <= set(keys):
            return float(first == second)
        return self.correlation[keys.index(first)][keys.index(second)]
