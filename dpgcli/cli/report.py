"""`dpg report`: a design space on one page."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dpgcli.cli.streams import say

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
    if is_new or not path.exists() or _is_outdated(path, text):
        _write(path, text)
    return designs, text


def _is_outdated(path: Path, text: str) -> bool:
    """Whether a report of `dpg` says anything else, as that of tables before these."""
    from dpgcli.files.content import opened
    from dpgcli.files.output import Mark, is_own

    content = _bytes(text)
    try:
        with opened(path) as stream:
            return stream.read(len(content) + 1) != content and is_own(path, Mark.REPORT)
    except OSError:  # whatever that is, it is no report
        return False


def _read(folder: Path, kind: str) -> "tuple[pd.DataFrame, str]":
    """The designs in a folder, and their report."""
    from dpgcli.files.table_reader import read_designs
    from dpgcli.reports.page import html, markdown

    designs, units = read_designs(folder / "designs.parquet")
    text = (markdown if kind == ".md" else html)(designs, units, _facts(folder))
    return designs, text


def _facts(folder: Path) -> dict[str, Any] | None:
    """The facts of the run that made the tables in a folder, if they are there."""
    from dpgcli.files.parts import FINGERPRINT
    from dpgcli.files.table_reader import read_run
    from dpgcli.files.table_writer import read_metadata

    facts = read_run(folder / "run.json")
    made = read_metadata(folder / "designs.parquet").get(FINGERPRINT)
    if facts is not None and facts.get("fingerprint") != made:
        say(f"{folder / 'run.json'} is not of the run that made these tables: left out")
        return None
    return facts


def _write(path: Path, text: str) -> None:
    """A report in a file has at its end the mark by which `dpg` knows it."""
    from dpgcli.files.output import Mark, whole_file

    with whole_file(path, Mark.REPORT) as temporary:
        temporary.write_bytes(_bytes(text))


def _bytes(text: str) -> bytes:
    return f"{text}\n{AT_END}\n".encode(errors="backslashreplace")
