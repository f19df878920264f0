"""Fits as rows and in words: values, their errors, and the quality of the fit."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from dpgcli.arrays import Columns
from dpgcli.calibration.bistable import UNITS, BistableFit, BistableOptions, rests
from dpgcli.calibration.choices import GridMethod, Rule, Target
from dpgcli.calibration.finger import FingerFit
from dpgcli.calibration.fits import Fit
from dpgcli.calibration.grid import FittedGridLaw
from dpgcli.calibration.hinge import HingeFit
from dpgcli.calibration.observations import UNITS as UNITS_OF_TARGETS
from dpgcli.calibration.observations import residual_unit, rms
from dpgcli.design.dimensions import unit_of
from dpgcli.files.measured import GridTable
from dpgcli.states.columns import Column, Kind

VALUE_COLUMNS = (
    Column("key", "", "key of a spec's lattice section", kind=Kind.TEXT),
    Column("value", "", "the fitted or fixed value"),
    Column("standard_error", "", "its standard error"),
    Column("unit", "", "unit of both", kind=Kind.TEXT),
    Column("status", "", "free, fixed or at its bound", kind=Kind.TEXT),
)
INTERVAL_COLUMNS = (
    Column("lower", "", "lower end of the 95 % bootstrap interval"),
    Column("upper", "", "upper end of the 95 % bootstrap interval"),
)


def value_rows(fit: Fit) -> tuple[tuple[Column, ...], Columns]:
    """Columns, and a row for each parameter."""
    states = zip(fit.parameters, fit.at_bound, strict=True)
    rows: dict[str, Any] = {
        "key": np.array([parameter.key for parameter in fit.parameters]),
        "value": fit.values,
        "standard_error": fit.standard_errors,
        "unit": np.array([unit_of(parameter.key) for parameter in fit.parameters]),
        "status": np.array(
            ["at bound" if bound else "free" if p.is_free else "fixed" for p, bound in states]
        ),
    }
    if fit.intervals is None:
        return VALUE_COLUMNS, rows
    rows |= {"lower": fit.intervals[:, 0], "upper": fit.intervals[:, 1]}
    return VALUE_COLUMNS + INTERVAL_COLUMNS, rows


def quantity_rows(law: FittedGridLaw) -> tuple[tuple[Column, ...], Columns]:
    """Columns, and a row for each quantity of a grid.

    Its law if it has one, and how well others predict a point.
    """
    quantities = list(law.points.quantities)
    left_out = np.array([law.leave_one_out(key) for key in quantities]).reshape(-1, 2).T
    columns = [Column("quantity", "", "what is known at the points", kind=Kind.TEXT)]
    rows: dict[str, Any] = {"quantity": np.array(quantities)}
    if law.method is GridMethod.SCALING:
        fits = [law.scaling(key) for key in quantities]
        rows["at_reference"] = np.exp([fit.values[0] for fit in fits])
        rows["standard_error_percent"] = 100.0 * np.array([f.standard_errors[0] for f in fits])
        for place, key in enumerate(law.points.over, start=1):
            rows[f"exponent_{key}"] = np.array([fit.values[place] for fit in fits])
            rows[f"error_{key}"] = np.array([fit.standard_errors[place] for fit in fits])
    rows["left_out_largest_percent"], rows["left_out_rms_percent"] = 100.0 * left_out
    columns += [
        Column(name, "%" if name.endswith("percent") else "", "") for name in list(rows)[1:]
    ]
    return tuple(columns), rows


def quality(fit: Fit, unit: str) -> str:
    """The quality of a fit in words: residual, R², strongest correlation."""
    if fit.n_points <= sum(parameter.is_free for parameter in fit.parameters):
        return f"{fit.n_points} point{'s' * (fit.n_points != 1)}, met exactly"
    text = f"{fit.n_points} points: rms residual {fit.rms:.3g} {unit}"
    if np.isfinite(fit.r_squared):
        text += f", R^2 {fit.r_squared:.5f}"
    pairs = np.argwhere(np.triu(np.abs(fit.correlation) > 0.0, 1)).tolist()
    if pairs:
        first, second = max(pairs, key=lambda pair: abs(fit.correlation[*pair]))
        keys = [fit.parameters[place].key for place in (first, second)]
        text += (
            f"; strongest correlation {fit.correlation[first, second]:.2f}: {' and '.join(keys)}"
        )
    return text


def bistable_summary(found: BistableFit, choice: BistableOptions) -> Iterator[str]:
    """Quality, the assumed mapping, and the inverted wells of law and data."""
    how = "as given"
    if choice.opening.rule is Rule.STROKE:
        how = f"so that the inverted well opens {choice.opening.amount:g} mm"
    wells = [f"{found.well:.4g} mm in the data"] if found.well is not None else []
    well = float(rests(found.fit.values).well)
    wells += [] if math.isnan(well) else [f"{well / found.factor:.4g} mm in the law"]
    yield quality(found.fit, UNITS[choice.quantity])
    yield f"opening = {found.factor:.5g} travel, {how} (assumed, not fitted)"
    if wells:
        yield f"travel at the inverted well: {', '.join(wells)}"
    if found.snap_pressure is not None:
        yield f"snap pressure: {found.snap_pressure:.4g} MPa, the largest before the dome snapped"
    if choice.opening.rule is Rule.STROKE and not math.isnan(well):
        linearity, stroke = found.fit.values[1:]
        yield (
            f"stroke_mm {stroke:.4g} is the law's d, no place of rest: with a force linearity of "
            f"{linearity:.3g} its inverted dome rests at {well / stroke:.3f} d = {well:.4g} mm; "
            f"the {choice.opening.amount:g} mm asked for are where that of the data does"
        )


def hinge_summary(found: HingeFit) -> Iterator[str]:
    """Quality, and the secant stiffness at both ends if they differ."""
    yield quality(found.fit, "N mm")
    near, far = found.secants
    if near != far:
        yield f"M/theta {near:.4g} N mm/rad in the inner third, {far:.4g} in the outer third"


def finger_summary(study: FingerFit, found: Fit) -> Iterator[str]:
    """Quality, and errors of the tips before and after, and of each state from the others."""
    yield from _weighted_quality(study, found)
    for what, values in (("before", None), ("after", found)):
        relative = 100.0 * study.compared(values).relative
        if np.isfinite(relative).any():
            yield (
                f"tips {what}: {np.nanmax(relative):.3g} % of the deflection at worst, "
                f"{np.nanmean(relative):.3g} % in the mean"
            )
    left_out = 100.0 * study.left_out
    if np.isfinite(left_out).any():
        yield (
            f"each state from the others alone: {np.nanmax(left_out):.3g} % at worst, "
            f"{np.nanmean(left_out):.3g} % in the mean"
        )


def unit_summary(study: FingerFit, found: Fit) -> Iterator[str]:
    """Quality, the push of the data, and the errors of what moments turn the unit by."""
    yield from _weighted_quality(study, found)
    if study.known.patterns.any():
        spring, too_long = study.finger.bistable_stiffness.item(), study.finger.stroke.item()
        yield f"the push of the data: a spring of {spring:.4g} N/mm, {too_long:.4g} mm too long"
    else:
        yield "no inverted unit in the data: they do not say how walls yield"
    compared = study.compared(found)
    if Target.PUSHES not in study.targets and np.isfinite(compared.push).any():
        pushed = study.known.patterns.any(axis=0) & np.isfinite(compared.push)
        off, largest = compared.push[pushed].max(initial=0.0), np.nanmax(study.known.pushes)
        yield f"pushes, not fitted: {off:.3g} N off at worst, of up to {largest:.3g} N"
    errors = 100.0 * np.abs(compared.stiffness)
    for name, is_in in (("ground", False), ("inverted", True)):
        of_unit = errors[(study.known.patterns[0] == is_in) & np.isfinite(errors)]
        if len(of_unit):
            worst, mean = of_unit.max(), of_unit.mean()
            yield f"stiffness, {name}: {worst:.3g} % off at worst, {mean:.3g} % in the mean"


def _weighted_quality(study: FingerFit, found: Fit) -> Iterator[str]:
    """Quality of a fit, and what is left in each of several quantities."""
    yield quality(found, residual_unit(study.targets))
    if len(study.targets) > 1:
        for target, left in study.observations.by_target(found.residuals):
            how = "stated" if target in study.errors else "estimated"
            error, unit = study.observations.errors[target], UNITS_OF_TARGETS[target]
            yield f"{target}: rms residual {rms(left):.3g} {unit}, error {error:.3g} {unit} ({how})"


def grid_summary(law: FittedGridLaw, table: GridTable) -> Iterator[str]:
    """The number of points, their keys, and the values that all points share."""
    points = law.points
    reference = ", ".join(
        f"{key} {value:g}" for key, value in zip(points.over, points.reference, strict=True)
    )
    text = f"{len(points.geometry)} points over {', '.join(points.over)}"
    same = ", ".join(f"{key} {value:g}" for key, value in table.constant.items())
    text += f"; all at {same}" if same else ""
    yield text + (f"; reference {reference}" if law.method is GridMethod.SCALING else "")
