"""Polygons that turn between two fingers: closed forms, an energy of its own, SciPy, invariance."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import shapely
from scipy.optimize import brentq, minimize

from dpgcli.arrays import Array, rotated
from dpgcli.design.bodies import Body, Disc, Friction, Jaws, Polygon, at_place
from dpgcli.design.scene import Gripper, Held, Scene
from dpgcli.grasping import grasp, release, table
from dpgcli.grasping.approach import approach
from dpgcli.grasping.clearance import clearance
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.frames import frames
from dpgcli.grasping.grasp import described, placed
from dpgcli.grasping.release import motion_of, moved_by, released, together, turned_by
from dpgcli.grasping.shapes import ContactShapes
from dpgcli.grasping.stages import Task, beside, kept, lifted, way
from dpgcli.grasping.table import Grasps, grasp_rows, grasps
from dpgcli.mechanics.chain import Chain
from dpgcli.mechanics.face import Face, Pivot
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.gaps import FAR, FaceGaps
from dpgcli.mechanics.obstacle import Obstacle
from dpgcli.mechanics.sticking import Sticking
from dpgcli.mechanics.terms import chain_potential
from dpgcli.reports import grasp as drawing
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions
from dpgcli.sweeps.grasps import Encounter
from dpgcli.sweeps.grasps import grasp_rows as grasp_rows_of_designs

Fingers = Callable[..., Finger]
LAYER, ROUNDING = 1.5, 1e-9  # mm


@pytest.fixture(autouse=True)
def without_margins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Margins are looked for as far as the load itself: nowhere."""
    monkeypatch.setattr(grasp, "MARGIN_TO", 1.0)


def codes(*texts: str) -> Any:
    return codes_of(np.array([[digit == "1" for digit in text] for text in texts]).T)


def gripper_of(
    finger: Finger, spacing: float = 50.0, angle: float = 0.0, layer: float = LAYER
) -> Scene:
    return Scene(finger, (), Gripper(base_spacing=spacing, mounting_angle=angle), layer)


def grasped(scene: Scene, body: Body, pair: str, held: Held = Held.FREE) -> Grasps:
    both = tuple(codes(text) for text in pair.split("/"))
    return grasps(replace(scene, body=body, held=held), chain_potential, body, both)


def ends_of(scene: Scene, pair: str) -> tuple[Array, Array]:
    """Where the free faces end in the gripper, of the upper and the lower finger, (2,)."""
    units, found = UnitSolutions.of(scene.finger), []
    for frame, text in zip(frames(scene.gripper), pair.split("/"), strict=True):
        pattern = np.array([[digit == "1"] for digit in text])
        free = settle(units, chain_potential, pattern, 1e-12)
        face = Face.of(free.potential.coordinates, np.reshape(scene.layer_thickness, (1, 1)))
        nodes = face.shape(free.equilibrium.coordinates).nodes
        found.append(frame.placed(nodes[:, -1, 0]))
    upper, lower = found
    return upper, lower


def spool(scene: Scene, pair: str, deep: float = 1.0) -> Polygon:
    """Two notches that the ends of the fingers are in, each of them deeper than it wants to be."""
    corners: list[Array] = []
    for (x, y), side in zip(ends_of(scene, pair), (1.0, -1.0), strict=True):
        bottom = y + side * deep
        around = [(5.0, 3.0), (0.0, 0.0), (-5.0, 3.0)][:: int(side)]
        corners += [np.array([x + away, bottom + side * up]) for away, up in around]
    whole = np.array(corners).T
    at = whole.mean(axis=1)
    return Polygon(at, whole - at[:, None])


def moments(found: Grasps) -> tuple[Array, Array]:
    """Force (2,), N, and moment about the origin, N mm, of all pushes on the body of one row.

    Where they push is told of the body before it moved, but turned about its center of area.
    """
    body = found.body
    assert body is not None
    there = at_place(body, found.centers[:, 0], float(np.reshape(found.turned, -1)[0]))
    force, moment = np.zeros(2), 0.0
    for frame, finger in zip(found.frames, found.fingers, strict=True):
        places = frame.placed(finger.touches.places)[..., 0] + (there.middle - body.middle)[:, None]
        pushes = (frame.outside(finger.touches.directions) * finger.push)[..., 0]
        force += pushes.sum(axis=1)
        moment += float((places[0] * pushes[1] - places[1] * pushes[0]).sum())
    return force, np.array(moment)


SQUARE = np.array([[-6.0, 6.0, 6.0, -6.0], [-6.0, -6.0, 6.0, 6.0]])


