"""Grasps as a table: a row for each state of a finger, or for each pair of states of a gripper."""

from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Codes, Columns, Indices, distinct
from dpgcli.design.bodies import Body, Jaws, gives_way
from dpgcli.design.outputs import Output
from dpgcli.design.scene import Scene
from dpgcli.grasping.approach import Way
from dpgcli.grasping.closing import Closing, event_text
from dpgcli.grasping.costs import is_moving
from dpgcli.grasping.frames import FingerFrame, frames
from dpgcli.grasping.grasp import blocks, placed, told
from dpgcli.grasping.grasped import Grasped, Placed
from dpgcli.grasping.joining import Joined, joined
from dpgcli.grasping.release import let_go, motion_of, moved_by, opened_by, turned_by, turns
from dpgcli.grasping.shapes import ContactShapes
from dpgcli.mechanics.coordinates import Stations
from dpgcli.mechanics.plates import SLIGHT
from dpgcli.mechanics.terms import Formulate
from dpgcli.records import dataclass
from dpgcli.states.certify import Status
from dpgcli.states.columns import Column, Kind
from dpgcli.states.gripper import place_in_gripper
from dpgcli.states.patterns import inverted_units, texts

FORCES, SHAPES = (Output.FORCES,), (Output.SHAPES,)

ROUNDING = 1e-12  # of the scale of values
COLUMNS = (
    Column("pattern", "", "state before the body was there; upper/lower of a pair", kind=Kind.TEXT),
    Column("status", "", "result of certification, with the body there", kind=Kind.STATUS),
    Column("pattern_after", "", "state with the body there", kind=Kind.TEXT),
    Column("resets", "", "units that left their wells, at which share of the load", kind=Kind.TEXT),
    Column("events", "", "units that snapped and reset, at which pressure", kind=Kind.TEXT),
    Column("tie", "", "units whose threshold is the same within 1e-6", kind=Kind.TEXT),
    Column("n_contacts", "", "places that touch the body, or each other", kind=Kind.COUNT),
    Column("touching", "", "phalanges that touch there, from the base", kind=Kind.TEXT),
    Column(
        "finger_force_x_N",
        "N",
        "force of the upper finger on the body, or on the lower finger",
        outputs=FORCES,
    ),
    Column("finger_force_y_N", "N", "the same along y", outputs=FORCES),
    Column(
        "squeeze_N",
        "N",
        "closing force of the two fingers on the body, or of one on the other",
        outputs=FORCES,
    ),
    Column(
        "between_fingers_N",
        "N",
        "force of the two fingers on each other, beside the body",
        outputs=FORCES,
    ),
    Column("max_contact_N", "N", "largest force at one place", outputs=FORCES),
    Column(
        "payload_N", "N", "largest pull on the body along gravity that is borne", outputs=FORCES
    ),
    Column(
        "fails_first",
        "",
        "what ends it: slip or reset; none: the weight is borne",
        kind=Kind.TEXT,
        outputs=FORCES,
    ),
    Column("aperture_mm", "mm", "distance of the two faces at the tips", outputs=SHAPES),
    Column("overlaps", "", "whether the fingers overlap each other", kind=Kind.FLAG),
    Column("object_x_mm", "mm", "x of the body's reference point"),
    Column("object_y_mm", "mm", "y of the body's reference point"),
    Column("object_angle_deg", "deg", "angle that the body has turned by, counterclockwise"),
    Column("jaw_gap_mm", "mm", "aperture of the jaws"),
    Column("penetration_mm", "mm", "largest depth of the body, or a finger, in a face"),
    Column("margin", "", "how much more of the load before a next unit resets", outputs=FORCES),
    Column("residual_N", "N", "largest force out of balance"),
    Column("numerical_error_mm", "mm", "error of the tip by solving the equations"),
)
JAW_GAP = "jaw_gap_mm"
OF_BODIES = ("object_x_mm", "object_y_mm")
ANGLE = "object_angle_deg"
OF_CLOSING = ("events", "tie")
OF_FRICTION = ("payload_N", "fails_first")
BETWEEN = "between_fingers_N"
OF_PAIRS = ("squeeze_N", BETWEEN, "aperture_mm", "overlaps")


