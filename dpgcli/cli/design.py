"""`dpg design`: search for designs whose states are as a goal asks for."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.exits import ExitCode, Terminated, say_warnings
from dpgcli.cli.options import (
    ExecutorName,
    Quiet,
    Restart,
    Scheduler,
    Settings,
    Strict,
    Wait,
    Where,
    seconds,
)
from dpgcli.cli.printing import Format, print_rows
from dpgcli.cli.progress import under_way
from dpgcli.cli.streams import say
from dpgcli.cores import MOST_PROCESSES

GoalPath = Annotated[
    Path, typer.Argument(metavar="GOAL", help="YAML file of a goal; - reads standard input")
]
Output = Annotated[
    Path | None,
    typer.Option(
        "-o", "--output", metavar="FOLDER", help="Folder for tables, and a spec of each design"
    ),
]
Evaluations = Annotated[
    int | None,
    typer.Option(
        "--evaluations", metavar="N", min=1, help="End after so many, with more starts or fewer"
    ),
]
Budget = Annotated[
    str | None,
    typer.Option("--budget", metavar="TIME", help="End after so long, likewise: 60s, 5m"),
]
Jobs = Annotated[
    int,
    typer.Option("-j", "--jobs", min=1, max=MOST_PROCESSES, help="Processes that share the work"),
]
Seed = Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Seed of the starts")]


def design(
    goal: GoalPath,
    output: Output = None,
    seed: Seed = 1,
    evaluations: Evaluations = None,
    budget: Budget = None,
    jobs: Jobs = 1,
    executor: Where = ExecutorName.PROCESSES,
    scheduler: Scheduler = None,
    wait: Wait = None,
    restart: Restart = False,
    settings: Settings = None,
    printed_as: Annotated[
        Format, typer.Option("--format", help="How to print designs")
    ] = Format.TABLE,
    strict: Strict = False,
    quiet: Quiet = False,
) -> None:
    """Search for designs whose states, and maps of states, are as a goal asks."""
    from dpgcli.api.given import goal_input
    from dpgcli.api.inverse_design import Ends, found_for
    from dpgcli.api.place import Place

    ends = Ends(seed, evaluations, None if budget is None else seconds("--budget", budget))
    limit = None if wait is None else seconds("--wait", wait)
    place = Place(executor.value, jobs, scheduler, limit)
    given = goal_input(goal, settings or ())
    try:
        with under_way("searching", quiet=quiet):
            found = found_for(given, output, ends, place, restart=restart, strict=strict, say=say)
    except (KeyboardInterrupt, Terminated) as stop:
        if output is None or budget is not None:
            raise
        raise type(stop)("what is done is kept, and the same command goes on from there") from None
    print_rows(found.columns, found.rows, printed_as)
    sys.stdout.flush()
    say_warnings(found.warnings)
    if not quiet:
        for line in found.summary:
            say(line)
    if not found.is_met:
        raise typer.Exit(ExitCode.REQUIREMENT)