@pytest.mark.parametrize(
    ("body", "held", "n"),
    [
        (Polygon(np.array([40.0, 0.0]), SQUARE), Held.FREE, 3),
        (Polygon(np.array([40.0, 0.0]), SQUARE), Held.GUIDED, 1),
        (Disc(np.array([40.0, 0.0]), 6.0), Held.FREE, 2),
        (Jaws(np.array([40.0, 0.0]), 12.0, 12.0), Held.FREE, 2),
        (Jaws(np.array([40.0, 0.0]), 12.0, 12.0, 0.1), Held.FREE, 3),
    ],
)
def test_unknowns_of_bodies(body: Body, held: Held, n: int) -> None:
    motion = motion_of(body, held, frames(Gripper(50.0, 0.0)))
    assert motion is not None and motion.n == n
    assert bool(motion.pivots) == (isinstance(body, Polygon) and held is Held.FREE)
    assert motion_of(body, Held.FIXED, frames(None)) is None or isinstance(body, Jaws)


def turning_gaps(
    finger: Finger, around: Array, n_motions: int = 2, sign: float = 1.0
) -> tuple[FaceGaps, int]:
    """The gaps of a finger to a polygon that turns, and how many coordinates the finger has."""
    chain = Chain(finger)
    pivot = Pivot(np.array([[20.0], [-9.0]]), np.array([sign * 11.0]))
    ways = np.array([[0.8, -0.6], [0.6, 0.8]])[:, :n_motions, None]
    own = np.arange(chain.size, chain.size + n_motions + 1)
    face = Face.of(chain, np.array([[LAYER]])).seen_from(ways, own, pivot)
    return FaceGaps(face, Obstacle.polygon(around)), chain.size


def drawn_gaps(
    seed: int, bars: float, graded_finger: Fingers, bent: float = 0.05
) -> tuple[FaceGaps, Array]:
    """Such a polygon below a bent finger, turned and moved."""
    random = np.random.default_rng(seed)
    turn = np.sort(random.uniform(0.0, 2.0 * np.pi, 5))
    around = np.array([[20.0], [-9.0]]) + random.uniform(5.0, 9.0, 5) * np.array(
        [np.cos(turn), np.sin(turn)]
    )
    finger = graded_finger(3, seed, linear_stiffness=bars)
    gaps, n = turning_gaps(finger, around, sign=random.choice([1.0, -1.0]))
    at = random.normal(0.0, bent, (n + 3, 40))
    at[n] = random.uniform(-30.0, 30.0, 40)  # mm at 11 mm: up to 156°
    return gaps, at


@pytest.mark.parametrize("bars", [np.inf, 1e3])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_derivatives_of_gaps(seed: int, bars: float, graded_finger: Fingers) -> None:
    """All of them, by all coordinates: fourth-order differences."""
    gaps, at = drawn_gaps(seed, bars, graded_finger)
    rows = [row.offset for row in gaps.rows]
    assert rows[:3] == [*range(len(at) - 3, len(at))], "the body's"
    found, step = gaps(at), 1e-3
    force = np.random.default_rng(seed).normal(0.0, 1.0, found.value.shape)
    is_there = found.value < FAR
    weights = np.where(is_there, force, 0.0)

    def values(x: Array) -> tuple[Array, Array, Array]:
        here = gaps(x)
        slopes = (here.gradient * weights).sum(axis=1)
        return here.value, slopes, here.place

    exact, bent = found.gradient, found.bent(weights)
    n_compared = 0
    for number, row in enumerate(rows):
        parts = []
        for away in (step, -step, 2.0 * step, -2.0 * step):
            moved = at.copy()
            moved[row] += away
            parts.append(values(moved))
        same = np.all([part[2] == found.place for part in parts], axis=0)
        same &= np.all([(part[0] < FAR) == is_there for part in parts], axis=0)
        value, slope = (
            (8.0 * (parts[0][k] - parts[1][k]) - (parts[2][k] - parts[3][k])) / (12.0 * step)
            for k in range(2)
        )
        compared = same & is_there
        n_compared += int(compared.sum())
        off = np.abs(exact[number] - value)[compared]
        assert off.max() < 1e-7 * max(1.0, np.abs(value[compared]).max())
        lanes = same.all(axis=0)
        if lanes.any():
            wrong = np.abs(bent[number] - slope)[:, lanes]
            assert wrong.max() < 1e-6 * max(1.0, np.abs(slope[:, lanes]).max())
    assert n_compared > 1000
    assert np.abs(bent - np.swapaxes(bent, 0, 1)).max() < 1e-12 * np.abs(bent).max()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_body_that_turns_is_one_that_is_placed_so(seed: int, graded_finger: Fingers) -> None:
    """Gaps, where it is touched, and which way it is pushed: of a finger bent into it as well."""
    gaps, at = drawn_gaps(seed, np.inf, graded_finger, bent=0.25)
    n, pivot = len(at) - 3, gaps.face.pivot
    assert pivot is not None
    at[n + 1 :] = 0.0
    angle = at[n] / pivot.radius
    corners = gaps.obstacle.points
    there = pivot.point[:, None] + rotated(corners - pivot.point[:, None], angle)
    alone = replace(gaps.face, places=gaps.face.places[3:], pivot=None)
    still = FaceGaps(
        replace(alone, directions=np.zeros((2, 0, 1))), replace(gaps.obstacle, points=there)
    )
    one, other = gaps(at), still(at)
    assert one.place.tolist() == other.place.tolist()
    assert one.value == pytest.approx(other.value, abs=1e-12)
    for mine, told in zip(gaps.touches(at), still.touches(at), strict=True):
        assert mine == pytest.approx(told, abs=1e-12)
    assert one.gradient[3:] == pytest.approx(other.gradient, abs=1e-11)


