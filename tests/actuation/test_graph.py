"""The graph of states: against independent hysterons, ties, batches of designs, what is lost."""

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from dpgcli.actuation import directions
from dpgcli.actuation.alone import thresholds_alone
from dpgcli.actuation.graph import Graph, Pulses, reachable
from dpgcli.actuation.pressed import Pressed
from dpgcli.arrays import Array
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.states.units import UnitSolutions

Study = Callable[..., Finger]
Made = Callable[..., Pressed]
State = tuple[bool, ...]
STROKES = np.array([[3.5], [3.4], [3.6], [3.7]])
LINES = np.array([0, 1, 0, 1])


def state_of(code: int, n_units: int) -> State:
    return tuple(digit == "1" for digit in f"{code:0{n_units}b}")


def test_pulses_between_rigid_bars_are_those_of_independent_hysterons(
    study: Study, pressed: Made, hysterons: Any
) -> None:
    """Stiffness and area differ by unit, so that the order of resets is not that of snaps."""
    finger = study(4, np.inf).changed(
        stroke=STROKES, force_linearity=np.array([[0.043], [0.0], [0.06], [0.02]])
    )
    own = pressed(finger)
    alone = thresholds_alone(own)
    reach = alone.reach
    peer = hysterons(tuple(alone.snap[:, 0]), tuple(alone.reset[:, 0]), (0, 1, 0, 1))
    assert np.argsort(alone.snap[:, 0]).tolist() != np.argsort(-alone.reset[:, 0]).tolist()
    found = reachable(own, LINES, reach)
    pulses = found.pulses
    known = {state_of(int(code), 4) for code in found.code}
    n = 0
    for state in known:
        code = int("".join(str(int(bit)) for bit in state), 2)
        for line in (0, 1):
            for sign in (1, -1):
                expected = peer.pulses(state, line, sign, float(reach[0]))
                own_pulses = np.flatnonzero(
                    (pulses.source == code) & (pulses.line == line) & (pulses.sign == sign)
                )
                n += len(expected)
                assert len(own_pulses) == len(expected)
                for place, (start, stop, target) in zip(own_pulses, expected, strict=True):
                    assert pulses.start[place] == pytest.approx(start, rel=1e-9)
                    assert pulses.stop[place] == pytest.approx(stop, rel=1e-9)
                    assert state_of(int(pulses.target[place]), 4) == target
    assert len(pulses.start) == n > 30
    assert not pulses.is_tie.any()


@pytest.mark.parametrize("lines", [(0, 0, 0, 0), (0, 1, 0, 1), (0, 1, 2, 3)])
def test_the_states_reached_are_those_that_hysterons_reach(
    study: Study, pressed: Made, hysterons: Any, lines: tuple[int, ...]
) -> None:
    """Resets in the order of snaps or not: with one line it decides what can be reached."""
    linearity = np.array([[0.0], [0.03], [0.06], [0.08]])
    n_reached = []
    for changes in ({}, {"force_linearity": linearity}):
        own = pressed(study(4, np.inf).changed(stroke=np.sort(STROKES, axis=0), **changes))
        alone = thresholds_alone(own)
        peer = hysterons(tuple(alone.snap[:, 0]), tuple(alone.reset[:, 0]), lines)
        found = reachable(own, np.array(lines), alone.reach)
        assert {state_of(int(code), 4) for code in found.code} == peer.reached()
        assert found.n_lost == 0
        n_reached.append(len(found.code))
    assert (n_reached[0] == n_reached[1]) == (len(set(lines)) == 4)


def test_a_finger_returns_to_the_point_where_it_turned(study: Study, pressed: Made) -> None:
    """Return-point memory: after a smaller pulse and its undoing, the greater one goes on."""
    own = pressed(study(4, np.inf).changed(stroke=STROKES))
    reach = thresholds_alone(own).reach
    pulses = reachable(own, np.zeros(4, np.int64), reach).pulses

    def after(code: int, peak: float) -> int:
        inside = (pulses.source == code) & (pulses.sign == np.sign(peak))
        inside &= (np.abs(pulses.start) <= abs(peak)) & (abs(peak) < np.abs(pulses.stop))
        place = np.flatnonzero(inside)
        return int(pulses.target[place[0]]) if len(place) else code

    snaps = np.sort(thresholds_alone(own).snap[:, 0])
    peaks = 0.5 * (snaps[1:] + snaps[:-1])
    for turned in peaks:
        there = after(0, turned)
        for low in np.linspace(-0.0645, -0.06, 7):
            for high in peaks[peaks <= turned]:
                back = after(after(there, low), turned)
                assert back == there
                assert after(after(after(there, low), high), turned) == there


def test_equal_units_on_one_line_go_together_and_the_pulse_says_so(
    study: Study, pressed: Made
) -> None:
    strokes = np.array([[3.5], [3.5], [3.5], [4.5], [4.5]])
    own = pressed(study(5).changed(stroke=strokes))
    found = reachable(own, np.zeros(5, np.int64), thresholds_alone(own).reach)
    from_rest = found.pulses.take(np.flatnonzero(found.pulses.source == 0))
    assert from_rest.target.tolist() == [0b11100, 0b11111]
    assert from_rest.is_tie.tolist() == [True, True]
    assert from_rest.stop[0] == from_rest.start[1]


