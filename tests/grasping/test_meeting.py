"""Two fingers that touch each other: by an energy of its own, by SciPy, and by symmetry."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.optimize import minimize
from shapely import LineString, affinity

from dpgcli.arrays import Array
from dpgcli.design.scene import Gripper, Scene
from dpgcli.grasping import grasp, meeting
from dpgcli.grasping.frames import frames
from dpgcli.grasping.grasped import Grasped
from dpgcli.grasping.table import grasp_rows, grasps
from dpgcli.mechanics.finger import STUDY, Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
THICKNESS = 1.5
QUICK = (0, 11)
SEEDS = [
    pytest.param(s, marks=[] if s in QUICK else pytest.mark.slow, id=str(s)) for s in range(18)
]


def codes(*patterns: str) -> Any:
    return codes_of(np.array([[digit == "1" for digit in text] for text in patterns]).T)


def scene_of(finger: Finger, spacing: float, tilt: float = 0.0) -> Scene:
    return Scene(finger, (), Gripper(spacing, tilt), THICKNESS)


class Drawn:
    """A random finger, two patterns of it and a gripper whose free fingers would overlap."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(900 + seed)
        n = self.n = int(random.integers(2, 5))
        values = {name: value * random.uniform(0.9, 1.1, (n, 1)) for name, value in STUDY.items()}
        values["segment_height"] = values["segment_height"][:1]
        values["force_linearity"] = random.uniform(0.02, 0.04, (n, 1))
        bars = np.array([[(1e3, 1e4, np.inf)[seed % 3]]])
        finger = Finger(n, **values, linear_stiffness=bars)
        self.finger = finger.changed(wall_compliance=np.array([[0.6 if seed % 2 else 0.0]]))
        drawn = (random.choice(["0", "1"], n, p=[0.3, 0.7]) for _ in range(99))
        patterns = list(dict.fromkeys("".join(digits) for digits in drawn))
        self.patterns = patterns[:2]
        self.tilt, self.deep = random.uniform(-0.35, 0.1), random.uniform(0.5, 3.0)


class Pair:
    """Two fingers of patterns in a gripper: energy and gaps by interleaved coordinates."""

    def __init__(self, own: Any, scene: Scene, inverted: Any) -> None:
        assert scene.gripper is not None
        self.scene, self.n = scene, scene.finger.n_units
        self.tilt, self.half = scene.gripper.mounting_angle, 0.5 * scene.gripper.base_spacing
        parts = np.reshape(inverted, (2, -1))
        self.own = [own(scene.finger, part, THICKNESS, (0.0, 0.0), 1.0) for part in parts]

    def energy(self, q: Array) -> Array:
        """Of both, N mm, (batch,)."""
        upper, lower = (one.energy(q[f::2]) for f, one in enumerate(self.own))
        return np.asarray(upper + lower)

    def outline(self, finger: int, q: Array) -> list[Any]:
        """The nodes of the face and the end's, x and y, in the gripper's frame."""
        base, top, face = self.own[finger].nodes(q[finger::2])
        across = top[-1].x - base[-1].x, top[-1].y - base[-1].y
        height = float(self.scene.finger.segment_height[0, 0])
        share = height / np.sqrt(across[0] ** 2 + across[1] ** 2)
        end = base[-1].x + share * across[0], base[-1].y + share * across[1]
        cos, sin = np.cos(self.tilt), np.sin(self.tilt)
        side = 1.0 - 2.0 * finger
        return [
            (cos * x - sin * y, side * (sin * x + cos * y + self.half)) for x, y in [*face, end]
        ]

    def gap(self, cell: int, q: Array) -> Array:
        """How far a node is on the inner side of the line of a side, mm, (batch,)."""
        n_sides = self.n + 1
        finger, rest = divmod(cell, n_sides * (n_sides + 1))
        node, side = divmod(rest, n_sides)
        (x0, y0), (x1, y1) = self.outline(finger, q)[side : side + 2]
        x, y = self.outline(1 - finger, q)[node]
        cross = (y1 - y0) * (x - x0) - (x1 - x0) * (y - y0)
        return np.asarray((1.0 - 2.0 * finger) * cross / np.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2))

    def gaps(self, cells: Any, q: Array) -> Array:
        """The same of some cells, (cell, batch)."""
        return np.stack([self.gap(int(cell), q) for cell in cells])

    def lines(self, q: Array) -> list[LineString]:
        """Faces with their ends."""
        outlines = (self.outline(finger, q[:, None]) for finger in range(2))
        return [LineString([(x[0], y[0]) for x, y in line]) for line in outlines]


