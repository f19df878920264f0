"""The keys of a calibration file, their types and their meaning.

Each description says what is expected: it is what a wrong value is answered with.
"""

from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Generic, Literal, TypeVar

from pydantic import Field

from dpgcli.design import calibrations
from dpgcli.files.sections import (
    BarStiffness,
    Bounded,
    Fraction,
    Geometry,
    NotNegative,
    Positive,
    Section,
)

if TYPE_CHECKING:
    from dpgcli.calibration.grid import FittedGridLaw

T = TypeVar("T")
Samples = Annotated[list[float], Field(min_length=1)]
Size = Annotated[float, Field(ge=0)]  # of an error: what data do not tell has a huge one
Positives = Annotated[list[Positive], Field(min_length=1)]


class Fitted(Section, Generic[T]):
    """A value, its standard error if it has one, and its 95 % bootstrap interval if asked for."""

    value: T = Field(description="a number in the unit of its key")
    standard_error: Size | None = Field(default=None, description="a number >= 0")
    interval: Annotated[list[float], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="two numbers, the lower one first"
    )


# Classes of their own, since processes know a class by its name, and Fitted[Positive] has none.
class FittedPositive(Fitted[Positive]):
    """A fitted length or stiffness."""


class FittedNotNegative(Fitted[NotNegative]):
    """A fitted stiffness that may be zero."""


class FittedFraction(Fitted[Fraction]):
    """A fitted share."""


class FittedBounded(Fitted[Bounded]):
    """A fitted value of either sign."""


class FittedBars(Fitted[BarStiffness]):
    """A fitted stiffness of bars, which may be rigid."""


class Values(Section):
    """Lattice values; keys as in a spec, and in the order of these fields."""

    bistable_stiffness_N_per_mm: FittedPositive | None = None
    force_linearity: FittedFraction | None = None
    stroke_mm: FittedPositive | None = None
    hinge_stiffness_N_mm_per_rad: FittedNotNegative | None = None
    segment_height_mm: FittedPositive | None = None
    segment_length_mm: FittedPositive | None = None
    linear_stiffness_N_per_mm: FittedBars | None = None
    wall_compliance_mm_per_N: FittedNotNegative | None = None
    hinge_coupling_N_mm_per_rad: FittedBounded | None = None


Measurements = Annotated[list[Bounded | None], Field(min_length=2)]
Stretch = Annotated[list[float], Field(min_length=2, max_length=2)]


class Curve(Section):
    """The dome's own energy over its travel, by travel."""

    travel_mm: Annotated[list[Bounded], Field(min_length=2)] = Field(
        description="numbers in mm up to 1e12, each larger than the one before"
    )
    energy_mJ: Annotated[list[Bounded], Field(min_length=2)] = Field(
        description="numbers in mJ up to 1e12, one for each travel"
    )
    opening_per_travel: Positive = Field(
        description="a number > 0: the opening of a unit over the travel of its dome"
    )
    unsampled_mm: list[Stretch] = Field(
        default_factory=list, description="pairs of travels in mm between which nothing is known"
    )
    pressure_MPa: Measurements | None = Field(
        default=None, description="numbers in MPa, one for each travel, null where none is known"
    )
    volume_mm3: Measurements | None = Field(
        default=None,
        description="numbers in mm3 that the dome has swept, one for each travel, null where none "
        "is known",
    )
    snap_pressure_MPa: Positive | None = Field(
        default=None, description="a pressure > 0 in MPa: the largest before the dome snapped"
    )

    @property
    def known(self) -> calibrations.DomeCurve:
        """The value that designs are resolved with."""
        return calibrations.DomeCurve(
            self.travel_mm,
            self.energy_mJ,
            self.opening_per_travel,
            self.unsampled_mm,
            self.pressure_MPa,
            self.volume_mm3,
            self.snap_pressure_MPa,
        )


class ScalingLaw(Section):
    """A product of powers: value at the reference geometry, times (geometry/reference)^exponent."""

    at_reference: Annotated[float, Field(gt=0)] = Field(description="a number > 0")
    standard_error: Size | None = Field(
        default=None, description="a number >= 0, relative to the value"
    )
    exponents: dict[str, float] = Field(description="a number for each key of `over`")
    standard_errors: dict[str, Size] | None = Field(
        default=None, description="a number >= 0 for each key of `over`"
    )


