"""What a state is called when it is not what its pattern says."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from dpgcli.arrays import Array, Flags
from dpgcli.design.scene import Scene
from dpgcli.equilibrium.newton import minimize
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status, certified, certify
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict
from dpgcli.states.settle import settle, settle_from
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]


def statuses(finger: Finger, guess: Array, inverted: Flags) -> NDArray[np.uint8]:
    units = UnitSolutions.of(finger)
    return settle_from(units, chain_potential(finger), inverted, guess, 1e-12).status


@pytest.mark.parametrize("linear_stiffness", [1e3, 1e6, np.inf])
def test_a_unit_without_a_well_falls_back_and_the_others_stay(
    reference_finger: Fingers, linear_stiffness: float
) -> None:
    linearity = np.array([[0.043], [0.12], [0.043]])
    arrays = reference_finger(3, linear_stiffness).arrays() | {"force_linearity": linearity}
    rows = predict(Scene(Finger(3, **arrays), ())).arrays()
    table = dict(
        zip(rows["pattern"], zip(rows["status"], rows["reached_pattern"], strict=True), strict=True)
    )
    for pattern, (status, reached) in table.items():
        expected = pattern[0] + "0" + pattern[2]
        assert status == ("stable" if pattern[1] == "0" else "not_bistable")
        assert reached == expected


def test_numbers_of_a_row_without_a_state_are_nan(graded_finger: Fingers) -> None:
    finger = graded_finger(3, 41, 1e4, force_linearity=[0.04, 0.12, 0.04])
    request = Request(columns=("all",))
    rows = predict(Scene(finger, ()), request).arrays()
    fallen = rows["status"] == "not_bistable"
    assert fallen.sum() == 4
    kept = {"pattern", "status", "reached_pattern", "residual_N"}
    assert rows.keys() > kept
    never = rows.pop("barrier_2_mJ")  # a unit with one well has nothing to flip to
    assert np.isnan(never).all()
    assert ((rows.pop("least_robust_unit") == "") == fallen).all()
    for name, values in rows.items():
        if name not in kept:
            assert (np.isnan(values.astype(float)) == fallen).all(), name
    assert np.isfinite(rows["residual_N"]).all()


@pytest.mark.parametrize("linear_stiffness", [1e4, np.inf])
def test_a_finger_without_hinges_is_a_mechanism(
    reference_finger: Fingers, linear_stiffness: float
) -> None:
    finger = reference_finger(3, linear_stiffness, hinge_stiffness=0.0)
    batch = settle(UnitSolutions.of(finger), chain_potential, np.zeros((3, 1), bool), 1e-12)
    assert certify(batch, UnitSolutions.of(finger), 1e-12).tolist() == [Status.MARGINAL]


@pytest.mark.parametrize("linear_stiffness", [1e4, np.inf])
def test_a_mechanism_is_predicted_without_warnings(
    reference_finger: Fingers, linear_stiffness: float
) -> None:
    """Warnings are errors here; `predict` also estimates what elastic bars would do."""
    predict(Scene(reference_finger(3, linear_stiffness, hinge_stiffness=0.0), ())).arrays()


def test_one_hingeless_unit_leaves_the_search_finite(reference_finger: Fingers) -> None:
    hinges = np.array([[24.2], [0.0], [24.2]])
    finger = Finger(3, **(reference_finger(3, 1e4).arrays() | {"hinge_stiffness": hinges}))
    units = UnitSolutions.of(finger)
    batch = settle(units, chain_potential, np.zeros((3, 1), bool), 1e-12)
    assert certify(batch, units, 1e-12).tolist() == [Status.MARGINAL]


@pytest.mark.parametrize("n_units", [5, 14])  # solved one by one, and as pairs of halves
@pytest.mark.parametrize("hingeless", [0, 1, 4])
def test_one_hingeless_unit_is_predicted_without_warnings(
    reference_finger: Fingers, n_units: int, hingeless: int
) -> None:
    """With every column: warnings are errors here, also of lanes that are mechanisms."""
    hinges = np.full((n_units, 1), 24.2)
    hinges[hingeless] = 0.0
    finger = Finger(n_units, **(reference_finger(n_units).arrays() | {"hinge_stiffness": hinges}))
    some = Request(patterns=("0*" + "0" * (n_units - 5),), columns=("all",))
    rows = predict(Scene(finger, ()), some).arrays()
    assert set(rows["status"]) == {"marginal"}


def test_a_saddle_is_not_called_stable(reference_finger: Fingers) -> None:
    finger = reference_finger(1)
    half = np.arcsin(2.004174241840 / 21.5)
    chain, units = chain_potential(finger), UnitSolutions.of(finger)
    at_barrier = minimize(chain, np.full((2, 1), half), 1e-3, max_iterations=1)
    reached = np.ones((1, 1), bool)
    batch = certified(units, chain, reached, at_barrier, 1e-3)
    assert batch.reached.tolist() == [[True]]
    assert certify(batch, units, 1e-3).tolist() == [Status.MARGINAL]


def test_a_minimum_beyond_a_right_angle_is_called_folded(reference_finger: Fingers) -> None:
    """Struts swung past each other, sin a = −L/H: the dome's spring is at rest, upside down."""
    finger = reference_finger(1, segment_length=9.0, hinge_stiffness=5.0)
    guess = np.full((2, 1), np.arcsin(9.0 / 10.75) - np.pi)
    folded = statuses(finger, guess, np.zeros((1, 1), bool))
    assert folded.tolist() == [Status.FOLDED]


