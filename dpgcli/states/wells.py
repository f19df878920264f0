"""Wells and barrier of one unit with rigid bars, and the moment it bears before it snaps.

By symmetry both corners open by m = φ/2, so x = 2H sin m, and a zero of the force other than
x = 0 is a root of r(u) = 1 + β(2u² − 3u) + κ φ/sin φ with u = x/d, κ = k_θ/(k_b H²). r is convex
(a quadratic plus a convex increasing function of a convex one), so there are at most two roots,
barrier and well, and Newton's method from outside reaches each monotonically. r(0) = α + β + κ
is positive. Our derivation; without the hinge the roots are u = [3β ± √(9β² − 8β)]/(4β).
"""

from dataclasses import fields, replace
from typing import Self

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.contracts import take_lanes
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.states.rigid_unit import SHORT_OF_LEVER, rigid_unit, tangent_of
from dpgcli.states.scan import MIDDLE, WIDEST, opened, pulls, scan
from dpgcli.states.straight import energy_at_rest, straight_rest

INFLECTION_BISECTIONS = 24


@dataclass(frozen=True)
class ByUnit:
    """Arrays of shape (unit or 1, design or 1)."""

    def take_lanes(self, index: Indices) -> Self:
        """The designs at `index`, in its order; a design may repeat."""
        arrays = (getattr(self, field.name) for field in fields(self))
        return type(self)(*(take_lanes(v, index) for v in arrays))

    def section(self, first: int, stop: int) -> Self:
        """The units first+1 … stop, counted from the base."""
        arrays = (getattr(self, field.name) for field in fields(self))
        return type(self)(*(v if len(v) == 1 else v[first:stop] for v in arrays))


@dataclass(frozen=True)
class Wells(ByUnit):
    """The inverted well of each unit, arrays of shape (unit or 1, design).

    Which one that is, under every law, between any bars and with any walls: of the wells beyond
    `spring_barrier` the one that lies deepest below the highest top before it, by the energy of the
    dome attached to its neighbor, hinge and wall included. `spring_barrier` is the x (mm) at which
    the dome's spring alone turns over, the highest top before the deepest well of its curve,
    infinite where there is none. A unit counts as inverted exactly where it is open beyond it: what
    holds the unit straight pulls back, so that it rests inverted only there. In a ripple before it
    a unit counts as not inverted, whatever the hinge makes of the ripple's depth. A dome that only
    pushes rests where it would rest if it were attached, as the hinge pulls back at any opening.

    `exists` says whether there is such a well; `angle` is its corner angle m (rad), `extension` its
    x (mm) and `barrier` the x at the highest top before it, negative where the dome turns over
    before it touches its neighbor. Where there is none, both are of the full stroke (of where a
    dome that only pushes still does) and `barrier` is the middle, so that a search can still begin.
    `from_top` and `to_top` (mm) are the tops that part it from other wells beyond `spring_barrier`,
    ripples of the curve, infinite where there are none: a state outside is another one.
    `snap_force` and `reset_force` (N, on the opening) are what a unit bears in its ground and in
    its inverted well; where there is no second well, `reset_force` is negative, what is lacking.
    A dome that only pushes does not act in the ground well, whose hinge bears anything. `rest` (mm)
    is the extension at which a unit that is not inverted rests, see `straight`: 0 under most laws.
    """

    exists: Flags
    extension: Array
    barrier: Array
    angle: Array
    spring_barrier: Array
    from_top: Array
    to_top: Array
    snap_force: Array
    reset_force: Array
    rest: Array


def inverted_wells(finger: Finger) -> Wells:
    """Find each unit's inverted well and barrier in the rigid limit.

    >>> from dpgcli.mechanics.finger import uniform_finger
    >>> unit = uniform_finger(
    ...     1, segment_length=13.5, segment_height=10.75, stroke=3.5,
    ...     bistable_stiffness=12.84, force_linearity=0.043, hinge_stiffness=24.2)
    >>> print(inverted_wells(unit).extension.round(6))  # mm
    [[3.245015]]
    """
    if finger.law.curve is not None or finger.has_walls:
        return _scanned_wells(finger)
    half_height = finger.stroke / (2.0 * finger.segment_height)
    hinge = finger.hinge_stiffness / (finger.bistable_stiffness * finger.segment_height**2)
    half_height, hinge, linearity = np.broadcast_arrays(half_height, hinge, finger.force_linearity)
    widest = np.minimum(WIDEST, SHORT_OF_LEVER / half_height)
    (well, barrier), exists = _roots(widest, half_height, hinge, linearity)
    exists &= barrier < well
    stroke = np.broadcast_to(finger.stroke, exists.shape)
    full = np.minimum(1.0, widest)
    extension = np.where(exists, well * stroke, opened(finger, widest * stroke))
    snap, reset = _extreme_slopes(finger, np.stack((0.0 * full, full)) * stroke)
    return Wells(
        exists,
        extension,
        np.where(exists, barrier, MIDDLE) * stroke,
        np.arcsin(extension / (2.0 * finger.segment_height)),
        _spring_barrier(finger),
        np.full(exists.shape, -np.inf),
        np.full(exists.shape, np.inf),
        snap if pulls(finger) else np.full(exists.shape, np.inf),
        -reset,
        np.zeros(exists.shape),
    )


