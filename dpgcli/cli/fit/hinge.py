"""`dpg fit hinge`: the stiffness of a hinge from moments over rotations."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dpgcli.calibration.choices import Loss
from dpgcli.cli.fit.common import (
    NO_GEOMETRY,
    Bootstrap,
    GeometrySpec,
    GeometryValues,
    LossOption,
    LossScale,
    Output,
    Plot,
    Printed,
    Seed,
    check_files,
    geometry_from,
    method_of,
    print_fit,
    quality_line,
    scale_of,
    tell,
    write,
)
from dpgcli.cli.options import Quiet
from dpgcli.cli.printing import Format

if TYPE_CHECKING:
    from dpgcli.calibration.hinge import HingeFit
    from dpgcli.files.measured import Moments


def hinge(
    curve: Annotated[
        Path, typer.Argument(metavar="CURVE", help="CSV: moment_N_mm and rotation_rad")
    ],
    output: Output = None,
    where: Annotated[
        str | None,
        typer.Option("--where", metavar="COLUMN=TEXT", help="Only rows with this text"),
    ] = None,
    geometry: GeometryValues = None,
    spec: GeometrySpec = None,
    loss: LossOption = Loss.LINEAR,
    loss_scale: LossScale = None,
    bootstrap: Bootstrap = 0,
    seed: Seed = 0,
    printed_as: Printed = Format.TABLE,
    plot: Plot = None,
    quiet: Quiet = False,
) -> None:
    """Fit k_theta to moments over rotations, and check that it is one number."""
    from dpgcli.calibration.hinge import fit_hinge
    from dpgcli.files.calibration import DataFile
    from dpgcli.files.calibration.results import fitted
    from dpgcli.files.measured import read_moments

    check_files((curve, spec), output, plot)
    at = geometry_from(geometry, spec)
    data = read_moments(curve, where)
    found = fit_hinge(
        data.moment,
        data.rotation,
        loss=loss,
        loss_scale=scale_of(loss, loss_scale),
        resamples=bootstrap,
        seed=seed,
    )
    warnings = [*_mixed(data), *found.fit.warnings, *([] if at else [NO_GEOMETRY])]
    if data.ignored:
        warnings.append(f"columns not used: {', '.join(data.ignored)}")
    method = method_of("moment", found.fit, bootstrap, seed)
    method += f", rows where {where}" if where else ""
    source = DataFile(file=curve.name, sha256=data.sha256, rows=found.fit.n_points)
    content = {"method": method, "geometry": at, "warnings": warnings}
    write(output, {**fitted(found.fit, "N mm", source), **content})
    if plot is not None:
        _draw(found, data, curve.name, plot)
    print_fit(found.fit, printed_as)
    if not quiet:
        near, far = found.secants
        secants = f"M/theta {near:.4g} N mm/rad in the inner third, {far:.4g} in the outer third"
        lines = [quality_line(found.fit, "N mm"), *([secants] if near != far else [])]
        tell(lines, warnings, output, plot)


def _mixed(data: "Moments") -> list[str]:
    """Columns whose texts tell rows of different hinges apart."""
    return [
        f"rows of {n} different {name} are fitted as one hinge: choose with --where '{name}=...'"
        for name, texts in data.texts.items()
        if (n := len(set(texts))) > 1
    ]


def _draw(found: "HingeFit", data: "Moments", name: str, path: Path) -> None:
    import numpy as np

    from dpgcli.report.fits import FitFigure, draw_fit

    ends = np.array([min(0.0, data.rotation.min()), max(0.0, data.rotation.max())])
    figure = FitFigure(
        title=f"{name}: hinge",
        x=data.rotation,
        observed=data.moment,
        residuals=found.fit.residuals,
        line=(ends, found.fit.values[0] * ends),
        x_label="rotation (rad)",
        y_label="moment (N mm)",
        unit="N mm",
    )
    draw_fit(figure, path)
