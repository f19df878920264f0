"""Arguments and options that several commands share."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from dpgcli.states.plan import Request

SpecPath = Annotated[Path, typer.Argument(metavar="SPEC", help="YAML spec; - reads standard input")]
Settings = Annotated[
    list[str] | None,
    typer.Option("-s", "--set", metavar="KEY=VALUE", help="Override a key of the spec; repeatable"),
]
Patterns = Annotated[
    list[str] | None,
    typer.Option("--pattern", metavar="GLOB", help="Only these states: 101, 1*1, 1??; repeatable"),
]
ColumnNames = Annotated[
    str,
    typer.Option(
        "--columns", metavar="LIST", help="Columns or groups, comma-separated; see explain"
    ),
]
Nodes = Annotated[bool, typer.Option("--nodes", help="Add all node positions")]
Tolerance = Annotated[
    float | None,
    typer.Option("--tolerance", help="Largest residual over the forces in play  [default: 1e-12]"),
]


class FormulationName(StrEnum):
    """The two formulations of one finger."""

    CHAIN = "chain"
    LATTICE = "lattice"


FormulationOption = Annotated[
    FormulationName,
    typer.Option("--formulation", help="Internal coordinates, or the study's node coordinates"),
]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="No summary on standard error")]


def request_of(
    patterns: list[str] | None,
    columns: str,
    nodes: bool,
    formulation: FormulationName,
    tolerance: float | None,
) -> "Request":
    """The options as a request."""
    from dpgcli.states.plan import DEFAULT_TOLERANCE, Request

    names = tuple(name.strip() for name in columns.split(",") if name.strip())
    return Request(
        patterns=tuple(patterns or ()),
        columns=(*names, *(("nodes",) if nodes else ())),
        formulation=formulation.value,
        tolerance=DEFAULT_TOLERANCE if tolerance is None else tolerance,
    )
