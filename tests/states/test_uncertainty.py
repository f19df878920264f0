"""Uncertainty of tips by the errors of fitted values, against drawn values (Monte Carlo)."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.design.scene import FITTED, Gripper, Scene, Step, Uncertainty
from dpgcli.errors import UsageError
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict
from dpgcli.states.settle import settle
from dpgcli.states.solved import SolvedFingers, Surroundings
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
NAMES = ("segment_height", "hinge_stiffness", "stroke")
ERRORS = np.array([0.1, 0.8, 0.02])  # mm, N mm/rad, mm
CORRELATION = np.array([[1.0, 0.6, -0.3], [0.6, 1.0, 0.0], [-0.3, 0.0, 1.0]])
UNCERTAIN = ("tip_x_uncertainty_mm", "tip_y_uncertainty_mm", "tip_angle_uncertainty_rad")
N_DRAWN = 20_000
LAYER = 30.0  # mm: so thick that its turning shows


def uncertainty() -> Uncertainty:
    pairs = zip(NAMES, ERRORS, strict=True)
    steps = tuple(Step(FITTED, {name: np.array([[error]])}) for name, error in pairs)
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
    step = Step("stroke_mm", {"stroke": np.array([[0.0], [0.1], [0.0]])})
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
    assert np.isfinite(rows["aperture_uncertainty_mm"]).all()


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


def drawn_apertures(finger: Finger, pattern: str, sigma: Array, mount: float) -> Array:
    """Apertures of grippers whose stroke, spacing, angle and layer are drawn, (drawn,)."""
    random = np.random.default_rng(2)
    off = sigma[:, None] * random.normal(size=(4, N_DRAWN))
    inverted = np.array([[digit == "1"] for digit in pattern]).repeat(N_DRAWN, axis=1)
    units = UnitSolutions.of(finger.changed(stroke=finger.stroke + off[[0]]))
    settled = settle(units, chain_potential, inverted, 1e-10)
    gripper = Gripper(60.0 + off[1], mount + off[2])
    around = Surroundings(gripper, LAYER + off[3])
    return SolvedFingers.of(settled, around, 0.0, with_compliance=False).in_gripper.aperture


@pytest.mark.parametrize("mount", [-0.4, 0.0, 0.3])
@pytest.mark.parametrize(
    "pattern", ["101", *(pytest.param(p, marks=pytest.mark.slow) for p in ("000", "111"))]
)
def test_that_of_the_aperture_is_the_scatter_of_grippers_that_are_drawn(
    reference_finger: Fingers, pattern: str, mount: float
) -> None:
    """By a value of the finger, of the gripper, and of what is between them."""
    sigma = np.array([0.03, 0.2, 0.004, 0.15])  # mm, mm, rad, mm
    finger = reference_finger(3, 1e4)
    steps = (
        Step("stroke_mm", {"stroke": np.array([[sigma[0]]])}),
        Step("base_spacing_mm", {}, base_spacing=sigma[1]),
        Step("mounting_angle_deg", {}, mounting_angle=sigma[2]),
        Step("limiting_layer_thickness_mm", {}, layer_thickness=sigma[3]),
    )
    gripper = Gripper(60.0, mount)
    scene = Scene(finger, (), gripper, LAYER, Uncertainty(steps, np.eye(4)))
    request = Request(patterns=(pattern,), columns=("uncertainty",))
    stated = predict(scene, request).arrays()["aperture_uncertainty_mm"][0]
    assert stated == pytest.approx(drawn_apertures(finger, pattern, sigma, mount).std(), rel=0.02)


def test_the_model_s_error_is_a_share_of_the_deflection(reference_finger: Fingers) -> None:
    """Equally in x and y; of the angle the same share; of the aperture what these make of it."""
    mount, layer, share = 0.3, 1.5, 0.05
    known = Uncertainty((), np.eye(0), share)
    scene = Scene(reference_finger(3, 1e4), (), Gripper(60.0, mount), layer, known)
    rows = predict(scene, Request(columns=("default", "uncertainty"))).arrays()
    deflection = np.hypot(rows["tip_x_mm"] - 40.5, rows["tip_y_mm"])
    each = share * deflection / np.sqrt(2.0)
    turn = share * np.abs(rows["tip_angle_rad"])
    assert rows["tip_x_uncertainty_mm"] == pytest.approx(each, abs=1e-12)
    assert rows["tip_y_uncertainty_mm"] == pytest.approx(each, abs=1e-12)
    assert rows["tip_angle_uncertainty_rad"] == pytest.approx(turn, abs=1e-12)
    by_angle = layer * np.sin(rows["tip_angle_rad"] + mount) * turn
    expected = np.hypot(2.0 * each, by_angle)  # 2 sin and 2 cos of the mounting angle
    assert rows["aperture_uncertainty_mm"] == pytest.approx(expected, abs=1e-12)


def test_shares_of_all_causes_add_up_in_squares(reference_finger: Fingers) -> None:
    fitted = uncertainty()
    steps = (*fitted.steps, Step("segment_length_mm", {"segment_length": np.array([[0.2]])}))
    covariance = np.eye(4)
    covariance[:3, :3] = CORRELATION
    scene = Scene(reference_finger(3, 1e4), (), uncertainty=Uncertainty(steps, covariance, 0.03))
    prediction = predict(scene, Request(columns=("uncertainty", "uncertainty_shares")))
    rows = prediction.arrays()
    shares = [values for name, values in rows.items() if name.startswith("tip_uncertainty_by_")]
    assert len(shares) == 3
    both = np.hypot(rows["tip_x_uncertainty_mm"], rows["tip_y_uncertainty_mm"])
    assert np.sqrt((np.stack(shares) ** 2).sum(axis=0)) == pytest.approx(both, rel=1e-12)
    assert np.stack(shares)[:, 1:].min() > 0.0
    worst = prediction.summary.breakdown
    assert worst is not None
    place = int(both.argmax())
    assert (worst.total, worst.pattern) == (pytest.approx(both[place]), rows["pattern"][place])
    alone = [
        rows[f"tip_uncertainty_by_{cause}_mm"][place]
        for cause in ("fitted_values", "segment_length", "model_error")
    ]
    assert list(worst.shares.values()) == alone


def test_what_it_covers_is_said_in_every_row(reference_finger: Fingers) -> None:
    scene = Scene(reference_finger(2, 1e4), (), uncertainty=uncertainty())
    rows = predict(scene, Request(columns=("uncertainty",))).arrays()
    assert set(rows["uncertainty_covers"]) == {"fitted values; without the model error"}
