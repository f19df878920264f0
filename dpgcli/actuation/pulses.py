"""Sequences of pulses from one state to another: searched in the graph of states, then replayed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dpgcli.actuation.directions import Directions, SideBySide, on_line, raised
from dpgcli.actuation.graph import Graph
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.rest import at_rest, is_certified
from dpgcli.actuation.travel import Travel, travel
from dpgcli.arrays import Array, Flags, Indices
from dpgcli.records import dataclass
from dpgcli.states.patterns import codes_of, inverted_units

ABOVE = 0.1  # of the last threshold: how far beyond it a peak goes that no other one bounds
WHOLE = 1e-9  # of how far pressures were followed: thresholds as near to that are its end


@dataclass(frozen=True)
class Pulse:
    """A pulse on a line: it rises or falls to the pressure `peak`, MPa, and goes back to zero.

    Peaks `low` to `high`, by size, lead from the pattern with the code `source` to that of
    `target`. `is_open` says that no event bounds them further away.
    """

    line: int
    peak: float
    low: float
    high: float
    source: int
    target: int
    is_open: bool

    @property
    def margin(self) -> float:
        """How far the peak is from the next threshold, MPa."""
        low, high = abs(self.peak - self.low), abs(self.high - self.peak)
        return low if self.is_open else min(low, high)


def shortest(graph: Graph, reach: float, start: int, target: int) -> tuple[Pulse, ...] | None:
    """The fewest pulses from a state to another, of one design; None where there are none.

    A peak is midway between the thresholds that bracket it; beyond the last one it is 10 % above.
    Of sequences as short as each other that with the largest smallest margin is taken.

    >>> from dpgcli.actuation.graph import reachable
    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.pressure import DomeVolumes
    >>> from dpgcli.states.units import UnitSolutions
    >>> finger = uniform_finger(2, **STUDY).changed(stroke=np.array([[3.5], [4.5]]))
    >>> pressed = Pressed(UnitSolutions.of(finger), DomeVolumes(np.array([[31.61]])))
    >>> graph = reachable(pressed, np.array([0, 0]), np.array([0.4]))
    >>> found = shortest(graph, 0.4, 0, 0b01)
    >>> [(pulse.target, round(pulse.peak, 4), round(pulse.margin, 4)) for pulse in found]
    [(3, 0.2115, 0.0192), (1, -0.0742, 0.0092)]
    """
    return routes(graph, reach, start).get(target)


def routes(graph: Graph, reach: float, start: int) -> dict[int, tuple[Pulse, ...]]:
    """The same from a state of the graph to each that pulses lead to, by code, nearest first."""
    if start not in graph.code.tolist():
        return {}
    each = _each(graph, reach)
    found: dict[int, tuple[Pulse, ...]] = {start: ()}
    margin = {start: np.inf}
    newest = [start]
    while newest:
        best: dict[int, tuple[float, Pulse]] = {}
        for pulse in each:
            if pulse.source in newest and pulse.target not in found:
                least = min(pulse.margin, margin[pulse.source])
                if least > best.get(pulse.target, (-1.0, None))[0]:
                    best[pulse.target] = least, pulse
        newest = [*best]
        for code, (least, pulse) in best.items():
            found[code], margin[code] = (*found[pulse.source], pulse), least
    return found


def _each(graph: Graph, reach: float) -> list[Pulse]:
    """The pulses of a graph of one design, each with its peak."""
    pulses = graph.pulses
    is_open = np.abs(pulses.stop) >= (1.0 - WHOLE) * reach
    middle = 0.5 * (pulses.start + pulses.stop)
    above = np.sign(pulses.stop) * np.minimum((1.0 + ABOVE) * np.abs(pulses.start), np.abs(middle))
    peak = np.where(is_open, above, middle)
    columns = pulses.line, peak, pulses.start, pulses.stop, pulses.source, pulses.target, is_open
    return [Pulse(*row) for row in zip(*(column.tolist() for column in columns), strict=True)]


@dataclass(frozen=True)
class Replay:
    """What pulses do to a finger that is followed through them, one after the other.

    `at_peak` and `after` are codes of patterns, as far as it went; `ties` are for each pulse groups
    of units (from 0) with the same threshold. `problem` is empty where it ends as planned.
    """

    way: Travel
    at_peak: tuple[int, ...]
    after: tuple[int, ...]
    ties: tuple[tuple[tuple[int, ...], ...], ...]
    problem: str


def replayed(pressed: Pressed, line_of: Indices, start: int, pulses: Sequence[Pulse]) -> Replay:
    """Follow a finger from rest through pulses, there and back, and hold it against their plan."""
    n_units = pressed.finger.n_units
    rest, _ = at_rest(pressed, inverted_units(np.array([start], np.uint64), n_units))
    history = np.zeros((2 * len(pulses), n_units))
    for k, pulse in enumerate(pulses):
        history[2 * k, line_of == pulse.line] = pulse.peak
    way = travel(pressed, rest, history)
    holds = way.points.shapes.take_lanes(np.array(way.holds, np.int64))
    codes = codes_of(holds.inverted).tolist()
    is_sound = is_certified(pressed, holds.take_lanes(np.arange(1, len(codes), 2)))
    at_peak, after = tuple(codes[::2]), tuple(codes[1::2])
    problems = [
        _difference(k, pulse, way, after[k : k + 1], is_sound[k : k + 1])
        for k, pulse in enumerate(pulses)
    ]
    first = next((problem for problem in problems if problem), "")
    return Replay(way, at_peak, after, _ties(way, len(pulses)), first)


def _difference(k: int, pulse: Pulse, way: Travel, after: Sequence[int], is_sound: Flags) -> str:
    """How the end of pulse `k` differs from its plan, empty where it does not."""
    n_units = way.final.inverted.shape[0]
    if not len(after):
        furthest = way.pressure[np.abs(way.pressure).argmax()]
        return f"pulse {k + 1} goes no further than {furthest:.5g} MPa: {way.reason.name.lower()}"
    if after[0] != pulse.target:
        return f"pulse {k + 1} ends in {after[0]:0{n_units}b}, not in {pulse.target:0{n_units}b}"
    return "" if is_sound[0] else f"pulse {k + 1} ends in no certified state"


def _ties(way: Travel, n_pulses: int) -> tuple[tuple[tuple[int, ...], ...], ...]:
    """Groups of units with the same threshold, for each pulse: its steps are two of the history."""
    groups: list[list[tuple[int, ...]]] = [[] for _ in range(n_pulses)]
    for event in way.events:
        if event.tied:
            pulse = (int(way.points.step[event.before]) - 1) // 2
            groups[pulse].append(tuple(sorted({event.units[0], *event.tied})))
    return tuple(map(tuple, groups))


@dataclass(frozen=True)
class Intervals(SideBySide):
    """What peaks of single pulses do to states, by lane and size of the peak, (interval,).

    Peaks from `low` up to below `high` (MPa) lead to the pattern with the code `at_peak`, and after
    release to `after`; −1 stands for no certified state, at the peak for what is not known, as the
    finger folds onto itself before or no equilibrium is found. `is_tie` says that units whose
    thresholds the model does not tell apart go at `low`.
    """

    lane: Indices
    low: Array
    high: Array
    at_peak: Indices
    after: Indices
    is_tie: Flags


def intervals(
    pressed: Pressed,
    line_of: Indices,
    reach: Array,
    directions: Directions,
) -> Intervals:
    """Everything that one pulse does to certified states, (lane,), in the order of lanes.

    `reach` (design,) is how far pressures go, MPa.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.pressure import DomeVolumes
    >>> from dpgcli.states.units import UnitSolutions
    >>> finger = uniform_finger(2, **STUDY).changed(stroke=np.array([[3.5], [4.5]]))
    >>> pressed = Pressed(UnitSolutions.of(finger), DomeVolumes(np.array([[31.61]])))
    >>> up = Directions.of(np.zeros(1, int), np.zeros(1, np.uint64), 1).take(np.array([0]))
    >>> found = intervals(pressed, np.array([0, 0]), np.array([0.4]), up)
    >>> found.low.round(4).tolist(), found.after.tolist()
    ([0.0, 0.1495, 0.1922], [0, 2, 3])
    """
    own, stairs, way = raised(pressed, line_of, reach, directions)
    code = directions.code.astype(np.int64)
    n, nothing = len(code), np.zeros(len(code))
    parts = [Intervals(np.arange(n), nothing, nothing, code, code, np.zeros(n, bool))]
    for stair in stairs:
        lanes, halted = stair.events.lanes, stair.events.halted
        low = on_line(halted.shapes, line_of, directions.line[lanes])
        at_peak = codes_of(stair.events.after.inverted).astype(np.int64)
        is_fine = stair.is_fine & is_certified(own.take_lanes(lanes), stair.rest)
        after = np.where(is_fine, codes_of(stair.rest.inverted).astype(np.int64), -1)
        parts.append(
            Intervals(lanes, low, low, at_peak, after, np.asarray(halted.tied.any(axis=0)))
        )
    ends = on_line(way.shapes, line_of, directions.line)
    furthest = directions.sign * reach[directions.design]
    short = np.flatnonzero(np.abs(ends) < (1.0 - WHOLE) * np.abs(furthest))
    none, begins = np.full(len(short), -1), ends[short]
    parts.append(Intervals(short, begins, begins, none, none, np.zeros(len(short), bool)))
    found = Intervals.joined(parts)
    found = found.take(np.argsort(found.lane, kind="stable"))
    is_same = np.append(
        False,
        (found.lane[1:] == found.lane[:-1])
        & (found.at_peak[1:] == found.at_peak[:-1])
        & (found.after[1:] == found.after[:-1]),
    )
    found = found.take(np.flatnonzero(~is_same))
    is_last = np.append(found.lane[1:] != found.lane[:-1], True)
    ends = furthest[found.lane]
    return replace(found, high=np.where(is_last, ends, np.append(found.low[1:], 0.0)))
