"""`placed`: what is said of a gripper's fingers on a disc."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dpgcli.arrays import Codes
from dpgcli.design.bodies import Disc
from dpgcli.design.scene import Gripper, Scene
from dpgcli.grasping import grasp
from dpgcli.grasping.frames import FingerFrame, frames
from dpgcli.grasping.grasp import described, placed
from dpgcli.grasping.grasped import Grasped
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import Formulate, chain_potential
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of

Fingers = Callable[..., Finger]
ALONE = frames(None)[0]


def held(
    scene: Scene, formulate: Formulate, disc: Disc, frame: FingerFrame, codes: Codes
) -> Grasped:
    """Fingers at rest on a disc that does not move."""
    found = placed(scene, formulate, disc, frame, codes)
    (finger,) = described(found.own, [codes], found.grown, found.status)
    return finger


@pytest.fixture
def without_margins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Margins are looked for as far as the load itself: nowhere."""
    monkeypatch.setattr(grasp, "MARGIN_TO", 1.0)


def on_disc(
    finger: Finger, center: tuple[float, float], radius: float, patterns: list[str], **options: Any
) -> Grasped:
    inverted = np.array([[digit == "1" for digit in text] for text in patterns]).T
    scene = Scene(finger, (), layer_thickness=1.5)
    frame = options.get("frame", ALONE)
    return held(scene, chain_potential, Disc(np.array(center), radius), frame, codes_of(inverted))


@pytest.mark.usefixtures("without_margins")
def test_statuses_and_resets(reference_finger: Fingers) -> None:
    """11 lets a unit go at 0.89997 of the disc, the top of its path (test_closed_forms)."""
    found = on_disc(reference_finger(2), (20.0, -16.0), 15.0, ["11", "10", "00"])
    assert (found.status == Status.STABLE).all()
    assert found.code.tolist() == [3, 2, 0]
    assert found.after.tolist() == [1, 2, 0]
    (reset,) = found.resets
    assert reset.lanes.tolist() == [0]
    assert reset.load[0] == pytest.approx(0.8999699254279223, rel=1e-9)
    assert (found.push >= 0.0).all() and found.gap.min() >= -1e-9
    assert (found.push.max(axis=0) * np.maximum(found.gap, 0.0)).max() <= 1e-9
    assert (found.residual < 1e-9).all() and (found.error < 1e-6).all()


@pytest.mark.usefixtures("without_margins")
def test_a_state_without_a_well_stays_what_it_is(reference_finger: Fingers) -> None:
    finger = reference_finger(2, force_linearity=0.2)
    found = on_disc(finger, (20.0, -16.0), 15.0, ["11", "00"])
    assert found.status.tolist() == [Status.NOT_BISTABLE, Status.STABLE]
    assert np.isnan(found.margin[0])


def test_a_disc_out_of_reach(reference_finger: Fingers) -> None:
    found = on_disc(reference_finger(2), (20.0, -60.0), 5.0, ["11", "00"])
    assert (found.status == Status.STABLE).all()
    assert not found.push.any() and not found.force.any()
    assert (found.gap > 10.0).all()
    assert found.after.tolist() == found.code.tolist() and not found.resets


@pytest.mark.usefixtures("without_margins")
def test_forces_balance_with_the_clamp(reference_finger: Fingers) -> None:
    """The clamp's reaction by the elements at B_0 and T_0 alone: force and moment of the push."""
    finger = reference_finger(2, 1e4)
    found = on_disc(finger, (20.0, -16.0), 15.0, ["10"])
    base = np.array([found.nodes.base_x[0, 0], found.nodes.base_y[0, 0]])
    top = np.array([found.nodes.top_x[0, 0], found.nodes.top_y[0, 0]])
    height, length, k_t = 10.75, 13.5, 24.2
    chord, strut = np.hypot(*base), np.hypot(*(top - base))
    spring = top - np.array([0.0, height])
    x = np.hypot(*spring) - length
    u, beta = x / 3.5, 1.0 - 0.043
    pull = 12.84 * x * (1.0 + beta * (2.0 * u**2 - 3.0 * u)) * spring / np.hypot(*spring)
    a = -np.arctan2(base[1], base[0])
    turned = np.arctan2(-(top - base)[0], (top - base)[1])
    b = -turned - a
    assert strut == pytest.approx(height, abs=1e-2)
    along = base / chord
    shear = (
        -(2.0 * k_t * (a - b)) / chord * np.array([along[1], -along[0]])
    )  # both corners' moments
    on_finger = -(1e4 * (chord - length) * along + pull)
    normal_force = -found.force[:, 0]  # of the disc on the finger
    reaction = on_finger + shear
    assert reaction + normal_force == pytest.approx([0.0, 0.0], abs=1e-8)
    center = np.array([20.0, -16.0])
    moment_of_disc = center[0] * normal_force[1] - center[1] * normal_force[0]
    moment = height * pull[0] + 2.0 * k_t * a  # about B_0: the spring at T_0, the near corner
    assert moment + moment_of_disc == pytest.approx(0.0, abs=1e-8)


