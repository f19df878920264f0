"""Accuracy levels of the same states, from cheap to exact, each with an error bound.

The bounds are known before any pattern is solved, and hold for all of them. Each is a sum over
units of how far the unit may turn, times the length of the finger (our derivation):

- rigid bars: what the bars' flexibility does to the unit, to first order in 1/k_L
- a residual of τ times the forces in play: the corners' answer to moments of τ F H, which is
  1/λ per moment, λ the smallest eigenvalue of the unit's Hessian by its two corners
- rounding: a few units in the last place, times the finger's softness F H/λ

All are doubled for what is left out. Where bars are so soft, or a unit so close to losing its
second well, that a single unit does not show what the finger does, there is no bound.
"""

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from dpgcli.arrays import Array, Indices, distinct
from dpgcli.errors import Field, UsageError
from dpgcli.mechanics.coordinates import Internal
from dpgcli.mechanics.terms import chain_potential
from dpgcli.records import dataclass
from dpgcli.states.guess import without_first
from dpgcli.states.rigid_unit import single_units
from dpgcli.states.tip import TIP_ROUNDING
from dpgcli.states.units import UnitSolutions

SAFETY = 2.0
SMALLEST_TOLERANCE, LARGEST_TOLERANCE = 1e-14, 1e-3  # below, rounding decides
DEFAULT_TOLERANCE = 1e-12


@dataclass(frozen=True)
class AccuracyLevel:
    """An accuracy level: with or without elastic bars, and to which tolerance.

    `tolerance` is the largest residual over the forces in play.
    """

    name: str
    drops_bars: bool
    tolerance: float


ACCURACY_LEVELS = (  # from the cheapest to the most exact
    AccuracyLevel("rigid bars", True, DEFAULT_TOLERANCE),
    *(AccuracyLevel(f"tolerance {t:g}", False, t) for t in (1e-3, 1e-6, 1e-9, DEFAULT_TOLERANCE)),
)


def check_exactness(tolerance: float, target_error: float | None) -> None:
    """Raise UsageError for a tolerance or a target error (mm) that makes no sense."""
    if not SMALLEST_TOLERANCE <= tolerance <= LARGEST_TOLERANCE:
        raise UsageError(
            Field("tolerance"),
            f" {tolerance}: expected {SMALLEST_TOLERANCE} … {LARGEST_TOLERANCE} "
            "of the forces in play; below, rounding decides",
        )
    if target_error is None:
        return
    if not 0.0 < target_error < np.inf:
        raise UsageError(Field("target_error"), f" {target_error} mm: expected a length > 0")
    if tolerance != DEFAULT_TOLERANCE:
        raise UsageError(Field("target_error"), " chooses the tolerance: drop ", Field("tolerance"))


@dataclass(frozen=True)
class Exactness:
    """The exactness of some fingers' states: a tolerance, or an accuracy level.

    `scene_units` are those of the fingers as they were given.
    """

    scene_units: UnitSolutions
    tolerance: float
    accuracy_level: AccuracyLevel | None = None

    @property
    def drops_bars(self) -> bool:
        """Whether the fingers are solved without their bars."""
        return self.accuracy_level is not None and self.accuracy_level.drops_bars

    @cached_property
    def units(self) -> UnitSolutions:
        """The units of the fingers as they are solved."""
        if not self.drops_bars:
            return self.scene_units
        return UnitSolutions.of(self.scene_units.finger.with_bars(np.inf))

    @cached_property
    def error_bounds(self) -> Array:
        """Bound on the error of every tip before the work, mm, (design,); infinite where none."""
        bounds = error_bounds(self.scene_units)
        return np.asarray(
            bounds[ACCURACY_LEVELS.index(self.accuracy_level) if self.accuracy_level else -1]
        )

    @cached_property
    def dropped_error(self) -> Array:
        """Bound on the tip displacement by the bars that were dropped, mm, (design,)."""
        if not self.drops_bars:
            return np.zeros(self.scene_units.finger.n_designs)
        return bar_flexibility(self.scene_units)


