"""`dpg fit unit`: hinge, walls and segment height of one unit, from its turns under end moments."""

from pathlib import Path
from typing import Annotated

import typer

from dpgcli.calibration.choices import HINGES, LEVER, WALLS, Loss, Target
from dpgcli.cli.fit.options import (
    Bootstrap,
    ErrorsOfTargets,
    GeometrySpec,
    GeometryValues,
    LossOption,
    LossScale,
    Output,
    Plot,
    Printed,
    Seed,
)
from dpgcli.cli.fit.output import check_files, put_out, resampling
from dpgcli.cli.options import Quiet
from dpgcli.cli.printing import Format


def unit(
    curve: Annotated[
        Path,
        typer.Argument(
            metavar="CURVE",
            help="CSV: unit, moment_N_mm, chamber2_angle_rad, opening_mm, push_N",
        ),
    ],
    output: Output = None,
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free",
            metavar="KEY",
            help=f"Fit this value; repeatable  [default: {HINGES}, {WALLS}, {LEVER}]",
        ),
    ] = None,
    target: Annotated[
        list[Target] | None,
        typer.Option(help="What to meet; repeatable  [default: angles, openings]"),
    ] = None,
    error: ErrorsOfTargets = None,
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
    """Fit k_theta, walls and segment height to what end moments turn a unit by."""
    from dpgcli.api.fits.unit import fit_unit

    check_files((curve, spec), output, plot)
    with resampling(bootstrap, quiet=quiet):
        fit = fit_unit(
            curve,
            free=tuple(free or (HINGES, WALLS, LEVER)),
            target=target or (),
            error=error or (),
            geometry=geometry,
            spec=spec,
            loss=loss,
            loss_scale=loss_scale,
            bootstrap=bootstrap,
            seed=seed,
        )
    put_out(fit, output, plot, printed_as, quiet)
