"""Options, tables and files that the fits share."""

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dpgcli.calibration.choices import Loss
from dpgcli.cli.options import check_plot
from dpgcli.cli.printing import Format, printer_of
from dpgcli.cli.streams import say
from dpgcli.states.columns import Column, Group, Kind

if TYPE_CHECKING:
    from dpgcli.calibration.fits import Fit
    from dpgcli.files.calibration import Calibration
    from dpgcli.files.sections import Geometry

Output = Annotated[
    Path | None, typer.Option("-o", "--output", help="Write the calibration to this YAML file")
]
Printed = Annotated[Format, typer.Option("--format", help="How to print the values")]
Plot = Annotated[
    Path | None, typer.Option("--plot", help="Draw data, fit and residuals: a .svg or .png file")
]
Bootstrap = Annotated[
    int,
    typer.Option(
        "--bootstrap", metavar="N", min=0, max=100_000, help="95 % intervals from N resampled fits"
    ),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the resampling")]
LossOption = Annotated[Loss, typer.Option("--loss", help="How residuals count")]
LossScale = Annotated[
    float | None,
    typer.Option(
        "--loss-scale", help="Residual from which a robust loss counts less  [default: the data's]"
    ),
]
GeometryValues = Annotated[
    list[str] | None,
    typer.Option(
        "-g",
        "--geometry",
        metavar="KEY=VALUE",
        help="Where the values hold: a key of a spec's geometry; repeatable",
    ),
]
GeometrySpec = Annotated[
    Path | None,
    typer.Option("--spec", metavar="SPEC", help="Take the geometry from this spec's finger"),
]

NO_GEOMETRY = (
    "no geometry given (by --geometry or a spec): specs will treat the values as extrapolated"
)
VALUE_COLUMNS = (
    Column("key", "", "key of a spec's lattice section", Group.STATES, Kind.TEXT),
    Column("value", "", "the fitted or fixed value", Group.STATES),
    Column("standard_error", "", "its standard error", Group.STATES),
    Column("unit", "", "unit of both", Group.STATES, Kind.TEXT),
    Column("status", "", "free, fixed or at its bound", Group.STATES, Kind.TEXT),
)
INTERVAL_COLUMNS = (
    Column("lower", "", "lower end of the 95 % bootstrap interval", Group.STATES),
    Column("upper", "", "upper end of the 95 % bootstrap interval", Group.STATES),
)


def check_files(sources: Sequence[Path | None], output: Path | None, plot: Path | None) -> None:
    """Before any work: names that fit their content, and files that can be written."""
    from dpgcli.errors import UsageError
    from dpgcli.files.output import Mark, check_outputs

    if output is not None and output.suffix.lower() not in (".yaml", ".yml"):
        raise UsageError(f"--output {output}: expected a name that ends in .yaml")
    if plot is not None:
        check_plot(plot)
    read = [source for source in sources if source is not None]
    check_outputs(read, (output, Mark.CALIBRATION), (plot, Mark.FIGURE))


def positive(option: str, value: float | None) -> float | None:
    """An option's number, if there is one, above zero."""
    from dpgcli.errors import UsageError
    from dpgcli.files.sections import LARGEST, SMALLEST

    if value is not None and not SMALLEST <= value <= LARGEST:
        raise UsageError(
            f"{option} {value:g}: expected a number > 0, from {SMALLEST:g} to {LARGEST:g}"
        )
    return value


def scale_of(loss: Loss, scale: float | None) -> float | None:
    """The scale of a robust loss, if one is given."""
    from dpgcli.errors import UsageError

    if scale is not None and loss is Loss.LINEAR:
        raise UsageError("--loss-scale is for a robust loss: --loss soft_l1, huber or cauchy")
    return positive("--loss-scale", scale)


def geometry_from(values: list[str] | None, spec: Path | None) -> "Geometry | None":
    """The geometry that a fit holds at: that of a spec, with values changed or added."""
    from dpgcli.files.calibration import geometry_of
    from dpgcli.files.scene_file import read_keys

    base = None if spec is None else read_keys(spec).finger.geometry
    return geometry_of(values, base) if values else base


def known(geometry: "Geometry | None") -> dict[str, float]:
    """The dimensions that are given, by key."""
    return {} if geometry is None else geometry.model_dump(exclude_none=True)


def print_fit(fit: "Fit", printed_as: Format) -> None:
    """One row for each parameter on standard output."""
    import numpy as np

    from dpgcli.files.sections import unit_of

    states = zip(fit.parameters, fit.at_bound, strict=True)
    rows: dict[str, Any] = {
        "key": np.array([parameter.key for parameter in fit.parameters]),
        "value": fit.values,
        "standard_error": fit.standard_errors,
        "unit": np.array([unit_of(parameter.key) for parameter in fit.parameters]),
        "status": np.array(
            ["at bound" if bound else "free" if p.is_free else "fixed" for p, bound in states]
        ),
    }
    columns: tuple[Column, ...] = VALUE_COLUMNS
    if fit.intervals is not None:
        columns += INTERVAL_COLUMNS
        rows |= {"lower": fit.intervals[:, 0], "upper": fit.intervals[:, 1]}
    print_rows(columns, rows, printed_as)


def print_rows(columns: tuple[Column, ...], rows: dict[str, Any], printed_as: Format) -> None:
    """One block of rows on standard output."""
    for _ in printer_of(printed_as)(columns, [rows]):
        pass


def quality_line(fit: "Fit", unit: str) -> str:
    """How well the model meets the data, in words."""
    import numpy as np

    if fit.n_points <= sum(parameter.is_free for parameter in fit.parameters):
        return f"{fit.n_points} point{'s' * (fit.n_points != 1)}, met exactly"
    text = f"{fit.n_points} points: rms residual {fit.rms:.3g} {unit}"
    if np.isfinite(fit.r_squared):
        text += f", R^2 {fit.r_squared:.5f}"
    pairs = np.argwhere(np.triu(np.abs(fit.correlation) > 0.0, 1)).tolist()
    if pairs:
        first, second = max(pairs, key=lambda pair: abs(fit.correlation[*pair]))
        keys = [fit.parameters[place].key for place in (first, second)]
        text += (
            f"; strongest correlation {fit.correlation[first, second]:.2f}: {' and '.join(keys)}"
        )
    return text


def tell(lines: Iterable[str], warnings: Iterable[str], *files: Path | None) -> None:
    """Quality, warnings and files on standard error, after what is on standard output."""
    sys.stdout.flush()
    for line in lines:
        say(line)
    for warning in warnings:
        say(f"warning: {warning}")
    for path in files:
        if path is not None:
            say(f"written: {path}")


def method_of(what: str, fit: "Fit", resamples: int, seed: int) -> str:
    """The method of a fit in one line."""
    text = f"least squares on the {what}, {fit.loss} loss"
    if fit.loss != "linear":
        text += f" beyond {fit.loss_scale:.4g}"
    return text + (f", bootstrap of {resamples} (seed {seed})" if resamples else "")


def write(output: Path | None, content: dict[str, Any]) -> "Calibration":
    """The calibration with this content, written if there is a file to write it to."""
    from dpgcli.files.calibration import VERSION, Calibration, made_by, write_calibration

    head = {"calibration_version": VERSION, "made_by": made_by()}
    calibration = Calibration.model_validate({**head, **content})
    if output is not None:
        write_calibration(output, calibration)
    return calibration
