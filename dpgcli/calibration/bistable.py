"""The published law's three values from a dome's curve.

E = ½ k_b x² [1 + (1−α)(x²/d² − 2x/d)] at the opening x = f u that a travel u stands for. Energies
are compared as they are, forces as f F(x), since dE/du = f dE/dx.
"""

from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from functools import partial

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.beginning import beginning_warnings, check_sign
from dpgcli.calibration.branches import branch_of, in_time, ways, with_hysteresis
from dpgcli.calibration.choices import (
    LINEARITY,
    STIFFNESS,
    STROKE,
    Branches,
    CurveQuantity,
    Loss,
    Rule,
)
from dpgcli.calibration.fits import Fit, Parameter, fit, mean_errors
from dpgcli.calibration.opening import OpeningRule
from dpgcli.calibration.record import (
    Record,
    cleaned,
    in_order,
    inverted_well,
    lag1_autocorrelation,
    quasi_static,
    record_warnings,
    rings,
    unsampled,
    work,
)
from dpgcli.calibration.snap import snap_pressure
from dpgcli.errors import FitError
from dpgcli.mechanics import laws
from dpgcli.mechanics.curve import FEWEST_POINTS
from dpgcli.records import dataclass

BISTABLE_LIMIT = (
    1.0 / 9.0
)  # of α: from it on, the law has one well only (9β² − 8β ≤ 0 with β = 1 − α)
NEAR_LIMIT_FRACTION = 0.9  # from it on, the hinge may cost the second well
LOW_R_SQUARED = 0.95  # below it, a warning
HIGH_AUTOCORRELATION = 0.5  # correlation of neighboring residuals; above it, a warning
STROKE_BOUNDS = (0.01, 100.0)  # of the largest opening: bounds of the stroke


ADDED_UP = (
    "bootstrap: errors of a work add up along the curve, and intervals from points that are drawn "
    "one by one are too narrow: take the standard errors"
)
UNITS = {
    CurveQuantity.ENERGY: "mJ",
    CurveQuantity.WORK: "mJ",
    CurveQuantity.FORCE: "N",
    CurveQuantity.PRESSURE: "N",
}


@dataclass(frozen=True)
class BistableOptions:
    """Options of a fit: mapping, quantity, part of the record, loss; `fixed` are values by key.

    Without `branches` both are fitted, if they are not too far apart.
    """

    opening: OpeningRule
    quantity: CurveQuantity
    branches: Branches | None = None
    area: float = float("nan")
    fixed: Mapping[str, float] | None = None
    loss: Loss = Loss.LINEAR
    loss_scale: float | None = None
    resamples: int = 0
    seed: int = 0

    @property
    def is_quasi_static(self) -> bool:
        """Whether only slow pieces are fitted."""
        return self.branches is Branches.QUASI_STATIC


@dataclass(frozen=True)
class BistableFit:
    """The fit, the points it was made to (travel in mm; energy in mJ or force in N), and the curve.

    `factor` is x/u; `well` the travel of the data's inverted well, None if not sampled; `gaps`
    stretches without data; `curve` travel and energy by travel, None where the energy is not known;
    `beside` pressure (MPa) and swept volume (mm³) at its travels, as far as they were recorded;
    `snap_pressure` (MPa) that at which the dome snapped; `warnings` those of the fit and the data.
    """

    fit: Fit
    travel: Array
    observed: Array
    factor: float
    well: float | None
    gaps: list[tuple[float, float]]
    curve: tuple[Array, Array] | None
    warnings: tuple[str, ...]
    beside: Mapping[str, Array] = field(default_factory=dict)
    snap_pressure: float | None = None


def law(opening: Array, values: Array, quantity: CurveQuantity) -> Array:
    """Energy (mJ) or force (N, by the opening) of the law; `values` are k_b, α, d.

    >>> at_stroke = law(np.array([3.5]), np.array([12.84, 0.043, 3.5]), CurveQuantity.ENERGY)
    >>> round(float(at_stroke[0]), 8)  # ½ α k_b d²
    3.381735
    """
    response = laws.bistable(opening, values[0], values[1], values[2])
    return response.energy if UNITS[quantity] == "mJ" else response.force


