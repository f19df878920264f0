"""Jaws that open and close: slopes, work against energy, a closed form, and a linear mechanism."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import root

from dpgcli.arrays import Array, Flags
from dpgcli.design.bodies import Jaws
from dpgcli.design.scene import Gripper, Scene
from dpgcli.grasping import jaws
from dpgcli.grasping.contact import Obstructed
from dpgcli.grasping.frames import frames
from dpgcli.grasping.jaw_table import by_number, jaw_rows, path_rows
from dpgcli.grasping.jaws import JawPath, jaw_path
from dpgcli.grasping.mechanism import Branch, Mechanism
from dpgcli.grasping.shapes import ContactShapes
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.laws import PUBLISHED, PushOnly
from dpgcli.mechanics.obstacle import Obstacle
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
SPACING, THICKNESS = 30.0, 1.5  # mm


def on_jaws(
    finger: Finger,
    gaps: tuple[float, float],
    at: float,
    *patterns: str,
    n_steps: int = 8,
    height: float = 20.0,
    scale: float = 1.0,
) -> JawPath:
    gripper = Gripper(base_spacing=scale * SPACING, mounting_angle=0.0)
    scene = Scene(finger, (), gripper, scale * THICKNESS)
    codes = codes_of(np.array([[digit == "1" for digit in text] for text in patterns]).T)
    body = Jaws(np.array([at, 0.0]), gaps[1], scale * height)
    upper = frames(scene.gripper)[0]
    return jaw_path(scene, chain_potential, body, upper, codes, gaps, n_steps)


@pytest.mark.parametrize(("pattern", "first"), [("01", 25.0), ("11", 15.0)])
@pytest.mark.parametrize("bars", [np.inf, 1e3])
def test_stiffness_is_the_slope_of_the_squeeze(
    bars: float, pattern: str, first: float, reference_finger: Fingers
) -> None:
    """By Hermite's cubic of every second step, at the steps between."""
    path = on_jaws(reference_finger(2, bars), (first, first + 1.0), 20.0, pattern)
    assert (path.status == Status.STABLE).all() and not path.halts
    gap, squeeze = path.gap[:9], path.squeeze[:9, 0]
    assert (squeeze > 0.01).all(), "N: it is pressed everywhere"
    cubic = CubicHermiteSpline(gap[::2], squeeze[::2], path.stiffness[:9:2, 0])
    assert cubic(gap[1::2]) == pytest.approx(squeeze[1::2], rel=1e-6)
    assert path.squeeze[::-1] == pytest.approx(path.squeeze, rel=1e-9), "and back again"


@pytest.mark.parametrize("bars", [np.inf, 1e3])
def test_the_end_of_a_face_on_a_plate(
    bars: float, reference_finger: Fingers, own: Callable[..., Any]
) -> None:
    """∇E = N ∇y with y that of the face's last node, by an energy of its own and SciPy's root."""
    finger = reference_finger(2, bars)
    path = on_jaws(finger, (15.0, 16.0), 20.0, "11", n_steps=4)
    assert (path.status == Status.STABLE).all()
    tool = own(finger, np.ones(2, bool), THICKNESS, (0.0, 0.0), 1.0)

    def end(q: Array) -> Array:
        return np.asarray(tool.nodes(q)[2][-1].y)

    q = np.zeros(4 if np.isinf(bars) else 8)
    q[[0, 1, 2, 3] if np.isinf(bars) else [1, 2, 5, 6]] = 0.16
    for gap, squeeze in zip(path.gap, path.squeeze[:, 0], strict=True):
        place = 0.5 * (gap - SPACING)

        def unbalance(z: Array, place: float = place) -> Array:
            slope = tool.gradient(tool.energy, z[:-1]) - z[-1] * tool.gradient(end, z[:-1])
            return np.append(slope, end(z[:-1, None])[0] - place)

        found = root(unbalance, np.append(q, 0.1), tol=1e-13)
        assert np.abs(found.fun).max() < 1e-9
        assert squeeze == pytest.approx(found.x[-1], rel=1e-8)
        q = found.x[:-1]


def test_a_unit_resets_at_a_fold(reference_finger: Fingers) -> None:
    """The squeeze is largest before it, whatever the steps."""
    finger = reference_finger(2)
    few, many = (on_jaws(finger, (16.0, 26.0), 20.0, "11", n_steps=n) for n in (6, 13))
    assert few.halts and len(few.halts) == len(many.halts)
    for one, other in zip(few.halts, many.halts, strict=True):
        assert one.gap == pytest.approx(other.gap, rel=1e-9)
        assert one.squeeze == pytest.approx(other.squeeze, rel=1e-5)
        assert one.flipped.tolist() == other.flipped.tolist()
    rows = jaw_rows(few, 2)
    assert rows["resets"][0].endswith("mm")
    assert rows["largest_squeeze_N"][0] >= few.halts[0].squeeze > 0.0


