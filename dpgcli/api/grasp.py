"""`grasp`: what the fingers of a gripper do with a body between them, state by state."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dpgcli.api.arguments import as_texts, check_flags, chosen, figure_path, path_of, table_path
from dpgcli.api.bodies import (
    body_lines,
    check_body,
    force_lines,
    own_settings,
    pressure_lines,
    with_body,
)
from dpgcli.api.inputs import SceneInput, Settings, SpecInput, scene_input
from dpgcli.api.tables import Table, TableResult
from dpgcli.arrays import Codes, Columns, distinct, keep_freed_memory
from dpgcli.design.bodies import Friction
from dpgcli.design.loads import direction_text
from dpgcli.design.scene import Scene
from dpgcli.errors import Field, UsageError
from dpgcli.grasping.approach import Load, Way
from dpgcli.grasping.closing import Closing
from dpgcli.grasping.costs import JOINED_SECONDS, MOVING_SECONDS, Work, effort, is_moving
from dpgcli.grasping.joining import n_overlapping
from dpgcli.grasping.table import BETWEEN, Grasps, columns_of, grasp_rows, grasps
from dpgcli.mechanics.terms import chain_potential
from dpgcli.records import dataclass
from dpgcli.states.certify import Status
from dpgcli.states.columns import Column
from dpgcli.states.patterns import select
from dpgcli.text import counted

if TYPE_CHECKING:
    from dpgcli.api.histories import PressureInput

MOST_ROWS, MOST_LANES, MOST_BYTES = 2**20, 2**14, 2**30
MOST_DRAWN = 64


@dataclass(frozen=True)
class GraspResult(TableResult):
    """Fingers at rest against a body, and what happened on the way there."""

    given: SceneInput
    grasps: Grasps
    way: Way

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of the rows."""
        return columns_of(self.grasps.scene, self.grasps.closing)

    @cached_property
    def rows(self) -> Columns:
        """A row for each state, or pair of states, by column."""
        return grasp_rows(self.grasps)

    @cached_property
    def table(self) -> Table:
        """A row for each state, or pair of states."""
        return Table.of(self.columns, self.rows)

    @property
    def summary(self) -> tuple[str, ...]:
        """How many hold, what reset, the largest force, what forces rest on: lines."""
        return tuple(self._lines())

    def _lines(self) -> Iterator[str]:
        rows = self.rows
        is_there = rows["status"] == Status.STABLE
        touches = int((rows["n_contacts"] > 0).sum())
        changed = int((is_there & (rows["pattern"] != rows["pattern_after"])).sum())
        n = len(is_there)
        what = "with each other" if self.grasps.body is None else "with the body"
        yield (
            f"of {counted(n, 'state')} {touches:,} in touch {what}, {changed:,} changed on "
            f"the way; worst penetration {_worst(rows['penetration_mm']):.2g} mm, worst residual "
            f"{_worst(rows['residual_N']):.2g} N"
        )
        is_let_go = rows["status"] == Status.NOT_HELD
        if n_let_go := int(is_let_go.sum()):
            yield f"{counted(n_let_go, 'state')} from which the body gets away: not_held"
        if n_other := int(n - (is_there | is_let_go).sum()):
            yield f"{counted(n_other, 'state')} without an answer: see the column status"
        if "overlaps" in rows and rows["overlaps"].any():
            is_met = self.grasps.body is None or BETWEEN in rows
            where = "elsewhere than at faces and ends" if is_met else "each other"
            yield (
                f"{counted(int(rows['overlaps'].sum()), 'state')} in which the fingers overlap "
                f"{where}: their contact there is not in the model"
            )
        if BETWEEN in rows:
            yield from self._between_lines()
        if self.grasps.body is None or BETWEEN in rows:
            yield from self._mirrored_lines()
        if "tie" in rows and (n_tied := int((rows["tie"] != "").sum())):
            yield (
                f"ties in {counted(n_tied, 'state')}: the model does not say which of the units "
                "goes first, and another order may end in another state"
            )
        if self.grasps.closing is not None:
            yield from pressure_lines(self.given.scene)
        yield from body_lines(self.grasps.scene)
        yield from force_lines(self.given.scene)
        if self.grasps.scene.friction is not None:
            yield from self._payload_lines(self.grasps.scene.friction)

    def _between_lines(self) -> Iterator[str]:
        """How many fingers touch each other beside the body."""
        if n_between := int((self.rows[BETWEEN] > 0.0).sum()):
            yield f"{counted(n_between, 'state')} in which the fingers touch each other"

    def _mirrored_lines(self) -> Iterator[str]:
        """What is taken of two fingers in one state that come together."""
        rows, mark = self.rows, "" if self.grasps.body is None else Load.MEETING
        are_reset = [bool(text) and mark in text and "/" not in text for text in rows["resets"]]
        is_alike = np.array(["/" not in text for text in rows["pattern"]], bool)
        told = [("reset", np.array(are_reset, bool))]
        if "events" in rows:
            told.append(("snapped or reset", (rows["events"] != "") & (rows[BETWEEN] > 0.0)))
        for happened, are_so in told:
            if n_so := int((is_alike & are_so).sum()):
                yield (
                    f"{counted(n_so, 'mirrored pair')} {happened} together: which finger goes "
                    "first the model does not say, and one alone may end in another state"
                )
        if n_aside := int((is_alike & (self.rows["status"] == Status.MARGINAL)).sum()):
            yield f"{counted(n_aside, 'mirrored pair')} giving way to one side: marginal"

    def _payload_lines(self, friction: Friction) -> Iterator[str]:
        """What payloads rest on, the largest, and which states do not bear the weight."""
        payload, pattern = self.rows["payload_N"], self.rows["pattern"]
        yield (
            f"payload: pull along {direction_text(self.grasps.scene.gravity)}, where gravity acts "
            f"to; rests on the friction of {friction.coefficient:g} that is given, and on these "
            "forces"
        )
        is_known = ~np.isnan(payload)
        is_unknown = (self.rows["status"] == Status.STABLE) & ~is_known
        if BETWEEN in self.rows and (n := int((is_unknown & (self.rows[BETWEEN] > 0.0)).sum())):
            yield (
                f"{counted(n, 'mirrored pair')} touching each other as well: what the pair bears "
                "is not known"
            )
        if not is_known.any():
            return
        best = int(np.nanargmax(payload))
        most, weight = payload[best], friction.weight
        if weight is None:
            yield f"largest payload {most:.4g} N, in {pattern[best]}"
            return
        yield (
            f"largest payload {most:.4g} N, in {pattern[best]}: {most / weight:.3g} times the "
            f"weight of {weight:.4g} N"
        )
        if n_less := int((payload[is_known] < weight).sum()):
            yield f"warning: {counted(n_less, 'state')} not bearing the weight of {weight:.4g} N"

    def save(self, path: str | Path) -> None:
        """Write the rows to a Parquet file, the bytes of `dpg grasp --output`.

        Raises OutputError, and UsageError for a file that was read or a name of another format.
        """
        from dpgcli.files.output import Mark, check_outputs
        from dpgcli.files.scene_file.objects import told_of
        from dpgcli.files.scene_metadata import told_history
        from dpgcli.files.scene_rows import write_scene_rows

        table = path_of("path", path)
        check_outputs(self.given.files, (table, Mark.TABLE))
        scene = self.grasps.scene
        chosen: dict[str, Any] = {"approach": "together"}
        if (body := self.grasps.body) is not None:
            told = told_of(body, scene.held, scene.friction)
            chosen = {"object": told, "approach": self.way.value}
        if (closing := self.grasps.closing) is not None:
            chosen |= told_history(closing.pressure, closing.history)
        write_scene_rows(table_path(table), scene, self.given.json, self.columns, self.rows, chosen)

    def draw(self, path: str | Path) -> None:
        """Draw the fingers on the body, with forces and inverted units, to a .svg or .png file."""
        from dpgcli.reports.grasp import draw_grasps

        check_drawable(len(self.rows["pattern"]))
        draw_grasps(self.grasps, self.rows, figure_path(path))


