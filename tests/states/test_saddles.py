"""Saddles between states: closed forms, their index, what they part, SciPy's own search."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, minimize, minimize_scalar

from dpgcli.arrays import Array, Flags
from dpgcli.equilibrium.loaded import spread
from dpgcli.mechanics.curve import Curve, spline
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.laws import PUBLISHED, DomeLaw, PushOnly, Tabulated
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential
from dpgcli.states.barriers import Barriers, barriers
from dpgcli.states.flips import Flips
from dpgcli.states.saddles import Saddles, SaddleStatus, saddles
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
TRAVEL = np.linspace(0.0, 1.2, 241)
APART = 9.5  # mm of a dome's travel before it touches


def dome(depth: float = 0.03) -> Curve:
    """A double well of the published form, sampled: its second well is higher by a little."""
    u = TRAVEL
    return spline(tuple(u), tuple(0.5 * u**2 * (depth + (1.0 - depth) * (1.0 - u) ** 2)))


LAWS: tuple[DomeLaw, ...] = (
    PUBLISHED,
    Tabulated(dome()),
    PushOnly(PUBLISHED),
    PushOnly(Tabulated(dome())),
)


def every_flip(
    finger: Finger, all_patterns: Callable[[int], Flags], formulate: Formulate = chain_potential
) -> Flips:
    """All flips of a finger of one design: each pattern in which a unit is not inverted."""
    n = finger.n_units
    lower = np.tile(all_patterns(n), n)
    unit = np.repeat(np.arange(n), 2**n)
    which = ~lower[unit, np.arange(len(unit))]
    return Flips(UnitSolutions.of(finger), formulate, lower[:, which], unit[which], 1e-12)


def rigid_energy(x: float, stroke: float = 3.5) -> float:
    """One unit between rigid bars, mJ: dome and hinge."""
    u, turn = x / stroke, 2.0 * np.arcsin(x / 21.5)
    spring = 0.5 * 12.84 * x * x * (1.0 + 0.957 * (u * u - 2.0 * u))
    return float(spring + 0.5 * 24.2 * turn * turn)


def energies_of(settled: object) -> Array:
    return np.asarray(sum(settled.equilibrium.energies.values()))  # type: ignore[attr-defined]


@pytest.mark.parametrize("law", [PUBLISHED, PushOnly(PUBLISHED)], ids=lambda law: law.description)
def test_one_unit_between_rigid_bars_is_a_closed_form(law: DomeLaw) -> None:
    """Barrier top at 2.0041742418 mm with 6.0382332675 mJ, well with 4.3613588754 mJ.

    A dome that only pushes goes on from its own top to there: at its own the hinge holds it back.
    """
    finger = replace(uniform_finger(1, **STUDY), law=law)
    units = UnitSolutions.of(finger)
    flips = Flips(units, chain_potential, np.array([[False]]), np.array([0]), 1e-12)
    found = saddles(flips)
    assert found.status.tolist() == [SaddleStatus.CERTIFIED]
    assert not found.is_apart.any()
    assert found.energy[0] == pytest.approx(6.0382332675, abs=1e-10)
    assert flips.extension(found.coordinates)[0] == pytest.approx(2.0041742418, abs=1e-9)
    top = minimize_scalar(lambda x: -rigid_energy(x), bounds=(1.0, 3.0), method="bounded")
    assert found.energy[0] == pytest.approx(-top.fun, rel=1e-10)
    both = settle(units, chain_potential, np.array([[False, True]]), 1e-12)
    snap, reset = barriers(units, chain_potential, both, 1e-12).energy[0]
    assert (snap, reset) == pytest.approx((6.0382332675, 6.0382332675 - 4.3613588754), abs=1e-9)


def test_walls_take_their_share_of_the_barrier() -> None:
    """Along y = x + w, w = c_w h'(x): the top of E(y) + w²/2c_w + ½ k_θ φ², by SciPy."""
    compliance = 0.3
    finger = uniform_finger(1, **STUDY).changed(wall_compliance=np.array([[compliance]]))
    flips = Flips(
        UnitSolutions.of(finger), chain_potential, np.zeros((1, 1), bool), np.array([0]), 1e-12
    )

    def energy(x: float) -> float:
        turn = 2.0 * np.arcsin(x / 21.5)
        wall = compliance * 24.2 * turn / (10.75 * np.cos(turn / 2.0))
        u = (x + wall) / 3.5
        spring = 0.5 * 12.84 * (x + wall) ** 2 * (1.0 + 0.957 * (u * u - 2.0 * u))
        return float(spring + 0.5 * wall**2 / compliance + 0.5 * 24.2 * turn**2)

    top = minimize_scalar(
        lambda x: -energy(x), bounds=(1.0, 2.5), method="bounded", options={"xatol": 1e-9}
    )
    found = saddles(flips)
    assert found.energy[0] == pytest.approx(-top.fun, rel=1e-11)
    assert -top.fun != pytest.approx(6.0382332675, rel=1e-3)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.description)
