"""Whether an equilibrium is a stable state of its pattern: residual, curvature, wells, shape."""

from dataclasses import replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags
from dpgcli.equilibrium.newton import Equilibrium
from dpgcli.mechanics.coordinates import FingerCoordinates, FingerPotential
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass
from dpgcli.states.crossing import crosses_itself, outline
from dpgcli.states.units import UnitSolutions
from dpgcli.states.wells import Wells

MARGINAL_CURVATURE = float(np.sqrt(np.finfo(float).eps))  # below it, rounding may decide
SMALL_SHARE = 0.1  # of a unit's holding force: a smaller residual cannot make it snap
LARGEST_CURVATURE = 1.0  # a larger one is far from any loss of stability
FINEST_BALANCE = 3e-13  # of the finger's forces in play: rounding leaves so much of them


class Status(IntEnum):
    """The result of certification, the graver the greater.

    `text` is the word in tables, `meaning` the sentence in summaries.
    """

    STABLE = 0
    MARGINAL = 1
    ANOTHER_PATTERN = 2
    NOT_BISTABLE = 3
    GAP_CLOSED = 4  # under pressure only: see `actuation.rest`
    NOT_HELD = 5  # of a body that may move only: see `grasping.release`
    BEYOND_TABLE = 6  # of jaws whose forces are in a table only
    FOLDED = 7
    NOT_CONVERGED = 8

    @property
    def text(self) -> str:
        """The word in tables, such as `not_bistable`."""
        return self.name.lower()

    @property
    def meaning(self) -> str:
        """The sentence in summaries."""
        return _MEANINGS[self]

    def meaning_for(self, finger: Finger) -> str:
        """The sentence for a finger, whose loads may be the reason as well."""
        is_by_way = self is Status.NOT_CONVERGED and finger.is_loaded
        return f"{self.meaning}; or {_LOST}" if is_by_way else self.meaning


UNDECIDED = (Status.MARGINAL, Status.NOT_CONVERGED)  # a saddle has states beside it
_MEANINGS = {
    Status.STABLE: "certified: residual, curvature, wells and shape",
    Status.MARGINAL: "an equilibrium whose curvature is not safely positive: next to a fold, or a "
    "saddle, as a finger that is straight under more than it buckles at",
    Status.ANOTHER_PATTERN: "the search ended in the minimum of another pattern, or in a ripple of "
    "a dome's curve",
    Status.NOT_BISTABLE: "a unit that the pattern inverts has no second well",
    Status.GAP_CLOSED: "a gap is closed beyond the place of its dome at rest, which would push as "
    "pressure comes; where that dome really is a calibration's curve knows",
    Status.NOT_HELD: "nothing keeps the body between the fingers: let go of, it leaves them",
    Status.BEYOND_TABLE: "jaws would rest at an aperture beyond those of their table of forces",
    Status.FOLDED: "a minimum of the equations whose shape no finger can take",
    Status.NOT_CONVERGED: "the residual is above its tolerance, or not small against what a unit "
    "bears before it leaves its well",
}
_LOST = "the state is lost, or folds onto itself, as loads grow"


@dataclass(frozen=True)
class Settled:
    """Equilibria of one finger (or one per lane), certified, shapes (…, batch).

    `inverted` is the pattern that was asked for, `reached` the wells in which the units ended,
    (unit, batch); `strayed` are units in a ripple of their dome's curve instead of their well (see
    `wells.Wells`), (unit, batch); `is_folded` marks impossible shapes, `is_balanced` residual
    forces too small to matter, (batch,). `status` holds `Status` codes.
    """

    potential: FingerPotential
    equilibrium: Equilibrium
    inverted: Flags
    reached: Flags
    strayed: Flags
    is_folded: Flags
    is_balanced: Flags
    status: NDArray[np.uint8]

    @property
    def finger(self) -> Finger:
        """The finger in the states of its domes."""
        return self.potential.coordinates.finger


