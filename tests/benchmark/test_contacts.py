"""Minimizers against a disc: each finds the states, as exactly as it can."""

from dataclasses import replace

import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.benchmark.bench import Bench, errors
from dpgcli.benchmark.contacts import ContactCase, Problem, meets_body
from dpgcli.design.bodies import Body, Disc, Jaws, Polygon
from dpgcli.design.scene import Gripper, Scene
from dpgcli.mechanics.finger import STUDY, uniform_finger

DISC = Disc(np.array([20.0, 0.0]), 11.5)
JAWS = Jaws(np.array([22.0, 0.0]), 22.0, 16.0)
CORNERS = np.array([[-8.0, 8.0, 8.0, -8.0], [-9.0, -12.5, 12.5, 9.0]])
WEDGE = Polygon(np.array([22.0, 0.0]), CORNERS)
PATTERNS = np.array([[True, True, False], [True, False, True]])
LARGEST = {"this": 1e-10, "SLSQP": 1e-5, "trust-constr": 1e-4}


def scene(linear_stiffness: float = 1e3, **changes: object) -> Scene:
    finger = uniform_finger(2, **STUDY, linear_stiffness=linear_stiffness)
    gripper = Gripper(base_spacing=30.0, mounting_angle=0.05)
    return replace(Scene(finger, (), gripper, 1.5, body=DISC), **changes)


@pytest.mark.parametrize("body", [JAWS, WEDGE], ids=["jaws", "wedge"])
@pytest.mark.parametrize("bars", [1e3, np.inf])
def test_this_package_finds_the_states_on_straight_bodies(
    bars: float, body: Body, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dpgcli.benchmark.contacts.BATCH", 6)
    on_body = ContactCase.of(scene(bars, body=body), PATTERNS)
    free = ContactCase.of(scene(bars, body=replace(DISC, radius=0.1)), PATTERNS)
    moved = np.hypot(*(free.truth.pose - on_body.truth.pose)[:2].astype(float))
    assert (moved > 0.1).any(), "mm: it is touched"
    for method in list(on_body.methods())[:2]:
        found = method.run()
        row = errors(type(found)(found.pose[:, :3], found.energy[:3]), on_body.truth)
        assert row["n_missing"] == 0 and row["max_tip_error_mm"] < 1e-10


@pytest.fixture(scope="module", params=[1e3, np.inf], ids=["elastic", "rigid"])
def case(request: pytest.FixtureRequest) -> ContactCase:
    return ContactCase.of(scene(request.param), PATTERNS)


def test_every_method_finds_the_states(case: ContactCase, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dpgcli.benchmark.contacts.BATCH", 6)
    assert (case.truth.is_minimum & case.truth.in_pattern).all()
    methods = list(case.methods())
    assert [method.n_states for method in methods] == [3, 6, 3, 3]
    for method in methods:
        found = method.run()
        assert found.pose.shape == (3, method.n_states)
        first = type(found)(found.pose[:, :3], found.energy[:3])
        row = errors(first, case.truth)
        assert row["n_missing"] == 0, method.name
        largest = next(v for name, v in LARGEST.items() if name in method.name)
        assert row["max_tip_error_mm"] < largest, method.name


def test_the_disc_is_touched(case: ContactCase) -> None:
    """Else nothing but free states would be compared."""
    free = ContactCase.of(replace(case.scene, body=replace(DISC, radius=0.1)), PATTERNS)
    moved = np.hypot(*(free.truth.pose - case.truth.pose)[:2].astype(float))
    assert (moved[:2] > 0.1).all()


def test_a_minimum_elsewhere_is_not_found(case: ContactCase) -> None:
    away = replace(case.truth, pose=case.truth.pose + np.array([[0.36], [0.0], [0.0]]))
    elsewhere = replace(case, truth=away)
    (method,) = [m for m in elsewhere.methods() if m.name == "SciPy SLSQP"]
    assert np.isnan(method.run().pose).all()


def test_slopes_and_bends_are_those_of_energy_and_gaps(case: ContactCase) -> None:
    problem = Problem.of(case.scene)
    size = problem.coordinates.size
    random = np.random.default_rng(1)
    z, way = random.normal(0.0, 0.5, size), random.standard_normal(size)
    push = np.array([0.7, 0.4])

    def rate(function: object, step: float = 1e-4) -> Array:
        ends = [np.asarray(function(z + s * step * way)) for s in (-2.0, -1.0, 1.0, 2.0)]  # type: ignore[operator]
        return np.asarray((ends[0] - 8.0 * ends[1] + 8.0 * ends[2] - ends[3]) / (12.0 * step))

    pairs = [
        (rate(problem.energy), problem.slope(z) @ way),
        (rate(problem.slope), problem.bend(z) @ way),
        (rate(problem.gap), problem.gap_slope(z) @ way),
        (rate(lambda y: push @ problem.gap_slope(y)), problem.gap_bend(z, push) @ way),
    ]
    for by_steps, own in pairs:
        np.testing.assert_allclose(by_steps, own, rtol=1e-7, atol=1e-9)


def test_only_a_body_that_can_be_met_is_measured() -> None:
    assert meets_body(scene())
    assert not meets_body(scene(body=None))
    assert not meets_body(scene(layer_thickness=None))
    assert not meets_body(scene(body=Disc(np.array([2.0, 20.0]), 5.0)))
    assert meets_body(scene(body=JAWS))
    assert not meets_body(scene(body=replace(JAWS, stiffness=1.0)))
    assert meets_body(scene(body=WEDGE))
    notched = np.array([[-8.0, 8.0, 2.0, 8.0, -8.0], [-9.0, -9.0, 0.0, 9.0, 9.0]])
    assert not meets_body(scene(body=Polygon(np.array([25.0, 0.0]), notched)))


def test_bench_measures_them_where_a_spec_has_a_body(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dpgcli.benchmark.contacts.BATCH", 6)
    rows = list(Bench(scene(np.inf), 1)._contacts(PATTERNS))
    assert [row["group"] for row in rows] == ["contact"] * 4
    assert [row["n_missing"] for row in rows] == [0] * 4
    assert [row["certified"] for row in rows] == [True, True, False, False]
    assert rows[0]["times_as_long"] == 1.0
    assert rows[0]["max_tip_error_mm"] < 1e-10
