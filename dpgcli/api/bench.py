"""`bench`: error against run time, on the user's own finger."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from dpgcli.api.arguments import (
    as_texts,
    check_callable,
    check_installed,
    figure_path,
    files_of,
    number,
    path_of,
    table_path,
    whole,
)
from dpgcli.api.data import frame_of
from dpgcli.api.inputs import Place, Settings, SpecInput, scene_input
from dpgcli.api.tables import Table, TableResult
from dpgcli.benchmark.bench import COLUMNS, Bench, BenchRow, as_columns
from dpgcli.calibration.known import Frame
from dpgcli.errors import Field, UsageError
from dpgcli.files.csv_file import Tabular
from dpgcli.files.output import Mark, check_outputs
from dpgcli.files.plausible_states import states_of
from dpgcli.files.prediction import write_states
from dpgcli.files.study_tables import write_bench, write_record
from dpgcli.files.table_reader import read_record
from dpgcli.records import dataclass
from dpgcli.reports.precision import changes, cheapest_way, draw_precision
from dpgcli.sweeps.differences import differences

MOST_REPEATS = 1000


@dataclass(frozen=True)
class BenchResult(TableResult):
    """Measurements, a row for each method and size; `recorded` are rows of an earlier record.

    `files` are those that were read.
    """

    name: str
    spec_json: str
    rows: tuple[BenchRow, ...]
    target_error: float | None = None
    recorded: tuple[BenchRow, ...] | None = None
    files: tuple[Path, ...] = ()

    @property
    def table(self) -> Table:
        """All rows, the columns of `benchmark.bench.COLUMNS`."""
        return Table.of(COLUMNS, as_columns(self.rows))

    @property
    def findings(self) -> tuple[str, ...]:
        """The cheapest method for the target error, and what got slower since the record."""
        cheapest = (
            () if self.target_error is None else (cheapest_way(self.rows, self.target_error),)
        )
        return (*cheapest, *(() if self.recorded is None else changes(self.recorded, self.rows)))

    def save(self, path: str | Path, command: Sequence[str] = ()) -> None:
        """Write all rows to a Parquet file, with the `command` that asked for them."""
        table = table_path(path)
        check_outputs(self.files, (table, Mark.TABLE))
        write_bench(table, self.rows, self.spec_json, command)

    def record(self, path: str | Path, command: Sequence[str] = ()) -> None:
        """Write all rows and the machine to a JSON file, for `compare` in a later call.

        Raises UsageError for the record that was compared with.
        """
        record = path_of("path", path)
        check_outputs(self.files, (record, Mark.FACTS))
        write_record(record, self.rows, self.spec_json, command)

    def draw(self, path: str | Path) -> None:
        """Draw error over time to a .svg or .png file."""
        draw_precision(self.rows, self.name, figure_path(path))


def bench(
    spec: SpecInput,
    *,
    settings: Settings = (),
    repeats: int = 5,
    target_error: float | None = None,
    keep: str | Sequence[str] = (),
    against: Tabular | None = None,
    first_station: Place = None,
    tip_offset: Place = None,
    compare: str | Path | None = None,
    watch: Callable[[BenchRow], None] = lambda row: None,
) -> BenchResult:
    """Measure error against run time, beside what else there is; needs mpmath.

    `target_error` in mm; `keep` names what the plan leaves out and is put back; `against` are
    known tips, for the model's own error; `compare` names a record of the same finger. `watch`
    sees each row as it is measured. Takes from seconds to minutes.
    Raises SpecError for a wrong spec or data, UsageError for wrong choices.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> bench(uniform_finger(2, **STUDY), keep=["hinges"])
    Traceback (most recent call last):
        ...
    dpgcli.errors.UsageError: keep hinges: this scene leaves out bars, every-unit, every-column
    """
    check_installed("dpg bench", "mpmath")
    repeats = whole("repeats", repeats)
    check_callable(watch=watch)
    if repeats is None or not 1 <= repeats <= MOST_REPEATS:
        raise UsageError(Field("repeats"), f" {repeats}: expected from 1 to {MOST_REPEATS:,}")
    target_error = number("target_error", target_error)
    given = scene_input(spec, settings)
    known = None if against is None else states_of(given.scene.finger, against)
    then = None if compare is None else _recorded(path_of("compare", compare), given.json)
    frame = Frame() if known is None else frame_of(given, known, first_station, tip_offset)[0]
    write = partial(write_states, spec_json="{}")
    study = Bench(given.scene, repeats, as_texts("keep", keep), target_error, known, frame, write)
    study.check()
    rows = []
    for row in study.rows():
        watch(row)
        rows.append(row)
    files = (*given.files, *files_of(against, compare))
    return BenchResult(given.name, given.json, tuple(rows), target_error, then, files)


def _recorded(path: Path, spec_json: str) -> tuple[BenchRow, ...]:
    """The rows of a record of the same finger."""
    facts = read_record(path)
    changed = differences({"spec": str(facts.get("spec"))}, {"spec": spec_json})
    if changed:
        what = f" {path}: of another finger, differs in {', '.join(changed)}"
        raise UsageError(Field("compare"), what)
    return tuple(facts["rows"])