def test_crossed_struts_are_not_called_stable(reference_finger: Fingers) -> None:
    """L < H: struts that lean over each other turn the dome's spring round before 90°."""
    finger = reference_finger(1, segment_length=4.0, hinge_stiffness=10.0)
    guess = np.full((2, 1), -np.arcsin(4.0 / 10.75))
    assert statuses(finger, guess, np.zeros((1, 1), bool)).tolist() != [Status.STABLE]


def test_an_unreachable_tolerance_is_not_converged(graded_finger: Fingers) -> None:
    units = UnitSolutions.of(graded_finger(4, 42, 1e4))
    inverted = np.ones((4, 1), bool)
    batch = settle(units, chain_potential, inverted, 1e-30)
    assert certify(batch, units, 1e-30).tolist() == [Status.NOT_CONVERGED]
    assert certify(batch, units, 1e-12).tolist() == [Status.STABLE]


@pytest.mark.parametrize("margin", [1e-3, 1e-6, 1e-10])
@pytest.mark.parametrize("linear_stiffness", [1e2, 1e4])
def test_near_the_loss_of_bistability_elastic_fingers_keep_their_states(
    reference_finger: Fingers,
    margin: float,
    linear_stiffness: float,
) -> None:
    """Elastic bars make room for the dome: bistability is lost later than with rigid ones."""
    linearity = 0.0964682337467354 - margin
    units = UnitSolutions.of(reference_finger(3, linear_stiffness, force_linearity=linearity))
    batch = settle(units, chain_potential, np.ones((3, 1), bool), 1e-12)
    assert certify(batch, units, 1e-12).tolist() == [Status.STABLE]


def test_at_the_rigid_fold_elastic_fingers_keep_their_states(reference_finger: Fingers) -> None:
    linearity = 0.0964682337467354 - 1e-12
    units = UnitSolutions.of(reference_finger(3, 50.0, force_linearity=linearity))
    batch = settle(units, chain_potential, np.ones((3, 1), bool), 1e-12)
    assert certify(batch, units, 1e-12).tolist() == [Status.STABLE]


@pytest.mark.parametrize(("n_units", "linear_stiffness"), [(1, 1e8), (64, 1e6)])
def test_the_lattice_calls_stable_what_the_chain_does(
    reference_finger: Fingers, n_units: int, linear_stiffness: float
) -> None:
    scene = Scene(reference_finger(n_units, linear_stiffness), ())
    request = Request((("1000" * n_units)[:n_units],), ("states",), "lattice")
    assert predict(scene, request).arrays()["status"].tolist() == ["stable"]


@pytest.mark.parametrize("relative_stiffness", [1.0, 3.0, 10.0])
def test_with_soft_bars_patterns_are_distinct_minima(
    reference_finger: Fingers, all_patterns: Callable[[int], Flags], relative_stiffness: float
) -> None:
    """k_L down to k_b: the wells the pattern names are told apart by the rigid barrier."""
    units = UnitSolutions.of(reference_finger(5, 12.84 * relative_stiffness))
    batch = settle(units, chain_potential, all_patterns(5), 1e-12)
    assert (certify(batch, units, 1e-12) == Status.STABLE).all()
    openings = batch.potential.coordinates.openings(batch.equilibrium.coordinates)
    assert openings[batch.inverted].min() > 0.85 * 3.5
    assert openings[~batch.inverted].max() < 0.1 * 3.5
