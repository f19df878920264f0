"""Fingers under dead loads: closed forms, other minimizers, 50 digits, and units that reset."""

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, minimize, minimize_scalar

from dpgcli.arrays import Array, Flags
from dpgcli.equilibrium import newton
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.laws import PUBLISHED, PushOnly
from dpgcli.mechanics.terms import Formulate, chain_potential, lattice_potential
from dpgcli.reference.equilibria import extended_states
from dpgcli.states import loading
from dpgcli.states.barriers import barriers
from dpgcli.states.certify import Settled, Status
from dpgcli.states.loading import Grown, grown
from dpgcli.states.sensitivities import sensitivities
from dpgcli.states.settle import settle
from dpgcli.states.tip import COMPLIANCE_PAIRS, min_eigenvalues, tip
from dpgcli.states.units import UnitSolutions

Fingers = Callable[..., Finger]
UnitsOf = Callable[..., Flags]
WEIGHT = 0.118  # N, of 12 g
LOADS = {
    "tip_force_x": 0.06,
    "tip_force_y": -0.1,
    "end_moment": -2.0,
    "unit_weight": WEIGHT,
    "gravity_x": -0.6,
    "gravity_y": 0.8,
}
HEIGHT, LENGTH = STUDY["segment_height"], STUDY["segment_length"]


def loaded(finger: Finger, share: float = 1.0, **loads: float) -> Finger:
    """The finger under loads, all of `LOADS` unless some are named."""
    named = loads or LOADS
    is_way = {"gravity_x", "gravity_y"}
    values = {k: v if k in is_way else share * v for k, v in named.items()}
    return finger.changed(**{name: np.array([[value]]) for name, value in values.items()})


def solved(finger: Finger, pattern: Flags, formulate: Formulate = chain_potential) -> Settled:
    return settle(UnitSolutions.of(finger), formulate, pattern, 1e-12)


def stable(finger: Finger, pattern: Flags, formulate: Formulate = chain_potential) -> Settled:
    settled = solved(finger, pattern, formulate)
    assert settled.status.tolist() == [Status.STABLE] * pattern.shape[1]
    return settled


def rigid_unit_energy(turn: float, moment: float) -> float:
    """Of a unit between rigid bars both of whose corners open by half its turn."""
    opening = 2.0 * HEIGHT * np.sin(0.5 * turn) / STUDY["stroke"]
    softening = 1.0 - STUDY["force_linearity"]
    spring = 0.5 * STUDY["bistable_stiffness"] * (opening * STUDY["stroke"]) ** 2
    spring = spring * (1.0 + softening * (opening**2 - 2.0 * opening))
    hinge = 0.5 * STUDY["hinge_stiffness"] * turn**2
    return float(spring + hinge - moment * turn)


def slope(turn: float, moment: float = 0.0) -> float:
    """Of that energy, by central differences, N mm."""
    there, before = (rigid_unit_energy(turn + step, moment) for step in (1e-5, -1e-5))
    return (there - before) / 2e-5


@pytest.mark.parametrize("moment", [-15.0, -1.0, 3.0, 30.0])
def test_a_rigid_unit_under_a_moment_turns_both_corners_alike(
    reference_finger: Fingers, units_of: UnitsOf, moment: float
) -> None:
    """The tip's angle is minus the turn; beyond 0.245 rad the unit has its second well."""
    settled = stable(loaded(reference_finger(1), end_moment=moment), units_of("1"))
    (angle,) = tip(settled, with_compliance=False).pose[2]
    assert -angle == pytest.approx(brentq(slope, 0.245, 0.8, args=(moment,)), abs=1e-8)
    found = rigid_unit_energy(-angle, moment)
    assert settled.equilibrium.energy[0] == pytest.approx(found, rel=1e-12)


