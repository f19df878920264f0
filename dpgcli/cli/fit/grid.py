"""`dpg fit grid`: quantities over geometries, as scaling laws or interpolated."""

from collections.abc import Container, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dpgcli.calibration.choices import Method
from dpgcli.cli.fit.common import (
    GeometrySpec,
    GeometryValues,
    Output,
    Printed,
    check_files,
    geometry_from,
    known,
    print_rows,
    tell,
    write,
)
from dpgcli.cli.options import Quiet
from dpgcli.cli.printing import Format
from dpgcli.states.columns import Column, Group, Kind

if TYPE_CHECKING:
    from dpgcli.calibration.grid import Law
    from dpgcli.files.measured import Table


def grid(
    table: Annotated[
        Path, typer.Argument(metavar="TABLE", help="CSV: keys of the geometry, and quantities")
    ],
    output: Output = None,
    method: Annotated[
        Method, typer.Option("--method", help="Products of powers, or an interpolation")
    ] = Method.SCALING,
    geometry: GeometryValues = None,
    spec: GeometrySpec = None,
    printed_as: Printed = Format.TABLE,
    quiet: Quiet = False,
) -> None:
    """Fit quantities over geometries, with the error at points that are left out."""
    from dpgcli.calibration.grid import Law, Points
    from dpgcli.files.calibration import DataFile
    from dpgcli.files.calibration.results import grid_of
    from dpgcli.files.measured import read_table

    check_files((table, spec), output, None)
    read = read_table(table)
    _check_apart(geometry or (), (*read.over, *read.constant))
    shared = known(geometry_from(geometry, spec))
    law = Law(method, Points(read.over, read.geometry, read.quantities))
    for key in read.quantities:
        law.at(key, law.points.reference[None])  # a spec will ask for no less
    columns, rows = _rows(law)
    warnings = list(_warnings(law, read))
    elsewhere = {key: value for key, value in shared.items() if key not in read.over}
    source = DataFile(file=table.name, sha256=read.sha256, rows=len(read.geometry))
    content = {
        "method": f"{law.method} over {', '.join(read.over)}",
        "geometry": {**elsewhere, **read.constant} or None,
        "grid": grid_of(law),
        "warnings": warnings,
        "sources": [source],
    }
    write(output, content)
    print_rows(columns, rows, printed_as)
    if not quiet:
        tell(_summary(law, read), warnings, output)


def _check_apart(geometry: Iterable[str], columns: Container[str]) -> None:
    """Options that speak of what the table has itself."""
    from dpgcli.errors import UsageError

    for text in geometry:
        key = text.partition("=")[0].strip()
        if key in columns:
            raise UsageError(f"--geometry {text}: the table has a column {key}")


def _rows(law: "Law") -> tuple[tuple[Column, ...], dict[str, Any]]:
    """A row for each quantity: its law if it has one, and how well others predict a point."""
    import numpy as np

    quantities = list(law.points.quantities)
    left_out = np.array([law.leave_one_out(key) for key in quantities]).reshape(-1, 2).T
    columns = [Column("quantity", "", "what is known at the points", Group.STATES, Kind.TEXT)]
    rows: dict[str, Any] = {"quantity": np.array(quantities)}
    if law.method is Method.SCALING:
        fits = [law.scaling(key) for key in quantities]
        rows["at_reference"] = np.exp([fit.values[0] for fit in fits])
        rows["standard_error_percent"] = 100.0 * np.array([f.standard_errors[0] for f in fits])
        for place, key in enumerate(law.points.over, start=1):
            rows[f"exponent_{key}"] = np.array([fit.values[place] for fit in fits])
            rows[f"error_{key}"] = np.array([fit.standard_errors[place] for fit in fits])
    rows["left_out_largest_percent"], rows["left_out_rms_percent"] = 100.0 * left_out
    columns += [
        Column(name, "%" if name.endswith("percent") else "", "", Group.STATES)
        for name in list(rows)[1:]
    ]
    return tuple(columns), rows


def _summary(law: "Law", table: "Table") -> list[str]:
    points = law.points
    reference = ", ".join(
        f"{key} {value:g}" for key, value in zip(points.over, points.reference, strict=True)
    )
    text = f"{len(points.geometry)} points over {', '.join(points.over)}"
    same = ", ".join(f"{key} {value:g}" for key, value in table.constant.items())
    text += f"; all at {same}" if same else ""
    return [text + (f"; reference {reference}" if law.method is Method.SCALING else "")]


def _warnings(law: "Law", table: "Table") -> list[str]:
    from difflib import get_close_matches

    import numpy as np

    from dpgcli.files.calibration import Values

    said = list(table.doubts)
    if table.ignored:
        said.append(f"columns not used, since they hold text: {', '.join(table.ignored)}")
    taken = [key for key in Values.model_fields if key != "linear_stiffness_N_per_mm"]
    unused = {key: get_close_matches(key, taken, n=1) for key in table.quantities}
    names = [
        key + (f" (did you mean {close[0]}?)" if close else "")
        for key, close in unused.items()
        if key not in taken
    ]
    if names:
        said.append(f"nothing that specs take from a grid, fitted all the same: {', '.join(names)}")
    if any(np.isnan(law.leave_one_out(key)[0]) for key in table.quantities):
        said.append(
            "too few points to leave one out: nothing is known about the error between them"
        )
    return said
