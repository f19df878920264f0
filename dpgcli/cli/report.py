"""`dpg report`: a design space on one page."""

from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.exits import say_warnings
from dpgcli.cli.options import Strict
from dpgcli.cli.streams import put


def report(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of a finished sweep")],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="File: .md, or .html to explore designs in  [default: standard output]",
        ),
    ] = None,
    strict: Strict = False,
) -> None:
    """Summarize a design space: what is best, what failed and why, where bistability ends."""
    from dpgcli.api.report import PAGES, page, write_page
    from dpgcli.errors import UsageError
    from dpgcli.files.output import Mark, check_outputs
    from dpgcli.reports.explorer import NO_BOKEH, is_drawable
    from dpgcli.reports.summary import doubts

    kind = ".md" if output is None else output.suffix.lower()
    if kind not in PAGES:
        raise UsageError(f"--output {output}: expected a name that ends in {' or '.join(PAGES)}")
    check_outputs((folder / "designs.parquet",), (output, Mark.REPORT))
    space, text = page(folder, kind, strict=strict)
    say_warnings(doubts(space))
    if kind == ".html" and not is_drawable():
        say_warnings([NO_BOKEH])
    if output is None:
        put(text, end="")
    else:
        write_page(output, text)
