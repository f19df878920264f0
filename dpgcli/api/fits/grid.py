"""`fit_grid`: quantities over geometries, as scaling laws or interpolated."""

from collections.abc import Container, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from dpgcli.api.arguments import chosen, files_of
from dpgcli.api.fits.result import (
    FitResult,
    GeometryInput,
    fit_result,
    geometry_from,
    geometry_texts,
    sizes,
)
from dpgcli.calibration.choices import GridMethod
from dpgcli.calibration.grid import FittedGridLaw, GridPoints
from dpgcli.errors import Field, UsageError
from dpgcli.files.calibration import DataFile
from dpgcli.files.calibration.results import grid_doubts, grid_of
from dpgcli.files.csv_file import Tabular, name_of
from dpgcli.files.measured import read_table
from dpgcli.reports.fits import grid_summary, quantity_rows


def fit_grid(
    table: Tabular,
    *,
    method: str = "scaling",
    geometry: GeometryInput = None,
    spec: str | Path | Mapping[str, Any] | None = None,
) -> FitResult[FittedGridLaw]:
    """Fit quantities over geometries, by products of powers or an "interpolation".

    `table` has columns that are keys of the geometry, and positive quantities. Its result's
    table tells how well each point follows from the others.
    Raises SpecError for wrong data, UsageError for wrong choices, FitError for points through
    which there is no law.

    >>> heights = [1.0, 2.0, 4.0]  # stroke = 0.5 mm at 1 mm, and grows as the height squared
    >>> grid = fit_grid({"dome_height_mm": heights, "stroke_mm": [0.5 * h**2 for h in heights]})
    >>> grid.table["exponent_dome_height_mm"].round(9).tolist()
    [2.0]
    """
    read = read_table(table)
    texts = geometry_texts(geometry)
    _check_apart(texts, (*read.over, *read.constant))
    shared = sizes(geometry_from(texts, spec))
    way = chosen(GridMethod, "method", method)
    law = FittedGridLaw(way, GridPoints(read.over, read.geometry, read.quantities))
    for key in read.quantities:
        law.at(key, law.points.reference[None])  # a spec will ask for no less
    elsewhere = {key: value for key, value in shared.items() if key not in read.over}
    source = DataFile(file=name_of(table), sha256=read.sha256, rows=len(read.geometry))
    return fit_result(
        law,
        {
            "method": f"{law.method} over {', '.join(read.over)}",
            "geometry": {**elsewhere, **read.constant} or None,
            "grid": grid_of(law),
            "sources": [source],
        },
        quantity_rows(law),
        partial(grid_summary, law, read),
        grid_doubts(law, read),
        files=files_of(table, spec),
    )


def _check_apart(texts: Sequence[str], columns: Container[str]) -> None:
    """Raise UsageError for dimensions that the table has itself."""
    for text in texts:
        key = text.partition("=")[0].strip()
        if key in columns:
            raise UsageError(Field("geometry"), f" {text}: the table has a column {key}")
