"""`dpg pulses`: the pulses of pressure that lead from one state to another."""

import sys
from typing import Annotated

import typer

from dpgcli.cli.exits import ExitCode
from dpgcli.cli.options import NumberOfDraws, Quiet, Scatter, Seed, Settings, SpecPath
from dpgcli.cli.printing import Format, print_rows
from dpgcli.cli.progress import under_way
from dpgcli.cli.streams import say

To = Annotated[str, typer.Option("--to", metavar="PATTERN", help="Pattern to reach")]
Start = Annotated[
    str, typer.Option("--from", metavar="PATTERN", help="Pattern to start from  [default: at rest]")
]
Lookup = Annotated[
    bool, typer.Option("--table", help="What pulses of all sizes do to the state, instead")
]


def pulses(
    spec: SpecPath,
    end: To = "",
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
    from dpgcli.actuation.costs import announced
    from dpgcli.api.lookup import LookupResult, lookup_of
    from dpgcli.api.pressure import pressed_input
    from dpgcli.api.pulses import PulsesResult, pulses_of
    from dpgcli.api.scatter import drawn_by
    from dpgcli.errors import Field, UsageError

    if bool(end) == table:
        raise UsageError("expected ", Field("end"), " or ", Field("table"), ", one of both")
    if table and scatter is not None:
        raise UsageError(Field("scatter"), " goes with ", Field("end"))
    given = pressed_input(spec, settings or ())
    drawn = drawn_by(given, scatter, draws, seed)
    expected = announced(given.pressed.finger, len(given.pressure.lines))
    if expected and not quiet:
        say(f"at most {expected}")  # a sequence may be found before all states are followed
    found: LookupResult | PulsesResult
    with under_way("following pulses", quiet=quiet):
        found = lookup_of(given, start) if table else pulses_of(given, end, start, drawn)
    print_rows(found.columns, found.rows, printed_as)
    sys.stdout.flush()
    if not quiet:
        for line in found.summary:
            say(line)
    if isinstance(found, PulsesResult) and not found.exists:
        raise typer.Exit(ExitCode.REQUIREMENT)
