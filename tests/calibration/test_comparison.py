"""Predicted states beside known ones."""

import tracemalloc
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dpgcli.calibration.comparison import compare, distances
from dpgcli.calibration.known import Frame, KnownStates, lattice_states
from dpgcli.design.scene import Scene
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.laws import PUBLISHED, DomeLaw, PushOnly
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict

Fingers = Callable[..., Finger]
ALL = np.array([[0, 0, 1, 1], [0, 1, 0, 1]], bool)


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
    found = compare(finger, KnownStates.of_tips(ALL, tips, angle), Frame((7.0, -2.0), (5.0, -1.0)))
    assert found.distance.max() < 1e-12
    assert found.tip_angle.max() < 1e-14
    assert found.deflection[0] == pytest.approx(0.0, abs=1e-12)
    assert np.isnan(found.relative[0]), "the straight finger has no deflection to compare with"
    assert found.relative[1:].max() < 1e-12


def test_errors_are_those_that_were_made(reference_finger: Fingers) -> None:
    finger = reference_finger(2, 1e4)
    rows = predict(Scene(finger, ())).arrays()
    tips = np.stack((rows["tip_x_mm"] + 3e-2, rows["tip_y_mm"] - 4e-2))
    found = compare(finger, KnownStates.of_tips(ALL, tips, rows["tip_angle_rad"] + 0.1), Frame())
    assert found.distance == pytest.approx(np.full(4, 5e-2))
    assert found.tip_angle == pytest.approx(np.full(4, 0.1))
    straight = np.hypot(tips[0, 3] - 27.0, tips[1, 3])
    assert found.relative[3] == pytest.approx(5e-2 / straight)


def test_states_that_the_lattice_does_not_have(reference_finger: Fingers) -> None:
    finger = reference_finger(2, 1e4, force_linearity=0.5)
    found = compare(finger, KnownStates.of_tips(ALL, np.zeros((2, 4))), Frame())
    assert np.isfinite(found.distance).tolist() == [True, False, False, False]
    assert np.isnan(found.tip_angle).all()


def test_openings_pushes_and_phalanges_beside_themselves(reference_finger: Fingers) -> None:
    finger = reference_finger(3, 1e4)
    patterns = np.array([[1, 0], [0, 1], [1, 1]], bool)
    own = lattice_states(finger, patterns, Frame())
    known = KnownStates(
        patterns,
        own.tip,
        own.angles + 0.01,
        own.openings - 0.02,
        own.pushes + 0.03,
        own.pose[0],
        np.zeros(2),
    )
    found = compare(finger, known, Frame())
    assert found.angle == pytest.approx(np.full(2, 0.01))
    assert found.opening == pytest.approx(np.full(2, 0.02))
    assert found.push == pytest.approx(np.full(2, 0.03))
    inverted = own.pushes[patterns]
    assert (inverted > 0.5).all(), "inverted domes push"
    assert np.abs(own.pushes[~patterns]).max() < 1e-9


def test_pushes_hold_the_hinges(reference_finger: Fingers) -> None:
    """By moments about the hinge: push times lever H cos(phi/2) is k_theta phi, bars rigid."""
    own = lattice_states(reference_finger(1), np.array([[True]]), Frame())
    turn = -float(own.angles[0, 0])
    assert float(own.pushes[0, 0]) * 10.75 * np.cos(0.5 * turn) == pytest.approx(24.2 * turn)


def test_shapes_are_held_against_the_layer(reference_finger: Fingers) -> None:
    """The layer's lower face, 0.75 mm from the stations, from the clamp to the tip."""
    finger = reference_finger(3, 1e4)
    patterns = np.array([[1], [0], [1]], bool)
    frame = Frame((5.0, 0.75), (6.0, -0.75))
    own = lattice_states(finger, patterns, frame)
    corners = own.layer[:, :, 0]
    assert corners[:, 0] == pytest.approx([5.0, 0.0])
    assert corners[:, -1] == pytest.approx(own.tip[:, 0])
    between = 0.5 * (corners[:, 1:] + corners[:, :-1])
    shape = np.concatenate((np.array([[0.0], [0.0]]), between), axis=1)
    known = replace(KnownStates.of_tips(patterns, own.tip), shapes=(shape,))
    assert compare(finger, known, frame).shape.max() < 1e-13
    shifted = replace(known, shapes=(shape + np.array([[0.0], [0.3]]),))
    largest, rms = compare(finger, shifted, frame).shape[:, 0]
    assert largest == pytest.approx(0.3)
    assert 0.2 < rms < 0.3


def test_a_shape_of_many_points_takes_the_memory_of_some(reference_finger: Fingers) -> None:
    finger, patterns = reference_finger(40, 1e4), np.zeros((40, 1), bool)
    patterns[:3] = True  # all of them would run it into itself
    own = lattice_states(finger, patterns, Frame())
    shape = np.repeat(own.layer[:, :, 0], 5000, axis=1)
    known = replace(KnownStates.of_tips(patterns, own.tip), shapes=(shape,))
    tracemalloc.start()
    assert compare(finger, known, Frame()).shape.max() < 1e-12
    (_, most) = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert shape.shape[1] == 210_000
    assert most < 20 * shape.nbytes


def test_distances_are_those_of_an_independent_search() -> None:
    random = np.random.default_rng(4)
    line, points = (
        np.cumsum(random.normal(1.0, 0.5, (2, 6)), axis=1),
        random.normal(3.0, 2.0, (2, 40)),
    )
    shares = np.linspace(0.0, 1.0, 20_001)
    dense = [
        a[:, None] + shares * (b - a)[:, None] for a, b in zip(line.T, line.T[1:], strict=False)
    ]
    every = np.concatenate(dense, axis=1)
    nearest = [np.hypot(*(every - point[:, None])).min() for point in points.T]
    assert distances(points, line) == pytest.approx(nearest, abs=1e-3)


def test_lattice_states_are_those_of_predict(reference_finger: Fingers) -> None:
    finger = reference_finger(2, 1e4)
    rows = predict(Scene(finger, ())).arrays()
    own = lattice_states(finger, ALL, Frame())
    assert np.array_equal(own.pose[0], rows["tip_x_mm"])
    assert np.array_equal(own.angles[-1], rows["tip_angle_rad"])
    assert np.array_equal(own.openings[1], rows["opening_2_mm"])


@pytest.mark.parametrize("law", [PUBLISHED, PushOnly(PUBLISHED)], ids=lambda law: law.description)
def test_openings_of_predict_and_of_comparisons_are_alike_beside_walls(
    reference_finger: Fingers, law: DomeLaw
) -> None:
    """What is measured at the dome's axis: the lattice's opening and what the wall yields."""
    compliance = 0.5
    finger = reference_finger(2, 1e4).changed(wall_compliance=np.full((2, 1), compliance))
    finger = replace(finger, law=law)
    rows = predict(Scene(finger, ()), Request(columns=("openings", "nodes"))).arrays()
    own = lattice_states(finger, ALL, Frame())
    assert np.isfinite(own.openings).all()
    for unit in (1, 2):
        opening = rows[f"opening_{unit}_mm"]
        assert np.array_equal(own.openings[unit - 1], opening)
        apart = np.hypot(
            *(rows[f"T{unit}_{axis}_mm"] - rows[f"T{unit - 1}_{axis}_mm"] for axis in "xy")
        )
        yielded = opening - (apart - finger.segment_length[0, 0])
        assert yielded == pytest.approx(compliance * own.pushes[unit - 1], abs=1e-9)
    assert np.abs(own.pushes).max() > 0.1
