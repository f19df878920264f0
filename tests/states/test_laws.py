"""States under the other laws: two formulations, closed forms, independent searches."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from dpgcli.design.scene import Scene
from dpgcli.mechanics.curve import Curve, spline
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.laws import PUBLISHED, DomeLaw, PushOnly, Tabulated
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential
from dpgcli.states.certify import Status
from dpgcli.states.pairs.halves import Split
from dpgcli.states.plan import Method, Request, explain
from dpgcli.states.predict import predict
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions
from dpgcli.states.wells import barriers, inverted_wells

Fingers = Callable[..., Finger]
TRAVEL = np.linspace(0.0, 1.5, 301)


def table(linearity: float = 0.043) -> Curve:
    energy = 0.5 * TRAVEL**2 * (linearity + (1.0 - linearity) * (1.0 - TRAVEL) ** 2)
    return spline(tuple(TRAVEL), tuple(energy))


LAWS: tuple[DomeLaw, ...] = (Tabulated(table()), PushOnly(PUBLISHED), PushOnly(Tabulated(table())))


def rows(finger: Finger, **request: object) -> dict[str, np.ndarray]:
    return predict(Scene(finger, ()), Request(**request)).arrays()  # type: ignore[arg-type]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.description)
def test_both_formulations_agree(graded_finger: Fingers, law: DomeLaw) -> None:
    finger = replace(graded_finger(3, 5), law=law)
    chain, lattice = (rows(finger, formulation=name) for name in ("chain", "lattice"))
    assert (chain["status"] == "stable").all()
    assert (lattice["status"] == "stable").all()
    for name in ("tip_x_mm", "tip_y_mm", "tip_angle_rad", "energy_mJ"):
        assert chain[name] == pytest.approx(lattice[name], abs=1e-9)
    name = "tip_compliance_angle_rad_per_N_mm"
    assert chain[name] == pytest.approx(lattice[name], rel=1e-8)


@pytest.mark.parametrize("law", LAWS[1:], ids=lambda law: law.description)
def test_free_shapes_do_not_feel_whether_domes_pull(
    reference_finger: Fingers, law: DomeLaw
) -> None:
    """Inverted domes push in every state, ground ones are at rest."""
    finger = reference_finger(4, 1e4)
    both = rows(finger), rows(replace(finger, law=law))
    error = 1e-10 if law.curve is None else 1e-4  # of the spline's second well
    for name in ("tip_x_mm", "tip_y_mm", "tip_angle_rad", "energy_mJ"):
        assert both[0][name] == pytest.approx(both[1][name], abs=error)


def test_a_ground_unit_that_is_not_touched_bends_as_its_hinge(reference_finger: Fingers) -> None:
    """By the model's definition a moment turns it by M/k_theta; 60 times less where domes pull."""
    pushing = replace(reference_finger(1), law=PushOnly(PUBLISHED))
    name = "tip_compliance_angle_rad_per_N_mm"
    by_hinge = rows(pushing, patterns=("0",))[name][0]
    assert by_hinge == pytest.approx(1.0 / 24.2, rel=1e-12)
    by_both = rows(reference_finger(1), patterns=("0",))[name][0]
    assert by_both == pytest.approx(1.0 / (24.2 + 12.84 * 10.75**2), rel=1e-12)
    assert by_hinge / by_both == pytest.approx(62.3, abs=0.1)


@pytest.mark.parametrize("linearity", [0.0, 0.043, 0.09])
def test_wells_of_a_table_are_where_an_independent_search_finds_them(
    reference_finger: Fingers, linearity: float
) -> None:
    curve = table(linearity)
    finger = replace(reference_finger(1), law=Tabulated(curve))
    wells = inverted_wells(finger)

    def slope(x: float) -> float:
        half = np.arcsin(x / 21.5)
        spring = 12.84 * 3.5 * float(curve(np.array(x / 3.5)).slope)
        return float(spring + 2.0 * 24.2 * half / (10.75 * np.cos(half)))

    assert wells.extension[0, 0] == pytest.approx(brentq(slope, 2.8, 3.6), rel=1e-12)
    assert wells.barrier[0, 0] == pytest.approx(brentq(slope, 1.0, 2.6), rel=1e-12)
    assert wells.exists.all()


