"""Sequences of pulses: against independent hysterons, replays, margins, ties, look-up tables."""

from collections import deque
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from dpgcli.actuation.alone import thresholds_alone
from dpgcli.actuation.directions import Directions
from dpgcli.actuation.graph import reachable
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.pulses import Pulse, intervals, replayed, routes, shortest
from dpgcli.actuation.sequences import pulse_sequence
from dpgcli.mechanics.finger import Finger

Study = Callable[..., Finger]
Made = Callable[..., Pressed]
State = tuple[bool, ...]
GRADED = np.array([[3.5], [3.5], [3.5], [4.5], [4.5]])
STROKES = np.array([[3.5], [3.4], [3.6], [3.7]])
LINEARITIES = np.array([[0.043], [0.0], [0.06], [0.02]])
ONE, TWO = np.zeros(4, np.int64), np.array([0, 1, 0, 1])


def state_of(code: int, n_units: int) -> State:
    return tuple(digit == "1" for digit in f"{code:0{n_units}b}")


def test_a_graded_finger_takes_one_pulse_to_the_units_that_snap_first(
    study: Study, pressed: Made
) -> None:
    """The study's 11100 lies midway between the thresholds of its two heights."""
    own, line = pressed(study(5).changed(stroke=GRADED)), np.zeros(5, np.int64)
    alone = thresholds_alone(own)
    found = pulse_sequence(own, line, 0, 0b11100)
    assert found.holds
    assert found.pulses is not None
    (pulse,) = found.pulses
    low, high = alone.snap[0, 0], alone.snap[4, 0]
    assert pulse.peak == pytest.approx(0.5 * (low + high), rel=1e-6)
    assert pulse.margin == pytest.approx(0.5 * (high - low), rel=1e-5)
    assert found.replay is not None
    assert found.replay.at_peak == found.replay.after == (0b11100,)
    assert found.replay.ties == (((0, 1, 2),),)


def test_up_and_down_leaves_the_units_that_reset_last(study: Study, pressed: Made) -> None:
    own, line = pressed(study(5).changed(stroke=GRADED)), np.zeros(5, np.int64)
    alone = thresholds_alone(own)
    found = pulse_sequence(own, line, 0, 0b00011)
    assert found.holds
    assert found.pulses is not None
    first, second = found.pulses
    assert first.is_open
    assert first.peak == pytest.approx(1.1 * alone.snap[4, 0], rel=1e-6)
    assert first.margin == pytest.approx(0.1 * alone.snap[4, 0], rel=1e-6)
    assert second.peak == pytest.approx(0.5 * (alone.reset[0, 0] + alone.reset[4, 0]), rel=1e-6)
    assert second.margin > 0.0


def test_nothing_leads_between_equal_units_and_no_pulse_to_where_one_is(
    study: Study, pressed: Made
) -> None:
    own, line = pressed(study(3)), np.zeros(3, np.int64)
    missed = pulse_sequence(own, line, 0, 0b101)
    assert missed.pulses is None
    assert not missed.holds
    assert missed.graph.code.tolist() == [0b000, 0b111]
    there = pulse_sequence(own, line, 0b101, 0b101)
    assert there.pulses == ()
    assert there.holds


def test_no_pulse_leads_to_where_a_finger_with_walls_is(study: Study, pressed: Made) -> None:
    own = pressed(study(3).changed(wall_compliance=np.array([[0.3]])))
    there = pulse_sequence(own, np.zeros(3, np.int64), 0, 0)
    assert there.pulses == ()
    assert there.holds


@pytest.mark.parametrize("lines", [ONE, TWO])
def test_sequences_between_rigid_bars_are_as_short_as_those_of_hysterons(
    study: Study, pressed: Made, hysterons: Any, lines: np.ndarray[Any, Any]
) -> None:
    """Breadth first through a Preisach model of its own, and with margins as good as any."""
    finger = study(4, np.inf).changed(stroke=STROKES, force_linearity=LINEARITIES)
    own = pressed(finger)
    alone = thresholds_alone(own)
    reach = float(alone.reach[0])
    peer = hysterons(tuple(alone.snap[:, 0]), tuple(alone.reset[:, 0]), tuple(lines.tolist()))
    graph = reachable(own, lines, alone.reach)
    n_several = 0
    for code in range(16):
        expected = best_of(peer, state_of(code, 4), reach, len(set(lines.tolist())))
        found = shortest(graph, reach, 0, code)
        assert (found is None) == (expected is None)
        if found and expected:
            n_pulses, margin = expected
            assert len(found) == n_pulses
            assert min(pulse.margin for pulse in found) == pytest.approx(margin, rel=1e-8)
            assert replayed(own, lines, 0, found).problem == ""
            n_several += n_pulses > 1
    assert n_several > (3 if lines.any() else 0)


