"""From a fit to what a calibration file says about it."""

import math
from collections.abc import Iterator
from difflib import get_close_matches
from typing import Any

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.bistable import BistableFit, BistableOptions
from dpgcli.calibration.choices import Branches, CurveQuantity, GridMethod
from dpgcli.calibration.finger import FingerFit
from dpgcli.calibration.fits import Fit
from dpgcli.calibration.grid import FittedGridLaw
from dpgcli.calibration.observations import UNITS, residual_unit
from dpgcli.design.dimensions import LARGEST, SMALLEST
from dpgcli.errors import FitError
from dpgcli.files.calibration.models import (
    Curve,
    DataFile,
    Grid,
    Quality,
    ScalingLaw,
    Values,
)
from dpgcli.files.measured import GridTable


def fitted(fit: Fit, unit: str, source: DataFile, *, only_free: bool = False) -> dict[str, object]:
    """The sections on a fit whose parameters are lattice keys, with residuals in `unit`."""
    return {
        "values": values_of(fit, only_free=only_free),
        "correlation": correlation_of(fit),
        "quality": quality_of(fit, unit),
        "sources": [source],
    }


def finger_sections(
    study: FingerFit, found: Fit, source: DataFile, resamples: int, seed: int
) -> dict[str, object]:
    """The sections on a fit to known states: its values, their errors and how they were found."""
    unit = residual_unit(study.targets)
    return {
        **fitted(found, unit, source, only_free=True),
        "quality": _judged(study, quality_of(found, unit)),
        "method": finger_method(study, found, resamples, seed),
    }


def _judged(study: FingerFit, quality: Quality) -> Quality:
    """The quality of a finger's fit, with the errors of states predicted from the others."""
    known = study.left_out[np.isfinite(study.left_out)]
    if not len(known):
        return quality
    errors = {"left_out_rms": float(np.sqrt((known**2).mean())), "left_out_largest": known.max()}
    return quality.model_copy(update={key: float(error) for key, error in errors.items()})


def method_of(what: str, fit: Fit, resamples: int, seed: int) -> str:
    """The method of a fit in one line."""
    text = f"least squares on the {what}, {fit.loss} loss"
    if fit.loss != "linear":
        text += f" beyond {fit.loss_scale:.4g}"
    return text + (f", bootstrap of {resamples} (seed {seed})" if resamples else "")


def bistable_method(found: BistableFit, choice: BistableOptions) -> str:
    """The method of a fit of the bistable law, with what of the curve it was made to."""
    text = method_of(choice.quantity, found.fit, choice.resamples, choice.seed)
    if choice.quantity is CurveQuantity.PRESSURE:
        text += f", area {choice.area:g} mm2"
    if choice.branches in (Branches.LOADING, Branches.UNLOADING):
        text += f", {choice.branches} only"
    return text + (", quasi-static pieces" if choice.is_quasi_static else "")


def finger_method(study: FingerFit, found: Fit, resamples: int, seed: int) -> str:
    """The method of a fit to known states, with the frame that was assumed."""
    frame = study.frame
    station, tip = ("{:g},{:g}".format(*point) for point in (frame.first_station, frame.tip))
    errors = study.observations.errors
    weighted = [
        f"{target} ({errors[target]:.3g} {UNITS[target]})" if target in errors else target
        for target in study.targets
    ]
    what = f"{', '.join(weighted)} through the equilibrium"
    held = ", ".join(f"{p.key} {p.start:g}" for p in found.parameters if not p.is_free)
    return (
        f"{method_of(what, found, resamples, seed)}, first station {station} mm, "
        f"tip offset {tip} mm, {study.finger.law.description}; held: {held}"
    )


def values_of(fit: Fit, *, only_free: bool) -> Values:
    """Values, errors and intervals; `only_free` leaves out those that were held.

    Raises FitError for a value that no spec takes.
    """
    said: dict[str, Any] = {}
    for place, parameter in enumerate(fit.parameters):
        if only_free and not parameter.is_free:
            continue
        value = float(fit.values[place])
        if parameter.key == "force_linearity" and value < SMALLEST:
            value = 0.0  # found to rounding
        if parameter.is_free and not (value == 0.0 or SMALLEST <= value <= LARGEST):
            raise FitError(
                f"{parameter.key} = {value:g} is not from {SMALLEST:g} to {LARGEST:g}: "
                "is a unit, or the mapping, another one?"
            )
        entry: dict[str, Any] = {"value": value}
        if math.isfinite(error := float(fit.standard_errors[place])):
            entry["standard_error"] = error
        if fit.intervals is not None and np.isfinite(fit.intervals[place]).all():
            entry["interval"] = fit.intervals[place].tolist()
        said[parameter.key] = entry
    return Values.model_validate(said)


