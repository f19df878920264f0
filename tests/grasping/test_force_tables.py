"""Jaws with a table of forces: by a stiffness, an energy of its own and SciPy, and by roots."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator
from scipy.optimize import brentq, minimize

from dpgcli.arrays import Array, Columns
from dpgcli.design.bodies import Jaws
from dpgcli.design.scene import Gripper, Held, Scene
from dpgcli.grasping import grasp
from dpgcli.grasping.frames import frames
from dpgcli.grasping.jaws import jaw_path
from dpgcli.grasping.table import grasp_rows, grasps
from dpgcli.mechanics.aperture import ForceCurve
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of

Fingers = Callable[..., Finger]
SPACING, THICKNESS = 30.0, 1.5  # mm
JAWS = Jaws(np.array([20.0, 0.0]), 28.0, 20.0)


@pytest.fixture(autouse=True)
def without_margins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Margins are looked for as far as the load itself: nowhere."""
    monkeypatch.setattr(grasp, "MARGIN_TO", 1.0)


def scene_of(finger: Finger) -> Scene:
    return Scene(finger, (), Gripper(base_spacing=SPACING, mounting_angle=0.0), THICKNESS)


def rows_of(finger: Finger, jaws: Jaws, pattern: str = "01", held: Held = Held.FIXED) -> Columns:
    codes = codes_of(np.array([[digit == "1"] for digit in pattern]))
    scene = replace(scene_of(finger), body=jaws, held=held)
    return grasp_rows(grasps(scene, chain_potential, jaws, (codes, codes)))


def curve(*points: tuple[float, float]) -> ForceCurve:
    return ForceCurve(*np.array(points).T)


@pytest.mark.parametrize("bars", [np.inf, 1e3])
def test_a_straight_table_is_a_stiffness(bars: float, reference_finger: Fingers) -> None:
    finger = reference_finger(2, bars)
    line = curve((20.0, 0.4), (23.0, 0.25), (28.0, 0.0))
    table, spring = (
        rows_of(finger, replace(JAWS, **own)) for own in ({"curve": line}, {"stiffness": 0.05})
    )
    assert table["status"].tolist() == [Status.STABLE]
    for name in ("jaw_gap_mm", "squeeze_N", "finger_force_x_N"):
        assert table[name] == pytest.approx(spring[name], rel=1e-10)


def test_the_energy_of_a_table_is_least(reference_finger: Fingers, own: Callable[..., Any]) -> None:
    """2 E(q) − ∫F da with the face's last node on the plate, by SciPy; it pushes there."""
    finger, points = reference_finger(2), ((13.0, 1.4), (14.0, 1.0), (15.5, 0.8), (17.0, 0.0))
    rows = rows_of(finger, replace(JAWS, gap=15.5, curve=curve(*points)), "11")
    assert rows["status"].tolist() == [Status.STABLE] and rows["pattern_after"].tolist() == ["11"]
    tool = own(finger, np.ones(2, bool), THICKNESS, (0.0, 0.0), 1.0)
    force = PchipInterpolator(*np.array(points).T)

    def end(q: Array) -> Array:
        return np.asarray(tool.nodes(q)[2][-1].y)

    def gap(q: Array) -> float:
        return float(SPACING + 2.0 * end(q[:, None])[0])

    def energy(q: Array) -> float:
        of_jaws, _ = quad(force, gap(q), 17.0)
        return float(2.0 * tool.energy(q[:, None])[0] + of_jaws)

    def slope(q: Array) -> Array:
        return 2.0 * (tool.gradient(tool.energy, q) - force(gap(q)) * tool.gradient(end, q))

    def bend(q: Array) -> Array:
        steps = 1e-5 * np.eye(4)
        return np.array([(slope(q + step) - slope(q - step)) / 2e-5 for step in steps])

    near = {"initial_trust_radius": 0.01, "max_trust_radius": 0.02, "gtol": 1e-9}  # no other well
    start = np.full(4, 0.16)
    best = minimize(energy, start, jac=slope, hess=bend, method="trust-exact", options=near)
    assert np.abs(slope(best.x)).max() < 1e-6, "N mm"
    assert rows["jaw_gap_mm"][0] == pytest.approx(gap(best.x), abs=1e-6)
    assert rows["squeeze_N"][0] == pytest.approx(float(force(gap(best.x))), abs=1e-6) != 0.0


VALLEY = (23.0, 0.4), (25.0, 0.3), (26.0, 0.02)
ONE_REST = (*VALLEY, (27.0, 0.25), (28.0, 0.0))
TWO_RESTS = (*VALLEY, (27.0, 0.35), (28.0, 0.0))


@pytest.mark.parametrize(
    ("points", "n_roots", "ends"),
    [(ONE_REST, 1, {28.0: 0, 25.0: 0}), (TWO_RESTS, 3, {28.0: 0, 27.0: 0, 26.0: 2})],
)
def test_jaws_that_soften_come_to_the_next_rest_on_their_way(
    points: Any, n_roots: int, ends: dict[float, int], reference_finger: Fingers
) -> None:
    """S − F falls to zero as they close: beyond a fold they jump, past what is no rest.

    S is the squeeze of rigid jaws; roots are from wide to narrow, every second one no minimum.
    """
    finger = reference_finger(2)
    scene = scene_of(finger)
    seen, codes = frames(scene.gripper)[0], codes_of(np.array([[False], [True]]))
    path = jaw_path(scene, chain_potential, JAWS, seen, codes, (23.0, 28.0), 20)
    turn = len(path.gap) // 2 + 1
    assert not path.halts
    squeeze = CubicHermiteSpline(path.gap[:turn], path.squeeze[:turn, 0], path.stiffness[:turn, 0])
    force = PchipInterpolator(*np.array(points).T)
    at = np.linspace(28.0, 23.0, 2001)
    left = squeeze(at) - force(at)
    (places,) = np.nonzero(np.sign(left[:-1]) != np.sign(left[1:]))
    assert len(places) == n_roots
    roots = [brentq(lambda a: squeeze(a) - force(a), at[k + 1], at[k]) for k in places]
    for gap, which in ends.items():
        rows = rows_of(finger, replace(JAWS, gap=gap, curve=curve(*points)))
        assert rows["status"].tolist() == [Status.STABLE]
        assert rows["jaw_gap_mm"][0] == pytest.approx(roots[which], abs=2e-6), gap
        assert rows["squeeze_N"][0] == pytest.approx(float(force(rows["jaw_gap_mm"][0])), rel=1e-9)


def test_jaws_that_come_to_rest_beyond_their_table_say_so(reference_finger: Fingers) -> None:
    narrow = curve((27.0, 0.01), (28.0, 0.0))
    rows = rows_of(reference_finger(2), replace(JAWS, curve=narrow))
    assert rows["status"].tolist() == [Status.BEYOND_TABLE]
    assert np.isnan(rows["squeeze_N"][0]) and np.isnan(rows["jaw_gap_mm"][0])


def test_jaws_that_nothing_touches_rest_where_they_have_no_force(reference_finger: Fingers) -> None:
    """They need not begin there."""
    table = curve((10.0, 0.5), (16.0, 0.1), (20.0, -0.3))
    rows = rows_of(reference_finger(2), replace(JAWS, gap=15.0, curve=table), "00")
    assert rows["status"].tolist() == [Status.STABLE] and rows["n_contacts"].tolist() == [0]
    expected = brentq(PchipInterpolator(table.gap, table.force), 16.0, 20.0)
    assert rows["jaw_gap_mm"] == pytest.approx([expected], rel=1e-9)