def slopes(opening: Array, values: Array, quantity: CurveQuantity) -> Array:
    """Derivatives of `law` by k_b, α and d, shape (point, 3).

    With u = x/d, β = 1−α: E_α = ½ k_b x² u(2−u), E_d = k_b x² β u(1−u)/d,
    F_α = k_b x u(3−2u), F_d = k_b x β u(3−4u)/d; both are proportional to k_b. Our derivation.
    """
    stiffness, linearity, stroke = values
    relative, softening = opening / stroke, 1.0 - linearity
    by_stiffness = law(opening, np.array([1.0, linearity, stroke]), quantity)
    if UNITS[quantity] == "mJ":
        size = stiffness * opening**2 * relative
        by_linearity = 0.5 * size * (2.0 - relative)
        by_stroke = size * softening * (1.0 - relative) / stroke
    else:
        size = stiffness * opening * relative
        by_linearity = size * (3.0 - 2.0 * relative)
        by_stroke = size * softening * (3.0 - 4.0 * relative) / stroke
    return np.stack((by_stiffness, by_linearity, by_stroke), axis=1)


def rests(values: Array) -> laws.Rests:
    """Openings (mm) of the barrier and of the inverted well of the law; NaN if it has none.

    >>> top, well = rests(np.array([1.0, 0.0, 2.0]))  # symmetric wells
    >>> float(top), float(well)
    (1.0, 2.0)
    """
    stiffness, linearity, stroke = values
    return laws.PUBLISHED.rests(laws.Dome(stiffness, linearity, stroke, contact=np.zeros(())))


def fit_bistable(record: Record, choice: BistableOptions) -> BistableFit:
    """Fit the published law to a record of a dome.

    Raises FitError if the record lacks what is asked for, or the fit fails.
    """
    snapped_at = snap_pressure(record)
    if choice.branches in (Branches.LOADING, Branches.UNLOADING):
        record = branch_of(record, choice.branches)
    ordered, said = in_order(_by_travel(record))
    if choice.quantity is not CurveQuantity.ENERGY:
        check_sign(ordered)
    observed = _observed(ordered, choice)
    kept = np.ones(len(observed), bool)
    warnings = [*said, *record_warnings(ordered, is_cut=choice.is_quasi_static)]
    warnings += beginning_warnings(ordered)
    if choice.is_quasi_static:
        kept, cut = quasi_static(ordered)
        warnings.append(cut)
    curve, observed = ordered.points(kept), observed[kept]
    well = inverted_well(curve)
    factor = _factor(choice.opening, well)
    along = _along(curve, choice)
    found = _fitted(factor * curve.travel, observed, factor, choice, along)
    if choice.branches not in (Branches.LOADING, Branches.UNLOADING):
        found, differing = _with_hysteresis(
            found, curve if choice.is_quasi_static else record, choice, factor
        )
        warnings += differing
    energies = None
    try:
        energies = _energies(curve, observed, choice)
    except FitError as error:
        warnings.append(f"no curve written: {error}")
    gaps = unsampled(curve.travel)
    result = BistableFit(
        found,
        curve.travel,
        observed,
        factor,
        well,
        gaps,
        energies,
        (),
        _beside(curve),
        snapped_at,
    )
    return replace(result, warnings=(*found.warnings, *warnings, *_judgments(result, along)))


def _by_travel(record: Record) -> Record:
    """The record by its travel where that goes to and fro, which is no fault of it."""
    if record.time is not None or ways(record) is None:
        return record
    return record.points(np.argsort(record.travel, kind="stable"))


def _with_hysteresis(
    found: Fit, record: Record, choice: BistableOptions, factor: float
) -> tuple[Fit, tuple[str, ...]]:
    """The fit with what its two branches say of its errors; a ringing dome has none."""
    if rings(in_time(record)):
        return found, ()
    alone = partial(_alone, replace(choice, resamples=0), factor)
    is_asked = choice.branches is not None
    return with_hysteresis(record, found, alone, is_asked=is_asked, is_cut=choice.is_quasi_static)