@pytest.mark.parametrize("walls", [0.0, 0.02])
def test_a_saddle_has_one_negative_eigenvalue_and_parts_its_two_states(
    graded_finger: Fingers,
    all_patterns: Callable[[int], Flags],
    dense: Callable[[Array], Array],
    law: DomeLaw,
    walls: float,
) -> None:
    """Down from either side by SciPy's BFGS, into the states as `settle` finds them."""
    finger = replace(graded_finger(3, 7, 200.0), law=law)
    finger = finger.changed(wall_compliance=np.array([[walls], [0.5 * walls], [walls]]))
    flips = every_flip(finger, all_patterns)
    found = saddles(flips)
    assert (found.status == SaddleStatus.CERTIFIED).all()
    assert not found.is_apart.any()
    sides = [
        flips.settled(pattern).equilibrium.coordinates for pattern in (flips.lower, flips.upper)
    ]
    for lane in range(len(flips.unit)):
        own = flips.take(np.array([lane])).potential
        here = found.coordinates[:, lane]
        at = own.evaluate(here[:, None])
        assert np.abs(at.gradient / own.coordinates.gradient_scale).max() <= 1e-12
        values, vectors = np.linalg.eigh(dense(at.hessian))
        assert (values < 0.0).sum() == 1

        def value_and_slope(x: Array) -> tuple[float, Array]:
            at = own.evaluate(x[:, None])  # noqa: B023
            return float(at.energy[0]), at.gradient[:, 0]

        ends = [
            minimize(
                value_and_slope, here + side * vectors[:, 0], jac=True, options={"gtol": 1e-7}
            ).x
            for side in (1e-3, -1e-3)
        ]
        ends.sort(key=lambda x: float(flips.take(np.array([lane])).extension(x[:, None])[0]))
        for end, state in zip(ends, sides, strict=True):
            np.testing.assert_allclose(end, state[:, lane], atol=1e-5)


