"""`dpg validate`: check specs, sweeps and goals without solving."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from dpgcli.cli.exits import ExitCode
from dpgcli.cli.options import Settings
from dpgcli.cli.spelling import problem_with_options
from dpgcli.cli.streams import annotate, put, put_json
from dpgcli.errors import Problem

MOST_ANNOTATIONS = 9  # GitHub shows ten per step


class ProblemFormat(StrEnum):
    """How problems are listed."""

    TEXT = "text"
    JSON = "json"
    GITHUB = "github"


def validate(
    specs: Annotated[
        list[Path],
        typer.Argument(
            metavar="SPEC...", help="YAML specs, sweeps and goals; - reads standard input"
        ),
    ],
    settings: Settings = None,
    listed_as: Annotated[
        ProblemFormat, typer.Option("--format", help="How to list problems")
    ] = ProblemFormat.TEXT,
) -> None:
    """Check specs, sweeps and goals without solving."""
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
        put(str(problem))
    if problems:
        put(f"{len(problems)} problem{'s' * (len(problems) != 1)}")


def _print_json(problems: list[Problem]) -> None:
    import json
    from dataclasses import asdict

    put_json(json.dumps([asdict(problem) for problem in problems], indent=2) + "\n")


def _print_github(problems: list[Problem]) -> None:
    for problem in problems[:MOST_ANNOTATIONS]:
        annotate(str(problem), file=problem.file, line=problem.line, col=problem.column)
    if len(problems) > MOST_ANNOTATIONS:
        annotate(f"and {len(problems) - MOST_ANNOTATIONS} more problems")


_PRINTERS = {
    ProblemFormat.TEXT: _print_text,
    ProblemFormat.JSON: _print_json,
    ProblemFormat.GITHUB: _print_github,
}
