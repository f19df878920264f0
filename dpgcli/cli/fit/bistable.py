"""`dpg fit bistable`: the bistable law from a dome's curve."""

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dpgcli.calibration.choices import LAW_KEYS, LINEARITY, Branches, Loss, Quantity, Rule
from dpgcli.cli.fit.common import (
    NO_GEOMETRY,
    Bootstrap,
    GeometrySpec,
    GeometryValues,
    LossOption,
    LossScale,
    Output,
    Plot,
    Printed,
    Seed,
    check_files,
    geometry_from,
    known,
    method_of,
    positive,
    print_fit,
    quality_line,
    scale_of,
    tell,
    write,
)
from dpgcli.cli.options import Quiet
from dpgcli.cli.printing import Format

if TYPE_CHECKING:
    from dpgcli.calibration.bistable import BistableFit, Choice, Opening
    from dpgcli.files.calibration import DataFile
    from dpgcli.files.measured import Measured

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
    Quantity | None,
    typer.Option("--quantity", help="What to fit  [default: energy, else force, else pressure]"),
]
Area = Annotated[
    float | None, typer.Option("--area", metavar="MM2", help="Effective area, for pressure")
]
BranchNames = Annotated[
    Branches, typer.Option("--branches", help="All points, or slow stable pieces only")
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
    branches: BranchNames = Branches.ALL,
    fix: Fix = None,
    free: Free = None,
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
    from dpgcli.calibration.bistable import Choice, fit_bistable
    from dpgcli.files.calibration import DataFile
    from dpgcli.files.measured import read_curve

    opening, fixed = _opening(travel_to_opening), _fixed(fix or [], free)
    check_files((curve, spec), output, plot)
    where = geometry_from(geometry, spec)
    measured = read_curve(curve, known(where))
    chosen = _quantity(measured, quantity)
    choice = Choice(
        opening,
        chosen,
        is_quasi_static=branches is Branches.QUASI_STATIC,
        area=_area(chosen, area),
        fixed=fixed,
        loss=loss,
        loss_scale=scale_of(loss, loss_scale),
        resamples=bootstrap,
        seed=seed,
    )
    found = fit_bistable(measured.curve, choice)
    warnings = [*found.warnings, *([] if where else [NO_GEOMETRY])]
    if measured.ignored:
        warnings.append(f"columns not used: {', '.join(measured.ignored)}")
    source = DataFile(file=curve.name, sha256=measured.sha256, rows=found.fit.n_points)
    _write(output, source, found, choice, where, warnings)
    if plot is not None:
        _draw(found, choice, curve.name, plot)
    print_fit(found.fit, printed_as)
    if not quiet:
        tell(_summary(found, choice), warnings, output, plot)


def _opening(text: str | None) -> "Opening":
    from dpgcli.calibration.bistable import Opening
    from dpgcli.errors import UsageError

    if text is None:
        raise UsageError(WHY_OPENING)
    rule, _, amount = text.partition(":")
    if text == Rule.EQUAL:
        return Opening(Rule.EQUAL)
    if rule in (Rule.PROPORTIONAL, Rule.STROKE) and (size := _number(amount)):
        return Opening(Rule(rule), size)
    raise UsageError(
        f"--travel-to-opening {text}: expected equal, proportional:FACTOR or stroke:MM, "
        "with a number > 0"
    )


def _number(text: str) -> float | None:
    """A number from zero on, None for anything else."""
    if not re.fullmatch(r"\s*[0-9]*\.?[0-9]*(?:[eE][-+]?[0-9]+)?\s*", text):
        return None
    try:
        value = float(text)
    except ValueError:
        return None
    return value if value < float("inf") else None


def _fixed(fix: list[str], free: list[str] | None) -> dict[str, float]:
    """Values that are held, by key."""
    from difflib import get_close_matches

    from dpgcli.errors import UsageError
    from dpgcli.files.sections import LARGEST, SMALLEST

    fixed: dict[str, float] = {}
    for text in fix:
        key, _, value = (part.strip() for part in text.partition("="))
        number = _number(value)
        low, high = (0.0, 1.0) if key == LINEARITY else (SMALLEST, LARGEST)
        if key in LAW_KEYS and (number is None or not low <= number <= high):
            raise UsageError(f"--fix {text}: expected a number from {low:g} to {high:g}")
        fixed[key] = number or 0.0
    for option, keys in (("--fix", list(fixed)), ("--free", free or [])):
        for key in keys:
            if key not in LAW_KEYS:
                nearest = get_close_matches(key, LAW_KEYS, n=1)
                hint = f"did you mean {nearest[0]}?" if nearest else f"one of {', '.join(LAW_KEYS)}"
                raise UsageError(f"{option} {key}: no value of the law ({hint})")
    for key in LAW_KEYS:
        if free is not None and key in free and key in fixed:
            raise UsageError(f"{key} is both in --fix and in --free")
        if free is not None and key not in free and key not in fixed:
            raise UsageError(f"{key} is not free: give its value, --fix {key}=VALUE")
    return fixed


def _quantity(measured: "Measured", asked: Quantity | None) -> Quantity:
    """What to fit: what is asked for, or the first that there is."""
    from dpgcli.errors import UsageError

    has = [q for q in Quantity if getattr(measured.curve, q.value, None) is not None]
    if asked is None:
        return has[0]
    if asked is not Quantity.WORK and asked not in has:
        raise UsageError(f"--quantity {asked}: the curve has {', '.join(has)}")
    return asked


def _area(quantity: Quantity, area: float | None) -> float:
    from dpgcli.errors import UsageError

    if quantity is Quantity.PRESSURE and area is None:
        raise UsageError("pressure needs --area MM2, the effective area A in F = p A")
    if quantity is not Quantity.PRESSURE and area is not None:
        raise UsageError(f"--area is for pressure; the fit is to the {quantity}")
    return positive("--area", area) or float("nan")


def _summary(found: "BistableFit", choice: "Choice") -> list[str]:
    """Quality, the assumed mapping, and the inverted wells of law and data."""
    from dpgcli.calibration.bistable import UNITS, rests

    how = "as given"
    if choice.opening.rule is Rule.STROKE:
        how = f"so that the inverted well opens {choice.opening.amount:g} mm"
    wells = [f"{found.well:.4g} mm in the data"] if found.well is not None else []
    well = float(rests(found.fit.values).well)
    wells += [] if math.isnan(well) else [f"{well / found.factor:.4g} mm in the law"]
    return [
        quality_line(found.fit, UNITS[choice.quantity]),
        f"opening = {found.factor:.5g} travel, {how} (assumed, not fitted)",
        *([f"travel at the inverted well: {', '.join(wells)}"] if wells else []),
    ]


def _write(
    output: Path | None,
    source: "DataFile",
    found: "BistableFit",
    choice: "Choice",
    geometry: object,
    warnings: list[str],
) -> None:
    from dpgcli.calibration.bistable import UNITS
    from dpgcli.files.calibration.results import curve_of, fitted

    method = method_of(choice.quantity, found.fit, choice.resamples, choice.seed)
    if choice.quantity is Quantity.PRESSURE:
        method += f", area {choice.area:g} mm2"
    content = {
        **fitted(found.fit, UNITS[choice.quantity], source),
        "method": method + (", quasi-static pieces" if choice.is_quasi_static else ""),
        "geometry": geometry,
        "curve": curve_of(found),
        "warnings": warnings,
    }
    write(output, content)


def _draw(found: "BistableFit", choice: "Choice", name: str, path: Path) -> None:
    import numpy as np

    from dpgcli.calibration.bistable import UNITS, law
    from dpgcli.report.fits import FitFigure, draw_fit

    unit = UNITS[choice.quantity]
    along = np.linspace(min(0.0, float(found.travel.min())), float(found.travel.max()), 400)
    fitted = law(found.factor * along, found.fit.values, choice.quantity)
    figure = FitFigure(
        title=f"{name}: bistable law, opening = {found.factor:.4g} travel",
        x=found.travel,
        observed=found.observed,
        residuals=found.fit.residuals,
        line=(along, fitted if unit == "mJ" else found.factor * fitted),
        x_label="travel of the dome (mm)",
        y_label=f"{'energy' if unit == 'mJ' else 'force along the travel'} ({unit})",
        unit=unit,
        gaps=found.gaps,
    )
    draw_fit(figure, path)
