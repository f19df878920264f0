"""`routine`: pulses that open a gripper, close it on a body that comes, and let it go."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from dpgcli.api.arguments import (
    check_positive,
    check_texts,
    figure_path,
    path_of,
    point,
    table_path,
)
from dpgcli.api.bodies import (
    NO_BODY,
    check_body,
    force_lines,
    own_settings,
    pressure_lines,
    with_body,
)
from dpgcli.api.inputs import SceneInput, Settings, SpecInput
from dpgcli.api.pressed_states import code_of, unknown_rest
from dpgcli.api.pressure import pressed_input
from dpgcli.api.pulses import check_size
from dpgcli.api.tables import Table, TableResult
from dpgcli.api.transitions import failed_searches
from dpgcli.arrays import Columns, keep_freed_memory
from dpgcli.design.bodies import gives_way
from dpgcli.design.loads import direction_text
from dpgcli.design.pressure import History
from dpgcli.design.scene import Held
from dpgcli.errors import ActuationError, Field, UsageError
from dpgcli.grasping.costs import routine_seconds
from dpgcli.grasping.plans import Prospect, prospect
from dpgcli.grasping.routine import NO_PULSES, NOT_CHECKED, Stage, searched
from dpgcli.grasping.stages import Task
from dpgcli.grasping.steps import (
    Routine,
    columns_of,
    routine_of,
    routine_rows,
    schedule,
)
from dpgcli.records import dataclass
from dpgcli.states.columns import Column
from dpgcli.text import counted

RAMP, MOVE = 1.0, 5.0  # s


@dataclass(frozen=True)
class RoutineResult(TableResult):
    """A routine step by step, or how far the best plan comes and what is in its way."""

    given: SceneInput
    routine: Routine
    ramp: float
    move: float

    @property
    def exists(self) -> bool:
        """Whether pulses do all that is asked for, as far as it is checked."""
        return self.routine.search.holds

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of the steps."""
        return columns_of(self.routine.task)

    @cached_property
    def rows(self) -> Columns:
        """Steps by column."""
        return routine_rows(self.routine)

    @cached_property
    def table(self) -> Table:
        """A row for each step."""
        return Table.of(self.columns, self.rows)

    @property
    def history(self) -> History:
        """The pressures of all lines by time. Raises UsageError where there is no routine."""
        if not self.exists:
            raise UsageError("no routine is found: there are no pressures for a controller")
        return schedule(self.routine, self.ramp, self.move)

    @property
    def summary(self) -> tuple[str, ...]:
        """What was found, what is in the way, and what all that rests on: lines."""
        return tuple(self._lines())

    def _lines(self) -> Iterator[str]:
        search, rows = self.routine.search, self.rows
        yield from self._found() if self.exists else self._failures()
        if search.n_left_out:
            yield f"{counted(search.n_left_out, 'plan')} not tried: those of most pulses"
        if n_unknown := search.known.graph.n_unknown:
            yield f"{failed_searches(n_unknown)}: there may be other plans"
        if NOT_CHECKED in rows["status"].tolist():
            yield from self._unchecked()
        if any(rows["tie"]):
            yield (
                "ties: the model does not say which of the units goes first, and with a body in "
                "the way another order may end in another state"
            )
        if n_over := sum(step.overlaps for step in self.routine.steps):
            yield (
                f"{counted(n_over, 'step')} in which the fingers overlap each other: their contact "
                "with each other is not in the model"
            )
        yield from self._assumptions()
        yield from pressure_lines(self.given.scene)
        yield from force_lines(self.given.scene)

    def _found(self) -> Iterator[str]:
        pulses = [step for step in self.routine.steps if step.pulse is not None]
        margins = [
            (step.margin, abs(step.pulse.peak))
            for step in pulses
            if step.pulse is not None and step.margin == step.margin
        ]
        words = f"routine of {counted(len(pulses), 'pulse')}, the fewest that are found"
        if margins:
            least, peak = min(margins)
            words += f"; smallest margin {least:.4g} MPa, {100.0 * least / peak:.2g}% of its peak"
        yield f"{words}; each step followed with the body there"

    def _failures(self) -> Iterator[str]:
        """Which plans fail where."""
        search, steps = self.routine.search, self.routine.steps
        known = search.known
        plans = counted(len(known.plans), "plan")
        yield f"no routine found: {plans} of pulses up to {known.reach:.4g} MPa"
        if not steps:
            yield "no pulses lead from rest to the open state that is asked for"
            return
        for (stage, why), number in search.failures.items():
            of = "open state" if stage is Stage.APPROACH else "plan"
            yield f"{stage}: {why} in {counted(number, of)}"
        yield f"shown is the one that comes furthest: {self._reason()}"

    def _reason(self) -> str:
        """Why the plan that comes furthest ends where it does."""
        last, task = self.routine.steps[-1], self.routine.task
        x, y = last.found.centers[:, 0]
        friction = task.scene.friction
        weight = 0.0 if friction is None else friction.weight or 0.0
        payload = self.rows["payload_N"][-1] if "payload_N" in self.rows else 0.0
        return {
            "collides": f"body and fingers meet with the body at {x:.4g},{y:.4g} mm",
            NO_PULSES: f"no pulses up to {self.routine.search.known.reach:.4g} MPa lead "
            f"{self._on_to(last.stage)} from {self.rows['pattern_after'][-1]}",
            "not_touched": "not both fingers touch the body after the pulses that close them",
            "slips": "the body slips as soon as its support is gone",
            "not_held": "let go of, the body leaves the fingers",
            "too_heavy": f"{payload:.4g} N are borne of a weight of {weight:.4g} N",
            "in_touch": "after the pulses that let go the fingers still touch the body",
        }.get(last.status, f"{last.stage} ends {last.status}")

    def _on_to(self, stage: Stage) -> str:
        closed = self.routine.search.known.closed
        if stage is not Stage.CLOSE or closed is None:
            return "on"
        return f"to {closed:0{self.given.scene.finger.n_units}b}, as without the body,"

    def _unchecked(self) -> Iterator[str]:
        lifts = self.routine.task.scene.held is not Held.FIXED
        what = "carried" if lifts else "lifted and carried"
        yield (
            f"not checked: whether the body is {what}, as object.friction is not given"
            + ("" if lifts else ", and the body is fixed")
        )

    def _assumptions(self) -> Iterator[str]:
        """What the steps are computed with."""
        task = self.routine.task
        yield (
            "quasi-static: pressures change slowly, and not while the gripper moves; the body is "
            "kept in its place while they do, and contact is without friction"
        )
        if (friction := task.scene.friction) is not None:
            yield (
                f"payload: pull along {direction_text(task.scene.gravity)}, where gravity acts to; "
                f"rests on the friction of {friction.coefficient:g} that is given"
                + ("" if friction.weight is not None else "; no mass_g says what has to be borne")
            )

    def save(self, path: str | Path) -> None:
        """Write the steps to a Parquet file, the bytes of `dpg routine --output`.

        Raises OutputError, and UsageError for a file that was read or a name of another format.
        """
        from dpgcli.files.output import Mark, check_outputs
        from dpgcli.files.scene_file.objects import told_of
        from dpgcli.files.scene_rows import write_scene_rows

        table, task = path_of("path", path), self.routine.task
        check_outputs(self.given.files, (table, Mark.TABLE))
        chosen = {"object": told_of(task.body, task.scene.held, task.scene.friction)}
        chosen |= {"approach_from_mm": task.begin.tolist()}
        scene = self.given.scene
        write_scene_rows(table_path(table), scene, self.given.json, self.columns, self.rows, chosen)

    def save_controller(self, path: str | Path) -> None:
        """Write the pressures by time to a CSV file, as `actuate` reads them.

        Raises OutputError, and UsageError where there is no routine.
        """
        from dpgcli.files.controller import write_controller
        from dpgcli.files.output import Mark, check_outputs

        file, history = path_of("path", path), self.history
        if file.suffix.lower() != ".csv":
            raise UsageError(f"path {path}: expected a name that ends in .csv")
        check_outputs(self.given.files, (file, Mark.CONTROLLER))
        write_controller(file, self.routine.task.lines.lines, history)

    def draw(self, path: str | Path) -> None:
        """Draw the steps, a panel each, to a .svg or .png file. Raises UsageError without steps."""
        from dpgcli.reports.routine import draw_routine

        if not self.routine.steps:
            raise UsageError("there are no steps to draw")
        draw_routine(self.routine, self.rows, figure_path(path))


