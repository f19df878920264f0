"""Fingers about a growing disc: energy, limits, and what results must not depend on."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from dpgcli.api.inputs import scene_input
from dpgcli.arrays import Array
from dpgcli.equilibrium import corrector, path, steps, walk
from dpgcli.grasping import approach as approaching
from dpgcli.grasping.descent import finished
from dpgcli.grasping.frames import frames
from dpgcli.grasping.grasp import placed
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.patterns import inverted_units
from dpgcli.states.settle import settle

Fingers = Callable[..., Finger]
Grow = Callable[..., Any]
TWO_SIDES = (["010"], (24.0, -16.0), 15.6)
RESETS = (["11"], (20.0, -16.0), 15.0)


def test_a_body_in_a_corner_touches_both_sides(
    reference_finger: Fingers, grown: Grow, own: Callable[..., Any]
) -> None:
    """Against the balance of an energy and gaps of the tests' own, with two pushes."""
    patterns, center, radius = TWO_SIDES
    found = grown(reference_finger(3), patterns, center, radius)
    push, q = found.obstructed.relabeled(found.shapes).push[:, 0], found.shapes.coordinates[:, 0]
    assert (push > 0.0).tolist() == [False, True, True]
    finger = own(reference_finger(3), np.array([False, True, False]), 1.5, center, radius)
    assert finger.gaps(q[:, None])[1:, 0] == pytest.approx(0.0, abs=1e-12)
    rest = finger.gradient(finger.energy, q) - push @ finger.gradient(finger.gaps, q)
    assert np.abs(rest).max() / 10.75 <= 1e-9


def test_a_side_that_is_let_go_of_opens(
    reference_finger: Fingers, grown: Grow, own: Callable[..., Any]
) -> None:
    """In the same corner the larger disc ends on one side: the end phalanx has come off."""
    patterns, center, _ = TWO_SIDES
    found = grown(reference_finger(3), patterns, center, 17.2)
    assert found.shapes.is_there.all() and not found.came.resets
    push, q = found.obstructed.relabeled(found.shapes).push[:, 0], found.shapes.coordinates[:, 0]
    assert (push > 0.0).tolist() == [False, True, False]
    finger = own(reference_finger(3), np.array([False, True, False]), 1.5, center, 17.2)
    assert finger.gaps(q[:, None])[2, 0] > 1e-3
    rest = finger.gradient(finger.energy, q) - push @ finger.gradient(finger.gaps, q)
    assert np.abs(rest).max() / 10.75 <= 1e-9


@pytest.mark.parametrize("walls", [0.0, 0.6])
def test_a_penalty_comes_to_the_same_at_first_order(
    walls: float, reference_finger: Fingers, grown: Grow, own: Callable[..., Any]
) -> None:
    """½ k max(0, −g)², minimized by Newton's method from definitions: errors fall as 1/k."""
    finger = reference_finger(2).changed(wall_compliance=np.array([[walls]]))
    found = grown(finger, ["10"], (20.0, -16.0), 15.0)
    exact, push = (
        found.shapes.coordinates[:, 0],
        found.obstructed.relabeled(found.shapes).push[:, 0],
    )
    soft = own(finger, np.array([True, False]), 1.5, (20.0, -16.0), 15.0)
    off = []
    for k in (1e4, 1e5):

        def energy(q: Array, k: float = k) -> Array:
            return np.asarray(
                soft.energy(q) + 0.5 * k * (soft.gaps(q)[push > 0.0] ** 2).sum(axis=0)
            )

        q = exact.copy()
        for _ in range(12):
            q = q - np.linalg.solve(soft.hessian(energy, q), soft.gradient(energy, q))
        assert np.abs(soft.gradient(energy, q)).max() < 1e-7
        pushes = -k * np.minimum(soft.gaps(q[:, None])[:, 0], 0.0)
        assert (pushes > 0.0).tolist() == (push > 0.0).tolist()
        off.append([np.abs(q - exact).max(), np.abs(pushes - push).max()])
    assert off[0][0] > 1e-6
    assert np.divide(*off) == pytest.approx([10.0, 10.0], rel=0.02)