def exactnesses(
    units: UnitSolutions, tolerance: float, target_error: float | None, *, needs_bars: bool = False
) -> Iterator[tuple[Indices, Exactness]]:
    """The exactness of each design: the tolerance, or the cheapest level for the target error.

    With a target error (mm) each design takes the cheapest level that is bounded by it; rigid bars
    are none where something `needs_bars`. Designs of one level come together.
    """
    if target_error is None:
        yield np.arange(units.finger.n_designs), Exactness(units, tolerance)
        return
    bounds = error_bounds(units)
    if needs_bars:
        bounds[0] = np.inf
    chosen = cheapest(bounds, target_error)
    for index in distinct(chosen):
        places = np.flatnonzero(chosen == index)
        some = units if len(places) == len(chosen) else units.take_lanes(places)
        yield places, Exactness(some, ACCURACY_LEVELS[index].tolerance, ACCURACY_LEVELS[index])


def error_bounds(units: UnitSolutions) -> Array:
    """Bound on the tip's error (mm) by each level, shape (level, design); infinite where none.

    The first level needs elastic bars to drop, and a second well of every unit without them. What
    dead loads do to a finger is not known before.
    """
    finger = units.finger
    softness, length = _softness(units), finger.straight_length
    rounding = 10.0 * TIP_ROUNDING * (1.0 + finger.n_units / 64.0 + softness) * length
    bounds = [
        SAFETY * 2.0 * level.tolerance * softness * length
        + rounding
        + (dropped_bars(units) if level.drops_bars else 0.0)
        for level in ACCURACY_LEVELS
    ]
    is_unknown = units.are_soft.any(axis=0) | finger.is_loaded
    return np.where(is_unknown, np.inf, np.stack(bounds))


def cheapest(bounds: Array, target: float) -> Indices:
    """Index of the first level whose bound meets the target (mm), by design; else of the last."""
    meets = bounds <= target
    return np.where(meets.any(axis=0), meets.argmax(axis=0), len(ACCURACY_LEVELS) - 1)


def dropped_bars(units: UnitSolutions) -> Array:
    """Bound on how far dropping the bars moves the tip (mm), shape (design,)."""
    if units.finger.is_rigid:
        return np.full(units.wells.exists.shape[1], np.inf)
    exists = np.asarray(units.wells.exists.all(axis=0))
    return np.where(exists, bar_flexibility(units), np.inf)


def bar_flexibility(units: UnitSolutions) -> Array:
    """Bound on how far the bars' flexibility moves the tip (mm), in any state, (design,).

    Twice the sum, over units, of what each unit's bars do to first order; infinite under dead
    loads, which bars bear as well.
    """
    if units.finger.is_loaded:
        return np.full(units.wells.exists.shape[1], np.inf)
    unit = units.first_order
    per_unit = np.abs(unit.chord) + units.finger.straight_length * unit.turn
    shape = (units.finger.n_units, per_unit.shape[1])
    return np.asarray(SAFETY * np.broadcast_to(per_unit, shape).sum(axis=0))


def _softness(units: UnitSolutions) -> Array:
    """Σ F H/λ over the units: their turning by moments of the size of those in play."""
    finger = units.finger
    moment = finger.force_scale * finger.segment_height
    with np.errstate(divide="ignore", over="ignore"):  # without hinges a unit is a mechanism
        softness = moment / _corner_stiffness(units)
    return np.asarray(np.broadcast_to(softness, (finger.n_units, softness.shape[1])).sum(axis=0))


def _corner_stiffness(units: UnitSolutions) -> Array:
    """Smallest eigenvalue λ (N mm/rad) by a unit's two corners, in any well, (unit, design)."""
    finger, shape = single_units(units.finger)
    angle = np.where(units.wells.exists, units.wells.angle, 0.0)
    angle = np.broadcast_to(angle, shape).reshape(1, -1)
    bent = finger.with_bars(np.inf)
    rest = np.zeros((1, 1))
    wall = np.where(units.wells.exists, units.first_order.wall, 0.0).reshape(1, -1)
    least = np.full_like(angle, np.inf)
    for inverted in (False, True):
        corner, yielded = angle * inverted, wall * inverted
        potential = chain_potential(bent.with_domes(np.full(angle.shape, inverted)))
        at = potential.coordinates.of_shape(Internal(rest, corner, corner, rest, yielded))
        band = potential.evaluate(at).hessian
        band = without_first(band) if finger.has_walls else band
        least = np.minimum(least, band[0, 0] - np.abs(band[1, 0]))
    return np.where(least > 0.0, least, 0.0).reshape(shape)