def routine(
    spec: SpecInput,
    *,
    approach_from: Sequence[float],
    object: str | None = None,
    at: Sequence[float] | None = None,
    open: str = "",
    closed: str = "",
    ramp: float = RAMP,
    move: float = MOVE,
    settings: Settings = (),
) -> RoutineResult:
    """Pulses, without feedback, that open a gripper, close it on a body, hold it and let it go.

    The body comes along a straight line from `approach_from` (mm, in the gripper's frame) to its
    place; `object` and `at` are those of `grasp`. Only open states `open` are tried, and pulses
    that lead to `closed` without the body, if they are given. Controllers need times, which no
    model knows: `ramp` (s) is that of a ramp of pressure, `move` that of a move of the gripper.
    Raises SpecError for a wrong spec, UsageError for wrong choices, ActuationError where a finger
    that is followed ends elsewhere than planned.

    >>> spec = {"finger": {"units": 1, "calibration": "published",
    ...     "linear_stiffness_N_per_mm": float("inf"), "geometry": {
    ...     "dome_height_mm": 6.5, "dome_thickness_mm": 0.75, "unit_cell_mm": 22,
    ...     "chamber_length_mm": 9, "channel_width_mm": 10, "limiting_layer_thickness_mm": 1.5,
    ...     "unit_separation_mm": 3, "elastic_modulus_MPa": 26}},
    ...     "gripper": {"base_spacing_mm": 24, "mounting_angle_deg": 0}}
    >>> found = routine(spec, object="disc:20", at=(14, 0), approach_from=(60, 0))
    >>> found.exists, found.table["pattern_after"].tolist()
    (True, ['0', '0', '1', '1', '1', '0', '0'])
    >>> found.history.pressure[:, 0].round(3).tolist()
    [0.0, 0.0, 0.164, 0.0, 0.0, -0.071, 0.0, 0.0]
    """
    check_positive("ramp", ramp)
    check_positive("move", move)
    check_texts(open=open, closed=closed)
    given, known = planned(spec, approach_from, object, at, open, closed, settings)
    return found_routine(given, known, ramp, move)


