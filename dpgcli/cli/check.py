"""`dpg check`: test a table of designs against requirements."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dpgcli.cli.exits import ExitCode, say_warnings
from dpgcli.cli.options import Strict
from dpgcli.cli.spelling import with_options
from dpgcli.cli.streams import annotate, put, put_json, say
from dpgcli.cli.validate import MOST_ANNOTATIONS, ProblemFormat

if TYPE_CHECKING:
    from dpgcli.sweeps.gate import RequirementVerdict

MOST_LINES = 20
LARGEST_SUMMARY = 2**20  # bytes; GitHub refuses more
NOTE = "dpg: left out, the summary would be larger than 1 MiB.\n"


def check(
    table: Annotated[Path, typer.Argument(metavar="TABLE", help="designs.parquet of a sweep")],
    require: Annotated[
        list[str],
        typer.Option("--require", metavar="EXPR", help="What each design must meet; repeatable"),
    ],
    listed_as: Annotated[
        ProblemFormat, typer.Option("--format", help="How to list designs that fail")
    ] = ProblemFormat.TEXT,
    summary_file: Annotated[
        Path | None,
        typer.Option("--summary-file", metavar="FILE", help="Append the summary, in Markdown"),
    ] = None,
    strict: Strict = False,
) -> None:
    """Check that every design of a table meets requirements."""
    from dpgcli.files.output import check_appendable
    from dpgcli.files.table_reader import read_designs
    from dpgcli.reports.page import verdicts_markdown
    from dpgcli.sweeps.gate import check_designs

    designs = read_designs(table)
    if summary_file is not None:
        check_appendable(summary_file, (table,))
    verdicts = check_designs(designs.columns, require, designs.trusts, strict=strict)
    say_warnings(warning for verdict in verdicts for warning in verdict.warnings)
    print_verdicts(verdicts, listed_as)
    is_written = summary_file is None or append_summary(summary_file, verdicts_markdown(verdicts))
    if code := code_of(verdicts, is_written=is_written):
        raise typer.Exit(code)


def code_of(verdicts: Sequence["RequirementVerdict"], *, is_written: bool) -> ExitCode:
    """How a command ends that held requirements: what they say comes before its summary."""
    if not all(verdict.is_met for verdict in verdicts):
        return ExitCode.REQUIREMENT
    return ExitCode.DONE if is_written else ExitCode.USAGE


def print_verdicts(verdicts: Sequence["RequirementVerdict"], listed_as: ProblemFormat) -> None:
    """Print verdicts."""
    _PRINTERS[listed_as](verdicts)


def append_summary(path: Path, text: str) -> bool:
    """Append Markdown, such as to $GITHUB_STEP_SUMMARY; a note where it would get too large.

    False, and a word why, where it cannot be written: the work is done, and its outcome counts.
    """
    content = text.encode(errors="backslashreplace")
    try:
        with path.open("ab") as stream:
            size = os.fstat(stream.fileno()).st_size
            gap = b"\n" if size else b""
            room = LARGEST_SUMMARY - size - len(gap)
            if len(content) > room:
                say(f"dpg: {path}: no room for {len(content):,} bytes within 1 MiB")
                content = NOTE.encode()
            if len(content) <= room:
                stream.write(gap + content)
    except OSError as error:
        say(f"dpg: cannot write {path}: {error.strerror}")
        return False
    return True


def _print_text(verdicts: Sequence["RequirementVerdict"]) -> None:
    for verdict in verdicts:
        put(str(verdict))
        for failure in verdict.failures(MOST_LINES):
            put(f"  {failure}")
        if len(verdict.rows) > MOST_LINES:
            put(f"  and {len(verdict.rows) - MOST_LINES:,} more")


def _print_json(verdicts: Sequence["RequirementVerdict"]) -> None:
    import json

    put_json(json.dumps([_record(verdict) for verdict in verdicts], indent=2) + "\n")


def _print_github(verdicts: Sequence["RequirementVerdict"]) -> None:
    messages = [
        f"{verdict.requirement.text}: {failure}"
        for verdict in verdicts
        for failure in verdict.failures(MOST_ANNOTATIONS)
    ]
    for message in messages[:MOST_ANNOTATIONS]:
        annotate(message)
    n_more = sum(len(verdict.rows) for verdict in verdicts) - MOST_ANNOTATIONS
    if n_more > 0:
        annotate(f"and {n_more:,} more")


_PRINTERS = {
    ProblemFormat.TEXT: _print_text,
    ProblemFormat.JSON: _print_json,
    ProblemFormat.GITHUB: _print_github,
}


def _record(verdict: "RequirementVerdict") -> dict[str, Any]:
    """A verdict as JSON values; null for what is not a finite number."""
    import math
    from dataclasses import asdict

    failures = [asdict(failure) for failure in verdict.failures()]
    for failure in failures:
        for part in ("values", "found"):
            numbers = failure[part].items()
            failure[part] = {k: v if math.isfinite(v) else None for k, v in numbers}
    return {
        "requirement": verdict.requirement.text,
        "is_met": verdict.is_met,
        "warnings": [with_options(warning) for warning in verdict.warnings],
        "n_checked": verdict.n_checked,
        "n_failing": len(verdict.rows),
        "failing": failures,
    }
