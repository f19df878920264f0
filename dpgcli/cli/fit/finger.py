"""`dpg fit finger`: lattice values from known states of a whole finger."""

from pathlib import Path
from typing import Annotated

import typer

from dpgcli.calibration.choices import FITTED_BY_DEFAULT, Loss, Target
from dpgcli.cli.fit.options import (
    Bootstrap,
    ErrorsOfTargets,
    GeometryValues,
    LossOption,
    LossScale,
    Output,
    Plot,
    Printed,
    Seed,
)
from dpgcli.cli.fit.output import check_files, put_out, resampling
from dpgcli.cli.options import FirstStation, Quiet, Settings, SpecPath, TipOffset, frame_of
from dpgcli.cli.printing import Format


def finger(
    spec: SpecPath,
    data: Annotated[Path, typer.Argument(metavar="STATES", help="CSV of known states")],
    output: Output = None,
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free",
            metavar="KEY",
            help=f"Fit this value; repeatable  [default: {FITTED_BY_DEFAULT}]",
        ),
    ] = None,
    target: Annotated[
        list[Target] | None,
        typer.Option(
            help="What of the states to meet; repeatable  [default: tips; with free walls openings "
            "and pushes, too]"
        ),
    ] = None,
    error: ErrorsOfTargets = None,
    settings: Settings = None,
    first_station: FirstStation = None,
    tip_offset: TipOffset = None,
    geometry: GeometryValues = None,
    loss: LossOption = Loss.LINEAR,
    loss_scale: LossScale = None,
    bootstrap: Bootstrap = 0,
    seed: Seed = 0,
    printed_as: Printed = Format.TABLE,
    plot: Plot = None,
    quiet: Quiet = False,
) -> None:
    """Fit lattice values to tips or angles of known states."""
    from dpgcli.api.fits.finger import fit_finger
    from dpgcli.api.inputs import scene_input

    given = scene_input(spec, settings or ())
    check_files((data, *given.files), output, plot)
    frame = frame_of(first_station, tip_offset)
    with resampling(bootstrap, quiet=quiet):
        fit = fit_finger(
            given,
            data,
            free=tuple(free or (FITTED_BY_DEFAULT,)),
            target=target or (),
            error=error or (),
            first_station=frame[0],
            tip_offset=frame[1],
            geometry=geometry,
            loss=loss,
            loss_scale=loss_scale,
            bootstrap=bootstrap,
            seed=seed,
        )
    put_out(fit, output, plot, printed_as, quiet)
