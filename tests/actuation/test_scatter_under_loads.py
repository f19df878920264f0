"""Scatter of fingers that loads bring to other states: each draw by where it rests itself."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from dpgcli.actuation import scatter, transition_scatter
from dpgcli.actuation.pressed import Pressed, Shapes
from dpgcli.actuation.scatter import begins, reliability
from dpgcli.actuation.sequences import pulse_sequence
from dpgcli.actuation.transition_scatter import spread_rows
from dpgcli.actuation.transitions import state_graph
from dpgcli.arrays import Codes, Flags
from dpgcli.design.scene import Scene
from dpgcli.files.scene_file import read_spec, scene_of
from dpgcli.states.certify import Settled, Status
from dpgcli.states.units import UnitSolutions

SPEC = Path(__file__).parents[2] / "configs" / "five_unit.yaml"
LATTICE = (
    "{segment_length_mm: 13.5, segment_height_mm: 10.75, stroke_mm: 3.5, force_linearity: 0.043, "
    "bistable_stiffness_N_per_mm: 12.84, hinge_stiffness_N_mm_per_rad: 24.2}"
)
SETTINGS = (
    f"finger={{units: 2, linear_stiffness_N_per_mm: .inf, lattice: {LATTICE}}}",
    "pressure={lines: {A: 1, B: 2}, effective_area_mm2: 31.61}",
    "loads.tip_moment_N_mm=-50.9",
)
LINES = np.array([0, 1])
FIRST = [12.4, 13.4]  # N/mm: under this couple the softer unit snaps by itself, the other does not


@cache
def loaded() -> Scene:
    return scene_of(read_spec(SPEC, [*SETTINGS]))


def two(first: list[float]) -> Pressed:
    """Fingers whose first units have these stiffnesses."""
    scene = loaded()
    assert scene.pressure is not None
    stiffness = np.array([first, [20.0] * len(first)])
    finger = scene.finger.changed(bistable_stiffness=stiffness)
    return Pressed.of(UnitSolutions.of(finger), scene.pressure)


@pytest.mark.parametrize(
    ("first", "target", "from_rest", "expected"),
    [
        (12.4, 0b11, True, (1, 0, [1])),  # a pulse on B inverts its unit, wherever the other is
        (12.4, 0b11, False, (2, 0, [2])),
        (12.4, 0b10, True, (1, 0, [])),
        (13.4, 0b10, True, (1, 0, [2])),  # 10 stays on a pulse up of A
        (13.4, 0b10, False, (1, 1, [1])),
    ],
)
def test_each_draw_begins_where_it_rests(
    first: float, target: int, *, from_rest: bool, expected: tuple[int, int, list[int]]
) -> None:
    """Of two draws; the plan is that of a finger that rests as the one or the other."""
    start = 0b10 if first == FIRST[0] else 0b00
    plan = pulse_sequence(two([first]), LINES, start, target)
    assert plan.holds
    found = reliability([(np.arange(2), two(FIRST))], LINES, plan, 2, 0.5, from_rest=from_rest)
    assert (found.n_begun, found.n_unknown, found.n_led.tolist()) == expected
    assert found.n_done == (expected[2] or expected[:1])[-1]


def test_the_softer_draw_rests_elsewhere() -> None:
    """It has no state 00 under the couple, the other has."""
    draws = two(FIRST)
    assert begins(draws, 2, None).tolist() == [0b10, 0b00]
    assert begins(draws, 2, 0b00).tolist() == [-1, 0b00]


def test_later_pulses_make_up_for_another_rest() -> None:
    """By the plan of two pulses that a finger in 00 needs to 11, whichever is the first."""
    plan = pulse_sequence(two(FIRST[1:]), LINES, 0b00, 0b11)
    assert plan.pulses is not None
    assert len(plan.pulses) == 2
    found = reliability([(np.arange(2), two(FIRST))], LINES, plan, 2, 0.5, from_rest=True)
    is_through_10 = plan.pulses[0].target == 0b10
    assert (found.n_begun, found.n_led.tolist()) == (1, [1 + is_through_10, 2])
    given = reliability([(np.arange(2), two(FIRST))], LINES, plan, 2, 0.5, from_rest=False)
    assert (given.n_begun, given.n_unknown, given.n_led.tolist()) == (1, 1, [1, 1])


def test_draws_of_unknown_rest_are_led_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    def doubtful(pressed: Pressed, n_designs: int) -> tuple[Codes, Flags]:
        return np.full(n_designs, 0b10, np.uint64), np.arange(n_designs) != 0

    monkeypatch.setattr(scatter, "rests", doubtful)
    plan = pulse_sequence(two(FIRST[:1]), LINES, 0b10, 0b11)
    found = reliability([(np.arange(2), two(FIRST))], LINES, plan, 3, 0.5, from_rest=True)
    assert (found.n_begun, found.n_unknown, found.n_led.tolist()) == (1, 1, [1])


def test_draws_without_a_state_do_not_stay_in_it() -> None:
    """Of two fingers and a draw that is none: the softer one has no 00 and no 01."""
    own = two(FIRST[1:])
    graph = state_graph(own, LINES)
    rows = graph.transitions
    found = spread_rows([(np.arange(2), two(FIRST))], LINES, graph.reach, rows, 3)
    has_none = (rows.code == 0b00) | (rows.code == 0b01)
    assert found["share_without_state"] == pytest.approx(np.where(has_none, 2 / 3, 1 / 3))
    n_leaving = np.where(rows.unit < 0, 0, np.where(has_none, 1, 2))
    assert found["share_leaving"] == pytest.approx(n_leaving / 3)
    assert (found["share_unknown"] == 0.0).all()


@pytest.mark.parametrize("status", [*Status])
def test_what_is_not_decided_is_unknown(status: Status, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if the first of two draws had another status: each by itself."""
    own = two(FIRST[1:])
    graph = state_graph(own, LINES)
    at_rest = transition_scatter.at_rest

    def other(pressed: Pressed, inverted: Flags) -> tuple[Shapes, Settled]:
        shapes, settled = at_rest(pressed, inverted)
        changed = settled.status.copy()
        changed[::2] = status
        return shapes, replace(settled, status=changed)

    monkeypatch.setattr(transition_scatter, "at_rest", other)
    both = [(np.arange(2), two(FIRST[1:] * 2))]
    found = spread_rows(both, LINES, graph.reach, graph.transitions, 2)
    is_unknown = status in (Status.MARGINAL, Status.NOT_CONVERGED)
    is_none = not is_unknown and status is not Status.STABLE
    assert (found["share_unknown"] == 0.5 * is_unknown).all()
    assert (found["share_without_state"] == 0.5 * is_none).all()