def highest_held(finger: Finger, flips: Flips, lane: int) -> float:
    """The largest over a dome's travel of the least energy of all else, mJ, by SciPy alone.

    A dome that pulls holds its neighbor where it is; one that only pushes keeps it from coming
    nearer, with an energy of its own beside the finger's.
    """
    own = flips.take(np.array([lane]))
    pulls = not isinstance(finger.law, PushOnly)
    bare = own.formulate(own.units.finger.with_domes(own.upper if pulls else own.lower))
    lower, upper = (own.settled(p).equilibrium.coordinates for p in (own.lower, own.upper))
    rows = own.potential.coordinates.dome

    def extension(x: Array) -> float:
        return float(rows(x[:, None]).value[own.unit[0], 0])

    def slope(x: Array) -> Array:
        measured = rows(x[:, None])
        return spread(rows.rows, measured, own.is_flipping.astype(float), x[:, None])[:, 0]

    def energy(x: Array) -> tuple[float, Array]:
        at = bare.evaluate(x[:, None])
        return float(at.energy[0]), at.gradient[:, 0]

    def least(travel: float) -> float:
        share = (travel - extension(lower[:, 0])) / (
            extension(upper[:, 0]) - extension(lower[:, 0])
        )
        start = lower[:, 0] + np.clip(share, 0.0, 1.0) * (upper - lower)[:, 0]
        kind = "eq" if pulls else "ineq"
        held = {"type": kind, "fun": lambda x: extension(x) - travel, "jac": slope}
        options = {"ftol": 1e-13, "maxiter": 200}
        found = minimize(
            energy, start, jac=True, method="SLSQP", constraints=[held], options=options
        )
        if pulls:
            return float(found.fun)
        alone = finger.law.pulling.response(np.array(travel), finger.domes).energy
        return float(found.fun) + float(np.broadcast_to(alone, (finger.n_units, 1))[own.unit[0], 0])

    rests = finger.law.rests(finger.domes)
    top, well = (float(own.of_unit(rest)[0]) for rest in rests)
    bounds = (top - 0.2 * (well - top), well)
    options = {"xatol": 1e-4}
    return -float(
        minimize_scalar(lambda t: -least(t), bounds=bounds, method="bounded", options=options).fun
    )


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.description)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_scipy_finds_the_same_saddle_energies(
    graded_finger: Fingers, all_patterns: Callable[[int], Flags], law: DomeLaw, seed: int
) -> None:
    """The mountain pass as a maximum over the held opening of a constrained minimum."""
    finger = replace(graded_finger(2, seed, 60.0), law=law)
    if seed == 3:
        finger = finger.changed(wall_compliance=np.array([[0.03]]))
    flips = every_flip(finger, all_patterns)
    found = saddles(flips)
    assert (found.status == SaddleStatus.CERTIFIED).all()
    for lane in range(seed % 2, len(flips.unit), 2):
        assert found.energy[lane] == pytest.approx(highest_held(finger, flips, lane), rel=1e-7)


def apart(travel: float = 13.0, **changes: float) -> Finger:
    """Two graded units whose domes only push, and turn over long before they touch."""
    finger = uniform_finger(2, **{**STUDY, **changes}, linear_stiffness=1e3)
    finger = finger.changed(
        dome_travel=np.array([[travel], [travel + 0.4]]), stroke=np.array([[3.5], [3.9]])
    )
    return replace(finger, law=PushOnly(Tabulated(dome())))


def test_a_dome_that_is_apart_goes_over_its_own_top(all_patterns: Callable[[int], Flags]) -> None:
    """The finger takes no part: E + k_b D² max ê, whatever the rest of it does."""
    finger = apart()
    flips = every_flip(finger, all_patterns)
    found = saddles(flips)
    u = minimize_scalar(
        lambda u: -0.5 * u**2 * (0.03 + 0.97 * (1.0 - u) ** 2), bounds=(0.3, 0.7), method="bounded"
    )
    own = -u.fun * 12.84 * np.array([13.0, 13.4]) ** 2
    assert found.is_apart.all()
    assert (found.status == SaddleStatus.CERTIFIED).all()
    before = energies_of(flips.settled(flips.lower))
    np.testing.assert_allclose(found.energy - before, own[flips.unit], rtol=1e-6)  # of the spline
    states = settle(flips.units, chain_potential, all_patterns(2), 1e-12)
    energy = energies_of(states)
    table = barriers(flips.units, chain_potential, states, 1e-12).energy
    assert table[0, 2] == pytest.approx(own[0] + energy[0] - energy[2], rel=1e-6)
    assert table[1, 1] == pytest.approx(own[1] + energy[0] - energy[1], rel=1e-6)


def test_a_dome_just_in_touch_at_its_top_and_one_just_apart_have_the_same_barrier(
    all_patterns: Callable[[int], Flags],
) -> None:
    """It touches after a share of its travel that passes its top's, 0.5159 of D."""
    found = []
    top = brentq(lambda u: 0.03 + 0.97 * (1.0 - u) * (1.0 - 2.0 * u), 0.4, 0.6)
    for gap in (-1e-5, 1e-5):
        share = top + gap
        finger = replace(uniform_finger(1, **STUDY), law=PushOnly(Tabulated(dome())))
        finger = finger.changed(dome_travel=np.array([[3.5 / (1.0 - share)]]))
        at = saddles(every_flip(finger, all_patterns))
        assert at.status.tolist() == [SaddleStatus.CERTIFIED]
        found.append((bool(at.is_apart[0]), float(at.energy[0])))
    assert [is_apart for is_apart, _ in found] == [False, True]
    assert found[0][1] == pytest.approx(found[1][1], rel=1e-4)


