"""Why targets are not met: the bounds in the way and what they cost, targets that contradict."""

from collections.abc import Iterator, Sequence

import numpy as np

from dpgcli.arrays import Array
from dpgcli.search.goal import Goal
from dpgcli.search.search import Designs
from dpgcli.sweeps.evaluation import short_names
from dpgcli.text import enumerated

SHARE = 0.1  # of a range, by which a bound is moved in words
AGAINST = -0.5  # cosine of two targets' slopes, below which they pull against each other


def unmet_lines(goal: Goal, best: Designs, misses: Array, units: Sequence[str]) -> Iterator[str]:
    """What the best design misses (misses in the quantities' units), and what is in the way."""
    missed = [k for k, target in enumerate(goal.targets) if misses[k] > target.tolerance]
    if not missed:
        return
    for k in missed:
        target = goal.targets[k]
        amount = f"{misses[k]:.4g} {units[k]}".rstrip()
        tolerance = f"{target.tolerance:.4g} {units[k]}".rstrip()
        yield f"target {k + 1} ({target.text}) is missed by {amount}, tolerance {tolerance}"
    held = np.flatnonzero(best.held[:, 0])
    for k in held.tolist():
        yield _bound_line(goal, best, k)
    slopes = _slopes_of_misses(goal, best)[:, ~best.held[:, 0]]
    if pair := _contradiction(slopes):
        first, second = (f"target {k + 1}" for k in pair)
        yield f"{first} and {second} pull against each other: what brings one nearer misses the other"
    elif not len(held):
        yield "no bound is in the way: no descent found less within these ranges and values"


def _bound_line(goal: Goal, best: Designs, k: int) -> str:
    """How much less would be missed with a bound moved, to first order."""
    each, misfit = goal.ranges[k], float(best.misfits[0])
    is_high = best.points[k, 0] > 0.5
    slope = float((best.residuals.slopes[:, k, 0] * best.residuals.values[:, 0]).sum()) / misfit
    end = each.high + SHARE * each.width if is_high else each.low - SHARE * each.width
    less = max(misfit - SHARE * abs(slope), 0.0)
    name = short_names(goal.keys)[each.key]
    return (
        f"in the way: {name} {'<' if is_high else '>'}= {each.high if is_high else each.low:g}; with "
        f"{end:.4g} the misfit would go from {misfit:.3g} to about {less:.3g} tolerances"
    )


def _slopes_of_misses(goal: Goal, best: Designs) -> Array:
    """Slopes of half the square of each target's miss, (target, range)."""
    parts = best.residuals.slopes[..., 0] * best.residuals.values[:, [0]]
    ends = np.cumsum([len(target.values) for target in goal.targets])
    return np.stack([part.sum(axis=0) for part in np.split(parts, ends[:-1])])


def _contradiction(slopes: Array) -> tuple[int, int] | None:
    """The two targets that pull against each other most, if any do."""
    sizes = np.linalg.norm(slopes, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosines = np.nan_to_num(slopes @ slopes.T / np.outer(sizes, sizes))
    if not cosines.size or cosines.min() > AGAINST:
        return None
    first, second = np.unravel_index(int(cosines.argmin()), cosines.shape)
    return int(first), int(second)


def how_slopes_are_found(names: Sequence[str]) -> str:
    """That some slopes are not exact; empty where all are."""
    if not names:
        return ""
    return f"slopes of {enumerated(names)} by central differences: there are no exact ones"