def test_a_table_that_is_not_bistable_is_a_row_that_says_so(reference_finger: Fingers) -> None:
    finger = replace(reference_finger(2, 1e4), law=Tabulated(table(0.12)))
    assert not inverted_wells(finger).exists.any()
    assert rows(finger)["status"].tolist() == ["stable", *["not_bistable"] * 3]
    pushing = replace(finger, law=PushOnly(Tabulated(table(0.12))))
    assert rows(pushing)["status"].tolist() == ["stable", *["not_bistable"] * 3]


def dome_that_inverts_before_it_touches() -> Finger:
    """A dome of 13.7 mm travel that touches its neighbor at 9.5 mm."""
    finger = Finger(
        2,
        *(np.array([[value]]) for value in (13.5, 10.75, 4.2, 12.84, 0.0, 24.2, 1e4, 13.7)),
    )
    return replace(finger, law=PushOnly(Tabulated(table())))


def test_a_hinge_never_resets_a_dome_that_still_pushes_in_the_straight_finger() -> None:
    finger = dome_that_inverts_before_it_touches()
    wells = inverted_wells(finger)
    top, well = finger.law.rests(finger.domes)
    assert wells.barrier == pytest.approx(top)
    assert wells.barrier[0, 0] < 0.0 < wells.extension[0, 0] < well[0, 0]
    found = rows(finger)
    assert (found["status"] == "stable").all()
    assert found["reached_pattern"].tolist() == found["pattern"].tolist()


def test_barriers_of_a_dome_that_inverts_before_it_touches() -> None:
    """The dome's own, as the hinge is at rest at that top; to reset, that less the well."""
    finger = dome_that_inverts_before_it_touches()
    curve = finger.law.curve
    assert curve is not None
    own = 12.84 * 13.7**2 * float(curve(np.array(curve.rests[0])).value)
    wells = inverted_wells(finger)
    (lowest,) = barriers(finger, wells)
    half_turn = float(np.arcsin(wells.extension[0, 0] / 21.5))
    bottom = 0.5 * 24.2 * (2.0 * half_turn) ** 2
    reset = own - float(finger.springs(wells.extension).energy[0, 0]) - bottom
    assert lowest == pytest.approx(min(own, reset), rel=1e-9)


LAWS = [PUBLISHED, Tabulated(table()), PushOnly(PUBLISHED), PushOnly(Tabulated(table()))]
EXTREMES = [
    PUBLISHED,
    PushOnly(Tabulated(table())),
    *(pytest.param(law, marks=pytest.mark.slow) for law in LAWS[1:3]),
]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.description)
def test_pairs_of_halves_are_for_every_law(reference_finger: Fingers, law: DomeLaw) -> None:
    scene = Scene(replace(reference_finger(14, 1e4), law=law), ())
    assert explain(scene, Request(columns=("tip_x_mm",))).method is Method.PAIRS


@pytest.mark.parametrize("law", LAWS[1:], ids=lambda law: law.description)
def test_long_fingers_agree_with_a_direct_solve(reference_finger: Fingers, law: DomeLaw) -> None:
    finger = replace(reference_finger(13, 1e4), law=law)
    paired = rows(finger, columns=("tip_x_mm", "tip_y_mm", "energy_mJ"))
    some = rows(finger, patterns=("1*01*1",), columns=("tip_x_mm", "tip_y_mm", "energy_mJ"))
    place = np.flatnonzero(np.isin(paired["pattern"], some["pattern"]))
    assert len(place) > 100
    for name in ("tip_x_mm", "tip_y_mm", "energy_mJ"):
        assert paired[name][place] == pytest.approx(some[name], abs=1e-9)


@pytest.mark.parametrize("law", EXTREMES, ids=lambda law: law.description)
def test_dropping_the_bars_stays_within_its_bound(graded_finger: Fingers, law: DomeLaw) -> None:
    for seed in range(20):
        finger = replace(graded_finger(3, seed, linear_stiffness=3e3), law=law)
        exact = rows(finger)
        stable = exact["status"] == "stable"
        cheap = predict(Scene(finger, ()), Request(target_error=1.0))
        bound, found = cheap.plan.error_bound, cheap.arrays()
        assert cheap.plan.accuracy_level is not None and cheap.plan.accuracy_level.drops_bars
        moved = np.hypot(
            found["tip_x_mm"] - exact["tip_x_mm"], found["tip_y_mm"] - exact["tip_y_mm"]
        )
        assert moved[stable].max() <= bound