def _spring_barrier(finger: Finger) -> Array:
    """Where the dome's spring alone turns over, mm; nowhere if it has no second well.

    0 where a dome has done so before it opens its unit.
    """
    top = finger.law.rests(finger.domes).top
    return np.asarray(np.where(np.isnan(top), np.inf, np.maximum(top, 0.0)))


def _extreme_slopes(finger: Finger, stiff: Array) -> Array:
    """The forces (N) where de/dx turns between `stiff` extensions (mm) and half a stroke.

    Half a stroke is where the spring is softest. A place is known to 1e-7 of it, and the force to
    the square of that.
    """
    soft = np.minimum(0.5 * finger.stroke, stiff.max(axis=0)) + 0.0 * stiff
    for _ in range(INFLECTION_BISECTIONS):
        middle = 0.5 * (stiff + soft)
        rises = rigid_unit(finger, middle).stiffness >= 0.0
        stiff, soft = np.where(rises, middle, stiff), np.where(rises, soft, middle)
    return rigid_unit(finger, stiff).force


def _scanned_wells(finger: Finger) -> Wells:
    """The inverted well of any law, with walls that give way too."""
    found = scan(finger)
    sine = found.extension / (2.0 * finger.segment_height)
    angle = np.arctan(tangent_of(finger, found.extension)) if finger.has_walls else np.arcsin(sine)
    return Wells(
        found.exists,
        found.extension,
        found.barrier,
        angle,
        _spring_barrier(finger),
        found.from_top,
        found.to_top,
        found.snap_force,
        found.reset_force,
        straight_rest(finger, found.barrier),
    )


@np.errstate(over="ignore")  # a slope of nearly nothing
def _roots(
    widest: Array, half_height: Array, hinge: Array, linearity: Array
) -> tuple[Array, Flags]:
    """Newton on r from above its roots and from below; false where a slope shows there is none."""
    relative = np.stack((widest, np.zeros_like(widest)))
    towards = np.array([1.0, -1.0])[:, None, None]  # the sign of the slope on the way
    beta = 1.0 - linearity
    exists = np.ones(relative.shape, bool)
    running = exists
    for _ in range(80):
        turn = 2.0 * np.arcsin(relative * half_height)
        ratio, ratio_slope = _turn_over_sine(turn)
        value = linearity + beta * (1.0 - relative) * (1.0 - 2.0 * relative) + hinge * ratio
        stretching = 2.0 * half_height / np.cos(0.5 * turn)
        slope = beta * (4.0 * relative - 3.0) + hinge * ratio_slope * stretching
        running = running & (value > 0.0)
        exists = exists & ~(running & (slope * towards <= 0.0))
        running = running & exists
        step = np.where(running, value, 0.0) / np.where(running, slope, 1.0)
        running = running & (np.abs(step) > 2e-16 * np.abs(relative))
        if not running.any():
            break
        step = np.where(running, step, 0.0)  # what has arrived stays, whoever else still runs
        relative = np.clip(relative - step, 0.0, widest)  # beyond only where there is no root
    return relative, np.asarray(exists.all(axis=0))


def _turn_over_sine(turn: Array) -> tuple[Array, Array]:
    """φ/sin φ and its derivative; a series where the quotient would cancel."""
    small = np.abs(turn) < 1e-2
    safe = np.where(small, 1.0, turn)
    sine = np.sin(safe)
    squared = turn * turn  # NumPy's own powers have other bits in batches of other sizes
    series = 1.0 + squared * (1.0 / 6.0 + 7.0 / 360.0 * squared)
    ratio = np.where(small, series, safe / sine)
    slope = (sine - safe * np.cos(safe)) / sine**2
    return ratio, np.where(small, turn * (1.0 / 3.0 + 7.0 / 90.0 * squared), slope)


def barriers(finger: Finger, wells: Wells) -> Array:
    """Smallest barrier (mJ) that keeps a unit of each design in its well, shape (design,).

    To snap or to reset, hinge included, bars rigid: e(barrier) less e of the well, or of the unit
    at rest; 0 where a unit has but one well.
    """
    attached = replace(finger, law=finger.law.pulling)
    top, bottom = (
        rigid_unit(attached, np.maximum(x, 0.0)).energy for x in (wells.barrier, wells.extension)
    )
    # a dome that inverts before it touches its neighbor does not open the hinge
    snap = np.where(wells.barrier > 0.0, top, attached.springs(wells.barrier).energy)
    at_rest = energy_at_rest(finger, wells.rest)
    if pulls(finger):  # what turns over before it touches has no rest beside its neighbor
        at_rest = np.where(wells.barrier > 0.0, at_rest, 0.0)
    lowest = np.where(wells.exists, np.minimum(snap - at_rest, snap - bottom), 0.0)
    return np.asarray(lowest.min(axis=0))
