"""Shapes composed of units: those of finger and lattice, and where they are refused."""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dpgcli.mechanics.finger import Finger
from dpgcli.reports.explorer.poses import (
    StateTips,
    UnitPoses,
    are_composed,
    composed,
    deviation,
    unit_poses,
)

N_UNITS = 4
RANDOM = np.random.default_rng(5)
LENGTH = RANDOM.uniform(10.0, 15.0, (3, N_UNITS))
OFFSET = LENGTH + RANDOM.uniform(-2.0, 2.0, (3, N_UNITS)) * np.exp(1j)
TURN = RANDOM.uniform(-0.4, -0.1, (3, N_UNITS))
ENERGY = RANDOM.uniform(1.0, 4.0, (3, N_UNITS))
POSES = UnitPoses(LENGTH, OFFSET, TURN, ENERGY, np.full((3, 1), 0.5))


def tips() -> StateTips:
    """The same by matrices of motions, state by state."""
    found = np.empty((3, 2**N_UNITS, 3), complex)
    for design, (code, pattern) in itertools.product(
        range(3), enumerate(itertools.product((0, 1), repeat=N_UNITS))
    ):
        motion, angle, energy = np.eye(2, dtype=complex), 0.0, 0.5
        for unit, is_inverted in enumerate(pattern):
            turn = TURN[design, unit] if is_inverted else 0.0
            step = OFFSET[design, unit] if is_inverted else LENGTH[design, unit]
            motion = motion @ np.array([[np.exp(1j * turn), step], [0.0, 1.0]])
            angle += turn
            energy += ENERGY[design, unit] * is_inverted
        found[design, code] = motion[0, 1], angle, energy
    return StateTips(found[..., 0], found[..., 1].real, found[..., 2].real)


def test_poses_are_those_that_made_the_tips() -> None:
    found = unit_poses(tips(), LENGTH)
    for one, other in zip(found, POSES, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)
    for one, other in zip(composed(found), tips(), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "by"), [("tip", 0.1), ("tip", 0.1j), ("angle", 2e-3), ("energy", -0.05)]
)
def test_one_state_that_is_another_is_seen(name: str, by: complex) -> None:
    """In a state of two inverted units of the second design, by each number alone."""
    known = tips()
    getattr(known, name)[1, 0b0101] += by
    poses = unit_poses(known, LENGTH)
    off = deviation(poses, known)
    assert are_composed(poses, known, off).tolist() == [True, False, True]
    assert getattr(off, name)[1] == pytest.approx(abs(by))


def test_states_that_are_not_stable_are_not_compared() -> None:
    known = tips()
    for values in known:
        values[1, 0b0101] = np.nan
    poses = unit_poses(known, LENGTH)
    assert are_composed(poses, known, deviation(poses, known)).all()


def test_a_unit_that_is_not_stable_alone_has_no_pose() -> None:
    known = tips()
    for values in known:
        values[1, 0b0100] = np.nan
    poses = unit_poses(known, LENGTH)
    assert are_composed(poses, known, deviation(poses, known)).tolist() == [True, False, True]


@pytest.mark.parametrize("bars", [np.inf, 1e4])
def test_a_finger_is_composed_of_its_units(graded_finger: Callable[..., Finger], bars: Any) -> None:
    """With rigid bars to rounding; bars that give way turn neighbors a little."""
    from dpgcli.design.scene import Scene
    from dpgcli.states.plan import Request
    from dpgcli.states.predict import predict

    finger = graded_finger(5, seed=3, linear_stiffness=bars)
    names = ("tip_x_mm", "tip_y_mm", "tip_angle_rad", "energy_mJ")
    rows = predict(Scene(finger, sources=()), Request(columns=names)).arrays()
    x, y, angle, energy = (rows[name][None] for name in names)
    known = StateTips(x + 1j * y, angle, energy)
    poses = unit_poses(known, finger.segment_length.T)
    off = deviation(poses, known)
    assert are_composed(poses, known, off).all()
    rounding = 1e-10 if np.isinf(bars) else 0.05
    assert off.tip[0] < rounding
    assert np.isinf(bars) or off.tip[0] > 1e-6
