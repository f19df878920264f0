"""`dpg validate`: check specs without solving."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.exits import ExitCode
from dpgcli.cli.options import Settings
from dpgcli.cli.spelling import problem_with_options
from dpgcli.cli.streams import put
from dpgcli.errors import Problem
from dpgcli.text import printable

MOST_ANNOTATIONS = 9  # GitHub shows ten per step


class ProblemFormat(StrEnum):
    """How problems are listed."""

    TEXT = "text"
    JSON = "json"
    GITHUB = "github"


def validate(
    specs: Annotated[list[Path], typer.Argument(metavar="SPEC...", help="YAML specs")],
    settings: Settings = None,
    listed_as: Annotated[
        ProblemFormat, typer.Option("--format", help="How to list problems")
    ] = ProblemFormat.TEXT,
) -> None:
    """Check specs without solving."""
    from dpgcli.api.validate import validate

    problems: list[Problem] = []
    for path in specs:
        found = validate(path, settings=settings or ())
        problems.extend(map(problem_with_options, found))
        if not found and listed_as is ProblemFormat.TEXT:
            put(f"{path}: ok")
    _PRINTERS[listed_as](problems)
    if problems:
        raise typer.Exit(ExitCode.USAGE)


def _print_text(problems: list[Problem]) -> None:
    for problem in problems:
        print(problem)
    if problems:
        print(f"{len(problems)} problem{'s' * (len(problems) != 1)}")


def _print_json(problems: list[Problem]) -> None:
    import json
    from dataclasses import asdict

    print(json.dumps([asdict(problem) for problem in problems], indent=2))


def _print_github(problems: list[Problem]) -> None:
    """Workflow commands; property values and messages are escaped as GitHub asks."""
    for problem in problems[:MOST_ANNOTATIONS]:
        place = f"file={escaped(printable(problem.file), ':,')}"
        place += f",line={problem.line}" if problem.line is not None else ""
        place += f",col={problem.column}" if problem.column is not None else ""
        print(f"::error {place}::{escaped(str(problem))}")
    if len(problems) > MOST_ANNOTATIONS:
        print(f"::error ::and {len(problems) - MOST_ANNOTATIONS} more problems")


_PRINTERS = {
    ProblemFormat.TEXT: _print_text,
    ProblemFormat.JSON: _print_json,
    ProblemFormat.GITHUB: _print_github,
}


def escaped(text: str, also: str = "") -> str:
    """Text as a GitHub workflow command takes it."""
    for character in "%\r\n" + also:
        text = text.replace(character, f"%{ord(character):02X}")
    return text