def test_states_that_are_others_at_the_beginning_say_so(reference_finger: Fingers) -> None:
    path = on_jaws(reference_finger(2), (29.0, 30.0), 20.0, "11", "00", n_steps=2)
    rows = jaw_rows(path, 2)
    assert rows["status"][0] == Status.ANOTHER_PATTERN and np.isnan(rows["largest_squeeze_N"][0])
    assert [borne.n_inverted for borne in by_number(rows)] in ([], [0])


def test_a_way_ends_where_a_finger_has_folded(reference_finger: Fingers) -> None:
    """The shape is an equilibrium with a positive curvature: only its corners tell."""
    path = on_jaws(reference_finger(2), (30.0, 70.0), 15.0, "00", height=10.0)
    assert path.status[:7, 0].tolist() == [Status.STABLE] * 7
    assert (path.status[7:, 0] == Status.FOLDED).all(), "and does not come back"
    assert np.isnan(path.squeeze[7:]).all() and not np.isnan(path.squeeze[:7]).any()
    rows = jaw_rows(path, 2)
    assert rows["ended_by"].tolist() == ["folded"] and rows["lost_mm"][0] == path.gap[7]
    (borne,) = by_number(rows)
    assert borne.at_least.tolist() == [np.nanmax(path.squeeze)] and not len(borne.exactly)


@pytest.mark.parametrize(
    ("reason", "word"), [(Status.MARGINAL, "marginal"), (Status.NOT_CONVERGED, "not_converged")]
)
def test_every_aperture_is_certified(
    reason: Status, word: str, monkeypatch: pytest.MonkeyPatch, reference_finger: Fingers
) -> None:
    """What certification finds at one of them ends the way."""
    found = jaws.judged

    def wrong(own: Any, came: Any, status: Any) -> Any:
        there, settled, known = found(own, came, status)
        return there, settled, np.where(came.load == 0.5, np.uint8(reason), known)

    monkeypatch.setattr(jaws, "judged", wrong)
    path = on_jaws(reference_finger(2), (15.0, 16.0), 20.0, "11", n_steps=4)
    rows = jaw_rows(path, 2)
    assert path.status[:, 0].tolist() == [Status.STABLE] * 2 + [reason] * 7
    assert rows["ended_by"].tolist() == [word] and rows["lost_mm"].tolist() == [15.5]
    assert rows["status"].tolist() == [Status.STABLE], "at the first aperture"
    assert rows["largest_at_mm"].tolist() == [15.25]


def test_no_reset_is_told_of_a_folded_finger(
    monkeypatch: pytest.MonkeyPatch, reference_finger: Fingers
) -> None:
    """Between two apertures as well, where certification does not look."""

    def folded(own: Obstructed, shapes: ContactShapes) -> Flags:
        return np.ones(shapes.coordinates.shape[1], bool)

    monkeypatch.setattr(Obstructed, "are_folded", folded)
    path = on_jaws(reference_finger(2), (16.0, 26.0), 20.0, "11", n_steps=2)
    assert not path.halts and path.status[1:].tolist() == [[Status.NOT_CONVERGED]] * 4


def test_searches_that_are_lost_say_where(reference_finger: Fingers) -> None:
    """Jaws that come up behind the end of a finger: it has no front that they could meet."""
    path = on_jaws(reference_finger(2), (10.0, 40.0), 32.0, "00", "10", height=8.0)
    rows = jaw_rows(path, 2)
    assert rows["ended_by"].tolist() == ["last_aperture", "not_converged"]
    assert np.isnan(rows["touch_mm"]).all() and np.isnan(rows["largest_squeeze_N"]).all()
    assert rows["lost_mm"].tolist() == pytest.approx([np.nan, 32.5], nan_ok=True)
    assert path_rows(path, 2)["pattern_now"][17:].tolist() == ["10"] * 6 + [""] * 11


@pytest.mark.slow
def test_what_is_lost_after_a_reset_is_told_beside_it(reference_finger: Fingers) -> None:
    path = on_jaws(reference_finger(2), (26.0, 60.0), 14.0, "00", "10")
    rows = jaw_rows(path, 2)
    assert rows["ended_by"].tolist() == ["folded", "reset"]
    assert (rows["lost_mm"] == 55.75).all()
    least, exact = by_number(rows)
    assert len(least.at_least) == 1 and not len(least.exactly)
    assert exact.exactly.tolist() == [rows["largest_squeeze_N"][1]] and not len(exact.at_least)


