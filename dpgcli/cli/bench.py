"""`dpg bench`: error against run time, on the user's own finger."""

import json
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dpgcli.cli.options import (
    FirstStation,
    Quiet,
    Settings,
    SpecPath,
    TargetError,
    TipOffset,
    check_installed,
    check_plot,
    check_table_name,
    frame_of,
    millimeters,
)
from dpgcli.cli.printing import Format, print_grid, printer_of
from dpgcli.cli.streams import say

if TYPE_CHECKING:
    from dpgcli.benchmark.bench import Row

GROUPS = {
    "ladder": "Ways to the states, in a batch as large as a sweep's",
    "one finger": "The same, for the states of this finger alone",
    "peer": "What one would do instead, state by state",
    "model": "The lattice against the data given",
    "units": "All 2^n states of longer fingers",
    "designs": "Many designs at once",
    "stiffness": "Softer and stiffer bars",
    "kept": "What the plan leaves out, put back",
}
SHOWN = {
    "ladder": ("certified", "n_missing", "max_tip_error_mm", "rms_tip_error_mm",
               "max_angle_error_rad", "max_energy_error_mJ", "µs_per_state", "spread",
               "cpu_µs_per_state"),
    "model": ("n_missing", "max_tip_error_mm", "rms_tip_error_mm"),
    "units": ("n_units", "n_states", "seconds", "µs_per_state", "peak_MiB"),
    "designs": ("n_designs", "n_states", "seconds", "µs_per_state", "peak_MiB"),
    "stiffness": ("stiffness_ratio", "n_missing", "max_tip_error_mm", "µs_per_state", "peak_MiB"),
    "kept": ("seconds", "µs_per_state", "peak_MiB", "tips_move_mm", "bound_mm"),
}  # fmt: skip
SLOWER = 2.0  # times its recorded ratio: more than the noise of a shared machine


Repeats = Annotated[int, typer.Option("--repeats", min=1, max=1000, help="Times each way is timed")]
Keep = Annotated[
    list[str] | None,
    typer.Option("--keep", metavar="WHAT", help="Put back what is left out; repeatable"),
]
Against = Annotated[
    Path | None, typer.Option("--against", help="CSV of known tips, for the model's own error")
]
PrintedAs = Annotated[Format, typer.Option("--format", help="How to print what was measured")]
Output = Annotated[
    Path | None, typer.Option("-o", "--output", help="Write all rows to this Parquet file")
]
Plot = Annotated[
    Path | None, typer.Option("--plot", help="Draw error over time: a .svg or .png file")
]
Record = Annotated[
    Path | None, typer.Option("--json", help="Write all rows and the machine to this file")
]
Compare = Annotated[
    Path | None, typer.Option("--compare", help="Say what got slower since this --json file")
]


def bench(
    spec: SpecPath,
    settings: Settings = None,
    repeats: Repeats = 5,
    target_error: TargetError = None,
    keep: Keep = None,
    against: Against = None,
    first_station: FirstStation = None,
    tip_offset: TipOffset = None,
    printed_as: PrintedAs = Format.TABLE,
    output: Output = None,
    plot: Plot = None,
    record: Record = None,
    compare: Compare = None,
    quiet: Quiet = False,
) -> None:
    """Measure error against run time, beside what else there is."""
    from dpgcli.benchmark.bench import Bench
    from dpgcli.files.known_states import states_of
    from dpgcli.files.output import Mark, check_outputs
    from dpgcli.files.scene_file import canonical_json, checked, read_scene, scene_of
    from dpgcli.files.table_writer import write_states
    from dpgcli.reports.precision import cheapest_way, draw_precision

    check_installed("dpg bench", "mpmath")
    if plot is not None:
        check_plot(plot)
    sources = [path for path in (spec, against, compare) if path is not None]
    outputs = ((output, Mark.TABLE), (record, Mark.FACTS), (plot, Mark.FIGURE))
    check_table_name(output)
    document = read_scene(spec, settings or ())
    check_outputs([*sources, *document.files], *outputs)
    content = checked(document)
    scene, said = scene_of(content), canonical_json(content)
    target = None if target_error is None else millimeters("--target-error", target_error)
    known = None if against is None else states_of(scene.finger, against)
    then = None if compare is None else _recorded(compare, said)
    study = Bench(
        scene,
        repeats,
        tuple(keep or ()),
        target,
        known,
        frame_of(first_station, tip_offset),
        partial(write_states, spec_json="{}"),
    )
    study.check()
    rows = list(_watched(study.rows(), quiet))
    _write(rows, said, output, record)
    if plot is not None:
        draw_precision(rows, str(spec), plot)
    _print(printed_as, rows)
    findings = [] if target is None else [cheapest_way(rows, target)]
    for line in findings + ([] if then is None else _changes(then, rows)):
        _tell(printed_as, line)


