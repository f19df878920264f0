"""Bounds known before the work hold after it, on thousands of random fingers."""

from collections.abc import Callable

import numpy as np
import pytest

from dpgcli.design.scene import Scene
from dpgcli.errors import UsageError
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.accuracy import ACCURACY_LEVELS, bar_flexibility, cheapest, error_bounds
from dpgcli.states.certify import Status, certify
from dpgcli.states.plan import Request, explain
from dpgcli.states.predict import predict
from dpgcli.states.settle import settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

FOLD = 0.0964682337467354  # α at which the reference unit loses its second well
Fingers = Callable[..., Finger]


def random_fingers(n_units: int, n_designs: int, seed: int) -> Finger:
    """Graded fingers of all proportions: soft to stiff bars, some units close to their fold."""
    random = np.random.default_rng(seed)

    def between(low: float, high: float, units: int = n_units) -> np.ndarray:
        return 10.0 ** random.uniform(low, high, (units, n_designs))

    height = between(0.3, 1.5, 1)
    stiffness = between(-1.0, 2.0)
    near = FOLD - between(-9.0, -1.1)
    linearity = random.uniform(0.0, 0.11, near.shape)
    return Finger(
        n_units,
        segment_length=between(0.5, 1.5),
        segment_height=height,
        stroke=np.minimum(between(-1.0, 0.9), 1.2 * height),
        bistable_stiffness=stiffness,
        force_linearity=np.where(random.random(near.shape) < 0.3, near, linearity),
        hinge_stiffness=stiffness * height**2 * between(-4.0, -1.0),
        linear_stiffness=stiffness.max(axis=0) * between(-0.5, 8.0, 1),
    )


@pytest.mark.parametrize(
    "n_units", [1, 3, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 5, 8))]
)
def test_bounds_cover_the_true_error_of_random_fingers(n_units: int) -> None:
    n_designs = 1000
    finger = random_fingers(n_units, n_designs, seed=n_units)
    inverted = np.random.default_rng(n_units).random((n_units, n_designs)) < 0.6
    units = UnitSolutions.of(finger)
    bounds = error_bounds(units)
    exact = settle(units, chain_potential, inverted, 1e-14)
    truth = tip(exact, with_compliance=False)
    is_state = certify(exact, units, 1e-12) == Status.STABLE
    rigid = UnitSolutions.of(finger.with_bars(np.inf))
    n_checked = []
    for level, bound in zip(ACCURACY_LEVELS, bounds, strict=True):
        own = rigid if level.drops_bars else units
        batch = settle(own, chain_potential, inverted, level.tolerance)
        says_stable = certify(batch, own, level.tolerance) == Status.STABLE
        bounded = np.isfinite(bound)
        assert not (says_stable & ~is_state & bounded).any(), "stable only where it is"
        both = says_stable & is_state & bounded
        pose = tip(batch, with_compliance=False).pose
        error = np.hypot(*(pose[:2] - truth.pose[:2])) - truth.error
        assert (error <= bound)[both].all(), (level.name, (error / bound)[both].max())
        n_checked.append(int(both.sum()))
    assert min(n_checked) > 0.2 * n_designs, "many have a bound and a state"


def test_bounds_are_not_absurd(reference_finger: Fingers) -> None:
    """Of the study's finger: dropping the bars is known within a factor of three."""
    units = UnitSolutions.of(reference_finger(5, 1e4))
    inverted = np.ones((5, 1), bool)
    exact = tip(settle(units, chain_potential, inverted, 1e-12), with_compliance=False)
    rigid = UnitSolutions.of(units.finger.with_bars(np.inf))
    without = tip(settle(rigid, chain_potential, inverted, 1e-12), with_compliance=False)
    moved = np.hypot(*(without.pose[:2] - exact.pose[:2]))[0]
    (bound,) = error_bounds(units)[0]
    assert moved < bound < 6.0 * moved


def test_no_bound_where_a_unit_is_about_to_lose_its_well(reference_finger: Fingers) -> None:
    units = UnitSolutions.of(reference_finger(2, 1e2, force_linearity=FOLD - 1e-12))
    assert np.isinf(error_bounds(units)).all()


@pytest.mark.parametrize("linear_stiffness", [1e4, np.inf])
@pytest.mark.parametrize("hinge_stiffness", [0.0, 1e-300])
def test_no_bound_for_a_mechanism(
    reference_finger: Fingers, linear_stiffness: float, hinge_stiffness: float
) -> None:
    finger = reference_finger(2, linear_stiffness, hinge_stiffness=hinge_stiffness)
    assert np.isinf(error_bounds(UnitSolutions.of(finger))).all()


def test_rigid_bars_cannot_be_dropped(reference_finger: Fingers) -> None:
    bounds = error_bounds(UnitSolutions.of(reference_finger(2)))
    assert np.isinf(bounds[0]).all()
    assert np.isfinite(bounds[1:]).all()


def test_the_cheapest_that_meets_the_target_is_chosen() -> None:
    bounds = np.array([[1e-2, 5.0, np.inf], [1e-3, 1.0, np.inf], [1e-9, 1e-4, np.inf]])
    assert cheapest(bounds, 2e-3).tolist() == [1, 2, len(ACCURACY_LEVELS) - 1]


