"""What explain announces is what predict does."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dpgcli.arrays import Array
from dpgcli.design.scene import Gripper, Scene
from dpgcli.equilibrium import newton
from dpgcli.equilibrium.potential import Potential
from dpgcli.errors import UsageError
from dpgcli.mechanics.finger import Finger
from dpgcli.states import settle as settle_module
from dpgcli.states.accuracy import bar_flexibility
from dpgcli.states.plan import Method, Request, explain
from dpgcli.states.predict import predict
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]


@pytest.fixture
def lanes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of lanes of every minimization from now on."""
    counted: list[int] = []

    def counting(potential: Any, guess: Array, *options: Any, **named: Any) -> newton.Equilibrium:
        counted.append(guess.shape[1])
        return newton.minimize(potential, guess, *options, **named)

    monkeypatch.setattr(settle_module, "minimize", counting)
    return counted


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> set[tuple[str, str]]:
    """Kinds of terms that are evaluated from now on, with their systems of coordinates."""
    acted: set[tuple[str, str]] = set()

    def evaluate(self: Any, coordinates: Array, _original: Any = Potential.evaluate) -> Any:
        acted.update((type(self.coordinates).__name__, term.kind) for term in self.terms)
        return _original(self, coordinates)

    monkeypatch.setattr(Potential, "evaluate", evaluate)
    return acted


@pytest.mark.parametrize("formulation", ["chain", "lattice"])
@pytest.mark.parametrize("n_units", [1, 4, 8])
def test_every_state_is_solved_once(
    reference_finger: Fingers, lanes: list[int], formulation: str, n_units: int
) -> None:
    scene = Scene(reference_finger(n_units, 1e4), (), Gripper(30.0, 0.0), 1.5)
    prediction = predict(scene, Request(formulation=formulation))
    rows = prediction.arrays()
    assert prediction.plan.n_finger_solves == sum(lanes) == 2**n_units
    assert prediction.summary.n_finger_solves == 2**n_units
    assert prediction.summary.n_states == len(rows["pattern"]) == prediction.plan.n_states


@pytest.mark.parametrize("linear_stiffness", [1e4, np.inf])
def test_pairs_solve_the_halves_that_the_plan_counts(
    reference_finger: Fingers, lanes: list[int], linear_stiffness: float
) -> None:
    prediction = predict(
        Scene(reference_finger(14, linear_stiffness), ()), Request(columns=("states",))
    )
    plan = prediction.plan
    lanes.clear()  # planning tries the cut on a few units
    rows = prediction.arrays()
    assert plan.method is Method.PAIRS and plan.split is not None
    assert plan.n_finger_solves == sum(lanes) == prediction.summary.n_finger_solves
    assert plan.n_finger_solves == 2 * 2 ** (7 + plan.split.context)
    assert len(rows["pattern"]) == 2**14


@pytest.mark.parametrize("linear_stiffness", [1e4, np.inf])
def test_terms_are_those_of_the_plan(
    reference_finger: Fingers, built: set[tuple[str, str]], linear_stiffness: float
) -> None:
    prediction = predict(Scene(reference_finger(3, linear_stiffness), ()))
    built.clear()  # planning asks what elastic bars would do
    prediction.arrays()
    assert {kind for _, kind in built} == set(prediction.plan.terms)
    assert ("bar" in prediction.plan.terms) == np.isfinite(linear_stiffness)
    assert {system for system, _ in built} == {"Chain"}


def test_hingeless_fingers_plan_no_hinges(reference_finger: Fingers) -> None:
    plan = explain(Scene(reference_finger(3, hinge_stiffness=0.0), ()))
    assert plan.terms == ("bistable",)
    assert "hinge terms" in {omission.what for omission in plan.omissions}
    assert "hinge_energy_mJ" not in {column.name for column in plan.columns}


@pytest.mark.parametrize("columns", [("default",), ("all",), ("tip_x_mm",), ("nodes", "energies")])
@pytest.mark.parametrize("n_units", [2, pytest.param(13, marks=pytest.mark.slow)])
def test_columns_are_those_of_the_plan(
    reference_finger: Fingers, columns: tuple[str, ...], n_units: int
) -> None:
    scene = Scene(reference_finger(n_units, 1e4), ())
    prediction = predict(scene, Request(("1*0",), columns))
    blocks = list(prediction.blocks())
    assert blocks
    for block in blocks:
        assert list(block) == [column.name for column in prediction.plan.columns]
        assert len({len(values) for values in block.values()}) == 1


