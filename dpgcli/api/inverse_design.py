"""`inverse_design`: designs whose states are as a goal asks for."""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from dpgcli.api.arguments import check_flags, number, path_of, whole
from dpgcli.api.given import GoalInput, goal_input
from dpgcli.api.inputs import Settings
from dpgcli.api.reached import reached
from dpgcli.api.tables import Table, TableResult
from dpgcli.arrays import Columns, keep_freed_memory
from dpgcli.design.dimensions import UNITS
from dpgcli.design.outputs import doubts_about
from dpgcli.design.scene import Scene
from dpgcli.errors import Field, NothingSelectedError, OutputError, UsageError
from dpgcli.files.design_spec import design_spec
from dpgcli.files.goal_file import GoalFile
from dpgcli.files.scene_file import Spec, scene_of
from dpgcli.records import dataclass
from dpgcli.search.columns import body_columns, pressed_columns
from dpgcli.search.goal import Goal
from dpgcli.search.search import MOST_CHOICES, Limits, Searched, search
from dpgcli.search.table import GoalTables, Reached
from dpgcli.search.targets import reason_against
from dpgcli.search.unmet import how_slopes_are_found
from dpgcli.states.columns import Column
from dpgcli.text import counted, enumerated

if TYPE_CHECKING:
    from dpgcli.api.place import Place, Say

MOST_NAMED = 3  # designs in a line


