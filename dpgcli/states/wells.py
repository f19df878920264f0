"""Wells and barrier of one unit with rigid bars, and the moment it bears before it snaps.

By symmetry both corners open by m = φ/2, so x = 2H sin m, and a zero of the force other than
x = 0 is a root of r(u) = 1 + β(2u² − 3u) + κ φ/sin φ with u = x/d, κ = k_θ/(k_b H²). r is convex
(a quadratic plus a convex increasing function of a convex one), so there are at most two roots,
barrier and well, and Newton's method from outside reaches each monotonically. r(0) = α + β + κ
is positive. Our derivation; without the hinge the roots are u = [3β ± √(9β² − 8β)]/(4β).
"""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.contracts import take_lanes
from dpgcli.mechanics import laws
from dpgcli.mechanics.finger import Finger

MIDDLE = 0.75  # in strokes: the vertex of 2u² − 3u, between barrier and well
SEARCHED = 512  # extensions at which the slope of a tabulated law is looked at
WIDEST = 1.5  # of the travel to the spring's own well: no unit rests beyond
IN_TOUCH = 0.999  # of a dome's own well: where a dome that only pushes still does
INFLECTION_BISECTIONS = 24
NEWTON_STEPS = 12  # for an opening: quadratic from a start that is off by the wall's share
BISECTIONS = 48  # of one 512th of the range: down to rounding


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

    `exists` says whether there is one; `angle` is its corner angle m (rad), `extension` its
    x (mm) and `barrier` the x at the top between the wells. Where there is none, both are of
    the full stroke (of where a dome that only pushes still does) and `barrier` is the middle, so
    that a search can still begin.

    `spring_barrier` is the x (mm) at which the dome's spring alone turns over: the highest top
    before the deepest well of its curve, infinite where there is none. A unit counts as inverted
    exactly where it is open beyond it, with any bars and hinges: what holds the unit straight pulls
    back, so that it rests inverted only there. A unit in a ripple before it counts as not inverted,
    whatever the hinge makes of the ripple's depth; `extension` is the deepest of the wells beyond
    it, and the unit's own barrier lies between the two.
    `snap_force` and `reset_force` (N, on the opening) are what a unit bears in its ground and in
    its inverted well; where there is no second well, `reset_force` is negative, what is lacking.
    """

    exists: Flags
    extension: Array
    barrier: Array
    angle: Array
    spring_barrier: Array
    snap_force: Array
    reset_force: Array


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
        return _searched_wells(finger)
    half_height = finger.stroke / (2.0 * finger.segment_height)
    hinge = finger.hinge_stiffness / (finger.bistable_stiffness * finger.segment_height**2)
    half_height, hinge, linearity = np.broadcast_arrays(half_height, hinge, finger.force_linearity)
    widest = np.minimum(WIDEST, (1.0 - 1e-9) / half_height)
    (well, barrier), exists = _roots(widest, half_height, hinge, linearity)
    exists &= barrier < well
    stroke = np.broadcast_to(finger.stroke, exists.shape)
    full = np.minimum(1.0, widest)
    extension = np.where(exists, well * stroke, _opened(finger, widest * stroke))
    snap, reset = _extreme_slopes(finger, np.stack((0.0 * full, full)) * stroke)
    return Wells(
        exists,
        extension,
        np.where(exists, barrier, MIDDLE) * stroke,
        np.arcsin(extension / (2.0 * finger.segment_height)),
        _spring_barrier(finger),
        snap,
        -reset,
    )


def _opened(finger: Finger, widest: Array) -> Array:
    """Where a search begins in a unit without a second well, mm: open by its stroke.

    A dome that only pushes has to be in touch, or nothing would hold the unit there.
    """
    highest = finger.law.touching(finger.domes).highest
    opening = np.where(np.isfinite(highest), IN_TOUCH * highest, finger.stroke)
    return np.asarray(np.minimum(opening, widest))


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
        rises = _rigid_stiffness(finger, middle) >= 0.0
        stiff, soft = np.where(rises, middle, stiff), np.where(rises, soft, middle)
    return _rigid_slope(finger, stiff)


def _searched_wells(finger: Finger) -> Wells:
    """The inverted well of any law: sign changes of de/dx on a grid, then bisection."""
    lever = 2.0 * finger.segment_height
    domes = finger.domes
    whole = domes.stroke + domes.contact
    own = finger.law.rests(domes).well + domes.contact  # a travel; the unit's is shorter
    furthest = WIDEST * np.where(np.isnan(own), whole, own)
    widest = furthest - domes.contact
    if not finger.has_walls:  # walls take the rest
        widest = np.minimum(widest, (1.0 - 1e-9) * lever)
    lowest = finger.law.touching(domes).lowest
    within_reach = ~(lowest >= widest)  # of a unit whose bars are rigid
    lowest = np.where(within_reach & np.isfinite(lowest), lowest, 0.0)
    shares = np.linspace(0.0, 1.0, SEARCHED + 1)[1:, None, None]
    grid = lowest + (widest - lowest) * shares
    slope = _rigid_slope(finger, grid)
    pulls = slope >= 0.0
    energy = _rigid_energy(finger, grid)[:-1]
    places = np.arange(SEARCHED - 1)[:, None, None]
    is_well, is_top = ~pulls[:-1] & pulls[1:], pulls[:-1] & ~pulls[1:]
    turned = _spring_barrier(finger)
    is_well &= grid[:-1] >= turned  # before it a unit may rest in a ripple, but is not inverted
    # the well that lies deepest below both sides, and the highest top before it: ripples pass
    left, right = (np.maximum.accumulate(e, axis=0) for e in (energy, energy[::-1]))
    depth = np.minimum(left, right[::-1]) - energy
    wells = np.where(is_well, depth, -np.inf).argmax(axis=0)
    is_top &= places < wells
    tops = np.where(is_top.any(axis=0), np.where(is_top, energy, -np.inf).argmax(axis=0), -1)
    exists = is_well.any(axis=0) & within_reach
    well = _bisected(finger, grid, wells, rises=True)
    top = _bisected(finger, grid, np.maximum(tops, 0), rises=False)
    stroke = np.broadcast_to(finger.stroke, exists.shape)
    extension = np.where(exists, well, _opened(finger, widest))
    barrier = np.where(exists, np.where(tops >= 0, top, lowest), MIDDLE * stroke)
    return Wells(
        exists,
        extension,
        barrier,
        np.arcsin(opening_of(finger, extension) / lever),
        turned,
        _largest(slope, grid <= barrier),
        _largest(-slope, (grid >= barrier) & (grid <= extension)),
    )


def _largest(values: Array, at: Flags) -> Array:
    """The largest of some values by unit, (place, unit, design); infinite where there are none."""
    return np.where(at.any(axis=0), np.where(at, values, -np.inf).max(axis=0), np.inf)


def opening_of(finger: Finger, extension: Array) -> Array:
    """The opening x of a unit with rigid bars whose dome's spring extends by y, mm.

    Walls take the rest: y − x = c_w h'(x), h' being the hinge's pull on the opening. The right
    side is convex, so that Newton's method from above reaches the root monotonically.
    """
    if not finger.has_walls:
        return extension
    opening = np.minimum(extension, (1.0 - 1e-9) * 2.0 * finger.segment_height)
    for _ in range(NEWTON_STEPS):
        pull, stiffness = _hinge(finger, opening)
        excess = opening - extension + finger.wall_compliance * pull
        step = excess / (1.0 + finger.wall_compliance * stiffness)
        opening = opening - np.maximum(step, 0.0)  # not at all where bars end it
    return np.asarray(opening)


def _hinge(finger: Finger, opening: Array) -> tuple[Array, Array]:
    """The hinge's pull on the opening, N, and its stiffness, N/mm: with x = 2H sin m."""
    sine = opening / (2.0 * finger.segment_height)
    half_turn, cosine = np.arcsin(sine), np.sqrt(1.0 - sine * sine)
    stiffness = finger.hinge_stiffness / finger.segment_height**2
    pull = 2.0 * stiffness * finger.segment_height * half_turn / cosine
    return pull, stiffness / cosine**2 * (1.0 + half_turn * sine / cosine)


