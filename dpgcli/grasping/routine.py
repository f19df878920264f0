"""Routines without feedback: searched among plans, then followed stage by stage.

Plans of fewest pulses come first, many at once. Of those that hold the body and let it go, one that
ends in the open state in which it began is taken first, then one whose peaks are 5 % or more from
all thresholds, then that of the largest payload, or squeeze where nothing is known of friction.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from dpgcli.actuation.pulses import Pulse
from dpgcli.arrays import Array, Columns, Flags, Indices
from dpgcli.design.scene import Held
from dpgcli.grasping.plans import MOST_PLANS, Plan, Prospect, releases, variants
from dpgcli.grasping.stages import (
    Parts,
    Task,
    are_touched,
    beside,
    kept,
    lifted,
    pulsed,
    some,
    way,
)
from dpgcli.grasping.table import Grasps, grasp_rows
from dpgcli.records import dataclass
from dpgcli.states.certify import Status


class Stage(StrEnum):
    """The stages of a routine, in their order."""

    OPEN = "open"
    APPROACH = "approach"
    CLOSE = "close"
    LIFT = "lift"
    CARRY = "carry"
    RELEASE = "release"
    WITHDRAW = "withdraw"


STAGES = tuple(Stage)
WELL = Status.STABLE.text
COLLIDES, NO_PULSES, NOT_TOUCHED = "collides", "no_pulses", "not_touched"
SLIPS, TOO_HEAVY, IN_TOUCH = "slips", "too_heavy", "in_touch"
NOT_CHECKED, UNKNOWN = "not_checked", "unknown"
FINE = (WELL, NOT_CHECKED)
ENOUGH = 0.05  # of a peak: how far thresholds should be
ALIKE = 6  # digits of the largest: what differs further behind is rounding


@dataclass(frozen=True)
class Search:
    """The plan that does, or the one that comes furthest; how many fail, by stage and why.

    `plan` is None where no pulses lead to the open state that is asked for; `n_left_out` plans, or
    ways to let go, were too many to be followed.
    """

    known: Prospect
    plan: Plan | None
    holds: bool
    failures: Mapping[tuple[Stage, str], int]
    n_left_out: int


@dataclass
class _Furthest:
    """What has failed so far, the plan that has come furthest, and how many were not tried."""

    plan: Plan | None
    place: int
    n_left_out: int
    failures: Counter[tuple[Stage, str]] = field(default_factory=Counter)

    def add(self, plan: Plan, stage: Stage, why: str) -> None:
        self.failures[stage, why] += 1
        if (place := STAGES.index(stage)) > self.place:
            self.plan, self.place = plan, place


def searched(known: Prospect) -> Search:
    """The routine among the plans of a prospect."""
    failed = _Furthest(known.nearest_miss, STAGES.index(Stage.APPROACH), known.n_left_out)
    gap = known.coming.gap
    for why, are_so in ((COLLIDES, gap == 0.0), (Status.NOT_CONVERGED.text, np.isnan(gap))):
        if are_so.any():
            failed.failures[Stage.APPROACH, why] = int(are_so.sum())
    if known.coming.is_clear.any() and not known.plans:
        code = int(known.opened[known.coming.is_clear][0])
        failed.add(Plan(code, known.openings[code]), Stage.CLOSE, NO_PULSES)
    for plans in known.rounds():
        best = _best(known, plans, failed)
        if best is not None:
            return Search(known, best, True, failed.failures, failed.n_left_out)
    return Search(known, failed.plan, False, failed.failures, failed.n_left_out)


def _best(known: Prospect, plans: Sequence[Plan], failed: _Furthest) -> Plan | None:
    """The best of some plans; what fails of the others is noted."""
    task = known.task
    opened = np.array([plan.opened for plan in plans], np.uint64)
    closings = [plan.closing for plan in plans]
    parts, near = pulsed(task, beside(task, opened), closings, known.reach)
    words = closing(task, parts)
    lanes = np.flatnonzero(_well(words, plans, Stage.CLOSE, failed, np.arange(len(plans))))
    if not len(lanes):
        return None
    plans, near = [plans[lane] for lane in lanes.tolist()], near[lanes]
    found, after = lifted(task, some(parts, lanes))
    rows = grasp_rows(found)
    worth = _worth(rows)
    order = np.argsort(-worth, kind="stable")
    are_lifted = _well(lifting(task, rows), plans, Stage.LIFT, failed, order)
    words = np.where(are_lifted, carrying(task, rows), WELL)
    lanes = np.flatnonzero(are_lifted & _well(words, plans, Stage.CARRY, failed, order))
    if not len(lanes):
        return None
    found = found.take_rows(lanes)
    plans, merits = [plans[lane] for lane in lanes.tolist()], (near[lanes], worth[lanes])
    return _released(known, plans, found, some(after, lanes), merits, failed)


def _well(
    words: NDArray[np.str_],
    plans: Sequence[Plan],
    stage: Stage,
    failed: _Furthest,
    order: Indices,
) -> Flags:
    """Plans that go well at a stage; of the others it is noted why not, in this order."""
    are_well = np.isin(words, FINE)
    for place in order[~are_well[order]].tolist():
        failed.add(plans[place], stage, str(words[place]))
    return are_well


def _worth(rows: Columns) -> Array:
    """What plans bear, or how they squeeze, without rounding: the first of equal ones is taken."""
    worth = rows["payload_N"] if "payload_N" in rows else rows["squeeze_N"]
    largest = np.abs(np.nan_to_num(worth)).max(initial=0.0) or 1.0
    return np.asarray(np.round(worth / largest, ALIKE) * largest)


def status_words(rows: Columns) -> NDArray[np.str_]:
    """Results of certification as words."""
    return np.array([Status(code).text for code in rows["status"]], str)


def closing(task: Task, parts: Parts) -> NDArray[np.str_]:
    """What becomes of fingers that close: at rest, with both in touch."""
    found = kept(task, parts, task.centers(len(parts[0].codes)))
    words = status_words(grasp_rows(found))
    return np.where((words == WELL) & ~are_touched(found), NOT_TOUCHED, words)


def lifting(task: Task, rows: Columns) -> NDArray[np.str_]:
    """What becomes of bodies that leave their support: they rest, and do not slip at once."""
    words = status_words(rows)
    if "payload_N" in rows:
        return np.where((words == WELL) & (rows["payload_N"] == 0.0), SLIPS, words)
    is_checked = task.scene.held is not Held.FIXED
    return words if is_checked else np.where(words == WELL, NOT_CHECKED, words)


def carrying(task: Task, rows: Columns) -> NDArray[np.str_]:
    """Whether their weight is borne."""
    words, friction = status_words(rows), task.scene.friction
    if friction is None:
        return np.where(words == WELL, NOT_CHECKED, words)
    payload = rows["payload_N"]
    words = np.where((words == WELL) & np.isnan(payload), UNKNOWN, words)
    if friction.weight is None:
        return words
    return np.where((words == WELL) & (payload < friction.weight), TOO_HEAVY, words)


Option = tuple[int, tuple[Pulse, ...]]
"""The place of a plan, and pulses that may let go of its body."""


def _released(
    known: Prospect,
    plans: Sequence[Plan],
    found: Grasps,
    after: Parts,
    merits: tuple[Array, Array],
    failed: _Furthest,
) -> Plan | None:
    """Of plans that hold the best one with pulses that let the body go; fewest pulses first.

    Their `merits` are how near their peaks are to thresholds, and what they bear.
    """
    closed, worth = merits
    options = _options(known, found, np.argsort(-worth, kind="stable"))
    came: dict[int, tuple[Stage, str, tuple[Pulse, ...]]] = {}
    for n_pulses in sorted({len(pulses) for _, pulses in options}):
        few = [option for option in options if len(option[1]) == n_pulses]
        failed.n_left_out += max(len(few) - MOST_PLANS, 0)
        few = few[:MOST_PLANS]
        words, codes, near = letting_go(known, found, after, few)
        good = [
            (
                code == plans[place].opened,
                min(near[number], closed[place]) >= ENOUGH,
                worth[place],
                -number,
            )
            for number, ((place, _), word, code) in enumerate(zip(few, words, codes, strict=True))
            if word == WELL
        ]
        if good:
            place, pulses = few[-max(good)[-1]]
            return replace(plans[place], release=pulses)
        for (place, pulses), word in zip(few, words.tolist(), strict=True):
            stage = Stage.WITHDRAW if word == COLLIDES else Stage.RELEASE
            if place not in came or stage is Stage.WITHDRAW:
                came[place] = stage, word, pulses
    for place, plan in enumerate(plans):
        stage, word, pulses = came.get(place, (Stage.RELEASE, NO_PULSES, ()))
        failed.add(replace(plan, release=pulses), stage, word)
    return None


def _options(known: Prospect, found: Grasps, order: Indices) -> list[Option]:
    """All pulses from the states that plans have left each finger in, with their variants."""
    patterns = [own.after[lanes] for own, lanes in zip(found.fingers, found.pairs, strict=True)]
    codes = [sorted({int(own[place]) for own in patterns}) for place in range(len(order))]
    ways = releases(known, sorted({code for own in codes for code in own}))
    options = [
        (place, option)
        for place in order.tolist()
        for code in codes[place]
        for pulses in ways[code].values()
        for option in variants(pulses, known.reach)
        if pulses
    ]
    return [*dict.fromkeys(options)]


def letting_go(
    known: Prospect, found: Grasps, after: Parts, options: Sequence[Option]
) -> tuple[NDArray[np.str_], NDArray[np.uint64], Array]:
    """What becomes of fingers, by place, after pulses that should let go.

    Also codes of their states, and how near the peaks are to thresholds, as a share of them.
    """
    task, places = known.task, np.array([place for place, _ in options])
    sequences = [pulses for _, pulses in options]
    parts, near = pulsed(task, some(after, places), sequences, known.reach)
    before = found.take_rows(places)
    free = kept(task, parts, before.centers, before.turned)
    rows = grasp_rows(free)
    words = status_words(rows)
    words = np.where((words == WELL) & (rows["n_contacts"] > 0), IN_TOUCH, words)
    going = way(task, free, free.centers, task.begins(len(places)))
    words = np.where((words == WELL) & ~going.is_clear, COLLIDES, words)
    return words, free.fingers[0].after, near