@pytest.mark.usefixtures("without_margins")
def test_mirrored_fingers_push_alike(reference_finger: Fingers) -> None:
    """A disc on the axis: the lower finger's force is the mirror image of the upper one's."""
    gripper = Gripper(base_spacing=36.0, mounting_angle=0.1)
    upper, lower = frames(gripper)
    finger = reference_finger(2)
    above, below = (
        on_disc(finger, (20.0, 0.0), 13.5, ["11", "10"], frame=frame) for frame in (upper, lower)
    )
    assert above.push.max() > 0.05
    assert (above.push == below.push).all() and (above.force == below.force).all()
    up, down = upper.outside(above.force), lower.outside(below.force)
    assert up[0] == pytest.approx(down[0]) and up[1] == pytest.approx(-down[1])
    off_axis = [
        on_disc(finger, (20.0, y), 13.5, ["11", "10"], frame=frame)
        for y, frame in ((1.0, upper), (-1.0, lower))
    ]
    assert off_axis[0].push == pytest.approx(off_axis[1].push, rel=1e-12)
    assert (off_axis[0].push != above.push).any()


def test_frames_lead_out_and_back() -> None:
    for frame in frames(Gripper(base_spacing=40.0, mounting_angle=0.3)):
        point = np.array([[12.0, 3.0], [-7.0, 2.0]])
        assert frame.inside(frame.placed(point)) == pytest.approx(point, abs=1e-13)
        turned = frame.outside(np.array([1.0, 0.0]))
        assert turned == pytest.approx([np.cos(0.3), frame.side * np.sin(0.3)])
        assert frame.placed(np.zeros(2)) == pytest.approx([0.0, 20.0 * frame.side])


def test_the_force_is_along_the_line_from_the_finger_to_the_center(
    reference_finger: Fingers,
) -> None:
    """Without friction every push goes through the middle of the disc, away from the finger."""
    found = on_disc(reference_finger(2), (20.0, -16.0), 15.0, ["10"])
    size = np.hypot(*found.force)
    assert size == pytest.approx(found.push.sum(axis=0))
    on_face = np.array([[20.0], [-16.0]]) - 15.0 * found.force / size
    sides = [found.face[:, k : k + 2, 0] for k in range(2)]
    away = [
        abs(np.cross(*(np.append(v, 0.0) for v in (s[:, 1] - s[:, 0], on_face[:, 0] - s[:, 0])))[2])
        / np.hypot(*(s[:, 1] - s[:, 0]))
        for s in sides
    ]
    assert min(away) < 1e-9
    assert found.force[1, 0] < 0.0, "the disc is below"


@pytest.mark.slow
@pytest.mark.parametrize("bars", [np.inf, 1e4])
def test_margins(bars: float, reference_finger: Fingers, grown: Callable[..., Any]) -> None:
    """A disc larger by slightly less than the margin keeps the state, by slightly more not."""
    finger, radius = reference_finger(2, bars), 13.0
    margin = float(on_disc(finger, (20.0, -16.0), radius, ["11"]).margin[0])
    assert 0.0 < margin < 0.1
    less, more = (
        grown(finger, ["11"], (20.0, -16.0), radius * (1.0 + margin + by)).came
        for by in (-1e-8, 1e-8)
    )
    assert less.shapes.is_there.all() and not less.resets
    (reset,) = more.resets
    assert reset.flipped[:, 0].tolist() == [True, False]


def test_a_finger_that_lets_go_nowhere_has_an_infinite_margin(reference_finger: Fingers) -> None:
    found = on_disc(reference_finger(2), (20.0, -60.0), 5.0, ["11"])
    assert np.isinf(found.margin[0])


def test_a_scene_without_a_thickness_is_refused(reference_finger: Fingers) -> None:
    scene = Scene(reference_finger(2), ())
    codes = np.array([0], np.uint64)
    with pytest.raises(ValueError, match="thickness"):
        held(scene, chain_potential, Disc(np.zeros(2), 1.0), ALONE, codes)


def test_a_margin_that_was_not_found_is_not_infinite(
    reference_finger: Fingers, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No reset on a way that could not be followed says nothing."""
    whole = grasp.approach

    def lost(*args: Any, to_reset: bool = False, **others: Any) -> Any:
        found = whole(*args, to_reset=to_reset, **others)
        if to_reset:
            found.shapes.is_there[0] = False
        return found

    monkeypatch.setattr(grasp, "approach", lost)
    found = on_disc(reference_finger(2), (200.0, -16.0), 5.0, ["00", "01"])
    assert found.status.tolist() == [Status.STABLE] * 2
    assert np.isnan(found.margin[0]) and found.margin[1] == np.inf


def test_margins_in_one_batch_are_those_of_their_own_paths(reference_finger: Fingers) -> None:
    """And what is told of the grasp is the same, bit for bit."""
    scene = Scene(reference_finger(4), (), None, 1.5)
    (frame,), disc = frames(None), Disc(np.array([36.0, -22.0]), np.array([16.0]))
    states = np.arange(16).astype(np.uint64)
    parts = [
        placed(scene, chain_potential, disc, frame, states, with_margins=wanted)
        for wanted in (False, True)
    ]
    alone, at_once = (
        described(part.own, [part.codes], part.grown, part.status)[0] for part in parts
    )
    assert parts[0].grown.margin is None and parts[1].grown.margin is not None
    is_finite = np.isfinite(alone.margin)
    assert is_finite.any() and np.isinf(alone.margin).any()
    assert (np.isfinite(at_once.margin) == is_finite).all()
    assert at_once.margin[is_finite] == pytest.approx(alone.margin[is_finite], abs=1e-10)
    assert (np.isinf(at_once.margin) == np.isinf(alone.margin)).all()
    for name in ("status", "after", "push", "force", "gap"):
        assert (getattr(at_once, name) == getattr(alone, name)).all()
    told = [[(r.lanes.tolist(), r.load.tolist()) for r in f.resets] for f in (alone, at_once)]
    assert sorted(lane for lanes, _ in told[0] for lane in lanes) == sorted(
        lane for lanes, _ in told[1] for lane in lanes
    )
