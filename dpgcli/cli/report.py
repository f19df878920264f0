"""`dpg report`: a design space on one page."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    import pandas as pd

KINDS = (".md", ".html")


def report(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of a finished sweep")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="File, .md or .html  [default: standard output]"),
    ] = None,
) -> None:
    """Summarize a design space: what is best, what failed and why, where bistability ends."""
    from dpgcli.errors import UsageError
    from dpgcli.files.output import Mark, check_outputs
    from dpgcli.files.reading import read_designs, read_run
    from dpgcli.report.page import html, markdown

    kind = ".md" if output is None else output.suffix.lower()
    if kind not in KINDS:
        raise UsageError(f"--output {output}: expected a name that ends in {' or '.join(KINDS)}")
    sources = (folder / "designs.parquet", folder / "run.json")
    check_outputs(sources, (output, Mark.REPORT))
    designs, units = read_designs(sources[0])
    facts = read_run(sources[1])
    text = (markdown if kind == ".md" else html)(designs, units, facts)
    if output is None:
        print(text, end="")
        return
    _write(output, text)


def summarize(folder: Path, *, is_new: bool) -> "tuple[pd.DataFrame, str]":
    """The designs of a finished sweep and their report, written into its folder if need be."""
    from dpgcli.files.reading import read_designs, read_run
    from dpgcli.report.page import markdown

    designs, units = read_designs(folder / "designs.parquet")
    text = markdown(designs, units, read_run(folder / "run.json"))
    path = folder / "report.md"
    if is_new or not path.exists():
        _write(path, text)
    return designs, text


def _write(path: Path, text: str) -> None:
    from dpgcli.files.output import Mark, whole_file

    with whole_file(path, Mark.REPORT) as temporary:
        temporary.write_bytes(text.encode(errors="backslashreplace"))
