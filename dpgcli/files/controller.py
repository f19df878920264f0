"""Pressures by time in a CSV file, for a controller; `dpg actuate` reads it as a history."""

import csv
from collections.abc import Sequence
from pathlib import Path

from dpgcli.design.lines import TIME
from dpgcli.design.pressure import History
from dpgcli.files.histories import LINE, PRESSURE, UNIT
from dpgcli.files.output import Mark, whole_file

HEAD = "# dpg routine: pressures of lines by time, straight from one row of a line to the next\n"


def write_controller(path: Path, lines: Sequence[str], history: History) -> None:
    """Write a row for each time and line: time_s, line, pressure_MPa."""
    assert history.time is not None, "controllers go by time"
    with (
        whole_file(path, Mark.CONTROLLER) as temporary,
        temporary.open("w", encoding="utf-8", newline="\n") as stream,
    ):
        stream.write(HEAD)
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([TIME, LINE, f"{PRESSURE}{UNIT}"])
        for time, row in zip(history.time.tolist(), history.pressure.tolist(), strict=True):
            writer.writerows(
                [f"{time:.10g}", line, f"{value:.10g}"]
                for line, value in zip(lines, row, strict=True)
            )