def test_places_stick_along_sides_that_have_turned(graded_finger: Fingers) -> None:
    """Across the push, as the body sees it: a finger that goes on along it moves the place so."""
    gaps, at = drawn_gaps(1, np.inf, graded_finger)
    n, pivot, lanes = len(at) - 3, gaps.face.pivot, np.arange(40)
    assert pivot is not None
    push = np.random.default_rng(1).uniform(0.0, 1.0, gaps(at).value.shape)
    place = Sticking.of(gaps, at, push, np.array([[0.5]]))
    way = gaps.touches(at).directions[:, push.argmax(axis=0), lanes]
    along = rotated(place.along[:, 0], at[n] / pivot.radius)
    assert (along * way).sum(axis=0) == pytest.approx(np.zeros(40), abs=1e-12)
    moved = at.copy()
    moved[n + 1] += 0.5  # of the body, along its first way
    ways = gaps.face.directions[:, 0]
    assert place(moved).value[0] == pytest.approx(-0.5 * (along * ways).sum(axis=0), abs=1e-12)


def test_a_square_below_a_straight_finger(reference_finger: Fingers) -> None:
    """Its highest corner is d sin(φ + 45°) above its middle, d being half its diagonal."""
    chain = Chain(reference_finger(2))
    half, middle = 3.0, np.array([[20.0], [-9.0]])
    square = half * np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]])
    pivot = Pivot(middle, np.array([5.0]))
    own = np.arange(4, 5)
    face = Face.of(chain, np.array([[LAYER]])).seen_from(np.zeros((2, 0, 1)), own, pivot)
    gaps = FaceGaps(face, Obstacle.polygon(middle + square))
    angle = np.linspace(0.05, 1.5, 7)
    at = np.concatenate((np.zeros((4, 7)), 5.0 * angle[None]))
    found = gaps(at)
    cell, lanes = found.value.argmin(axis=0), np.arange(7)
    diagonal, turned = np.sqrt(2.0) * half, angle + 0.25 * np.pi
    gap = 9.0 - 0.5 * LAYER - diagonal * np.sin(turned)
    assert found.value[cell, lanes] == pytest.approx(gap, abs=1e-12)
    row = [row.offset for row in gaps.rows].index(4)
    slope = found.gradient[row, cell, lanes]
    assert slope == pytest.approx(-diagonal * np.cos(turned) / 5.0, abs=1e-12)
    once = np.zeros(found.value.shape)
    once[cell, lanes] = 1.0
    bend = found.bent(once)[row, row]
    assert bend == pytest.approx(diagonal * np.sin(turned) / 25.0, abs=1e-12)


def test_a_body_given_askew_comes_to_stand_across(reference_finger: Fingers) -> None:
    """Between mirrored fingers, and off the axis: by symmetry as the one that is given straight."""
    scene = gripper_of(reference_finger(2), 40.0)
    straight, askew = spool(scene, "10/10", deep=0.6), 0.03
    body = replace(straight, center=straight.center + np.array([0.2, 0.3])).turned(askew)
    rows, expected = (grasp_rows(grasped(scene, own, "10/10")) for own in (body, straight))
    assert rows["status"].tolist() == [Status.STABLE] and rows["n_contacts"].tolist() == [4]
    assert rows["object_angle_deg"] == pytest.approx([-np.degrees(askew)], abs=1e-10)
    assert rows["object_y_mm"] == pytest.approx([0.0], abs=1e-10)
    for name in ("squeeze_N", "object_x_mm", "finger_force_x_N"):
        assert rows[name] == pytest.approx(expected[name], rel=1e-10, abs=1e-10)


