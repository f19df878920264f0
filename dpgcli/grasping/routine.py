"""Routines without feedback: searched among plans, then followed stage by stage.

Plans of fewest pulses come first, many at once. Of those that hold the body and let it go, one that
ends in the open state in which it began is taken first, then that of the largest payload, or
squeeze where nothing is known of friction.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from dpgcli.actuation.pulses import Pulse
from dpgcli.arrays import Array, Columns, Indices
from dpgcli.design.scene import Held
from dpgcli.grasping.plans import Plan, Prospect, Sequences, releases, variants
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


@dataclass(frozen=True)
class Search:
    """The plan that does, or the one that comes furthest; how many fail, by stage and why.

    `plan` is None where no pulses lead to the open state that is asked for.
    """

    known: Prospect
    plan: Plan | None
    holds: bool
    failures: Mapping[tuple[Stage, str], int] = field(default_factory=dict)


@dataclass
class _Furthest:
    """What has failed so far, and the plan that has come furthest."""

    plan: Plan | None
    place: int
    failures: Counter[tuple[Stage, str]]

    def add(self, plan: Plan, stage: Stage, why: str) -> None:
        self.failures[stage, why] += 1
        if (place := STAGES.index(stage)) > self.place:
            self.plan, self.place = plan, place


def searched(known: Prospect) -> Search:
    """The routine among the plans of a prospect."""
    failed = _Furthest(known.nearest_miss, STAGES.index(Stage.APPROACH), Counter())
    if n_met := int((~known.coming.is_clear).sum()):
        failed.failures[Stage.APPROACH, COLLIDES] = n_met
    if known.coming.is_clear.any() and not known.plans:
        code = int(known.opened[known.coming.is_clear][0])
        failed.add(Plan(code, known.openings[code]), Stage.CLOSE, NO_PULSES)
    for plans in known.rounds():
        best = _best(known, plans, failed)
        if best is not None:
            return Search(known, best, holds=True, failures=failed.failures)
    return Search(known, failed.plan, holds=False, failures=failed.failures)


def _best(known: Prospect, plans: Sequence[Plan], failed: _Furthest) -> Plan | None:
    """The best of some plans; what fails of the others is noted."""
    task = known.task
    opened = np.array([plan.opened for plan in plans], np.uint64)
    parts = pulsed(task, beside(task, opened), [plan.closing for plan in plans])
    lanes = _sifted(closing(task, parts), plans, Stage.CLOSE, failed)
    if not len(lanes):
        return None
    plans, parts = [plans[lane] for lane in lanes], some(parts, lanes)
    found, after = lifted(task, parts)
    rows = grasp_rows(found)
    for stage in (Stage.LIFT, Stage.CARRY):
        words = lifting(task, rows) if stage is Stage.LIFT else carrying(task, rows)
        lanes = _sifted(words, plans, stage, failed)
        plans = [plans[lane] for lane in lanes]
        rows = {name: values[lanes] for name, values in rows.items()}
        found = replace(found, pairs=found.pairs[:, lanes], centers=found.centers[:, lanes])
        after = some(after, lanes)
    return _released(known, plans, found, after, _worth(rows), failed) if plans else None


def _sifted(
    words: NDArray[np.str_], plans: Sequence[Plan], stage: Stage, failed: _Furthest
) -> Indices:
    """Plans that go well at a stage; of the others it is noted why not."""
    for plan, word in zip(plans, words.tolist(), strict=True):
        if word not in FINE:
            failed.add(plan, stage, word)
    return np.flatnonzero(np.isin(words, FINE))


def _worth(rows: Columns) -> Array:
    worth = rows["payload_N"] if "payload_N" in rows else rows["squeeze_N"]
    return np.asarray(worth)


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


def _released(
    known: Prospect,
    plans: Sequence[Plan],
    found: Grasps,
    after: Parts,
    worth: Array,
    failed: _Furthest,
) -> Plan | None:
    """Of plans that hold the best one with pulses that let the body go; fewest pulses first."""
    patterns = [own.after[lanes] for own, lanes in zip(found.fingers, found.pairs, strict=True)]
    codes = [sorted({int(own[place]) for own in patterns}) for place in range(len(plans))]
    ways = releases(known, sorted({code for own in codes for code in own}))
    options = [
        (place, pulses)
        for place, own in enumerate(codes)
        for pulses in _each(ways, own, known.reach)
    ]
    came: dict[int, tuple[Stage, str, tuple[Pulse, ...]]] = {}
    for n_pulses in sorted({len(pulses) for _, pulses in options}):
        few = [option for option in options if len(option[1]) == n_pulses]
        words, at_rest = letting_go(known.task, found, after, few)
        told = zip(few, words.tolist(), at_rest.tolist(), strict=True)
        good = [(option, code) for option, word, code in told if word == WELL]
        if good:
            (place, pulses), _ = max(
                good, key=lambda one: (one[1] == plans[one[0][0]].opened, worth[one[0][0]])
            )
            return replace(plans[place], release=pulses)
        for (place, pulses), word in zip(few, words.tolist(), strict=True):
            stage = Stage.WITHDRAW if word == COLLIDES else Stage.RELEASE
            if place not in came or stage is Stage.WITHDRAW:
                came[place] = stage, word, pulses
    for place, plan in enumerate(plans):
        stage, word, pulses = came.get(place, (Stage.RELEASE, NO_PULSES, ()))
        failed.add(replace(plan, release=pulses), stage, word)
    return None


def _each(
    ways: Mapping[int, Sequences], codes: Sequence[int], reach: float
) -> list[tuple[Pulse, ...]]:
    """All pulses from states, with their variants; each once."""
    sequences = [pulses for code in codes for pulses in ways[code].values() if pulses]
    found = [option for pulses in sequences for option in variants(pulses, reach)]
    return [*dict.fromkeys(found)]


def letting_go(
    task: Task, found: Grasps, after: Parts, options: Sequence[tuple[int, tuple[Pulse, ...]]]
) -> tuple[NDArray[np.str_], NDArray[np.uint64]]:
    """What becomes of fingers, by place, after pulses that should let go; codes of their states."""
    places = np.array([place for place, _ in options])
    parts = pulsed(task, some(after, places), [pulses for _, pulses in options])
    free = kept(task, parts, found.centers[:, places])
    rows = grasp_rows(free)
    words = status_words(rows)
    words = np.where((words == WELL) & (rows["n_contacts"] > 0), IN_TOUCH, words)
    going = way(task, free, free.centers, task.begins(len(places)))
    words = np.where((words == WELL) & ~going.is_clear, COLLIDES, words)
    return words, free.fingers[0].after
