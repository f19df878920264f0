"""`dpg report`: a design space on one page."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    import pandas as pd

KINDS = (".md", ".html")
AT_END = "<!-- written by dpg -->"


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

    kind = ".md" if output is None else output.suffix.lower()
    if kind not in KINDS:
        raise UsageError(f"--output {output}: expected a name that ends in {' or '.join(KINDS)}")
    check_outputs((folder / "designs.parquet", folder / "run.json"), (output, Mark.REPORT))
    _, text = _read(folder, kind)
    if output is None:
        print(text, end="")
    else:
        _write(output, text)


def summarize(folder: Path, *, is_new: bool) -> "tuple[pd.DataFrame, str]":
    """The designs of a finished sweep and their report, written into its folder if need be."""
    designs, text = _read(folder, ".md")
    path = folder / "report.md"
    if is_new or not path.exists():
        _write(path, text)
    return designs, text


def _read(folder: Path, kind: str) -> "tuple[pd.DataFrame, str]":
    """The designs in a folder, and their report."""
    from dpgcli.files.reading import read_designs, read_run
    from dpgcli.report.page import html, markdown

    designs, units = read_designs(folder / "designs.parquet")
    text = (markdown if kind == ".md" else html)(designs, units, read_run(folder / "run.json"))
    return designs, text


def _write(path: Path, text: str) -> None:
    """A report in a file has at its end the mark by which `dpg` knows it."""
    from dpgcli.files.output import Mark, whole_file

    content = f"{text}\n{AT_END}\n".encode(errors="backslashreplace")
    with whole_file(path, Mark.REPORT) as temporary:
        temporary.write_bytes(content)
