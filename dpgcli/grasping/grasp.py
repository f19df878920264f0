"""What a finger, or a gripper's two, do with a round body in their way."""

from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Codes, Flags, total
from dpgcli.design.scene import Disc, Gripper, Scene
from dpgcli.equilibrium.newton import looked_at
from dpgcli.grasping.approach import Approach, Reset, approach
from dpgcli.grasping.contact import Obstructed
from dpgcli.mechanics.coordinates import Stations
from dpgcli.mechanics.gaps import nearest
from dpgcli.mechanics.obstacle import Obstacle
from dpgcli.mechanics.terms import Formulate
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Settled, Status, certified, certify
from dpgcli.states.patterns import codes_of, inverted_units
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

MARGIN_TO = 2.0  # of the load: margins are looked for so far


class FingerFrame(NamedTuple):
    """A finger's frame in the gripper's: angle (rad), base (mm) and side, 1 or −1 if mirrored.

    >>> upper, lower = frames(Gripper(base_spacing=60.0, mounting_angle=0.0))
    >>> lower.inside(np.array([40.0, -5.0])).tolist()  # 25 mm above the lower base
    [40.0, -25.0]
    """

    angle: float
    offset: float
    side: int

    def inside(self, point: Array) -> Array:
        """A point of the gripper's frame, (2, …), in the finger's."""
        x, y = point[0], self.side * point[1] - self.offset
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        return np.stack((cos * x + sin * y, cos * y - sin * x))

    def outside(self, vector: Array) -> Array:
        """A direction in the finger's frame, (2, …), in the gripper's."""
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        x, y = cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]
        return np.stack((x, self.side * y))

    def placed(self, point: Array) -> Array:
        """A point of the finger's frame, (2, …), in the gripper's."""
        shift = np.zeros((2,) + (1,) * (point.ndim - 1))
        shift[1] = self.side * self.offset
        return self.outside(point) + shift


def frames(gripper: Gripper | None) -> tuple[FingerFrame, ...]:
    """The frames of the upper and the lower finger; of one alone its own."""
    if gripper is None:
        return (FingerFrame(0.0, 0.0, 1),)
    angle, half = float(gripper.mounting_angle), 0.5 * float(gripper.base_spacing)
    return FingerFrame(angle, half, 1), FingerFrame(angle, half, -1)


@dataclass(frozen=True)
class Grasped:
    """Fingers at rest against a body, a lane each; forces on the body in the finger's frame.

    `status` are `Status` codes of the states that `code` (batch,) have become, `after`; `push`
    (side, batch) N is by phalanx along `normal`, `force` (2, batch) N, `gap` (batch,) mm the
    smallest, `margin` what more of the load the next unit bears. `nodes`, and `face` (2, node,
    batch), in mm. `residual` N and `error` mm are those of the tip. `resets` say what happened.
    """

    code: Codes
    after: Codes
    status: NDArray[np.uint8]
    push: Array
    normal: Array
    force: Array
    gap: Array
    margin: Array
    residual: Array
    error: Array
    nodes: Stations
    face: Array
    resets: tuple[Reset, ...]
    BY_LANE: ClassVar = (
        *("code", "after", "status", "push", "force", "gap", "margin"),
        *("residual", "error"),
    )


def held(
    scene: Scene, formulate: Formulate, disc: Disc, frame: FingerFrame, codes: Codes
) -> Grasped:
    """Let a body grow at its place about fingers in these states.

    Raises ValueError for a scene without the thickness of its layer.
    """
    if scene.layer_thickness is None:
        raise ValueError("the face of a finger needs the thickness of its layer")
    units = UnitSolutions.of(scene.finger)
    n = scene.finger.n_units
    pattern = inverted_units(codes, n)
    free = settle(units, formulate, pattern, DEFAULT_TOLERANCE)
    center = frame.inside(disc.center)[:, None, None]
    thickness = np.full((1, 1), float(np.squeeze(scene.layer_thickness)))
    body = Obstacle(center, np.full((1, 1), disc.radius))
    bare = Obstructed(units, formulate, thickness, body, np.zeros(1))
    x = free.equilibrium.coordinates
    depth = np.maximum(disc.radius, -bare.gaps()(x).value.min(axis=0))
    own = replace(bare, depth=depth)
    nothing, begin = np.zeros((n, len(codes))), np.zeros(len(codes))
    start = own.finished(x, pattern, nothing, begin)
    is_stable = free.status == Status.STABLE
    start = replace(start, is_there=start.is_there & is_stable)
    grown = approach(own, start, begin, begin + 1.0)
    settled = _certified(own, grown)
    status = np.where(is_stable, settled.status, free.status)
    is_lost = is_stable & ~grown.shapes.is_there
    status = np.where(is_lost, np.uint8(Status.NOT_CONVERGED), status)
    return _described(own, codes, grown, settled, status)


def _certified(own: Obstructed, grown: Approach) -> Settled:
    """The states that fingers have come to rest in, certified with their contacts."""
    shapes = grown.shapes
    potential = own.pressed(shapes.inverted, shapes.push, grown.load)
    there = looked_at(potential, shapes.coordinates)
    settled = certified(own.units, potential, shapes.inverted, there, DEFAULT_TOLERANCE)
    settled = replace(settled, inverted=settled.reached)
    return replace(settled, status=certify(settled, own.units, DEFAULT_TOLERANCE))


def _described(
    own: Obstructed, codes: Codes, grown: Approach, settled: Settled, status: NDArray[np.uint8]
) -> Grasped:
    """What there is to say of fingers that have come to rest."""
    shapes, coordinates = own.relabeled(grown.shapes), settled.potential.coordinates
    face = own.face.shape(shapes.coordinates)
    near = nearest(face, own.obstacle.points)
    push = shapes.push
    at_tip = tip(settled, with_compliance=False)
    return Grasped(
        code=codes,
        after=codes_of(settled.reached),
        status=status,
        push=push,
        normal=near.normal[:, 0],
        force=total(np.moveaxis(near.normal[:, 0] * push, 1, 0)),
        gap=own.gaps()(shapes.coordinates).value.min(axis=0),
        margin=_margins(own, grown, np.asarray(status == Status.STABLE)),
        residual=settled.equilibrium.residual,
        error=at_tip.error,
        nodes=coordinates.stations(shapes.coordinates),
        face=face.nodes,
        resets=grown.resets,
    )


def _margins(own: Obstructed, grown: Approach, is_stable: Flags) -> Array:
    """What more of the load fingers bear before a unit resets; infinite beyond `MARGIN_TO`.

    NaN where there is no state, or none is found on the way on.
    """
    shapes = replace(grown.shapes, is_there=grown.shapes.is_there & is_stable)
    onwards = approach(own, shapes, grown.load, 0.0 * grown.load + MARGIN_TO, to_reset=True)
    margin = np.where(onwards.shapes.is_there, np.inf, np.nan)
    for reset in onwards.resets:
        margin[reset.lanes] = reset.load - 1.0
    return margin
