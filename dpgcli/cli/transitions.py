"""`dpg transitions`: what first happens to every stable state under pressure."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.options import (
    NumberOfDraws,
    Quiet,
    Scatter,
    Seed,
    Settings,
    SpecPath,
    TableFile,
    check_plot,
    check_table_name,
)
from dpgcli.cli.printing import ROWS_SHOWN, Format, print_rows
from dpgcli.cli.progress import under_way
from dpgcli.cli.streams import say

Graph = Annotated[
    Path | None,
    typer.Option("--graph", metavar="FILE", help="Write states and transitions as GraphML"),
]
Plot = Annotated[
    Path | None,
    typer.Option("--plot", metavar="FILE", help="Draw states and transitions: .svg or .png"),
]


def transitions(
    spec: SpecPath,
    scatter: Scatter = None,
    draws: NumberOfDraws = None,
    seed: Seed = None,
    settings: Settings = None,
    output: TableFile = None,
    printed_as: Annotated[
        Format | None,
        typer.Option("--format", help="How to print rows  [default: table]", show_default=False),
    ] = None,
    graph: Graph = None,
    plot: Plot = None,
    quiet: Quiet = False,
) -> None:
    """Find where pressure drives every stable state, and what can be reached from rest."""
    from dpgcli.actuation.costs import announced
    from dpgcli.api.pressure import pressed_input
    from dpgcli.api.scatter import drawn_by
    from dpgcli.api.transitions import (
        check_drawable_graph,
        check_size,
        graph_path,
        transitions_of,
    )
    from dpgcli.files.output import Mark, check_outputs

    given = pressed_input(spec, settings or ())
    check_size(given)
    drawn = drawn_by(given, scatter, draws, seed)
    if plot is not None:
        check_plot(plot)
        check_drawable_graph(given)
    check_table_name(output)
    if graph is not None:
        graph_path(graph)
    outputs = (output, Mark.TABLE), (graph, Mark.GRAPH), (plot, Mark.FIGURE)
    check_outputs(given.given.files, *outputs)
    expected = announced(given.pressed.finger, len(given.pressure.lines))
    if expected and not quiet:
        say(expected)
    with under_way("following every state", quiet=quiet):
        found = transitions_of(given, drawn)
    if output is not None:
        found.save(output)
    if graph is not None:
        found.save_graph(graph)
    if plot is not None:
        found.draw(plot)
    if printed_as is not None or output is None or len(found.rows["pattern"]) <= ROWS_SHOWN:
        print_rows(found.columns, found.rows, printed_as or Format.TABLE)
    sys.stdout.flush()
    if not quiet:
        for line in found.summary:
            say(line)