@dataclass(frozen=True)
class Grasps:
    """Fingers against a body, by frame (upper and lower, or one), and the pairs of their states.

    `pairs` (finger, row) are lanes of the fingers' tables, `centers` (2, row) are where the body
    is, and by so much it has `turned`, or jaws `opened`, (row,), rad or mm. `closing` is how they
    closed, if they did; `borne` are columns of what friction bears, if there is any. Without a body
    fingers touch each other.
    """

    scene: Scene
    body: Body | None
    frames: tuple[FingerFrame, ...]
    fingers: tuple[Grasped, ...]
    pairs: NDArray[np.int64]
    centers: Array
    opened: Array | float = 0.0
    turned: Array | float = 0.0
    closing: Closing | None = None
    borne: Columns = field(default_factory=dict)

    def take_rows(self, index: Indices) -> "Grasps":
        """Some of the rows, of the same fingers."""
        n_rows = self.pairs.shape[1]
        opened, turned = (np.broadcast_to(v, n_rows)[index] for v in (self.opened, self.turned))
        pairs, centers = self.pairs[:, index], self.centers[:, index]
        return replace(self, pairs=pairs, centers=centers, opened=opened, turned=turned)

    def take(self, finger: int, row: int) -> tuple[Grasped, int]:
        """The finger of a row, and its lane."""
        return self.fingers[finger], int(self.pairs[finger, row])