PATTERNS = {2: ("10",), 3: ("010", "100", "001", "110")}
QUICK = (12,)
MANY = (*QUICK, 0, 1, 3, 4, 6, 9, 13, 14, 15, 17, 18, 19, 22, 23, 24, 26, 27, 28)
SEEDS = [pytest.param(s, marks=[] if s in QUICK else pytest.mark.slow) for s in MANY]


class Drawn:
    """A random gripper and pair of states, and a spool that their ends hold, askew and off."""

    def __init__(self, seed: int, reference_finger: Fingers) -> None:
        random = np.random.default_rng(seed)
        n = int(random.integers(2, 4))
        self.finger = reference_finger(n, float(random.choice([1e3, 1e4, np.inf])))
        spacing, angle = random.uniform(35.0, 60.0), random.uniform(0.0, 0.1)
        self.scene = gripper_of(self.finger, spacing, angle)
        self.pair = "/".join(str(random.choice(PATTERNS[n])) for _ in range(2))
        corners: list[Array] = []
        deep = [side * random.uniform(0.4, 1.2) for side in (1.0, -1.0)]
        for end, by, side in zip(ends_of(self.scene, self.pair), deep, (1.0, -1.0), strict=True):
            bottom = end + np.array([0.0, by])
            before, after = random.uniform([3.0, 2.0], [6.0, 5.0], (2, 2))
            corners += [bottom + side * before, bottom, bottom + side * after * np.array([-1, 1])]
        whole = np.array(corners).T
        at = whole.mean(axis=1)
        straight = Polygon(at + random.uniform(-0.3, 0.3, 2), whole - at[:, None])
        self.body = straight.turned(random.uniform(-0.04, 0.04))


