"""`dpg merge`: join the shards of a sweep."""

from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.options import MaxFailed, Quiet
from dpgcli.cli.report import summarize
from dpgcli.cli.streams import say
from dpgcli.cli.sweep_summary import check_failed


def merge(
    shards: Annotated[
        list[Path], typer.Argument(metavar="FOLDER...", help="Output folders of the shards")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder of the tables")],
    max_failed: MaxFailed = 0,
    quiet: Quiet = False,
) -> None:
    """Join shards into the tables of the whole sweep."""
    from dpgcli.errors import UsageError
    from dpgcli.files.output import check_outputs, sole_use
    from dpgcli.files.table_reader import read_run
    from dpgcli.studies.sweep import RUN, assemble, drop_half_written, outputs, stores

    found = []
    for folder in shards:
        here = stores(folder)
        if len(here) != 1:
            what = "no shard" if not here else "several sweeps"
            raise UsageError(
                f"{folder}: expected the output of one dpg sweep --shard, found {what}"
            )
        found += here
    with sole_use(output):
        drop_half_written(output)
        check_outputs((), *(each for each in outputs(output) if each[0] != output / RUN))
        read_run(output / RUN)  # what no report can be made beside is refused before the work
        assemble(found, output)
        designs, text = summarize(output, is_new=True)
        for store in found:
            if store.folder.parent.parent.samefile(output):
                store.drop()
    if not quiet:
        print(text, end="")
        say(f"{output}: {len(found)} shards joined")
    check_failed(int((designs["status"] == "failed").sum()), max_failed)
