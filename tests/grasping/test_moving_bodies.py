"""Bodies that may move between two fingers: by an energy of its own, by SciPy, and by symmetry."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from dpgcli.arrays import Array
from dpgcli.design.bodies import Body, Disc, Jaws
from dpgcli.design.scene import Gripper, Held, Scene
from dpgcli.grasping import grasp
from dpgcli.grasping.approach import Load, Reset, Way
from dpgcli.grasping.frames import frames
from dpgcli.grasping.grasp import placed
from dpgcli.grasping.release import motion_of, released, together
from dpgcli.grasping.table import Grasps, grasp_rows, grasps
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.obstacle import Obstacle
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of

Fingers = Callable[..., Finger]


@pytest.fixture(autouse=True)
def without_margins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Margins are looked for as far as the load itself: nowhere."""
    monkeypatch.setattr(grasp, "MARGIN_TO", 1.0)


SPACING = 60.0  # mm
CAN = Disc(np.array([50.0, 0.0]), 33.0)


def codes(*texts: str) -> Any:
    return codes_of(np.array([[digit == "1" for digit in text] for text in texts]).T)


def gripper_of(finger: Finger, angle: float = 0.0) -> Scene:
    return Scene(finger, (), Gripper(base_spacing=SPACING, mounting_angle=angle), 1.5)


def grasped(scene: Scene, body: Body, held: Held, *pairs: str, way: Way = Way.PLACE) -> Grasps:
    uppers, lowers = zip(*(pair.split("/") for pair in pairs), strict=True)
    both = codes(*uppers), codes(*lowers)
    return grasps(replace(scene, body=body, held=held), chain_potential, body, both, way)


def forces(found: Grasps) -> Array:
    """On the body in the gripper's frame, (finger, 2, row), N."""
    pairs = zip(found.frames, found.fingers, strict=True)
    return np.stack([frame.outside(finger.force) for frame, finger in pairs])


def dense(band: Array) -> Array:
    """The matrix of a band, (size, size), of one lane."""
    size = band.shape[1]
    matrix = np.zeros((size, size))
    for depth, column in np.ndindex(*band.shape[:2]):
        if column + depth < size:
            matrix[column + depth, column] = matrix[column, column + depth] = band[depth, column, 0]
    return matrix


def difference(function: Callable[[Array], Array], at: Array, scale: Array) -> Array:
    """Fourth-order central differences by coordinates over their scales, (size, …)."""
    rows = []
    for step in 1e-3 * np.diag(scale)[:, :, None]:
        near = function(at + step) - function(at - step)
        far = function(at + 2 * step) - function(at - 2 * step)
        rows.append((8.0 * near - far) / 12e-3)
    return np.stack(rows)


@pytest.mark.parametrize("held", [Held.FREE, Held.GUIDED])
@pytest.mark.parametrize(("bars", "walls"), [(np.inf, 0.0), (1e3, 0.0), (1e3, 0.6)])
def test_derivatives_by_fingers_and_body(
    held: Held, bars: float, walls: float, graded_finger: Fingers
) -> None:  # fmt: skip
    finger = graded_finger(3, 21, linear_stiffness=bars)
    finger = finger.changed(wall_compliance=np.array([[walls]]))
    scene = gripper_of(finger, 0.2)
    seen = frames(scene.gripper)
    disc = Disc(np.array([25.0, 1.0]), 30.0)
    parts = [placed(scene, chain_potential, disc, f, codes("001")) for f in seen]
    lane = np.zeros(1, int)
    own, shapes = together(parts, [lane, lane], motion_of(disc, held, seen))
    random = np.random.default_rng(5)
    push = random.uniform(5000.0, 6000.0, (own.n_gaps, 1))
    potential = own.pressed(shapes.inverted, push, np.ones(1))
    unit = np.broadcast_to(potential.coordinates.force_unit, (len(shapes.coordinates), 1))[:, 0]
    at = shapes.coordinates + random.normal(0.0, 0.02, shapes.coordinates.shape) / unit[:, None]
    scale = 1.0 / unit
    slope = difference(lambda x: potential.evaluate(x).energy, at, scale)[:, 0]
    found = potential.evaluate(at)
    assert found.gradient[:, 0] * scale == pytest.approx(slope, rel=1e-6, abs=1e-6)
    assert np.abs(slope[own.n_own :]).min() > 0.1, "N: the body is pushed"
    bend = difference(lambda x: potential.evaluate(x).gradient, at, scale)[:, :, 0]
    exact = dense(found.hessian) * scale[:, None] * scale
    assert exact == pytest.approx(bend * scale, rel=1e-5, abs=1e-3)


