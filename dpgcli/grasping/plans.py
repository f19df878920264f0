"""Plans of routines: which open states let a body come, which pulses may close fingers on it.

Open states are those that pulses lead to from rest, and past which the body comes without a touch.
Pulses that close are those that lead from there to other states without the body: what they do with
the body there has to be followed. It may keep units from snapping, so a pulse that no further
threshold bounds is tried once more, with its peak midway up to where pressures were followed to.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from dpgcli.actuation.alone import thresholds_alone
from dpgcli.actuation.graph import Graph, reachable
from dpgcli.actuation.pulses import Pulse, routes
from dpgcli.arrays import Codes
from dpgcli.grasping.clearance import Clearance
from dpgcli.grasping.stages import Task, free, way
from dpgcli.records import dataclass

MOST_PLANS = 256

Sequences = dict[int, tuple[Pulse, ...]]
"""Pulses to each state, by its code."""


@dataclass(frozen=True)
class Plan:
    """Pulses that open fingers from rest, to the state of a code, that close them, and release."""

    opened: int
    opening: tuple[Pulse, ...]
    closing: tuple[Pulse, ...] = ()
    release: tuple[Pulse, ...] = ()

    @property
    def n_pulses(self) -> int:
        """Pulses until the body is held."""
        return len(self.opening) + len(self.closing)


@dataclass(frozen=True)
class Prospect:
    """What pulses lead to from rest, and how the body comes past each of the `opened` states.

    `closed` is the code of the state that closing has to lead to without the body, if one is asked
    for; `reach` is how far pressures go, MPa.
    """

    task: Task
    graph: Graph
    reach: float
    opened: Codes
    coming: Clearance
    closed: int | None = None

    @property
    def rest(self) -> int:
        """The code of the state that fingers rest in before any pulse."""
        return int(self.graph.code[0])

    @cached_property
    def openings(self) -> Sequences:
        """Pulses from rest."""
        return routes(self.graph, self.reach, self.rest)

    @cached_property
    def _all(self) -> tuple[Plan, ...]:
        codes = self.opened[self.coming.is_clear].tolist()
        found = [
            Plan(code, self.openings[code], closing)
            for code in codes
            for target, pulses in routes(self.graph, self.reach, code).items()
            if pulses and self.closed in (None, target)
            for closing in variants(pulses, self.reach)
        ]
        return tuple(sorted(found, key=lambda plan: plan.n_pulses))

    @property
    def plans(self) -> tuple[Plan, ...]:
        """Plans to be followed, those of fewest pulses first."""
        return self._all[:MOST_PLANS]

    @property
    def n_left_out(self) -> int:
        """Plans that are too many."""
        return max(len(self._all) - MOST_PLANS, 0)

    @property
    def nearest_miss(self) -> Plan | None:
        """Of open states past which the body does not come, that where it comes furthest."""
        if not len(self.opened):
            return None
        code = int(self.opened[self.coming.share.argmax()])
        return Plan(code, self.openings[code])

    def rounds(self) -> Iterator[Sequence[Plan]]:
        """Plans of as many pulses each."""
        for n_pulses in sorted({plan.n_pulses for plan in self.plans}):
            yield [plan for plan in self.plans if plan.n_pulses == n_pulses]


def prospect(task: Task, opened: int | None, closed: int | None) -> Prospect:
    """What there is to try; only with these states, by their codes, if they are given."""
    reach = thresholds_alone(task.pressed).reach
    graph = reachable(task.pressed, task.lines.line_of, reach)
    codes = graph.code if opened is None else graph.code[graph.code == np.uint64(opened)]
    coming, n = Clearance(np.zeros(0), np.zeros(0)), len(codes)
    if n:
        end = task.centers(n)
        coming = way(task, free(task, codes, end), task.begins(n), end)
    return Prospect(task, graph, float(reach[0]), codes, coming, closed)


def variants(pulses: tuple[Pulse, ...], reach: float) -> Iterator[tuple[Pulse, ...]]:
    """Pulses, and the same with higher peaks where no further threshold bounds them."""
    yield pulses
    if any(pulse.is_open for pulse in pulses):
        yield tuple(_higher(pulse, reach) if pulse.is_open else pulse for pulse in pulses)


def _higher(pulse: Pulse, reach: float) -> Pulse:
    return replace(pulse, peak=0.5 * (pulse.low + float(np.copysign(reach, pulse.peak))))


def releases(known: Prospect, codes: Sequence[int]) -> Mapping[int, Sequences]:
    """Pulses from states that bodies have left fingers in, by code, to all that they lead to."""
    task, reach, found = known.task, known.reach, {}
    others = [code for code in codes if code not in known.graph.code.tolist()]
    for code in codes:
        if code not in others:
            found[code] = routes(known.graph, reach, code)
    if others:
        starts = np.array(others, np.uint64)
        graph = reachable(task.pressed, task.lines.line_of, np.full(len(others), reach), starts)
        for place, code in enumerate(others):
            found[code] = routes(_of_design(graph, place), reach, code)
    return found


def _of_design(graph: Graph, design: int) -> Graph:
    """What a graph of several designs has of one."""
    which, pulses = graph.design == design, graph.pulses
    own = pulses.take(np.flatnonzero(pulses.design == design))
    return replace(
        graph,
        design=graph.design[which],
        code=graph.code[which],
        n_pulses=graph.n_pulses[which],
        pulses=own,
    )
