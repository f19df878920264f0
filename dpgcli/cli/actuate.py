"""`dpg actuate`: a finger followed through pressures, a row for each thing that happens."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dpgcli.cli.options import (
    Pressures,
    Quiet,
    Settings,
    SpecPath,
    check_plot,
    check_table_name,
)
from dpgcli.cli.printing import Format, print_rows
from dpgcli.cli.progress import under_way
from dpgcli.cli.streams import say

if TYPE_CHECKING:
    from dpgcli.api.actuate import ActuateResult

Start = Annotated[
    str, typer.Option("--from", metavar="PATTERN", help="Pattern to start from  [default: at rest]")
]
Cycles = Annotated[
    int, typer.Option("--cycles", metavar="N", help="Repeat the history, and report the drift")
]
Unstable = Annotated[
    bool, typer.Option("--unstable", help="Add the unstable branches to --output and --plot")
]
Output = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="FILE", help="Write the path to this Parquet file"),
]
Plot = Annotated[
    Path | None,
    typer.Option("--plot", metavar="FILE", help="Draw pressure against tip: a .svg or .png file"),
]


def actuate(
    spec: SpecPath,
    pressure: Pressures = None,
    start: Start = "",
    cycles: Cycles = 1,
    unstable: Unstable = False,
    settings: Settings = None,
    printed_as: Annotated[
        Format, typer.Option("--format", help="How to print events")
    ] = Format.TABLE,
    output: Output = None,
    plot: Plot = None,
    quiet: Quiet = False,
) -> None:
    """Follow a finger through pressures: what snaps and resets, and when."""
    from dpgcli.actuation.costs import history_announced
    from dpgcli.api.actuate import followed
    from dpgcli.api.histories import history_input
    from dpgcli.api.pressure import pressed_input
    from dpgcli.errors import ActuationError, UsageError
    from dpgcli.files.output import Mark, check_outputs

    if plot is not None:
        check_plot(plot)
    check_table_name(output)
    if unstable and output is None and plot is None:
        raise UsageError("--unstable adds points to --output and --plot: name a file")
    given = pressed_input(spec, settings or ())
    history = history_input(pressure, given.pressure)
    sources = (*given.given.files, *history.files)
    check_outputs(sources, (output, Mark.TABLE), (plot, Mark.FIGURE))
    expected = history_announced(given.pressed, history.history.pressure, cycles)
    if expected and not quiet:
        say(expected)
    try:
        with under_way("following the finger", quiet=quiet):
            found = followed(given, history, start, cycles, unstable=unstable)
    except ActuationError as error:
        _print(error.result, printed_as)
        raise
    if output is not None:
        found.save(output)
    if plot is not None:
        found.draw(plot)
    _print(found, printed_as)
    if not quiet:
        for line in found.summary:
            say(line)


def _print(found: "ActuateResult", printed_as: Format) -> None:
    """The events, before anything is said of them."""
    print_rows(found.columns, found.rows, printed_as)
    sys.stdout.flush()
