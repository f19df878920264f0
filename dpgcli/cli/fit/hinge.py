"""`dpg fit hinge`: the stiffness of a hinge from moments over rotations."""

from pathlib import Path
from typing import Annotated

import typer

from dpgcli.calibration.choices import Loss
from dpgcli.cli.fit.options import (
    Bootstrap,
    ColumnTitles,
    GeometrySpec,
    GeometryValues,
    LossOption,
    LossScale,
    Output,
    Plot,
    Printed,
    Seed,
    Skip,
    Units,
)
from dpgcli.cli.fit.output import check_files, put_out, resampling
from dpgcli.cli.options import Quiet
from dpgcli.cli.printing import Format


def hinge(
    curve: Annotated[
        Path, typer.Argument(metavar="CURVE", help="CSV: moment_N_mm and rotation_rad")
    ],
    output: Output = None,
    where: Annotated[
        str | None,
        typer.Option("--where", metavar="CONDITION", help="Only rows with a text: COLUMN=TEXT"),
    ] = None,
    column: ColumnTitles = None,
    skip: Skip = None,
    units: Units = None,
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
    from dpgcli.api.fits.hinge import fit_hinge

    check_files((curve, spec), output, plot)
    with resampling(bootstrap, quiet=quiet):
        fit = fit_hinge(
            curve,
            where=where,
            geometry=geometry,
            spec=spec,
            loss=loss,
            loss_scale=loss_scale,
            bootstrap=bootstrap,
            seed=seed,
            column=column or (),
            skip=skip,
            units=units or (),
        )
    put_out(fit, output, plot, printed_as, quiet)