@pytest.mark.parametrize("walls", [0.0, 0.6])
@pytest.mark.parametrize("bars", [np.inf, 1e4])
def test_the_work_of_the_body_is_the_change_of_energy(
    bars: float, walls: float, reference_finger: Fingers, begun: Grow, own: Callable[..., Any]
) -> None:
    """∫ push D dλ by 24 places of Gauss's rule, from the first touch on."""
    finger = reference_finger(2, bars).changed(wall_compliance=np.array([[walls]]))
    obstructed, start = begun(finger, ["10"] * 26, (20.0, -16.0), 15.0)
    depth = float(obstructed.depth[0])
    touch = 1.0 + float(obstructed.gaps()(start.coordinates).value.min()) / depth
    place, weight = np.polynomial.legendre.leggauss(24)
    half = 0.5 * (1.0 - touch)
    loads = np.array([touch, *(touch + half * (1.0 + place)), 1.0])
    came = approaching.approach(obstructed, start, 0.0 * loads, loads)
    assert came.shapes.is_there.all() and not came.resets
    push = obstructed.relabeled(came.shapes).push.sum(axis=0)
    energy = own(finger, np.array([True, False]), 1.5, (20.0, -16.0), 15.0).energy(
        came.shapes.coordinates
    )
    assert energy[-1] - energy[0] > 0.1, "N mm"
    work = half * depth * (weight * push[1:-1]).sum()
    assert work == pytest.approx(energy[-1] - energy[0], rel=1e-7)


def test_a_lane_does_not_depend_on_others(reference_finger: Fingers, grown: Grow) -> None:
    patterns = ["10", "11", "01", "00"]
    finger = reference_finger(2, 1e4)
    together = grown(finger, patterns, (20.0, -16.0), 15.0)
    for lane, pattern in enumerate(patterns):
        alone = grown(finger, [pattern], (20.0, -16.0), 15.0)
        for name, values in vars(alone.shapes).items():
            assert (values[..., 0] == getattr(together.shapes, name)[..., lane]).all(), name
        resets = [reset.load[0] for reset in alone.came.resets]
        of_lane = [r.load[r.lanes == lane][0] for r in together.came.resets if lane in r.lanes]
        assert resets == of_lane


def test_steps_do_not_matter(
    reference_finger: Fingers, grown: Grow, monkeypatch: pytest.MonkeyPatch
) -> None:
    finger = reference_finger(2, 1e4)
    coarse = grown(finger, *RESETS)
    monkeypatch.setattr(path, "LARGEST_STEP", 0.5 * path.LARGEST_STEP)
    monkeypatch.setattr(walk, "FIRST_STEP", 0.5 * walk.FIRST_STEP)
    monkeypatch.setattr(corrector, "STRAYING", 0.1 * corrector.STRAYING)
    fine = grown(finger, *RESETS)
    assert fine.shapes.coordinates == pytest.approx(coarse.shapes.coordinates, abs=1e-11)
    assert fine.shapes.push == pytest.approx(coarse.shapes.push, abs=1e-10)
    (one,), (other,) = coarse.came.resets, fine.came.resets
    assert one.load == pytest.approx(other.load, rel=1e-10)
    assert (one.flipped == other.flipped).all()


