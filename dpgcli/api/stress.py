"""`stress`: stiff and extreme cases beside extended precision."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from dpgcli.api.arguments import as_texts, check_callable, check_installed, table_path
from dpgcli.api.inputs import SceneInput, Settings, SpecInput, scene_input, setting_texts
from dpgcli.api.tables import Table, TableResult
from dpgcli.errors import Field, NothingSelectedError, UsageError
from dpgcli.files.study_tables import write_stress
from dpgcli.hard_cases import verdicts
from dpgcli.hard_cases.cases import Case, all_cases, check_families
from dpgcli.hard_cases.outcomes import Outcome
from dpgcli.hard_cases.table import STRESS_COLUMNS, FamilySummary, rows, summarized
from dpgcli.records import dataclass


@dataclass(frozen=True)
class StressResult(TableResult):
    """Outcomes of hard cases, each the answer of the solver and what it is worth."""

    outcomes: tuple[Outcome, ...]
    spec_json: str | None = None

    @property
    def failures(self) -> tuple[Outcome, ...]:
        """Outcomes that should not be."""
        return tuple(outcome for outcome in self.outcomes if outcome.is_failure)

    @property
    def families(self) -> tuple[FamilySummary, ...]:
        """Counts and worst values by family and formulation."""
        return tuple(summarized(self.outcomes))

    @property
    def table(self) -> Table:
        """A row for each case, the columns of `hard_cases.table.STRESS_COLUMNS`."""
        return Table.of(STRESS_COLUMNS, rows(self.outcomes))

    def save(self, path: str | Path) -> None:
        """Write every case to a Parquet file."""
        write_stress(table_path(path), self.outcomes, self.spec_json)


@dataclass(frozen=True)
class HardCases:
    """Cases to come, around the finger of a spec, if there is one, and the built-in one."""

    given: SceneInput | None
    cases: tuple[Case, ...]

    def outcomes(self) -> Iterator[Outcome]:
        """Solve and judge case by case."""
        return verdicts.stress(self.cases)

    def result(self, outcomes: Sequence[Outcome]) -> StressResult:
        """The result that outcomes make."""
        spec = None if self.given is None or self.given.spec is None else self.given.json
        return StressResult(tuple(outcomes), spec)


def stress(
    spec: SpecInput | None = None,
    *,
    only: str | Sequence[str] = (),
    settings: Settings = (),
    watch: Callable[[Outcome], None] = lambda outcome: None,
) -> StressResult:
    """Compare stiff and extreme cases with extended precision; needs mpmath.

    Without a spec the built-in cases alone; `only` names families. `watch` sees each outcome.
    Raises SpecError for a wrong spec, UsageError for unknown families.

    >>> result = stress(only=["scale"])
    >>> len(result.failures), set(result.table["verdict"].tolist())
    (0, {'right'})
    """
    check_callable(watch=watch)
    cases = hard_cases(spec, as_texts("only", only), settings)
    found = []
    for outcome in cases.outcomes():
        watch(outcome)
        found.append(outcome)
    return cases.result(found)


def hard_cases(
    spec: SpecInput | None = None, only: Sequence[str] = (), settings: Settings = ()
) -> HardCases:
    """The cases of `stress`, before any work."""
    check_installed("dpg stress", "mpmath")
    if spec is None and setting_texts(settings):
        raise UsageError(Field("settings"), " changes a spec: give one")
    given = None if spec is None else scene_input(spec, settings)
    check_families(only)
    cases = all_cases(None if given is None else given.scene.finger, only)
    if not cases:
        what = f" {', '.join(only)}: there are none without a spec"
        raise NothingSelectedError(Field("only"), what)
    return HardCases(given, tuple(cases))