def correlation_of(fit: Fit) -> list[list[float]] | None:
    """Correlation of the values that have errors, in the order of `Values`; None if there are none.

    The matrix is symmetric and its diagonal 1 to the last bit.
    """
    keys = [parameter.key for parameter in fit.parameters]
    known = [k for k, error in zip(keys, fit.standard_errors, strict=True) if np.isfinite(error)]
    rows = [keys.index(key) for key in Values.model_fields if key in known]
    matrix = fit.correlation[np.ix_(rows, rows)]
    return (0.5 * (matrix + matrix.T)).tolist() or None


def quality_of(fit: Fit, unit: str) -> Quality:
    """Points, R² and residual of a fit."""
    r_squared = fit.r_squared if math.isfinite(fit.r_squared) else None
    return Quality(
        n_points=fit.n_points, r_squared=r_squared, rms_residual=fit.rms, residual_unit=unit
    )


def curve_of(found: BistableFit) -> Curve | None:
    """The dome's energy over its travel, None where it is not known."""
    if found.curve is None:
        return None
    travel, energy = found.curve
    return Curve(
        travel_mm=travel.tolist(),
        energy_mJ=energy.tolist(),
        opening_per_travel=found.factor,
        unsampled_mm=[list(gap) for gap in found.gaps],
        pressure_MPa=_listed(found.beside.get("pressure")),
        volume_mm3=_listed(found.beside.get("volume")),
        snap_pressure_MPa=found.snap_pressure,
    )


def _listed(values: Array | None) -> list[float | None] | None:
    return None if values is None else [*values.tolist()]


def grid_of(law: FittedGridLaw) -> Grid:
    """The points of a grid, its scaling laws if it has them, and its leave-one-out errors."""
    points = law.points
    columns = dict(zip(points.over, points.geometry.T.tolist(), strict=True))
    left_out = {key: law.leave_one_out(key)[0] for key in points.quantities}
    is_scaling = law.method is GridMethod.SCALING
    reference = dict(zip(points.over, points.reference.tolist(), strict=True))
    return Grid(
        method=law.method.value,
        over=list(points.over),
        points={**columns, **{key: v.tolist() for key, v in points.quantities.items()}},
        reference=reference if is_scaling else None,
        scaling={k: _scaling_of(law, k) for k in points.quantities} if is_scaling else None,
        leave_one_out={k: v for k, v in left_out.items() if math.isfinite(v)} or None,
    )


def grid_doubts(law: FittedGridLaw, table: GridTable) -> Iterator[str]:
    """Warnings about a table of points."""
    yield from table.doubts
    if table.ignored:
        yield f"columns not used, since they hold text: {', '.join(table.ignored)}"
    taken = [key for key in Values.model_fields if key != "linear_stiffness_N_per_mm"]
    unused = {key: get_close_matches(key, taken, n=1) for key in table.quantities}
    names = [
        key + (f" (did you mean {close[0]}?)" if close else "")
        for key, close in unused.items()
        if key not in taken
    ]
    if names:
        yield f"nothing that specs take from a grid, fitted all the same: {', '.join(names)}"
    if any(np.isnan(law.leave_one_out(key)[0]) for key in table.quantities):
        yield "too few points to leave one out: nothing is known about the error between them"


def _scaling_of(law: FittedGridLaw, key: str) -> ScalingLaw:
    fit, over = law.scaling(key), law.points.over
    errors = fit.standard_errors.tolist()
    is_known = bool(np.isfinite(fit.standard_errors).all())
    return ScalingLaw(
        at_reference=float(np.exp(fit.values[0])),
        standard_error=errors[0] if is_known else None,
        exponents=dict(zip(over, fit.values[1:].tolist(), strict=True)),
        standard_errors=dict(zip(over, errors[1:], strict=True)) if is_known else None,
    )
