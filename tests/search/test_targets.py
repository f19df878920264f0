"""Targets: the nearest of the states that match, slopes against differences, tips found again."""

from collections.abc import Callable
from time import process_time
from typing import Any

import numpy as np
import pytest

from dpgcli.arrays import Array, Columns, Indices
from dpgcli.search import states as module
from dpgcli.search.descent import Residuals, descend
from dpgcli.search.goal import Goal
from dpgcli.search.targets import TargetEvaluation
from dpgcli.states.certify import Status
from dpgcli.states.rows import solved_rows

Make = Callable[..., Goal]
HEIGHT, SEPARATION = "finger.geometry.dome_height_mm", "finger.geometry.unit_separation_mm"
TWO = f"vary: {{{HEIGHT}: {{from: 4.5, to: 7.5}}, {SEPARATION}: {{from: 2, to: 4}}}}\n"
TIP = "targets: [{{pattern: '{}', quantity: tip, value: [{}, {}], tolerance_mm: 0.5}}]\n"
KEYS = {
    HEIGHT: (5.0, 7.5),
    SEPARATION: (2.0, 3.5),
    "finger.geometry.dome_thickness_mm": (0.6, 0.9),
    "finger.geometry.chamber_length_mm": (8, 10),
    "finger.geometry.limiting_layer_thickness_mm": (1, 2),
    "finger.geometry.elastic_modulus_MPa": (20, 40),
    "finger.overrides.4-5.geometry.dome_height_mm": (5.0, 7.5),
    "finger.linear_stiffness_N_per_mm": (500, 5000),
    "finger.wall_compliance_mm_per_N": (0.1, 0.5),
    "finger.hinge_coupling_N_mm_per_rad": (0.2, 1.0),
    "gripper.base_spacing_mm": (40, 80),
    "gripper.mounting_angle_deg": (-10, 20),
    "loads.tip_force_y_N": (-0.02, 0.02),
    "loads.unit_mass_g": (0.5, 2.0),
}
EVERY = f"vary: {{{', '.join(f'{k}: {{from: {a}, to: {b}}}' for k, (a, b) in KEYS.items())}}}\n"
QUANTITIES = {
    "tip": ("[50, -35]", "mm"),
    "tip_angle_rad": ("-0.9", "rad"),
    "tip_angle_deg": ("-50", "deg"),
    "energy_mJ": ("10", "mJ"),
    "aperture_mm": ("10", "mm"),
    "tip_stiffness_min_N_per_mm": ("0.05", "N_per_mm"),
    "upper_tip_y_mm": ("5", "mm"),
}


def targets(*names: str, pattern: str = "11100") -> str:
    lines = ["targets:"]
    for name in names:
        value, unit = QUANTITIES[name]
        tail = f"quantity: {name}, value: {value}, tolerance_{unit}: 0.5"
        lines.append(f"  - {{pattern: '{pattern}', {tail}}}")
    return "\n".join(lines)


LOADS = "loads={tip_force_y_N: 0.01, unit_mass_g: 1, gravity_direction: x}"
EXACT = ("tip", "tip_angle_rad", "tip_angle_deg", "energy_mJ", "aperture_mm")


def slopes_by_differences(made: Goal, point: Array) -> Array:
    """Fourth-order central differences with a step of 1e-3 of the ranges, (part, range)."""
    n = len(made.ranges)
    steps = np.concatenate([h * np.eye(n) for h in (1e-3, -1e-3, 2e-3, -2e-3)], axis=1)
    values = made.values({}, point + steps)
    found = TargetEvaluation(made)(values)[0].values.reshape(-1, 4, n)
    near, far = found[:, 0] - found[:, 1], found[:, 2] - found[:, 3]
    return np.asarray((8.0 * near - far) / 12e-3)


def test_slopes_are_those_of_differences_by_every_kind_of_key(goal: Make) -> None:
    """Of a design with walls, coupled hinges and loads, in a gripper."""
    made = goal(EVERY + targets(*EXACT), LOADS, base="gripper")
    point = np.random.default_rng(1).uniform(0.2, 0.8, (len(KEYS), 1))
    found, codes = TargetEvaluation(made)(made.values({}, point))
    slopes = slopes_by_differences(made, point)
    scale = np.abs(slopes).max(axis=1)[:, None]
    error = np.abs(found.slopes[..., 0] - slopes)
    assert (error <= 1e-7 * scale).all(), [*KEYS][int((error / scale).max(axis=0).argmax())]
    assert (np.abs(slopes).max(axis=0) > 0.0).all()
    assert (codes == 0b11100).all()


def test_other_slopes_are_differences_within_the_ranges(goal: Make) -> None:
    """At an end of a range, too, where they are those a step inside."""
    made = goal(TWO + targets("tip_stiffness_min_N_per_mm", "upper_tip_y_mm"), base="gripper")
    for point in (np.array([[0.4], [0.6]]), np.array([[0.0], [1.0]])):
        found, _ = TargetEvaluation(made)(made.values({}, point))
        slopes = slopes_by_differences(made, np.clip(point, 2e-3, 1.0 - 2e-3))
        assert found.slopes[..., 0] == pytest.approx(slopes, rel=1e-2)


