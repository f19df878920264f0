"""From patterns to certified states of one batch of fingers, and what is known of them."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags, Indices, total
from dpgcli.equilibrium.banded import forward
from dpgcli.equilibrium.newton import Equilibrium, minimize
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.formulation import Formulation
from dpgcli.states.wells import (
    FirstOrder,
    Wells,
    first_order,
    geometric_guess,
    inverted_wells,
    stroke_guess,
)

MARGINAL_CURVATURE = float(np.sqrt(np.finfo(float).eps))
TIP_ROUNDING = 8.0 * np.finfo(float).eps
CANCELLED = 1e-3  # of the product: below it the determinant is found without cancellation
UNITS_AT_ONCE = 15_000  # keeps a batch in the processor's second cache; measured
COMPLIANCE_PAIRS = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))


class Status(IntEnum):
    """What a state turned out to be, the graver the greater; `text` is what tables say."""

    STABLE = 0
    MARGINAL = 1
    ANOTHER_PATTERN = 2
    NOT_BISTABLE = 3
    FOLDED = 4
    NOT_CONVERGED = 5

    @property
    def text(self) -> str:
        return self.name.lower()

    @property
    def meaning(self) -> str:
        return _MEANINGS[self]


_MEANINGS = {
    Status.STABLE: "certified: residual, curvature, and every unit in the well the pattern says",
    Status.NOT_BISTABLE: "a unit that the pattern inverts has no second well",
    Status.ANOTHER_PATTERN: "the search ended in the minimum of another pattern",
    Status.MARGINAL: "an equilibrium whose curvature is not safely positive",
    Status.FOLDED: "a minimum of the equations with a corner turned by 90° or more",
    Status.NOT_CONVERGED: "the residual did not reach its tolerance",
}


@dataclass(frozen=True)
class Batch:
    """States of one finger (or one per lane), each at an equilibrium, shape (…, batch).

    `reached` says which wells the units ended in, `is_folded` which lanes are no finger.
    """

    formulation: Formulation
    equilibrium: Equilibrium
    inverted: Flags
    reached: Flags
    is_folded: Flags


@dataclass(frozen=True)
class States:
    """Certified states, arrays of shape (…, state): what every method gives.

    `status` holds `Status` codes. `pose` is tip x, y (mm) and angle (rad), `tip_error` in mm,
    `energies` in mJ by kind, `residual` in N.
    """

    inverted: Flags
    reached: Flags
    status: NDArray[np.uint8]
    pose: Array
    tip_error: Array
    energies: dict[str, Array]
    residual: Array


@dataclass(frozen=True)
class Units:
    """What is known of a finger's units before any pattern is solved."""

    finger: Finger
    wells: Wells
    first_order: FirstOrder

    @classmethod
    def of(cls, finger: Finger) -> "Units":
        wells = inverted_wells(finger)
        return cls(finger, wells, first_order(finger, wells))

    def designs(self, index: Indices) -> "Units":
        """One design for each lane, by index, so that designs and patterns share a batch."""
        return Units(
            self.finger.designs(index), self.wells.designs(index), self.first_order.designs(index)
        )


def solve(
    units: Units,
    formulate: Callable[[Finger], Formulation],
    inverted: Flags,
    tolerance: float,
    *,
    strokes: float | None = None,
) -> Batch:
    """Minimize from each pattern's geometric guess; what was found is yet to be certified.

    `inverted` has shape (unit, batch); the finger has one design, or one for each lane.
    The guess puts each unit into its own rigid well, or opens it by `strokes` strokes.
    """
    formulation = formulate(units.finger.with_pattern(inverted))
    if strokes is None:
        guess = geometric_guess(units.finger, inverted, units.first_order)
    else:
        guess = stroke_guess(units.finger, inverted, strokes)
    equilibrium = minimize(formulation, formulation.coordinates(guess), tolerance)
    springs = formulation.springs(equilibrium.coordinates)
    reached = springs.extension > units.wells.barrier
    if units.finger.law.pushes_only:  # a dome that does not act is not inverted by its neighbors
        reached = reached & inverted
    return Batch(formulation, equilibrium, inverted, reached, springs.is_folded)


def certify(
    batch: "Batch", wells: Wells, tolerance: float, own: slice = slice(None)
) -> NDArray[np.uint8]:
    """The gravest reason why a lane is not a certified state of its pattern.

    `own` are the units that must have reached their wells; `wells` are those of all units.
    """
    equilibrium = batch.equilibrium
    inverted, reached = batch.inverted[own], batch.reached[own]
    exists = np.broadcast_to(wells.exists, (len(batch.inverted), wells.exists.shape[1]))[own]
    elsewhere = (reached != inverted).any(axis=0)
    checks = (
        (~(equilibrium.curvature > MARGINAL_CURVATURE), Status.MARGINAL),
        (elsewhere, Status.ANOTHER_PATTERN),
        (elsewhere & (inverted & ~exists).any(axis=0), Status.NOT_BISTABLE),
        (batch.is_folded, Status.FOLDED),
        (~(equilibrium.relative_residual <= tolerance), Status.NOT_CONVERGED),
    )
    status = np.full(inverted.shape[1], Status.STABLE, np.uint8)
    for failed, reason in checks:
        status[failed] = reason
    return status


