"""First transitions of every state: against independent hysterons, ties, ends without one."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dpgcli.actuation import directions, graph
from dpgcli.actuation.alone import thresholds_alone
from dpgcli.actuation.graph import reachable, reached_from_rest, stable_states
from dpgcli.actuation.pressed import Halt, Pressed
from dpgcli.actuation.transition_table import transition_rows
from dpgcli.actuation.transitions import Departure, StateGraph, state_graph
from dpgcli.arrays import Columns
from dpgcli.design.pressure import Pressure
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.laws import PUBLISHED, PushOnly

Study = Callable[..., Finger]
Made = Callable[..., Pressed]
LINES = np.array([0, 1, 0, 1])
STROKES = np.array([[3.5], [3.4], [3.6], [3.7]])


def table(found: StateGraph, line_of: np.ndarray) -> Columns:
    names = tuple("ABCD"[: int(line_of.max()) + 1])
    rows = transition_rows(found.transitions, Pressure(names, line_of, None, None))
    return {name: np.asarray(values.astype(str)) for name, values in rows.items()} | {
        "pressure_MPa": rows["pressure_MPa"]
    }


@pytest.mark.parametrize("linearity", [0.043, [[0.0], [0.03], [0.06], [0.08]]])
def test_between_rigid_bars_it_is_the_graph_of_independent_hysterons(
    study: Study, pressed: Made, hysterons: Any, linearity: Any
) -> None:
    alpha = np.broadcast_to(linearity, (4, 1)).copy()
    own = pressed(study(4, np.inf).changed(stroke=STROKES, force_linearity=alpha))
    alone = thresholds_alone(own)
    peer = hysterons(tuple(alone.snap[:, 0]), tuple(alone.reset[:, 0]), tuple(LINES))
    rows = table(state_graph(own, LINES), LINES)
    n = 0
    for row in zip(*rows.values(), strict=True):
        found = dict(zip(rows, row, strict=True))
        state = tuple(digit == "1" for digit in found["pattern"])
        line, sign = "AB".index(found["line"]), {"+": 1, "-": -1}[found["direction"]]
        fields = peer.thresholds(state, line, sign)
        n += bool(fields)
        if not fields:
            assert np.isnan(found["pressure_MPa"])
            assert found["unit"] == found["pattern_after"] == found["reached_at_pressure"] == ""
            assert found["note"].startswith("no unit leaves")
            continue
        assert found["pressure_MPa"] == pytest.approx(fields[0], rel=1e-9)
        after = peer.at(state, line, fields[0])
        assert found["pattern_after"] == "".join("01"[int(up)] for up in after)
        assert found["reached_at_pressure"] == found["pattern_after"]
        assert [k + 1 for k in range(4) if after[k] != state[k]] == [int(found["unit"])]
        assert found["tie"] == found["note"] == ""
    assert n == 48
    assert len(rows["pattern"]) == 64


def test_columns_are_those_of_the_interface() -> None:
    from dpgcli.actuation.transition_table import COLUMNS

    assert [column.name for column in COLUMNS] == [
        "pattern", "line", "direction", "pressure_MPa", "unit", "reached_at_pressure",
        "pattern_after", "tie", "note",
    ]  # fmt: skip


def test_equal_units_are_a_tie_and_the_numbers_decide_their_order_on_paper(
    study: Study, pressed: Made
) -> None:
    strokes = np.array([[3.5], [3.5], [3.5], [4.5], [4.5]])
    line = np.zeros(5, np.int64)
    rows = table(state_graph(pressed(study(5).changed(stroke=strokes)), line), line)
    found = {
        (pattern, direction): (unit, after, tie)
        for pattern, direction, unit, after, tie in zip(
            *(rows[name] for name in ("pattern", "direction", "unit", "pattern_after", "tie")),
            strict=True,
        )
    }
    assert found["00000", "+"] == ("1,2,3", "11100", "2,3")
    assert found["11100", "+"] == ("4,5", "11111", "5")
    assert found["10000", "+"] == ("2,3", "11100", "3")
    assert found["11000", "+"] == ("3", "11100", "")
    assert found["00011", "-"] == ("4,5", "00000", "5")


def test_how_far_pressures_go_is_said(study: Study, pressed: Made) -> None:
    own = pressed(study(2).changed(stroke=np.array([[3.5], [4.5]])))
    alone, found = thresholds_alone(own), state_graph(own, np.zeros(2, np.int64))
    assert found.reach == pytest.approx(2.0 * alone.snap[1, 0], rel=1e-15)
    rows = table(found, np.zeros(2, np.int64))
    notes = [note for note in rows["note"].tolist() if note]
    assert notes == [
        f"no unit leaves down to -{found.reach:.4g} MPa",
        f"no unit leaves up to {found.reach:.4g} MPa",
    ]


def test_states_that_are_none_are_left_out(study: Study, pressed: Made) -> None:
    """The second unit has no second well."""
    own = pressed(study(2).changed(force_linearity=np.array([[0.043], [0.3]])))
    found = state_graph(own, np.zeros(2, np.int64))
    assert found.is_stable.tolist() == [True, False, True, False]
    assert found.transitions.code.tolist() == [0, 0, 2, 2]
    assert found.is_reached.tolist() == found.is_stable.tolist()


def test_a_finger_without_any_well_stays(study: Study, pressed: Made) -> None:
    own = pressed(study(2).changed(force_linearity=np.array([[0.3]])))
    found = state_graph(own, np.zeros(2, np.int64))
    assert found.transitions.code.tolist() == [0, 0]
    assert set(found.transitions.outcome.tolist()) <= {Departure.STAYS, Departure.FOLDS}
    assert found.is_reached.tolist() == [True, False, False, False]


def test_a_unit_that_does_not_stay_inverted_comes_back(study: Study, pressed: Made) -> None:
    """The dome has a second well by itself (α < 1/9), not with its hinge (α > 0.096)."""
    own = pressed(study(1, np.inf).changed(force_linearity=np.array([[0.1]])))
    line = np.zeros(1, np.int64)
    found = state_graph(own, line)
    rows = table(found, line)
    assert rows["pattern"].tolist() == ["0", "0"]
    assert rows["reached_at_pressure"].tolist() == ["1", ""]
    assert rows["pattern_after"].tolist() == ["0", ""]
    alone = thresholds_alone(own)
    assert rows["pressure_MPa"][0] == pytest.approx(alone.snap[0, 0], rel=1e-12)
    assert np.isnan(alone.reset).all()
    assert len(reachable(own, line, alone.reach).pulses.start) == 0


def test_a_finger_with_no_stable_state_has_no_rows(study: Study, pressed: Made) -> None:
    """A dome that only pushes does not hold a unit without a hinge."""
    finger = study(1).changed(hinge_stiffness=np.zeros((1, 1)))
    own = pressed(type(finger)(**{**vars(finger), "law": PushOnly(PUBLISHED)}))
    found = state_graph(own, np.zeros(1, np.int64))
    assert not found.is_stable.any()
    assert len(found.transitions.code) == 0
    assert not found.is_reached.any()


def test_contact_and_release_are_no_transitions(study: Study, pressed: Made) -> None:
    """A dome that only pushes leaves its neighbor before it snaps or resets."""
    finger = study(2)
    own = pressed(type(finger)(**{**vars(finger), "law": PushOnly(PUBLISHED)}))
    found = state_graph(own, np.array([0, 1]))
    moves = found.transitions.take(np.flatnonzero(found.transitions.outcome == Departure.LEAVES))
    flipped = [int(code).bit_count() for code in moves.flipped]
    assert len(moves.code) == 8
    assert flipped == [1] * 8
    assert found.is_reached.all()


def test_one_state_that_fails_does_not_spoil_the_others(
    study: Study, pressed: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, line = pressed(study(3).changed(stroke=STROKES[:3])), np.zeros(3, np.int64)
    healthy = state_graph(own, line).transitions
    followed = Pressed.followed

    def failing(self: Pressed, shapes: Any, target: Any, *rest: Any) -> Any:
        halted = followed(self, shapes, target, *rest)
        bad = (shapes.inverted.T == [True, False, True]).all(axis=1) & (target.max(axis=0) > 0.0)
        halted.reason[bad] = Halt.FOLDED
        return halted

    monkeypatch.setattr(Pressed, "followed", failing)
    found = state_graph(own, line).transitions
    row = int(np.flatnonzero((found.code == 0b101) & (found.sign == 1))[0])
    assert found.outcome[row] == Departure.FOLDS
    assert found.after[row] == found.code[row]
    others = np.arange(len(found.code)) != row
    for name in ("pressure", "outcome", "unit", "flipped", "reached", "after"):
        np.testing.assert_array_equal(
            getattr(found, name)[others], getattr(healthy, name)[others], err_msg=name
        )


def test_what_is_left_must_be_the_certified_state(
    study: Study, pressed: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else the row has no state after it, and nothing is reached by it."""
    from dpgcli.actuation import transitions

    def of_none(own: Pressed, shapes: Any) -> Any:
        return ~(shapes.inverted[0] & shapes.inverted[1])

    monkeypatch.setattr(transitions, "is_certified", of_none)
    monkeypatch.setattr(graph, "is_certified", of_none)
    line = np.array([0, 1])
    found = state_graph(pressed(study(2)), line)
    rows = table(found, line)
    astray = found.transitions.outcome == Departure.ASTRAY
    assert rows["reached_at_pressure"][astray].tolist() == ["11", "11"]
    assert rows["pattern_after"][astray].tolist() == ["", ""]
    assert all("no certified state" in note for note in rows["note"][astray])
    assert np.isfinite(rows["pressure_MPa"][astray]).all()
    assert found.is_reached.tolist() == [True, True, True, False]


