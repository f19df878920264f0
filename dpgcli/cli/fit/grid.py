"""`dpg fit grid`: quantities over geometries, as scaling laws or interpolated."""

from pathlib import Path
from typing import Annotated

import typer

from dpgcli.calibration.choices import GridMethod
from dpgcli.cli.fit.options import GeometrySpec, GeometryValues, Output, Printed
from dpgcli.cli.fit.output import check_files, put_out
from dpgcli.cli.options import Quiet
from dpgcli.cli.printing import Format


def grid(
    table: Annotated[
        Path, typer.Argument(metavar="TABLE", help="CSV: keys of the geometry, and quantities")
    ],
    output: Output = None,
    method: Annotated[
        GridMethod, typer.Option("--method", help="Products of powers, or an interpolation")
    ] = GridMethod.SCALING,
    geometry: GeometryValues = None,
    spec: GeometrySpec = None,
    printed_as: Printed = Format.TABLE,
    quiet: Quiet = False,
) -> None:
    """Fit quantities over geometries, with the error at points that are left out."""
    from dpgcli.api.fits.grid import fit_grid

    check_files((table, spec), output, None)
    fit = fit_grid(table, method=method, geometry=geometry, spec=spec)
    put_out(fit, output, None, printed_as, quiet)
