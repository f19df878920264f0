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


def pulses(
    spec: SpecPath,
    target: To = "",
    start: Start = "",
    table: Lookup = False,
    settings: Settings = None,
    printed_as: Annotated[
        Format, typer.Option("--format", help="How to print rows")
    ] = Format.TABLE,
    quiet: Quiet = False,
) -> None:
    """Find the fewest pulses of pressure from one state to another."""
    from dpgcli.api.pressure import pressed_input
    from dpgcli.api.pulses import LookupResult, PulsesResult, lookup_of, pulses_of
    from dpgcli.errors import Field, UsageError

    if bool(target) == table:
        raise UsageError("expected ", Field("target"), " or ", Field("table"), ", one of both")
    given = pressed_input(spec, settings or ())
    found: LookupResult | PulsesResult
    with under_way("following pulses", quiet=quiet):
        found = lookup_of(given, start) if table else pulses_of(given, target, start)
    print_rows(found.columns, found.rows, printed_as)
    sys.stdout.flush()
    if not quiet:
        for line in found.summary:
            say(line)
    if isinstance(found, PulsesResult) and not found.exists:
        raise typer.Exit(ExitCode.REQUIREMENT)