def _alone(choice: BistableOptions, factor: float, branch: Record) -> Fit:
    """The fit to a part of a record, with the mapping of the whole."""
    record, _ = in_order(_by_travel(branch))
    observed, along = _observed(record, choice), _along(record, choice)
    return _fitted(factor * record.travel, observed, factor, choice, along)


def _observed(record: Record, choice: BistableOptions) -> Array:
    """The observations to fit: energies in mJ, or forces along the travel in N."""
    if choice.quantity is CurveQuantity.WORK:
        return work(record)
    column = getattr(record, choice.quantity.value)
    if column is None:
        raise FitError(f"no {choice.quantity.value} in the curve")
    return np.asarray(column * choice.area if choice.quantity is CurveQuantity.PRESSURE else column)


def _along(record: Record, choice: BistableOptions) -> Array | None:
    """What work is the integral over, whose errors add up along it; None of other quantities."""
    if choice.quantity is not CurveQuantity.WORK:
        return None
    return record.volume if record.force is None else record.travel


def _factor(opening: OpeningRule, well: float | None) -> float:
    if opening.rule is not Rule.STROKE:
        return opening.amount
    if well is None:
        raise FitError(
            "the curve does not show where the inverted dome rests, so no travel stands for the "
            f"opening of {opening.amount:g} mm: give proportional:FACTOR instead"
        )
    return opening.amount / well


def _fitted(
    opening: Array, observed: Array, factor: float, choice: BistableOptions, along: Array | None
) -> Fit:
    size = 1.0 if UNITS[choice.quantity] == "mJ" else factor
    return fit(
        _parameters(opening, observed / size, choice),
        lambda values: size * law(opening, values, choice.quantity) - observed,
        lambda values: size * slopes(opening, values, choice.quantity),
        observed=observed,
        loss=choice.loss,
        loss_scale=choice.loss_scale,
        resamples=choice.resamples,
        seed=choice.seed,
        along=along,
    )


def _parameters(opening: Array, observed: Array, choice: BistableOptions) -> list[Parameter]:
    """Parameters with starts: the best of a few strokes and linearities, at the best stiffness."""
    fixed = choice.fixed or {}
    largest = float(np.abs(opening).max())
    if largest == 0.0:
        raise FitError("the travel is 0 throughout")
    strokes = (
        [fixed[STROKE]] if STROKE in fixed else (largest * np.geomspace(0.2, 5.0, 60)).tolist()
    )
    linearities = [fixed[LINEARITY]] if LINEARITY in fixed else [0.005, 0.02, 0.05, 0.1, 0.3, 0.9]
    best = (np.inf, 1.0, 0.05, largest)
    for stroke in strokes:
        for linearity in linearities:
            unit = law(opening, np.array([1.0, linearity, stroke]), choice.quantity)
            size = float((unit**2).sum()) or 1.0
            stiffness = fixed.get(STIFFNESS, max(float(unit @ observed) / size, 0.0))
            cost = float(((stiffness * unit - observed) ** 2).sum())
            best = min(best, (cost, stiffness, linearity, stroke))
    _, stiffness, linearity, stroke = best
    if stiffness == 0.0:
        raise FitError("no positive stiffness follows the curve: is its sign the other way round?")
    return [
        Parameter(STIFFNESS, stiffness, 1e-6 * stiffness, np.inf, STIFFNESS not in fixed),
        Parameter(LINEARITY, linearity, 0.0, 1.0, LINEARITY not in fixed),
        _stroke(stroke, largest, is_free=STROKE not in fixed),
    ]


def _stroke(start: float, largest: float, *, is_free: bool) -> Parameter:
    if not is_free:
        return Parameter(STROKE, start, is_free=False)
    return Parameter(STROKE, start, STROKE_BOUNDS[0] * largest, STROKE_BOUNDS[1] * largest)


