"""What there is of fingers, bodies and domes: gaps, and where coordinates and cells stand."""

from collections.abc import Iterator
from dataclasses import field, replace
from functools import cached_property
from typing import Self

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.equilibrium.contracts import OwnCoordinate, Row, WideMeasure, take_lanes
from dpgcli.equilibrium.joined import OfPart, Together
from dpgcli.grasping.shapes import Motion, Ramp
from dpgcli.mechanics.coordinates import FingerPotential
from dpgcli.mechanics.dome_gaps import DomeGaps
from dpgcli.mechanics.face import Face
from dpgcli.mechanics.gaps import FaceGaps
from dpgcli.mechanics.laws import PushOnly
from dpgcli.mechanics.mirror import Axis, Heights, NodeGaps, OfNodes, Touching
from dpgcli.mechanics.obstacle import Obstacle
from dpgcli.mechanics.sticking import Sticking
from dpgcli.mechanics.terms import Formulate
from dpgcli.records import dataclass
from dpgcli.states.units import UnitSolutions


@dataclass(frozen=True)
class Layout:
    """Fingers with bodies in their way: one design and body, or one for each lane.

    There are as many fingers to a lane as there are `bodies`: what the body is in the frame of
    each. Fingers that meet each other have an `axis`, in which their frames are mirror images: two
    of them do, with or without a body, and one alone that `is_mirrored` meets its mirror image
    there. Arrays by unit are those of the first finger, then of the next; so are those by cell.
    Coordinates are interleaved (`equilibrium.joined`), those of the `motion` behind them, then
    those of domes by themselves. Cells are gaps to bodies, then those between fingers, then those
    between domes and neighbors, then what is prescribed.

    `thickness` (1, 1 or batch) is that of the layer, mm. Bodies may stand in the way by less than
    they will: by b = (λ − 1) D with a load λ, `depth` D (batch,) in mm; and mirror images may come
    to the axis, from `apart` (batch,), mm, beyond it. A `ramp` changes the pressures on their domes
    by the load; without it there are none. Points of bodies deeper behind a face than the `reach`
    (batch,), mm, are beyond the finger. Places that are `sticking` to a body that is there in full
    do not slide along it.
    """

    units: UnitSolutions
    formulate: Formulate
    thickness: Array
    bodies: tuple[Obstacle, ...]
    depth: Array
    motion: Motion | None = None
    ramp: Ramp | None = None
    reach: Array | None = None
    sticking: tuple[Sticking, ...] = ()
    axis: Axis | None = None
    is_mirrored: bool = False
    apart: Array = field(default_factory=lambda: np.zeros(1))

    @property
    def n_fingers(self) -> int:
        """Fingers to a lane."""
        return 1 if self.is_mirrored else len(self.bodies) or 2

    def take_lanes(self, index: Indices) -> Self:
        """Some of the fingers."""
        thickness, depth = take_lanes(self.thickness, index), take_lanes(self.depth, index)
        bodies = tuple(body.take_lanes(index) for body in self.bodies)
        motion = self.motion and self.motion.take_lanes(index)
        ramp = self.ramp and self.ramp.take_lanes(index)
        reach = None if self.reach is None else take_lanes(self.reach, index)
        units = self.units.take_lanes(index)
        sticking = tuple(place.take_lanes(index) for place in self.sticking)
        axis, apart = self.axis and self.axis.take_lanes(index), take_lanes(self.apart, index)
        return replace(
            self,
            units=units,
            thickness=thickness,
            bodies=bodies,
            depth=depth,
            motion=motion,
            ramp=ramp,
            reach=reach,
            sticking=sticking,
            axis=axis,
            apart=apart,
        )

    def of_finger(self, values: Array, finger: int) -> Array:
        """What belongs to a finger of coordinates (size, …)."""
        return values[finger : self.n_own : self.n_fingers]

    @cached_property
    def n_own(self) -> int:
        """Coordinates of all fingers."""
        return self.n_fingers * self.formulate(self.units.finger).coordinates.size

    @cached_property
    def _still(self) -> tuple[Face, ...]:
        """The faces of the fingers."""
        alone = Face.of(self.formulate(self.units.finger).coordinates, self.thickness)
        n = self.n_fingers
        return tuple(replace(alone, places=n * alone.places + finger) for finger in range(n))

    @cached_property
    def _moving(self) -> tuple[Face, ...]:
        """The same as what moves sees them."""
        if self.motion is None:
            return self._still
        own = np.arange(self.n_own, self.n_own + self.motion.n)
        motion, pairs = self.motion, enumerate(self._still)
        return tuple(
            face.seen_from(motion.directions[finger], own, motion.pivot_of(finger))
            for finger, face in pairs
        )

    @property
    def faces(self) -> tuple[Face, ...]:
        """The faces of the fingers, as the body sees them."""
        return self._still if self._moves_bases else self._moving

    @property
    def _moves_bases(self) -> bool:
        return self.motion is not None and self.motion.is_of_bases

    @cached_property
    def contacts(self) -> tuple[FaceGaps | Heights | NodeGaps, ...]:
        """The gaps of each finger to its body, and behind them those between fingers."""
        return (*self.on_bodies, *self._between)

    @cached_property
    def on_bodies(self) -> tuple[FaceGaps, ...]:
        """The gaps of each finger to its body."""
        pairs = zip(self.faces, self.bodies, strict=False)  # there may be no body
        return tuple(FaceGaps(face, body, reach=self.reach) for face, body in pairs)

    @cached_property
    def _between(self) -> tuple[Heights | NodeGaps, ...]:
        """The gaps between fingers that meet."""
        if self.axis is None:
            return ()
        faces = self._moving if self._moves_bases else self._still
        if self.is_mirrored:
            return (Heights(faces[0].with_end(), self.axis),)
        upper, lower = (face.with_end() for face in faces)
        told = self.axis, self.n_own + self._n_motions, self.behind
        return NodeGaps(upper, lower, *told, True), NodeGaps(lower, upper, *told, False)

    @property
    def behind(self) -> Array:
        """How far behind the face the domes reach, mm, (1 or batch,)."""
        height = self.units.finger.segment_height.max(axis=0)
        return np.asarray(height + 0.5 * self.thickness[0])

    def seen_by(self, finger: int) -> Iterator[tuple[slice, Touching]]:
        """The cells that a finger has a part in, and what it touches there."""
        n_before = 0
        for number, gaps in enumerate(self.contacts):
            cells = slice(n_before, n_before + gaps.n_cells)
            if number % self.n_fingers == finger:
                yield cells, gaps
            elif isinstance(gaps, NodeGaps):
                yield cells, OfNodes(gaps)
            n_before = cells.stop

    def gaps(self, first: Flags | None = None) -> WideMeasure:
        """Gaps to the bodies in full; at each place only one, if it is said which come first.

        Behind them what is prescribed: motions, and places that stick.
        """
        gaps: list[WideMeasure] = []
        for bare in self.contacts:
            n = sum(measure.n_cells for measure in gaps)
            gaps.append(bare.with_first(None if first is None else first[n : n + bare.n_cells]))
        if self.motion is None and not self.n_travels and len(gaps) == 1:
            return gaps[0]
        return Together((*gaps, *self._dome_gaps, *self._prescribed), self._n_frame)

    def each(self, push: Array) -> Iterator[tuple[FaceGaps, Array]]:
        """The gaps of each finger to its body, and what belongs to them of pushes (cell, …)."""
        n_before = 0
        for gaps in self.on_bodies:
            yield gaps, push[n_before : n_before + gaps.n_cells]
            n_before += gaps.n_cells

    @property
    def _n_motions(self) -> int:
        return 0 if self.motion is None else self.motion.n

    @cached_property
    def n_travels(self) -> int:
        """Domes with coordinates of their own: those that only push, while pressures change."""
        has_own = self.ramp is not None and isinstance(self.units.finger.law, PushOnly)
        return self.n_fingers * self.units.finger.n_units if has_own else 0

    @property
    def _n_frame(self) -> int:
        """Coordinates of fingers, body and domes."""
        return self.n_own + self._n_motions + self.n_travels

    @property
    def travels(self) -> tuple[OwnCoordinate, ...]:
        """Where the domes of each finger are by themselves, as extensions of their springs, mm."""
        n, first = self.units.finger.n_units, self.n_own + self._n_motions
        places = range(first, first + self.n_travels, n)
        return tuple(OwnCoordinate(Row(1, place), n) for place in places)

    @cached_property
    def _dome_gaps(self) -> tuple[DomeGaps, ...]:
        """Those of each finger between domes by themselves and their neighbors."""
        if not self.n_travels:
            return ()
        own = (self.formulate(self.units.finger),) * self.n_fingers
        pairs = zip(self._extensions(own), self.travels, strict=True)
        return tuple(DomeGaps(extension, travel) for extension, travel in pairs)

    def _extensions(self, own: tuple[FingerPotential, ...]) -> tuple[OfPart, ...]:
        """Extensions of the domes' springs of each finger."""
        n, size = len(own), self.n_own
        return tuple(
            OfPart(alone.coordinates.dome, place, n, size) for place, alone in enumerate(own)
        )

    @property
    def _motions(self) -> OwnCoordinate:
        return OwnCoordinate(Row(1, self.n_own), self._n_motions)

    @property
    def _opening(self) -> OwnCoordinate:
        """The last of the motions, which a body may resist."""
        return OwnCoordinate(Row(1, self.n_own + self._n_motions - 1), 1)

    @property
    def _prescribed(self) -> tuple[OwnCoordinate | Sticking, ...]:
        is_told = self.motion is not None and self.motion.travel is not None
        return (*((self._motions,) if is_told else ()), *self.sticking)

    @property
    def is_free(self) -> bool:
        """Whether nothing but the fingers keeps the body where it is."""
        motion = self.motion
        return motion is not None and motion.travel is None and motion.resistance is None

    @cached_property
    def n_gaps(self) -> int:
        """Cells that are gaps."""
        return sum(gaps.n_cells for gaps in self.contacts)

    @cached_property
    def n_on_bodies(self) -> int:
        """Those of them, the first ones, that are gaps to bodies."""
        return sum(gaps.n_cells for gaps in self.on_bodies)

    @cached_property
    def are_kept(self) -> Flags:
        """Cells that are no gaps, (cell, 1)."""
        n_others = sum(measure.n_cells for measure in self._prescribed)
        n_contacts = self.n_gaps + self.n_travels
        return (np.arange(n_contacts + n_others) >= n_contacts)[:, None]

    @property
    def _deep(self) -> Array:
        """D of every cell, (…, batch)."""
        is_told = self.motion is not None and self.motion.travel is not None
        if self.axis is None and not is_told:
            return self.depth
        n_between = self.n_gaps - self.n_on_bodies
        travel = np.zeros((0, 1)) if self.motion is None else self.motion.travel
        deep = [(self.n_on_bodies, self.depth), (n_between, self.apart)]
        deep.append((self.n_travels, np.zeros(1)))
        deep += [] if travel is None else [(len(travel), travel)]
        deep.append((len(self.sticking), np.zeros(1)))
        n_lanes = max(own.shape[-1] for _, own in deep)
        return np.concatenate([np.broadcast_to(own, (n, n_lanes)) for n, own in deep])

    @property
    def _limits(self) -> Array | None:
        """How much of its finger's pushes a place that sticks bears, (place, cell, 1 or lane)."""
        if not self.sticking:
            return None
        n_lanes = max(place.friction.shape[1] for place in self.sticking)
        limits, n_before = np.zeros((len(self.sticking), len(self.are_kept), n_lanes)), 0
        for finger, (place, gaps) in enumerate(zip(self.sticking, self.on_bodies, strict=True)):
            limits[finger, n_before : n_before + gaps.n_cells] = place.friction
            n_before += gaps.n_cells
        return limits

    def bound(self, load: Array) -> Array:
        """b = (λ − 1) D, mm."""
        return (load - 1.0) * self._deep