def _recorded(path: Path, said: str) -> "Sequence[Row]":
    """The rows of a record of the same finger."""
    from dpgcli.errors import UsageError
    from dpgcli.files.table_reader import read_record
    from dpgcli.studies.differences import differences

    facts = read_record(path)
    changed = differences({"spec": str(facts.get("spec"))}, {"spec": said})
    if changed:
        raise UsageError(f"--compare {path}: of another finger, differs in {', '.join(changed)}")
    rows: Sequence[Row] = facts["rows"]
    return rows


def _watched(rows: "Iterable[Row]", quiet: bool) -> "Iterable[Row]":
    """Name each row on a terminal as it is measured."""
    interactive = sys.stderr.isatty() and not quiet
    for row in rows:
        if interactive:
            print(f"\r{row['group']}: {row['way']}"[:70].ljust(71), end="\r", file=sys.stderr)
        yield row
    if interactive:
        print(" " * 71, end="\r", file=sys.stderr)


def _tell(printed_as: Format, line: str) -> None:
    """A finding: with the tables for people, beside the data for programs."""
    if printed_as is Format.TABLE:
        print(line)
    else:
        say(line)


def _print(printed_as: Format, rows: "Sequence[Row]") -> None:
    from dpgcli.benchmark.bench import COLUMNS, as_columns

    if printed_as is Format.TABLE:
        _print_tables(rows)
        return
    for _ in printer_of(printed_as)(COLUMNS, [as_columns(rows)]):
        pass


def _print_tables(rows: "Sequence[Row]") -> None:
    from dpgcli.reports.precision import text_figure

    for group, title in GROUPS.items():
        own = [row for row in rows if row["group"] == group]
        if own:
            names = SHOWN.get(group, SHOWN["ladder"])
            print(f"{title}\n")
            print_grid(
                {"way": [row["way"] for row in own]}
                | {name: [_cell(row, name) for row in own] for name in names},
                left=("way",),
            )
            print()
    print("\n".join(text_figure(rows)))


def _cell(row: "Row", name: str) -> str:
    if name == "µs_per_state":
        return f"{row['seconds_per_state'] * 1e6:.3g}"
    if name == "cpu_µs_per_state":
        return f"{row['cpu_seconds'] / row['n_states'] * 1e6:.3g}"
    if name == "spread":
        low, high = (row[f"seconds_{end}"] / row["seconds"] for end in ("min", "max"))
        return f"{low:.2f}-{high:.2f}"
    value = row["max_tip_error_mm" if name == "tips_move_mm" else name]
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}"
    if name.endswith(("_mm", "_rad", "_mJ")):
        return f"{value:.1e}"
    return f"{value:.3g}"


def _write(rows: "Sequence[Row]", said: str, output: Path | None, record: Path | None) -> None:
    from dpgcli.benchmark.bench import COLUMNS, as_columns
    from dpgcli.files.table_writer import record_batch, schema, write_run, write_table

    if output is not None:
        batch = record_batch(COLUMNS, as_columns(rows))
        metadata = {"dpg.bench": json.dumps(_machine()), "dpg.spec": said}
        write_table(output, schema(COLUMNS), [batch], metadata)
    if record is not None:
        plain = [{key: _plain(value) for key, value in row.items()} for row in rows]
        write_run(record, {**_machine(), "spec": said, "rows": plain})


def _plain(value: Any) -> Any:
    """As JSON can say it: null for what was not measured, and .inf as in a spec."""
    from dpgcli.files.scene_file import spelled

    if not isinstance(value, float):
        return value
    return None if value != value else spelled(value)


def _machine() -> dict[str, Any]:
    import os
    import platform

    import numpy as np

    return {
        "machine": platform.machine(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "command": ["dpg", *sys.argv[1:]],
    }


def _processor() -> str:
    """The processor's name, where the system tells it."""
    import platform

    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor()


def _which(row: "Row") -> str:
    """The row of a group that varies something."""
    ratio = f"k_L/k_b {row['stiffness_ratio']:.3g}"
    return f"{row['n_units']} units, {row['n_designs']:,} designs, {ratio}"


def _changes(then: "Sequence[Row]", now: "Sequence[Row]") -> list[str]:
    """What takes a larger multiple of the NumPy kernel's time than it took when recorded."""
    key = ("group", "way", "n_units", "n_designs", "stiffness_ratio")
    before = {tuple(row.get(name) for name in key): row.get("relative_time") for row in then}
    slower, n_compared = [], 0
    for row in now:
        old = before.get(tuple(_plain(row[name]) for name in key))
        if not old or not row["relative_time"] > 0.0:
            continue
        n_compared += 1
        ratio = row["relative_time"] / old
        if ratio > SLOWER:
            slower.append(f"{ratio:.2f} times: {row['group']}, {row['way']}, {_which(row)}")
    verdict = f"{n_compared} compared with the record, {len(slower)} slower by more than {SLOWER}"
    return [verdict, *slower]
