"""`pick`: choose among designs, or states, that exist."""

import json
from collections import Counter
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from dpgcli.api.arguments import as_texts, check_flags, path_of, table_path, whole
from dpgcli.api.check import DesignsInput
from dpgcli.api.designs import table_of, tables_beside
from dpgcli.api.tables import Table, TableResult
from dpgcli.arrays import Columns, Flags
from dpgcli.errors import Field, NothingSelectedError, UsageError
from dpgcli.files.design_spec import SWEEP, write_spec
from dpgcli.files.output import Mark, check_outputs
from dpgcli.files.record_batches import record_batch, schema
from dpgcli.files.row_source import DesignRow, RowSource, opened_rows
from dpgcli.files.scene_file import checked
from dpgcli.files.table_writer import write_table
from dpgcli.files.trust import with_bases
from dpgcli.records import dataclass
from dpgcli.states.columns import Column
from dpgcli.sweeps.choice import Question, check_undoubted, question, selected, warnings_of
from dpgcli.sweeps.gate import counts_of
from dpgcli.sweeps.metrics import METRICS
from dpgcli.text import counted, printable

KEPT = ("dpg.schema_version", "dpg.law", "dpg.versions", "dpg.base", "dpg.trust", "dpg.warnings")
PICK = "dpg.pick"
ALL, DEFAULT = "all", "default"
EXCLUDED = "it does not meet the sweep's constraints"


@dataclass(frozen=True)
class PickResult(TableResult):
    """The rows that were chosen, in their order; `lines` say what became of the others.

    `warnings` name the columns that nothing should be chosen by, as far as the table says it;
    `first` is the design of the first row. `counts` say where searches failed, so that columns are
    only bounds: files have them, too.
    """

    columns: tuple[Column, ...]
    rows: Columns
    counts: Columns
    lines: tuple[str, ...]
    warnings: tuple[str, ...]
    metadata: dict[str, str]
    sources: tuple[Path, ...]
    first: DesignRow

    @property
    def table(self) -> Table:
        """A row for each that was chosen."""
        return Table.of(self.columns, self.rows)

    def save(self, path: str | Path) -> None:
        """Write the rows to a Parquet file.

        Raises OutputError, and UsageError for a file that they come from or a name of another
        format.
        """
        table = table_path(path)
        check_outputs(self.sources, (table, Mark.TABLE))
        columns = (*self.columns, *(m for m in METRICS if m.name in self.counts))
        described, rows = with_bases(schema(columns), self.metadata), self.rows | self.counts
        write_table(table, described, [record_batch(columns, rows)], self.metadata)

    def save_spec(self, path: str | Path) -> None:
        """Write the spec of the first row's design, complete in one file.

        Raises OutputError, SpecError for a design that cannot be, and UsageError where the table
        does not say what its designs are made from.
        """
        spec = path_of("path", path)
        check_outputs(self.sources, (spec, Mark.SPEC))
        write_spec(spec, checked(self.first.document), str(self.first))


def pick(
    designs: DesignsInput,
    where: str | Sequence[str] = (),
    *,
    minimize: str | Sequence[str] = (),
    maximize: str | Sequence[str] = (),
    top: int | None = None,
    design: int | None = None,
    states: bool = False,
    columns: str | Sequence[str] = DEFAULT,
    strict: bool = False,
) -> PickResult:
    """Choose among the designs of a sweep: those that meet conditions, the best ones first.

    `designs` is the folder of a sweep, a table of one, or the content of a table; with `states`
    its states are chosen among. Two objectives or more give the Pareto front. `design` is one by
    its number; `columns` are those of the rows, by name, or `default`, `all`.
    Raises UsageError for what is no such table or question, and where it is `strict` for a choice
    by what is doubted; NothingSelectedError, which says why, where nothing is left.

    >>> designs = {"design": [0, 1, 2], "height_mm": [5.5, 6.5, 7.5], "calibration": ["given"] * 3,
    ...            "status": ["stable"] * 3, "reason": [""] * 3, "n_stable": [8, 8, 8]}
    >>> pick(designs, "height_mm > 6", minimize="height_mm", top=1).table["design"].tolist()
    [1]
    """
    check_flags(states=states, strict=strict)
    top, design = whole("top", top), whole("design", design)
    conditions = [*as_texts("where", where), *([] if design is None else [f"design == {design}"])]
    objectives = as_texts("minimize", minimize), as_texts("maximize", maximize)
    names = columns.split(",") if isinstance(columns, str) else as_texts("columns", columns)
    source = table_of(designs, has_states=states)
    with opened_rows(source, has_states=states) as rows:
        asked = question(conditions, *objectives, top, rows.numbers)
        shown = _shown(rows, asked, [name.strip() for name in names if name.strip()])
        why = () if design is None else _why_not(rows, design)
        return _picked(rows, asked, shown, tables_beside(source), why, strict=strict)