def _worst(values: Any) -> float:
    known = values[~np.isnan(values)]
    return float(known.max()) if len(known) else 0.0


def check_drawable(n_rows: int, field: str = "plot") -> None:
    """Raise UsageError for more grasps than one can see."""
    if n_rows > MOST_DRAWN:
        what = f" draws at most {MOST_DRAWN} grasps, not {n_rows:,}: select with "
        raise UsageError(Field(field), what, Field("patterns"))


def grasp(
    spec: SpecInput,
    *,
    object: str | None = None,
    at: Sequence[float] | None = None,
    patterns: str | Sequence[str] | None = None,
    both: bool = False,
    approach: str = "place",
    pressure: "PressureInput | None" = None,
    settings: Settings = (),
) -> GraspResult:
    """What the fingers of a spec do with a body in their way, or two without one with each other.

    `object` is such as "disc:40", a disc of 40 mm, "jaws:30x40", two plates of 40 mm with a gap of
    30 mm, or the name of a YAML file; `at` is its place (mm) in the gripper's frame. They are those
    of the spec's `object` unless given; beside an `object` settings such as object.held are its.
    Without either the bases of a gripper come together until its fingers touch. Patterns are globs
    such as "111*", or a pair of them for the upper and the lower finger, "111*/11100"; with `both`
    every pattern meets every other.
    With the `approach` "place" the body grows from nothing at its place, with "insert" it comes in
    along −x from beyond the fingers, and with "close" the fingers then go through pressures, as
    `actuate` takes them, until there is none; in the end the body is let go of, if the spec says
    that it is not fixed. Patterns are all of them, or that of a finger at rest with "close", unless
    given. Raises SpecError for a wrong spec or history, UsageError for what is no body, pattern or
    approach, a body that begins in a base, and for too many states.

    >>> from dpgcli.design.scene import Gripper, Scene
    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> finger = uniform_finger(3, **STUDY)
    >>> gripper = Scene(finger, (), Gripper(base_spacing=30.0, mounting_angle=0.0), 1.5)
    >>> found = grasp(gripper, object="disc:20", at=(32.0, 0.0), patterns=["001", "111"])
    >>> found.table["pattern_after"].tolist(), found.table["n_contacts"].tolist()
    (['001', '011'], [0, 2])
    """
    check_flags(both=both)
    way = chosen(Way, "approach", approach)
    given, closing = grasp_input(spec, object, at, settings, way, pressure)
    said = None if patterns is None else as_texts("patterns", patterns)
    return grasp_of(given, patterns_of(given.scene, closing, said), both, way, closing)


