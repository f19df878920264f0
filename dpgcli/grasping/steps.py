"""A routine step by step: one gripper followed through its plan, or as far as it goes."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from dpgcli.actuation.pulses import Pulse, Replay, replayed
from dpgcli.actuation.tables import numbered
from dpgcli.arrays import Array, Columns
from dpgcli.design.outputs import Output
from dpgcli.design.pressure import History
from dpgcli.grasping.grasped import Grasped
from dpgcli.grasping.plans import Plan, Prospect
from dpgcli.grasping.release import turns
from dpgcli.grasping.routine import (
    COLLIDES,
    FINE,
    IN_TOUCH,
    NO_PULSES,
    WELL,
    Search,
    Stage,
    carrying,
    closing,
    lifting,
    status_words,
)
from dpgcli.grasping.stages import Parts, Task, beside, free, kept, lifted, pulsed, way
from dpgcli.grasping.table import ANGLE, Grasps, grasp_rows
from dpgcli.records import dataclass
from dpgcli.states.columns import Column, Kind

PRESSURES, FORCES, SHAPES = (Output.PRESSURES,), (Output.FORCES,), (Output.SHAPES,)
COLUMNS = (
    Column("step", "", "what is done; of several pulses a row each", kind=Kind.TEXT),
    Column("line", "", "pressure line of the pulse", kind=Kind.TEXT),
    Column("peak_pressure_MPa", "MPa", "where the pulse turns back to zero", outputs=PRESSURES),
    Column(
        "margin_MPa",
        "MPa",
        "from there to the nearest threshold, with the body where it is",
        outputs=PRESSURES,
    ),
    Column("pattern_before", "", "state before; upper/lower where they differ", kind=Kind.TEXT),
    Column("pattern_after", "", "state after, without pressure", kind=Kind.TEXT),
    Column("status", "", "stable if the step is well, else why it is not", kind=Kind.TEXT),
    Column("clearance_mm", "mm", "least gap between body and fingers on the way", outputs=SHAPES),
    Column("n_contacts", "", "places that touch the body", kind=Kind.COUNT),
    Column("squeeze_N", "N", "closing force between the two fingers", outputs=FORCES),
    Column(
        "payload_N", "N", "largest pull on the body along gravity that is borne", outputs=FORCES
    ),
    Column("payload_margin", "", "how much more than its weight that is, a share of it"),
    Column("object_x_mm", "mm", "x of the body's reference point, in the gripper's frame"),
    Column("object_y_mm", "mm", "y of the same"),
    Column("object_angle_deg", "deg", "angle that the body has turned by, counterclockwise"),
    Column("tie", "", "units whose threshold is the same within 1e-6", kind=Kind.TEXT),
)
OF_FRICTION, OF_WEIGHT = "payload_N", "payload_margin"


@dataclass(frozen=True)
class Step:
    """A step of a routine, and what the fingers are like after it: `found` has one row.

    `status` is a word of `grasping.routine`, `margin` in MPa, `clearance` in mm.
    """

    stage: Stage
    found: Grasps
    status: str
    pulse: Pulse | None = None
    margin: float = float("nan")
    clearance: float = float("nan")
    tie: str = ""

    @property
    def overlaps(self) -> bool:
        """Whether the fingers overlap each other."""
        return bool(grasp_rows(self.found)["overlaps"][0])


@dataclass(frozen=True)
class Routine:
    """The steps of the plan that a search has found, and what opening without the body did."""

    search: Search
    steps: tuple[Step, ...]
    opening: Replay | None = None

    @property
    def task(self) -> Task:
        """What was to be done."""
        return self.search.known.task

    @property
    def is_done(self) -> bool:
        """Whether it goes well to its end."""
        last = self.steps[-1] if self.steps else None
        return last is not None and last.stage is Stage.WITHDRAW and last.status in FINE


def routine_of(search: Search) -> Routine:
    """Follow the plan of a search, with the body there."""
    plan, known = search.plan, search.known
    if plan is None:
        return Routine(search, ())
    opening = replayed(known.task.pressed, known.task.lines.line_of, known.rest, plan.opening)
    steps: list[Step] = []
    for step in _steps(known, plan, opening):
        steps.append(step)
        if step.status not in FINE:
            break
    return Routine(search, tuple(steps), opening)


def _steps(known: Prospect, plan: Plan, opening: Replay) -> Iterator[Step]:
    """All steps; each rests on those before."""
    task = known.task
    yield from _opened(task, plan, opening)
    yield _moved(task, Stage.APPROACH, free(task, _code(plan.opened), task.centers(1)))
    parts = beside(task, _code(plan.opened))
    if not plan.closing:
        yield Step(Stage.CLOSE, kept(task, parts, task.centers(1)), NO_PULSES)
    for count, pulse in enumerate(plan.closing, start=1):
        parts, near = pulsed(task, parts, [[pulse]], known.reach)
        found = kept(task, parts, task.centers(1))
        is_last = count == len(plan.closing)
        words = closing(task, parts) if is_last else status_words(grasp_rows(found))
        yield Step(Stage.CLOSE, found, str(words[0]), pulse, _size(near, pulse), tie=_ties(parts))
    held, parts = lifted(task, parts)
    rows = grasp_rows(held)
    yield Step(Stage.LIFT, held, str(lifting(task, rows)[0]))
    yield Step(Stage.CARRY, held, str(carrying(task, rows)[0]))
    yield from _released(known, plan, parts, held)


def _opened(task: Task, plan: Plan, opening: Replay) -> Iterator[Step]:
    """The gripper opens before the body comes."""
    codes = [pulse.target for pulse in plan.opening] or [plan.opened]
    pulses: Sequence[Pulse | None] = plan.opening or [None]
    ties = opening.ties or ((),)
    for code, pulse, groups in zip(codes, pulses, ties, strict=True):
        found = free(task, _code(code), task.begins(1))
        near = float("nan") if pulse is None else pulse.margin
        word, tie = str(status_words(grasp_rows(found))[0]), "; ".join(map(numbered, groups))
        yield Step(Stage.OPEN, found, word, pulse, near, tie=tie)


def _moved(task: Task, stage: Stage, found: Grasps) -> Step:
    """The body comes, or is left: where it meets a finger, it is there."""
    ends = [task.begins(1), found.centers]
    begin, end = ends if stage is Stage.APPROACH else ends[::-1]
    going = way(task, found, begin, end)
    there = replace(found, centers=begin + going.share * (end - begin))
    word = WELL if going.is_clear[0] else COLLIDES
    return Step(stage, there, word, clearance=float(going.gap[0]))


def _released(known: Prospect, plan: Plan, parts: Parts, held: Grasps) -> Iterator[Step]:
    """The body is put down, the gripper opens and moves away."""
    task, found = known.task, held
    if not plan.release:
        yield Step(Stage.RELEASE, held, NO_PULSES)
    for count, pulse in enumerate(plan.release, start=1):
        parts, near = pulsed(task, parts, [[pulse]], known.reach)
        found = kept(task, parts, held.centers, held.turned)
        rows = grasp_rows(found)
        word = str(status_words(rows)[0])
        is_held = word == WELL and count == len(plan.release) and rows["n_contacts"][0] > 0
        word = IN_TOUCH if is_held else word
        yield Step(Stage.RELEASE, found, word, pulse, _size(near, pulse), tie=_ties(parts))
    yield _moved(task, Stage.WITHDRAW, found)


def _size(near: Array, pulse: Pulse) -> float:
    """A share of a pulse's peak in MPa; NaN where no threshold is known."""
    return float(near[0]) * abs(pulse.peak) if np.isfinite(near[0]) else float("nan")