class Found(NamedTuple):
    """What the package found for a pair, and the pair by the definitions of these tests."""

    fingers: tuple[Grasped, Grasped]
    pair: Pair
    q: Array
    push: Array
    unit: Array

    @property
    def cells(self) -> Any:
        return np.flatnonzero(self.push > 0.0)

    def gradient(self, function: Callable[[Array], Array]) -> Array:
        return np.asarray(self.pair.own[0].gradient(function, self.q))


def shapes_of(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What is described from now on: fingers and shapes."""
    kept: list[Any] = []
    for module, name in ((meeting, "described"), (grasp, "described")):
        whole = getattr(module, name)

        def watched(own: Any, texts: Any, came: Any, *rest: Any, _whole: Any = whole) -> Any:
            kept.append((own, own.relabeled(came.shapes)))
            return _whole(own, texts, came, *rest)

        monkeypatch.setattr(module, name, watched)
    return kept


def way_of(known: Any, gripper: Gripper, pair: Any) -> float:
    """How far apart bases are moved for free fingers just to touch, mm."""
    found: list[float] = []

    class KnownError(Exception):
        pass

    def told(*both: Any) -> Array:
        found.append(float(way(*both)[0]))
        raise KnownError

    with pytest.MonkeyPatch.context() as patch:
        way = meeting.way_of
        patch.setattr(meeting, "way_of", told)
        with pytest.raises(KnownError):
            meeting._met(*known, frames(gripper), pair)
    return found[0]


def met(drawn: Drawn, own: Any, monkeypatch: pytest.MonkeyPatch) -> Found:
    """The pair where the bases have come together by `deep` since the free fingers touched."""
    pair = [codes(text) for text in drawn.patterns]
    known = UnitSolutions.of(drawn.finger), chain_potential, np.array([[THICKNESS]])
    kept, near = shapes_of(monkeypatch), THICKNESS * np.cos(drawn.tilt) + 0.1
    spacing = max(near, near + way_of(known, Gripper(near, drawn.tilt), pair) - drawn.deep)
    scene = scene_of(drawn.finger, spacing, drawn.tilt)
    fingers = meeting._met(*known, frames(scene.gripper), pair)
    joint, shapes = kept[-1]
    assert fingers[0].status.tolist() == [Status.STABLE]
    assert [gaps.has_corners for gaps in joint.contacts] == [True, False], "two nodes meet once"
    found = Pair(own, scene, shapes.inverted[:, 0])
    lengths = joint.potentials(shapes.inverted)[0].coordinates.force_unit
    unit = np.repeat(np.broadcast_to(lengths, (joint.n_own // 2, 1))[:, 0], 2)
    q, push = shapes.coordinates[: joint.n_own, 0], shapes.push[: joint.n_gaps, 0]
    return Found(fingers, found, q, np.where(push > 1e-12, push, 0.0), unit)


@pytest.fixture(params=SEEDS)
def drawn(request: Any) -> Drawn:
    return Drawn(request.param)


def test_they_balance_without_penetration(
    drawn: Drawn, own: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = met(drawn, own, monkeypatch)
    cells, q = found.cells, found.q
    assert len(cells) and np.abs(found.pair.gaps(cells, q[:, None])).max() <= 1e-9, "mm"
    pulled = found.gradient(found.pair.energy)
    slopes = found.gradient(lambda x: found.pair.gaps(cells, x))
    assert np.abs((pulled - found.push[cells] @ slopes) / found.unit).max() <= 1e-9, "N"
    upper, lower = found.pair.lines(q)
    assert upper.distance(lower) <= 1e-9
    assert not affinity.translate(upper, 0.0, 1e-8).intersects(lower)
    by_upper, by_lower = (
        frame.outside(finger.force)[:, 0]
        for frame, finger in zip(frames(found.pair.scene.gripper), found.fingers, strict=True)
    )
    assert by_upper == pytest.approx(-by_lower, abs=1e-12), "action is reaction"


def test_forces_and_moments_at_the_bases(
    drawn: Drawn, own: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Places and pushes that are told turn each finger about its base as its first corner does."""
    found = met(drawn, own, monkeypatch)
    for number, finger in enumerate(found.fingers):
        single, x = found.pair.own[number], found.q[number::2]
        corner = int(single.finger.has_walls) + int(not single.finger.is_rigid)  # behind v and e
        places, ways = (part[..., 0] for part in finger.touches)
        force = -ways * finger.push[:, 0]
        moment = (places[0] * force[1] - places[1] * force[0]).sum()  # turns against a corner
        by_corner = single.gradient(single.energy, x)[corner]
        assert abs(moment) > 0.1 and by_corner == pytest.approx(-moment, abs=1e-9), "N mm"


def test_they_are_minima_on_the_tangent_space(
    drawn: Drawn, own: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = met(drawn, own, monkeypatch)
    cells, push = found.cells, found.push[found.cells]

    def lagrangian(x: Array) -> Array:
        return np.asarray(found.pair.energy(x) - push @ found.pair.gaps(cells, x))

    slopes = found.gradient(lambda x: found.pair.gaps(cells, x))
    tangent = np.linalg.svd(slopes.T / found.unit[:, None])[0][:, len(cells) :]
    hessian = found.pair.own[0].hessian(lagrangian, found.q) / found.unit / found.unit[:, None]
    assert np.linalg.eigvalsh(tangent.T @ hessian @ tangent).min() > 1e-3, "N/mm"


def test_slsqp_finds_the_same_minima(
    drawn: Drawn, own: Any, slsqp: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = met(drawn, own, monkeypatch)
    pair, unit, tool = found.pair, found.unit, found.pair.own[0]

    def gaps(q: Array) -> Array:
        return pair.gaps(found.cells, q)

    best = slsqp(pair.energy, gaps, tool.gradient, found.q, unit)
    assert best.x / unit == pytest.approx(found.q, abs=2e-5)
    assert best.fun == pytest.approx(float(pair.energy(found.q[:, None])[0]), rel=1e-9)


STUDY_GRIPPER = 60.0, 0.0
GIVES_WAY = 2.095335672462368, 0.28275180489860696, "1011"  # a spacing, a tilt and a pattern


def mirrored(
    finger: Finger, gripper: tuple[float, float], own: Any, *patterns: str
) -> tuple[Grasped, list[Found]]:
    """What the package found for mirrored pairs, and them with both fingers of each."""
    with pytest.MonkeyPatch.context() as patch:
        kept = shapes_of(patch)
        scene = scene_of(finger, *gripper)
        (upper, lower), lanes = meeting.meeting(scene, chain_potential, (codes(*patterns),) * 2)
    joint, shapes = kept[-1]
    lengths = joint.potentials(shapes.inverted)[0].coordinates.force_unit
    unit = np.repeat(np.broadcast_to(lengths, (joint.n_own, 1))[:, 0], 2)
    found = []
    for lane in range(len(upper.code)):
        pair = Pair(own, scene, np.tile(shapes.inverted[:, lane], 2))
        q = np.repeat(shapes.coordinates[:, lane], 2)
        found.append(Found((upper, lower), pair, q, shapes.push[:, lane], unit))
    order = np.argsort(lanes[0])
    assert upper.code[lanes[0]].tolist() == codes(*patterns).tolist() and len(order)
    return upper, found


def along_and_apart(found: Found, q: Array) -> tuple[Array, Array]:
    """By how much nodes that touch have slid along each other, and come apart, (node, batch)."""
    nodes = np.flatnonzero(found.push > 0.0) + 1
    upper, lower = (found.pair.outline(finger, q) for finger in range(2))
    apart = (np.stack([upper[k][axis] - lower[k][axis] for k in nodes]) for axis in range(2))
    along, across = apart
    return along, across


@pytest.mark.parametrize("bars", [np.inf, pytest.param(1e3, marks=pytest.mark.slow)])
def test_mirrored_fingers_are_minima_of_both(
    bars: float, reference_finger: Fingers, own: Any
) -> None:
    """Whatever both do while nodes that touch do not slide: the rest is the same by SLSQP."""
    upper, found = mirrored(reference_finger(5, bars), STUDY_GRIPPER, own, "11001", "11111")
    assert upper.status.tolist() == [Status.STABLE] * 2
    pressed = found[0]
    tool, unit, q = pressed.pair.own[0], pressed.unit, pressed.q
    along, apart = along_and_apart(pressed, q[:, None])
    assert along == pytest.approx(np.zeros((1, 1)), abs=1e-12) and abs(apart).max() < 1e-9

    def function(part: int) -> Callable[[Array], Array]:
        return lambda x: along_and_apart(pressed, x)[part]

    constraints = [
        {
            "type": kind,
            "fun": lambda z, part=part: function(part)((z / unit)[:, None])[:, 0],
            "jac": lambda z, part=part: tool.gradient(function(part), z / unit) / unit,
        }
        for part, kind in enumerate(("eq", "ineq"))
    ]
    best = minimize(
        lambda z: float(pressed.pair.energy((z / unit)[:, None])[0]),
        q * unit + np.random.default_rng(2).normal(0.0, 0.02, len(q)),
        jac=lambda z: tool.gradient(pressed.pair.energy, z / unit) / unit,
        constraints=constraints,
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert best.x / unit == pytest.approx(q, abs=2e-5)
    slopes = np.concatenate([tool.gradient(function(part), q) for part in range(2)])
    rest = tool.gradient(pressed.pair.energy, q)
    push = np.concatenate((np.zeros(1), pressed.push[pressed.push > 0.0]))
    assert np.abs((rest - push @ slopes) / unit).max() < 1e-9, "N: nothing is rubbed"


def curvatures(found: Found) -> tuple[float, float]:
    """The smallest of mirrored motions, and of their opposites, N/mm: nodes do not slide."""
    tool, unit, q = found.pair.own[0], found.unit, found.q
    push = found.push[found.push > 0.0]

    def lagrangian(x: Array) -> Array:
        return np.asarray(found.pair.energy(x) - push @ along_and_apart(found, x)[1])

    hessian = tool.hessian(lagrangian, q) / unit / unit[:, None]
    slopes = np.concatenate(
        [tool.gradient(lambda x, part=part: along_and_apart(found, x)[part], q) for part in (0, 1)]
    )
    least = []
    for sign in (1.0, -1.0):
        basis = np.kron(np.eye(len(q) // 2), np.array([[1.0], [sign]])) / np.sqrt(2.0)
        normals = (slopes / unit @ basis).T
        free = np.linalg.svd(normals)[0][:, np.linalg.matrix_rank(normals) :]
        least.append(float(np.linalg.eigvalsh(free.T @ basis.T @ hessian @ basis @ free).min()))
    return least[0], least[1]


def test_both_kinds_of_motion_are_certified(reference_finger: Fingers, own: Any) -> None:
    upper, found = mirrored(reference_finger(5, np.inf), STUDY_GRIPPER, own, "11001", "11010")
    assert upper.status.tolist() == [Status.STABLE] * 2
    assert all(min(curvatures(pressed)) > 1e-3 for pressed in found)


def test_a_pair_that_gives_way_to_one_side_is_marginal(reference_finger: Fingers, own: Any) -> None:
    """By that alone: motions that are mirror images are stable."""
    *gripper, pattern = GIVES_WAY
    upper, (found,) = mirrored(reference_finger(4, np.inf), tuple(gripper), own, pattern)
    assert upper.status.tolist() == [Status.MARGINAL]
    by_mirrored, sideways = curvatures(found)
    assert by_mirrored > 1e-3 and sideways < -1e-3, "N/mm"


@pytest.mark.slow
def test_a_penalty_comes_near_at_first_order(own: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Contact that gives way by its force over κ: a tenth of the error at ten times κ."""
    found = met(Drawn(8), own, monkeypatch)
    pair, unit, tool, cells = found.pair, found.unit, found.pair.own[0], found.cells
    errors = []
    for stiffness in (1e2, 1e3, 1e4):

        def energy(x: Array, stiffness: float = stiffness) -> Array:
            inside = pair.gaps(cells, x)  # below 0 wherever both press
            return np.asarray(pair.energy(x) + 0.5 * stiffness * (inside**2).sum(axis=0))

        q = found.q.copy()
        for _ in range(12):
            slope = tool.gradient(energy, q) / unit
            q = q - np.linalg.solve(tool.hessian(energy, q) / unit / unit[:, None], slope) / unit
        assert np.abs(tool.gradient(energy, q) / unit).max() < 1e-7
        assert pair.gaps(cells, q[:, None]).max() < 0.0
        errors.append(np.abs((q - found.q) * unit).max())
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(10.0, rel=0.05)


def test_swapped_fingers_have_mirrored_forces(reference_finger: Fingers) -> None:
    scene = scene_of(reference_finger(5), *STUDY_GRIPPER)
    pair = codes("11111", "01111", "11001"), codes("01111", "11111", "11001")
    rows = grasp_rows(grasps(scene, chain_potential, None, pair))
    assert (rows["status"] == Status.STABLE).all()
    one, other = ({name: rows[name][row] for name in rows} for row in range(2))
    assert one["finger_force_x_N"] == -other["finger_force_x_N"] != 0.0
    for name in ("squeeze_N", "finger_force_y_N", "n_contacts", "margin", "aperture_mm"):
        assert one[name] == other[name]
    assert one["pattern"] == "11111/01111" and other["pattern"] == "01111/11111"
    assert one["squeeze_N"] == -one["finger_force_y_N"] > 0.1
    assert rows["n_contacts"].tolist() == [1, 1, 1]
    assert rows["finger_force_x_N"][2] == 0.0 and rows["aperture_mm"][2] == pytest.approx(0.0)
    assert not rows["overlaps"].any()


def test_whichever_is_the_upper_one_touches_are_the_same(reference_finger: Fingers) -> None:
    """Phalanges, places and pushes of a finger, in its own frame."""
    scene = scene_of(reference_finger(3), 25.0)
    pair = codes("111", "101", "111", "110"), codes("101", "111", "110", "111")
    found = grasps(scene, chain_potential, None, pair)
    rows = grasp_rows(found)
    assert (rows["status"] == Status.STABLE).all() and (rows["n_contacts"] > 0).all()

    def touched(finger: int, row: int) -> set[tuple[Any, ...]]:
        own, lane = found.take(finger, row)
        cells = np.flatnonzero(own.push[:, lane] > 0.0)
        numbers = (own.push[cells, lane], *own.touches.places[:, cells, lane])
        ways = own.touches.directions[:, cells, lane]
        return set(zip(own.phalanges[cells].tolist(), *numbers, *ways, strict=True))

    for row in (0, 2):
        for finger in range(2):
            assert touched(finger, row) == touched(1 - finger, row + 1) != set()


@pytest.mark.slow
def test_a_pair_is_the_same_among_others(reference_finger: Fingers) -> None:
    """Bit for bit, and whichever finger is told first."""
    scene = scene_of(reference_finger(3), 25.0)
    all_codes = np.arange(8, dtype=np.uint64)
    pairs = np.repeat(all_codes, 8), np.tile(all_codes, 8)
    rows = grasp_rows(grasps(scene, chain_potential, None, pairs))
    assert (rows["n_contacts"] > 0).sum() > 10
    for row in np.flatnonzero(rows["n_contacts"] > 0)[::5]:
        alone = grasp_rows(
            grasps(scene, chain_potential, None, tuple(part[row : row + 1] for part in pairs))
        )
        assert {name: values[0] for name, values in alone.items()} == {
            name: values[row] for name, values in rows.items()
        }


def test_resets_are_told_at_the_spacing_where_a_gripper_of_it_has_them(
    reference_finger: Fingers,
) -> None:
    """A share of the way: bases that stay before it keep the state, those just beyond not."""
    finger, (spacing, tilt) = reference_finger(5), STUDY_GRIPPER
    own = codes("11011"), codes("11011")
    rows = grasp_rows(grasps(scene_of(finger, spacing, tilt), chain_potential, None, own))
    free = grasp_rows(grasps(scene_of(finger, 300.0, tilt), chain_potential, None, own))
    share = float(rows["resets"][0].partition(" at ")[2])
    way = 300.0 - spacing - free["aperture_mm"][0]
    assert rows["pattern_after"].tolist() == ["01011"] and free["n_contacts"].tolist() == [0]
    for part, after in ((share - 0.03, "11011"), (share + 2e-4, "01011")):
        scene = scene_of(finger, spacing + (1.0 - part) * way, tilt)
        found = grasp_rows(grasps(scene, chain_potential, None, own))
        assert found["pattern_after"].tolist() == [after]
        is_held = after == "11011"
        assert found["margin"][0] == pytest.approx(share / part - 1.0, abs=1e-4) or not is_held


def test_next_to_its_reset_a_pair_gives_way_to_one_side(
    reference_finger: Fingers, own: Any
) -> None:
    """Before mirror images reset together: 0.28 mm of spacing away, and not 0.3."""
    finger, (spacing, tilt) = reference_finger(5, np.inf), STUDY_GRIPPER
    for more, status in ((0.28, Status.MARGINAL), (0.3, Status.STABLE)):
        upper, (found,) = mirrored(finger, (spacing + more, tilt), own, "11011")
        by_mirrored, sideways = curvatures(found)
        assert upper.status.tolist() == [status]
        assert by_mirrored > 1e-2 and abs(sideways) > 1e-3
        assert (sideways > 0.0) == (status == Status.STABLE)
