"""`dpg routine`: pulses that open a gripper, close it on a body that comes, and let it go."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.exits import ExitCode
from dpgcli.cli.grasp import Body, Place
from dpgcli.cli.options import (
    LONG,
    Quiet,
    Settings,
    SpecPath,
    TableFile,
    check_plot,
    check_table_name,
    point,
    seconds,
)
from dpgcli.cli.printing import Format, print_rows
from dpgcli.cli.progress import under_way
from dpgcli.cli.streams import say
from dpgcli.text import counted

From = Annotated[
    str,
    typer.Option(
        "--approach-from", metavar="X,Y", help="Where the body comes from, straight: 90,0, in mm"
    ),
]
Opened = Annotated[
    str, typer.Option("--open", metavar="PATTERN", help="Open state  [default: any that does]")
]
Closed = Annotated[
    str,
    typer.Option(
        "--closed", metavar="PATTERN", help="State that closing leads to without the body"
    ),
]
Ramp = Annotated[
    str, typer.Option("--ramp", metavar="TIME", help="Time of a ramp of pressure, up or down: 1s")
]
Move = Annotated[
    str, typer.Option("--move", metavar="TIME", help="Time of each move of the gripper: 5s")
]
Controller = Annotated[
    Path | None,
    typer.Option("--controller", metavar="FILE", help="Write pressures by time to this CSV file"),
]
Plot = Annotated[
    Path | None,
    typer.Option("--plot", metavar="FILE", help="Draw each step: a .svg or .png file"),
]


def routine(
    spec: SpecPath,
    approach_from: From,
    body: Body = None,
    at: Place = None,
    opened: Opened = "",
    closed: Closed = "",
    ramp: Ramp = "1s",
    move: Move = "5s",
    controller: Controller = None,
    settings: Settings = None,
    printed_as: Annotated[
        Format, typer.Option("--format", help="How to print steps")
    ] = Format.TABLE,
    output: TableFile = None,
    plot: Plot = None,
    quiet: Quiet = False,
) -> None:
    """Find pulses that open a gripper, close it on a body, carry it and let it go."""
    from dpgcli.api.arguments import check_positive
    from dpgcli.api.routine import found_routine, planned, seconds_of
    from dpgcli.files.output import Mark, check_outputs
    from dpgcli.sweeps.extent import time_text

    if plot is not None:
        check_plot(plot)
    check_table_name(output)
    _check_controller(controller)
    times = [seconds(f"--{name}", text) for name, text in (("ramp", ramp), ("move", move))]
    for name, time in zip(("ramp", "move"), times, strict=True):
        check_positive(name, time)
    begin = point("--approach-from", approach_from)
    assert begin is not None, "it is given"
    with under_way("looking for pulses", quiet=quiet) as tell:
        given, known = planned(spec, begin, body, point("--at", at), opened, closed, settings or ())
        outputs = (output, Mark.TABLE), (controller, Mark.CONTROLLER), (plot, Mark.FIGURE)
        check_outputs(given.files, *outputs)
        if (time := seconds_of(known)) > LONG and not quiet:
            plans = counted(len(known.plans), "plan")
            say(f"{plans}: at most about {time_text(time)} on one core (rough)")
        tell("closing on the body")
        found = found_routine(given, known, *times)
    if output is not None:
        found.save(output)
    if controller is not None and found.exists:
        found.save_controller(controller)
    elif controller is not None:
        old = ": what is there is of another run" if controller.exists() else ""
        say(f"{controller} is not written{old}")
    if plot is not None and found.routine.steps:
        found.draw(plot)
    print_rows(found.columns, found.rows, printed_as)
    sys.stdout.flush()
    if not quiet:
        for line in found.summary:
            say(line)
    if not found.exists:
        raise typer.Exit(ExitCode.REQUIREMENT)


def _check_controller(path: Path | None) -> None:
    """Raise UsageError for a name that promises another kind of file."""
    from dpgcli.errors import UsageError

    if path is not None and path.suffix.lower() != ".csv":
        raise UsageError(f"--controller {path}: expected a name that ends in .csv")
