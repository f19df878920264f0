"""`dpg landscape`: the energy along the path of least barriers between two states."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.options import Quiet, Settings, SpecPath, TableFile, check_plot, check_table_name
from dpgcli.cli.printing import Format, print_rows
from dpgcli.cli.progress import under_way
from dpgcli.cli.streams import say

Start = Annotated[str, typer.Option("--from", metavar="PATTERN", help="State to start from: 00000")]
End = Annotated[str, typer.Option("--to", metavar="PATTERN", help="State to end in: 11111")]
Via = Annotated[
    list[str] | None,
    typer.Option("--via", metavar="PATTERN", help="State to pass on the way; repeatable, in order"),
]
Plot = Annotated[
    Path | None,
    typer.Option("--plot", metavar="FILE", help="Draw the energy on the way: a .svg or .png file"),
]


def landscape(
    spec: SpecPath,
    start: Start,
    end: End,
    via: Via = None,
    settings: Settings = None,
    printed_as: Annotated[
        Format, typer.Option("--format", help="How to print states and saddles")
    ] = Format.TABLE,
    output: TableFile = None,
    plot: Plot = None,
    quiet: Quiet = False,
) -> None:
    """Find the path of least barriers between two states, and the energy on it."""
    from dpgcli.api.inputs import scene_input
    from dpgcli.api.landscape import landscape_of
    from dpgcli.files.output import Mark, check_outputs

    if plot is not None:
        check_plot(plot)
    check_table_name(output)
    given = scene_input(spec, settings or ())
    check_outputs(given.files, (output, Mark.TABLE), (plot, Mark.FIGURE))
    with under_way("finding all barriers", quiet=quiet):
        found = landscape_of(given, start, end, via or ())
    if output is not None:
        found.save(output)
    if plot is not None:
        found.draw(plot)
    print_rows(found.columns, found.rows, printed_as)
    sys.stdout.flush()
    if not quiet:
        for line in found.summary:
            say(line)