def planned(
    spec: SpecInput,
    approach_from: Sequence[float],
    body: str | None,
    at: Sequence[float] | None,
    opened: str,
    closed: str,
    settings: Settings = (),
) -> tuple[SceneInput, Prospect]:
    """What there is to try: open states past which the body comes, and pulses that close."""
    begin = np.array(point("approach_from", approach_from))
    of_spec, of_body = own_settings(settings, body)
    pressed = pressed_input(spec, of_spec)
    check_size(pressed)
    scene = pressed.given.scene
    if scene.gripper is None:
        raise UsageError("a routine needs two fingers: expected gripper in the spec")
    codes = [
        code_of(pressed, field, pattern) if pattern else None
        for field, pattern in (("open", opened), ("closed", closed))
    ]
    given = with_body(pressed.given, body, at, of_body)
    known = given.scene.body
    if known is None:
        raise UsageError(Field("object"), NO_BODY)
    check_body(given.scene, known)
    if gives_way(known):
        raise UsageError(
            Field("object"), ": expected a body that keeps its shape, without compliance"
        )
    if (begin == known.center).all():
        raise UsageError(Field("approach_from"), ": expected another place than that of the body")
    nearest = float(known.nearest_x)
    if nearest + begin[0] - known.center[0] < min(0.0, nearest):
        expected = ": expected a place in front of the gripper's base, found one behind it, at "
        raise UsageError(Field("approach_from"), f"{expected}x = {begin[0]:g} mm")
    keep_freed_memory()
    found = prospect(Task(given.scene, pressed.pressed, begin), *codes)
    if not len(found.graph.code):
        raise UsageError(f"a routine begins at rest: {unknown_rest(pressed.pressed)}")
    return given, found


def seconds_of(known: Prospect) -> float:
    """Seconds of one core that following all plans of a prospect may take."""
    scene = known.task.scene
    assert scene.body is not None, "a scene with a body"
    rounds = [[plan.n_pulses for plan in plans] for plans in known.rounds()]
    return routine_seconds(scene, scene.body, rounds)


def found_routine(given: SceneInput, known: Prospect, ramp: float, move: float) -> RoutineResult:
    """The same, of what there is to try."""
    found = routine_of(searched(known))
    result = RoutineResult(given, found, ramp, move)
    if found.opening is not None and found.opening.problem:
        raise ActuationError(result, f"the pulses that open do not hold: {found.opening.problem}")
    if result.exists and not found.is_done:
        last = found.steps[-1]
        raise ActuationError(result, f"the routine does not hold: {last.stage} ends {last.status}")
    return result
