"""`dpg fit`: spring constants from curves and tables."""

import typer

from dpgcli.cli.commands import add_command
from dpgcli.cli.fit.bistable import bistable
from dpgcli.cli.fit.finger import finger
from dpgcli.cli.fit.grid import grid
from dpgcli.cli.fit.hinge import hinge
from dpgcli.cli.fit.unit import unit

app = typer.Typer(
    help="Calibrate spring constants from curves, tables and known states.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
for _function in (bistable, hinge, unit, finger, grid):
    add_command(app, _function, "fit")
