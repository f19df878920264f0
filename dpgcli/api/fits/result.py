"""The result of a fit, and the arguments that all fits share."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Generic, Self, TypeAlias, TypeVar

from dpgcli.api.arguments import check_positive, figure_path, path_of
from dpgcli.api.inputs import keys_of, setting_texts
from dpgcli.api.tables import Table, TableResult
from dpgcli.arrays import Columns
from dpgcli.calibration.choices import Loss
from dpgcli.errors import Field, Message, UsageError
from dpgcli.files.calibration import Calibration, calibration_of, geometry_of, write_calibration
from dpgcli.files.output import Mark, check_outputs
from dpgcli.files.sections import Geometry
from dpgcli.records import dataclass
from dpgcli.states.columns import Column

T = TypeVar("T")
GeometryInput: TypeAlias = Geometry | Mapping[str, float] | Sequence[str] | None
"""Dimensions by key of a spec's geometry, or "key=value" texts."""

NO_GEOMETRY = Message(
    "no geometry given (by ",
    Field("geometry"),
    " or a spec): specs will treat the values as extrapolated",
)


@dataclass(frozen=True)
class FitResult(TableResult, Generic[T]):
    """A fit and the calibration that it makes.

    `found` is the fit itself, `columns` and `rows` its values with their errors, `warnings` what
    a user should know. `summarized` says how good it is, `drawing`, where there is one, draws it.
    `files` are those that the fit was made from.
    """

    found: T
    calibration: Calibration
    columns: tuple[Column, ...]
    rows: Columns
    summarized: Callable[[], Iterable[str]]
    warnings: tuple[str, ...]
    drawing: Callable[[Path], None] | None = None
    files: tuple[Path, ...] = ()

    @property
    def values(self) -> dict[str, float]:
        """Values of the lattice by key; none of a grid, which has them at its points."""
        given = {} if self.calibration.values is None else self.calibration.values.given()
        return {key: value.value for key, value in given.items()}

    @property
    def summary(self) -> tuple[str, ...]:
        """How good the fit is, in words; that of a finger is fitted again without each state."""
        return tuple(self.summarized())

    @property
    def table(self) -> Table:
        """A row for each value, or of a grid for each quantity."""
        return Table.of(self.columns, self.rows)

    def save(self, path: str | Path) -> None:
        """Write the calibration to a YAML file, which a spec can name.

        Raises OutputError where it cannot be written, or something else stands there, UsageError
        for a file that the fit was made from.
        """
        calibration = path_of("path", path)
        check_outputs(self.files, (calibration, Mark.CALIBRATION))
        write_calibration(calibration, self.calibration)

    def draw(self, path: str | Path) -> None:
        """Draw data, fit and residuals to a .svg or .png file; raises UsageError for a grid."""
        if self.drawing is None:
            raise UsageError("a grid has no figure")
        self.drawing(figure_path(path))

    def with_warnings(self, warnings: Iterable[str]) -> Self:
        """The result with its warnings in other words, in its calibration, too."""
        said = tuple(warnings)
        calibration = self.calibration.model_copy(update={"warnings": [str(w) for w in said]})
        return replace(self, calibration=calibration, warnings=said)


def fit_result(
    found: T,
    sections: Mapping[str, Any],
    rows: tuple[tuple[Column, ...], Columns],
    summarized: Callable[[], Iterable[str]],
    warnings: Iterable[str],
    drawing: Callable[[Path], None] | None = None,
    *,
    files: tuple[Path, ...],
) -> FitResult[T]:
    """A result whose calibration has these sections and warnings."""
    calibration = calibration_of(sections)
    result = FitResult(found, calibration, *rows, summarized, (), drawing, files)
    return result.with_warnings(warnings)


def geometry_from(
    geometry: GeometryInput, spec: str | Path | Mapping[str, Any] | None = None
) -> Geometry | None:
    """The geometry that a fit holds at: that of a spec, with values changed or added."""
    base = None if spec is None else keys_of(spec).finger.geometry
    return with_geometry(geometry, base)


def with_geometry(geometry: GeometryInput, base: Geometry | None) -> Geometry | None:
    """A base geometry with values changed or added."""
    texts = geometry_texts(geometry)
    return geometry_of(texts, base) if texts else base


def geometry_texts(geometry: GeometryInput) -> tuple[str, ...]:
    """Dimensions as "key=value" texts."""
    given = sizes(geometry) if isinstance(geometry, Geometry) else geometry
    return () if given is None else setting_texts(given, "geometry")


def sizes(geometry: Geometry | None) -> dict[str, float]:
    """The dimensions that are given, by key."""
    return {} if geometry is None else geometry.model_dump(exclude_none=True)


def warned(warnings: Iterable[str], geometry: Geometry | None, ignored: Sequence[str]) -> list[str]:
    """Warnings with those on a missing geometry and on columns that were not used."""
    unused = [f"columns not used: {', '.join(ignored)}"] if ignored else []
    return [*warnings, *([] if geometry else [NO_GEOMETRY]), *unused]


def check_loss(loss: Loss, scale: float | None) -> None:
    """Raise UsageError for a scale that a loss does not have."""
    if scale is not None and loss is Loss.LINEAR:
        robust = ": ", Field("loss"), " soft_l1, huber or cauchy"
        raise UsageError(Field("loss_scale"), " is for a robust loss", *robust)
    check_positive("loss_scale", scale)