def test_a_can_between_mirrored_fingers_stays_on_the_axis(reference_finger: Fingers) -> None:
    scene = gripper_of(reference_finger(5))
    found = grasped(scene, CAN, Held.FREE, "00001/00001")
    rows = grasp_rows(found)
    assert rows["status"].tolist() == [Status.STABLE]
    assert rows["object_y_mm"] == pytest.approx([0.0], abs=1e-9)
    upper, lower = (
        frame.outside(f.force)[:, 0] for frame, f in zip(found.frames, found.fingers, strict=True)
    )
    assert upper + lower == pytest.approx(np.zeros(2), abs=1e-9), "N: nothing else acts on the body"
    assert upper[1] < -0.1 and abs(upper[0]) < 1e-9, "N"
    assert rows["object_x_mm"][0] != pytest.approx(CAN.center[0], abs=1.0)


def test_different_fingers_shift_the_can(reference_finger: Fingers) -> None:
    scene = gripper_of(reference_finger(5, 1e4))
    found = grasped(scene, CAN, Held.FREE, "00001/00000", "00000/00001", "00001/00001")
    rows = grasp_rows(found)
    sides = rows["object_y_mm"]
    there = rows["status"] == Status.STABLE
    assert there[2]
    assert sides[0] == pytest.approx(-sides[1], abs=1e-7, nan_ok=True)
    total = sum(
        frame.outside(f.force) for frame, f in zip(found.frames, found.fingers, strict=True)
    )
    assert np.abs(total[:, there]).max() < 1e-9