def grasp_input(
    spec: SpecInput,
    body: str | None,
    at: Sequence[float] | None,
    settings: Settings,
    way: Way,
    pressure: "PressureInput | None",
) -> tuple[SceneInput, Closing | None]:
    """A spec with its body or the one of these arguments, and pressures, if its fingers close.

    Raises SpecError for a wrong spec or history, UsageError for what is missing, and for pressures
    that have no use.
    """
    of_spec, of_body = own_settings(settings, body)

    def completed(given: SceneInput) -> SceneInput:
        with_it = with_body(given, body, at, of_body)
        if with_it.scene.body is None and way is not Way.PLACE:
            what = f" {way} goes with a body: expected an "
            raise UsageError(Field("approach"), what, Field("object"), " such as disc:40")
        return with_it

    if way is Way.CLOSE:
        from dpgcli.api.closing import closing_input

        return closing_input(spec, of_spec, pressure, completed)
    if pressure is not None:
        raise UsageError(Field("pressure"), " goes with ", Field("approach"), f" {Way.CLOSE}")
    return completed(scene_input(spec, of_spec)), None


def patterns_of(
    scene: Scene, closing: Closing | None, patterns: Sequence[str] | None
) -> tuple[str, ...]:
    """Patterns as given, else all of them, or that in which fingers rest before they close."""
    if patterns is not None:
        return tuple(patterns)
    if closing is None:
        return ("*",)
    from dpgcli.api.closing import rest_of

    return (rest_of(scene, closing),)


def grasp_of(
    given: SceneInput,
    patterns: Sequence[str],
    both: bool = False,
    way: Way = Way.PLACE,
    closing: Closing | None = None,
) -> GraspResult:
    """The same, of a scene with a body that was read before."""
    scene = given.scene
    check_body(scene, scene.body)
    pairs = pairs_of(patterns, scene, both)
    check_work(work_of(scene, pairs, way, closing))
    keep_freed_memory()
    found = grasps(scene, chain_potential, scene.body, pairs, way, closing)
    return GraspResult(given, found, way)


