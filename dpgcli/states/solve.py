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
from dpgcli.states.crossing import crosses_itself, fewest_in_loop, outline
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
SMALL_SHARE = 0.1  # of what a unit bears: a residual below it cannot decide whether it holds
LARGEST_TURN = 0.05  # of a unit's own angle: bars that turn it further are soft
LARGEST_CURVATURE = 1.0  # a shape of more than that is far from any fold
FINEST_BALANCE, FINEST_TOLERANCE = 1e-13, 1e-15  # of the forces in play: rounding's
WIDE_ANGLE = np.pi / 3.0  # of a corner, beyond which strokes come close to twice the height
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
    Status.STABLE: "certified: residual, curvature, wells and shape",
    Status.MARGINAL: "an equilibrium whose curvature is not safely positive",
    Status.ANOTHER_PATTERN: "the search ended in the minimum of another pattern",
    Status.NOT_BISTABLE: "a unit that the pattern inverts has no second well",
    Status.FOLDED: "a minimum of the equations whose shape no finger can take",
    Status.NOT_CONVERGED: "the residual is above its tolerance, or not small against what a unit "
    "bears before it leaves its well (node coordinates with very stiff bars: take the chain)",
}


@dataclass(frozen=True)
class Batch:
    """States of one finger (or one per lane), each at an equilibrium, shape (…, batch).

    `reached` says which wells the units ended in, `is_folded` which lanes are no finger, and
    `is_balanced` where what is left of the forces is too small to matter.
    """

    formulation: Formulation
    equilibrium: Equilibrium
    inverted: Flags
    reached: Flags
    is_folded: Flags
    is_balanced: Flags


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

    @property
    def are_soft(self) -> Flags:
        """Units that with rigid bars do not show what the finger does, (unit, design).

        Bars turn them too far, or a stroke leads to where only bars that give way can follow.
        """
        if self.finger.is_rigid:
            return np.zeros((1, 1), bool)
        with np.errstate(invalid="ignore"):
            is_turned = self.first_order.turn > LARGEST_TURN * self.wells.angle
        return is_turned | (~self.wells.exists & (self.wells.angle > WIDE_ANGLE))

    @property
    def shortest_loop(self) -> int | None:
        """Units that the finger needs to run into itself; None where it has too few."""
        finger = self.finger
        widest = np.arcsin(np.minimum(0.5 * finger.stroke / finger.segment_height, 1.0))
        turn = 2.0 * np.where(self.are_soft, widest, self.wells.angle)
        return fewest_in_loop(turn, finger.segment_length, finger.n_units)

    @property
    def have_no_well(self) -> Flags:
        """Units that certainly have no second well, (unit, design).

        Between soft bars one may exist where there is none between rigid ones, unless the dome
        by itself has none.
        """
        has_none, soft = ~self.wells.exists, self.are_soft
        if soft.any():
            has_none = has_none & (~soft | np.isnan(self.finger.law.rests(self.finger.domes).well))
        return has_none

    @classmethod
    def of(cls, finger: Finger) -> "Units":
        wells = inverted_wells(finger)
        return cls(finger, wells, first_order(finger, wells))

    def section(self, first: int, stop: int) -> "Units":
        """Units first+1 … stop, counted from the base, with all that is known of them."""
        finger = self.finger.units(first, stop)
        return Units(finger, self.wells.units(first, stop), self.first_order.units(first, stop))

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
    The guess puts each unit into its own rigid well, or opens it by `strokes` strokes. What soft
    bars let go astray from there is looked for once more, with domes held open first.
    """
    formulation = formulate(units.finger.with_pattern(inverted))
    if strokes is not None:
        guess = stroke_guess(units.finger, inverted, strokes)
        return search(units, formulation, inverted, formulation.coordinates(guess), tolerance)
    guess = geometric_guess(units.finger, inverted, units.first_order)
    batch = search(units, formulation, inverted, formulation.coordinates(guess), tolerance)
    soft = units.are_soft.any(axis=0)
    if not soft.any():
        return batch
    missed = certify(batch, units, tolerance) != Status.STABLE
    lanes = np.flatnonzero(missed & soft)
    return _searched_again(units, formulate, batch, tolerance, lanes) if len(lanes) else batch


def search(
    units: Units, formulation: Formulation, inverted: Flags, start: Array, tolerance: float
) -> Batch:
    """Walk from coordinates, (size, batch), and see which wells the units end in.

    Near a fold the tolerance may not do: there the walk goes on to where rounding ends it.
    """
    batch = batch_at(units, formulation, inverted, minimize(formulation, start, tolerance))
    is_close = batch.equilibrium.relative_residual <= tolerance
    lanes = np.flatnonzero(is_close & ~batch.is_balanced)
    if not len(lanes):
        return batch
    few = formulation.designs(lanes)
    here = np.take(batch.equilibrium.coordinates, lanes, axis=1)
    further = minimize(few, here, FINEST_TOLERANCE)
    everywhere = np.arange(len(lanes))
    equilibrium = batch.equilibrium.with_lanes(lanes, further, everywhere)
    return batch_at(units, formulation, inverted, equilibrium)


def batch_at(
    units: Units, formulation: Formulation, inverted: Flags, equilibrium: Equilibrium
) -> Batch:
    """What the certificate needs to know of shapes, as found for these patterns."""
    extension, is_folded = formulation.springs(equilibrium.coordinates)
    reached = extension > units.wells.spring_barrier
    if units.finger.law.pushes_only:  # a dome that does not act is not inverted by its neighbors
        reached = reached & inverted
    loop = units.shortest_loop
    if loop is not None:
        nodes = formulation.stations(equilibrium.coordinates)
        is_folded |= crosses_itself(outline(nodes, units.finger.segment_height), loop)
    is_balanced = _is_balanced(formulation, equilibrium, reached, units.wells)
    return Batch(formulation, equilibrium, inverted, reached, is_folded, is_balanced)


def _searched_again(
    units: Units,
    formulate: Callable[[Finger], Formulation],
    batch: Batch,
    tolerance: float,
    lanes: Indices,
) -> Batch:
    """Search some lanes with domes held open until bars and hinges have settled, then let go.

    What is let go walks down from beyond its well, and meets the well before its barrier. A lane
    is replaced if that finds its state.
    """
    few, inverted = units.designs(lanes), np.take(batch.inverted, lanes, axis=1)
    guess = stroke_guess(few.finger, inverted, 1.0)
    held = formulate(few.finger.with_domes_held(inverted))
    settled = minimize(held, held.coordinates(guess), tolerance).coordinates
    formulation = formulate(few.finger.with_pattern(inverted))
    again = search(few, formulation, inverted, settled, tolerance)
    found = np.flatnonzero(certify(again, few, tolerance) == Status.STABLE)
    if not len(found):
        return batch
    equilibrium = batch.equilibrium.with_lanes(lanes[found], again.equilibrium, found)
    return batch_at(units, batch.formulation, batch.inverted, equilibrium)


def certify(
    batch: Batch, units: Units, tolerance: float, own: slice = slice(None)
) -> NDArray[np.uint8]:
    """The gravest reason why a lane is not a certified state of its pattern.

    `own` are the units that must have reached their wells; `units` are all.
    """
    equilibrium = batch.equilibrium
    inverted, reached = batch.inverted[own], batch.reached[own]
    elsewhere = reached != inverted
    has_none = np.broadcast_to(units.have_no_well, batch.inverted.shape)[own]
    is_curved = equilibrium.curvature > MARGINAL_CURVATURE
    checks = (
        (~is_curved, Status.MARGINAL),
        (elsewhere.any(axis=0), Status.ANOTHER_PATTERN),
        ((elsewhere & inverted & has_none).any(axis=0), Status.NOT_BISTABLE),
        (batch.is_folded, Status.FOLDED),
        (is_curved & ~batch.is_balanced, Status.NOT_CONVERGED),
        (~(equilibrium.relative_residual <= tolerance), Status.NOT_CONVERGED),
    )
    status = np.full(inverted.shape[1], Status.STABLE, np.uint8)
    for failed, reason in checks:
        status[failed] = reason
    return status


def _is_balanced(
    formulation: Formulation, equilibrium: Equilibrium, reached: Flags, wells: Wells
) -> Flags:
    """Whether what is left of the forces is too small to decide that there is a state, (batch,).

    The moment about a unit's corners, over its lever H, has to be small against

    - what the unit bears, or lacks for a second well, between rigid bars: more could hold it
      where it does not rest
    - what a fold as near as the curvature κ allows would bear: where the opening has a stiffness λ
      whose slope is c, a minimum bears a force of λ²/2c; for equal corners λ = κ k/4, and near
      the spring's inflection c = 3 k/d, k being k_b + k_θ/H² (our derivation). A low curvature
      may come from a faint hinge as well, so that rounding is always allowed.

    The residual would not do: stiff bars leave rounding in it that does not move a corner.
    """
    finger = formulation.finger
    moments = formulation.corner_moments(equilibrium.coordinates, equilibrium.gradient)
    unbalance = np.abs(moments).max(axis=0) / finger.segment_height
    borne = np.where(reached, np.abs(wells.reset_force), wells.snap_force)
    curvature = np.clip(equilibrium.curvature, 0.0, LARGEST_CURVATURE)
    by_fold = np.maximum(curvature * curvature / 96.0, FINEST_BALANCE) * finger.force_scale
    return np.asarray((unbalance <= SMALL_SHARE * np.minimum(borne, by_fold)).all(axis=0))


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