def test_ripples_at_the_end_of_a_curve_are_no_wells(reference_finger: Fingers) -> None:
    """A record that ends with noise keeps the well that it has."""
    travel = np.linspace(0.0, 1.3, 60)
    energy = 0.5 * travel**2 * (0.043 + 0.957 * (1.0 - travel) ** 2)
    noisy = energy.copy()
    noisy[-3:] += [0.0, -0.02, 0.0]
    assert spline(tuple(travel), tuple(noisy)).rests[1] == pytest.approx(0.95, abs=5e-3)
    clean, rippled = (
        inverted_wells(
            replace(reference_finger(1), law=Tabulated(spline(tuple(travel), tuple(values))))
        )
        for values in (energy, noisy)
    )
    assert rippled.extension == pytest.approx(clean.extension, abs=1e-3)
    assert rippled.barrier == pytest.approx(clean.barrier, abs=1e-6)


def stretched(strokes: float, offset: float = 0.0) -> Tabulated:
    """A curve whose well lies at so many strokes, its energy counted from anywhere."""
    energy = 0.5 * TRAVEL**2 * (0.043 + 0.957 * (1.0 - TRAVEL) ** 2) * strokes**2
    return Tabulated(spline(tuple(TRAVEL * strokes), tuple(energy + offset)))


@pytest.mark.parametrize("strokes", [0.05, 0.3, 1.6, 2.5, 6.0])
@pytest.mark.parametrize("pushes_only", [False, True])
def test_a_well_is_found_wherever_the_curve_has_it(
    reference_finger: Fingers, strokes: float, pushes_only: bool
) -> None:
    """3.5/s mm of stroke under a curve stretched by s: the same dome as 3.5 mm under its own."""
    own, other = stretched(1.0), stretched(strokes)
    same = reference_finger(3, 1e4), reference_finger(3, 1e4, stroke=3.5 / strokes)
    laws = [PushOnly(law) if pushes_only else law for law in (own, other)]
    fingers = [replace(finger, law=law) for finger, law in zip(same, laws, strict=True)]
    expected, found = (rows(finger) for finger in fingers)
    assert (found["status"] == "stable").all()
    assert found["tip_y_mm"] == pytest.approx(expected["tip_y_mm"], abs=1e-9)
    least = [barriers(finger, inverted_wells(finger))[0] for finger in fingers]
    assert least[1] == pytest.approx(least[0], rel=1e-9)
    assert least[0] > 1.5


@pytest.mark.parametrize("offset", [-5.0, 0.7])
def test_an_energy_is_counted_from_rest(reference_finger: Fingers, offset: float) -> None:
    """A constant changes no state and no barrier."""
    expected, found = (
        replace(reference_finger(2, 1e4), law=stretched(1.0, by)) for by in (0.0, offset)
    )
    assert rows(found)["energy_mJ"] == pytest.approx(rows(expected)["energy_mJ"], rel=1e-12)
    least = [barriers(finger, inverted_wells(finger))[0] for finger in (expected, found)]
    assert least[1] == pytest.approx(least[0], rel=1e-12)


def rippled(bars: float, hinge_stiffness: float, *, pushes_only: bool = False) -> Finger:
    """A dome of 20 N/mm whose curve has a shallow well at 1.8 mm and its own at 4.6 mm."""
    travel = np.linspace(0.0, 6.0, 61)
    heights = [0.0, 40.0, 20.0, 44.0, 10.0, 60.0]
    through = CubicHermiteSpline([0.0, 1.0, 1.8, 2.8, 4.6, 6.0], heights, [0.0] * 5 + [60.0])
    curve = spline(tuple(travel / 4.6), tuple(through(travel) / (20.0 * 4.6**2)))
    law = PushOnly(Tabulated(curve)) if pushes_only else Tabulated(curve)
    values = {**STUDY, "stroke": 4.6, "bistable_stiffness": 20.0}
    values["hinge_stiffness"] = hinge_stiffness
    return replace(uniform_finger(1, **values, linear_stiffness=bars), law=law)


