"""Options that the fits share."""

from pathlib import Path
from typing import Annotated

import typer

from dpgcli.calibration.choices import MOST_RESAMPLES, Loss
from dpgcli.cli.printing import Format

Output = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="FILE", help="Write the calibration to this YAML file"),
]
Printed = Annotated[Format, typer.Option("--format", help="How to print rows")]
Plot = Annotated[
    Path | None,
    typer.Option(
        "--plot", metavar="FILE", help="Draw data, fit and residuals: a .svg or .png file"
    ),
]
Bootstrap = Annotated[
    int,
    typer.Option(
        "--bootstrap",
        metavar="N",
        min=0,
        max=MOST_RESAMPLES,
        help="95 % intervals from N resampled fits",
    ),
]
Seed = Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Seed of the resampling")]
LossOption = Annotated[Loss, typer.Option("--loss", help="How residuals count")]
LossScale = Annotated[
    float | None,
    typer.Option(
        "--loss-scale", help="Residual from which a robust loss counts less  [default: the data's]"
    ),
]
GeometryValues = Annotated[
    list[str] | None,
    typer.Option(
        "-g",
        "--geometry",
        metavar="KEY=VALUE",
        help="Where the values hold: a key of a spec's geometry; repeatable",
    ),
]
GeometrySpec = Annotated[
    Path | None,
    typer.Option("--spec", metavar="SPEC", help="Take the geometry from this spec's finger"),
]
ColumnTitles = Annotated[
    list[str] | None,
    typer.Option(
        "--column",
        metavar="NAME=TITLE",
        help="The file's title of a column, force_N=Load; -Load reverses it; repeatable",
    ),
]
Skip = Annotated[
    int | None,
    typer.Option(
        "--skip", metavar="N", min=0, help="Lines above the table's header  [default: found]"
    ),
]
Units = Annotated[
    list[str] | None,
    typer.Option(
        "--units", metavar="QUANTITY=UNIT", help="The file's unit, such as force=kN; repeatable"
    ),
]
ErrorsOfTargets = Annotated[
    list[str] | None,
    typer.Option(
        "--error",
        metavar="TARGET=NUMBER",
        help="Take this for the error of a target (mm, rad, N); repeatable  [default: estimated]",
    ),
]