def _code(code: int) -> np.ndarray[tuple[int], np.dtype[np.uint64]]:
    return np.array([code], np.uint64)


def _ties(parts: Parts) -> str:
    """Units that are tied on the way of either finger, group by group."""
    groups = [
        numbered(np.flatnonzero(told.tied[:, 0]).tolist())
        for part in parts
        for told in part.grown.resets
    ]
    return "; ".join(dict.fromkeys(filter(None, groups)))


def columns_of(task: Task) -> tuple[Column, ...]:
    """The columns of a routine: payloads where there is friction, their margin where a mass is."""
    friction = task.scene.friction
    left_out = {OF_FRICTION, OF_WEIGHT} if friction is None else set()
    if friction is not None and friction.weight is None:
        left_out.add(OF_WEIGHT)
    if not turns(task.scene.body, task.scene.held):
        left_out.add(ANGLE)
    return tuple(column for column in COLUMNS if column.name not in left_out)


def routine_rows(routine: Routine) -> Columns:
    """A row for each step, by column."""
    told = [grasp_rows(step.found) for step in routine.steps]
    after = [str(rows["pattern_after"][0]) for rows in told]
    pulses = [step.pulse for step in routine.steps]
    lines = routine.task.lines.lines
    payload = np.array([float(rows.get("payload_N", [np.nan])[0]) for rows in told])
    friction = routine.task.scene.friction
    weight = None if friction is None else friction.weight
    first = f"{routine.search.known.rest:0{routine.task.scene.finger.n_units}b}"

    def of(name: str, kind: type) -> Array:
        return np.array([rows[name][0] for rows in told], kind)

    rows: Columns = {
        "step": np.array([step.stage.value for step in routine.steps], str),
        "line": np.array([lines[pulse.line] if pulse else "" for pulse in pulses], str),
        "peak_pressure_MPa": np.array([pulse.peak if pulse else np.nan for pulse in pulses], float),
        "margin_MPa": np.array([step.margin for step in routine.steps], float),
        "pattern_before": np.array([first, *after][: len(after)], str),
        "pattern_after": np.array(after, str),
        "status": np.array([step.status for step in routine.steps], str),
        "clearance_mm": np.array([step.clearance for step in routine.steps], float),
        **{name: of(name, kind) for name, kind in (("n_contacts", int), ("squeeze_N", float))},
        "payload_N": payload,
        "payload_margin": payload / weight - 1.0 if weight else 0.0 * payload,
        **{name: of(name, float) for name in ("object_x_mm", "object_y_mm")},
        ANGLE: np.degrees([float(np.reshape(step.found.turned, -1)[0]) for step in routine.steps]),
        "tie": np.array([step.tie for step in routine.steps], str),
    }
    return {column.name: rows[column.name] for column in columns_of(routine.task)}


