"""Curves with ripples: which well of a unit counts, under every law and by every method."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, minimize_scalar

from dpgcli.arrays import Array
from dpgcli.design.scene import Scene
from dpgcli.equilibrium.newton import minimize
from dpgcli.mechanics.curve import spline
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.laws import PUBLISHED, PushOnly, Tabulated
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.barriers import barriers as over_saddles
from dpgcli.states.certify import Status, certified
from dpgcli.states.guess import stroke_guess
from dpgcli.states.plan import Request
from dpgcli.states.predict import predict
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions
from dpgcli.states.wells import Wells, barriers, inverted_wells

TRAVEL = np.arange(0.0, 15.01, 0.25)
LAWS = [Tabulated, lambda curve: PushOnly(Tabulated(curve))]
NAMES = ["tabulated", "push-only"]


def energies(depth: float, place: float = 11.18) -> Array:
    """A dome of 260 mJ that rests at 13 mm, with a dent of some mJ before or after."""
    u = TRAVEL / 13.0
    smooth = 16.0 * 234.0 * u**2 * (1.0 - u) ** 2 + 40.0 * u**2 * (3.0 - 2.0 * u)
    return np.asarray(smooth - depth * np.exp(-(((TRAVEL - place) / 0.26) ** 2)))


def rippled(law: Callable[..., object], dent: Array, **changes: float) -> Finger:
    """One unit of 12.84 N/mm on the curve, stroke 3.5 mm of 13 mm of the dome's travel."""
    scaled = dent / (12.84 * 13.0**2)
    curve = spline(tuple(TRAVEL / 13.0), tuple(scaled))
    finger = replace(uniform_finger(1, **{**STUDY, **changes}), law=law(curve))
    return finger.changed(dome_travel=np.array([[13.0]]))