def test_a_unit_without_a_second_well_has_no_barrier() -> None:
    linearity = np.array([[0.043], [0.3]])
    finger = uniform_finger(2, **STUDY, linear_stiffness=1e4).changed(force_linearity=linearity)
    units = UnitSolutions.of(finger)
    states = settle(units, chain_potential, np.array([[False, True], [False, False]]), 1e-12)
    found = barriers(units, chain_potential, states, 1e-12)
    assert found.status.tolist() == [
        [SaddleStatus.CERTIFIED] * 2,
        [SaddleStatus.NO_NEIGHBOR] * 2,
    ]
    assert np.isnan(found.energy).tolist() == [[False, False], [True, True]]
    assert found.least_robust.tolist() == ["1", "1"]
    assert found.n_not_found.tolist() == [0, 0]


def test_a_pattern_that_is_no_state_has_no_barriers() -> None:
    units = UnitSolutions.of(uniform_finger(1, **{**STUDY, "force_linearity": 0.3}))
    states = settle(units, chain_potential, np.array([[True]]), 1e-12)
    found = barriers(units, chain_potential, states, 1e-12)
    assert np.isnan(found.energy).all()
    assert np.isnan(found.least).all()
    assert found.least_robust.tolist() == [""]


def test_equal_units_tie_and_a_weaker_one_does_not(all_patterns: Callable[[int], Flags]) -> None:
    for stroke, expected in (
        (3.5, "1,2,3"),
        (3.5 * (1.0 + 1e-4), "1,3"),
        (3.5 * (1.0 - 1e-4), "2"),
    ):
        finger = uniform_finger(3, **STUDY, linear_stiffness=1e4)
        finger = finger.changed(stroke=np.array([[3.5], [stroke], [3.5]]))
        units = UnitSolutions.of(finger)
        states = settle(units, chain_potential, all_patterns(3)[:, :1], 1e-12)
        found = barriers(units, chain_potential, states, 1e-12)
        assert found.least_robust.tolist() == [expected]


def test_both_formulations_and_any_batch_have_the_same_saddles(
    graded_finger: Fingers, all_patterns: Callable[[int], Flags]
) -> None:
    finger = graded_finger(3, 11, 300.0)
    chain, lattice = (
        saddles(every_flip(finger, all_patterns, formulate))
        for formulate in (chain_potential, lattice_potential)
    )
    np.testing.assert_allclose(chain.energy, lattice.energy, rtol=1e-10)
    flips = every_flip(finger, all_patterns)
    alone = [saddles(flips.take(np.array([lane]))).energy[0] for lane in range(len(flips.unit))]
    assert chain.energy.tolist() == alone


def test_designs_side_by_side_have_the_barriers_that_each_has_alone(
    graded_finger: Fingers, all_patterns: Callable[[int], Flags]
) -> None:
    fingers = [graded_finger(2, seed, 500.0) for seed in (1, 2)]
    arrays = {
        name: np.concatenate(
            [np.broadcast_to(f.arrays()[name], (len(f.arrays()[name]), 1)) for f in fingers], axis=1
        )
        for name in fingers[0].arrays()
    }
    both = fingers[0].changed(**arrays)
    lanes = np.repeat([0, 1], 4)
    units = UnitSolutions.of(both).take_lanes(lanes)
    inverted = np.tile(all_patterns(2), 2)
    together = barriers(
        units, chain_potential, settle(units, chain_potential, inverted, 1e-12), 1e-12
    )
    for place, finger in enumerate(fingers):
        own = UnitSolutions.of(finger)
        states = settle(own, chain_potential, all_patterns(2), 1e-12)
        alone = barriers(own, chain_potential, states, 1e-12).energy
        np.testing.assert_allclose(together.energy[:, lanes == place], alone, rtol=1e-13)


