"""`fit_bistable`: the bistable law from a dome's curve."""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Any

from dpgcli.api.arguments import as_texts, check_positive, chosen, files_of
from dpgcli.api.data import check_resampling, table_choice
from dpgcli.api.fits.result import (
    FitResult,
    GeometryInput,
    check_loss,
    fit_result,
    geometry_from,
    sizes,
    warned,
)
from dpgcli.api.inputs import Texts, by_text
from dpgcli.calibration import bistable
from dpgcli.calibration.bistable import UNITS, BistableFit, BistableOptions
from dpgcli.calibration.choices import LAW_KEYS, LINEARITY, Branches, CurveQuantity, Loss
from dpgcli.calibration.opening import OpeningRule
from dpgcli.calibration.record import Record
from dpgcli.design.dimensions import LARGEST, SMALLEST
from dpgcli.errors import Field, UsageError
from dpgcli.files.calibration import DataFile
from dpgcli.files.calibration.results import bistable_method, curve_of, fitted
from dpgcli.files.csv_file import Tabular, name_of
from dpgcli.files.measured import MeasuredCurve, read_curve
from dpgcli.files.sections import Geometry
from dpgcli.reports.fit_figures import bistable_figure, draw_fit
from dpgcli.reports.fits import bistable_summary, value_rows
from dpgcli.text import is_number, quoted


def fit_bistable(
    curve: Tabular,
    *,
    travel_to_opening: str | OpeningRule,
    quantity: str | None = None,
    area: float | None = None,
    branches: str | None = None,
    fix: Mapping[str, float] | None = None,
    free: str | Sequence[str] | None = None,
    geometry: GeometryInput = None,
    spec: str | Path | Mapping[str, Any] | None = None,
    loss: str = "linear",
    loss_scale: float | None = None,
    bootstrap: int = 0,
    seed: int = 0,
    column: Texts = (),
    skip: int | None = None,
    units: Texts = (),
) -> FitResult[BistableFit]:
    """Fit k_b, α and d of the bistable law to a dome's curve; see `calibration.bistable`.

    `curve` has `travel_mm` and any of `energy_mJ`, `force_N`, `pressure_MPa`; for pressure `area`
    is its effective area (mm²). `travel_to_opening` is "equal", "proportional:FACTOR" or
    "stroke:MM". `branches` is "loading", "unloading", "both" or "quasi-static"; without it both are
    fitted, unless they are two curves. `fix` holds values by key; `free` names those that are
    fitted, by default all others. Dimensions (`geometry`, or those of a `spec`) say where the
    values hold. Of a machine's export `column` has titles by our names ("-Extension" reverses
    signs), `skip` is the number of lines above its table, `units` has units by quantity, such as
    {"force": "kN"}.
    Raises SpecError for wrong data, UsageError for wrong choices, FitError for a fit that fails.

    >>> opening = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]  # of a law with k_b = 2 N/mm, α = 0, d = 2 mm
    >>> energy = [x**2 * (1 - x / 2) ** 2 for x in opening]
    >>> dome = {"travel_mm": opening, "energy_mJ": energy}
    >>> fit = fit_bistable(dome, travel_to_opening="equal", fix={"force_linearity": 0.0})
    >>> round(fit.values["bistable_stiffness_N_per_mm"], 6), round(fit.values["stroke_mm"], 6)
    (2.0, 2.0)
    """
    opening = _opening(travel_to_opening)
    held = _held(fix, None if free is None else as_texts("free", free))
    check_resampling(bootstrap, seed)
    where = geometry_from(geometry, spec)
    measured = read_curve(curve, sizes(where), table_choice(column, skip, units))
    fitted_to = _quantity(measured.curve, quantity)
    choice = BistableOptions(
        opening,
        fitted_to,
        branches=None if branches is None else chosen(Branches, "branches", branches),
        area=_area(fitted_to, area),
        fixed=held,
        loss=chosen(Loss, "loss", loss),
        loss_scale=loss_scale,
        resamples=bootstrap,
        seed=seed,
    )
    check_loss(choice.loss, loss_scale)
    found = bistable.fit_bistable(measured.curve, choice)
    return _result(found, choice, where, measured, name_of(curve), files_of(curve, spec))


