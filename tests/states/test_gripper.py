"""Two mirrored fingers, against a polygon computation of our own."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.design.scene import Gripper, Scene
from dpgcli.mechanics.finger import Finger
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict

Fingers = Callable[..., Finger]
Point = tuple[float, float]
LAYER = 1.5


def outline(rows: dict[str, Array], state: int, finger: str, n: int) -> list[Point]:
    """The face, half a layer inside the B nodes along each strut, and back along the T nodes."""
    face, top = [], []
    for i in range(n + 1):
        b, t = (
            np.array([rows[f"{finger}_{node}{i}_{axis}_mm"][state] for axis in "xy"])
            for node in "BT"
        )
        inward = (b - t) / np.linalg.norm(b - t)
        face.append(tuple(b + 0.5 * LAYER * inward))
        top.append(tuple(t))
    return face + top[::-1]


def crosses(p: Point, q: Point, r: Point, s: Point) -> bool:
    """Whether the segments pq and rs cross properly."""

    def side(a: Point, b: Point, c: Point) -> float:
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    return side(p, q, r) * side(p, q, s) < 0 and side(r, s, p) * side(r, s, q) < 0


def polygons_cross(first: list[Point], second: list[Point]) -> bool:
    edges = [list(zip(p, p[1:] + p[:1], strict=True)) for p in (first, second)]
    return any(crosses(*a, *b) for a in edges[0] for b in edges[1])


@pytest.mark.parametrize("spacing", [10.0, 40.0, 70.0])
@pytest.mark.parametrize("tilt", [-0.2, 0.0, 0.35])
def test_overlap_and_aperture_are_those_of_the_polygons(
    reference_finger: Fingers, spacing: float, tilt: float
) -> None:
    n = 5
    scene = Scene(reference_finger(n, 1e4), (), Gripper(spacing, tilt), LAYER)
    rows = predict(scene, Request(columns=("all",))).arrays()
    for state in range(2**n):
        upper, lower = (outline(rows, state, finger, n) for finger in ("upper", "lower"))
        # the outlines are mirror images: they cross, but for symmetry, at points of y = 0
        shifted = [(x + 1e-7, y) for x, y in lower]
        assert rows["fingers_overlap"][state] == polygons_cross(upper, shifted)
        assert rows["aperture_mm"][state] == pytest.approx(upper[n][1] - lower[n][1], abs=1e-11)


def test_the_mounting_angle_turns_the_finger_outward(reference_finger: Fingers) -> None:
    finger = reference_finger(3)
    free = predict(Scene(finger, ()), Request(("000",))).arrays()
    assert free["tip_y_mm"].tolist() == [0.0]
    scene = Scene(finger, (), Gripper(20.0, np.radians(30.0)), LAYER)
    rows = predict(scene, Request(("000",), ("all",))).arrays()
    assert rows["upper_tip_x_mm"] == pytest.approx(40.5 * np.cos(np.pi / 6), rel=1e-14)
    assert rows["upper_tip_y_mm"] == pytest.approx(10.0 + 40.5 / 2, rel=1e-14)
    assert rows["lower_tip_y_mm"] == pytest.approx(-10.0 - 40.5 / 2, rel=1e-14)
    assert rows["upper_T0_y_mm"] == pytest.approx(10.0 + 10.75 * np.cos(np.pi / 6), rel=1e-14)
    expected = 2 * (10.0 + 40.5 / 2 - 0.75 * np.cos(np.pi / 6))
    assert rows["aperture_mm"] == pytest.approx(expected, rel=1e-14)
    assert rows["fingers_overlap"].tolist() == [False]


def test_the_layer_takes_its_thickness_from_the_aperture(reference_finger: Fingers) -> None:
    finger, gripper = reference_finger(3), Gripper(20.0, 0.0)
    thin, thick = (
        predict(Scene(finger, (), gripper, t), Request(("000",))).arrays()["aperture_mm"]
        for t in (0.0, 1.5)
    )
    assert thin.tolist() == [20.0]
    assert thick.tolist() == [18.5]


def test_a_fallen_state_overlaps_with_nothing(reference_finger: Fingers) -> None:
    with np.errstate(invalid="ignore"):
        finger = reference_finger(3, force_linearity=0.12)
        scene = Scene(finger, (), Gripper(1.0, -0.5), LAYER)
        rows = predict(scene, Request(("000", "111"))).arrays()
    assert rows["status"].tolist() == ["stable", "not_bistable"]
    assert rows["fingers_overlap"].tolist() == [True, False]
    assert np.isnan(rows["aperture_mm"]).tolist() == [False, True]
