"""Equilibria of a finger in extended precision, the reference for a solver's true errors.

Newton's method on the energy of `reference.energy`, with a factorization of its own.
"""

from collections.abc import Iterable
from math import ceil, log10
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.reference.energy import ElasticBars, RigidBars, YieldingWalls
from dpgcli.reference.expansion import Expansion
from dpgcli.reference.units import (
    Unit,
    extended_units,
    inverted_rest,
    spring_barrier,
)
from dpgcli.reference.vectors import cells, corners, cross, measured

if TYPE_CHECKING:
    from mpmath import mpf

ExtendedArray = NDArray[np.longdouble]
Energy: TypeAlias = ElasticBars | RigidBars | YieldingWalls

MOST_ITERATIONS = 100
MOST_HALVINGS = 40  # of one step
LARGEST_OPENING = 0.25  # strokes that one step may open a unit by
SUFFICIENT_DECREASE = 1e-4  # Nocedal and Wright, Numerical Optimization (2006), page 33
ROUNDING = 1e6  # times the working precision: differences below it mean nothing
PRINTED_DIGITS = 25  # digits, more than a long double holds


@dataclass(frozen=True)
class ExtendedStates:
    """Equilibria known to more digits than doubles have, arrays of shape (…, state).

    `pose` is tip x, y (mm) and angle (rad, full turns counted), shape (3, state); `energy` in
    mJ; `openings` the extension x of every bistable spring (mm), shape (unit, state).
    `min_eigenvalue` of the Hessian in node coordinates (N/mm) and `condition`, in the 2-norm,
    of the Hessian in the unknowns are NaN where it is not positive definite. `is_minimum`:
    converged, and the Hessian is positive definite. `in_pattern`: every unit is on its
    pattern's side of its dome's barrier, no corner is turned by 90° or
    more, no strut's opening would shorten its spring, and the finger does not meet itself. All
    numbers of a state that did not converge are NaN.
    """

    pose: ExtendedArray
    energy: ExtendedArray
    openings: ExtendedArray
    min_eigenvalue: Array
    condition: Array
    is_minimum: Flags
    in_pattern: Flags