def certified(
    units: UnitSolutions,
    potential: FingerPotential,
    inverted: Flags,
    equilibrium: Equilibrium,
    tolerance: float,
    own: slice = slice(None),
) -> Settled:
    """Certify equilibria found for these patterns, (unit, batch).

    `own` are the units that must have reached their wells; `units` are all.
    """
    coordinates = potential.coordinates
    extension, is_folded, lever = coordinates.springs(equilibrium.coordinates)
    wells = units.wells
    reached = are_inverted(coordinates.finger, extension, wells)
    strayed = reached & ((extension < wells.from_top) | (extension > wells.to_top))
    loop = units.shortest_loop
    if loop is not None:
        nodes = coordinates.stations(equilibrium.coordinates)
        is_folded |= crosses_itself(outline(nodes, units.finger.segment_height), loop)
    is_balanced = _is_balanced(coordinates, equilibrium, lever, reached, wells)
    unknown = np.zeros(inverted.shape[1], np.uint8)
    settled = Settled(
        potential, equilibrium, inverted, reached, strayed, is_folded, is_balanced, unknown
    )
    return replace(settled, status=certify(settled, units, tolerance, own))


def are_inverted(finger: Finger, extension: Array, wells: Wells) -> Flags:
    """Units open beyond the tops of their domes, (unit, batch), by extensions in mm.

    A dome that does not act is not inverted by its neighbors, or by loads.
    """
    return np.asarray((extension > wells.spring_barrier) & (finger.acting > 0.0))


def certify(
    settled: Settled, units: UnitSolutions, tolerance: float, own: slice = slice(None)
) -> NDArray[np.uint8]:
    """The gravest reason why a lane is not a certified state of its pattern, `Status` codes."""
    equilibrium = settled.equilibrium
    inverted, reached = settled.inverted[own], settled.reached[own]
    elsewhere = reached != inverted
    has_none = np.broadcast_to(units.have_no_well, settled.inverted.shape)[own]
    is_curved = equilibrium.curvature > MARGINAL_CURVATURE
    checks = (
        (~is_curved, Status.MARGINAL),
        ((elsewhere | settled.strayed[own]).any(axis=0), Status.ANOTHER_PATTERN),
        ((elsewhere & inverted & has_none).any(axis=0), Status.NOT_BISTABLE),
        (settled.is_folded, Status.FOLDED),
        (is_curved & ~settled.is_balanced, Status.NOT_CONVERGED),
        (~(equilibrium.relative_residual <= tolerance), Status.NOT_CONVERGED),
    )
    status = np.full(inverted.shape[1], Status.STABLE, np.uint8)
    for failed, reason in checks:
        status[failed] = reason
    return status


def _is_balanced(
    coordinates: FingerCoordinates,
    equilibrium: Equilibrium,
    lever: Array,
    reached: Flags,
    wells: Wells,
) -> Flags:
    """Whether the residual forces are too small to decide that there is a state, (batch,).

    The moments about a unit's corners have to be small against

    - what the unit bears, or lacks for a second well, between rigid bars, as forces on the opening:
      more could hold it where it does not rest
    - over H, what a fold as near as the curvature κ allows would bear: where the opening has a
      stiffness λ whose slope is c, a minimum bears a force of λ²/2c; for equal corners λ = κ k/4,
      and near the spring's inflection c = 3 k/d, k being k_b + k_θ/H² (our derivation). A low
      curvature may come from a faint hinge as well, so that rounding is always allowed.

    The residual would not do: stiff bars leave rounding in it that does not move a corner.
    """
    finger = coordinates.finger
    moments = np.abs(coordinates.corner_moments(equilibrium.coordinates, equilibrium.gradient))
    unbalance = moments.max(axis=0) / finger.segment_height
    on_opening = (moments / np.where(lever > 0.0, lever, finger.segment_height)).max(axis=0)
    borne = np.where(reached, np.abs(wells.reset_force), wells.snap_force)
    curvature = np.clip(equilibrium.curvature, 0.0, LARGEST_CURVATURE)
    rounding = FINEST_BALANCE * finger.force_scale.max(axis=0)  # a weak unit feels its neighbors'
    by_fold = np.maximum(curvature * curvature / 96.0 * finger.force_scale, rounding)
    is_small = (on_opening <= SMALL_SHARE * borne) & (unbalance <= SMALL_SHARE * by_fold)
    return np.asarray(is_small.all(axis=0))
