"""How far a unit is from losing its second well: closed forms, other computations, the solver."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import mpmath
import numpy as np
import pytest

from dpgcli.arrays import Array
from dpgcli.mechanics.curve import spline
from dpgcli.mechanics.finger import STUDY as REFERENCE
from dpgcli.mechanics.finger import Finger, uniform_finger
from dpgcli.mechanics.laws import Tabulated
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status, certify
from dpgcli.states.margins import NAMES, Margins, limits, margins
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions
from dpgcli.states.wells import inverted_wells

FOLD = 0.0964682337467354  # α at which the reference unit loses its second well


@cache
def unit(**changes: float) -> Finger:
    return uniform_finger(1, **{**REFERENCE, **changes})


@cache
def graded(seed: int, n_units: int = 4) -> Finger:
    random = np.random.default_rng(seed)
    shared = ("segment_height",)
    values = {
        name: value * random.uniform(0.7, 1.3, (1 if name in shared else n_units, 1))
        for name, value in REFERENCE.items()
    }
    return Finger(n_units, **values, linear_stiffness=np.array([[np.inf]]))


@cache
def limits_of(finger_of: Callable[..., Finger], *arguments: int) -> Margins:
    return limits(finger_of(*arguments))


def limit_of(found: Margins, name: str) -> Array:
    return np.asarray(getattr(found, name))


def test_the_reference_unit_loses_its_well_at_the_known_linearity() -> None:
    assert margins(unit()).force_linearity[0] + 0.043 == pytest.approx(FOLD, abs=2e-16)


def test_without_a_hinge_the_limit_is_a_ninth() -> None:
    assert limits(unit(hinge_stiffness=0.0)).force_linearity[0] == pytest.approx(1 / 9, abs=1e-15)


def test_a_stroke_that_is_small_feels_the_hinge_as_a_linear_spring() -> None:
    """φ → 0: α must stay below 1 − 8/9 (1 + κ), κ = k_θ/(k_b H²)."""
    stiffening = 24.2 / (12.84 * 10.75**2)
    found = limits(unit(stroke=1e-6)).force_linearity[0]
    assert found == pytest.approx(1.0 - 8.0 / 9.0 * (1.0 + stiffening), abs=1e-13)


def fold(finger: Finger, place: int, name: str, near: float) -> float:
    """Where r = r' = 0, in u and the named value, by Newton's method in 40 digits."""
    own = {key: float(np.broadcast_to(v, (4, 1))[place, 0]) for key, v in finger.arrays().items()}

    def r(u: mpmath.mpf, value: mpmath.mpf) -> mpmath.mpf:
        now = {key: mpmath.mpf(number) for key, number in own.items()} | {name: value}
        turn = 2 * mpmath.asin(u * now["stroke"] / (2 * now["segment_height"]))
        hinge = now["hinge_stiffness"] / (now["bistable_stiffness"] * now["segment_height"] ** 2)
        return (
            1 + (1 - now["force_linearity"]) * (2 * u * u - 3 * u) + hinge * turn / mpmath.sin(turn)
        )

    def slope(u: mpmath.mpf, value: mpmath.mpf) -> mpmath.mpf:
        return mpmath.diff(lambda u: r(u, value), u)

    def widest(value: float) -> float:
        return 2.0 * own["segment_height"] / (value if name == "stroke" else own["stroke"])

    openings = np.linspace(0.5, min(0.75, 0.999 * widest(near)), 200)
    start = min(openings, key=lambda u: r(mpmath.mpf(u), mpmath.mpf(near)))

    def equations(u: mpmath.mpf, value: mpmath.mpf) -> list[mpmath.mpf]:
        return [r(u, value), slope(u, value)]

    with mpmath.workdps(40):
        return float(mpmath.findroot(equations, (start, near))[1])


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_limits_are_folds(seed: int, name: str) -> None:
    finger = graded(seed)
    found = limit_of(limits_of(graded, seed), name)
    for place in range(4):
        exact = fold(finger, place, name, float(found[place]) * (1.0 - 1e-6))
        assert found[place] == pytest.approx(exact, rel=1e-13)


@pytest.mark.parametrize("name", NAMES)
def test_the_moment_turns_back_below_the_limit_and_not_above(name: str) -> None:
    """A dense scan over openings, from the energy itself: E(x) + ½ k_θ φ², x = 2H sin(φ/2)."""
    limit = float(limit_of(limits_of(unit), name)[0])
    for factor, is_bistable in ((1.0 - 1e-4, True), (1.0 + 1e-4, False)):
        values = {**REFERENCE, name: factor * limit}
        turn = np.linspace(1e-3, 2.9, 200_001)
        x = 2.0 * values["segment_height"] * np.sin(0.5 * turn)
        u, softening = x / values["stroke"], 1.0 - values["force_linearity"]
        spring = 0.5 * values["bistable_stiffness"] * x**2 * (1.0 + softening * (u**2 - 2.0 * u))
        energy = spring + 0.5 * values["hinge_stiffness"] * turn**2
        assert bool((np.diff(energy) < 0.0).any()) is is_bistable


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("factor", "status"), [(-1e-9, "STABLE"), (1e-9, "NOT_BISTABLE")])
def test_the_solver_finds_the_state_up_to_the_limit(name: str, factor: float, status: str) -> None:
    limit = float(limit_of(limits_of(unit), name)[0])
    units = UnitSolutions.of(unit(**{name: limit * (1.0 + factor)}))
    batch = settle(units, chain_potential, np.ones((1, 1), bool), 1e-12)
    assert certify(batch, units, 1e-12).tolist() == [Status[status]]


@pytest.mark.parametrize("name", NAMES)
def test_no_well_is_lost_by_falling(name: str) -> None:
    parts = np.linspace(0.0, 1.0, 201)[1:]
    for seed in range(10, 20):
        finger = graded(seed)
        assert inverted_wells(finger).exists.all()
        lower = {**finger.arrays(), name: parts * finger.arrays()[name]}
        assert inverted_wells(Finger(4, **lower)).exists.all()


def test_units_have_limits_of_their_own() -> None:
    found, alone = limits_of(graded, 1), limits(graded(1).section(2, 3))
    for name in NAMES:
        assert limit_of(found, name)[2] == limit_of(alone, name)[0]


def test_margins_are_what_is_left_to_the_limits() -> None:
    found, finger = margins(graded(1)), graded(1)
    for name in NAMES:
        left = limit_of(limits_of(graded, 1), name) - finger.arrays()[name][:, 0]
        assert limit_of(found, name).tolist() == left.tolist()


def test_beyond_the_limit_margins_are_negative_or_hopeless() -> None:
    assert margins(unit(force_linearity=0.12)).force_linearity[0] == pytest.approx(FOLD - 0.12)
    assert -3.5 < margins(unit(hinge_stiffness=113.0)).stroke[0] < 0.0
    assert margins(unit(force_linearity=0.2)).hinge_stiffness[0] == -np.inf
    assert margins(unit(hinge_stiffness=200.0)).force_linearity[0] == -np.inf


def with_walls(compliance: float, **changes: float) -> Finger:
    return unit(**changes).changed(wall_compliance=np.array([[compliance]]))


@pytest.mark.slow
def test_walls_that_hold_a_well_by_themselves_lose_it_to_no_hinge_and_no_stroke() -> None:
    """k_θ → ∞, x → 0: the wall stands for the hinge, κ = 1/(k_b c_w), α < 1 − 8/9 (1 + κ)."""
    holding = 1.0 / (12.84 * (9.0 / 8.0 * (1.0 - 0.043) - 1.0))
    softer, stiffer = (limits(with_walls(f * holding)) for f in (1.02, 0.98))
    assert softer.hinge_stiffness[0] == np.inf
    assert 112.6 < stiffer.hinge_stiffness[0] < np.inf
    assert margins(with_walls(1.02 * holding)).hinge_stiffness[0] == np.inf
    alone = 1.0 - 8.0 / 9.0 * (1.0 + 1.0 / (12.84 * holding))
    assert alone == pytest.approx(0.043)
    assert limits(with_walls(5.0)).stroke[0] == np.inf
    assert softer.force_linearity[0] < 1.0, "a straight line has one well, whatever the walls"


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("compliance", [0.5, 1.0])
def test_limits_beside_walls_are_where_the_well_goes(name: str, compliance: float) -> None:
    """Also beyond 4 H and k_b H², where limits without walls end."""
    limit = float(limit_of(limits(with_walls(compliance)), name)[0])
    for factor, exists in ((1.0 - 1e-6, True), (1.0 + 1e-6, False)):
        assert inverted_wells(with_walls(compliance, **{name: factor * limit})).exists[0] == exists
    assert limit > {"stroke": 43.0, "hinge_stiffness": 150.0}.get(name, FOLD)


def test_a_value_that_a_law_does_not_have_loses_no_well() -> None:
    places = np.linspace(0.0, 1.5, 31)
    energies = 0.5 * places**2 * (1.0 + 0.957 * (places**2 - 2.0 * places))
    curve = spline(tuple(places), tuple(energies))
    found = limits(replace(unit(), law=Tabulated(curve)))
    assert found.force_linearity[0] == np.inf
    assert 0.0 < found.hinge_stiffness[0] < np.inf


def test_several_designs_are_refused() -> None:
    arrays = unit().arrays() | {"stroke": np.array([[3.5, 3.6]])}
    with pytest.raises(ValueError, match="2 designs"):
        margins(Finger(1, **arrays))