def extended_states(
    finger: Finger,
    inverted: Flags,
    nodes: Array | None = None,
    digits: int = 50,
    *,
    walls: Array | None = None,
    pushes: Array | None = None,
) -> ExtendedStates:
    """Find the equilibrium of each pattern, shape (unit, state), by Newton's method.

    The search starts at `nodes`, (4 n, state) in mm, or where each inverted unit rests in the
    second well that it has with rigid bars. It has converged when the next step is below
    10^−(digits/2 + 5) of the finger's length; as many digits as the bars are stiffer than the
    springs are carried on top. Walls begin at `walls`, (unit, state) in mm, or where they are at
    rest; `pushes`, (unit, state) in N, are those of pressures on the domes, none by default.
    Raises ValueError for a batch of fingers or a wrong shape.

    >>> from dpgcli.mechanics.finger import uniform_finger
    >>> unit = uniform_finger(
    ...     1, segment_length=13.5, segment_height=10.75, stroke=3.5,
    ...     bistable_stiffness=12.84, force_linearity=0.043, hinge_stiffness=24.2)
    >>> print(f"{extended_states(unit, np.array([[True]])).openings[0, 0]:.10f}")  # mm
    3.2450151985
    """
    import mpmath

    n = finger.n_units
    if finger.n_designs != 1:
        raise ValueError(f"{finger.n_designs} designs, not one")
    if inverted.ndim != 2 or len(inverted) != n or inverted.shape[1] == 0:
        raise ValueError(f"inverted has shape {inverted.shape}, not ({n}, one or more states)")
    sizes = {"nodes": (nodes, 4 * n), "walls": (walls, n), "pushes": (pushes, n)}
    for name, (values, size) in sizes.items():
        if values is not None and values.shape != (size, inverted.shape[1]):
            raise ValueError(f"{name} has shape {values.shape}, not {(size, inverted.shape[1])}")
    lost = digits_lost(finger)
    with mpmath.workdps(digits + lost):
        units = extended_units(finger)
        rest_of = {unit: inverted_rest(unit) for unit in set(units)}
        rests = [rest_of[unit] for unit in units]
        tolerance = mpmath.mpf(10) ** -(digits // 2 + 5)
        smallest = tolerance / mpmath.mpf(10) ** lost
        rows = []
        for state, pattern in enumerate(inverted.T):
            opened = [(m * int(on), w * int(on)) for (m, w), on in zip(rests, pattern, strict=True)]
            start = RigidBars(units).nodes([angle for angle, _ in opened for _ in "ab"])
            push = None if pushes is None else pushes[:, state]
            begin = [w for _, w in opened] if walls is None else extended(walls[:, state])
            bars = energy_of(finger, pushed(units, push), begin)
            if nodes is not None:
                start = extended(nodes[:, state])
            found = _minimum(bars, start, tolerance, smallest)
            rows.append(_missing(n) if found is None else _row(found, pattern))
    return ExtendedStates(*(np.stack(column, axis=-1) for column in zip(*rows, strict=True)))


def pushed(units: list[Unit], push: Array | None) -> list[Unit]:
    """Units whose domes are pushed, (unit,) in N."""
    if push is None:
        return units
    return [unit._replace(push=p) for unit, p in zip(units, extended(push), strict=True)]


def energy_of(finger: Finger, units: list[Unit], walls: list["mpf"]) -> Energy:
    """The energy of a finger's units; where walls give way, the search begins at `walls`, mm."""
    (coupling,) = extended(finger.hinge_coupling[0])
    frame = (RigidBars if finger.is_rigid else ElasticBars)(units, coupling)
    return YieldingWalls(frame, walls) if finger.has_walls else frame


def extended(values: Array) -> list["mpf"]:
    """Doubles, taken as exact."""
    from mpmath import mpf

    return [mpf(value) for value in values.tolist()]


def digits_lost(finger: Finger) -> int:
    """Decimal digits that stiff bars cost: the ratio of their stiffness to the springs', log10."""
    if finger.is_rigid:
        return 0
    return max(0, ceil(log10(finger.linear_stiffness.max() / finger.bistable_stiffness.min())))


class ExactFactorization(NamedTuple):
    """L D Lᵀ of a band: below[i] the entries of L's row i that the band holds, left to right.

    `is_positive` says that no pivot is negative or too small for its sign to be known.
    """

    below: list[list["mpf"]]
    pivots: list["mpf"]
    is_positive: bool


def factorize(band: list[list["mpf"]], smallest: "mpf") -> ExactFactorization:
    """Factorize a symmetric band without pivoting.

    Pivots below `smallest` of their diagonal may be what is left of zeros where the search
    ended.
    """
    from mpmath import fdot

    below: list[list[mpf]] = []
    pivots: list[mpf] = []
    is_positive = True
    for row, (diagonal, *entries) in enumerate(band):
        first = row - len(entries)
        scaled: list[mpf] = []  # L D of this row
        for column, entry in enumerate(reversed(entries), first):
            known = below[column][first - column + len(below[column]) :]
            scaled.append(entry - fdot(scaled, known))
        below.append([value / pivot for value, pivot in zip(scaled, pivots[first:], strict=True)])
        pivot = diagonal - fdot(scaled, below[row])
        is_positive &= bool(pivot > smallest * abs(diagonal))
        pivots.append(pivot)
    return ExactFactorization(below, pivots, is_positive)


def _forward(factorization: ExactFactorization, right_hand_side: list["mpf"]) -> list["mpf"]:
    """L⁻¹ b; rows above the first nonzero of b stay zero and are skipped."""
    from mpmath import fdot

    y = list(right_hand_side)
    start = next((row for row, value in enumerate(y) if value), len(y))
    for row in range(start + 1, len(y)):
        entries = factorization.below[row]
        known = max(row - len(entries), start)
        y[row] -= fdot(entries[known - row :], y[known:row])
    return y


def _downhill(factorization: ExactFactorization, gradient: list["mpf"]) -> list["mpf"]:
    """The step −(L|D|Lᵀ)⁻¹ g: Newton's if the Hessian is positive definite, downhill if not."""
    y = _forward(factorization, [-value for value in gradient])
    y = [value / abs(d) for value, d in zip(y, factorization.pivots, strict=True)]
    return _backward(factorization, y)


def solved(factorization: ExactFactorization, right_hand_side: list["mpf"]) -> list["mpf"]:
    """(L D Lᵀ)⁻¹ b."""
    y = _forward(factorization, right_hand_side)
    y = [value / d for value, d in zip(y, factorization.pivots, strict=True)]
    return _backward(factorization, y)


def _backward(factorization: ExactFactorization, y: list["mpf"]) -> list["mpf"]:
    """L⁻ᵀ y."""
    x = list(y)
    for row in range(len(x) - 1, 0, -1):
        entries = factorization.below[row]
        for column, entry in enumerate(entries, row - len(entries)):
            x[column] -= entry * x[row]
    return x


class Stationary(NamedTuple):
    """A point where Newton's method converged, with the energy's expansion there."""

    bars: Energy
    unknowns: list["mpf"]
    expansion: Expansion
    factorization: ExactFactorization


def _minimum(
    bars: Energy, start: list["mpf"], tolerance: "mpf", smallest: "mpf"
) -> Stationary | None:
    """Walk downhill from the nodes `start`; None if that does not converge.

    Pivots are positive from `smallest` of their diagonal on.
    """
    from mpmath import isfinite

    if not all(map(isfinite, start)):
        return None
    try:
        here = bars.unknowns(start)
        expansion = bars.at(here)
        for _ in range(MOST_ITERATIONS):
            factorization = factorize(expansion.band, smallest)
            step = _downhill(factorization, expansion.gradient)
            if max(map(abs, step)) <= tolerance * bars.scale:
                return Stationary(bars, here, expansion, factorization)
            further = _further(bars, here, expansion, step)
            if further is None:
                return None
            here, expansion = further
    except ZeroDivisionError:  # nodes that coincide, or a mechanism
        return None
    return None


def _further(
    bars: Energy, here: list["mpf"], expansion: Expansion, step: list["mpf"]
) -> tuple[list["mpf"], Expansion] | None:
    """The unknowns a step further, halved until the energy falls, and its expansion there."""
    from mpmath import eps, fdot

    fraction = 1 / max(1, bars.strokes_opened(here, step) / LARGEST_OPENING)
    slope = SUFFICIENT_DECREASE * fdot(step, expansion.gradient)
    springs = sum(unit.bistable * unit.stroke**2 for unit in bars.units)
    allowed = expansion.energy + ROUNDING * eps * (abs(expansion.energy) + springs)
    for _ in range(MOST_HALVINGS):
        trial = bars.moved(here, [fraction * part for part in step])
        there = bars.at(trial)
        if there.energy <= allowed + fraction * slope:
            return trial, there
        fraction /= 2
    return None


def _row(found: Stationary, pattern: Flags) -> tuple[Any, ...]:
    """One state of `ExtendedStates`."""
    pose, openings, in_pattern = pose_in_pattern(found.bars, found.unknowns, pattern)
    return (
        pose,
        long_doubles([found.expansion.energy])[0],
        openings,
        *_spectrum(found),
        found.factorization.is_positive,
        in_pattern,
    )


def pose_in_pattern(
    bars: Energy, unknowns: list["mpf"], pattern: Flags
) -> tuple[ExtendedArray, ExtendedArray, bool]:
    """Tip, openings and whether a shape is one that the pattern says, as in `ExtendedStates`."""
    nodes = bars.nodes(unknowns)
    shape = list(cells(ElasticBars(bars.units).base, nodes))
    angles = [angle for cell in shape for angle in corners(cell)]
    units = zip(shape, bars.units, strict=True)
    openings = [measured(cell.top)[0] - unit.length for cell, unit in units]
    walls = bars.walls(unknowns)
    domes = zip(openings, walls, bars.units, strict=True)
    sides = [x + w > spring_barrier(unit) for x, w, unit in domes]
    is_ahead = [cross(cell.top, strut) > 0 for cell in shape for strut in (cell.near, cell.far)]
    is_upright = max(map(abs, angles)) < np.pi / 2
    in_pattern = sides == pattern.tolist() and all(is_ahead) and is_upright
    return (
        long_doubles([nodes[-4], nodes[-3], -sum(angles)]),
        long_doubles(openings),
        in_pattern and not _meets_itself(bars, nodes),
    )


def _meets_itself(bars: Energy, nodes: list["mpf"]) -> bool:
    """Whether sides of the outline cross that have no corner in common, by orientation."""
    height = float(bars.units[0].height)
    stations = np.concatenate(([0.0, 0.0, 0.0, height], np.array(nodes, float))).reshape(-1, 4)
    corners = np.concatenate((stations[:, :2], stations[::-1, 2:])) @ np.array([1.0, 1j])
    start, stop = corners, np.roll(corners, -1)

    def is_left(of: NDArray[np.complex128], end: Any, point: Any) -> Flags:
        across = (end - of)[:, None].conj() * (point[None] - of[:, None])
        return np.asarray(across.imag > 0.0)

    parts = is_left(start, stop, start) != is_left(start, stop, stop)
    apart = np.abs(np.subtract.outer(np.arange(len(start)), np.arange(len(start))))
    return bool((parts & parts.T & (apart > 1) & (apart < len(start) - 1)).any())


def _missing(n_units: int) -> tuple[Any, ...]:
    """The row of a state that did not converge."""
    nan = np.longdouble(np.nan)
    return np.full(3, nan), nan, np.full(n_units, nan), np.nan, np.nan, False, False


def long_doubles(values: Iterable["mpf"]) -> ExtendedArray:
    """Numbers as long doubles."""
    from mpmath import nstr

    return np.array([np.longdouble(nstr(value, PRINTED_DIGITS)) for value in values])


def _spectrum(found: Stationary) -> tuple[float, float]:
    """Smallest eigenvalue by nodes and condition by unknowns, NaN if not positive definite.

    H⁻¹ = YᵀY with Y = D^−½ L⁻¹, so that its largest eigenvalue, 1/λ_min, is ‖Y‖²; by nodes it
    is that of J H⁻¹ Jᵀ, J their rates. Y is found in extended precision, its norm needs none.
    """
    bars, unknowns, expansion, factorization = found
    if not factorization.is_positive:
        return np.nan, np.nan
    size = len(unknowns)
    columns = [_forward(factorization, [0] * k + [1] + [0] * (size - 1 - k)) for k in range(size)]
    roots = np.sqrt(np.array(factorization.pivots, float))
    compliance = np.array(columns, float) / roots
    by_nodes = _largest_square(bars.node_rates(unknowns) @ compliance)
    stiffest = float(np.linalg.eigvalsh(_dense(expansion.band))[-1])
    return 1.0 / by_nodes, stiffest * _largest_square(compliance)


def _largest_square(matrix: Array) -> float:
    """The square of the 2-norm."""
    return float(np.linalg.eigvalsh(matrix @ matrix.T)[-1])


def _dense(band: list[list["mpf"]]) -> Array:
    matrix = np.zeros((len(band), len(band)))
    for row, entries in enumerate(band):
        for depth, entry in enumerate(entries):
            matrix[row, row - depth] = matrix[row - depth, row] = float(entry)
    return matrix