def test_a_tie_says_nothing_of_the_pulses_before_it(study: Study, pressed: Made) -> None:
    own = pressed(study(3, np.inf).changed(stroke=np.array([[3.5], [4.5], [4.5]])))
    found = reachable(own, np.zeros(3, np.int64), thresholds_alone(own).reach)
    from_rest = found.pulses.take(np.flatnonzero(found.pulses.source == 0))
    assert from_rest.target.tolist() == [0b100, 0b111]
    assert from_rest.is_tie.tolist() == [False, True]


def test_what_comes_after_a_tie_on_the_way_rests_on_it(study: Study, pressed: Made) -> None:
    own = pressed(study(3, np.inf).changed(stroke=np.array([[3.5], [3.5], [4.5]])))
    found = reachable(own, np.zeros(3, np.int64), thresholds_alone(own).reach)
    from_rest = found.pulses.take(np.flatnonzero(found.pulses.source == 0))
    assert from_rest.target.tolist() == [0b110, 0b111]
    assert from_rest.is_tie.tolist() == [True, True]


def both(one: Array, other: Array) -> Array:
    return np.concatenate((one, other), axis=1)


@pytest.mark.slow
def test_designs_in_one_batch_do_not_feel_each_other(
    study: Study, pressed: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor does the size of the batches matter: to the last bit."""
    strokes = [np.array([[3.5], [3.4], [3.7]]), np.array([[4.5], [3.5], [4.0]])]
    lines = np.array([0, 0, 1])
    own = [pressed(study(3).changed(stroke=stroke)) for stroke in strokes]
    reach = np.array([0.4, 0.5])
    alone = [reachable(one, lines, reach[k : k + 1]) for k, one in enumerate(own)]
    together = pressed(study(3).changed(stroke=both(*strokes)))
    monkeypatch.setattr(directions, "lanes_at_once", lambda n_units: 5)
    found = reachable(together, lines, reach)
    for design in (0, 1):
        assert same(of_design(found, design), alone[design])


def of_design(found: Graph, design: int) -> Graph:
    which = np.flatnonzero(found.design == design)
    pulses = found.pulses.take(np.flatnonzero(found.pulses.design == design))
    return Graph(
        which * 0, found.code[which], found.n_pulses[which], pulses, found.n_lost, found.n_unknown
    )


def same(one: Graph, other: Graph) -> bool:
    columns = [field.name for field in fields(Pulses) if field.name != "design"]
    return all(
        np.array_equal(getattr(one.pulses, name), getattr(other.pulses, name)) for name in columns
    ) and np.array_equal(one.code, other.code)


def test_a_start_that_is_no_state_reaches_nothing(study: Study, pressed: Made) -> None:
    """The second design's domes have no second well; the first one's graph is as it was."""
    linearity = np.array([[0.043, 0.3]])
    own = pressed(study(2).changed(force_linearity=linearity))
    found = reachable(own, np.zeros(2, np.int64), np.array([0.3, 0.3]), np.full(2, 3, np.uint64))
    assert np.unique(found.design).tolist() == [0]
    assert found.code[0] == 3
    nothing = reachable(
        own.take_lanes(np.array([1])),
        np.zeros(2, np.int64),
        np.array([0.3]),
        np.full(1, 3, np.uint64),
    )
    assert len(nothing.code) == len(nothing.pulses.start) == 0


def test_units_alone_have_their_own_area(study: Study) -> None:
    """Half the area, twice the pressure."""
    finger = study(2, np.inf)
    areas = DomeVolumes(np.array([[31.61], [31.61 / 2.0]]))
    alone = thresholds_alone(Pressed(UnitSolutions.of(finger), areas))
    np.testing.assert_allclose(alone.snap[1], 2.0 * alone.snap[0], rtol=1e-9)
    np.testing.assert_allclose(alone.reset[1], 2.0 * alone.reset[0], rtol=1e-9)
    assert alone.reach[0] == pytest.approx(2.0 * alone.snap[1, 0], rel=1e-12)


def test_a_unit_that_is_not_bistable_has_no_thresholds(study: Study, pressed: Made) -> None:
    linearity = np.array([[0.043], [0.3]])
    alone = thresholds_alone(pressed(study(2).changed(force_linearity=linearity)))
    assert np.isnan(alone.snap).ravel().tolist() == [False, True]
    assert np.isnan(alone.reset).ravel().tolist() == [False, True]
    none = thresholds_alone(pressed(study(2).changed(force_linearity=np.array([[0.3]]))))
    assert none.reach.tolist() == none.furthest.tolist()
    assert none.furthest[0] > 1.0


def test_peaks_are_parted_by_thresholds_that_only_show_under_pressure(
    study: Study, pressed: Made
) -> None:
    """A unit without a second well snaps as well, and is back after the pulse."""
    linearity = np.array([[0.043], [0.1]])  # lost near 0.096, the hinge included
    own = pressed(study(2, np.inf).changed(force_linearity=linearity))
    pulses = reachable(own, np.array([0, 0]), np.array([0.3])).pulses
    up = pulses.take(np.flatnonzero((pulses.source == 0) & (pulses.sign > 0)))
    assert up.target.tolist() == [2, 2]
    np.testing.assert_array_equal(up.stop, [up.start[1], 0.3])
    assert up.start[0] == pytest.approx(0.1495, rel=1e-6)
