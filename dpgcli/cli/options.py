"""Arguments and options that several commands share."""

import re
from contextlib import suppress
from decimal import Decimal
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
Pressures = Annotated[
    list[str] | None,
    typer.Option(
        "--pressure",
        metavar="MPA",
        help="MPa: 0:0.15:0, or A=0:0.15:0 for each line, or a CSV file  [default: the spec's]",
    ),
]
ColumnNames = Annotated[
    str,
    typer.Option(
        "--columns", metavar="LIST", help="Columns or groups, comma-separated; see dpg help columns"
    ),
]
DesignNumber = Annotated[
    int | None,
    typer.Option("--design", metavar="N", help="The design of a sweep by its number"),
]
Nodes = Annotated[bool, typer.Option("--nodes", help="Add all node positions")]
WithUncertainty = Annotated[
    bool,
    typer.Option("--uncertainty", help="Add what errors of fits, tolerances and model do"),
]
Tolerance = Annotated[
    float | None,
    typer.Option("--tolerance", help="Largest residual over the forces in play  [default: 1e-12]"),
]


LONG = 30.0  # s of one core: what takes longer is said before
MICRO = ("um", "\u00b5m", "\u03bcm")  # the micro sign and the Greek letter
POWERS = {"": 0, "mm": 0, **dict.fromkeys(MICRO, -3), "nm": -6, "m": 3}  # of ten, in mm
TargetError = Annotated[
    str | None,
    typer.Option(
        "--target-error",
        metavar="LENGTH",
        help="Cheapest accuracy level whose tips are this exact: 0.01mm",
    ),
]


MaxFailed = Annotated[
    int, typer.Option("--max-failed", min=0, help="Failed designs up to which the exit code is 0")
]


Strict = Annotated[
    bool,
    typer.Option("--strict", help="Refuse what would be warned of: dpg help trust"),
]


FirstStation = Annotated[
    str | None,
    typer.Option("--first-station", metavar="X,Y", help="Lattice's first node in the data, mm"),
]
TipOffset = Annotated[
    str | None,
    typer.Option(
        "--tip-offset", metavar="X,Y", help="Data's tip from the last node, along the phalanx, mm"
    ),
]


Scatter = Annotated[
    str | None,
    typer.Option(
        "--scatter", metavar="LIST", help="Standard deviations: dome_height_mm=0.1mm,stroke_mm=2%"
    ),
]
NumberOfDraws = Annotated[
    int | None,
    typer.Option("--draws", metavar="N", help="Fingers to draw by --scatter  [default: 1000]"),
]
Seed = Annotated[
    int | None, typer.Option("--seed", metavar="N", help="Seed of the draws  [default: 1]")
]


class ExecutorName(StrEnum):
    """Where designs are evaluated."""

    PROCESSES = "processes"
    SERIAL = "serial"
    DASK = "dask"


Where = Annotated[ExecutorName, typer.Option("--executor", help="Where designs are evaluated")]
Scheduler = Annotated[
    str | None, typer.Option("--scheduler", metavar="ADDRESS", help="Of Dask: tcp://host:port")
]
Wait = Annotated[
    str | None,
    typer.Option(
        "--wait", metavar="TIME", help="For a worker of Dask, while none is there  [default: 5m]"
    ),
]
Restart = Annotated[bool, typer.Option("--restart", help="Begin anew, whatever is there")]


class FormulationName(StrEnum):
    """The two formulations of one finger."""

    CHAIN = "chain"
    LATTICE = "lattice"


FormulationOption = Annotated[
    FormulationName,
    typer.Option("--formulation", help="Internal coordinates, or the study's node coordinates"),
]
TableFile = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="FILE", help="Write all rows to this Parquet file"),
]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="No summary, no report, no progress")]


def request_of(
    patterns: list[str] | None,
    columns: str,
    nodes: bool,
    uncertainty: bool,
    formulation: FormulationName,
    tolerance: float | None,
    target_error: str | None = None,
) -> "Request":
    """The options as a request."""
    from dpgcli.api import predict

    target = target_in_mm(target_error)
    names = (*columns.split(","), *_groups(nodes=nodes, uncertainty=uncertainty))
    return predict.request_of(patterns or (), names, formulation.value, tolerance, target)


def _groups(**wanted: bool) -> list[str]:
    """Groups of columns that have an option of their own."""
    return [group for group, is_wanted in wanted.items() if is_wanted]


def check_plot(path: Path) -> None:
    """Before any work: a suffix that can be drawn, and what draws it."""
    from dpgcli.api.arguments import check_installed
    from dpgcli.errors import UsageError

    if path.suffix.lower() not in (".svg", ".png"):
        raise UsageError(f"--plot {path}: expected a name that ends in .svg or .png")
    check_installed("--plot", "matplotlib")


def check_table_name(path: Path | None) -> None:
    """Refuse a name that promises another format than Parquet; raises UsageError."""
    from dpgcli.errors import UsageError

    if path is not None and path.suffix.lower() in (".csv", ".json", ".svg", ".png"):
        raise UsageError(
            f"--output {path}: writes Parquet; for {path.suffix} use --format with > FILE, "
            "or --plot for figures"
        )


def frame_of(
    first_station: str | None, tip_offset: str | None
) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    """Where the lattice lies in given data, as far as the options say it."""
    return point("--first-station", first_station), point("--tip-offset", tip_offset)


def point(option: str, text: str | None) -> tuple[float, float] | None:
    """A place of an option, in mm; none of no text. Raises UsageError for what is none."""
    from dpgcli.design.dimensions import LARGEST
    from dpgcli.errors import UsageError
    from dpgcli.text import number_in

    if text is None:
        return None
    try:
        x, y = map(number_in, text.split(","))
    except ValueError:  # one, or three
        x, y = float("nan"), 0.0
    if not (abs(x) <= LARGEST and abs(y) <= LARGEST):
        raise UsageError(f"{option} {text}: expected two numbers in mm, such as 5.375,-0.75")
    return x, y


def millimeters(option: str, text: str) -> float:
    """A length with its unit as a number of mm: 0.01mm, 10um; a plain number is mm."""
    from dpgcli.errors import UsageError

    number = r"(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:e[-+]?[0-9]+)?"
    match = re.fullmatch(rf"\s*({number})\s*([^\W\d]*)\s*", text)
    length = 0.0
    if match is not None and match[2] in POWERS:
        with suppress(ArithmeticError):  # beyond what a number can be
            length = float(Decimal(match[1]).scaleb(POWERS[match[2]]))
    if not 0.0 < length < float("inf"):
        raise UsageError(f"{option} {text}: expected a length > 0 in mm, um, nm or m: 0.01mm")
    return length


def target_in_mm(text: str | None) -> float | None:
    """The target error, if there is one, as a number of mm."""
    return None if text is None else millimeters("--target-error", text)


def seconds(option: str, text: str) -> float:
    """A time with its unit as a number of s: 30s, 5m, 2h; a plain number is s."""
    from dpgcli.errors import UsageError

    match = re.fullmatch(r"([0-9]{1,9}(?:\.[0-9]{1,9})?)([smh]?)", text.strip())
    if match is None:
        raise UsageError(f"{option} {text}: expected a time in s, m or h: 5m")
    return float(match[1]) * {"": 1, "s": 1, "m": 60, "h": 3600}[match[2]]
