"""Output of a fit: its calibration, its figure, its values, and words about them."""

import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dpgcli.cli.options import check_plot
from dpgcli.cli.printing import Format, print_rows
from dpgcli.cli.progress import under_way
from dpgcli.cli.spelling import with_options
from dpgcli.cli.streams import say

if TYPE_CHECKING:
    from dpgcli.api.fits.result import FitResult


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


def resampling(bootstrap: int, *, quiet: bool) -> AbstractContextManager[object]:
    """Progress while one waits for many fits; one alone is over soon."""
    return under_way(f"{bootstrap:,} fits of resampled points", quiet=quiet or not bootstrap)


def put_out(
    fit: "FitResult[Any]",
    output: Path | None,
    plot: Path | None,
    printed_as: Format,
    quiet: bool,
) -> None:
    """Write the calibration and draw it if asked for, print its values, and say how good it is."""
    fit = fit.with_warnings(map(with_options, fit.warnings))
    if output is not None:
        fit.save(output)
    if plot is not None:
        fit.draw(plot)
    print_rows(fit.columns, fit.rows, printed_as)
    if not quiet:
        sys.stdout.flush()
        lines = [*fit.summary, *(f"warning: {warning}" for warning in fit.warnings)]
        files = (f"written: {path}" for path in (output, plot) if path is not None)
        for line in (*lines, *files):
            say(line)
