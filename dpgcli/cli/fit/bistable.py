"""`dpg fit bistable`: the bistable law from a dome's curve."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from dpgcli.calibration.choices import LAW_KEYS, Branches, CurveQuantity, Loss
from dpgcli.cli.exits import say_problems
from dpgcli.cli.fit.options import (
    Bootstrap,
    ColumnTitles,
    GeometrySpec,
    GeometryValues,
    LossOption,
    LossScale,
    Output,
    Plot,
    Printed,
    Seed,
    Skip,
    Units,
)
from dpgcli.cli.fit.output import check_files, put_out, resampling
from dpgcli.cli.options import Quiet
from dpgcli.cli.printing import Format

if TYPE_CHECKING:
    from dpgcli.files.csv_file import Choice

WHY_OPENING = """\
--travel-to-opening is needed: a dome's travel u and the opening x of a unit, in which the law is
written, are not the same, and no curve tells how they relate. One of:
  equal                x = u, as if the unit opened by all that the dome travels
  proportional:FACTOR  x = FACTOR u
  stroke:3.5           x = FACTOR u such that the inverted dome rests at an opening of 3.5 mm,
                       for example the dome height less the unit separation, as published"""


CurvePath = Annotated[
    Path, typer.Argument(metavar="CURVE", help="CSV: travel with energy, force or pressure")
]
OpeningRule = Annotated[
    str | None,
    typer.Option(
        "--travel-to-opening",
        metavar="RULE",
        help="equal, proportional:FACTOR or stroke:MM; needed",
    ),
]
QuantityName = Annotated[
    CurveQuantity | None,
    typer.Option("--quantity", help="What to fit  [default: energy, else force, else pressure]"),
]
Area = Annotated[
    float | None, typer.Option("--area", metavar="MM2", help="Effective area, for pressure")
]
BranchNames = Annotated[
    Branches | None,
    typer.Option(
        "--branches",
        help="Directions of travel, or slow pieces  [default: both, if they are alike]",
    ),
]
Fix = Annotated[
    list[str] | None, typer.Option("--fix", metavar="KEY=VALUE", help="Hold a value; repeatable")
]
Free = Annotated[
    list[str] | None,
    typer.Option("--free", metavar="KEY", help="Fit only this; repeatable  [default: all]"),
]


def bistable(
    curve: CurvePath,
    output: Output = None,
    travel_to_opening: OpeningRule = None,
    quantity: QuantityName = None,
    area: Area = None,
    branches: BranchNames = None,
    fix: Fix = None,
    free: Free = None,
    column: ColumnTitles = None,
    skip: Skip = None,
    units: Units = None,
    geometry: GeometryValues = None,
    spec: GeometrySpec = None,
    loss: LossOption = Loss.LINEAR,
    loss_scale: LossScale = None,
    bootstrap: Bootstrap = 0,
    seed: Seed = 0,
    printed_as: Printed = Format.TABLE,
    plot: Plot = None,
    quiet: Quiet = False,
) -> None:
    """Fit k_b, alpha and d of the bistable law to a dome's curve."""
    from dpgcli.api.data import table_choice
    from dpgcli.api.fits.bistable import fit_bistable
    from dpgcli.calibration.opening import OpeningRule

    if travel_to_opening is None:
        _ask(curve, geometry, spec, table_choice(column or (), skip, units or ()))
    opening, fixed = OpeningRule.of(travel_to_opening), _fixed(fix or [])
    check_files((curve, spec), output, plot)
    with resampling(bootstrap, quiet=quiet):
        fit = fit_bistable(
            curve,
            travel_to_opening=opening,
            quantity=quantity,
            area=area,
            branches=branches,
            fix=fixed,
            free=free,
            geometry=geometry,
            spec=spec,
            loss=loss,
            loss_scale=loss_scale,
            bootstrap=bootstrap,
            seed=seed,
            column=column or (),
            skip=skip,
            units=units or (),
        )
    put_out(fit, output, plot, printed_as, quiet)


def _ask(
    curve: Path, geometry: Sequence[str] | None, spec: Path | None, choice: "Choice"
) -> NoReturn:
    """Ask for the rule, with all that is wrong with the data: one round of mistakes is enough."""
    from dpgcli.api.fits.result import geometry_from, sizes
    from dpgcli.errors import SpecError, UsageError
    from dpgcli.files.measured import read_curve

    try:
        read_curve(curve, sizes(geometry_from(geometry, spec)), choice)
    except SpecError as error:
        say_problems(error)
    raise UsageError(WHY_OPENING)


def _fixed(texts: Sequence[str]) -> dict[str, float]:
    """Values by key; those of keys that the law does not have are not looked at."""
    from dpgcli.api.fits.bistable import limits_of
    from dpgcli.calibration.opening import parse_number
    from dpgcli.errors import UsageError

    fixed = {}
    for text in texts:
        key, _, value = (part.strip() for part in text.partition("="))
        number = parse_number(value)
        low, high = limits_of(key)
        if key in LAW_KEYS and (number is None or not low <= number <= high):
            raise UsageError(f"--fix {text}: expected a number from {low:g} to {high:g}")
        fixed[key] = number or 0.0
    return fixed
