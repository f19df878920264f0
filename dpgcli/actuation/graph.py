"""The graph of states: which pulses of pressure lead from which state to which, from rest on.

A pulse raises the pressure of one line, or lowers it, and lets it go again. What it does depends
on its peak alone: on the way the finger goes through one event after another, and is left in
another state, or in the same, if it turns back after each.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dpgcli.actuation.directions import Directions, SideBySide, on_line, raised
from dpgcli.actuation.pressed import Halt, Pressed
from dpgcli.actuation.rest import at_rest, is_certified
from dpgcli.actuation.staircase import UNKNOWN
from dpgcli.arrays import Array, Codes, Flags, Indices, distinct
from dpgcli.records import dataclass
from dpgcli.states.certify import Status
from dpgcli.states.patterns import chunks, codes_of, inverted_units
from dpgcli.states.settle import lanes_at_once


@dataclass(frozen=True)
class Pulses(SideBySide):
    """Pulses that lead from state to state, (pulse,), by design, state, line, sign and pressure.

    One on `line` with a peak from `start` up to below `stop` (MPa, both of the `sign` ±1) leads
    from the pattern with the code `source` to that of `target`, another one, at rest. `is_tie` says
    that units went together at or before `start` whose thresholds the model does not tell apart.
    Peaks in no such range change nothing, or lead to no certified state.
    """

    design: Indices
    source: Codes
    line: Indices
    sign: Indices
    start: Array
    stop: Array
    target: Codes
    is_tie: Flags


@dataclass(frozen=True)
class Graph:
    """States that pulses reach, by code of their patterns, and all pulses that start from them.

    `design` and `code` (state,) are in the order in which they are found, those of fewest pulses
    first; `n_pulses` says how many each needs. `n_lost` ranges of peaks led to no certified state,
    or were not looked at, as the finger folds onto itself before; in `n_unknown` directions what
    happens is not known: no equilibrium is found, or no certified state after release. Designs of
    which it is not known where they rest count there as well.
    """

    design: Indices
    code: Codes
    n_pulses: Indices
    pulses: Pulses
    n_lost: int
    n_unknown: int


def reachable(
    pressed: Pressed, line_of: Indices, reach: Array, start: Codes | None = None
) -> Graph:
    """Everything that pulses on single lines reach, breadth first, of some designs at once.

    `line_of` (unit,) are the lines of the units, 0, 1, …; `reach` (design,) how far pressures go,
    MPa. Each design starts at the pattern with the code `start` (design,), or where it `rests`; one
    that is no stable state there has no states at all.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.pressure import DomeVolumes
    >>> from dpgcli.states.units import UnitSolutions
    >>> finger = uniform_finger(2, **STUDY).changed(stroke=np.array([[3.5], [4.5]]))
    >>> pressed = Pressed(UnitSolutions.of(finger), DomeVolumes(np.array([[31.61]])))
    >>> graph = reachable(pressed, np.array([0, 0]), np.array([0.4]))
    >>> graph.code.tolist(), graph.n_pulses.tolist()  # 00, 10 and 11, then 01
    ([0, 2, 3, 1], [0, 1, 1, 2])
    >>> graph.pulses.start[:2].round(4).tolist(), graph.pulses.stop[:2].round(4).tolist()
    ([0.1495, 0.1922], [0.1922, 0.4])
    """
    n_units, n_designs = pressed.finger.n_units, len(reach)
    begin, is_there = rests(pressed, n_designs) if start is None else _at(pressed, start)
    design = np.flatnonzero(is_there)
    states = [(design, begin[design])]
    is_known = np.zeros(n_designs << n_units, bool)
    parts, n_lost = [_no_pulses()], 0
    n_unknown = int((~is_there).sum()) if start is None else 0
    while len(states[-1][0]):
        design, code = states[-1]
        is_known[_keys(design, code, n_units)] = True
        directions = Directions.of(design, code, int(line_of.max()) + 1)
        found = [_pulses(pressed, line_of, reach, part) for part in directions.chunks(n_units)]
        parts += [part.pulses for part in found]
        n_lost += sum(part.n_lost for part in found)
        n_unknown += sum(len(part.unknown) for part in found)
        targets = [_keys(pulses.design, pulses.target, n_units) for pulses in parts[-len(found) :]]
        new = distinct(np.concatenate(targets))
        new = new[~is_known[new]]
        states.append(_of_keys(new, n_units))
    n_pulses = np.repeat(np.arange(len(states)), [len(code) for _, code in states])
    designs, codes = (np.concatenate(part) for part in zip(*states, strict=True))
    return Graph(designs, codes, n_pulses, Pulses.joined(parts), n_lost, n_unknown)


def stable_states(pressed: Pressed, n_designs: int) -> Flags:
    """Which patterns are certified stable states without pressure, (design, pattern by code)."""
    n_units = pressed.finger.n_units
    found = []
    for key in chunks(n_designs << n_units, lanes_at_once(n_units)):
        design, code = _of_keys(key.astype(np.int64), n_units)
        found.append(are_states(pressed, design, code))
    return np.concatenate(found).reshape(n_designs, -1)


def rests(pressed: Pressed, n_designs: int) -> tuple[Codes, Flags]:
    """The codes of the patterns in which fingers rest before any pulse, and which are certified.

    No unit is inverted there, unless dead loads have brought the finger to another state. Where
    neither is a certified stable state it is not known, (design,).

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.pressure import DomeVolumes
    >>> from dpgcli.states.units import UnitSolutions
    >>> finger = uniform_finger(2, **STUDY)
    >>> pressed = Pressed(UnitSolutions.of(finger), DomeVolumes(np.array([[31.61]])))
    >>> [found.tolist() for found in rests(pressed, 1)]
    [[0], [True]]
    """
    own = pressed.take_lanes(np.arange(n_designs))
    shapes, settled = at_rest(own, np.zeros((pressed.finger.n_units, n_designs), bool))
    is_certain = settled.status == Status.STABLE
    lanes = np.flatnonzero(settled.status == Status.ANOTHER_PATTERN)
    there = replace(shapes, inverted=settled.reached).take_lanes(lanes)
    is_certain[lanes] = is_certified(own.take_lanes(lanes), there)
    return codes_of(settled.reached), is_certain


def _at(pressed: Pressed, code: Codes) -> tuple[Codes, Flags]:
    return code, are_states(pressed, np.arange(len(code)), code)


def reached_from_rest(
    pressed: Pressed,
    line_of: Indices,
    reach: Array,
    is_stable: Flags,
    known: tuple[Indices, Indices] | None = None,
) -> "Reached":
    """Which states pulses of any height lead to from rest.

    `known` are sources and targets of the first transition of every state, if they have been found,
    as codes of one finger. Whole staircases are climbed only where these do not lead to all states.
    """
    n_units = pressed.finger.n_units
    source, target = known or (np.zeros(0, np.int64), np.zeros(0, np.int64))
    is_reached = np.zeros_like(is_stable)
    begin, is_certain = rests(pressed, len(is_stable))
    is_reached[np.arange(len(begin)), begin.astype(np.int64)] = is_certain
    for n_stairs in (1, None) if known is None else (None,):
        is_done, n_unknown = np.zeros_like(is_stable), (~is_certain).astype(np.int64)
        while True:
            _close(is_reached.ravel(), source, target)
            is_open = (is_reached != is_stable).any(axis=1)
            key = np.flatnonzero(is_reached & ~is_done & is_open[:, None])
            if not len(key):
                break
            is_done |= is_reached
            directions = Directions.of(*_of_keys(key, n_units), int(line_of.max()) + 1)
            for part in directions.chunks(n_units):
                found, _, unknown = _pulses(pressed, line_of, reach, part, n_stairs)
                np.add.at(n_unknown, unknown, 1)
                source = np.append(source, _keys(found.design, found.source, n_units))
                target = np.append(target, _keys(found.design, found.target, n_units))
    return Reached(is_reached, n_unknown, np.where(is_certain, begin.astype(np.int64), -1))


class Reached(NamedTuple):
    """Which states pulses lead to from rest, (design, pattern by code).

    Where these are not all there are, `n_unknown` (design,) directions in which no equilibrium is
    found, or no certified state after release, may lead to others. `rest` (design,) is the code
    that each begins at, or −1 where that is not known, which counts as an unknown direction.
    """

    is_reached: Flags
    n_unknown: Indices
    rest: Indices

    @property
    def known(self) -> Array:
        """1 of what is reached, 0 of what is not, NaN where that is not known, (design, code)."""
        is_known = self.is_reached | (self.n_unknown == 0)[:, None]
        return np.where(is_known, self.is_reached, np.nan)


def _close(is_reached: Flags, source: Indices, target: Indices) -> None:
    """Add what is reached from what is reached."""
    n_reached = 0
    while is_reached.sum() > n_reached:
        n_reached = is_reached.sum()
        is_reached[target[is_reached[source]]] = True


def _no_pulses() -> Pulses:
    nothing, codes = np.zeros(0, np.int64), np.zeros(0, np.uint64)
    free = np.zeros(0)
    return Pulses(nothing, codes, nothing, nothing, free, free, codes, np.zeros(0, bool))


def are_states(pressed: Pressed, design: Indices, code: Codes) -> Flags:
    """Which patterns of designs are certified stable states without pressure, (lane,)."""
    inverted = inverted_units(code, pressed.finger.n_units)
    _, settled = at_rest(pressed.take_lanes(design), inverted)
    return np.asarray(settled.status == Status.STABLE)


def _keys(design: Indices, code: Codes, n_units: int) -> Indices:
    """Numbers that stand for states of designs, in the order of both."""
    return np.asarray((design << n_units) | code.astype(np.int64))


def _of_keys(key: Indices, n_units: int) -> tuple[Indices, Codes]:
    """The designs and codes of keys."""
    return key >> n_units, (key & (2**n_units - 1)).astype(np.uint64)


def _pulses(
    pressed: Pressed,
    line_of: Indices,
    reach: Array,
    directions: Directions,
    n_stairs: int | None = None,
) -> "_Found":
    """The pulses in these directions; of the first `n_stairs` flips, if that is given."""
    own, stairs, way = raised(pressed, line_of, reach, directions, n_stairs)
    n, ends = len(directions), on_line(way.shapes, line_of, directions.line)
    here, no = directions.code, np.zeros(n, bool)
    is_unknown = np.isin(way.reason, UNKNOWN)
    begin = _Ranges(np.arange(n), np.zeros(n), here, here, ~no, no)
    parts = [begin]
    for stair in stairs:
        lanes, halted = stair.events.lanes, stair.events.halted
        start = on_line(halted.shapes, line_of, directions.line[lanes])
        is_fine = stair.is_fine & is_certified(own.take_lanes(lanes), stair.rest)
        is_tie = np.asarray(halted.tied.any(axis=0))
        at_peak, after = (codes_of(s.inverted) for s in (stair.events.after, stair.rest))
        is_unknown[lanes[~is_fine]] = True
        parts.append(_Ranges(lanes, start, at_peak, after, is_fine, is_tie))
    ranges = _Ranges.joined(parts)
    ranges = ranges.take(np.argsort(ranges.lane, kind="stable"))
    found, n_lost = ranges.pulses(directions, ends)
    n_lost += int((way.reason != Halt.ARRIVED).sum())
    return _Found(found, n_lost, directions.design[is_unknown])


class _Found(NamedTuple):
    """Pulses; how many ranges of peaks lead to no certified state; designs of unknown directions.

    Such a direction is one in which a search failed.
    """

    pulses: Pulses
    n_lost: int
    unknown: Indices


@dataclass(frozen=True)
class _Ranges(SideBySide):
    """Ranges of peaks in the order of lanes and pressures: where each begins, what it leads to.

    The first range of each lane begins without pressure and leads to the state itself.
    """

    lane: Indices
    start: Array
    at_peak: Codes
    target: Codes
    is_fine: Flags
    is_tie: Flags

    def pulses(self, directions: Directions, ends: Array) -> tuple[Pulses, int]:
        """Ranges side by side of the same pattern, at the peak and after it, are one.

        Those that lead nowhere are none.
        """
        begins = np.ones(len(self.lane), bool)
        begins[1:] = (
            (self.lane[1:] != self.lane[:-1])
            | (self.at_peak[1:] != self.at_peak[:-1])
            | (self.target[1:] != self.target[:-1])
            | (self.is_fine[1:] != self.is_fine[:-1])
        )
        first = np.flatnonzero(begins)
        own = self.take(first)
        is_last = np.append(own.lane[1:] != own.lane[:-1], True)
        stop = np.where(is_last, ends[own.lane], np.append(own.start[1:], 0.0))
        n_ties = np.cumsum(self.is_tie)
        before = n_ties[np.searchsorted(self.lane, own.lane)]  # no first range has a tie
        towards = directions.take(own.lane)
        found = Pulses(
            towards.design, towards.code, towards.line, towards.sign,
            own.start, stop, own.target, n_ties[first] > before,
        )  # fmt: skip
        leads = own.is_fine & (own.target != towards.code)
        return found.take(np.flatnonzero(leads)), int((~own.is_fine).sum())