@pytest.mark.parametrize("bars", [np.inf, 1e3])
def test_an_energy_of_its_own_and_slsqp_find_the_same_place(
    bars: float, reference_finger: Fingers, own: Callable[..., Any]
) -> None:
    finger = reference_finger(5, bars)
    scene = gripper_of(finger)
    seen = frames(scene.gripper)
    code = codes("00001")
    parts = [placed(scene, chain_potential, CAN, f, code) for f in seen]
    lane = np.zeros(1, int)
    joint, start = together(parts, [lane, lane], motion_of(CAN, Held.FREE, seen))
    found = released(joint, start).shapes
    inverted = np.array([digit == "1" for digit in "00001"])
    n = joint.n_own // 2

    def unit(finger_index: int, center: Any) -> Any:
        return own(finger, inverted, 1.5, center, CAN.radius)

    def centers(x: Array) -> tuple[Any, Any]:
        cx, cy = CAN.center[0] + x[-2], x[-1]
        return (cx, cy - SPACING / 2.0), (cx, -cy - SPACING / 2.0)

    def energy(x: Array) -> Array:
        return sum(unit(f, (0.0, 0.0)).energy(x[f : 2 * n : 2]) for f in range(2))

    def gaps(x: Array) -> Array:
        parts = [unit(f, c).gaps(x[f : 2 * n : 2]) for f, c in enumerate(centers(x))]
        return np.concatenate(parts)

    scale = np.ones(2 * n + 2)
    height = float(finger.segment_height[0, 0])
    lengths = np.broadcast_to(joint.potentials(start.inverted)[0].coordinates.force_unit, (n, 1))
    scale[: 2 * n] = np.repeat(lengths[:, 0], 2)
    assert height in scale
    tool, q = unit(0, (0.0, 0.0)), found.coordinates[:, 0]
    there = gaps(q[:, None])[:, 0]
    push = found.push[:, 0]
    again = [k for k in range(len(there)) if (np.abs(there[k - k % 5 : k] - there[k]) < 1e-9).any()]
    apart = [k for k in range(len(there)) if push[k] > 0.0 or k not in again]

    def lagrangian(x: Array) -> Array:
        return np.asarray(energy(x) - push @ gaps(x))

    slopes = tool.gradient(gaps, q)
    rest = tool.gradient(energy, q) - push @ slopes
    assert np.abs(rest / scale).max() < 1e-9, "N"
    assert there.min() > -1e-9 and np.abs(push * there).max() < 1e-9
    normals = (slopes[push > 0.0] / scale).T
    tangent = np.linalg.svd(normals)[0][:, normals.shape[1] :]
    hessian = tool.hessian(lagrangian, q) / scale / scale[:, None]
    assert np.linalg.eigvalsh(tangent.T @ hessian @ tangent).min() > 1e-3, "N/mm"
    best = minimize(
        lambda z: float(energy((z / scale)[:, None])[0]),
        q * scale + np.random.default_rng(3).normal(0.0, 1e-3, len(q)),
        jac=lambda z: tool.gradient(energy, z / scale) / scale,
        constraints={
            "type": "ineq",
            "fun": lambda z: gaps((z / scale)[:, None])[apart, 0],
            "jac": lambda z: tool.gradient(gaps, z / scale)[apart] / scale,
        },
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert best.x / scale == pytest.approx(q, abs=2e-4)
    assert best.fun == pytest.approx(float(energy(q[:, None])[0]), rel=1e-9)


def test_a_body_that_nothing_keeps_leaves(reference_finger: Fingers) -> None:
    scene = gripper_of(reference_finger(5))
    squeezed_out = grasp_rows(grasped(scene, CAN, Held.FREE, "00000/00000", "11000/11000"))
    far = Disc(np.array([400.0, 0.0]), 10.0)
    untouched = grasp_rows(grasped(scene, far, Held.FREE, "00000/00000", "11000/11000"))
    fixed = grasp_rows(grasped(scene, far, Held.FIXED, "00000/00000"))
    for rows in (squeezed_out, untouched):
        assert (rows["status"] == Status.NOT_HELD).all()
        assert np.isnan(rows["squeeze_N"]).all() and np.isnan(rows["object_x_mm"]).all()
    assert fixed["status"].tolist() == [Status.STABLE] and fixed["n_contacts"].tolist() == [0]


def test_one_state_of_a_finger_meets_several_of_the_other(reference_finger: Fingers) -> None:
    """A part of one lane is not taken for the same of all."""
    scene = gripper_of(reference_finger(5))
    beside = replace(CAN, center=CAN.center + np.array([0.0, 0.5]))
    pairs = "00001/00000", "00001/00001"
    together = grasp_rows(grasped(scene, beside, Held.GUIDED, *pairs))
    alone = [grasp_rows(grasped(scene, beside, Held.GUIDED, pair)) for pair in pairs]
    assert (together["status"] == Status.STABLE).any()
    for name in ("status", "object_x_mm", "squeeze_N"):
        single = np.concatenate([rows[name] for rows in alone])
        assert together[name] == pytest.approx(single, rel=1e-9, nan_ok=True)


def test_a_guided_body_is_pushed_along_x_only(reference_finger: Fingers) -> None:
    scene = gripper_of(reference_finger(5))
    found = grasped(scene, CAN, Held.GUIDED, "00001/00000", "00001/00001")
    rows = grasp_rows(found)
    there = rows["status"] == Status.STABLE
    assert there[1]
    total = sum(
        frame.outside(f.force) for frame, f in zip(found.frames, found.fingers, strict=True)
    )
    assert np.abs(total[0, there]).max() < 1e-9, "N"
    assert (rows["object_y_mm"][there] == 0.0).all()


def test_insertion_ends_where_placing_does(reference_finger: Fingers) -> None:
    """Where no unit resets on either way there is one rest."""
    scene = gripper_of(reference_finger(5))
    grown, moved = (
        grasp_rows(grasped(scene, CAN, Held.FIXED, "00001/00001", "00011/00011", way=way))
        for way in (Way.PLACE, Way.INSERT)
    )
    assert (grown["status"] == Status.STABLE).all() and (grown["n_contacts"] > 0).all()
    assert grown["pattern_after"].tolist() == moved["pattern_after"].tolist()
    for name in ("finger_force_x_N", "finger_force_y_N", "aperture_mm"):
        assert moved[name] == pytest.approx(grown[name], rel=1e-9)


def test_a_lost_body_with_sides_does_not_end_the_others(reference_finger: Fingers) -> None:
    """Nothing keeps plates along x from sliding: no rest, and no shape to look at."""
    scene = gripper_of(reference_finger(2))
    jaws = Jaws(np.array([20.0, 0.0]), 56.0, 20.0)
    rows = grasp_rows(grasped(scene, jaws, Held.GUIDED, "01/01", "00/00"))
    assert set(rows["status"]) == {Status.NOT_HELD}


def test_faces_that_are_lost_run_into_nothing() -> None:
    square = Obstacle.polygon(np.array([[0.0, 4.0, 4.0, 0.0], [0.0, 0.0, 4.0, 4.0]]))
    through = np.array([[-1.0, 5.0], [2.0, 2.0]])
    beside = through + np.array([[0.0], [4.0]])
    nodes = np.stack((through, beside, np.full((2, 2), np.nan)), axis=2)
    assert grasp._is_entered(nodes, square).tolist() == [True, False, False]


@pytest.mark.parametrize("stiffness", [0.02, 0.5])
def test_jaws_that_give_way_balance(stiffness: float, reference_finger: Fingers) -> None:
    """k (a_0 − a) is the squeeze, and that of rigid jaws at the aperture a."""
    scene = gripper_of(reference_finger(2))
    jaws = Jaws(np.array([20.0, 0.0]), 56.0, 20.0, stiffness)
    rows = grasp_rows(grasped(scene, jaws, Held.FIXED, "01/01"))
    assert rows["status"].tolist() == [Status.STABLE]
    gap, squeeze = float(rows["jaw_gap_mm"][0]), float(rows["squeeze_N"][0])
    assert squeeze > 0.01 and squeeze == pytest.approx(stiffness * (56.0 - gap), rel=1e-9)
    rigid = grasp_rows(grasped(scene, replace(jaws, gap=gap, stiffness=None), Held.FIXED, "01/01"))
    assert rigid["squeeze_N"] == pytest.approx([squeeze], rel=1e-8)


def test_resets_before_letting_go_are_told(reference_finger: Fingers) -> None:
    """Jaws that hardly give way reset what rigid ones do, whatever else is in the table."""
    scene, rigid = gripper_of(reference_finger(5)), Jaws(np.array([40.0, 0.0]), 40.0, 40.0)
    pairs = ("01100/01100", "00000/01100", "01100/00000")
    expected = grasp_rows(grasped(scene, rigid, Held.FIXED, *pairs))["resets"]
    stiff = replace(rigid, stiffness=1e9)
    found = grasped(scene, stiff, Held.FIXED, *pairs)
    assert any(expected)
    assert grasp_rows(found)["resets"].tolist() == expected.tolist()
    upper, lower = found.fingers
    flags = np.eye(5, 2, dtype=bool)
    lanes, load, push = np.array([0, 2]), np.array([0.25, 0.5]), np.zeros((1, 2))
    one = Reset(lanes, load, flags, push, ~flags, flags & False)
    gone = replace(one, of=Load.RELEASE)
    told = replace(found, fingers=(replace(upper, resets=(one, gone)), replace(lower, resets=())))
    assert grasp_rows(told)["resets"].tolist() == [
        "1 at 0.25; 1 at 0.25 of letting go/–",
        "",
        "2 at 0.5; 2 at 0.5 of letting go/–",
    ]


@pytest.mark.parametrize("held", [Held.FIXED, Held.GUIDED])
def test_soft_fingers_touch_as_stiff_ones_do(held: Held, reference_finger: Fingers) -> None:
    """What is rounding is so beside the forces in play: all of them are 1e-12 times as large."""
    finger = reference_finger(5)
    soft = finger.changed(
        bistable_stiffness=1e-12 * finger.bistable_stiffness,
        hinge_stiffness=1e-12 * finger.hinge_stiffness,
    )
    stiff, other = (
        grasp_rows(grasped(gripper_of(own), CAN, held, "00001/00001")) for own in (finger, soft)
    )
    assert stiff["n_contacts"].tolist() == other["n_contacts"].tolist() != [0]
    assert other["squeeze_N"] == pytest.approx(1e-12 * stiff["squeeze_N"], rel=1e-9)


def test_fingers_of_a_body_that_gets_away_are_where_it_was_let_go_of(
    reference_finger: Fingers,
) -> None:
    """For pictures: as those about a body that stays."""
    scene, pairs = gripper_of(reference_finger(5)), ("00000/00000", "00001/00001")
    free, fixed = (grasped(scene, CAN, held, *pairs) for held in (Held.FREE, Held.FIXED))
    assert grasp_rows(free)["status"].tolist() == [Status.NOT_HELD, Status.STABLE]
    for finger in range(2):
        (gone, own), (stays, lane) = free.take(finger, 0), fixed.take(finger, 0)
        for at, expected in zip(gone.nodes, stays.nodes, strict=True):
            assert at[:, own] == pytest.approx(expected[:, lane], abs=1e-9)
    assert not np.allclose(free.fingers[0].face[..., 1], fixed.fingers[0].face[..., 1], atol=1e-3)