def test_a_touch_is_where_it_is_in_a_world_of_any_size(reference_finger: Fingers) -> None:
    """Lengths a ten-thousandth, elastic moduli the same: forces to the power of two."""
    large, small = (
        scaled_path(reference_finger(2), scale, (15.0, 25.0), 20.0, "01") for scale in (1.0, 1e-4)
    )
    one, other = (jaw_rows(path, 2) for path in (large, small))
    assert one["touch_mm"][0] > 15.0 and other["touch_mm"] == pytest.approx(1e-4 * one["touch_mm"])
    assert other["largest_squeeze_N"] == pytest.approx(1e-8 * one["largest_squeeze_N"])


def scaled_path(
    finger: Finger, scale: float, gaps: tuple[float, float], at: float, *patterns: str
) -> JawPath:
    lengths = "segment_length", "segment_height", "stroke", "bistable_stiffness"
    values = {name: scale * getattr(finger, name) for name in lengths}
    values["hinge_stiffness"] = scale**3 * finger.hinge_stiffness
    first, last = (scale * gap for gap in gaps)
    return on_jaws(finger.changed(**values), (first, last), scale * at, *patterns, scale=scale)


def test_rows_of_a_path(reference_finger: Fingers) -> None:
    path = on_jaws(reference_finger(2), (16.0, 17.0), 20.0, "01", "11", n_steps=3)
    rows = path_rows(path, 2)
    assert rows["pattern"].tolist() == ["01"] * 7 + ["11"] * 7
    assert rows["step"].tolist() == [*range(7), *range(7)]
    out = 16.0 + np.arange(4) / 3.0
    assert rows["jaw_gap_mm"][:7] == pytest.approx([*out, *out[2::-1]])
    assert rows["squeeze_N"][7:] == pytest.approx(path.squeeze[:, 1])


def linear(offset: float, slope: float) -> Branch:
    gap = np.array([10.0, 15.0, 20.0])
    return Branch(gap, slope * (gap - offset), np.full(3, slope))


def test_a_mechanism_that_is_fitted_to_one_state_predicts_another() -> None:
    """Lines: 0.1 (a − 8) = 0.5 N at 13 mm, k = 0.5/(21 − 13); 0.2 (a − 11) = k (21 − a)."""
    mechanism = Mechanism.fitted(linear(8.0, 0.1), 21.0, 0.5)
    assert mechanism is not None and mechanism.stiffness == pytest.approx(0.0625, rel=1e-9)
    gap = (0.2 * 11.0 + 0.0625 * 21.0) / 0.2625
    assert mechanism.force(linear(11.0, 0.2)) == pytest.approx(0.0625 * (21.0 - gap), rel=1e-9)
    assert Mechanism.fitted(linear(8.0, 0.1), 12.0, 0.5) is None, "at rest before"
    assert Mechanism.fitted(linear(8.0, 0.1), 21.0, 5.0) is None, "never so much"
    assert mechanism.force(linear(30.0, 0.2)) is None


def test_branches_go_by_rising_apertures(reference_finger: Fingers) -> None:
    out, back = (
        on_jaws(reference_finger(2), gaps, 20.0, "01", n_steps=4)
        for gaps in ((26.0, 27.0), (27.0, 26.0))
    )
    one, other = Branch.of(out, 0), Branch.of(back, 0)
    assert (np.diff(one.gap) > 0.0).all() and (np.diff(other.gap) > 0.0).all()
    assert other.squeeze == pytest.approx(one.squeeze, rel=1e-9)
    assert other.stiffness == pytest.approx(one.stiffness, rel=1e-6)


def test_a_gap_that_is_wide_without_a_dome_is_no_inverted_unit(reference_finger: Fingers) -> None:
    """Domes that only push: the ground unit's hinge alone opens its gap, past the barrier."""
    finger = replace(reference_finger(2), law=PushOnly(PUBLISHED))
    units = UnitSolutions.of(finger)
    body = Obstacle.disc(np.array([100.0, 0.0]), 1.0)
    own = Obstructed(units, chain_potential, np.array([[THICKNESS]]), (body,), np.zeros(1))
    wide = np.array([[0.17], [0.17], [0.17], [0.17]])
    inverted, nothing = np.array([[True], [False]]), np.zeros((own.n_gaps, 1))
    shapes = ContactShapes(wide, nothing, nothing > 0.0, inverted, np.ones(1, bool))
    assert own.is_open(shapes)[:, 0].tolist() == [True, False]