@dataclass(frozen=True)
class Tip:
    """The tip and how far it is known, shapes (…, batch).

    Pose x, y (mm) and angle (rad); estimated errors of its position (mm) and angle (rad); the
    compliance by `COMPLIANCE_PAIRS` in mm/N, rad/N and rad/(N mm), and the softest and the
    stiffest stiffness of its position (N/mm), if asked for.
    """

    pose: Array
    error: Array
    angle_error: Array
    compliance: Array | None = None
    stiffness: Array | None = None


def tip(batch: Batch, *, with_compliance: bool) -> Tip:
    """Pose, error and compliance C = J H⁻¹ Jᵀ of the tip from the factorization at hand.

    The error is twice the step Newton would take next, |J H⁻¹ g|, plus what rounding leaves: a
    few units in the last place, more for many units and where the curvature is small. Twice,
    since between very stiff bars of the lattice that step itself has lost its digits; infinite
    for a marginal state.
    """
    equilibrium = batch.equilibrium
    finger = batch.formulation.finger
    pose, jacobian = batch.formulation.tip(equilibrium.coordinates)
    sides = np.concatenate((jacobian, equilibrium.gradient[:, None]), axis=1)
    sides = forward(equilibrium.factorization, sides)
    with np.errstate(all="ignore"):  # a mechanism has no stiffness, or nearly none
        scaled = sides * (1.0 / equilibrium.factorization.pivots)[:, None]
        step = [total(sides[:, p] * scaled[:, 3]) for p in range(3)]
        slenderness = (finger.stroke / finger.segment_height).max(axis=0)
        softness = slenderness / equilibrium.curvature
        rounding = TIP_ROUNDING * (1.0 + finger.n_units / 64.0 + np.abs(softness))
        error = 2.0 * np.hypot(step[0], step[1]) + rounding * reach(finger)
        error = np.where(equilibrium.curvature > MARGINAL_CURVATURE, error, np.inf)
        angle_error = 2.0 * np.abs(step[2]) + rounding * (1.0 + np.abs(pose[2]))
        if not with_compliance:
            return Tip(pose, error, angle_error)
        compliance = np.stack([total(sides[:, p] * scaled[:, q]) for p, q in COMPLIANCE_PAIRS])
        stiffness = _principal_stiffness(compliance, sides, equilibrium.factorization.pivots)
    return Tip(pose, error, angle_error, compliance, stiffness)


def _principal_stiffness(compliance: Array, sides: Array, pivots: Array) -> Array:
    """Softest and stiffest 1/eigenvalue of the position's compliance, (2, batch)."""
    xx, xy, yy = compliance[:3]
    determinant = xx * yy - xy * xy
    cancelling = np.flatnonzero(~(determinant > CANCELLED * xx * yy))
    if len(cancelling):
        x, y = (np.take(sides[:, axis], cancelling, axis=-1) for axis in (0, 1))
        roots = np.sqrt(np.take(pivots, cancelling, axis=-1))
        determinant[cancelling] = _determinant(x / roots, y / roots)
    mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    return np.stack((1.0 / (mean + half), (mean + half) / determinant))


def _determinant(x: Array, y: Array) -> Array:
    """Of the matrix [x·x, x·y; x·y, y·y], without cancellation; zero below rounding.

    It is the square of the longer vector times that of what is perpendicular to it in the
    other; vectors of shape (size, batch).
    """
    is_longer = total(x * x) >= total(y * y)
    longer, shorter = np.where(is_longer, x, y), np.where(is_longer, y, x)
    square = total(longer * longer)
    beside = shorter - total(longer * shorter) / square * longer
    apart = total(beside * beside)
    smallest = 16.0 * np.finfo(float).eps * np.sqrt(total(shorter * shorter))
    return np.asarray(square * np.where(np.sqrt(apart) > smallest, apart, 0.0))


def lanes_at_once(n_units: int) -> int:
    """How many fingers to solve in one batch."""
    return max(UNITS_AT_ONCE // n_units, 256)


def reach(finger: Finger) -> Array:
    """Length of the straight finger, mm, shape (design,)."""
    shape = (finger.n_units, finger.segment_length.shape[1])
    return total(np.broadcast_to(finger.segment_length, shape))


def min_eigenvalues(batch: Batch) -> Array:
    """Smallest eigenvalue of the Hessian in node coordinates, N/mm, shape (batch,).

    At an equilibrium the compliance of all nodes is C = J H⁻¹ Jᵀ with J the nodes' derivatives
    by the formulation's coordinates, and the smallest eigenvalue is 1/λ_max(C): the stiff bars
    do not touch its digits, and rigid bars need no special case. NaN where H is not positive
    definite.
    """
    equilibrium = batch.equilibrium
    positive = np.asarray((equilibrium.factorization.pivots > 0.0).all(axis=0))
    nodes = batch.formulation.station_jacobian(equilibrium.coordinates)
    sides = forward(equilibrium.factorization, nodes)
    roots = np.sqrt(np.where(positive, equilibrium.factorization.pivots, 1.0))
    matrices = np.where(positive, sides / roots[:, None], 0.0).transpose(2, 0, 1)
    largest = np.linalg.eigvalsh(matrices @ matrices.transpose(0, 2, 1))[:, -1]
    with np.errstate(divide="ignore"):
        return np.where(positive, 1.0 / largest, np.nan)
