"""`dpg merge`: join the shards of a sweep."""

from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.exits import check_failed
from dpgcli.cli.options import MaxFailed, Quiet
from dpgcli.cli.streams import say
from dpgcli.cli.sweep import print_in_short


def merge(
    shards: Annotated[
        list[Path], typer.Argument(metavar="FOLDER...", help="Output folders of the shards")
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="Folder of the tables")
    ],
    max_failed: MaxFailed = 0,
    quiet: Quiet = False,
) -> None:
    """Join shards into the tables of the whole sweep."""
    from dpgcli.api.sweep import merged

    found = merged(shards, output)
    if not quiet and found.space is not None:
        print_in_short(output, found.space)
        say(f"{output}: {len(shards)} shards joined")
    check_failed(found.n_failed, max_failed)