def test_a_tip_force_turns_the_near_corner_only(
    reference_finger: Fingers, units_of: UnitsOf
) -> None:
    """The tip is at L from the near corner: y = −L sin a, x = L cos a; both corners, by SciPy."""
    force = np.array([0.2, -0.3])
    settled = stable(
        loaded(reference_finger(1), tip_force_x=force[0], tip_force_y=force[1]), units_of("1")
    )

    def energy(corners: Array) -> float:
        a, b = corners
        along = LENGTH + HEIGHT * (np.sin(a) + np.sin(b))
        u = (np.hypot(along, HEIGHT * (np.cos(b) - np.cos(a))) - LENGTH) / STUDY["stroke"]
        spring = 1.0 + (1.0 - STUDY["force_linearity"]) * (u**2 - 2.0 * u)
        spring *= 0.5 * STUDY["bistable_stiffness"] * (STUDY["stroke"] * u) ** 2
        place = LENGTH * np.array([np.cos(a), -np.sin(a)])
        return float(spring + STUDY["hinge_stiffness"] * (a**2 + b**2) - force @ place)

    found = minimize(energy, [0.15, 0.15], method="Nelder-Mead", options={"xatol": 1e-10})
    a, _ = found.x
    pose = tip(settled, with_compliance=False).pose[:, 0]
    assert pose[:2] == pytest.approx([LENGTH * np.cos(a), -LENGTH * np.sin(a)], abs=1e-6)
    assert settled.equilibrium.energy[0] == pytest.approx(found.fun, rel=1e-9)


@pytest.mark.parametrize("linear_stiffness", [1e3, np.inf])
@pytest.mark.parametrize("pattern", ["000", "101", "111"])
def test_another_minimizer_finds_the_same_state(
    graded_finger: Fingers, units_of: UnitsOf, linear_stiffness: float, pattern: str
) -> None:
    """Work of the loads by the places of nodes, on top of the unloaded energy."""
    finger = graded_finger(3, 5, linear_stiffness)
    settled, bare = stable(loaded(finger), units_of(pattern)), stable(finger, units_of(pattern))
    system = bare.potential.coordinates

    def energy(x: Array) -> float:
        nodes, pose = system.stations(x[:, None]), system.tip(x[:, None])[0][:, 0]
        work = LOADS["tip_force_x"] * pose[0] + LOADS["tip_force_y"] * pose[1]
        work += LOADS["end_moment"] * -pose[2]
        fallen = LOADS["gravity_x"] * nodes.top_x + LOADS["gravity_y"] * nodes.top_y
        return float(bare.potential.evaluate(x[:, None]).energy[0] - work - WEIGHT * fallen.sum())

    start = bare.equilibrium.coordinates[:, 0]
    short = 1e-4 * np.eye(len(start))  # the first steps stay in the well
    found = minimize(energy, start, method="BFGS", options={"gtol": 1e-7, "hess_inv0": short})
    pose = tip(settled, with_compliance=False).pose
    assert pose[:, 0] == pytest.approx(system.tip(found.x[:, None])[0][:, 0], abs=1e-4)
    assert settled.equilibrium.energy[0] == pytest.approx(found.fun, abs=1e-9)
    assert np.abs(pose - tip(bare, with_compliance=False).pose).max() > 0.05


@pytest.mark.parametrize("compliance", [0.0, 0.6])
@pytest.mark.parametrize("linear_stiffness", [1e2, 1e4])
def test_both_coordinates_agree(
    graded_finger: Fingers, units_of: UnitsOf, linear_stiffness: float, compliance: float
) -> None:
    finger = loaded(graded_finger(3, 6, linear_stiffness, wall_compliance=compliance))
    patterns = units_of("000", "101", "011")
    chain, lattice = (stable(finger, patterns, f) for f in (chain_potential, lattice_potential))
    first, second = (tip(found, with_compliance=True) for found in (chain, lattice))
    assert first.pose == pytest.approx(second.pose, abs=1e-9)
    assert first.compliance == pytest.approx(second.compliance, rel=1e-7, abs=1e-12)
    assert chain.equilibrium.energy == pytest.approx(lattice.equilibrium.energy, rel=1e-9)