def _result(
    found: BistableFit,
    choice: BistableOptions,
    where: Geometry | None,
    measured: MeasuredCurve,
    name: str,
    files: tuple[Path, ...],
) -> FitResult[BistableFit]:
    source = DataFile(file=name, sha256=measured.sha256, rows=found.fit.n_points)
    return fit_result(
        found,
        {
            **fitted(found.fit, UNITS[choice.quantity], source),
            "method": bistable_method(found, choice),
            "geometry": where,
            "curve": curve_of(found),
        },
        value_rows(found.fit),
        partial(bistable_summary, found, choice),
        warned((*measured.notes, *found.warnings), where, measured.ignored),
        partial(draw_fit, bistable_figure(found, choice, name)),
        files=files,
    )


def _opening(said: str | OpeningRule) -> OpeningRule:
    if isinstance(said, OpeningRule):
        return said
    return OpeningRule.of(said if isinstance(said, str) else quoted(said))


def limits_of(key: str) -> tuple[float, float]:
    """Smallest and largest value of a key of the law."""
    return (0.0, 1.0) if key == LINEARITY else (SMALLEST, LARGEST)


def _held(fix: Mapping[str, float] | None, free: Sequence[str] | None) -> dict[str, float]:
    """Values that are held, by key."""
    fix = {} if fix is None else fix
    if not isinstance(fix, Mapping):
        raise UsageError(Field("fix"), f" {quoted(fix)}: expected values by key")
    for field, keys in (("fix", list(by_text("fix", fix))), ("free", free or [])):
        for key in keys:
            if key not in LAW_KEYS:
                nearest = get_close_matches(str(key), LAW_KEYS, n=1)
                hint = f"did you mean {nearest[0]}?" if nearest else f"one of {', '.join(LAW_KEYS)}"
                raise UsageError(Field(field), f" {key}: no value of the law ({hint})")
    for key, value in fix.items():
        low, high = limits_of(key)
        if not (is_number(value) and low <= value <= high):
            shown = f"{value:g}" if isinstance(value, float) else quoted(value)
            what = f" {key}={shown}: expected a number from {low:g} to {high:g}"
            raise UsageError(Field("fix"), what)
    for key in LAW_KEYS if free is not None else ():
        is_free = key in (free or ())
        if is_free and key in fix:
            raise UsageError(f"{key} is both in ", Field("fix"), " and in ", Field("free"))
        if not is_free and key not in fix:
            raise UsageError(f"{key} is not free: give its value, ", Field("fix"), f" {key}=VALUE")
    return {key: float(value) for key, value in fix.items()}


def _quantity(record: Record, asked: str | None) -> CurveQuantity:
    """The quantity to fit: the one asked for, or the first that the curve has."""
    has = [q for q in CurveQuantity if getattr(record, q.value, None) is not None]
    if asked is None:
        return has[0]
    quantity = chosen(CurveQuantity, "quantity", asked)
    if quantity is not CurveQuantity.WORK and quantity not in has:
        raise UsageError(Field("quantity"), f" {quantity}: the curve has {', '.join(has)}")
    return quantity


def _area(quantity: CurveQuantity, area: float | None) -> float:
    if quantity is CurveQuantity.PRESSURE and area is None:
        what = " MM2, the effective area A in F = p A"
        raise UsageError("pressure needs ", Field("area"), what)
    if quantity is not CurveQuantity.PRESSURE and area is not None:
        raise UsageError(Field("area"), f" is for pressure; the fit is to the {quantity}")
    check_positive("area", area)
    return float("nan") if area is None else area
