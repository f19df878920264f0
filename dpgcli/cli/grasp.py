"""`dpg grasp`: what the fingers of a gripper do with a body between them."""

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.options import (
    Patterns,
    Quiet,
    Settings,
    SpecPath,
    TableFile,
    check_plot,
    check_table_name,
    point,
)
from dpgcli.cli.printing import ROWS_SHOWN, Format, print_rows
from dpgcli.cli.progress import under_way
from dpgcli.cli.streams import say

Body = Annotated[
    str | None,
    typer.Option("--object", metavar="BODY", help="Body: disc:40, jaws:30x40 or a YAML file"),
]
Place = Annotated[
    str | None,
    typer.Option("--at", metavar="X,Y", help="Its place in the gripper's frame, in mm: 40,0"),
]
Both = Annotated[
    bool, typer.Option("--both", help="All pairs of states, of the upper and the lower finger")
]


class ApproachName(StrEnum):
    """How a body comes to where it is grasped."""

    PLACE = "place"
    INSERT = "insert"


Coming = Annotated[
    ApproachName,
    typer.Option(
        "--approach",
        help="How the body comes: it grows at its place, or is moved in along -x from beyond",
    ),
]
Plot = Annotated[
    Path | None,
    typer.Option("--plot", metavar="FILE", help="Draw each grasp: a .svg or .png file"),
]


def grasp(
    spec: SpecPath,
    body: Body = None,
    at: Place = None,
    patterns: Patterns = None,
    both: Both = False,
    approach: Coming = ApproachName.PLACE,
    settings: Settings = None,
    printed_as: Annotated[
        Format | None, typer.Option("--format", help="How to print the grasps")
    ] = None,
    output: TableFile = None,
    plot: Plot = None,
    quiet: Quiet = False,
) -> None:
    """Let fingers close on a body: contacts, forces, and which units reset."""
    from dpgcli.api.bodies import with_body
    from dpgcli.api.grasp import check_drawable, grasp_of, pairs_of
    from dpgcli.api.inputs import scene_input
    from dpgcli.files.output import Mark, check_outputs
    from dpgcli.grasping.approach import Way

    if plot is not None:
        check_plot(plot)
    check_table_name(output)
    given = with_body(scene_input(spec, settings or ()), body, point("--at", at))
    chosen = tuple(patterns or ("*",))
    if plot is not None:
        check_drawable(len(pairs_of(chosen, given.scene, both)[0]))
    check_outputs(given.files, (output, Mark.TABLE), (plot, Mark.FIGURE))
    with under_way("closing the fingers", quiet=quiet):
        found = grasp_of(given, chosen, both, Way(approach.value))
    if output is not None:
        found.save(output)
    if plot is not None:
        found.draw(plot)
    if printed_as is not None or output is None or len(found.rows["pattern"]) <= ROWS_SHOWN:
        print_rows(found.columns, found.rows, printed_as or Format.TABLE)
    sys.stdout.flush()
    if not quiet:
        for line in found.summary:
            say(line)