class Grid(Section):
    """Quantities known at several geometries, and the way between them."""

    method: Literal["scaling", "interpolation"] = Field(description="scaling or interpolation")
    over: Annotated[list[str], Field(min_length=1)] = Field(
        description="keys of the geometry, at least one"
    )
    points: dict[str, Positives] = Field(
        description="lists of numbers > 0 by key, equally long, one list for each key of `over`"
    )
    reference: dict[str, Positive] | None = Field(
        default=None, description="a geometry: a number > 0 for each key of `over`"
    )
    scaling: dict[str, ScalingLaw] | None = Field(
        default=None, description="the law of each quantity, as the points have it"
    )
    leave_one_out: dict[str, Size] | None = Field(
        default=None, description="the largest relative error by quantity"
    )

    @cached_property
    def law(self) -> "FittedGridLaw":
        """The way between the points; made once for all designs that share the grid."""
        import numpy as np

        from dpgcli.calibration.choices import GridMethod
        from dpgcli.calibration.grid import FittedGridLaw, GridPoints

        geometry = np.array([self.points[key] for key in self.over]).T
        quantities = {k: np.array(v) for k, v in self.points.items() if k not in self.over}
        return FittedGridLaw(
            GridMethod(self.method), GridPoints(tuple(self.over), geometry, quantities)
        )

    @property
    def known(self) -> calibrations.Grid:
        """The value that designs are resolved with."""
        over = tuple(self.over)
        quantities = frozenset(self.points) - {*over}
        return calibrations.Grid(over, quantities, self.method == "scaling", self.law)


class Quality(Section):
    """How well the model meets the data."""

    n_points: Annotated[int, Field(ge=1)] = Field(description="a whole number from 1")
    r_squared: Annotated[float, Field(le=1)] | None = Field(
        default=None, description="a number up to 1"
    )
    rms_residual: Size | None = Field(default=None, description="a number >= 0")
    residual_unit: str | None = Field(default=None, description="a unit")
    left_out_rms: Size | None = Field(
        default=None, description="a number >= 0, relative to the deflection"
    )
    left_out_largest: Size | None = Field(
        default=None, description="a number >= 0, relative to the deflection"
    )

    @property
    def residual(self) -> str:
        """What is left of the data, in words; empty where nothing says it."""
        if self.rms_residual is None or self.residual_unit is None or self.n_points < 2:
            return ""
        return f"{self.rms_residual:.3g} {self.residual_unit} rms at {self.n_points} points"

    @property
    def leave_one_out(self) -> tuple[float, float] | None:
        """Root mean square and largest error of states, each predicted from the others."""
        if self.left_out_rms is None or self.left_out_largest is None:
            return None
        return self.left_out_rms, self.left_out_largest


class KnownError(Section):
    """Errors of one kind of output, as shares of it, and what it was compared with."""

    largest: Size = Field(description="a number >= 0, relative")
    rms: Size | None = Field(default=None, description="a number >= 0, relative")
    against: str = Field(description="what it was compared with, a line of text")


class KnownErrors(Section):
    """By output, as `dpg explain` lists them; of shapes as shares of the deflection."""

    shapes: KnownError | None = None
    energies_and_barriers: KnownError | None = None
    barriers: KnownError | None = None
    ground_stiffness: KnownError | None = None
    inverted_stiffness: KnownError | None = None
    stiffness_along_the_bars: KnownError | None = None
    pressures: KnownError | None = None
    forces: KnownError | None = None


class DataFile(Section):
    """A file that values come from."""

    file: str = Field(description="the name of a file")
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")] = Field(
        description="64 hexadecimal digits"
    )
    rows: Annotated[int, Field(ge=0)] = Field(description="a whole number from 0")


class Calibration(Section):
    """A calibration by `dpg fit`: values for one geometry, or a grid over several."""

    file: str | None = Field(default=None, description="the name of the file, once it is read")
    calibration_version: Literal[1] = Field(description="1: what this version of dpg reads")
    made_by: str = Field(description="the program and the versions behind its numbers")
    method: str = Field(description="one line of text")
    values: Values | None = Field(default=None, description="a section of fitted values")
    correlation: list[Samples] | None = Field(
        default=None, description="a symmetric matrix over the values that have errors"
    )
    geometry: Geometry | None = Field(default=None, description="a section of dimensions")
    curve: Curve | None = Field(default=None, description="the dome's energy over its travel")
    grid: Grid | None = Field(default=None, description="a section of points")
    quality: Quality | None = Field(default=None, description="a section")
    known_errors: KnownErrors | None = Field(
        default=None, description="a section of errors by output"
    )
    warnings: list[str] = Field(default_factory=list, description="a list of texts")
    sources: list[DataFile] = Field(default_factory=list, description="a list of files")

    @property
    def known(self) -> calibrations.Calibration:
        """The value that designs are resolved with."""
        values = {} if self.values is None else self.values.given()
        errors = {} if self.known_errors is None else self.known_errors.given()
        return calibrations.Calibration(
            self.file,
            {k: calibrations.Fitted(v.value, v.standard_error) for k, v in values.items()},
            {} if self.geometry is None else self.geometry.given(),
            self.correlation,
            None if self.curve is None else self.curve.known,
            None if self.grid is None else self.grid.known,
            None if self.quality is None else self.quality.leave_one_out,
            {key: calibrations.KnownError(**dict(error)) for key, error in errors.items()},
            "" if self.quality is None else self.quality.residual,
            tuple(self.warnings),
        )

    @property
    def uncertain(self) -> dict[str, float]:
        """Standard errors by key, of the values that have one; the order of `correlation`."""
        given = {} if self.values is None else self.values.given()
        return {k: v.standard_error for k, v in given.items() if v.standard_error is not None}