def test_a_wrong_shape_is_not_certified(study: Study, pressed: Made) -> None:
    from dpgcli.actuation.rest import at_rest, is_certified

    own = pressed(study(2))
    shapes, _ = at_rest(own, np.array([[True, False], [False, False]]))
    assert is_certified(own, shapes).all()
    shapes.coordinates[0, 1] += 1e-3
    assert is_certified(own, shapes).tolist() == [True, False]


@pytest.mark.parametrize("size", [3, 7])
def test_the_size_of_batches_changes_no_bit(
    study: Study, pressed: Made, monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    own = pressed(study(3, 100.0).changed(stroke=STROKES[:3]))
    expected = state_graph(own, np.array([0, 0, 1]))
    for module in (directions, graph):
        monkeypatch.setattr(module, "lanes_at_once", lambda n_units: size)
    found = state_graph(own, np.array([0, 0, 1]))
    for name, values in vars(expected.transitions).items():
        np.testing.assert_array_equal(getattr(found.transitions, name), values, err_msg=name)
    assert (found.is_reached == expected.is_reached).all()


@pytest.mark.parametrize(
    ("strokes", "lines"),
    [
        ([3.5, 3.5, 3.5, 4.5], [0, 0, 0, 0]),
        ([3.5, 3.6, 3.5, 4.5], [0, 1, 0, 1]),
        ([3.5, 3.4, 3.6, 3.7], [0, 0, 0, 0]),
    ],
)
@pytest.mark.slow
def test_states_are_reached_as_the_graph_of_pulses_says(
    study: Study, pressed: Made, strokes: list[float], lines: list[int]
) -> None:
    """Two ways of finding them: first transitions and what these leave out, or all pulses."""
    own = pressed(study(4).changed(stroke=np.array(strokes)[:, None]))
    line_of, reach = np.array(lines), thresholds_alone(own).reach
    by_pulses = reachable(own, line_of, reach)
    by_transitions = state_graph(own, line_of).is_reached
    assert np.flatnonzero(by_transitions).tolist() == sorted(by_pulses.code.tolist())
    alone = reached_from_rest(own, line_of, reach, stable_states(own, 1)).is_reached
    assert (alone[0] == by_transitions).all()


def test_whole_staircases_are_climbed_only_where_states_are_missing(
    study: Study, pressed: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, line = pressed(study(3).changed(stroke=STROKES[:3])), np.zeros(3, np.int64)
    reach, is_stable = thresholds_alone(own).reach, stable_states(own, 1)
    nothing = np.zeros(0, np.int64), np.zeros(0, np.int64)
    found = reached_from_rest(own, line, reach, is_stable, nothing).is_reached
    assert found.all()
    monkeypatch.setattr(graph, "_pulses", None)  # not asked
    all_known = np.zeros(7, np.int64), np.arange(1, 8)
    assert reached_from_rest(own, line, reach, is_stable, all_known).is_reached.all()


@pytest.mark.parametrize("rigid", [0, 1])
def test_units_whose_walls_are_rigid_stand_beside_others(
    study: Study, pressed: Made, rigid: int
) -> None:
    """Thresholds of each by itself; those of the rigid one, in doubt, are searched on their own."""
    soft, stiff = study(1).changed(wall_compliance=np.array([[0.1]])), study(1)
    stiff = stiff.changed(bistable_stiffness=np.array([[20.0]]), hinge_stiffness=np.array([[1.3]]))
    units = [stiff, soft] if rigid == 0 else [soft, stiff]
    names = ("bistable_stiffness", "hinge_stiffness", "wall_compliance")
    by_unit = {name: np.concatenate([getattr(unit, name) for unit in units]) for name in names}
    found = thresholds_alone(pressed(study(2).changed(**by_unit)))
    each = [thresholds_alone(pressed(unit)) for unit in units]
    for name in ("snap", "reset"):
        expected = np.concatenate([getattr(one, name) for one in each])
        assert getattr(found, name) == pytest.approx(expected, rel=1e-9)
