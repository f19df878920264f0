"""Predicted states beside known ones."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.accuracy.comparison import Frame, KnownTips, compare
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.scene import Scene
from dpgcli.states.predict import predict

Fingers = Callable[..., Finger]
ALL = np.array([[0, 0, 1, 1], [0, 1, 0, 1]], bool)
NONE = np.full(4, np.nan)


def turned(x: float, y: float, angle: float) -> np.ndarray:
    return np.array([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)])


def test_a_finger_beside_itself_in_a_frame_of_the_datas_own(reference_finger: Fingers) -> None:
    """The data's tip lies 5 mm beyond the last station and 1 mm to its right."""
    finger = reference_finger(2, 1e4)
    rows = predict(Scene(finger, ())).arrays()
    angle = rows["tip_angle_rad"]
    tips = np.stack(
        [
            np.array([7.0 + x, -2.0 + y]) + turned(5.0, -1.0, a)
            for x, y, a in zip(rows["tip_x_mm"], rows["tip_y_mm"], angle, strict=True)
        ],
        axis=1,
    )
    found = compare(finger, KnownTips(ALL, tips, angle, NONE), Frame((7.0, -2.0), (5.0, -1.0)))
    assert found.distance.max() < 1e-12
    assert found.angle.max() < 1e-14
    assert found.deflection[0] == pytest.approx(0.0, abs=1e-12)
    assert np.isnan(found.relative[0]), "the straight finger has no deflection to compare with"
    assert found.relative[1:].max() < 1e-12


def test_errors_are_those_that_were_made(reference_finger: Fingers) -> None:
    finger = reference_finger(2, 1e4)
    rows = predict(Scene(finger, ())).arrays()
    tips = np.stack((rows["tip_x_mm"] + 3e-2, rows["tip_y_mm"] - 4e-2))
    found = compare(finger, KnownTips(ALL, tips, rows["tip_angle_rad"] + 0.1, NONE), Frame())
    assert found.distance == pytest.approx(np.full(4, 5e-2))
    assert found.angle == pytest.approx(np.full(4, 0.1))
    straight = np.hypot(tips[0, 3] - 27.0, tips[1, 3])
    assert found.relative[3] == pytest.approx(5e-2 / straight)


def test_states_that_the_lattice_does_not_have(reference_finger: Fingers) -> None:
    finger = reference_finger(2, 1e4, force_linearity=0.5)
    found = compare(finger, KnownTips(ALL, np.zeros((2, 4)), NONE, NONE), Frame())
    assert np.isfinite(found.distance).tolist() == [True, False, False, False]
    assert np.isnan(found.angle).all()