def work_of(
    scene: Scene, pairs: Sequence[Codes], way: Way = Way.PLACE, closing: Closing | None = None
) -> Work:
    """What pairs of states will take."""
    n_ramps = 0 if closing is None else len(closing.history.pressure)
    n_states = sum(len(distinct(codes)) for codes in pairs)
    sizes = n_states, len(pairs[0]), scene.finger.n_units, len(pairs)
    if scene.body is None:
        n_pairs = int((pairs[0] != pairs[-1]).sum())
        return Work(*sizes, False, n_pairs=n_pairs, effort=effort(scene, None))
    moves, has_friction = is_moving(scene), scene.friction is not None
    work = Work(*sizes, moves, way, n_ramps, has_friction, effort(scene, scene.body))
    work = replace(work, moving_seconds=MOVING_SECONDS[type(scene.body)])
    if len(pairs) < 2 or moves or closing is not None:
        return work
    n_pairs = n_overlapping(scene, chain_potential, pairs)
    return replace(work, n_pairs=n_pairs, pair_seconds=JOINED_SECONDS)


def check_work(work: Work) -> None:
    """Raise UsageError for grasps that take more memory than MOST_BYTES."""
    if work.peak_bytes > MOST_BYTES:
        what = f"{work.n_rows:,} grasps of {work.n_units} units take about"
        raise UsageError(
            f"{what} {work.peak_bytes / 2**30:.1f} GiB of memory: expected at most "
            f"{MOST_BYTES / 2**30:.1f}: select with ",
            Field("patterns"),
        )


def pairs_of(patterns: Sequence[str], scene: Scene, both: bool) -> tuple[Codes, ...]:
    """States of the upper and the lower finger by row; of a finger alone one.

    Raises UsageError for what is no pattern, for pairs of one finger, and for too many states.
    """
    n, is_pair = scene.finger.n_units, scene.gripper is not None
    if not is_pair and (both or any("/" in text for text in patterns)):
        raise UsageError(Field("patterns"), ": pairs of states need a gripper in the spec")
    single, n_rows = [text for text in patterns if "/" not in text], 0
    found: list[tuple[Codes, Codes]] = []
    if single or not patterns:  # none at all selects nothing
        own = _codes(single, n)
        n_rows = _counted(0, len(own) ** 2 if both else len(own))
        found.append(_crossed(own, own) if both else (own, own))
    for text in patterns:
        upper, is_one, lower = text.partition("/")
        if is_one:
            halves = _codes([upper], n), _codes([lower], n)
            n_rows = _counted(n_rows, len(halves[0]) * len(halves[1]))
            found.append(_crossed(*halves))
    pairs = np.stack([np.concatenate(part) for part in zip(*found, strict=True)])
    if len(found) > 1:
        pairs = _each_once(pairs)
    return tuple(pairs) if is_pair else (pairs[0],)


def _each_once(pairs: Codes) -> Codes:
    """Pairs (2, row), each once: where it came first."""
    order = np.lexsort(pairs)
    is_new = np.ones(len(order), bool)
    is_new[1:] = (np.diff(pairs[:, order], axis=1) != 0).any(axis=0)
    return pairs[:, np.sort(order[is_new])]


def _counted(n_before: int, n_more: int) -> int:
    """So many rows, before they are made. Raises UsageError for too many."""
    n_rows = n_before + n_more
    if n_rows > MOST_ROWS:
        raise UsageError(f"{n_rows:,} grasps: expected at most {MOST_ROWS:,}")
    return n_rows


def _codes(globs: Sequence[str], n_units: int) -> Codes:
    selection = select(globs, n_units)
    if len(selection) > MOST_LANES:
        raise UsageError(
            Field("patterns"), f": {len(selection):,} states, expected at most {MOST_LANES:,}"
        )
    return selection.codes(0, len(selection))


def _crossed(upper: Codes, lower: Codes) -> tuple[Codes, Codes]:
    """Every one with every other, the upper's the slower."""
    return np.repeat(upper, len(lower)), np.tile(lower, len(upper))