@pytest.mark.parametrize("linear_stiffness", [1e2, 1e4, np.inf])
@pytest.mark.parametrize("compliance", [0.0, 0.6])
def test_fifty_digits_find_the_same_state(
    graded_finger: Fingers,
    units_of: UnitsOf,
    linear_stiffness: float,
    compliance: float,
) -> None:
    finger = loaded(graded_finger(3, 7, linear_stiffness, wall_compliance=compliance))
    settled = stable(finger, units_of("101"))
    truth = extended_states(finger, units_of("101"))
    assert truth.is_minimum.tolist() == truth.in_pattern.tolist() == [True]
    found = tip(settled, with_compliance=False)
    error = np.hypot(*(float(truth.pose[k, 0] - found.pose[k, 0]) for k in (0, 1)))
    assert error <= found.error[0] < 1e-9
    assert settled.equilibrium.energy[0] == pytest.approx(float(truth.energy[0]), rel=1e-12)
    smallest = min_eigenvalues(settled)[0]
    assert smallest == pytest.approx(truth.min_eigenvalue[0], rel=1e-6)


@pytest.mark.parametrize("at", [0.0, 1.0])
@pytest.mark.parametrize("linear_stiffness", [1e3, np.inf])
def test_small_forces_move_the_tip_by_its_compliance(
    graded_finger: Fingers, units_of: UnitsOf, linear_stiffness: float, at: float
) -> None:
    """Also where loads act already: their stiffness counts in."""
    finger, pattern = loaded(graded_finger(3, 8, linear_stiffness), at), units_of("101")
    here = tip(stable(finger, pattern), with_compliance=True)
    assert here.compliance is not None
    xx, xy, yy, x_turn, y_turn, turn = here.compliance[:, 0]
    assert COMPLIANCE_PAIRS == ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
    matrix = np.array([[xx, xy, x_turn], [xy, yy, y_turn], [x_turn, y_turn, turn]])
    for axis, (name, sign) in enumerate(
        (("tip_force_x", 1.0), ("tip_force_y", 1.0), ("end_moment", -1.0))
    ):
        moved = []
        for step in (1e-4, -1e-4):
            load = getattr(finger, name) + sign * step
            there = stable(finger.changed(**{name: load}), pattern)
            moved.append(tip(there, with_compliance=False))
        rate = (moved[0].pose - moved[1].pose)[:, 0] / 2e-4
        assert rate == pytest.approx(matrix[axis], rel=1e-6, abs=1e-8)


def reset(finger: Finger, pattern: Flags) -> Grown:
    bare = stable(finger.unloaded, pattern)
    coordinates = bare.equilibrium.coordinates
    return grown(UnitSolutions.of(finger), chain_potential, pattern, coordinates)


