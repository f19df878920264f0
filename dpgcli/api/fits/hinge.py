"""`fit_hinge`: the stiffness of a hinge from moments over rotations."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from dpgcli.api.arguments import chosen, files_of
from dpgcli.api.data import check_resampling, table_choice
from dpgcli.api.fits.result import (
    FitResult,
    GeometryInput,
    check_loss,
    fit_result,
    geometry_from,
    warned,
)
from dpgcli.api.inputs import Texts
from dpgcli.calibration import hinge
from dpgcli.calibration.choices import Loss
from dpgcli.calibration.hinge import HingeFit
from dpgcli.errors import Field, UsageError
from dpgcli.files.calibration import DataFile
from dpgcli.files.calibration.results import fitted, method_of
from dpgcli.files.csv_file import Tabular, name_of
from dpgcli.files.measured import read_moments
from dpgcli.reports.fit_figures import draw_fit, hinge_figure
from dpgcli.reports.fits import hinge_summary, value_rows
from dpgcli.text import quoted


def fit_hinge(
    curve: Tabular,
    *,
    where: str | None = None,
    geometry: GeometryInput = None,
    spec: str | Path | Mapping[str, Any] | None = None,
    loss: str = "linear",
    loss_scale: float | None = None,
    bootstrap: int = 0,
    seed: int = 0,
    column: Texts = (),
    skip: int | None = None,
    units: Texts = (),
) -> FitResult[HingeFit]:
    """Fit k_θ (N mm/rad) to moments over rotations, and check that it is one number.

    `curve` has `moment_N_mm` and `rotation_rad`; `where`, "COLUMN=TEXT", chooses rows.
    Dimensions (`geometry`, or those of a `spec`) say where the value holds; `column`, `skip` and
    `units` are those of `fit_bistable`.
    Raises SpecError for wrong data, UsageError for wrong choices, FitError for a fit that fails.

    >>> fit = fit_hinge({"moment_N_mm": [12.1, 24.2], "rotation_rad": [0.5, 1.0]})
    >>> round(fit.values["hinge_stiffness_N_mm_per_rad"], 9)
    24.2
    """
    check_resampling(bootstrap, seed)
    if not isinstance(where, str | None):
        raise UsageError(Field("where"), f" {quoted(where)}: expected a text, COLUMN=TEXT")
    at = geometry_from(geometry, spec)
    data = read_moments(curve, where, table_choice(column, skip, units))
    weighted = chosen(Loss, "loss", loss)
    check_loss(weighted, loss_scale)
    found = hinge.fit_hinge(
        data.moment,
        data.rotation,
        loss=weighted,
        loss_scale=loss_scale,
        resamples=bootstrap,
        seed=seed,
    )
    method = method_of("moment", found.fit, bootstrap, seed)
    method += f", rows where {where}" if where else ""
    source = DataFile(file=name_of(curve), sha256=data.sha256, rows=found.fit.n_points)
    return fit_result(
        found,
        {**fitted(found.fit, "N mm", source), "method": method, "geometry": at},
        value_rows(found.fit),
        partial(hinge_summary, found),
        warned((*data.doubts, *found.fit.warnings), at, data.ignored),
        partial(draw_fit, hinge_figure(found, data, name_of(curve))),
        files=files_of(curve, spec),
    )
