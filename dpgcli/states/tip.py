"""The tip of certified states: pose, numerical error, compliance, smallest eigenvalue."""

import numpy as np

from dpgcli.arrays import Array, total
from dpgcli.equilibrium.banded import forward
from dpgcli.equilibrium.newton import Equilibrium
from dpgcli.records import dataclass
from dpgcli.states.certify import MARGINAL_CURVATURE, Settled

TIP_ROUNDING = 8.0 * np.finfo(float).eps  # of the finger's length
CANCELING_SHARE = 1e-3  # of xx · yy: a smaller determinant is found without cancellation
COMPLIANCE_PAIRS = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))


@dataclass(frozen=True)
class Tip:
    """The tip and its numerical error, shapes (…, batch).

    Pose x, y (mm) and angle (rad); estimated errors of its position (mm) and angle (rad); the
    compliance by `COMPLIANCE_PAIRS` in mm/N, rad/N and rad/(N mm), and the softest and the
    stiffest stiffness of its position (N/mm), if asked for.
    """

    pose: Array
    error: Array
    angle_error: Array
    compliance: Array | None = None
    stiffness: Array | None = None


def tip(
    settled: Settled,
    *,
    with_compliance: bool,
    whole: Equilibrium | None = None,
    rows: slice = slice(None),
) -> Tip:
    """Pose, error and compliance C = J H⁻¹ Jᵀ of the tip from the factorization at hand.

    That of the `whole`, if the finger is only a part of it, with these rows.

    The error is twice the step Newton would take next, |J H⁻¹ g|, plus what rounding leaves: a
    few units in the last place, more for many units and where the curvature is small. Twice,
    since between very stiff bars of the lattice that step itself has lost its digits; infinite
    for a marginal state.

    A straight unit of H = 1 mm with k_b H² = 2 k_θ = 2 N mm has the Hessian [[4, 2], [2, 4]] by
    its corners, and a tip 3 mm away follows the near one alone: 3² · 4/12 = 3 mm/N along y.

    >>> from dpgcli.mechanics.finger import uniform_finger
    >>> from dpgcli.mechanics.terms import chain_potential
    >>> from dpgcli.states.settle import settle
    >>> from dpgcli.states.units import UnitSolutions
    >>> unit = uniform_finger(1, segment_length=3.0, segment_height=1.0, stroke=0.5,
    ...     bistable_stiffness=2.0, force_linearity=0.05, hinge_stiffness=1.0)
    >>> straight = settle(UnitSolutions.of(unit), chain_potential, np.array([[False]]), 1e-12)
    >>> compliance = tip(straight, with_compliance=True).compliance
    >>> compliance[COMPLIANCE_PAIRS.index((1, 1))].round(9)
    array([3.])
    """
    equilibrium = settled.equilibrium
    finger = settled.finger
    pose, jacobian = settled.potential.coordinates.tip(equilibrium.coordinates)
    if whole is not None:
        own, equilibrium = jacobian, whole
        jacobian = np.zeros((len(whole.coordinates), *own.shape[1:]))
        jacobian[rows] = own
    sides = np.concatenate((jacobian, equilibrium.gradient[:, None]), axis=1)
    sides = forward(equilibrium.factorization, sides)
    with np.errstate(all="ignore"):  # a mechanism has no stiffness, or nearly none
        scaled = sides * (1.0 / equilibrium.factorization.pivots)[:, None]
        step = [total(sides[:, p] * scaled[:, 3]) for p in range(3)]
        slenderness = (finger.stroke / finger.segment_height).max(axis=0)
        softness = slenderness / equilibrium.curvature
        rounding = TIP_ROUNDING * (1.0 + finger.n_units / 64.0 + np.abs(softness))
        error = 2.0 * np.hypot(step[0], step[1]) + rounding * finger.straight_length
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
    cancelling = np.flatnonzero(~(determinant > CANCELING_SHARE * xx * yy))
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


def min_eigenvalues(settled: Settled) -> Array:
    """Smallest eigenvalue of the Hessian in node coordinates, N/mm, shape (batch,).

    At an equilibrium the compliance of all nodes is C = J H⁻¹ Jᵀ with J the nodes' derivatives
    by the formulation's coordinates, and the smallest eigenvalue is 1/λ_max(C): the stiff bars
    do not touch its digits, and rigid bars need no special case. NaN where H is not positive
    definite.
    """
    equilibrium = settled.equilibrium
    positive = np.asarray((equilibrium.factorization.pivots > 0.0).all(axis=0))
    nodes = settled.potential.coordinates.station_jacobian(equilibrium.coordinates)
    sides = forward(equilibrium.factorization, nodes)
    roots = np.sqrt(np.where(positive, equilibrium.factorization.pivots, 1.0))
    scaled = np.where(positive, sides / roots[:, None], 0.0)
    # by the layout of memory, which of one lane is another, products are summed in another order
    matrices = np.ascontiguousarray(scaled.transpose(2, 0, 1))
    largest = np.linalg.eigvalsh(matrices @ matrices.transpose(0, 2, 1))[:, -1]
    with np.errstate(divide="ignore"):
        return np.where(positive, 1.0 / largest, np.nan)
