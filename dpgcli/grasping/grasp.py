"""What a finger, or a gripper's two, do with a body in their way."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Codes, Flags
from dpgcli.design.bodies import Body
from dpgcli.design.scene import Scene
from dpgcli.equilibrium.newton import Equilibrium, looked_at
from dpgcli.grasping.approach import Approach, Reset, Way, approach, moved_in
from dpgcli.grasping.closing import Closing, closed, with_reach
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.descent import finished
from dpgcli.grasping.frames import FingerFrame
from dpgcli.grasping.grasped import Grasped, Placed, Pushes
from dpgcli.grasping.shapes import ContactShapes, Motion, with_lost
from dpgcli.grasping.travels import with_reasons
from dpgcli.mechanics.face import Face
from dpgcli.mechanics.gaps import Touches
from dpgcli.mechanics.mirror import Touching
from dpgcli.mechanics.obstacle import Obstacle
from dpgcli.mechanics.plates import SLIGHT
from dpgcli.mechanics.terms import Formulate
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Settled, Status, certified, certify
from dpgcli.states.patterns import codes_of, inverted_units
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

MARGIN_TO = 2.0  # of the load: margins are looked for so far
BLOCK = 2**28  # bytes
LANE = 800  # bytes of a lane, times the square of its units: measured from 10 to 26 of them


def blocks(n_lanes: int, n_units: int) -> Iterator[slice]:
    """Lanes that are worked on at once, so that these take no more than BLOCK bytes."""
    size = max(BLOCK // (LANE * n_units**2), 1)
    for first in range(0, max(n_lanes, 1), size):
        yield slice(first, min(first + size, n_lanes))


def placed(
    scene: Scene,
    formulate: Formulate,
    body: Body,
    frame: FingerFrame,
    codes: Codes,
    way: Way = Way.PLACE,
    closing: Closing | None = None,
    *,
    with_margins: bool = False,
) -> Placed:
    """Let fingers in these states meet a body that grows at its place, or moves to it.

    Then they close on it, if that is given. Margins, if they are wanted, are sought in the same
    batch where bodies grow and stay. Raises ValueError for a scene without the thickness of its
    layer.
    """
    if scene.layer_thickness is None:
        raise ValueError("the face of a finger needs the thickness of its layer")
    thickness = np.reshape(scene.layer_thickness, -1)
    units = UnitSolutions.of(scene.finger)
    parts = [
        met(
            units,
            formulate,
            thickness,
            body,
            frame,
            codes[some],
            way,
            closing,
            with_margins=with_margins,
        )
        for some in blocks(len(codes), scene.finger.n_units)
    ]
    return Placed.joined(parts)


def met(
    units: UnitSolutions,
    formulate: Formulate,
    thickness: Array,
    body: Body,
    frame: FingerFrame,
    codes: Codes,
    way: Way = Way.PLACE,
    closing: Closing | None = None,
    *,
    with_margins: bool = False,
) -> Placed:
    """The same of units and layers of some thickness, mm, (1,) or (batch,).

    They, the body and the frame are one for all states, or one for each.
    """
    pattern = inverted_units(codes, units.finger.n_units)
    free = settle(units, formulate, pattern, DEFAULT_TOLERANCE)
    bare = Obstructed(units, formulate, thickness[None], (frame.obstacle(body),), np.zeros(1))
    x = free.equilibrium.coordinates
    depth = np.maximum(body.inner_radius, -bare.gaps()(x).value.min(axis=0))
    own = replace(bare, depth=depth)
    is_stable = np.asarray(free.status == Status.STABLE)
    if way is Way.INSERT:
        came = _inserted(own, body, frame, x, pattern, is_stable)
    else:
        beyond = MARGIN_TO if with_margins and closing is None else None
        came = grown(own, x, pattern, is_stable, beyond)
    status = with_lost(free.status, came.shapes.is_there)
    if closing is not None:
        own = with_reach(own)
        came = closed(own, came, closing)
        status = with_reasons(own, came.shapes, status)
    return Placed(codes, own, came, status)


def grown(
    own: Obstructed,
    x: Array,
    pattern: Flags,
    is_stable: Flags,
    beyond: float | None,
    push: Array | None = None,
) -> Approach:
    """How fingers in balance, coordinates (size, batch), meet what grows in their way.

    They are free, or feel pushes, (cell, batch).
    """
    begin = np.zeros(x.shape[1])
    pushes = np.zeros((len(own.are_kept), len(begin)))
    if push is not None:
        pushes[: len(push)] = push
    start = finished(own, x, pattern, pushes, begin)
    start = replace(start, is_there=start.is_there & is_stable)
    return approach(own, start, begin, begin + 1.0, beyond=beyond)


def _inserted(
    own: Obstructed, body: Body, frame: FingerFrame, x: Array, pattern: Flags, is_stable: Flags
) -> Approach:
    """How they meet a body that comes in along −x, from beyond where the fingers could reach."""
    finger, begin = own.units.finger, np.zeros(x.shape[1])
    furthest = finger.straight_length + finger.segment_height[0] + own.thickness[0]
    from_there = np.maximum(furthest - body.nearest_x, 0.0)[None]
    along = frame.along(np.array([1.0, 0.0]))[:, None, None]
    motion = Motion((along,), travel=-from_there)
    coming = replace(own, depth=np.zeros(1), motion=motion)
    start = np.concatenate((x, np.broadcast_to(from_there, (1, len(begin)))))
    nothing = np.zeros((coming.n_gaps + 1, len(begin)))
    shapes = finished(coming, start, pattern, nothing, begin)
    came = moved_in(coming, replace(shapes, is_there=shapes.is_there & is_stable))
    return replace(came, shapes=coming.at_rest(came.shapes))


def described(
    own: Obstructed,
    codes: Sequence[Codes],
    grown: Approach,
    status: NDArray[np.uint8],
    *,
    with_margins: bool = True,
) -> tuple[Grasped, ...]:
    """What there is to say of fingers that have come to rest, of each; `status` is that before.

    Margins that are not known take as long again as all else, and are NaN unless they are wanted.
    """
    shapes = own.relabeled(grown.shapes)
    there, settled, status = judged(own, grown, status)
    margin, is_stable = np.full(len(status), np.nan), np.asarray(status == Status.STABLE)
    if with_margins:
        known = grown.margin
        margin = _margins(own, grown, is_stable) if known is None else known
        margin = np.where(is_stable, margin, np.nan)
    gaps = own.gaps()(shapes.coordinates).value
    found = []
    for finger, state in enumerate(settled):
        cells, seen = zip(*own.seen_by(finger), strict=True)
        each = [_pushes(own, shapes, *part) for part in zip(cells, seen, strict=True)]
        n_first = 1 if own.bodies else len(each)
        mine, between = _together(each[:n_first]), _together(each[n_first:])
        assert mine is not None, "there is something to touch"
        rows = slice(finger, own.n_own, own.n_fingers)
        at = own.of_finger(shapes.coordinates, finger)
        found.append(
            Grasped(
                code=codes[finger],
                after=codes_of(state.reached),
                status=status,
                push=mine.push,
                touches=mine.touches,
                phalanges=np.concatenate([part.phalanges for part in seen[:n_first]]),
                force=mine.force,
                gap=np.min([gaps[part].min(axis=0) for part in cells], axis=0),
                margin=margin,
                residual=there.residual,
                error=tip(state, with_compliance=False, whole=there, rows=rows).error,
                nodes=state.potential.coordinates.stations(at),
                face=Face.of(state.potential.coordinates, own.thickness).shape(at).nodes,
                resets=_of_finger(grown.resets, own, finger),
                between=between,
            )
        )
    return tuple(found)


def judged(
    own: Obstructed, grown: Approach, status: NDArray[np.uint8]
) -> tuple[Equilibrium, list[Settled], NDArray[np.uint8]]:
    """Equilibria of all fingers, and of each, certified with their contacts, and the statuses.

    Those that are not stable before keep their `status`, (batch,).
    """
    shapes, is_there = grown.shapes, status == Status.STABLE
    potential = own.pressed(shapes.inverted, shapes.push, grown.load)
    there = looked_at(potential, shapes.coordinates)
    settled = [_certified(own, grown, there, finger) for finger in range(own.n_fingers)]
    worst = np.max([state.status for state in settled], axis=0)
    status = np.where(is_there, worst, status)
    for face, body in zip(own.faces, own.bodies, strict=False):
        is_cut = is_there & _is_entered(face.shape(shapes.coordinates).nodes, body)
        status = np.where(is_cut, np.uint8(Status.NOT_CONVERGED), status)
    return there, settled, status


def _pushes(own: Obstructed, shapes: ContactShapes, cells: slice, seen: Touching) -> Pushes:
    return Pushes(own.without_rounding(shapes.push[cells]), seen.touches(shapes.coordinates))


def _together(parts: Sequence[Pushes]) -> Pushes | None:
    """Cells of several, one after the other; None of none."""
    if not parts:
        return None
    push, touches = zip(*parts, strict=True)
    return Pushes(np.concatenate(push), Touches.together(touches))


def _is_entered(nodes: Array, body: Obstacle) -> Flags:
    """Whether a face, nodes (2, node, batch), runs into a polygon: one whose gaps do not tell.

    Lanes that are lost have no nodes, and run into nothing.
    """
    enters = np.zeros(nodes.shape[2], bool)
    lanes = np.flatnonzero(np.isfinite(nodes).all(axis=(0, 1)))
    if len(body.plates) and len(lanes):
        import shapely  # that discs do not need

        area = shapely.polygons(body.take_lanes(lanes).points.transpose(2, 1, 0))
        inner = shapely.buffer(area, -SLIGHT, join_style="mitre")
        faces = shapely.linestrings(nodes[..., lanes].transpose(2, 1, 0))
        enters[lanes] = shapely.intersects(faces, inner)
    return enters


def told(part: Placed) -> Grasped:
    """The same of fingers that have met a body which stays where it is."""
    grown, parts = part.grown, list[Grasped]()
    for some in blocks(len(part.codes), part.own.units.finger.n_units):
        lanes = np.arange(some.start, some.stop)
        own, shapes = part.own.take_lanes(lanes), grown.shapes.take_lanes(lanes)
        margin = None if grown.margin is None else grown.margin[some]
        came = Approach(shapes, grown.load[some], (), margin)
        parts += described(own, [part.codes[some]], came, part.status[some])
    return replace(Grasped.joined(parts), resets=grown.resets)


def _of_finger(resets: tuple[Reset, ...], own: Obstructed, finger: int) -> tuple[Reset, ...]:
    n = own.units.finger.n_units
    return tuple(reset.take_units(slice(finger * n, (finger + 1) * n)) for reset in resets)


def _certified(own: Obstructed, grown: Approach, there: Equilibrium, finger: int) -> Settled:
    """The states that a finger of each lane has come to rest in, certified with their contacts."""
    n = own.units.finger.n_units
    inverted = grown.shapes.inverted[finger * n : (finger + 1) * n]
    alone = own.potentials(grown.shapes.inverted)[finger]
    mine = (own.of_finger(values, finger) for values in (there.coordinates, there.gradient))
    coordinates, gradient = mine
    view = replace(there, coordinates=coordinates, gradient=gradient)
    settled = certified(own.units, alone, inverted, view, DEFAULT_TOLERANCE)
    settled = replace(settled, inverted=settled.reached)
    return replace(settled, status=certify(settled, own.units, DEFAULT_TOLERANCE))


def _margins(own: Obstructed, grown: Approach, is_stable: Flags) -> Array:
    """What more of the load fingers bear before a unit resets; infinite beyond `MARGIN_TO`.

    NaN where there is no state, or none is found on the way on, or one that is folded.
    """
    shapes = replace(grown.shapes, is_there=grown.shapes.is_there & is_stable)
    end = 0.0 * grown.load + MARGIN_TO
    onwards = approach(own, shapes, grown.load, end, to_reset=True, unfolded=True)
    margin = np.where(onwards.shapes.is_there, np.inf, np.nan)
    for reset in onwards.resets:
        margin[reset.lanes] = reset.load - 1.0
    return margin
