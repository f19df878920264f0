"""Uncertainty of tips by the errors of fitted values, against drawn values (Monte Carlo)."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.design.scene import Gripper, Scene, Uncertainty
from dpgcli.errors import UsageError
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
NAMES = ("segment_height", "hinge_stiffness", "stroke")
ERRORS = np.array([0.1, 0.8, 0.02])  # mm, N mm/rad, mm
CORRELATION = np.array([[1.0, 0.6, -0.3], [0.6, 1.0, 0.0], [-0.3, 0.0, 1.0]])
UNCERTAIN = ("tip_x_uncertainty_mm", "tip_y_uncertainty_mm", "tip_angle_uncertainty_rad")
N_DRAWN = 20_000


def uncertainty() -> Uncertainty:
    steps = tuple({name: np.array([[e]])} for name, e in zip(NAMES, ERRORS, strict=True))
    return Uncertainty(steps, CORRELATION)


def drawn_poses(finger: Finger, pattern: str) -> Array:
    """Tips of fingers whose values are drawn from the same errors, (3, drawn)."""
    random = np.random.default_rng(1)
    off = ERRORS[:, None] * (np.linalg.cholesky(CORRELATION) @ random.normal(size=(3, N_DRAWN)))
    values = {name: getattr(finger, name) + off[[k]] for k, name in enumerate(NAMES)}
    inverted = np.array([[digit == "1"] for digit in pattern]).repeat(N_DRAWN, axis=1)
    batch = settle(UnitSolutions.of(finger.changed(**values)), chain_potential, inverted, 1e-10)
    return tip(batch, with_compliance=False).pose


@pytest.mark.parametrize("pattern", ["100", "011", "111"])
def test_it_is_the_scatter_of_tips_whose_values_are_drawn(
    reference_finger: Fingers, pattern: str
) -> None:
    """20,000 draws know a standard deviation to 0.5 %; second order adds as much here."""
    finger = reference_finger(3, 1e4)
    request = Request(patterns=(pattern,), columns=("uncertainty",))
    rows = predict(Scene(finger, (), uncertainty=uncertainty()), request).arrays()
    scatter = drawn_poses(finger, pattern).std(axis=1)
    stated = np.array([rows[name][0] for name in UNCERTAIN])
    assert stated == pytest.approx(scatter, rel=0.02)


def test_the_straight_finger_is_certain(reference_finger: Fingers) -> None:
    request = Request(patterns=("000",), columns=("uncertainty",))
    scene = Scene(reference_finger(3, 1e4), (), uncertainty=uncertainty())
    rows = predict(scene, request).arrays()
    assert all(rows[name][0] < 1e-15 for name in UNCERTAIN)


def test_steps_that_only_some_units_take(reference_finger: Fingers) -> None:
    """An error of the second unit's stroke moves no state in which that unit is at rest."""
    step = {"stroke": np.array([[0.0], [0.1], [0.0]])}
    scene = Scene(reference_finger(3), (), uncertainty=Uncertainty((step,), np.eye(1)))
    rows = predict(scene, Request(columns=("uncertainty",))).arrays()
    moves = rows["tip_angle_uncertainty_rad"] > 1e-12
    assert moves.tolist() == [pattern[1] == "1" for pattern in rows["pattern"]]


def test_it_stands_beside_a_gripper_s_columns(reference_finger: Fingers) -> None:
    scene = Scene(
        reference_finger(2, 1e4),
        (),
        Gripper(60.0, 0.1),
        layer_thickness=1.5,
        uncertainty=uncertainty(),
    )
    rows = predict(scene, Request(columns=("default", "uncertainty"))).arrays()
    assert "aperture_mm" in rows
    assert np.isfinite(rows["tip_y_uncertainty_mm"]).all()


def test_it_is_asked_for(reference_finger: Fingers) -> None:
    scene = Scene(reference_finger(2, 1e4), (), uncertainty=uncertainty())
    assert not set(UNCERTAIN) & set(predict(scene).arrays())
    assert set(UNCERTAIN) <= set(predict(scene, Request(columns=("all",))).arrays())


def test_all_columns_of_the_lattice_are_without_it(reference_finger: Fingers) -> None:
    scene = Scene(reference_finger(2, 1e4), (), uncertainty=uncertainty())
    request = Request(columns=("all",), formulation="lattice")
    assert not set(UNCERTAIN) & set(predict(scene, request).arrays())


@pytest.mark.parametrize("formulation", ["chain", "lattice"])
def test_what_it_needs(reference_finger: Fingers, formulation: str) -> None:
    known = uncertainty() if formulation == "lattice" else None
    scene = Scene(reference_finger(2, 1e4), (), uncertainty=known)
    with pytest.raises(UsageError, match="uncertainty"):
        predict(scene, Request(columns=("uncertainty",), formulation=formulation))