def test_events_are_where_secants_find_them(
    reference_finger: Fingers, grown: Grow, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Contacts that close and open, each by Newton's steps or come near to from before."""
    finger, patterns = reference_finger(3), ["010", "110", "111"]
    by_newton = grown(finger, patterns, *TWO_SIDES[1:])
    asked: list[bool] = []

    def by_secants(_: Any, own: walk.Walk, trial: Any, cell: Array, is_away: Array) -> Array:
        asked.extend(cell >= 0)
        return np.full(len(cell), walk.BY_SECANTS)

    monkeypatch.setattr(steps, "_to_meet", by_secants)
    found = grown(finger, patterns, *TWO_SIDES[1:])
    assert any(asked)
    assert found.shapes.coordinates == pytest.approx(by_newton.shapes.coordinates, abs=1e-11)
    assert found.shapes.push == pytest.approx(by_newton.shapes.push, abs=1e-10)
    resets = [[(r.lanes.tolist(), *r.load) for r in f.came.resets] for f in (found, by_newton)]
    assert len(resets[0]) == len(resets[1])
    for one, other in zip(*resets, strict=True):
        assert one[0] == other[0] and one[1:] == pytest.approx(other[1:], rel=1e-10)


@pytest.mark.parametrize("is_held", [True, False])
def test_newton_meets_an_event(reference_finger: Fingers, begun: Grow, is_held: bool) -> None:
    """From well before it, with a cell that is held or by the load: one that closes."""
    obstructed, start = begun(reference_finger(2), *RESETS)
    half = approaching.approach(obstructed, start, np.zeros(1), np.array([0.2]))
    shapes = obstructed.relabeled(half.shapes)
    family, x = obstructed.family(shapes.inverted, shapes.active), obstructed.stacked(shapes)
    depth, nobody = max(family.column_depths), np.array([-1])
    first = path.follow(family, x, np.array([0.2]), np.array([1.0]))
    assert first.outcome == walk.PathEnd.EVENT
    cell = np.array([0 if is_held and shapes.active.any() else -1])
    target = family.followed(x).value[cell]
    ways = corrector.Ways(np.zeros(1, bool), first.cell)
    near = 0.9 * first.load + 0.1 * 0.2
    guess = 0.9 * first.coordinates + 0.1 * x
    found = corrector.corrected(family, guess, near, cell, target[0], depth, ways)
    assert found.is_fine and nobody[0] == -1
    assert found.load == pytest.approx(first.load, abs=1e-10)
    assert abs(family.law.margin(found.loaded, found.load)[first.cell[0], 0]) < corrector.CROSSED


def test_what_holds_a_cell_is_part_of_its_dome(reference_finger: Fingers, begun: Grow) -> None:
    """The derivatives are those of the potential with a spring; without a target it is at rest."""
    obstructed, start = begun(reference_finger(2), *RESETS)
    load = np.array([0.4])
    there = approaching.approach(obstructed, start, np.zeros(1), load)
    shapes = obstructed.relabeled(there.shapes)
    family, x = obstructed.family(shapes.inverted, shapes.active), obstructed.stacked(shapes)
    x, depth = x + 1e-2 * np.sin(np.arange(len(x)))[:, None], max(family.column_depths)
    stiffness, target = np.array([[0.0], [7.0]]), np.array([0.3])
    whole = family.held(load, stiffness, target).evaluate(x)
    linear = family.linearized(x, load, stiffness, target, depth)
    assert linear.gradient == pytest.approx(whole.gradient, rel=1e-12, abs=1e-12)
    assert linear.hessian == pytest.approx(whole.hessian, rel=1e-12, abs=1e-12)
    assert family.take_lanes(np.zeros(1, int)).linearized(
        x, load, stiffness, target, depth
    ).hessian == pytest.approx(linear.hessian, rel=1e-15), "its lanes share the dome, too"
    bare = family.at(load).evaluate(x).gradient
    at_rest = family.linearized(x, load, stiffness, np.array([np.nan]), depth)
    assert at_rest.gradient == pytest.approx(bare, rel=1e-12, abs=1e-12)


def test_events_are_met_by_squares(
    reference_finger: Fingers, begun: Grow, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Newton's own steps from well before a contact: each as the square of the one before."""
    obstructed, start = begun(reference_finger(2), *RESETS)
    part = np.array([0.2])
    half = approaching.approach(obstructed, start, np.zeros(1), part)
    shapes = obstructed.relabeled(half.shapes)
    family, x = obstructed.family(shapes.inverted, shapes.active), obstructed.stacked(shapes)
    first = path.follow(family, x, part, np.array([1.0]))
    lengths: list[float] = []
    look = corrector._look

    def told(*args: Any) -> Any:
        found = look(*args)
        lengths.append(float(found.length[0]))
        return found

    monkeypatch.setattr(corrector, "_look", told)
    ways = corrector.Ways(np.zeros(1, bool), first.cell)
    near, guess = 0.9 * first.load, first.coordinates + 0.01 * np.sin(np.arange(len(x)))[:, None]
    target = family.followed(guess).value[:1, 0] + 0.5  # mm: nothing of it is left
    args = near, np.array([0]), target, max(family.column_depths), ways
    assert corrector.corrected(family, guess, *args).is_fine
    assert lengths[0] > 1e-3, "of the step cap: a way to go"
    squares = [b / a**2 for a, b in pairwise(lengths) if b > 1e-10]
    assert squares and max(squares) < 30.0, lengths


def test_it_can_stop_halfway(reference_finger: Fingers, begun: Grow) -> None:
    """To λ = 0.7 and from there on is the same as at once, and as a smaller disc."""
    finger = reference_finger(2)
    obstructed, start = begun(finger, *RESETS)
    zero, part = np.zeros(1), np.array([0.7])
    first = approaching.approach(obstructed, start, zero, part)
    then = approaching.approach(obstructed, first.shapes, part, zero + 1.0)
    once = approaching.approach(obstructed, start, zero, zero + 1.0)
    assert then.shapes.coordinates == pytest.approx(once.shapes.coordinates, abs=1e-12)
    smaller, begin = begun(finger, ["11"], (20.0, -16.0), 10.5)
    small = approaching.approach(smaller, begin, zero, zero + 1.0)
    assert small.shapes.push.max() > 0.01, "N"
    assert first.shapes.coordinates == pytest.approx(small.shapes.coordinates, abs=1e-12)
    assert first.shapes.push == pytest.approx(small.shapes.push, abs=1e-11)


def test_to_reset_stops_at_the_first(reference_finger: Fingers, begun: Grow) -> None:
    obstructed, start = begun(reference_finger(2), *RESETS)
    zero = np.zeros(1)
    came = approaching.approach(obstructed, start, zero, zero + 1.0, to_reset=True)
    (reset,) = came.resets
    assert came.load == pytest.approx(reset.load, abs=2e-6)
    assert reset.load < 0.95


@pytest.mark.parametrize("bars", [1e2, 1e3])
def test_soft_bars_balance(
    bars: float, reference_finger: Fingers, grown: Grow, own: Callable[..., Any]
) -> None:
    finger = reference_finger(2, bars)
    found = grown(finger, ["10"], (20.0, -16.0), 15.0)
    push, q = found.obstructed.relabeled(found.shapes).push[:, 0], found.shapes.coordinates[:, 0]
    mine = own(finger, np.array([True, False]), 1.5, (20.0, -16.0), 15.0)
    assert push.max() > 0.1
    rest = mine.gradient(mine.energy, q) - push @ mine.gradient(mine.gaps, q)
    assert np.abs(rest).max() <= 1e-9


def test_stiff_bars_come_to_rigid_ones(reference_finger: Fingers, grown: Grow) -> None:
    """At first order in k_b/k_L, to the last digits at 1e15 N/mm."""

    def push(bars: float) -> float:
        found = grown(reference_finger(2, bars), ["10"], (20.0, -16.0), 15.0)
        assert found.shapes.is_there.all()
        return float(found.shapes.push.max())

    rigid = push(np.inf)
    off = [abs(push(bars) - rigid) / rigid for bars in (1e5, 1e6, 1e12, 1e15)]
    assert off[0] / off[1] == pytest.approx(10.0, rel=0.01)
    assert off[2] < 1e-9 and off[3] < 1e-11


def test_a_contact_ahead_is_gone_to_at_once(
    reference_finger: Fingers, begun: Grow, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A finger that nothing touches yet is where it touches after a single step."""
    obstructed, start = begun(reference_finger(2), *RESETS)
    family = obstructed.family(start.inverted, start.active)
    taken: list[int] = []
    one_step = path.one_step

    def told(*args: Any) -> Any:
        taken.append(1)
        return one_step(*args)

    monkeypatch.setattr(path, "one_step", told)
    first = path.follow(family, obstructed.stacked(start), np.zeros(1), np.ones(1))
    assert first.outcome[0] == walk.PathEnd.EVENT and len(taken) == 1
    here = family.measure(first.coordinates)
    assert abs(family.law.margin(here, first.load)[first.cell[0], 0]) < corrector.CROSSED


def test_contacts_that_only_seem_to_be_ahead_do_no_harm(
    reference_finger: Fingers, begun: Grow, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Resets and rest are the same where every step is told of a contact that is not there."""
    obstructed, start = begun(reference_finger(2), *RESETS)
    args = obstructed, start, np.zeros(1), np.ones(1)
    right = approaching.approach(*args)
    told: list[int] = []

    def wrong(here: walk.Walk) -> Array:
        told.append(1)
        return np.where(np.isfinite(here.margin), 1e-3, np.inf)

    monkeypatch.setattr(steps, "to_events_ahead", wrong)
    found = approaching.approach(*args)
    assert told and len(right.resets) == len(found.resets) > 0
    for reset, same in zip(right.resets, found.resets, strict=True):
        assert same.flipped.tolist() == reset.flipped.tolist()
        assert same.load == pytest.approx(reset.load, abs=1e-11)
    assert found.shapes.coordinates == pytest.approx(right.shapes.coordinates, abs=1e-11)


def test_a_gap_that_jumps_shut_from_afar_is_no_contact(
    reference_finger: Fingers, begun: Grow
) -> None:
    """Nothing brings a finger over to there; where it has come to a contact this closes."""
    obstructed, start = begun(reference_finger(2), *RESETS)
    family, x = obstructed.family(start.inverted, start.active), obstructed.stacked(start)
    first = path.follow(family, x, np.zeros(1), np.ones(1))
    wide = replace(first, load=first.load - 0.1)  # the body is as far away as it had to grow
    told = [int(approaching._told(obstructed, start, ends).outcome[0]) for ends in (first, wide)]
    assert told == [walk.PathEnd.EVENT, walk.PathEnd.FAILED]


def test_a_fold_where_a_contact_leaves_a_plate_is_found_exactly() -> None:
    """Jaws whose corner the end of a finger comes to: there the load turns back at a kink."""
    geometry = {"dome_height_mm": 6.054437, "dome_thickness_mm": 0.6857928, "unit_cell_mm": 22}
    geometry |= {"chamber_length_mm": 9, "channel_width_mm": 10, "elastic_modulus_MPa": 26}
    geometry |= {"limiting_layer_thickness_mm": 1.5, "unit_separation_mm": 3}
    finger = {"units": 4, "calibration": "published", "geometry": geometry}
    spec = {
        "finger": finger | {"linear_stiffness_N_per_mm": 1000},
        "gripper": {"base_spacing_mm": 37.588216, "mounting_angle_deg": -3.63988},
        "object": {"jaws": {"gap_mm": 21.777865, "height_mm": 19.82339}, "at_mm": [50.854096, 0]},
    }
    scene = scene_input(spec).scene
    assert scene.body is not None
    codes = np.array([0b1110], np.uint64)
    part = placed(scene, chain_potential, scene.body, frames(scene.gripper)[0], codes)
    load, own = part.grown.resets[0].load, part.own
    pattern = inverted_units(codes, 4)
    x = settle(own.units, chain_potential, pattern, 1e-12).equilibrium.coordinates
    start = finished(own, x, pattern, np.zeros((len(own.are_kept), 1)), np.zeros(1))
    for share, n_resets in ((1.0 - 1e-7, 0), (1.0 + 1e-7, 1)):
        came = approaching.approach(own, start, np.zeros(1), share * load)
        assert len(came.resets) == n_resets, share