def deepest(finger: Finger, dent: Array) -> tuple[float, float]:
    """The opening at the lowest energy beyond the dome's top, and the barrier on the way back."""
    travel = np.linspace(0.0, 14.9, 300_001)
    dome = CubicSpline(TRAVEL, dent, bc_type=((1, 0.0), "not-a-knot"))(travel)
    opening = travel - 9.5
    angle = 2.0 * np.arcsin(np.clip(opening / 2.0 / finger.segment_height[0, 0], 0.0, 1.0))
    energy = dome + 0.5 * finger.hinge_stiffness[0, 0] * angle**2
    beyond = (opening > 0.0) & (travel > travel[dome[: len(travel) * 3 // 4].argmax()])
    well = np.where(beyond, energy, np.inf).argmin()
    return float(opening[well]), float(energy[:well].max() - energy[well])


@pytest.mark.parametrize("law", LAWS, ids=NAMES)
@pytest.mark.parametrize("depth", [0.0, 24.0])
@pytest.mark.parametrize("hinge_stiffness", [1.0, 5.0, 10.0, 24.2, 60.0])
def test_a_unit_rests_where_its_own_energy_is_lowest_beyond_its_top(
    law: Callable[..., object], depth: float, hinge_stiffness: float
) -> None:
    """A softer hinge opens more; the barrier is the dome's own top, before it touches."""
    dent = energies(depth)
    finger = rippled(law, dent, hinge_stiffness=hinge_stiffness)
    wells = inverted_wells(finger)
    opening, barrier = deepest(finger, dent)
    assert wells.exists.all()
    assert wells.extension[0, 0] == pytest.approx(opening, abs=1e-4)
    assert wells.barrier[0, 0] < 0.0
    assert barriers(finger, wells)[0] == pytest.approx(barrier, abs=1e-3)
    found = settle(UnitSolutions.of(finger), chain_potential, np.ones((1, 1), bool), 1e-12)
    assert found.status.tolist() == [Status.STABLE]


def test_a_dome_that_turns_over_long_before_it_touches() -> None:
    """Its top lies further before contact than bars are long: nothing is asked of them there."""
    finger = rippled(LAWS[1], energies(0.0), segment_height=1.9, hinge_stiffness=0.5)
    wells = inverted_wells(finger)
    assert wells.barrier[0, 0] < -2.0
    assert wells.exists.all() and np.isfinite(wells.angle).all()
    patterns = np.array([[False, True]])
    found = settle(UnitSolutions.of(finger), chain_potential, patterns, 1e-12)
    assert found.status.tolist() == [Status.STABLE, Status.STABLE]


def test_a_well_near_the_lever_s_end_is_not_shallow_for_that() -> None:
    """Bars end the opening just beyond it; a ripple has more room."""
    dent = energies(24.0)
    finger = rippled(LAWS[0], dent, segment_height=1.78, hinge_stiffness=1e-3)
    assert inverted_wells(finger).extension[0, 0] == pytest.approx(
        deepest(finger, dent)[0], abs=1e-4
    )


def test_a_curve_that_ends_soon_after_its_well_has_it_all_the_same() -> None:
    dent = energies(24.0)
    whole = spline(tuple(TRAVEL), tuple(dent))
    cut = TRAVEL <= 13.25
    short = spline(tuple(TRAVEL[cut]), tuple(dent[cut]))
    assert short.rests == pytest.approx(whole.rests, abs=0.01)


@pytest.mark.parametrize("law", LAWS, ids=NAMES)
def test_a_state_in_a_ripple_is_another_one(law: Callable[..., object]) -> None:
    """A minimum beyond the barrier, balanced and convex, but not in the unit's own well."""
    finger = rippled(LAWS[0], energies(24.0))
    units = UnitSolutions.of(finger)
    ripple = float(units.wells.from_top[0, 0]) - 0.3
    inverted = np.ones((1, 1), bool)
    potential = chain_potential(units.finger.with_domes(inverted))
    guess = potential.coordinates.of_shape(stroke_guess(finger, inverted, ripple / 3.5))
    there = minimize(potential, guess, 1e-12)
    found = certified(units, potential, inverted, there, 1e-12)
    assert found.reached.all() and found.strayed.all()
    assert found.status.tolist() == [Status.ANOTHER_PATTERN]
    free = replace(units, wells=replace(units.wells, from_top=units.wells.from_top - 9.0))
    assert certified(free, potential, inverted, there, 1e-12).status.tolist() == [Status.STABLE]


@pytest.mark.parametrize("law", LAWS, ids=NAMES)
def test_every_method_and_tolerance_ends_in_the_same_states(law: Callable[..., object]) -> None:
    one = rippled(law, energies(24.0), hinge_stiffness=1.0)
    if law is Tabulated:  # by the opening: a ground unit is not touched
        one = one.changed(dome_travel=np.zeros((1, 1)))
    finger = replace(one.with_units([0] * 9), linear_stiffness=np.array([[300.0]]))

    def tips(**request: object) -> Array:
        found = predict(Scene(finger, ()), Request(**request)).arrays()  # type: ignore[arg-type]
        assert (found["status"] == "stable").all()
        return np.asarray(found["tip_y_mm"])

    exact = tips(columns=("default", "openings"), tolerance=1e-12)
    for tolerance in (1e-3, 1e-6):
        assert tips(tolerance=tolerance) == pytest.approx(exact, abs=1e-2)


@pytest.mark.parametrize("law", [PUBLISHED, PushOnly(PUBLISHED)], ids=["published", "push-only"])
@pytest.mark.parametrize(
    "distance", [1e-3, 1e-10, *(pytest.param(d, marks=pytest.mark.slow) for d in (1e-6, 1e-8))]
)
@pytest.mark.parametrize("name", ["force_linearity", "hinge_stiffness", "wall_compliance"])
def test_wells_behind_walls_are_told_from_barriers_next_to_a_fold(
    law: object, distance: float, name: str
) -> None:
    """Against a fold found by SciPy on the closed form of the dome's force and the hinge's."""

    def least(value: float) -> float:
        changed = {**STUDY, "force_linearity": 0.1, name: value}
        compliance = changed.pop("wall_compliance", 0.05)
        stiffness = changed["hinge_stiffness"] / 10.75**2

        def pull(x: float) -> float:
            m = np.arcsin(x / 21.5)
            return float(2.0 * stiffness * 10.75 * m / np.cos(m))

        def force(y: float) -> float:
            x = brentq(lambda x: x + compliance * pull(x) - y, 0.0, y, xtol=1e-15)
            u, b = y / 3.5, 1.0 - changed["force_linearity"]
            return float(12.84 * y * (1.0 + b * (2.0 * u * u - 3.0 * u)) + pull(x))

        places = np.linspace(2.2, 3.2, 41)
        for _ in range(9):
            low = int(np.argmin([force(y) for y in places]))
            places = np.linspace(places[max(low - 1, 0)], places[min(low + 1, 40)], 41)
        return force(float(places[20]))

    ends = {
        "force_linearity": (0.0, 0.111),
        "hinge_stiffness": (1e-3, 100.0),
        "wall_compliance": (1e-9, 5.0),
    }
    fold = brentq(least, *ends[name], xtol=1e-15, rtol=1e-14)

    def wells(value: float) -> Wells:
        values = {"force_linearity": 0.1, name: value}
        compliance = values.pop("wall_compliance", 0.05)
        finger = replace(uniform_finger(1, **{**STUDY, **values}), law=law)
        return inverted_wells(finger.changed(wall_compliance=np.array([[compliance]])))

    sign = -1.0 if least(ends[name][0]) < 0.0 else 1.0
    inside, outside = wells(fold * (1.0 + sign * distance)), wells(fold * (1.0 - sign * distance))
    assert inside.exists.all() and not outside.exists.any()
    assert (inside.barrier < inside.extension).all()


@pytest.mark.parametrize(("share", "is_balanced"), [(9e-15, True), (9e-14, False)])
def test_a_weak_unit_may_feel_the_rounding_of_its_neighbors(
    share: float, is_balanced: bool
) -> None:
    """A moment of that share of the strong unit's forces, at a curvature that tells nothing."""
    strong = uniform_finger(2, **{**STUDY, "hinge_stiffness": 1e-6})
    finger = strong.changed(bistable_stiffness=np.array([[100.0], [0.01]]))
    units, inverted = UnitSolutions.of(finger), np.ones((2, 1), bool)
    found = settle(units, chain_potential, inverted, 1e-12)
    moment = share * 100.0 * 3.5 * 10.75
    off = np.zeros((4, 1))
    off[2] = moment
    there = replace(found.equilibrium, gradient=off, curvature=np.array([1e-9]))
    again = certified(units, found.potential, inverted, there, 1e-6)
    assert again.is_balanced.tolist() == [is_balanced]


def test_a_well_beyond_a_ripple_that_the_hinge_takes_away() -> None:
    """The ripple is the deeper well of the dome alone, but the other falls more steeply."""
    travel = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.55, 0.6, 0.7, 0.8, 0.85, 0.9, 1.0])
    energy = 0.01 * np.array([0.0, 3.0, 6.0, 7.0, 6.2, 5.2, 5.0, 5.3, 7.0, 9.0, 7.4, 7.6, 9.0])
    curve = spline(tuple(travel), tuple(energy))
    finger = replace(uniform_finger(1, **{**STUDY, "hinge_stiffness": 500.0}), law=Tabulated(curve))
    assert curve.rests[1] == pytest.approx(0.55, abs=0.02)
    wells = inverted_wells(finger)
    opening = np.linspace(0.0, 1.0, 200_001) * finger.stroke[0, 0]
    peer = CubicSpline(travel, energy, bc_type=((1, 0.0), "not-a-knot"))
    scale = finger.bistable_stiffness[0, 0] * finger.stroke[0, 0] ** 2
    turn = 2.0 * np.arcsin(opening / 2.0 / finger.segment_height[0, 0])
    whole = scale * peer(opening / finger.stroke[0, 0]) + 250.0 * turn**2
    wells_of_it = np.flatnonzero((np.diff(whole[:-1]) < 0.0) & (np.diff(whole[1:]) >= 0.0)) + 1
    assert len(wells_of_it) == 1
    assert wells.exists.all()
    assert wells.extension[0, 0] == pytest.approx(opening[wells_of_it[0]], abs=1e-4)


FEW = np.array([0.0, 0.28, 0.56, 0.84, 1.12, 1.4, 1.68, 1.96, 2.24, 2.52])  # mm
RISING = np.array([0.0, 0.18, 1.01, 1.29, 1.40, 1.07, 0.97, 0.59, 0.53, 1.37])  # mJ


def bends_down(n_units: int, law: Callable[..., object] = Tabulated, **changes: float) -> Finger:
    """Units whose energy rises from point to point, but not from rest on."""
    values = {"segment_length": 10.0, "segment_height": 13.4, "hinge_stiffness": 1.7}
    values |= {"stroke": 2.04, "bistable_stiffness": 6.07, "force_linearity": 0.0}
    finger = uniform_finger(n_units, **{**values, **changes})
    curve = spline(tuple(FEW / 2.04), tuple(RISING / (6.07 * 2.04**2)))
    return replace(finger, law=law(curve))


def unit_energy(opening: Array) -> Array:
    dome = CubicSpline(FEW, RISING, bc_type=((1, 0.0), "not-a-knot"))(opening)
    return np.asarray(dome + 0.5 * 1.7 * (2.0 * np.arcsin(opening / 26.8)) ** 2)


def ground_opening() -> float:
    found = minimize_scalar(unit_energy, bounds=(0.01, 0.1), method="bounded", options=FINE)
    return float(found.x)


FINE = {"xatol": 1e-10}


def test_a_straight_unit_that_is_not_at_rest_opens_to_where_it_is() -> None:
    opening = ground_opening()
    finger, patterns = bends_down(1), np.array([[False, True]])
    found = settle(UnitSolutions.of(finger), chain_potential, patterns, 1e-12)
    assert found.status.tolist() == [Status.STABLE, Status.STABLE]
    potential = found.potential.coordinates
    extension = potential.openings(found.equilibrium.coordinates)
    assert extension[0, 0] == pytest.approx(opening, rel=1e-7)
    assert opening == pytest.approx(0.0448, abs=1e-4)


@pytest.mark.parametrize("bars", [np.inf, 1e4, 100.0])
@pytest.mark.parametrize("n_units", [3, 9])
def test_so_do_all_straight_units_of_a_finger(bars: float, n_units: int) -> None:
    """Directly, and by pairs of half-fingers."""
    finger = bends_down(n_units, linear_stiffness=bars)
    found = predict(Scene(finger, ()), Request(columns=("default", "openings"))).arrays()
    assert (found["status"] == "stable").all()
    openings = np.array([found[f"opening_{unit}_mm"] for unit in range(1, n_units + 1)])
    is_straight = np.array([[digit == "0" for digit in text] for text in found["pattern"]]).T
    assert openings[is_straight] == pytest.approx(ground_opening(), rel=0.2)


def test_its_barrier_is_counted_from_there() -> None:
    """Here the smaller one is to snap: both by a scan of the energy."""
    finger = bends_down(1)
    energy = unit_energy(np.linspace(0.0, 2.4, 240_001))
    snap = energy[:150_000].max() - energy[:50_000].min()
    reset = energy[:150_000].max() - energy[150_000:].min()
    found = float(barriers(finger, inverted_wells(finger))[0])
    assert found == pytest.approx(min(snap, reset), abs=1e-9)


def test_a_dome_that_only_pushes_snaps_from_its_own_rest() -> None:
    """Where that is the smaller barrier: its inverted well lies deeper."""
    energy = RISING - 0.2 * FEW**2
    curve = spline(tuple(FEW / 2.04), tuple(energy / (6.07 * 2.04**2)))
    finger = replace(bends_down(1), law=PushOnly(Tabulated(curve)))
    dome = CubicSpline(FEW, energy, bc_type=((1, 0.0), "not-a-knot"))
    own = dome(np.linspace(0.0, 1.2, 120_001))
    assert own.min() < -1e-3
    snap = barriers(finger, inverted_wells(finger))
    hinge = 0.5 * 1.7 * (2.0 * np.arcsin(inverted_wells(finger).barrier / 26.8)) ** 2
    top = dome(inverted_wells(finger).barrier) + hinge
    assert snap[0] == pytest.approx(float(top[0, 0]) - own.min(), abs=1e-9)


@pytest.mark.parametrize("compliance", [0.02, 1.0])
def test_walls_yield_in_straight_units_that_are_not_at_rest(compliance: float) -> None:
    finger = bends_down(2, linear_stiffness=1e4)
    finger = finger.changed(wall_compliance=np.array([[compliance], [0.0]]))
    found = predict(Scene(finger, ()), Request()).arrays()
    assert found["status"].tolist() == ["stable"] * 4
    assert UnitSolutions.of(finger).wells.rest[1, 0] == pytest.approx(ground_opening(), rel=1e-7)


@pytest.mark.parametrize("stroke", [8.0, 10.0])
def test_a_barrier_is_counted_from_a_gap_that_its_dome_pulls_shut(stroke: float) -> None:
    """A dome that pulls and rests a way off: the barrier to snap is that of the saddle."""
    u = TRAVEL / 13.0
    curve = 960.0 * u**2 * (1.0 - u) ** 2 - 30.0 * u**2 * (3.0 - 2.0 * u)
    finger = rippled(Tabulated, curve, stroke=stroke)
    units, patterns = UnitSolutions.of(finger), np.array([[False, True]])
    states = settle(units, chain_potential, patterns, 1e-12)
    over = over_saddles(units, chain_potential, states, 1e-12).energy
    assert barriers(finger, units.wells) == pytest.approx(over.min(), rel=1e-9)
    assert over[0, 0] < over[0, 1], "to snap"