def rests_of(finger: Finger) -> tuple[np.ndarray, np.ndarray]:
    """Openings and energies at every well and top between rigid bars, by a scan in closed form."""
    curve = finger.law.curve
    assert curve is not None
    x = np.linspace(1e-6, 6.0, 60_001)
    half_turn = np.arcsin(x / (2.0 * STUDY["segment_height"]))
    hinge = 0.5 * float(finger.hinge_stiffness[0, 0]) * (2.0 * half_turn) ** 2
    energy = 20.0 * 4.6**2 * curve(x / 4.6).value + hinge
    turns = np.flatnonzero(np.diff(np.sign(np.diff(energy)))) + 1
    return x[turns], energy[turns]


@pytest.mark.parametrize("bars", [np.inf, 1e4])
@pytest.mark.parametrize("hinge_stiffness", [24.2, 250.0, 330.0, 400.0, 600.0])
@pytest.mark.parametrize("pushes_only", [False, True])
def test_a_unit_is_inverted_in_the_well_of_its_curve_not_in_a_ripple_before_it(
    bars: float, hinge_stiffness: float, pushes_only: bool
) -> None:
    """From 330 N mm/rad on the hinge makes the ripple the deeper well of the two."""
    finger = rippled(bars, hinge_stiffness, pushes_only=pushes_only)
    found = rows(finger, patterns=("1",), columns=("default", "opening_1_mm"))
    (_, _, _, well), (_, _, top_energy, well_energy) = rests_of(finger)
    assert found["status"].tolist() == ["stable"]
    assert found["reached_pattern"].tolist() == ["1"]
    assert found["opening_1_mm"][0] == pytest.approx(well, abs=2e-4 if bars == np.inf else 0.2)
    if not pushes_only:
        (least,) = barriers(finger, inverted_wells(finger))
        assert least == pytest.approx(top_energy - well_energy, rel=1e-6)


def test_a_unit_that_can_only_rest_in_a_ripple_is_not_bistable() -> None:
    """It counts as not inverted: the curve's own barrier is still before it."""
    finger = rippled(np.inf, 1500.0)
    found = rows(finger, patterns=("1",))
    assert len(rests_of(finger)[0]) == 2
    assert found["status"].tolist() == ["not_bistable"]
    assert found["reached_pattern"].tolist() == ["0"]
    assert not inverted_wells(finger).exists.any()
    assert barriers(finger, inverted_wells(finger)).tolist() == [0.0]


def rippled_curve(random: np.random.Generator) -> Curve:
    """The study's polynomial with waves in it, or with noise in its points."""
    travel = np.linspace(0.0, random.uniform(1.1, 1.6), int(random.integers(12, 80)))
    linearity = random.uniform(0.0, 0.1)
    energy = 0.5 * travel**2 * (linearity + (1.0 - linearity) * (1.0 - travel) ** 2)
    if random.random() < 0.5:
        waves = np.sin(2.0 * np.pi * travel * random.integers(1, 9)) * np.minimum(1, travel / 0.2)
        energy += random.choice([0.003, 0.01, 0.03]) * waves
    else:
        energy += 0.003 * random.standard_normal(len(travel)) * (travel > 0.1)
    return spline(tuple(travel), tuple(energy))


@pytest.mark.slow
@pytest.mark.parametrize("pushes_only", [False, True])
def test_units_with_rippled_curves_rest_where_a_scan_finds_them(pushes_only: bool) -> None:
    """Wells beyond the curve's own barrier, by SciPy's roots of each piece and a scan of e'."""
    random = np.random.default_rng(2)
    n_states = n_none = 0
    for _ in range(150):
        curve = rippled_curve(random)
        stroke, hinge = 10.0 ** random.uniform(-1.0, 1.2), 10.0 ** random.uniform(-1.0, 3.0)
        if np.isnan(curve.rests).any():
            continue
        contact = random.uniform(0.0, 0.6) * curve.rests[1] * stroke if pushes_only else 0.0
        law = PushOnly(Tabulated(curve)) if pushes_only else Tabulated(curve)
        values = {**STUDY, "stroke": stroke - contact, "hinge_stiffness": hinge}
        finger = replace(uniform_finger(1, **values), law=law)
        if pushes_only:
            finger = finger.changed(dome_travel=np.array([[stroke]]))
        top, well = (rest * stroke - contact for rest in curve.rests)
        x = np.linspace(max(top, 0.0) + 1e-9, min(21.4, curve.knots[-1] * stroke), 40_001)
        force = 12.84 * stroke * curve((x + contact) / stroke).slope
        if pushes_only:
            force = np.where(x < well, np.minimum(force, 0.0), 0.0)
        half_turn = np.arcsin(x / 21.5)
        slope = force + 2.0 * hinge * half_turn / (10.75 * np.cos(half_turn))
        places = x[:-1][(slope[:-1] < 0.0) & (slope[1:] >= 0.0)]
        found = rows(finger, patterns=("1",), columns=("default", "openings"))
        assert (found["status"][0] == "stable") == (len(places) > 0)
        n_states, n_none = n_states + (len(places) > 0), n_none + (len(places) == 0)
        assert found["reached_pattern"][0] == str(int(len(places) > 0))
        if len(places):
            assert np.abs(places - found["opening_1_mm"][0]).min() < 1e-3 * stroke
    assert min(n_states, n_none) > 5


