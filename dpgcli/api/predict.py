"""`predict`: the stable states of a finger or gripper."""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from dpgcli.api.arguments import (
    as_texts,
    check_flags,
    check_texts,
    figure_path,
    number,
    path_of,
    table_path,
)
from dpgcli.api.inputs import SceneInput, Settings, SpecInput, spec_or_design
from dpgcli.api.tables import Table, TableResult
from dpgcli.arrays import Columns
from dpgcli.design.outputs import Trust
from dpgcli.design.scene import Scene
from dpgcli.errors import Field, UsageError
from dpgcli.records import dataclass
from dpgcli.states import predict as states
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.plan import Plan, Request
from dpgcli.states.predict import Prediction, Summary
from dpgcli.text import quoted

if TYPE_CHECKING:
    from dpgcli.reports.outlines import DrawnState

MOST_DRAWN = 64  # shapes that one can tell apart


@dataclass(frozen=True)
class PredictResult(TableResult):
    """Every state that was asked for, certified; what happened to one is its row's status.

    `prediction` has the plan and a summary, `blocks` the rows in the plan's columns.
    """

    given: SceneInput
    prediction: Prediction
    blocks: tuple[Columns, ...]

    @property
    def plan(self) -> Plan:
        """The decisions: method, columns, omissions and their reasons."""
        return self.prediction.plan

    @property
    def summary(self) -> Summary:
        """Counts by status, largest residual (N) and tip error (mm), times (s)."""
        return self.prediction.summary

    @property
    def trusts(self) -> tuple[Trust, ...]:
        """What each kind of output rests on; none of values without a spec."""
        return self.plan.trusts

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of the calibrations in use."""
        return self.plan.warnings

    @cached_property
    def table(self) -> Table:
        """A row for each state."""
        return Table.of(self.plan.columns, *self.blocks)

    def save(self, path: str | Path) -> None:
        """Write the states to a Parquet file, the bytes of `dpg predict --output`.

        What differs between runs goes into a `.run.json` beside it. Raises OutputError, and
        UsageError for a file that the states come from, or a name of another format.
        """
        from dpgcli.files.output import Mark, check_outputs, run_file
        from dpgcli.files.prediction import check_facts, write_prediction

        table = path_of("path", path)
        check_outputs(self.given.files, (table, Mark.TABLE), (run_file(table), Mark.FACTS))
        check_facts(table_path(table))
        write_prediction(self.prediction, table, self.given.json, self.blocks)

    def draw(self, path: str | Path, *, overlay: bool = False) -> None:
        """Draw the states, 64 at most, to a .svg or .png file.

        A panel for each, those with fewer inverted units first, or all in one picture.
        """
        check_flags(overlay=overlay)
        check_drawable(self.plan.n_states)
        draw(self.given.scene, self.plan.request.patterns, figure_path(path), overlay=overlay)

    def sketch(self, width: int = 80) -> str:
        """Small pictures of the states, 64 at most, as braille in lines of `width` characters."""
        if not (isinstance(width, int) and width > 0):
            raise UsageError(f"width {quoted(width)}: expected a whole number from 1 on")
        check_drawable(self.plan.n_states, "sketch")
        return sketch(self.given.scene, self.plan.request.patterns, width)


def predict(
    spec: SpecInput,
    *,
    design: int | None = None,
    settings: Settings = (),
    patterns: str | Sequence[str] = (),
    columns: str | Sequence[str] = "default",
    formulation: str = "chain",
    tolerance: float | None = None,
    target_error: float | None = None,
) -> PredictResult:
    """Predict and certify stable states.

    With `design` the `spec` is the folder of a sweep, or its table of designs, and this is one of
    them by its number.
    `settings` change keys of the spec; `patterns` are globs such as "1*1", none for all states;
    `columns` names columns or groups of them. `tolerance` is the largest residual over the forces
    in play; a `target_error` (mm, of the tips) takes the cheapest accuracy level that is bounded by
    it.
    Raises SpecError for a wrong spec, UsageError for wrong choices, NothingSelectedError where no
    pattern matches.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> states = predict(uniform_finger(3, **STUDY), patterns="1*1").table
    >>> states["pattern"].tolist(), states["status"].tolist()
    (['101', '111'], ['stable', 'stable'])
    """
    given = spec_or_design(spec, design, settings)
    request = request_of(patterns, columns, formulation, tolerance, target_error)
    prediction = states.predict(given.scene, request)
    return PredictResult(given, prediction, tuple(prediction.blocks()))


def request_of(
    patterns: str | Sequence[str],
    columns: str | Sequence[str],
    formulation: str,
    tolerance: float | None,
    target_error: float | None,
) -> Request:
    """The request that these arguments make."""
    names = columns.split(",") if isinstance(columns, str) else as_texts("columns", columns)
    tolerance, target_error = number("tolerance", tolerance), number("target_error", target_error)
    check_texts(formulation=formulation)
    return Request(
        patterns=as_texts("patterns", patterns),
        columns=tuple(name.strip() for name in names if name.strip()),
        formulation=formulation,
        tolerance=DEFAULT_TOLERANCE if tolerance is None else tolerance,
        target_error=target_error,
    )


def check_drawable(n_states: int, field: str = "plot") -> None:
    """Raise UsageError for more shapes than one can see."""
    if n_states > MOST_DRAWN:
        what = f" draws at most {MOST_DRAWN} states, not {n_states:,}: select with "
        raise UsageError(Field(field), what, Field("patterns"))


def draw(scene: Scene, patterns: tuple[str, ...], path: Path, *, overlay: bool = False) -> None:
    """Draw the states with these patterns."""
    from dpgcli.reports.figures import draw_states

    draw_states(_with_nodes(scene, patterns), path, overlay=overlay)


def sketch(scene: Scene, patterns: tuple[str, ...], width: int) -> str:
    """The states with these patterns as braille."""
    from dpgcli.reports.sketch import sketches

    return sketches(drawn(scene, patterns), width)


def drawn(scene: Scene, patterns: tuple[str, ...]) -> "list[DrawnState]":
    """What the states with these patterns look like."""
    from dpgcli.reports.outlines import drawn_states

    return drawn_states(_with_nodes(scene, patterns))


def _with_nodes(scene: Scene, patterns: tuple[str, ...]) -> Prediction:
    from dpgcli.reports.outlines import COLUMNS, OF_GRIPPERS

    columns = COLUMNS if scene.gripper is None else (*COLUMNS, *OF_GRIPPERS)
    return states.predict(scene, Request(patterns, columns=columns))