def _why_not(source: RowSource, design: int) -> tuple[str, ...]:
    """Why a design is not chosen among, in words, if it is not; states say nothing of that.

    Raises UsageError for one that is not there.
    """
    numbers = source.columns(["design"])["design"]
    places = np.flatnonzero(numbers == design)
    if not len(places):
        has = f"{numbers.min()} to {numbers.max()}" if len(numbers) else "none"
        raise UsageError(Field("design"), f" {design}: {source.name} has {has}")
    if source.has_states:
        return ()
    row = source.rows(places[:1], ("status", "reason", "n_stable"))
    status, reason, n_stable = (row[name][0].item() for name in row)
    if n_stable > 0 and status != "excluded":
        return ()
    words = EXCLUDED if status == "excluded" else reason or "no stable state"
    return (f"design {design} is {status}: {words}",)


def _shown(source: RowSource, asked: Question, names: Sequence[str]) -> list[str]:
    """The columns that are asked for: by name, `all`, or those that tell rows apart and were asked.

    Raises UsageError for others, with the nearest name.
    """
    known = source.readable
    first = [name for name in ("design", *source.swept, "pattern", "n_stable") if name in known]
    groups = {ALL: known, DEFAULT: (*first, *asked.names)}
    found = [column for name in names for column in groups.get(name, (name,))]
    for name in found:
        if name not in known:
            nearest = get_close_matches(name, [*known, *groups], n=1, cutoff=0.0)[0]
            raise UsageError(Field("columns"), f" {name}: no such column; the nearest is {nearest}")
    if not found:
        raise UsageError(Field("columns"), ": expected one column or more")
    return [*dict.fromkeys(found)]


def _picked(
    source: RowSource,
    asked: Question,
    shown: Sequence[str],
    files: tuple[Path, ...],
    why: tuple[str, ...],
    *,
    strict: bool,
) -> PickResult:
    status = "status" if source.has_states else "n_stable"
    extra = counts_of(asked.names, source.numbers)
    columns = source.columns([*dict.fromkeys((*asked.names, "status", status, *extra))])
    is_usable, first_line = _usable(source, columns)
    found = selected(columns, is_usable, asked)
    lines = (first_line, *found.lines(source.what))
    if not len(found.places):
        raise NothingSelectedError("\n".join(("nothing selected", *why, *lines)))
    warnings = warnings_of(asked, columns, source.trusts)
    if strict:
        check_undoubted(source.trusts, warnings)
    rows = source.rows(found.places, shown)
    hidden = [name for name in counts_of(shown, source.numbers) if name not in shown]
    counts = source.rows(found.places, hidden) if hidden else {}
    metadata = _metadata(source, asked, shown)
    design = source.design(int(found.places[0]))
    return PickResult(
        source.described(rows), rows, counts, lines, warnings, metadata, files, design
    )


def _usable(source: RowSource, columns: Columns) -> tuple[Flags, str]:
    """Which rows may be chosen, those of stable states, and how many there are, in words."""
    status = columns["status"]
    if source.has_states:
        is_usable = np.asarray(status == "stable", bool)
        left, with_what = status, "stable"
    else:
        is_usable = np.asarray((columns["n_stable"] > 0) & (status != "excluded"), bool)
        left, with_what = status, "with stable states"
    others = Counter(left[~is_usable].tolist())
    named = ((printable(name) or "without a status", n) for name, n in sorted(others.items()))
    rest = "".join(f", {n:,} {name}" for name, n in named)
    return is_usable, f"{counted(len(status), source.what)}: {is_usable.sum():,} {with_what}{rest}"


def _metadata(source: RowSource, asked: Question, shown: Sequence[str]) -> dict[str, str]:
    """What the table says that holds of chosen rows too, and how they were chosen.

    The base is kept where all of a design's values are.
    """
    is_whole = {"design", *source.swept} <= {*shown}
    kept = (*KEPT, *((SWEEP,) if is_whole else ()))
    said = {name: text for name, text in source.metadata.items() if name in kept}
    return {**said, PICK: json.dumps(asked.record)}