def test_a_dome_that_only_pushes_is_on_one_branch_of_a_curve_with_ripples() -> None:
    """Between a top and the next well it answers as if attached, beyond them not at all."""
    plain = rippled(np.inf, 24.2).law.curve
    assert plain is not None and plain.branches == (plain.rests,)
    travel = np.linspace(0.0, 1.4, 141)
    energy = 0.5 * travel**2 * (0.02 + 0.98 * (1.0 - travel) ** 2) + 0.01 * np.sin(20.0 * travel)
    curve = spline(tuple(travel), tuple(energy))
    (upper, well), (top, lower) = curve.branches
    assert (top, well) == curve.rests and top < lower < upper < well
    law, dome = PushOnly(Tabulated(curve)), rippled(np.inf, 24.2).domes
    for branch, ends in enumerate(curve.branches):
        on = dome._replace(branch=np.array([[float(branch)]]))
        inside = np.linspace(*ends, 9)[1:-1] * 4.6
        assert (law.branch_at(inside, on) == branch).all()
        for own, attached in zip(
            law.response(inside, on), Tabulated(curve).response(inside, on), strict=True
        ):
            assert own == pytest.approx(attached, rel=1e-12)
        for end, beyond in zip(ends, (ends[0] - 0.1, ends[1] + 0.1), strict=True):
            apart = law.response(np.array(beyond * 4.6), on)
            assert (apart.force.item(), apart.stiffness.item()) == (0.0, 0.0)
            at_end = float(dome.stiffness.item() * 4.6**2 * curve(np.array(end)).value)
            assert apart.energy.item() == pytest.approx(at_end, rel=1e-12)


def test_a_dome_that_does_not_act_brings_no_force_into_play(reference_finger: Fingers) -> None:
    """Ground units under a push-only law have their hinge alone, and so has a strut between two."""
    finger = replace(reference_finger(2, 1e4), law=PushOnly(PUBLISHED))
    hinge, both = 24.2 / 10.75**2 * 3.5, (12.84 + 24.2 / 10.75**2) * 3.5
    acting = finger.with_domes(np.array([[True], [False]]))
    assert acting.force_scale.ravel() == pytest.approx([both, hinge], rel=1e-14)
    assert Split(UnitSolutions.of(finger), 1, 0, 1e-12).strut_force == pytest.approx(
        hinge, rel=1e-14
    )
    always = Split(UnitSolutions.of(replace(finger, law=PUBLISHED)), 1, 0, 1e-12)
    assert always.strut_force == pytest.approx(both, rel=1e-14)


@pytest.mark.parametrize("formulate", [chain_potential, lattice_potential])
def test_domes_that_only_push_on_hinges_without_stiffness(formulate: Formulate) -> None:
    """Nothing holds a unit in the ground state: a mechanism, in equilibrium but not stable."""
    finger = uniform_finger(2, **{**STUDY, "hinge_stiffness": 0.0}, linear_stiffness=1e4)
    units = UnitSolutions.of(replace(finger, law=PushOnly(PUBLISHED)))
    patterns = np.array([[False, False, True, True], [False, True, False, True]])
    found = settle(units, formulate, patterns, 1e-12)
    assert found.status.tolist() == [Status.MARGINAL] * 4