def _rigid_slope(finger: Finger, extension: Array) -> Array:
    """de/dy of a unit with rigid bars, N: the spring's force and the hinge's."""
    half_turn = np.arcsin(opening_of(finger, extension) / (2.0 * finger.segment_height))
    hinge = 2.0 * finger.hinge_stiffness * half_turn
    return finger.springs(extension).force + hinge / (finger.segment_height * np.cos(half_turn))


def _rigid_stiffness(finger: Finger, extension: Array) -> Array:
    """d²e/dy² of a unit with rigid bars, N/mm; hinge and wall are springs in series."""
    _, hinge = _hinge(finger, opening_of(finger, extension))
    if finger.has_walls:
        hinge = hinge / (1.0 + finger.wall_compliance * hinge)
    return finger.springs(extension).stiffness + hinge


def _bisected(finger: Finger, grid: Array, places: Indices, *, rises: bool) -> Array:
    """Where the slope changes its sign between a place of the grid and the next."""
    low, high = (np.take_along_axis(grid, (places + k)[None], axis=0)[0] for k in (0, 1))
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        is_beyond = (_rigid_slope(finger, middle) >= 0.0) == rises
        low, high = np.where(is_beyond, low, middle), np.where(is_beyond, middle, high)
    return np.asarray(0.5 * (low + high))


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

    To snap or to reset, hinge included, bars rigid: e(barrier) less e of the well, 0 where a
    unit has but one well.
    """
    top, bottom = (_rigid_energy(finger, x) for x in (wells.barrier, wells.extension))
    # a dome that inverts before it touches its neighbor does not open the hinge
    snap = np.where(wells.barrier > 0.0, top, finger.springs(wells.barrier).energy)
    lowest = np.where(wells.exists, np.minimum(snap, top - bottom), 0.0)
    return np.asarray(lowest.min(axis=0))


def _rigid_energy(finger: Finger, extension: Array) -> Array:
    """Spring, wall and hinge of a unit with rigid bars, E(y) + w²/(2 c_w) + ½ k_θ φ²."""
    spring = finger.springs(extension)
    opening = opening_of(finger, extension)
    sine = opening / (2.0 * finger.segment_height)
    turn = 2.0 * np.arcsin(np.minimum(sine, 1.0))  # beyond the lever there is no well to ask for
    energy = spring.energy + laws.quadratic(turn, finger.hinge_stiffness).energy
    if finger.has_walls:  # w = c_w h'
        pull, _ = _hinge(finger, opening)
        energy = energy + 0.5 * finger.wall_compliance * pull * pull
    return np.asarray(energy)


def single_units(finger: Finger) -> tuple[Finger, tuple[int, int]]:
    """Every unit of every design as a design of its own, and how many units and designs."""
    arrays = finger.arrays()
    units, designs = np.broadcast_shapes(*(values.shape for values in arrays.values()))
    flat = {k: np.broadcast_to(v, (units, designs)).reshape(1, -1) for k, v in arrays.items()}
    return finger.with_units([0]).changed(**flat), (units, designs)
