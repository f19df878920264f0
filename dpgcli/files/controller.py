"""Pressures by time in a CSV file, for a controller; `dpg actuate` reads it as a history."""

import csv
from collections.abc import Sequence
from pathlib import Path

from dpgcli.design.lines import TIME
from dpgcli.design.pressure import History
from dpgcli.files.output import Mark, whole_file

HEAD = "# dpg routine: pressures of lines by time, straight from one row to the next\n"


def write_controller(path: Path, lines: Sequence[str], history: History) -> None:
    """Write a row for each time: time_s, and the pressure of each line, such as A_MPa."""
    assert history.time is not None, "controllers go by time"
    with (
        whole_file(path, Mark.CONTROLLER) as temporary,
        temporary.open("w", encoding="utf-8", newline="\n") as stream,
    ):
        stream.write(HEAD)
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([TIME, *(f"{line}_MPa" for line in lines)])
        for time, row in zip(history.time.tolist(), history.pressure.tolist(), strict=True):
            writer.writerow([f"{time:g}", *(f"{value:.10g}" for value in row)])
