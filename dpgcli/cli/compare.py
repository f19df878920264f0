"""`dpg compare`: predictions beside finite elements or measurements."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.options import (
    FirstStation,
    Quiet,
    Settings,
    SpecPath,
    TipOffset,
    check_plot,
    frame_of,
)
from dpgcli.cli.printing import Format, print_rows
from dpgcli.cli.streams import say

Data = Annotated[Path, typer.Argument(metavar="DATA", help="CSV of known states")]
Shapes = Annotated[
    Path | None,
    typer.Option("--shapes", metavar="FILE", help="CSV of the layer's points: pattern, x_mm, y_mm"),
]
OtherCalibration = Annotated[
    str | None,
    typer.Option(
        "--calibration",
        metavar="NAME|FILE",
        help="Compare with its values, too: a file, published, finite_elements",
    ),
]


def compare(
    spec: SpecPath,
    data: Data,
    settings: Settings = None,
    calibration: OtherCalibration = None,
    shapes: Shapes = None,
    first_station: FirstStation = None,
    tip_offset: TipOffset = None,
    printed_as: Annotated[
        Format, typer.Option("--format", help="How to print rows")
    ] = Format.TABLE,
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot", metavar="FILE", help="Draw shapes and known tips: a .svg or .png file"
        ),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Compare predictions with finite elements or measurements."""
    from dpgcli.api.compare import compare
    from dpgcli.api.inputs import scene_input
    from dpgcli.files.output import Mark, check_outputs

    given, frame = scene_input(spec, settings or ()), frame_of(first_station, tip_offset)
    if plot is not None:
        check_plot(plot)
        sources = [Path(path) for path in (data, shapes, calibration) if path is not None]
        check_outputs([*sources, *given.files], (plot, Mark.FIGURE))
    found = compare(
        given,
        data,
        calibration=calibration,
        shapes=shapes,
        first_station=frame[0],
        tip_offset=frame[1],
    )
    print_rows(found.columns, found.rows, printed_as)
    if plot is not None:
        found.draw(plot)
    if not quiet:
        sys.stdout.flush()
        for line in found.summary:
            say(line)
