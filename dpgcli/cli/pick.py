"""`dpg pick`: choose among the designs of a sweep, or their states."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.exits import say_warnings
from dpgcli.cli.options import DesignNumber, Quiet, Strict, TableFile, check_table_name
from dpgcli.cli.printing import Format, print_rows
from dpgcli.cli.progress import under_way
from dpgcli.cli.streams import say

Source = Annotated[
    Path, typer.Argument(metavar="OUT", help="Folder of a finished sweep, or one of its tables")
]
Where = Annotated[
    list[str] | None,
    typer.Option("--where", metavar="CONDITION", help="What each row must meet; repeatable"),
]
Minimize = Annotated[
    list[str] | None,
    typer.Option("--minimize", metavar="COLUMN", help="Least values first; repeatable"),
]
Maximize = Annotated[
    list[str] | None,
    typer.Option("--maximize", metavar="COLUMN", help="Largest values first; repeatable"),
]
Top = Annotated[
    int | None, typer.Option("--top", metavar="N", help="Only the first rows  [default: all]")
]
SpecFile = Annotated[
    Path | None,
    typer.Option("--spec", metavar="SPEC", help="Write the first row's design as a spec"),
]
States = Annotated[bool, typer.Option("--states", help="Choose among states, not designs")]
Shown = Annotated[
    str, typer.Option("--columns", metavar="LIST", help="Columns, comma-separated; default; all")
]


def pick(
    source: Source,
    where: Where = None,
    minimize: Minimize = None,
    maximize: Maximize = None,
    top: Top = None,
    design: DesignNumber = None,
    states: States = False,
    spec: SpecFile = None,
    output: TableFile = None,
    printed_as: Annotated[
        Format | None,
        typer.Option("--format", help="How to print rows  [default: table]", show_default=False),
    ] = None,
    columns: Shown = "default",
    strict: Strict = False,
    quiet: Quiet = False,
) -> None:
    """Choose among designs: those that meet conditions, the best ones first."""
    from dpgcli.api import pick as face
    from dpgcli.api.designs import table_of, tables_beside
    from dpgcli.files.output import Mark, check_outputs

    check_table_name(output)
    files = tables_beside(table_of(source, has_states=states))
    check_outputs(files, (output, Mark.TABLE), (spec, Mark.SPEC))
    with under_way("choosing", quiet=quiet):
        found = face.pick(
            source,
            where or (),
            minimize=minimize or (),
            maximize=maximize or (),
            top=top,
            design=design,
            states=states,
            columns=columns,
            strict=strict,
        )
    say_warnings(found.warnings)
    if printed_as is not None or output is None:
        print_rows(found.columns, found.rows, printed_as or Format.TABLE)
    if output is not None:
        found.save(output)
    if spec is not None:
        found.save_spec(spec)
    sys.stdout.flush()
    if not quiet:
        for line in found.lines:
            say(line)
    if spec is not None and not quiet:
        say(f"wrote {spec}: {found.first}")