def test_unknown_columns_are_named(reference_finger: Fingers) -> None:
    with pytest.raises(UsageError, match="aperture_mm"):
        explain(Scene(reference_finger(3), ()), Request(columns=("aperture_mm",)))
    with pytest.raises(UsageError, match="bar_energy_mJ"):
        explain(Scene(reference_finger(3), ()), Request(columns=("bar_energy_mJ",)))


@pytest.mark.parametrize("tolerance", [0.0, 1e-15, 1e-2, np.nan, np.inf, -1e-12])
def test_tolerances_out_of_reach_are_refused(reference_finger: Fingers, tolerance: float) -> None:
    with pytest.raises(UsageError, match=r"^tolerance "):
        explain(Scene(reference_finger(3), ()), Request(tolerance=tolerance))


def test_too_many_states_are_refused(reference_finger: Fingers) -> None:
    assert explain(Scene(reference_finger(26), ())).n_states == 2**26
    with pytest.raises(UsageError, match="patterns"):
        explain(Scene(reference_finger(27), ()))


@pytest.mark.parametrize("linear_stiffness", [1e2, 1e6, np.inf])
def test_64_units_with_one_pattern(
    graded_finger: Fingers, linear_stiffness: float, lanes: list[int]
) -> None:
    pattern = 16 * "0100"  # more of them would turn the finger round into itself
    scene = Scene(graded_finger(64, 81, linear_stiffness), ())
    rows = predict(scene, Request((pattern,), ("default", "nodes"))).arrays()
    assert lanes == [1]
    assert rows["status"].tolist() == ["stable"]
    assert rows["reached_pattern"].tolist() == [pattern]
    assert rows["numerical_error_mm"] < 1e-9


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("relative_stiffness", [1e1, 1e2, 1e4, 1e6])
def test_bar_flexibility_bounds_what_rigid_bars_cost(
    graded_finger: Fingers, seed: int, relative_stiffness: float
) -> None:
    finger = graded_finger(5, seed, 12.84 * relative_stiffness)
    rigid = Finger(5, **(finger.arrays() | {"linear_stiffness": np.array([[np.inf]])}))
    request = Request(columns=("states",))
    rows, without = (predict(Scene(f, ()), request).arrays() for f in (finger, rigid))
    moved = np.hypot(rows["tip_x_mm"] - without["tip_x_mm"], rows["tip_y_mm"] - without["tip_y_mm"])
    both = (rows["status"] == "stable") & (without["status"] == "stable")
    assert both.sum() >= 8
    (bound,) = bar_flexibility(UnitSolutions.of(finger))
    assert 0.05 * bound <= moved[both].max() <= bound


def test_under_loads_it_is_not_bounded(graded_finger: Fingers) -> None:
    """A force along the finger stretches bars by as much as it is large."""
    pulled = graded_finger(3, 7, 1e4).changed(tip_force_x=np.array([[0.1]]))
    assert explain(Scene(pulled, ())).bar_flexibility == np.inf


def test_residual_limit_is_what_the_tolerance_allows(graded_finger: Fingers) -> None:
    finger = graded_finger(3, 82, 1e4)
    plan = explain(Scene(finger, ()), Request(tolerance=1e-9))
    hinge = finger.hinge_stiffness / finger.segment_height**2
    expected = 1e-9 * ((finger.bistable_stiffness + hinge) * finger.stroke).max()
    assert_allclose(plan.residual_limit, expected, rtol=1e-14)
    rows = predict(Scene(finger, ()), Request(tolerance=1e-9)).arrays()
    assert rows["residual_N"].max() <= plan.residual_limit


def test_wildcards_reach_the_same_rows_as_the_whole_map(reference_finger: Fingers) -> None:
    scene = Scene(reference_finger(6, 1e4), ())
    whole = predict(scene).arrays()
    some = predict(scene, Request(("1*1", "0?00*"))).arrays()
    index = [int(pattern, 2) for pattern in some["pattern"]]
    for name, values in some.items():
        np.testing.assert_array_equal(values, whole[name][index], err_msg=name)