@pytest.mark.parametrize("target", [1.0, 1e-2, 1e-5, 1e-7])
def test_predict_meets_its_target_and_says_so_in_every_row(
    reference_finger: Fingers, target: float
) -> None:
    scene = Scene(reference_finger(5, 1e4), ())
    request = Request(columns=("states",), target_error=target)
    plan = explain(scene, request)
    assert plan.error_bound <= target
    rows, exact = (predict(scene, r).arrays() for r in (request, Request(columns=("states",))))
    error = np.hypot(*(rows[name] - exact[name] for name in ("tip_x_mm", "tip_y_mm")))
    assert (error <= rows["numerical_error_mm"] + exact["numerical_error_mm"]).all()
    assert rows["numerical_error_mm"].max() <= target


def test_a_rung_without_bars_has_fewer_unknowns(reference_finger: Fingers) -> None:
    scene = Scene(reference_finger(5, 1e4), ())
    plan = explain(scene, Request(target_error=0.1))
    assert plan.accuracy_level == ACCURACY_LEVELS[0]
    assert (plan.unknowns, plan.terms) == (10, ("bistable", "hinge"))
    assert any("the target error allows it" in omission.why for omission in plan.omissions)


def test_long_fingers_in_pairs_meet_it_too(reference_finger: Fingers) -> None:
    scene = Scene(reference_finger(13, 1e4), ())
    rows = predict(scene, Request(columns=("states",), target_error=0.1)).arrays()
    exact = predict(scene, Request(columns=("states",))).arrays()
    error = np.hypot(*(rows[name] - exact[name] for name in ("tip_x_mm", "tip_y_mm")))
    assert 1e-6 < error.max() <= rows["numerical_error_mm"].max() < 0.1


@pytest.mark.parametrize(
    "request_",
    [
        Request(target_error=0.0),
        Request(target_error=np.nan),
        Request(target_error=np.inf),
        Request(target_error=0.1, tolerance=1e-6),
        Request(target_error=0.1, formulation="lattice"),
    ],
)
def test_targets_that_make_no_sense(reference_finger: Fingers, request_: Request) -> None:
    with pytest.raises(UsageError, match="target_error"):
        explain(Scene(reference_finger(2, 1e4), ()), request_)


def test_stiffness_that_is_asked_for_keeps_the_bars(reference_finger: Fingers) -> None:
    scene = Scene(reference_finger(3, 1e4), ())
    for names in (("default", "stiffness"), ("tip_stiffness_min_N_per_mm",), ("all",)):
        plan = explain(scene, Request(columns=names, target_error=0.1))
        assert plan.accuracy_level is not None, names
        assert not plan.accuracy_level.drops_bars, names
    plan = explain(scene, Request(target_error=0.1))
    assert plan.accuracy_level == ACCURACY_LEVELS[0]
    assert not [column for column in plan.columns if column.name.startswith("tip_stiffness")]


def test_no_promise_for_node_coordinates(reference_finger: Fingers) -> None:
    scene = Scene(reference_finger(3, 1e4), ())
    assert np.isinf(explain(scene, Request(formulation="lattice")).error_bound)


def test_a_marginal_state_has_no_error_estimate(reference_finger: Fingers) -> None:
    scene = Scene(reference_finger(2, 12.84e15), ())
    rows = predict(scene, Request(formulation="lattice", columns=("states",))).arrays()
    assert set(rows["status"]) == {"marginal"}
    assert np.isinf(rows["numerical_error_mm"]).all()


def test_the_bound_of_a_tolerance_by_hand(reference_finger: Fingers) -> None:
    """Twice twice τ F H/λ L for one unit: λ the softer of its corners' stiffnesses, in any well.

    By the moments of a unit with rigid bars, M = k_c m + F H cos(…), differentiated numerically.
    """
    unit = reference_finger(1, 1e9)

    def energy(near: float, far: float) -> float:
        z = 10.75 * (np.sin(near) + np.sin(far))
        v = 10.75 * (np.cos(far) - np.cos(near))
        x = np.hypot(13.5 + z, v) - 13.5
        u = x / 3.5
        spring = 0.5 * 12.84 * x * x * (1.0 + 0.957 * (u * u - 2.0 * u))
        return float(spring + 24.2 * (near * near + far * far))

    def softest(corner: float, step: float = 1e-4) -> float:
        by = [[(a, b) for b in (-step, step)] for a in (-step, step)]
        e = [[energy(corner + a, corner + b) for a, b in row] for row in by]
        mixed = (e[1][1] - e[1][0] - e[0][1] + e[0][0]) / (4.0 * step * step)
        along = energy(corner + step, corner) + energy(corner - step, corner)
        own = (along - 2.0 * energy(corner, corner)) / step**2
        return own - abs(mixed)

    well = float(np.arcsin(3.2450151985 / 21.5))
    stiffness = min(softest(0.0), softest(well))
    forces = (12.84 + 24.2 / 10.75**2) * 3.5
    expected = 4.0 * forces * 10.75 / stiffness * 13.5
    coarse, fine = error_bounds(UnitSolutions.of(unit))[[1, 2], 0]
    assert coarse - fine == pytest.approx((1e-3 - 1e-6) * expected, rel=1e-4)


def test_what_dropping_the_bars_costs_is_in_the_error_of_each_tip(
    reference_finger: Callable[..., Finger],
) -> None:
    finger = reference_finger(3, 1e3)
    prediction = predict(Scene(finger, ()), Request(target_error=1.0))
    assert prediction.plan.accuracy_level is not None and prediction.plan.accuracy_level.drops_bars
    cost = float(bar_flexibility(UnitSolutions.of(finger))[0])
    assert prediction.plan.dropped_error == prediction.plan.bar_flexibility == cost
    errors = prediction.arrays()["numerical_error_mm"]
    assert (errors >= cost).all() and errors == pytest.approx(cost, abs=1e-10)