def grasps(
    scene: Scene,
    formulate: Formulate,
    body: Body | None,
    pairs: Sequence[Codes],
    way: Way = Way.PLACE,
    closing: Closing | None = None,
) -> Grasps:
    """Pairs of states, (row,) each for the upper and the lower finger, against a body.

    Without one they come together until they touch each other. Fingers that close do so while the
    body is kept in its place; jaws that give way do. Of a finger alone one. Where the body is on
    the axis a state is solved once for both fingers.
    """
    seen_from = frames(scene.gripper)
    if body is None:
        from dpgcli.grasping.meeting import meeting

        nowhere = np.full((2, len(pairs[0])), np.nan)
        return Grasps(scene, None, seen_from, *meeting(scene, formulate, pairs), nowhere)
    is_alike = bool(body.is_mirrored) and len(seen_from) > 1
    shared = distinct(np.concatenate(list(pairs)))
    needed = [shared if is_alike else distinct(codes) for codes in pairs]
    before, later = (None, closing) if gives_way(body) else (closing, None)
    motion = motion_of(body, scene.held, seen_from)
    parts: list[Placed] = []
    for frame, codes in zip(seen_from, needed, strict=True):
        if parts and is_alike:
            parts.append(parts[0])
        else:
            given = (scene, formulate, body, frame, codes, way, before)
            parts.append(placed(*given, with_margins=motion is None))
    lanes = [np.searchsorted(all_, own) for all_, own in zip(needed, pairs, strict=True)]
    centers = np.repeat(body.center[:, None], len(pairs[0]), axis=1)
    if motion is None:
        different = parts[:1] if is_alike else parts
        fingers = [told(part) for part in different] * (len(parts) // len(different))
        rows = np.array(lanes)
        known = Grasps(scene, body, seen_from, tuple(fingers), rows, centers, closing=closing)
        met: list[Joined] = []
        if len(parts) > 1:
            on_axis = np.asarray(body.is_mirrored)
            met = list(joined(parts, lanes, seen_from[0].axis, on_axis, closing))
        return _with_payload(_with_met(known, met), parts, lanes, None, met)
    found, moved, rest = let_go(parts, lanes, motion, scene.held, later)
    rows = np.tile(np.arange(len(pairs[0])), (len(parts), 1))
    is_there = found[0].status == Status.STABLE
    away = _rounded(moved_by(body, scene.held, moved), scene.finger.straight_length)
    centers = np.where(is_there, centers + away, np.nan)
    opened = np.where(is_there, opened_by(body, moved), np.nan)
    turned = np.where(is_there, _rounded(turned_by(body, scene.held, moved), 1.0), np.nan)
    known = Grasps(scene, body, seen_from, found, rows, centers, opened, turned, closing)
    return _with_payload(known, parts, lanes, rest)


def _with_met(found: Grasps, met: Sequence[Joined]) -> Grasps:
    """With fingers that overlapped, and have come together."""
    if not met:
        return found
    fingers, pairs = [[finger] for finger in found.fingers], found.pairs.copy()
    n_before = np.array([len(finger.code) for finger in found.fingers])
    for some in met:
        pairs[:, some.rows] = n_before[:, None] + np.arange(len(some.rows))
        n_before = n_before + len(some.rows)
        for own, told_ in zip(fingers, some.fingers, strict=True):
            own.append(told_)
    return replace(found, fingers=tuple(Grasped.joined(own) for own in fingers), pairs=pairs)


def _with_payload(
    found: Grasps,
    parts: Sequence[Placed],
    lanes: Sequence[NDArray[np.int64]],
    rest: ContactShapes | None,
    met: Sequence[Joined] = (),
) -> Grasps:
    """With what friction bears, if there is any."""
    scene = found.scene
    if scene.friction is None or found.body is None:
        return found
    from dpgcli.grasping.pull import Pulled, bearing_together, borne

    of_fingers = zip(found.fingers, found.pairs, strict=True)
    status = np.max([finger.status[own] for finger, own in of_fingers], axis=0)
    pulled = Pulled(found.body, scene.held, found.frames, scene.friction, scene.gravity)
    is_there = np.asarray(status == Status.STABLE)
    columns = borne(pulled, parts, lanes, rest, is_there, found.closing)
    return replace(found, borne=bearing_together(pulled, columns, met))


def columns_of(scene: Scene, closing: Closing | None) -> tuple[Column, ...]:
    """The columns of a gripper, or those of a finger alone."""
    left_out = set() if scene.gripper is not None else set(OF_PAIRS)
    if not isinstance(scene.body, Jaws):
        left_out.add(JAW_GAP)
    if scene.body is None:
        left_out.update((*OF_BODIES, BETWEEN))
    if not turns(scene.body, scene.held):
        left_out.add(ANGLE)
    if closing is None:
        left_out.update(OF_CLOSING)
    if is_moving(scene):
        left_out.add(BETWEEN)
    if scene.friction is None:
        left_out |= {*OF_FRICTION}
    return tuple(column for column in COLUMNS if column.name not in left_out)


def grasp_rows(found: Grasps) -> Columns:
    """Rows by column, (row,). What is not known of states that are not stable is NaN."""
    happened = [_happened(finger, found.closing) for finger in found.fingers]
    rows_of = blocks(found.pairs.shape[1], found.scene.finger.n_units)
    few = (found.take_rows(np.arange(some.start, some.stop)) for some in rows_of)
    parts = [_rows(own, happened) for own in few]
    rows = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    rows |= found.borne
    return {column.name: rows[column.name] for column in columns_of(found.scene, found.closing)}


def _rows(found: Grasps, happened: Sequence[Columns]) -> Columns:
    """The same of few rows; what `happened` are texts by finger, column and lane."""
    n_units = found.scene.finger.n_units
    of_fingers = [
        {name: getattr(finger, name)[..., lanes] for name in Grasped.BY_LANE}
        for finger, lanes in zip(found.fingers, found.pairs, strict=True)
    ]
    status = np.max([own["status"] for own in of_fingers], axis=0)
    is_there = status == Status.STABLE
    forces = [
        frame.outside(own["force"]) for frame, own in zip(found.frames, of_fingers, strict=True)
    ]
    touches = [own["push"] > 0.0 for own in of_fingers]
    counted = touches[:1] if found.body is None else touches  # a place of two fingers is one

    def known(values: Array) -> Array:
        return np.where(is_there, values + 0.0, np.nan)  # no negative zero

    most = np.max([own["push"].max(axis=0) for own in of_fingers], axis=0)
    rows: Columns = {
        "pattern": _joined([_texts(own["code"], n_units) for own in of_fingers]),
        "status": status,
        "pattern_after": _joined([_texts(own["after"], n_units) for own in of_fingers], is_there),
        "n_contacts": np.where(is_there, sum(t.sum(axis=0) for t in counted), 0),
        "touching": _joined(
            [_touching(t, f) for t, f in zip(touches, found.fingers, strict=True)], is_there
        ),
        "finger_force_x_N": known(_rounded(forces[0][0], most)),
        "finger_force_y_N": known(_rounded(forces[0][1], most)),
        "squeeze_N": known(0.5 * (forces[-1][1] - forces[0][1])),
        BETWEEN: known(found.fingers[0].size_between[found.pairs[0]]),
        "max_contact_N": known(most),
        "object_x_mm": found.centers[0],
        "object_y_mm": found.centers[1],
        ANGLE: np.degrees(found.turned) + np.zeros(len(status)),
        "penetration_mm": known(np.max([np.maximum(0.0, -o["gap"]) for o in of_fingers], axis=0)),
        "margin": known(np.min([own["margin"] for own in of_fingers], axis=0)),
        "residual_N": known(np.max([own["residual"] for own in of_fingers], axis=0)),
        "numerical_error_mm": known(np.max([own["error"] for own in of_fingers], axis=0)),
    }
    for name in happened[0]:
        told = zip(happened, found.pairs, strict=True)
        mask = None if name in OF_CLOSING else is_there  # whatever became of it afterwards
        rows[name] = _joined([own[name][lanes] for own, lanes in told], mask)
    if isinstance(found.body, Jaws):
        rows[JAW_GAP] = found.body.gap + found.opened + np.zeros(len(status))
    if found.scene.gripper is not None:
        rows.update(_between(found, is_there))
    return rows


def _rounded(values: Array, scale: Array | float) -> Array:
    """Values without those that are nothing but rounding."""
    return np.where(np.abs(values) > ROUNDING * scale, values, 0.0)


def _between(found: Grasps, is_there: NDArray[np.bool_]) -> Columns:
    """Aperture and overlap of the two fingers of each row."""
    assert found.scene.gripper is not None, "of a gripper"
    thickness = found.scene.layer_thickness
    assert thickness is not None, "the face is known"
    halves = []
    for finger, lanes in zip(found.fingers, found.pairs, strict=True):
        nodes = Stations(*(values[..., lanes] for values in finger.nodes))
        halves.append(place_in_gripper(found.scene.gripper, thickness, nodes).aperture)
    overlaps = np.zeros(len(is_there), bool)
    overlaps[is_there] = _overlaps(*(_outlines(found, finger, is_there) for finger in range(2)))
    aperture = _rounded(0.5 * np.sum(halves, axis=0), found.scene.finger.straight_length)
    return {"aperture_mm": np.where(is_there, aperture, np.nan), "overlaps": overlaps}


def _overlaps(upper: Array, lower: Array) -> NDArray[np.bool_]:
    """Whether outlines, (2, point, row), overlap: those that touch do not."""
    overlaps = np.zeros(upper.shape[2], bool)
    lowest, highest = (
        np.array([f(own, axis=1) for own in (upper, lower)]) for f in (np.min, np.max)
    )
    near = np.flatnonzero((lowest <= highest[::-1]).all(axis=(0, 1)))
    if len(near):
        import shapely  # that fingers far from each other do not need

        first, second = (
            shapely.polygons(own[:, :, near].transpose(2, 1, 0)) for own in (upper, lower)
        )
        within = shapely.buffer(first, -SLIGHT, join_style="mitre")
        overlaps[near] = shapely.intersects(within, second)
    return overlaps


def _outlines(found: Grasps, finger: int, rows: NDArray[np.bool_]) -> Array:
    """Outlines of a finger of some rows in the gripper, (2, point, row): face, and tops back."""
    own, height = found.fingers[finger], found.scene.finger.segment_height
    base = np.stack((0.0 * own.face[0, :1], own.face[1, :1] * 0.0 + height))
    tops = np.stack((own.nodes.top_x, own.nodes.top_y))
    around = np.concatenate((own.face, tops[:, ::-1], base), axis=1)
    around = around[:, :, found.pairs[finger, rows]]
    return found.frames[finger].placed(around)


def _texts(codes: Codes, n_units: int) -> NDArray[np.str_]:
    return texts(inverted_units(codes, n_units)).astype(str)


def _joined(
    parts: Sequence[NDArray[np.str_]], is_there: NDArray[np.bool_] | None = None
) -> NDArray[np.str_]:
    """Texts of both fingers as one, upper/lower where they differ; empty where nothing is."""
    rows = zip(*(part.tolist() for part in parts), strict=True)
    told = [row[0] if len(set(row)) == 1 else "/".join(word or "–" for word in row) for row in rows]
    joined = np.array(told, str)
    return joined if is_there is None else np.where(is_there, joined, "")


def _happened(finger: Grasped, closing: Closing | None) -> Columns:
    """What happened to each lane on the way, by column.

    Such as "1 at 0.672; 2 at 0.91 of letting go" and, as pressures changed, "snap 1 at 0.1 MPa".
    """
    n = len(finger.code)
    words: dict[str, list[list[str]]] = {
        name: [[] for _ in range(n)] for name in ("resets", *OF_CLOSING)
    }
    for reset in finger.resets:
        for place, lane in enumerate(reset.lanes):
            if not reset.flipped[:, place].any():  # it is the other finger's
                continue
            if closing is None or reset.pressure is None:
                units = _numbers(np.flatnonzero(reset.flipped[:, place]))
                words["resets"][lane].append(f"{units} at {reset.load[place]:.4g}{reset.of}")
                continue
            words["events"][lane].append(event_text(reset, place, closing.pressure))
            if tied := _numbers(np.flatnonzero(reset.tied[:, place])):
                words["tie"][lane].append(tied)
    return {name: np.array(["; ".join(lane) for lane in of]) for name, of in words.items()}


def _touching(touches: NDArray[np.bool_], finger: Grasped) -> NDArray[np.str_]:
    """The phalanges that touch the body in each row, from the base: "3,4"."""
    return np.array([_numbers(distinct(finger.phalanges[row])) for row in touches.T])


def _numbers(places: Indices) -> str:
    """Units or phalanges as people count them, from the base."""
    return ",".join(str(place + 1) for place in places)
