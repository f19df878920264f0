"""`dpg pulses`: the pulses of pressure that lead from one state to another."""

import sys
from typing import Annotated

import typer

from dpgcli.cli.exits import ExitCode
from dpgcli.cli.options import Quiet, Settings, SpecPath
from dpgcli.cli.printing import Format, print_rows
from dpgcli.cli.progress import under_way
from dpgcli.cli.streams import say

To = Annotated[str, typer.Option("--to", metavar="PATTERN", help="Pattern to reach")]
Start = Annotated[
    str, typer.Option("--from", metavar="PATTERN", help="Pattern to start from  [default: 0...0]")
]
Lookup = Annotated[
    bool, typer.Option("--table", help="What pulses of all sizes do to the state, instead")
]
Scatter = Annotated[
    str | None,
    typer.Option(
        "--scatter", metavar="LIST", help="Standard deviations: dome_height_mm=0.1mm,stroke_mm=2%"
    ),
]
NumberOfDraws = Annotated[
    int | None,
    typer.Option("--draws", metavar="N", help="Fingers to draw by --scatter  [default: 1000]"),
]
Seed = Annotated[
    int | None, typer.Option("--seed", metavar="N", help="Seed of the draws  [default: 1]")
]


def pulses(
    spec: SpecPath,
    target: To = "",
    start: Start = "",
    table: Lookup = False,
    scatter: Scatter = None,
    draws: NumberOfDraws = None,
    seed: Seed = None,
    settings: Settings = None,
    printed_as: Annotated[
        Format, typer.Option("--format", help="How to print rows")
    ] = Format.TABLE,
    quiet: Quiet = False,
) -> None:
    """Find the fewest pulses of pressure from one state to another."""
    from dpgcli.api.lookup import LookupResult, lookup_of
    from dpgcli.api.pressure import pressed_input
    from dpgcli.api.pulses import PulsesResult, pulses_of
    from dpgcli.api.scatter import draws_of
    from dpgcli.errors import Field, UsageError

    if bool(target) == table:
        raise UsageError("expected ", Field("target"), " or ", Field("table"), ", one of both")
    asked = {"scatter": scatter, "draws": draws, "seed": seed}
    for field in (name for name, value in asked.items() if value is not None):
        if table or scatter is None:
            wanted = Field("target") if table else Field("scatter")
            raise UsageError(Field(field), " goes with ", wanted)
    given = pressed_input(spec, settings or ())
    drawn = None
    if scatter is not None:
        number, start_of = 1000 if draws is None else draws, 1 if seed is None else seed
        drawn = draws_of(given, scatter, number, start_of)
    found: LookupResult | PulsesResult
    with under_way("following pulses", quiet=quiet):
        found = lookup_of(given, start) if table else pulses_of(given, target, start, drawn)
    print_rows(found.columns, found.rows, printed_as)
    sys.stdout.flush()
    if not quiet:
        for line in found.summary:
            say(line)
    if isinstance(found, PulsesResult) and not found.exists:
        raise typer.Exit(ExitCode.REQUIREMENT)