class Found:
    """What the package found for it: coordinates of fingers, and a pose about the reference point.

    Energy, nodes and gaps are those of these tests, by coordinates of both fingers and x, y and φ.
    """

    def __init__(self, drawn: Drawn, own: Callable[..., Any]) -> None:
        scene, body = drawn.scene, drawn.body
        seen = frames(scene.gripper)
        texts, lane = drawn.pair.split("/"), np.zeros(1, int)
        parts = [
            placed(scene, chain_potential, body, frame, codes(text))
            for frame, text in zip(seen, texts, strict=True)
        ]
        motion = motion_of(body, Held.FREE, seen)
        joint, start = together(parts, [lane, lane], motion)
        self.shapes = shapes = released(joint, start).shapes
        assert shapes.is_there.all()
        motions = shapes.coordinates[joint.n_own :]
        self.n, self.scene, self.around = joint.n_own // 2, scene, body.around
        center = body.center + moved_by(body, Held.FREE, motions)[:, 0]
        pose = np.append(center, turned_by(body, Held.FREE, motions))
        self.q = np.concatenate((shapes.coordinates[: joint.n_own, 0], pose))
        unit = joint.potentials(shapes.inverted)[0].coordinates.force_unit
        lengths = np.repeat(np.broadcast_to(unit, (self.n, 1))[:, 0], 2)
        self.unit = np.concatenate((lengths, [1.0, 1.0, 10.0]))
        half = len(shapes.inverted) // 2
        inverted = shapes.inverted[:half, 0], shapes.inverted[half:, 0]
        self.fingers = [own(drawn.finger, flags, LAYER, (0.0, 0.0), 0.0) for flags in inverted]
        push = joint.relabeled(shapes).push[:, 0]
        self.push = np.sort(push[push > ROUNDING])
        self.contacts = [*self._contacts()]

    def energy(self, q: Array) -> Array:
        """Of both fingers: the body has none."""
        both = zip(self.fingers, range(2), strict=True)
        return np.asarray(sum(finger.energy(q[f : 2 * self.n : 2]) for finger, f in both))

    def nodes(self, q: Array) -> list[tuple[Array, Array]]:
        """x and y of the nodes of each finger's face in the gripper, (node, batch)."""
        gripper, found = self.scene.gripper, []
        assert gripper is not None
        cos, sin = np.cos(gripper.mounting_angle), np.sin(gripper.mounting_angle)
        for place, side in enumerate((1.0, -1.0)):
            face = self.fingers[place].nodes(q[place : 2 * self.n : 2])[2]
            x, y = (np.stack([getattr(node, axis) for node in face]) for axis in "xy")
            high = sin * x + cos * y + 0.5 * gripper.base_spacing
            found.append((cos * x - sin * y, side * high))
        return found

    def corners(self, q: Array) -> tuple[Array, Array]:
        """x and y of the body's corners, (corner, batch)."""
        x, y, angle = q[-3:]
        cos, sin = np.cos(angle), np.sin(angle)
        a, b = self.around[:, :, None]
        return x + cos * a - sin * b, y + sin * a + cos * b

    def to_plate(self, q: Array, finger: int, node: int, plate: int) -> tuple[Array, Array]:
        """The height of a node over a side of the body, and its share of the way along it."""
        corners, face = self.corners(q), self.nodes(q)[finger]
        after = (plate + 1) % len(corners[0])
        return _over([(v[plate], v[after], at[node]) for v, at in zip(corners, face, strict=True)])

    def to_side(self, q: Array, finger: int, corner: int, side: int) -> tuple[Array, Array]:
        """How far a corner is inside a side of a face, and its share of the way along it."""
        corners, face = self.corners(q), self.nodes(q)[finger]
        ends = [(v[side], v[side + 1], at[corner]) for v, at in zip(face, corners, strict=True)]
        height, share = _over(ends)
        return (1.0 - 2.0 * finger) * height, share

    def _contacts(self) -> Any:
        """Nodes on sides of the body, and its corners on sides of faces: ways to measure a gap."""
        q = self.q[:, None]
        n_corners = len(self.around[0])
        for finger, (face, _) in enumerate(self.nodes(q)):
            for node, plate in np.ndindex(len(face), n_corners):
                height, share = (float(v[0]) for v in self.to_plate(q, finger, node, plate))
                if abs(height) < 1e-7 and -1e-7 <= share <= 1.0 + 1e-7:
                    yield self.to_plate, (finger, node, plate)
            for corner, side in np.ndindex(n_corners, len(face) - 1):
                height, share = (float(v[0]) for v in self.to_side(q, finger, corner, side))
                if abs(height) < 1e-7 and 1e-6 <= share <= 1.0 - 1e-6:
                    yield self.to_side, (finger, corner, side)

    def gaps(self, q: Array) -> Array:
        """Of the contacts, (contact, batch)."""
        return np.stack([measure(q, *places)[0] for measure, places in self.contacts])

    def gradient(self, function: Callable[[Array], Array], q: Array) -> Array:
        """By complex steps, as forces."""
        return np.asarray(self.fingers[0].gradient(function, q) / self.unit)


def _over(axes: list[tuple[Array, Array, Array]]) -> tuple[Array, Array]:
    """How far a point is to the right of a line, and its share of the way along it.

    By x and y of where the line begins and ends, and of the point.
    """
    (along_x, away_x), (along_y, away_y) = ((b - a, c - a) for a, b, c in axes)
    size = along_x**2 + along_y**2
    height = (along_y * away_x - along_x * away_y) / np.sqrt(size)
    return height, (along_x * away_x + along_y * away_y) / size


@pytest.mark.parametrize("seed", SEEDS)
def test_force_and_moment_balance(
    seed: int, reference_finger: Fingers, own: Callable[..., Any]
) -> None:
    """By an energy, nodes and a pose of its own; so does what the package tells of its pushes."""
    drawn = Drawn(seed, reference_finger)
    found = Found(drawn, own)
    gaps = found.gaps(found.q[:, None])[:, 0]
    assert np.abs(gaps).max() <= ROUNDING
    slopes = found.gradient(found.gaps, found.q)
    push, *_ = np.linalg.lstsq(slopes.T, found.gradient(found.energy, found.q), rcond=None)
    rest = found.gradient(found.energy, found.q) - push @ slopes
    assert np.abs(rest).max() <= 1e-9, "N"
    assert np.abs(push @ slopes[:, -3:]).max() <= 1e-9, "N: of the body"
    assert np.sort(push[push > ROUNDING]) == pytest.approx(found.push, abs=1e-9)
    told = grasped(drawn.scene, drawn.body, drawn.pair)
    assert grasp_rows(told)["status"].tolist() == [Status.STABLE]
    force, moment = moments(told)
    assert np.abs(force).max() <= 1e-9, "N"
    assert np.abs(moment) <= 1e-9, "N mm"


