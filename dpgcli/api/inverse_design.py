"""`inverse_design`: designs whose states are as a goal asks for."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from dpgcli.api.given import GoalInput, goal_input
from dpgcli.api.inputs import Settings, check_flags, check_numbers, check_whole, path_of
from dpgcli.api.reached import reached
from dpgcli.api.tables import Table
from dpgcli.arrays import Columns, keep_freed_memory
from dpgcli.design.dimensions import UNITS
from dpgcli.design.outputs import doubts_about
from dpgcli.design.scene import Scene
from dpgcli.errors import Field, NothingSelectedError, UsageError
from dpgcli.files.design_spec import design_spec
from dpgcli.files.goal_file import GoalFile
from dpgcli.files.scene_file import Spec, scene_of
from dpgcli.search.search import Limits, Searched, search
from dpgcli.search.table import GoalTables, Reached
from dpgcli.search.targets import reason_against
from dpgcli.search.unmet import how_slopes_are_found
from dpgcli.states.columns import Column
from dpgcli.text import counted, enumerated

MOST_NAMED = 3  # designs in a line


@dataclass(frozen=True)
class InverseDesignResult:
    """The best designs, each certified anew from its spec, and how they were found.

    `specs` are those of the designs, the best first, and `reached` what their states come to.
    """

    given: GoalFile
    searched: Searched
    specs: tuple[Spec, ...]
    reached: tuple[Reached, ...]

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
        yield from self._tables.standing(found.best, 0).lines(is_stopped=found.is_stopped)
        tried = (
            f"{counted(found.n_starts, 'start')}, {counted(found.n_evaluated, 'design')} evaluated"
        )
        empty = f", {found.n_empty:,} of them without such states" if found.n_empty else ""
        yield f"{tried}{empty}{'; stopped by the limit' if found.is_stopped else ''}"
        yield from how_slopes_are_found(goal) if goal.ranges else ()

    @property
    def _tables(self) -> GoalTables:
        return GoalTables(self.given.goal)

    def save(self, folder: str | Path) -> None:
        """Write the designs, the trace and a spec for each design into a folder.

        They are `best.parquet`, `trace.parquet` and `design_1.yaml` and so on. Raises OutputError,
        and UsageError for files that the designs come from.
        """
        from dpgcli.files.goal_output import BEST, TRACE, write_designs

        path = path_of("output", folder)
        tables = (
            (BEST, self.columns, self.rows),
            (
                TRACE,
                self._tables.trace_columns,
                self._tables.trace(self.searched.trace),
            ),
        )
        write_designs(path, self.given, tables, self.specs, scene_of(self.specs[0]))


def inverse_design(
    goal: GoalInput,
    output: str | Path | None = None,
    *,
    settings: Settings = (),
    seed: int = 1,
    evaluations: int | None = None,
    budget: float | None = None,
    strict: bool = False,
) -> InverseDesignResult:
    """Search for designs whose states meet the targets of a goal: its file, or its data.

    In data the `base` may be a spec's data, too; `settings` change it. The search descends from
    random starts, 32 for each combination of listed values, by `seed`. With `evaluations`, a number
    of designs, or a `budget` in seconds it ends there: earlier, or after further starts.
    Tables and specs go into the folder `output`, if there is one.
    Raises SpecError for a wrong goal, UsageError for wrong choices, and where it is `strict` for a
    goal about what no design of the base should be chosen by, OutputError, and
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
    check_whole(seed=seed, evaluations=evaluations)
    check_numbers(budget=budget)
    from dpgcli.files.goal_output import check_folder

    check_flags(strict=strict)
    given = goal_input(goal, settings)
    if output is not None:
        check_folder(path_of("output", output), given)
    found = found_for(given, seed, evaluations, budget, strict=strict)
    if output is not None:
        found.save(output)
    return found


def _doubts(tables: GoalTables, scene: Scene) -> list[str]:
    """Why no design should be chosen by what a goal asks for, in a line for each reason."""
    known = {trust.output: trust for trust in scene.trusts}
    asked = tables.quantities.values()
    trusts = {
        column.name: [known[output] for output in column.outputs if output in known]
        for column in (*asked, *tables.map_columns)
    }
    return doubts_about(trusts)


def found_for(
    given: GoalFile,
    seed: int = 1,
    evaluations: int | None = None,
    budget: float | None = None,
    *,
    strict: bool = False,
) -> InverseDesignResult:
    """The same, of a goal that was read before."""
    if seed is None or seed < 0:
        raise UsageError(Field("seed"), f" {seed}: expected a whole number from 0 on")
    if evaluations is not None and evaluations < 1:
        raise UsageError(Field("evaluations"), f" {evaluations}: expected 1 design or more")
    if budget is not None and not 0.0 < budget < float("inf"):
        raise UsageError(Field("budget"), f" {budget:g}: expected a time > 0 s")
    if strict and (doubts := _doubts(GoalTables(given.goal), scene_of(given.base))):
        lines = (part for doubt in doubts for part in ("\n", doubt))
        raise UsageError(Field("strict"), " allows no goal about what is doubted:", *lines)
    keep_freed_memory()
    searched = search(given.goal, seed, Limits(evaluations, budget))
    best = searched.best
    if not len(best):
        patterns = ", ".join(dict.fromkeys(target.pattern for target in given.goal.targets))
        n, of = counted(searched.n_starts, "start"), f" of {patterns}" if patterns else ""
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


def _plain(key: str, value: Any) -> float | int:
    """A value as a spec has it: numbers of units are whole."""
    return int(value) if key == UNITS else float(value)
