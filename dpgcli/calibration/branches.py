"""Loading and unloading of a recorded dome, and what their difference does to fitted values.

Loading is travel towards inversion. A dome of plastic or rubber gives back less than it took: its
springs are between those of the two branches, and no record tells where.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.calibration.choices import LAW_KEYS, Branches
from dpgcli.calibration.fits import Fit
from dpgcli.calibration.record import SMALLEST_SWING, Record
from dpgcli.errors import Field, FitError, Message
from dpgcli.records import dataclass

FEWEST_IN_RUN = 4  # points on the way between turns, in the mean: fewer are points in no order
SMALLEST_SHARE = 0.5  # of the travel: a branch that covers less has no fit of its own
SIGNIFICANT = 3.0  # standard errors of a difference
SMALLEST_DIFFERENCE = 1e-3  # of a value: less is not worth a word
FARTHEST = 2.0  # times: stiffnesses farther apart have no middle that means anything
CHOICES = (Field("branches"), " loading or unloading takes one of them")


@dataclass(frozen=True)
class Ways:
    """Which points of a record are of loadings and of unloadings, (point,), and of the runs."""

    loading: Flags
    unloading: Flags
    runs: tuple[tuple[int, int], ...]


def turns(travel: Array) -> list[int]:
    """Places where a travel turns back by more than 2 % of its range, its two ends included.

    >>> turns(np.array([0.0, 1.0, 0.99, 2.0, 1.0, 0.0, 1.0]))
    [0, 3, 5, 6]
    """
    swing = SMALLEST_SWING * float(np.ptp(travel))
    values = travel.tolist()
    found, low, high, is_up, is_down = [0], 0, 0, True, True
    for place, value in enumerate(values):
        high = place if value > values[high] else high
        low = place if value < values[low] else low
        if is_up and values[high] - value > swing:
            found += [high] if high else []
            is_up, is_down, low = False, True, place
        elif is_down and value - values[low] > swing:
            found += [low] if low else []
            is_up, is_down, high = True, False, place
    return [*found, len(values) - 1]


def ways(record: Record) -> Ways | None:
    """Loading and unloading of a record in the order of its time, else of its points.

    None where its points are in no order.

    >>> found = ways(Record(np.array([0.0, 1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 0.0])))
    >>> int(found.loading.sum()), int(found.unloading.sum())
    (5, 4)
    """
    travel = record.travel
    if len(travel) < FEWEST_IN_RUN:
        return None
    ends = turns(travel)
    runs = tuple(pairwise(ends))
    if len(travel) < FEWEST_IN_RUN * len(runs):
        return None
    flags = {True: np.zeros(len(travel), bool), False: np.zeros(len(travel), bool)}
    for first, last in runs:
        begin = first + (first > 0)  # a turning point is of the way to it
        flags[bool(travel[last] >= travel[first])][begin : last + 1] = True
    return Ways(flags[True], flags[False], runs)


def in_time(record: Record) -> Record:
    """The record in the order of its time, where it has one."""
    if record.time is None:
        return record
    return record.points(np.argsort(record.time, kind="stable"))


def branch_of(record: Record, branch: Branches) -> Record:
    """One branch, as a static curve. Raises FitError where there is none."""
    record = in_time(record)
    found = ways(record)
    if found is None:
        raise FitError(Field("branches"), f" {branch}: the points are in no order of travel")
    flags = found.loading if branch is Branches.LOADING else found.unloading
    if not flags.any():
        other = "goes" if branch is Branches.UNLOADING else "comes back"
        raise FitError(Field("branches"), f" {branch}: the travel only {other}")
    return replace(record.points(flags), time=None)


def with_hysteresis(
    record: Record,
    found: Fit,
    alone: Callable[[Record], Fit],
    *,
    is_asked: bool,
    is_cut: bool = False,
) -> tuple[Fit, tuple[str, ...]]:
    """A fit to both branches whose errors have half their difference in them, and what to say.

    `alone` fits a static curve. `is_asked` is whether somebody wants both, however far apart they
    are, `is_cut` whether only slow pieces are left. Raises FitError where they are too far apart.
    """
    record = in_time(record)
    both = ways(record)
    if both is None or not both.loading.any() or not both.unloading.any():
        return found, ()
    parts = {"loading": both.loading, "unloading": both.unloading}
    if short := [name for name, flags in parts.items() if _share(record, flags) < SMALLEST_SHARE]:
        return found, () if is_cut else (_too_short(record, short[0], parts[short[0]]),)
    try:
        fits = [alone(replace(record.points(flags), time=None)) for flags in parts.values()]
    except FitError as error:
        if is_asked:
            return found, (Message("one branch alone has no fit: ", str(error)),)
        raise FitError(
            f"loading and unloading are two curves, one of which alone has no fit ({error}): ",
            *CHOICES,
            ", both fits them as one",
        ) from error
    _check_near(fits, is_asked=is_asked)
    said = list(_cycles(record, both, alone))
    if not _differ(fits):
        return found, tuple(said)
    half = np.where(_is_known(found), 0.5 * (fits[0].values - fits[1].values), 0.0)
    return _widened(found, half), (_difference(fits), *said)


def _share(record: Record, flags: Flags) -> float:
    return float(np.ptp(record.travel[flags]) / (np.ptp(record.travel) or 1.0))


def _too_short(record: Record, name: str, flags: Flags) -> Message:
    travel = record.travel[flags]
    return Message(
        f"{int(flags.sum())} points of {name}, from {travel.min():.4g} to {travel.max():.4g} mm, "
        "are fitted with the others; ",
        *CHOICES,
    )


def _is_known(fit: Fit) -> Flags:
    return np.array([p.is_free for p in fit.parameters]) & ~fit.at_bound


def _differ(fits: Sequence[Fit]) -> bool:
    """Whether a value of two fits differs by more than their errors let expect."""
    one, other = fits
    apart = np.abs(one.values - other.values)
    errors = np.hypot(*(np.nan_to_num(fit.standard_errors) for fit in fits))
    sizes = np.maximum(np.abs(one.values), np.abs(other.values))
    return bool(((apart > SIGNIFICANT * errors) & (apart > SMALLEST_DIFFERENCE * sizes)).any())


def _check_near(fits: Sequence[Fit], *, is_asked: bool) -> None:
    low, high = sorted(float(fit.values[0]) for fit in fits)
    if high > FARTHEST * low and not is_asked:
        values = " and ".join(f"{fit.values[0]:.4g}" for fit in fits)
        raise FitError(
            f"loading and unloading are two curves: {LAW_KEYS[0]} {values} of each alone: ",
            *CHOICES,
            ", both fits them as one",
        )


def _widened(found: Fit, half: Array) -> Fit:
    """The fit whose values may be as far off as either branch: two values, as likely as each other.

    The covariance of such a choice between v - h and v + h is h hᵀ.
    """
    covariance = found.covariance + np.outer(half, half)
    errors = np.hypot(found.standard_errors, half)
    intervals = found.intervals
    if intervals is not None:
        intervals = intervals + np.abs(half)[:, None] * np.array([-1.0, 1.0])
    return replace(found, covariance=covariance, standard_errors=errors, intervals=intervals)


def _difference(fits: Sequence[Fit]) -> Message:
    one, other = (fit.values for fit in fits)
    values = ", ".join(
        f"{parameter.key} {a:.4g} and {b:.4g}"
        for parameter, a, b, is_known in zip(
            fits[0].parameters, one, other, _is_known(fits[0]), strict=True
        )
        if is_known
    )
    return Message(
        f"hysteresis: loading and unloading alone give {values}; standard errors include half the "
        "difference; ",
        *CHOICES,
    )


def _cycles(record: Record, both: Ways, alone: Callable[[Record], Fit]) -> Iterator[str]:
    """What repeated loadings have in common, or not: a dome softens in its first ones."""
    loadings = [
        replace(record.points(np.arange(first, last + 1)), time=None)
        for first, last in both.runs
        if record.travel[last] > record.travel[first]
    ]
    long = [run for run in loadings if np.ptp(run.travel) >= SMALLEST_SHARE * np.ptp(record.travel)]
    if len(long) < 2:
        return
    try:
        fits = [alone(long[0]), alone(long[-1])]
    except FitError:
        return
    if _differ(fits):
        values = " and ".join(f"{fit.values[0]:.4g}" for fit in fits)
        yield (
            f"{len(long)} loadings are fitted as one; the first and the last alone give "
            f"{LAW_KEYS[0]} {values}"
        )