def _energies(record: Record, observed: Array, choice: BistableOptions) -> tuple[Array, Array]:
    """The dome's energy by travel. Raises FitError if it is not known."""
    if not choice.is_quasi_static and rings(record):
        raise FitError("its energies are those of a ringing dome")
    if UNITS[choice.quantity] == "mJ":
        travel, energy = cleaned(record.travel, observed)
    elif record.energy is not None:
        travel, energy = cleaned(record.travel, record.energy)
    else:
        travel, force = cleaned(record.travel, observed)
        energy = work(Record(travel, force=force))
    if len(travel) < FEWEST_POINTS:
        raise FitError(f"expected {FEWEST_POINTS} points or more, found {len(travel)}")
    return travel, energy


def _beside(record: Record) -> dict[str, Array]:
    """Pressure and volume at the travels of the dome's energies."""
    columns = {"pressure": record.pressure, "volume": record.volume}
    return {
        name: cleaned(record.travel, values)[1]
        for name, values in columns.items()
        if values is not None
    }


def _judgments(found: BistableFit, along: Array | None) -> Iterator[str]:
    """Warnings about the fitted values."""
    linearity = float(found.fit.values[1])
    hinge = "the hinge takes another 8/9 k_theta/(k_b H^2) off that limit"
    if linearity >= BISTABLE_LIMIT:
        yield f"not bistable: force_linearity {linearity:.4g} is not below 1/9, and {hinge}"
    elif linearity >= NEAR_LIMIT_FRACTION * BISTABLE_LIMIT:
        yield f"hardly bistable: force_linearity {linearity:.4g} is close to 1/9, and {hinge}"
    yield from _unsampled_points(found)
    if found.fit.r_squared < LOW_R_SQUARED:
        yield f"the law does not follow the curve: R^2 = {found.fit.r_squared:.3f}"
    if along is None:
        errors = found.fit.residuals[np.argsort(found.travel, kind="stable")]
    else:
        errors = mean_errors(found.fit.residuals, along)[::2]  # neighbors share an error
        if found.fit.intervals is not None:
            yield ADDED_UP
    rho = lag1_autocorrelation(errors)
    if rho > HIGH_AUTOCORRELATION and found.fit.rms > 1e-6 * np.abs(found.observed).max():
        factor = np.sqrt((1.0 + rho) / (1.0 - rho))
        yield (
            f"neighboring residuals are alike (correlation {rho:.2f}): the law has another shape "
            f"than the curve, and standard errors are too small by a factor of about {factor:.1f}"
        )


def _unsampled_points(found: BistableFit) -> Iterator[str]:
    at_rest = rests(found.fit.values)
    top, well = (float(opening) / found.factor for opening in at_rest)
    largest = float(found.travel.max())
    if found.well is None:
        yield _unseen_well(found, well)
    if np.isnan(top):
        return
    height = float(law(at_rest.top, found.fit.values, CurveQuantity.ENERGY))
    barrier = f"the barrier of the fitted law, {height:.4g} mJ at {top:.4g} mm, is an extrapolation"
    for start, end in found.gaps:
        if start < top < end:
            yield f"nothing is sampled from {start:.4g} to {end:.4g} mm: {barrier}"
    if top > largest:
        yield f"nothing is sampled beyond {largest:.4g} mm: {barrier}"


def _unseen_well(found: BistableFit, well: float) -> str:
    """What is to be said of the law's inverted well (mm of travel) where the data show none."""
    largest = float(found.travel.max())
    gap = next((gap for gap in found.gaps if gap[0] < well < gap[1]), None)
    if np.isnan(well) or well > largest or gap is not None:
        said = f"the inverted well is not sampled (travel up to {largest:.4g} mm)"
        if gap is not None:
            said = (
                f"the inverted well is not sampled (nothing from {gap[0]:.4g} to {gap[1]:.4g} mm)"
            )
        where = f"; the fitted one, at {well:.4g} mm, is an extrapolation"
        return said if np.isnan(well) else said + where
    return (
        f"the data alone do not show where the inverted dome rests; the law has it at {well:.4g} "
        "mm, within the data"
    )
