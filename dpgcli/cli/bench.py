"""`dpg bench`: error against run time, on the user's own finger."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dpgcli.cli.options import (
    FirstStation,
    Quiet,
    Settings,
    SpecPath,
    TableFile,
    TargetError,
    TipOffset,
    check_plot,
    check_table_name,
    frame_of,
    target_in_mm,
)
from dpgcli.cli.printing import Format, print_grid, print_rows
from dpgcli.cli.progress import under_way
from dpgcli.cli.streams import put, say

if TYPE_CHECKING:
    from dpgcli.benchmark.bench import BenchRow

GROUPS = {
    "ladder": "Methods, with a batch of states as large as a sweep's",
    "one finger": "The same, for the states of this finger alone",
    "peer": "What one would do instead, state by state",
    "pressure": "The pressure at which the straight finger first snaps",
    "contact": "The states against the spec's body",
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
    "pressure": ("n_missing", "max_threshold_error", "seconds", "µs_per_state", "times_as_long"),
    "contact": ("certified", "n_missing", "max_tip_error_mm", "rms_tip_error_mm",
                "max_energy_error_mJ", "µs_per_state",
                "cpu_µs_per_state", "times_as_long"),
    "model": ("n_missing", "max_tip_error_mm", "rms_tip_error_mm"),
    "units": ("n_units", "n_states", "seconds", "µs_per_state", "peak_MiB"),
    "designs": ("n_designs", "n_states", "seconds", "µs_per_state", "peak_MiB"),
    "stiffness": ("stiffness_ratio", "n_missing", "max_tip_error_mm", "µs_per_state", "peak_MiB"),
    "kept": ("seconds", "µs_per_state", "peak_MiB", "tips_move_mm", "bound_mm"),
}  # fmt: skip


Repeats = Annotated[
    int, typer.Option("--repeats", min=1, max=1000, help="How often each method is timed")
]
Keep = Annotated[
    list[str] | None,
    typer.Option("--keep", metavar="WHAT", help="Put back what is left out; repeatable"),
]
Against = Annotated[
    Path | None,
    typer.Option("--against", metavar="FILE", help="CSV of known tips, for the model's own error"),
]
PrintedAs = Annotated[Format, typer.Option("--format", help="How to print rows")]
Plot = Annotated[
    Path | None,
    typer.Option("--plot", metavar="FILE", help="Draw error over time: a .svg or .png file"),
]
Record = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Write all rows and the machine to this file"),
]
Compare = Annotated[
    Path | None,
    typer.Option("--compare", metavar="FILE", help="Say what got slower since this --json file"),
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
    output: TableFile = None,
    plot: Plot = None,
    record: Record = None,
    compare: Compare = None,
    quiet: Quiet = False,
) -> None:
    """Measure error against run time, beside what else there is."""
    from dpgcli.api.arguments import check_installed
    from dpgcli.api.bench import bench
    from dpgcli.api.inputs import scene_input
    from dpgcli.files.output import Mark, check_outputs

    check_installed("dpg bench", "mpmath")
    if plot is not None:
        check_plot(plot)
    check_table_name(output)
    given = scene_input(spec, settings or ())
    sources = [path for path in (against, compare) if path is not None]
    outputs = ((output, Mark.TABLE), (record, Mark.FACTS), (plot, Mark.FIGURE))
    check_outputs([*sources, *given.files], *outputs)
    frame = frame_of(first_station, tip_offset)
    with under_way("bench", quiet=quiet) as say_that:
        found = bench(
            given,
            repeats=repeats,
            target_error=target_in_mm(target_error),
            keep=tuple(keep or ()),
            against=against,
            first_station=frame[0],
            tip_offset=frame[1],
            compare=compare,
            watch=lambda row: say_that(f"measured: {row['group']}: {row['method']}"),
        )
    command = ("dpg", *sys.argv[1:])
    if output is not None:
        found.save(output, command)
    if record is not None:
        found.record(record, command)
    if plot is not None:
        found.draw(plot)
    _print(printed_as, found.rows)
    for line in found.findings:
        _tell(printed_as, line)


def _tell(printed_as: Format, line: str) -> None:
    """A finding: with the tables for people, beside the data for programs."""
    if printed_as is Format.TABLE:
        put(line)
    else:
        say(line)


def _print(printed_as: Format, rows: "Sequence[BenchRow]") -> None:
    from dpgcli.benchmark.bench import COLUMNS, as_columns

    if printed_as is Format.TABLE:
        _print_tables(rows)
        return
    print_rows(COLUMNS, as_columns(rows), printed_as)


def _print_tables(rows: "Sequence[BenchRow]") -> None:
    from dpgcli.reports.precision import text_figure

    for group, title in GROUPS.items():
        own = [row for row in rows if row["group"] == group]
        if own:
            names = SHOWN.get(group, SHOWN["ladder"])
            put(f"{title}\n")
            print_grid(
                {"method": [row["method"] for row in own]}
                | {name: [_cell(row, name) for row in own] for name in names},
                left=("method",),
            )
            put("")
    put("\n".join(text_figure(rows)))


def _cell(row: "BenchRow", name: str) -> str:
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
    if name.endswith(("_mm", "_rad", "_mJ", "threshold_error")):
        return f"{value:.1e}"
    return f"{value:.3g}"