def test_what_has_no_exact_slope_is_told(goal: Make) -> None:
    made = goal(TWO + targets(*QUANTITIES), base="gripper")
    assert TargetEvaluation(made).by_differences == (
        "tip_stiffness_min_N_per_mm",
        "upper_tip_y_mm",
    )


@pytest.mark.parametrize("pattern", ["11100", "10101"])
def test_own_tips_are_found_again(goal: Make, pattern: str) -> None:
    """From ten random starts nine come to 1e-6 mm, and to the very design."""
    tip = goal(TWO + targets("tip", pattern=pattern))
    own = np.array([[0.62], [0.41]])
    code = TargetEvaluation(tip)(tip.values({}, own))[0].values[:, 0] * 0.5 + [50.0, -35.0]
    made = goal(TWO + TIP.format(pattern, *map(repr, code.tolist())))
    evaluation = TargetEvaluation(made)

    def evaluate(points: Array, _: Indices) -> Residuals:
        return evaluation(made.values({}, points))[0]

    start = np.random.default_rng(7).random((2, 10))
    *_, (descent, _) = descend(evaluate, start)
    assert (descent.misfits * 0.5 <= 1e-6).sum() >= 9
    assert (np.abs(descent.points - own).max(axis=0) < 1e-7).sum() >= 9


def test_the_nearest_of_the_states_that_match_counts(goal: Make) -> None:
    """As each of them by itself says it."""
    several = goal(TWO + TIP.format("1*0", 60, -20))
    points = np.random.default_rng(1).random((2, 4))
    found, codes = TargetEvaluation(several)(several.values({}, points))
    alone = []
    for code in range(16, 32, 2):
        one = goal(TWO + TIP.format(f"{code:05b}", 60, -20))
        alone.append(TargetEvaluation(one)(one.values({}, points))[0].values)
    squares = (np.array(alone) ** 2).sum(axis=1)
    assert (found.values**2).sum(axis=0) == pytest.approx(squares.min(axis=0), rel=1e-12)
    assert codes[0].tolist() == (16 + 2 * squares.argmin(axis=0)).tolist()


def test_without_the_state_or_the_finger_there_is_nothing(goal: Make) -> None:
    """111 is no pattern of two units, and a stroke below zero no finger."""
    made = goal("vary: {finger.units: [2, 3]}\n" + TIP.format("111", 36, -16), base="three_unit")
    found, _ = TargetEvaluation(made)({"finger.units": np.array([2, 3])})
    assert np.isnan(found.values).all(axis=0).tolist() == [True, False]
    lines = f"vary: {{{SEPARATION}: {{from: 2, to: 8}}}}\n"
    made = goal(lines + TIP.format("111", 36, -16), base="three_unit")
    found, _ = TargetEvaluation(made)({SEPARATION: np.array([7.0, 3.0])})
    assert np.isnan(found.values).all(axis=0).tolist() == [True, False]


def test_designs_are_the_same_alone_and_in_a_batch(goal: Make) -> None:
    made = goal(TWO + TIP.format("1*", 60, -20))
    points = np.random.default_rng(1).random((2, 5))
    together, codes = TargetEvaluation(made)(made.values({}, points))
    for k in range(5):
        alone, code = TargetEvaluation(made)(made.values({}, points[:, [k]]))
        assert np.array_equal(alone.values[:, 0], together.values[:, k])
        assert np.array_equal(alone.slopes[..., 0], together.slopes[..., k])
        assert code[:, 0].tolist() == codes[:, k].tolist()


def test_only_certified_states_count(goal: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """A marginal one has numbers, too."""
    made = goal(TWO + TIP.format("11100", 52, -38))
    point = made.values({}, np.array([[0.5], [0.5]]))
    assert not np.isnan(TargetEvaluation(made)(point)[0].values).any()

    def marginal(*arguments: Any) -> Columns:
        rows = solved_rows(*arguments)
        return {**rows, "status": np.full_like(rows["status"], Status.MARGINAL)}

    monkeypatch.setattr(module, "solved_rows", marginal)
    assert np.isnan(TargetEvaluation(made)(point)[0].values).all()


@pytest.mark.slow
def test_many_starts_cost_little_more_than_one(goal: Make) -> None:
    """In CPU time, both in turn, of three rounds the least."""
    made = goal(TWO + TIP.format("11100", 52, -38))
    evaluation = TargetEvaluation(made)

    def cost(n_starts: int) -> float:
        point = np.random.default_rng(1).random((2, n_starts))
        began = process_time()
        for _ in range(5):
            evaluation(made.values({}, point))
        return process_time() - began

    one, many = np.min([(cost(1), cost(32)) for _ in range(3)], axis=0)
    assert many < 4.0 * one