def best_of(peer: Any, target: State, reach: float, n_lines: int) -> tuple[int, float] | None:
    """Fewest pulses from rest, and their largest smallest margin: all paths, one after another."""
    rest = (False,) * len(target)
    if target == rest:
        return 0, np.inf
    best: dict[State, tuple[int, float]] = {rest: (0, np.inf)}
    todo = deque([rest])
    while todo:
        state = todo.popleft()
        n, margin = best[state]
        for line in range(n_lines):
            for sign in (1, -1):
                for start, stop, after in peer.pulses(state, line, sign, reach):
                    is_open = abs(stop) >= reach
                    own = 0.1 * abs(start) if is_open else 0.5 * abs(stop - start)
                    new = (n + 1, min(margin, own))
                    old = best.get(after)
                    if old is None or (new[0] == old[0] and new[1] > old[1]):
                        best[after] = new
                        todo.append(after)
    return best.get(target)


def test_a_replay_that_ends_elsewhere_says_so(study: Study, pressed: Made) -> None:
    own, line = pressed(study(5).changed(stroke=GRADED)), np.zeros(5, np.int64)
    wrong = Pulse(0, 0.16, 0.15, 0.17, 0, 0b11111, False)
    replay = replayed(own, line, 0, [wrong])
    assert replay.problem == "pulse 1 ends in 11100, not in 11111"
    assert replay.after == (0b11100,)
    far = Pulse(0, 1e3, 0.15, 2e3, 0, 0b11111, True)
    assert replayed(own, line, 0, [far]).problem


@pytest.mark.parametrize("code", [0b0000, 0b1011, 0b1111])
def test_a_look_up_table_is_that_of_hysterons(
    study: Study, pressed: Made, hysterons: Any, code: int
) -> None:
    own = pressed(study(4, np.inf).changed(stroke=STROKES, force_linearity=LINEARITIES))
    alone = thresholds_alone(own)
    peer = hysterons(tuple(alone.snap[:, 0]), tuple(alone.reset[:, 0]), (0, 1, 0, 1))
    towards = Directions.of(np.zeros(1, np.int64), np.array([code], np.uint64), 2)
    found = intervals(own, TWO, alone.reach, towards)
    for lane, (line, sign) in enumerate(((0, 1), (0, -1), (1, 1), (1, -1))):
        rows = found.take(np.flatnonzero(found.lane == lane))
        state = state_of(code, 4)
        fields = [0.0, *peer.thresholds(state, line, sign), sign * float(alone.reach[0])]
        assert rows.low == pytest.approx(np.array(fields[:-1]), rel=1e-9)
        assert rows.high == pytest.approx(np.array(fields[1:]), rel=1e-9)
        ends = [peer.at(state, line, 0.5 * (low + high)) for low, high in pairwise(fields)]
        assert [state_of(after, 4) for after in rows.after] == ends
        assert [state_of(peak, 4) for peak in rows.at_peak] == ends
        assert not rows.is_tie.any()


@pytest.mark.slow
def test_routes_are_the_shortest_to_every_state(study: Study, pressed: Made) -> None:
    own = pressed(study(3, np.inf).changed(stroke=STROKES[:3]))
    line, reach = np.array([0, 1, 0]), thresholds_alone(own).reach
    graph = reachable(own, line, reach)
    assert len(graph.code) > 4
    for start in graph.code.tolist():
        found = routes(graph, float(reach[0]), start)
        alone = reachable(own, line, reach, np.array([start], np.uint64))
        lengths = {code: len(pulses) for code, pulses in found.items()}
        assert lengths == dict(zip(alone.code.tolist(), alone.n_pulses.tolist(), strict=True))
        for code, pulses in found.items():
            ends = [start, *(pulse.target for pulse in pulses)]
            assert ends == [*(pulse.source for pulse in pulses), code]
    assert routes(graph, float(reach[0]), 99) == {}
