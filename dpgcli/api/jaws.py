"""`jaws`: what the states of a gripper bear as jaws between its fingers open and close."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from dpgcli.api.arguments import as_texts, figure_path, path_of, point, table_path
from dpgcli.api.bodies import check_body, force_lines
from dpgcli.api.grasp import check_drawable
from dpgcli.api.inputs import SceneInput, Settings, SpecInput, scene_input
from dpgcli.api.tables import Table, TableResult
from dpgcli.arrays import Array, Codes, Columns, keep_freed_memory
from dpgcli.design.bodies import Jaws
from dpgcli.design.scene import Held, Scene
from dpgcli.errors import Field, UsageError
from dpgcli.grasping.frames import frames
from dpgcli.grasping.jaw_table import COLUMNS, LAST, PATH_COLUMNS, by_number, jaw_rows, path_rows
from dpgcli.grasping.jaws import JawPath, jaw_path
from dpgcli.grasping.mechanism import STUDY, Branch, Mechanism
from dpgcli.mechanics.terms import chain_potential
from dpgcli.records import dataclass
from dpgcli.states.certify import Status
from dpgcli.states.patterns import select
from dpgcli.text import counted

MOST_STATES = 1024
HEIGHT = 40.0  # mm, of jaws that the spec says nothing of
NARROWEST, WIDEST = 1e-3, 1e4  # mm


@dataclass(frozen=True)
class JawsResult(TableResult):
    """What each state bears as jaws open and close, and its force by their aperture."""

    given: SceneInput
    jaws: Jaws
    gaps: tuple[float, float]
    path: JawPath

    @property
    def n_units(self) -> int:
        """Units of a finger."""
        return self.given.scene.finger.n_units

    @cached_property
    def rows(self) -> Columns:
        """A row for each state, by column."""
        return jaw_rows(self.path, self.n_units)

    @cached_property
    def table(self) -> Table:
        """A row for each state."""
        return Table.of(COLUMNS, self.rows)

    @cached_property
    def curves(self) -> Table:
        """Force by aperture: a row for each state and step."""
        return Table.of(PATH_COLUMNS, path_rows(self.path, self.n_units))

    @property
    def summary(self) -> tuple[str, ...]:
        """Force by the number of inverted units, the study's mechanism, what forces rest on."""
        return tuple(self._lines())

    def _lines(self) -> Iterator[str]:
        for number, exactly, at_least in by_number(self.rows):
            held = [_held("", exactly), _held("at least ", at_least)]
            said = ", ".join(text for text in held if text)
            yield f"F{number}, {counted(number, 'unit')} inverted: {said}"
        yield from self._ways()
        yield from self._mechanism()
        yield from force_lines(self.given.scene)

    def _ways(self) -> Iterator[str]:
        """How many states have no answer, or only a part of one."""
        n_without = int((self.rows["status"] != Status.STABLE).sum())
        n_kept = int((self.rows["ended_by"] == LAST).sum())
        n_lost = int((~np.isnan(self.rows["lost_mm"])).sum())
        if n_kept:
            yield f"{counted(n_kept, 'state')} without a reset up to {self.gaps[1]:g} mm"
        if n_lost:
            yield (
                f"{counted(n_lost, 'state')} lost on the way: no certified state from lost_mm on, "
                "see the column ended_by"
            )
        if n_without:
            yield f"{counted(n_without, 'state')} without an answer: see the column status"

    def _mechanism(self) -> Iterator[str]:
        """The study's two forces: one fitted, the other predicted, if both states are there."""
        lanes = {text: lane for lane, text in enumerate(self.rows["pattern"])}
        if not all(pattern in lanes for pattern in STUDY):
            return
        (known, force), (other, measured) = STUDY.items()
        rest = float(self.jaws.gap)
        fitted = Mechanism.fitted(Branch.of(self.path, lanes[known]), rest, force)
        if fitted is None:
            yield (
                f"the study's mechanism, at rest at {rest:g} mm: {known} does not hold its "
                f"{force} N before a unit resets or the mechanism is at rest"
            )
            return
        told = fitted.force(Branch.of(self.path, lanes[other]))
        said = "no rest before a unit resets"
        if told is not None:
            said = f"{told:.3g} N, {100.0 * (told / measured - 1.0):+.0f} %"
        yield (
            f"the study's mechanism, at rest at {rest:g} mm (assumed), {fitted.stiffness:.3g} N/mm "
            f"fitted to the {force} N of {known}: {other} holds {said} (study: {measured} N)"
        )

    def save(self, path: str | Path) -> None:
        """Write force by aperture to a Parquet file, the bytes of `dpg grasp --jaws --output`.

        Raises OutputError, and UsageError for a file that was read or a name of another format.
        """
        from dpgcli.files.output import Mark, check_outputs
        from dpgcli.files.scene_file.objects import told_of
        from dpgcli.files.scene_rows import write_scene_rows

        table = path_of("path", path)
        check_outputs(self.given.files, (table, Mark.TABLE))
        rows = path_rows(self.path, self.n_units)
        scene = self.given.scene
        body, gaps = told_of(self.jaws, Held.FIXED), [*self.gaps]
        write_scene_rows(
            table_path(table),
            scene,
            self.given.json,
            PATH_COLUMNS,
            rows,
            {"object": body, "gaps_mm": gaps},
        )

    def draw(self, path: str | Path) -> None:
        """Draw force by aperture, and by the number of inverted units, to a .svg or .png file."""
        from dpgcli.reports.jaws import draw_jaws

        check_drawable(len(self.path.codes))
        draw_jaws(self.given.scene, self.path, self.rows, figure_path(path))


