"""Shapes of fingers against bodies, how bodies may move, and pressures that change."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.contracts import ScalarLaw, take_lanes
from dpgcli.mechanics.aperture import KeptApart, Softening
from dpgcli.mechanics.face import Pivot
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.records import dataclass
from dpgcli.states.certify import Status


@dataclass(frozen=True)
class ContactShapes:
    """Shapes against bodies, a lane each: coordinates (size, batch) and pushes (cell, batch), N.

    `inverted` (unit, batch) are the domes that act as inverted ones, `active` (cell, batch) the
    gaps that are closed. `is_there` says which are equilibria, (batch,).
    """

    coordinates: Array
    push: Array
    active: Flags
    inverted: Flags
    is_there: Flags

    @classmethod
    def joined(cls, parts: Sequence["ContactShapes"]) -> "ContactShapes":
        """Those of several batches as one."""
        values = zip(*(vars(part).values() for part in parts), strict=True)
        return cls(*(np.concatenate(own, axis=-1) for own in values))

    def put(self, index: Indices, others: "ContactShapes") -> None:
        """Replace the lanes at `index`."""
        for name, values in vars(self).items():
            values[..., index] = getattr(others, name)

    def take_lanes(self, index: Indices) -> "ContactShapes":
        """Some of them."""
        return ContactShapes(*(np.take(values, index, axis=-1) for values in vars(self).values()))


@dataclass(frozen=True)
class Motion:
    """How a body may move, or the bases of fingers, by q, (motion, batch) in mm.

    `directions` (2, motion, 1 or batch) are the ways it moves, in the frame of each finger; with
    `pivots` in these frames it turns, too, by a q before all others. `resistance` is the law of the
    last q, if any. `hold` (motion, batch) N keeps it where it is at a load of 0, and lets go of it
    until 1; so does a `spring` (1, 1 or batch) N/mm on each q, if there is one. With a `travel` D
    (motion, batch), mm, it does not move by itself: q is (λ − 1) D. Where it `is_of_bases` each
    finger moves with what it touches but the other finger.
    """

    directions: tuple[Array, ...]
    resistance: ScalarLaw | None = None
    hold: Array | None = None
    travel: Array | None = None
    pivots: tuple[Pivot, ...] = ()
    spring: Array | None = None
    is_of_bases: bool = False

    @property
    def n(self) -> int:
        """Number of motions."""
        return int(self.directions[0].shape[1]) + bool(self.pivots)

    @property
    def ways(self) -> slice:
        """The motions along x and y of a body that is free."""
        return slice(len(self.pivots[:1]), len(self.pivots[:1]) + 2)

    def pivot_of(self, finger: int) -> Pivot | None:
        """What the body turns about in the frame of a finger, if it does."""
        return self.pivots[finger] if self.pivots else None

    @property
    def softening(self) -> Softening | None:
        """How what resists it softens; None if it does not."""
        law = self.resistance
        return law.curve.softening if isinstance(law, KeptApart) else None

    def take_lanes(self, index: Indices) -> "Motion":
        """Those of some lanes."""
        return Motion(
            tuple(take_lanes(along, index) for along in self.directions),
            self.resistance and self.resistance.take_lanes(index),
            None if self.hold is None else take_lanes(self.hold, index),
            None if self.travel is None else take_lanes(self.travel, index),
            tuple(pivot.take_lanes(index) for pivot in self.pivots),
            None if self.spring is None else take_lanes(self.spring, index),
            self.is_of_bases,
        )


@dataclass(frozen=True)
class Ramp:
    """Pressures on the domes of each finger, p = p₀ + λ Δp by a load λ, (unit, 1) in MPa."""

    volumes: DomeVolumes
    begin: Array
    change: Array

    def take_lanes(self, index: Indices) -> "Ramp":
        """Those of some lanes."""
        volumes = self.volumes.take_lanes(index)
        return Ramp(volumes, take_lanes(self.begin, index), take_lanes(self.change, index))


def with_lost(status: NDArray[np.uint8], is_there: Flags) -> NDArray[np.uint8]:
    """Statuses before, (batch,), but for those of states that have no rest any more."""
    is_lost = (status == Status.STABLE) & ~is_there
    return np.where(is_lost, np.uint8(Status.NOT_CONVERGED), status)