@dataclass(frozen=True)
class InverseDesignResult(TableResult):
    """The best designs, each certified anew from its spec, and how they were found.

    `specs` are those of the designs, the best first, and `reached` what their states come to.
    `removed` are specs of an earlier search that went from the folder of the output.
    """

    given: GoalFile
    searched: Searched
    specs: tuple[Spec, ...]
    reached: tuple[Reached, ...]
    removed: tuple[str, ...] = ()

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of designs."""
        return self._tables.columns

    @cached_property
    def rows(self) -> Columns:
        """Designs by column."""
        return self._tables.rows(self.searched.best, self.reached)

    @cached_property
    def table(self) -> Table:
        """A row for each design, the best first."""
        return Table.of(self.columns, self.rows)

    @cached_property
    def trace(self) -> Table:
        """A row for each step of each descent."""
        return Table.of(self._tables.trace_columns, self._tables.trace(self.searched.trace))

    @property
    def is_met(self) -> bool:
        """Whether the best design meets all that is asked."""
        return bool(self.rows["meets_all"][0])

    @property
    def warnings(self) -> tuple[str, ...]:
        """Of the calibrations in use, and of what no design should be chosen by."""
        scene = scene_of(self.specs[0])
        doubts = (f"goal: {why}" for why in _doubts(self._tables, scene))
        return (*scene.warnings, *doubts, *self._overlaps())

    def _overlaps(self) -> Iterator[str]:
        """In which states fingers overlap: contact of fingers is not in the model."""
        pairs = enumerate((each.overlapping for each in self.reached), start=1)
        found = [f"design {number} in {enumerated(own)}" for number, own in pairs if own]
        if found:
            more = f" and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else ""
            said = ", ".join(found[:MOST_NAMED])
            yield f"fingers overlap, since nothing keeps them apart in the model: {said}{more}"

    @property
    def summary(self) -> tuple[str, ...]:
        """How many designs meet what is asked, what is in the way, how slopes are found: lines."""
        return tuple(self._lines())

    def _lines(self) -> Iterator[str]:
        goal, found = self.given.goal, self.searched
        n_met, n = int(self.rows["meets_all"].sum()), len(self.specs)
        met = f"{n_met:,} of {counted(n, 'design')}" if n_met else "no design"
        meets = "meets" if n_met < 2 else "meet"
        front = "; they are a front" if len(goal.objectives) > 1 and n_met > 1 else ""
        yield f"{met} {meets} all that is asked{front}; each is certified anew from its spec"
        yield from self._tables.standing(found.best, 0).lines()
        tried = (
            f"{counted(found.n_starts, 'start')}, {counted(found.n_evaluated, 'design')} evaluated"
        )
        empty = f", {found.n_empty:,} of them without such states" if found.n_empty else ""
        yield f"{tried}{empty}{'; stopped by the limit' if found.is_stopped else ''}"
        if goal.n_choices > MOST_CHOICES:
            yield f"a population found which of {goal.n_choices:,} combinations to search for"
        yield from how_slopes_are_found(goal) if goal.ranges else ()
        if self.removed:
            yield f"of an earlier search, removed as it wrote them: {enumerated(self.removed)}"

    @property
    def _tables(self) -> GoalTables:
        return GoalTables(self.given.goal, not self.searched.best.are_finished.all())

    def save(self, folder: str | Path) -> None:
        """Write the designs, the trace and a spec for each design into a folder.

        They are `best.parquet`, `trace.parquet` and `design_1.yaml` and so on; specs of an earlier
        search go. Raises OutputError, also for a spec that was edited, and UsageError for files
        that the designs come from.
        """
        from dpgcli.files.output import sole_use

        path = path_of("output", folder)
        with sole_use(path):
            self._write(path)

    def _write(self, folder: Path) -> tuple[str, ...]:
        from dpgcli.files.goal_output import BEST, TRACE, write_designs

        trace = self._tables.trace(self.searched.trace)
        tables = (
            (BEST, self.columns, self.rows),
            (TRACE, self._tables.trace_columns, trace),
        )
        return write_designs(folder, self.given, tables, self.specs, scene_of(self.specs[0]))


def inverse_design(
    goal: GoalInput,
    output: str | Path | None = None,
    *,
    settings: Settings = (),
    seed: int = 1,
    evaluations: int | None = None,
    budget: float | None = None,
    jobs: int | None = 1,
    executor: str = "processes",
    scheduler: str | None = None,
    wait: float | None = None,
    restart: bool = False,
    strict: bool = False,
) -> InverseDesignResult:
    """Search for designs whose states meet the targets of a goal: its file, or its data.

    In data the `base` may be a spec's data, too; `settings` change it. The search descends from
    random starts, 32 for each combination of listed values, by `seed`. With `evaluations`, a number
    of designs, or a `budget` in seconds it ends there: earlier, or after further starts.
    Tables and specs go into the folder `output`, if there is one, where another call goes on with
    a search that was interrupted, unless it is to `restart`. `jobs` processes share the work; they
    import the program that starts them: put its work under `if __name__ == "__main__"`.
    `executor`, `scheduler` and `wait` are those of `sweep`.
    Raises SpecError for a wrong goal, UsageError for wrong choices, and where it is `strict` for a
    goal about what no design of the base should be chosen by, OutputError, WorkplaceError, and
    NothingSelectedError where no start has certified states of the patterns.

    >>> lattice = {"segment_length_mm": 13.5, "segment_height_mm": 10.75, "stroke_mm": 3.5,
    ...            "bistable_stiffness_N_per_mm": 12.84, "force_linearity": 0.043,
    ...            "hinge_stiffness_N_mm_per_rad": 24.2}
    >>> finger = {"units": 2, "linear_stiffness_N_per_mm": 1e4, "lattice": lattice}
    >>> target = {"pattern": "11", "quantity": "tip_y_mm", "value": -8.0, "tolerance_mm": 0.1}
    >>> goal = {"base": {"finger": finger}, "targets": [target],
    ...         "vary": {"finger.lattice.stroke_mm": {"from": 2.5, "to": 4.5}}}
    >>> found = inverse_design(goal)
    >>> found.table["stroke_mm"].round(4).tolist(), found.is_met
    ([3.5164], True)
    """
    from dpgcli.api.place import Place

    ends = Ends(whole("seed", seed), whole("evaluations", evaluations), number("budget", budget))
    check_flags(strict=strict, restart=restart)
    place = Place(executor, jobs, scheduler, wait)
    given = goal_input(goal, settings)
    path = None if output is None else path_of("output", output)
    return found_for(given, path, ends, place, restart=restart, strict=strict)


def _doubts(tables: GoalTables, scene: Scene) -> list[str]:
    """Why no design should be chosen by what a goal asks for, in a line for each reason."""
    known = {trust.output: trust for trust in scene.trusts}
    asked = tables.quantities.values()
    trusts = {
        column.name: [known[output] for output in column.outputs if output in known]
        for column in (*asked, *tables.map_columns)
    }
    return doubts_about(trusts)


class Ends(NamedTuple):
    """The seed of a search, and its limits: how many designs, how many seconds."""

    seed: int = 1
    evaluations: int | None = None
    budget: float | None = None

    def limits(self) -> Limits:
        """The limits; raises UsageError for what is none."""
        if self.seed is None or self.seed < 0:
            raise UsageError(Field("seed"), f" {self.seed}: expected a whole number from 0 on")
        if self.evaluations is not None and self.evaluations < 1:
            raise UsageError(
                Field("evaluations"), f" {self.evaluations}: expected 1 design or more"
            )
        if self.budget is not None and not 0.0 < self.budget < float("inf"):
            raise UsageError(Field("budget"), f" {self.budget:g}: expected a time > 0 s")
        return Limits(self.evaluations, self.budget)


def found_for(
    given: GoalFile,
    output: Path | None,
    ends: Ends,
    place: "Place",
    *,
    restart: bool = False,
    strict: bool = False,
    say: "Say" = lambda line: None,
) -> InverseDesignResult:
    """The same, of a goal that was read before; `say` hears of workers that are waited for."""
    limits = ends.limits()
    if strict and (doubts := _doubts(GoalTables(given.goal), scene_of(given.base))):
        lines = (part for doubt in doubts for part in ("\n", doubt))
        raise UsageError(Field("strict"), " allows no goal about what is doubted:", *lines)
    keep_freed_memory()
    if output is None and place.is_here:
        return _result(given, search(given.goal, ends.seed, limits))
    from dpgcli.files.goal_output import check_folder
    from dpgcli.files.output import sole_use
    from dpgcli.studies.search import SearchStudy, parts_folder

    with ExitStack() as held:
        if output is not None:
            held.enter_context(sole_use(output))
            check_folder(output, given)
        # what is found until time is up would be another thing the next time
        folder = held.enter_context(parts_folder(output if limits.seconds is None else None))
        workplace = held.enter_context(place.workplace(say))
        study = SearchStudy(given, ends.seed, limits, workplace, folder)
        held.enter_context(study.store.dropped_if_empty())
        study.begin(restart=restart)
        searched = search(given.goal, ends.seed, limits, study.run)
        try:
            found = _result(given, searched)
        except NothingSelectedError:  # with which nobody goes on
            study.store.drop()
            raise
        if output is not None:
            found = _written(found, output)
        study.store.drop()
    return found


def _written(found: InverseDesignResult, output: Path) -> InverseDesignResult:
    """What was found, in its folder; beside it, where the search is done and that takes it no more.

    Raises what is in the way, and says where the designs are.
    """
    from dpgcli.files.goal_output import folder_beside

    try:
        return replace(found, removed=found._write(output))
    except (OutputError, UsageError) as error:
        try:
            beside = folder_beside(output)
            found._write(beside)
        except (OSError, OutputError):  # such as a disk that is full
            raise error from None
        raise type(error)(error.message, f"; what was found is in {beside}") from error


def _result(given: GoalFile, searched: Searched) -> InverseDesignResult:
    """The designs that were found, each found anew from its spec."""
    best = searched.best
    if not len(best):
        patterns = ", ".join(dict.fromkeys(t.pattern for t in given.goal.of_states))
        n, of = counted(searched.n_starts, "start"), f" of {patterns}" if patterns else ""
        if names := _not_of_all_states(given.goal):
            of += f" that have {enumerated(names)}"
        why = reason_against(given.goal)
        because = f": {why}" if why else ""
        raise NothingSelectedError(f"none of {n} is a finger with certified states{of}{because}")
    values = given.goal.values(best.choice, best.points)
    designs = [
        {key: _plain(key, column[k]) for key, column in values.items()} for k in range(len(best))
    ]
    specs = tuple(design_spec(given.base_document, own) for own in designs)
    found = tuple(reached(given.goal, spec, best, k) for k, spec in enumerate(specs))
    return InverseDesignResult(given, searched, specs, found)


def _not_of_all_states(goal: Goal) -> list[str]:
    """Quantities of targets that certified states may have none of: with a body, under pressure."""
    some = body_columns(goal.base).keys() | pressed_columns(goal.base).keys()
    return [*dict.fromkeys(t.quantity for t in goal.of_states if t.quantity in some)]


def _plain(key: str, value: Any) -> float | int:
    """A value as a spec has it: numbers of units are whole."""
    return int(value) if key == UNITS else float(value)