def _held(prefix: str, force: Array) -> str:
    """Such as "at least 0.2 to 0.3 N (2 states)"; nothing of no states."""
    if not len(force):
        return ""
    ends = dict.fromkeys(f"{value:.4g}" for value in (force.min(), force.max()))
    return f"{prefix}{' to '.join(ends)} N ({counted(len(force), 'state')})"


def jaws(
    spec: SpecInput,
    *,
    gaps: Sequence[float],
    at: Sequence[float] | None = None,
    patterns: str | Sequence[str] = "*",
    settings: Settings = (),
) -> JawsResult:
    """What the states of a gripper bear as jaws open from one aperture to another, and close again.

    `gaps` are the two apertures in mm, `at` is the middle of the jaws (mm) in the gripper's frame;
    their height along the fingers and their aperture at rest are those of the spec's object, or
    40 mm and the wider of the two. Both fingers are in the same state. Raises SpecError for a
    wrong spec, UsageError for what is no gripper, pattern or aperture.

    >>> from dpgcli.design.scene import Gripper, Scene
    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> finger = uniform_finger(3, **STUDY)
    >>> gripper = Scene(finger, (), Gripper(base_spacing=30.0, mounting_angle=0.0), 1.5)
    >>> found = jaws(gripper, gaps=(10.0, 26.0), at=(30.0, 0.0), patterns="111")
    >>> found.table["pattern"].tolist(), len(found.curves["squeeze_N"])
    (['111'], 101)
    """
    return jaws_of(scene_input(spec, settings), gaps, at, as_texts("patterns", patterns))


def jaws_of(
    given: SceneInput,
    gaps: Sequence[float],
    at: Sequence[float] | None,
    patterns: Sequence[str],
) -> JawsResult:
    """The same, of what was read before."""
    scene = given.scene
    body, (first, last) = body_of(scene, gaps, at)
    codes = states_of(scene, patterns)
    keep_freed_memory()
    upper = frames(scene.gripper)[0]
    path = jaw_path(scene, chain_potential, body, upper, codes, (first, last))
    return JawsResult(given, body, (first, last), path)


def states_of(scene: Scene, patterns: Sequence[str]) -> Codes:
    """The states of these patterns. Raises UsageError for what is no pattern, and for too many."""
    selection = select(patterns, scene.finger.n_units)
    if len(selection) > MOST_STATES:
        raise UsageError(
            Field("patterns"), f": {len(selection):,} states, expected at most {MOST_STATES:,}"
        )
    return selection.codes(0, len(selection))


def body_of(
    scene: Scene, gaps: Sequence[float], at: Sequence[float] | None
) -> tuple[Jaws, tuple[float, float]]:
    """The jaws at rest, and the two apertures. Raises UsageError for what is none."""
    if scene.gripper is None:
        raise UsageError(Field("gaps"), ": jaws need a gripper in the spec")
    first, last = point("gaps", gaps)
    if not (min(first, last) >= NARROWEST and max(first, last) <= WIDEST and first != last):
        raise UsageError(
            Field("gaps"),
            f" {first:g}:{last:g}: expected two apertures from {NARROWEST:g} to {WIDEST:g} mm",
        )
    known = scene.body if isinstance(scene.body, Jaws) else None
    if at is not None:
        center = np.array(point("at", at))
    elif scene.body is not None:
        center = scene.body.center
    else:
        raise UsageError(Field("at"), ": expected the middle of the jaws in mm, such as 40,0")
    height = HEIGHT if known is None else known.height
    rest = max(first, last) if known is None else known.gap
    body = Jaws(center, rest, height)
    if body.center[1] != 0.0:
        raise UsageError(Field("at"), ": expected jaws on the axis of the gripper, y of 0")
    for gap in (first, last):
        check_body(scene, Jaws(body.center, gap, height))
    return body, (first, last)