def joined(routine: Routine) -> Grasps:
    """The shapes of all steps, a row each."""
    first = routine.steps[0].found
    found = [step.found for step in routine.steps]
    fingers = tuple(
        Grasped.joined(own) for own in zip(*(own.fingers for own in found), strict=True)
    )
    pairs = np.tile(np.arange(len(found)), (len(fingers), 1))
    centers = np.concatenate([own.centers for own in found], axis=1)
    turned = np.concatenate([np.reshape(own.turned, -1) for own in found])
    return replace(first, fingers=fingers, pairs=pairs, centers=centers, turned=turned)


def schedule(routine: Routine, ramp: float, move: float) -> History:
    """The pressures of a routine's lines by time, in s, all of them at zero between pulses.

    Each ramp, up or down, takes `ramp`, and each of the gripper's moves `move`: the body comes, is
    lifted and carried, is left. Nothing in the model knows how long they take.
    """
    zero = np.zeros(len(routine.task.lines.lines))
    times, pressures = [0.0], [zero]
    moves = (Stage.APPROACH, Stage.CARRY, Stage.WITHDRAW)
    for step in routine.steps:
        if step.stage in moves:
            times.append(times[-1] + move)
            pressures.append(zero)
        if step.pulse is not None:
            peak = zero.copy()
            peak[step.pulse.line] = step.pulse.peak
            times += [times[-1] + ramp, times[-1] + 2.0 * ramp]
            pressures += [peak, zero]
    return History(np.array(pressures), np.array(times))
