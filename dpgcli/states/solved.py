"""Solved states by any method, and further quantities of those solved as whole fingers."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags
from dpgcli.design.scene import Gripper, Uncertainty
from dpgcli.mechanics.coordinates import FingerCoordinates, Stations
from dpgcli.records import dataclass
from dpgcli.states.certify import Settled, Status
from dpgcli.states.gripper import GripperPose, place_in_gripper
from dpgcli.states.tip import Tip, min_eigenvalues, tip

if TYPE_CHECKING:
    from dpgcli.states.barriers import Barriers
    from dpgcli.states.uncertainty import Spread


@dataclass(frozen=True)
class SolvedStates:
    """Certified states by any method, arrays of shape (…, state).

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

    @cached_property
    def is_state(self) -> Flags:
        """Flags of stable and marginal states: equilibria of the pattern asked for, (state,)."""
        return np.asarray((self.status == Status.STABLE) | (self.status == Status.MARGINAL))

    @property
    def energy(self) -> Array:
        """Potential energy, mJ."""
        first, *rest = self.energies.values()
        return sum(rest, start=first)


@dataclass(frozen=True)
class Surroundings:
    """A finger's gripper, if any, layer thickness (mm) and uncertainty.

    Numbers, or arrays by state.
    """

    gripper: Gripper | None = None
    layer_thickness: float | Array = 0.0
    uncertainty: Uncertainty | None = None


ALONE = Surroundings()


def all_nodes(system: FingerCoordinates, coordinates: Array) -> Stations:
    """Positions of all nodes, the clamped ones first, mm, each (unit + 1, batch)."""
    stations = system.stations(coordinates)
    origin = np.zeros_like(stations.base_x[:1])
    clamped = (origin, origin, origin, origin + system.finger.segment_height)
    pairs = zip(clamped, stations, strict=True)
    return Stations(*(np.concatenate((row, rows)) for row, rows in pairs))


@dataclass(frozen=True)
class SolvedFingers(SolvedStates):
    """States that were solved as whole fingers; everything further is computed when asked for."""

    settled: Settled
    tip: Tip
    around: Surroundings
    barriers_if_asked: "Barriers | None" = None

    @classmethod
    def of(
        cls,
        settled: Settled,
        around: Surroundings,
        dropped_error: float | Array,
        *,
        with_compliance: bool,
        barriers: "Barriers | None" = None,
    ) -> "SolvedFingers":
        """The states of a batch; `dropped_error` is added to the error of each tip, mm."""
        at_tip = tip(settled, with_compliance=with_compliance)
        return cls(
            settled.inverted,
            settled.reached,
            settled.status,
            at_tip.pose,
            at_tip.error + dropped_error,
            settled.equilibrium.energies,
            settled.equilibrium.residual,
            settled,
            at_tip,
            around,
            barriers,
        )

    @property
    def barriers(self) -> "Barriers":
        """What units have to get over to flip, and which of them needs least."""
        if self.barriers_if_asked is None:
            raise ValueError("the states were solved without their barriers")
        return self.barriers_if_asked

    @cached_property
    def eigenvalues(self) -> Array:
        """Smallest eigenvalues in node coordinates, N/mm."""
        return min_eigenvalues(self.settled)

    @cached_property
    def openings(self) -> Array:
        """Openings at the domes' axis with what walls yield, mm, (unit, state)."""
        coordinates = self.settled.potential.coordinates
        return coordinates.springs(self.settled.equilibrium.coordinates).extension

    @cached_property
    def nodes(self) -> Stations:
        """Positions of all nodes, the clamped ones first, mm, each (unit + 1, state)."""
        coordinates = self.settled.potential.coordinates
        return all_nodes(coordinates, self.settled.equilibrium.coordinates)

    @cached_property
    def in_gripper(self) -> GripperPose:
        """The finger as the upper one of its gripper."""
        if self.around.gripper is None:
            raise ValueError("the fingers belong to no gripper")
        return place_in_gripper(self.around.gripper, self.around.layer_thickness, self.nodes)

    @cached_property
    def compliance(self) -> Array:
        """The tip's compliance by `tip.COMPLIANCE_PAIRS`, in mm/N, rad/N and rad/(N mm)."""
        if self.tip.compliance is None:
            raise ValueError("the tip was solved without its compliance")
        return self.tip.compliance

    @cached_property
    def stiffness(self) -> Array:
        """The softest and the stiffest stiffness of the tip's position, N/mm."""
        if self.tip.stiffness is None:
            raise ValueError("the tip was solved without its compliance")
        return self.tip.stiffness

    @cached_property
    def spread(self) -> "Spread":
        """Standard uncertainties of pose and aperture, by what the scene says may be off."""
        from dpgcli.states.uncertainty import spread

        around = self.around
        if around.uncertainty is None:
            raise ValueError("no value of the fingers may be off")
        return spread(
            self.settled, self.pose, around.uncertainty, around.gripper, around.layer_thickness
        )