@pytest.mark.parametrize("seed", SEEDS)
def test_slsqp_finds_the_same_rest(
    seed: int, reference_finger: Fingers, own: Callable[..., Any]
) -> None:
    found = Found(Drawn(seed, reference_finger), own)
    gaps = {
        "type": "ineq",
        "fun": lambda z: found.gaps((z / found.unit)[:, None])[:, 0],
        "jac": lambda z: found.gradient(found.gaps, z / found.unit),
    }
    random = np.random.default_rng(seed)
    best = minimize(
        lambda z: float(found.energy((z / found.unit)[:, None])[0]),
        found.q * found.unit + random.normal(0.0, 0.02, len(found.q)),
        jac=lambda z: found.gradient(found.energy, z / found.unit),
        constraints=gaps,
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert best.x / found.unit == pytest.approx(found.q, abs=2e-5)
    assert best.fun == pytest.approx(float(found.energy(found.q[:, None])[0]), rel=1e-9)


def test_a_polygon_given_turned_comes_to_the_same_rest(reference_finger: Fingers) -> None:
    """Whatever the reference point: its angle is shifted, and nothing else."""
    scene = gripper_of(reference_finger(3, 1e3), 45.0, 0.05)
    pair = "010/100"
    straight = spool(scene, pair)
    first = grasped(scene, straight, pair)
    rows = grasp_rows(first)
    assert rows["status"].tolist() == [Status.STABLE]
    assert np.abs(rows["object_angle_deg"]).max() > 0.1
    arm = np.array([30.0, -7.0])
    moved = Polygon(straight.center + arm, straight.around - arm[:, None])
    end = np.degrees(float(np.reshape(first.turned, -1)[0]))
    middle = at_place(straight, first.centers[:, 0], np.radians(end)).middle
    angle = -0.03
    about = straight.middle - moved.center
    center = moved.center + about - rotated(about[:, None], np.array([angle]))[:, 0]
    other = grasped(scene, replace(moved, center=center).turned(angle), pair)
    own = grasp_rows(other)
    assert own["object_angle_deg"] + np.degrees(angle) == pytest.approx([end], abs=1e-8)
    for name in ("squeeze_N", "finger_force_x_N", "max_contact_N", "aperture_mm"):
        assert own[name] == pytest.approx(rows[name], rel=1e-8)
    assert other.body is not None
    there = at_place(other.body, other.centers[:, 0], float(np.reshape(other.turned, -1)[0]))
    assert there.middle == pytest.approx(middle, abs=1e-8)


def without_turning(patch: pytest.MonkeyPatch) -> None:
    for module in (release, table):
        patch.setattr(module, "turns", lambda body, held: False)


def test_what_is_on_the_axis_rests_as_it_did(
    reference_finger: Fingers, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = gripper_of(reference_finger(3))
    body = spool(scene, "010/010")
    turning = grasp_rows(grasped(scene, body, "010/010"))
    without_turning(monkeypatch)
    before = grasp_rows(grasped(scene, body, "010/010"))
    assert turning["status"].tolist() == before["status"].tolist() == [Status.STABLE]
    assert turning["object_angle_deg"] == pytest.approx([0.0], abs=1e-9)
    for name in ("object_x_mm", "object_y_mm", "squeeze_N", "max_contact_N", "aperture_mm"):
        assert turning[name] == pytest.approx(before[name], abs=1e-9)
    assert "object_angle_deg" not in before


class OnEdge:
    """A body held in a notch by one finger, with an edge on the flat side of the other one.

    Where the edge has to be for its moments to balance, without turning, is sought.
    """

    def __init__(self, finger: Finger, patch: pytest.MonkeyPatch) -> None:
        self.scene, self.patch = gripper_of(finger), patch
        self.upper, (_, lowest) = ends_of(self.scene, "010/000")
        self.lowest = lowest
        along = brentq(lambda x: float(moments(self.still(x))[1]), -4.6, -4.4, xtol=1e-13)
        self.body = self.with_edge(along)

    def with_edge(self, along: float) -> Polygon:
        x, y, low = *self.upper, self.lowest
        corners = [(x + 5.0, y + 4.0), (x, y + 0.5), (x - 5.0, y + 4.0)]
        corners += [(x - 5.0, low + 8.0), (x + along, low - 0.5), (x + 5.0, low + 8.0)]
        at = np.array([x, 0.0])
        return Polygon(at, np.array(corners).T - at[:, None])

    def still(self, along: float) -> Grasps:
        with self.patch.context() as context:
            without_turning(context)
            return grasped(self.scene, self.with_edge(along), "010/000")

    def rest(self) -> tuple[Obstructed, ContactShapes]:
        """Where it rests, if it does not turn."""
        seen, lane = frames(self.scene.gripper), np.zeros(1, int)
        parts = [
            placed(self.scene, chain_potential, self.body, frame, codes(text))
            for frame, text in zip(seen, ("010", "000"), strict=True)
        ]
        with self.patch.context() as context:
            without_turning(context)
            own, start = together(parts, [lane, lane], motion_of(self.body, Held.FREE, seen))
        return own, released(own, start).shapes


def test_a_body_on_edge_is_not_stable(
    reference_finger: Fingers, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In balance, moments as well, and a minimum but for turning: only the curvature tells."""
    case = OnEdge(reference_finger(3), monkeypatch)
    own, rest = case.rest()
    motion = motion_of(case.body, Held.FREE, frames(case.scene.gripper))
    fingers, moved = np.split(rest.coordinates, [own.n_own])
    turning = np.concatenate((fingers, np.zeros((1, 1)), moved))
    status = {}
    for may_turn in (False, True):
        one = replace(own, motion=motion) if may_turn else own
        shapes = replace(rest, coordinates=turning) if may_turn else rest
        came = grasp.Approach(shapes, np.ones(1), ())
        both = [codes("010"), codes("000")]
        stable = np.array([Status.STABLE], np.uint8)
        upper, lower = described(one, both, came, stable, with_margins=False)
        assert (upper.residual < 1e-9).all() and (upper.gap > -1e-9).all()
        status[may_turn] = [int(upper.status[0]), int(lower.status[0])]
    assert status == {False: [Status.STABLE] * 2, True: [Status.MARGINAL] * 2}
    told = grasp_rows(grasped(case.scene, case.body, "010/000"))
    assert told["status"].tolist() == [Status.NOT_HELD]
    assert np.isnan(told["object_angle_deg"]).all() and np.isnan(told["squeeze_N"]).all()


@pytest.mark.slow
def test_a_body_on_two_edges_goes_counterclockwise(
    reference_finger: Fingers, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between mirrored fingers nothing says to which side; it is let go of but for the last."""
    scene = gripper_of(reference_finger(3), 40.0)
    units, free = UnitSolutions.of(scene.finger), np.array([[False], [True], [False]])
    settled = settle(units, chain_potential, free, 1e-12)
    face = Face.of(settled.potential.coordinates, np.array([[LAYER]]))
    nodes = face.shape(settled.equilibrium.coordinates).nodes[..., 0]
    x, high = frames(scene.gripper)[0].placed(nodes)[:, 1] + np.array([0.0, 0.6])
    low = high - 0.5
    corners = [[4.0, 0.0, -4.0, -4.0, 0.0, 4.0], [low, high, low, -low, -high, -low]]
    body, seen, lane = Polygon(np.array([x, 0.0]), np.array(corners)), frames(scene.gripper), [0]
    parts = [placed(scene, chain_potential, body, frame, codes("010")) for frame in seen]
    motion, index = motion_of(body, Held.FREE, seen), np.array(lane)
    own, start = together(parts, [index, index], motion)

    def nearly(own: Obstructed, shapes: ContactShapes, load: Array, end: Array) -> Any:
        return approach(own, shapes, load, 0.9985 * end)

    monkeypatch.setattr(release, "approach", nearly)
    gone = released(own, start).shapes
    assert gone.is_there.all()
    assert gone.coordinates[own.n_own, 0] > 0.1, "mm"


@pytest.mark.slow
def test_payloads_of_a_body_that_has_turned(reference_finger: Fingers) -> None:
    """Those of the same body given as it rests."""
    scene = gripper_of(reference_finger(3))
    scene = replace(scene, friction=Friction(0.4), gravity=(1.0, 0.0))
    body = spool(scene, "010/010")
    askew = replace(body, center=body.center + np.array([0.1, 0.2])).turned(0.03)
    straight, turned = (grasp_rows(grasped(scene, own, "010/010")) for own in (body, askew))
    assert turned["object_angle_deg"] == pytest.approx([-np.degrees(0.03)], abs=1e-8)
    assert straight["payload_N"][0] > 0.01
    assert turned["payload_N"] == pytest.approx(straight["payload_N"], rel=1e-6)
    assert turned["fails_first"].tolist() == straight["fails_first"].tolist()


@pytest.mark.slow
def test_many_designs_as_each_by_itself(reference_finger: Fingers) -> None:
    """Sweeps have the column, and only where a body may turn."""
    scene = gripper_of(reference_finger(3))
    body = spool(scene, "010/010").turned(0.03)
    column = np.array([0.0, 0.2])
    many = body.with_value("at_y_mm", column).take_lanes(np.arange(2))
    gripper = Gripper(np.full(2, 50.0), np.zeros(2))
    both, layer = np.repeat(codes("010"), 2), np.full(2, LAYER)
    own = Encounter(UnitSolutions.of(scene.finger), layer, gripper, many, Held.FREE)
    rows = grasp_rows_of_designs(own, both)
    for place, y in enumerate(column):
        one = replace(body, center=np.array([body.center[0], y]))
        alone = grasp_rows(grasped(scene, one, "010/010"))
        for name in ("object_angle_deg", "object_x_mm", "object_y_mm", "squeeze_N"):
            assert rows[name][place] == pytest.approx(alone[name][0], abs=1e-9)
    assert rows["object_angle_deg"] == pytest.approx(-np.degrees([0.03, 0.03]), abs=1e-9)
    assert "object_angle_deg" not in grasp_rows_of_designs(own._replace(held=Held.GUIDED), both)


def test_routines_go_on_about_the_body_as_it_has_turned(reference_finger: Fingers) -> None:
    """Each finger by itself, with the body kept where it rests, is in balance there."""
    scene = gripper_of(reference_finger(3))
    body = spool(scene, "010/010")
    body = replace(body, center=body.center + np.array([0.1, 0.2])).turned(0.03)
    task = Task(replace(scene, body=body, held=Held.FREE), cast("Any", None), body.center)
    held, after = lifted(task, beside(task, codes("010")))
    assert held.turned == pytest.approx([-0.03], abs=1e-9)
    before = grasp_rows(held)
    kept_rows = grasp_rows(kept(task, after, held.centers, held.turned))
    assert before["status"].tolist() == kept_rows["status"].tolist() == [Status.STABLE]
    for name in ("squeeze_N", "finger_force_x_N", "n_contacts"):
        assert kept_rows[name] == pytest.approx(before[name], abs=1e-9)
    assert kept_rows["penetration_mm"].max() < ROUNDING
    other = at_place(body, body.center, float(held.turned[0]))
    begin, end = np.array([[70.0], [0.0]]), held.centers
    around = np.array([[shapely.box(0.0, 20.0, 60.0, 30.0)]])
    (turned, known) = (
        clearance(around, own, begin, end)
        for own in (at_place(body, body.center, held.turned), other)
    )
    assert turned.gap == pytest.approx(known.gap, abs=1e-12)
    assert way(task, held, begin, end).gap.shape == (1,)


def test_centers_of_area() -> None:
    """By shapely, of bodies by design as well."""
    random = np.random.default_rng(7)
    turn = np.sort(random.uniform(0.0, 2.0 * np.pi, 7))
    around = np.array([[40.0], [-3.0]]) + 9.0 * np.array([np.cos(turn), 0.5 * np.sin(turn)])
    body, angle = Polygon(np.array([5.0, 6.0]), around), np.array([0.0, 0.4, 2.5])
    many = at_place(body, np.array([[5.0, 7.0, 9.0], [6.0, 6.0, 1.0]]), angle)
    radius = []
    for place in range(3):
        area = shapely.Polygon(many.corners[..., place].T)
        middle = shapely.get_coordinates(shapely.centroid(area))[0]
        assert many.middle[:, place] == pytest.approx(middle, abs=1e-12)
        radius.append(np.hypot(*(many.corners[..., place] - middle[:, None])).max())
    assert radius == pytest.approx([body.outer_radius] * 3, abs=1e-12)
    assert many.inner_radius == pytest.approx(body.inner_radius, rel=1e-6)


def test_figures_show_bodies_as_they_have_turned(
    reference_finger: Fingers, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    scene = gripper_of(reference_finger(3))
    body = spool(scene, "010/010").turned(0.03)
    found, drawn = grasped(scene, body, "010/010"), list[Array]()
    monkeypatch.setattr(drawing, "_draw_body", lambda axes, body, around: drawn.append(around))
    drawing.draw_grasps(found, grasp_rows(found), tmp_path / "spool.svg")
    x, y = spool(scene, "010/010").corners
    (around,) = drawn
    away = around - (x + 1j * y)
    assert away.imag == pytest.approx(np.zeros(6), abs=1e-9), "it stands across"
    assert np.ptp(away.real) == pytest.approx(0.0, abs=1e-9)