def test_stiff_bars_change_nothing_but_the_last_digits(
    all_patterns: Callable[[int], Flags],
) -> None:
    """From k_L/k_b of 1e3 on, to first order in its inverse."""
    rigid = saddles(every_flip(uniform_finger(2, **STUDY), all_patterns)).energy
    for ratio in (1e3, 1e6, 1e12):
        finger = uniform_finger(2, **STUDY, linear_stiffness=12.84 * ratio)
        found: Saddles = saddles(every_flip(finger, all_patterns))
        assert (found.status == SaddleStatus.CERTIFIED).all()
        np.testing.assert_allclose(found.energy, rigid, rtol=0.05 / ratio + 1e-13)


@pytest.mark.parametrize(
    ("place", "depth", "width"), [(0.25, 0.08, 0.05), (0.62, 0.03, 0.03), (0.86, 0.03, 0.03)]
)
@pytest.mark.parametrize("is_attached", [True, False])
def test_a_curve_with_ripples_has_no_barrier_that_is_not_certified(
    place: float,
    depth: float,
    width: float,
    is_attached: bool,
    all_patterns: Callable[[int], Flags],
) -> None:
    """Down from its highest top it goes to a ripple, before or behind: said, not made up."""
    u = np.arange(0.0, 1.16, 0.02)
    smooth = 4.0 * u**2 * (1.0 - u) ** 2 + 0.04 * u**2 * (3.0 - 2.0 * u)
    curve = spline(tuple(u), tuple(smooth - depth * np.exp(-(((u - place) / width) ** 2))))
    before = np.linspace(0.01, curve.rests[0] - 0.01, 500)
    assert (curve(before).slope.min() < 0.0) == (place < 0.5)
    assert len(curve.branches) == 1 + (place > 0.5)
    finger = uniform_finger(2, **STUDY, linear_stiffness=1e4)
    if is_attached:
        finger = replace(finger, law=Tabulated(curve))
    else:
        finger = replace(finger, law=PushOnly(Tabulated(curve)))
        finger = finger.changed(dome_travel=np.array([[13.0]]))
    flips = every_flip(finger, all_patterns)
    found = saddles(flips)
    assert (found.status == SaddleStatus.NOT_FOUND).all()
    assert np.isnan(found.energy).all()
    states = settle(flips.units, chain_potential, all_patterns(2), 1e-12)
    table = barriers(flips.units, chain_potential, states, 1e-12)
    assert table.n_not_found.tolist() == [2] * 4
    assert np.isnan(table.least).all()
    assert table.least_robust.tolist() == [""] * 4


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS[2:], ids=lambda law: law.description)
def test_saddles_between_soft_bars_are_found_from_the_held_path_too(
    all_patterns: Callable[[int], Flags], law: DomeLaw
) -> None:
    """Bars a sixth as stiff as domes: from barriers between rigid bars six and more are missed."""
    random = np.random.default_rng(2)
    values = {name: value * random.uniform(0.5, 1.5, (3, 1)) for name, value in STUDY.items()}
    values["segment_height"] = values["segment_height"][:1]
    finger = Finger(3, **values, linear_stiffness=np.array([[2.0]]), law=law)
    flips = every_flip(finger, all_patterns)
    found = saddles(flips)
    assert (found.status == SaddleStatus.CERTIFIED).all()
    for lane in (1, 2, 5, 7):
        assert found.energy[lane] == pytest.approx(highest_held(finger, flips, lane), rel=1e-6)


def test_no_unit_is_the_least_robust_where_a_barrier_is_not_known() -> None:
    energy = np.array([[2.0, 2.0, np.nan], [3.0, np.nan, np.nan]])
    status = np.array([[0, 0, 1], [0, 2, 1]], np.uint8)  # the second unit's saddle is not found
    found = Barriers(energy, status)
    assert found.least[0] == 2.0
    assert np.isnan(found.least[1:]).all()
    assert found.least_robust.tolist() == ["1", "", ""]