def test_the_largest_moment_of_a_rigid_unit(reference_finger: Fingers, units_of: UnitsOf) -> None:
    """The slope of its energy is least where it resets: as exactly as that slope is known."""
    least = minimize_scalar(slope, bounds=(0.15, 0.3), method="bounded", options={"xatol": 1e-9})
    way = reset(loaded(reference_finger(1), end_moment=-50.0), units_of("1"))
    assert way.unit.tolist() == [0]
    assert 50.0 * way.share[0] == pytest.approx(-least.fun, rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("linear_stiffness", [1e2, 1e6, 1e12, np.inf])
def test_states_exist_up_to_the_load_at_which_a_unit_resets(
    reference_finger: Fingers, units_of: UnitsOf, linear_stiffness: float
) -> None:
    """And no further: there the row is that of what the finger has become."""
    finger, pattern = reference_finger(5, linear_stiffness), units_of("11111")
    way = reset(loaded(finger, tip_force_y=1.0), pattern)
    (share,) = way.share
    assert 0.2 < share < 0.6, "about a third of a newton"
    below = stable(loaded(finger, tip_force_y=share * (1.0 - 1e-9)), pattern)
    assert 0.0 < below.equilibrium.curvature[0] < 1e-2
    above = solved(loaded(finger, tip_force_y=share * (1.0 + 1e-9)), pattern)
    assert above.status.tolist() == [Status.ANOTHER_PATTERN]
    fell = np.flatnonzero(~above.reached[:, 0])
    assert way.unit[0] in fell


def test_a_followed_state_is_that_of_a_direct_search(
    graded_finger: Fingers, units_of: UnitsOf
) -> None:
    finger, patterns = loaded(graded_finger(3, 9)), units_of("000", "101", "111")
    bare = stable(finger.unloaded, patterns)
    way = grown(UnitSolutions.of(finger), chain_potential, patterns, bare.equilibrium.coordinates)
    assert way.arrived.all()
    assert (way.unit == -1).all()
    assert np.isnan(way.share).all()
    direct = stable(finger, patterns)
    assert way.coordinates == pytest.approx(direct.equilibrium.coordinates, abs=1e-9)


@pytest.mark.parametrize("formulate", [chain_potential, lattice_potential])
def test_loads_of_zero_are_no_terms(
    formulate: Formulate, reference_finger: Fingers, units_of: UnitsOf
) -> None:
    finger = reference_finger(3, 1e4)
    none = loaded(finger, 0.0)
    assert none.gravity_x.any()
    assert formulate(none).kinds == formulate(finger).kinds
    patterns = units_of("101", "111")
    first, second = (stable(f, patterns, formulate).equilibrium for f in (finger, none))
    assert first.coordinates.tobytes() == second.coordinates.tobytes()


def test_gravity_is_along_its_direction_only(reference_finger: Fingers) -> None:
    along = loaded(reference_finger(2, 1e4), unit_weight=1.0, gravity_x=-1.0)
    assert sum(term.kind == "load" for term in chain_potential(along).terms) == 1


def test_lanes_do_not_touch_each_other(reference_finger: Fingers, units_of: UnitsOf) -> None:
    """Some of them are followed, some not: alone they end in the same bits."""
    forces = np.array([[0.1, 0.5, 0.2, 1.5]])
    finger = reference_finger(4, 1e4).changed(tip_force_y=forces)
    patterns = np.ones((4, 4), bool)
    together = settle(UnitSolutions.of(finger), chain_potential, patterns, 1e-12)
    assert together.status[0] == Status.STABLE
    assert together.status[3] == Status.ANOTHER_PATTERN
    for lane in range(4):
        alone = solved(finger.take_lanes(np.array([lane])), patterns[:, :1])
        mine = together.equilibrium.coordinates[:, lane].tobytes()
        assert alone.equilibrium.coordinates[:, 0].tobytes() == mine


@pytest.mark.slow
def test_every_unit_that_is_pushed_back_falls_by_itself(
    graded_finger: Fingers, units_of: UnitsOf
) -> None:
    """A couple that two of three bear; the weakest resets, and under more of it the next one."""
    strokes = {"stroke": np.array([2.6, 3.5, 3.0])}
    finger, pattern = graded_finger(3, 3, np.inf, **strokes), units_of("111")
    falls = []
    for moment in np.arange(5.0, 45.0, 2.5):
        settled = solved(loaded(finger, end_moment=-moment), pattern)
        falls.append(int((~settled.reached).sum()))
    assert falls == sorted(falls)
    assert falls[0] == 0
    assert falls[-1] == 3
    assert 1 in falls


@pytest.mark.parametrize("force", [-1.5, -0.5, 0.35, 0.5, 0.8])
def test_what_a_search_finds_is_where_growing_loads_lead(
    reference_finger: Fingers, all_patterns: Callable[[int], Flags], force: float
) -> None:
    """All states of a finger under one force: none that is called stable lies beyond a reset."""
    finger, patterns = loaded(reference_finger(4, 1e4), tip_force_y=force), all_patterns(4)
    bare = stable(finger.unloaded, patterns)
    coordinates = bare.equilibrium.coordinates
    way = grown(UnitSolutions.of(finger), chain_potential, patterns, coordinates)
    direct = solved(finger, patterns)
    is_stable = direct.status == Status.STABLE
    assert (is_stable == (way.unit < 0)).all()
    off = way.coordinates - direct.equilibrium.coordinates
    assert np.abs(off[:, is_stable]).max() < 1e-9


@pytest.mark.parametrize(
    "formulate", [chain_potential, pytest.param(lattice_potential, marks=pytest.mark.slow)]
)
def test_a_state_under_loads_is_on_the_branch_of_its_unloaded_state(
    formulate: Formulate, units_of: UnitsOf
) -> None:
    """Domes at rest that only push have no well: a search may stay in a pattern and be elsewhere.

    Two hundred small steps of the load, each from the minimum before, are told from the search.
    """
    own = {"segment_length": 9.57, "segment_height": 7.76, "stroke": 5.71, "hinge_stiffness": 5.88}
    own |= {"bistable_stiffness": 29.2, "force_linearity": 0.0777, "linear_stiffness": 4.4e5}
    bare = uniform_finger(6, **own).changed(wall_compliance=np.array([[5.45e-4]]))
    finger = loaded(replace(bare, law=PushOnly(PUBLISHED)), tip_force_x=-0.123, tip_force_y=0.146)
    patterns = units_of("001101", "010011", "010100", "111111")
    here = stable(finger.unloaded, patterns, formulate).equilibrium.coordinates
    openings: list[Array] = []
    for part in np.linspace(0.0, 1.0, 201)[1:]:
        potential = formulate(finger.with_share_of_loads(part).with_domes(patterns))
        there = newton.minimize(potential, here, 1e-12, largest_step=0.05)
        assert (there.curvature > 0.0).all()
        here = there.coordinates
        openings.append(potential.coordinates.springs(here).extension)
    assert np.abs(np.diff(openings, axis=0)).max() < 0.5
    found = stable(finger, patterns, formulate).equilibrium.coordinates
    springs = potential.coordinates.springs(found)
    assert springs.extension == pytest.approx(openings[-1], abs=1e-6)


def test_what_is_lost_as_loads_grow_is_no_state(
    reference_finger: Fingers, units_of: UnitsOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Though a search under the full loads would find one that is certified."""
    finger, patterns = loaded(reference_finger(3, 1e4), 0.5), units_of("101", "111")
    monkeypatch.setattr(sys.modules[settle.__module__], "STRAIGHT", 0.0)  # so that all is followed
    stable(finger, patterns)

    def lost(*of: Any) -> Grown:
        way = grown(*of)
        return replace(way, arrived=np.array([True, False]))

    monkeypatch.setattr(loading, "grown", lost)
    found = solved(finger, patterns)
    assert found.status.tolist() == [Status.STABLE, Status.NOT_CONVERGED]


def hinge_energy(corners: Array, force: float, moment: float) -> float:
    """Of two units between rigid bars whose domes do not act: hinges only, by the tip's place."""
    heading = -np.cumsum(corners)[0::2]  # of the chords
    fallen = LENGTH * np.sin(heading).sum()
    hinges = STUDY["hinge_stiffness"] * (corners**2).sum()
    return float(hinges - force * fallen - moment * corners.sum())


@pytest.mark.parametrize(
    ("force", "moment"), [(2.4, 20.0), (2.4, 18.0), (2.4, 26.0), (2.2, 20.0), (2.4, 22.0)]
)
def test_a_unit_at_rest_that_loads_open_gets_no_dome(
    force: float, moment: float, units_of: UnitsOf
) -> None:
    """Unit 1 resets, and then nothing but hinges is left: unit 2 opens past its barrier freely."""
    finger = uniform_finger(2, **STUDY)
    finger = replace(finger, law=PushOnly(PUBLISHED))
    finger = loaded(finger, tip_force_y=force, end_moment=moment)
    units, both = UnitSolutions.of(finger), units_of("10", "00")
    settled = settle(units, chain_potential, both, 1e-12)
    assert settled.status.tolist() == [Status.ANOTHER_PATTERN, Status.STABLE]
    assert not settled.reached.any()
    way = reset(finger, both[:, :1])
    assert (way.arrived.tolist(), way.unit.tolist()) == ([True], [0])
    assert not way.inverted.any()
    options = {"xatol": 1e-12, "fatol": 1e-14, "maxiter": 4000, "maxfev": 8000}
    found = minimize(
        hinge_energy, np.zeros(4), (force, moment), method="Nelder-Mead", options=options
    )
    for lane in range(2):
        corners = settled.equilibrium.coordinates[:, lane]
        assert corners == pytest.approx(found.x, abs=1e-5)
    springs = settled.potential.coordinates.springs(settled.equilibrium.coordinates)
    assert (springs.extension[1] > units.wells.spring_barrier[0]).all()


def test_the_domes_that_a_way_ends_with_are_those_of_its_state(
    reference_finger: Fingers, units_of: UnitsOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that has reset on a way is none though a couple opens its gap: the hinge bears it all."""
    finger = loaded(replace(reference_finger(1), law=PushOnly(PUBLISHED)), end_moment=7.0)
    monkeypatch.setattr(sys.modules[settle.__module__], "STRAIGHT", 0.0)  # so that all is followed
    stable(finger, units_of("1"))

    def fallen(*of: Any) -> Grown:
        return replace(grown(*of), inverted=units_of("0"))

    monkeypatch.setattr(loading, "grown", fallen)
    settled = solved(finger, units_of("1"))
    assert settled.status.tolist() == [Status.ANOTHER_PATTERN]
    assert settled.reached.tolist() == [[False]]
    springs = settled.potential.coordinates.springs(settled.equilibrium.coordinates)
    opening = 2.0 * HEIGHT * np.sin(0.5 * 7.0 / STUDY["hinge_stiffness"])
    assert springs.extension[0] == pytest.approx([opening], abs=1e-9)
    rests = finger.law.rests(finger.domes)
    assert rests.top[0, 0] < opening < rests.well[0, 0], "where an inverted dome would push"


@pytest.mark.parametrize("formulate", [chain_potential, lattice_potential])
@pytest.mark.parametrize("force", [-0.3, -0.8])
def test_which_way_a_straight_finger_buckles_is_not_told(
    formulate: Formulate, force: float, units_of: UnitsOf, reference_finger: Fingers
) -> None:
    """Along itself it is pushed beyond where straight is a minimum; a little aside decides."""
    finger = replace(reference_finger(5, 1e4), law=PushOnly(PUBLISHED))
    aside = loaded(finger, tip_force_x=force, tip_force_y=1e-6)
    for bent, status in ((finger, Status.MARGINAL), (aside, Status.STABLE)):
        settled = solved(loaded(bent, tip_force_x=force), units_of("00000"), formulate)
        assert settled.status.tolist() == [status]


@pytest.mark.parametrize("moment", [-12.0, 6.0])
def test_barriers_of_a_loaded_unit(
    reference_finger: Fingers, units_of: UnitsOf, moment: float
) -> None:
    finger, both = loaded(reference_finger(1), end_moment=moment), units_of("0", "1")
    settled, units = stable(finger, both), UnitSolutions.of(finger)
    found = barriers(units, chain_potential, settled, 1e-12).energy[0]
    turn = np.linspace(-0.2, 0.5, 1_400_001)
    energy = np.array([rigid_unit_energy(t, moment) for t in turn[::100]])
    middle = np.flatnonzero(turn[::100] < 0.245)[-1]
    start = np.flatnonzero(turn[::100] < 0.05)[-1]
    top = start + energy[start:middle].argmax()
    rests = [energy[:top].min(), energy[top:].min()]
    assert found == pytest.approx([energy[top] - rest for rest in rests], abs=1e-5)


def test_sensitivities_of_loaded_states(graded_finger: Fingers, units_of: UnitsOf) -> None:
    """Heights move the places where weights act."""
    finger, pattern = loaded(graded_finger(3, 10)), units_of("101")
    found = sensitivities(stable(finger, pattern), [{"segment_height": np.ones((1, 1))}])
    poses = []
    for step in (1e-4, -1e-4):
        moved = finger.changed(segment_height=finger.segment_height + step)
        poses.append(tip(stable(moved, pattern), with_compliance=False).pose[:, 0])
    slopes = (poses[0] - poses[1]) / 2e-4
    assert found.pose[:, 0, 0] == pytest.approx(slopes, rel=1e-6, abs=1e-8)
