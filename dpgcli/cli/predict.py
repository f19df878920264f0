"""`dpg predict`: every stable state of a finger or gripper, certified."""

import shutil
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dpgcli.cli.options import (
    LONG,
    ColumnNames,
    DesignNumber,
    FormulationName,
    FormulationOption,
    Nodes,
    Patterns,
    Quiet,
    Settings,
    TargetError,
    Tolerance,
    WithUncertainty,
    check_plot,
    check_table_name,
    request_of,
)
from dpgcli.cli.printing import ROWS_SHOWN, Format, printer_of
from dpgcli.cli.progress import ProgressLine
from dpgcli.cli.streams import is_read, put, say
from dpgcli.text import counted

if TYPE_CHECKING:
    from dpgcli.arrays import Columns
    from dpgcli.design.scene import Scene
    from dpgcli.states.accuracy import AccuracyLevel
    from dpgcli.states.certify import Status
    from dpgcli.states.plan import Plan
    from dpgcli.states.predict import Prediction, Summary

BRAILLE = "\u28ff"


SpecOrFolder = Annotated[
    Path,
    typer.Argument(
        metavar="SPEC", help="YAML spec; - reads standard input; with --design a sweep's folder"
    ),
]
Output = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="FILE", help="Write all rows to this Parquet file"),
]
PrintedAs = Annotated[
    Format | None,
    typer.Option("--format", help="How to print rows  [default: table]", show_default=False),
]
Plot = Annotated[
    Path | None,
    typer.Option("--plot", metavar="FILE", help="Draw the states: a .svg or .png file"),
]
Overlay = Annotated[
    bool, typer.Option("--overlay", help="Draw all states in one picture of --plot")
]
Sketch = Annotated[
    bool, typer.Option("--sketch", help="Show small pictures of the states under the table")
]


def predict(
    spec: SpecOrFolder,
    design: DesignNumber = None,
    output: Output = None,
    printed_as: PrintedAs = None,
    patterns: Patterns = None,
    settings: Settings = None,
    columns: ColumnNames = "default",
    nodes: Nodes = False,
    uncertainty: WithUncertainty = False,
    formulation: FormulationOption = FormulationName.CHAIN,
    tolerance: Tolerance = None,
    target_error: TargetError = None,
    plot: Plot = None,
    overlay: Overlay = False,
    sketch: Sketch = False,
    quiet: Quiet = False,
) -> None:
    """Predict and certify every stable state."""
    from dpgcli.api.inputs import spec_or_design
    from dpgcli.states import predict as states

    given = spec_or_design(spec, design, settings or ())
    request = request_of(
        patterns, columns, nodes, uncertainty, formulation, tolerance, target_error
    )
    prediction = states.predict(given.scene, request)
    _check_figure(plot, prediction.plan.n_states, overlay=overlay)
    _check_sketch(printed_as, prediction.plan.n_states if sketch else 0)
    _check_outputs(given.files, output, plot)
    if prediction.plan.expected_seconds > LONG and not quiet:
        from dpgcli.cli.explain import expected

        say(f"{prediction.plan.n_states:,} states: {expected(prediction.plan)}")
    rows = _progress(prediction, quiet)
    if printed_as is not None or output is None or prediction.plan.n_states <= ROWS_SHOWN:
        principal = columns == "default" and not nodes
        printer = printer_of(printed_as or Format.TABLE, principal=principal)
        rows = printer(prediction.plan.columns, rows)
    only_prints = output is None and plot is None
    if output is not None:
        from dpgcli.files.prediction import write_prediction

        write_prediction(prediction, output, given.json, rows, sys.argv)
    for _ in rows:
        if only_prints and not is_read():  # the work is for nobody
            break
    _draw(given.scene, request.patterns, plot, overlay=overlay, sketch=sketch and is_read())
    sys.stdout.flush()
    if not quiet and (is_read() or not only_prints):
        say("\n".join(_summary(prediction)))


def _progress(prediction: "Prediction", quiet: bool) -> Iterator["Columns"]:
    """Blocks, with progress where the work takes long."""
    line = ProgressLine(prediction.plan.n_states, "states", quiet=quiet)
    try:
        for block in prediction.blocks():
            yield block
            line.show(prediction.summary.n_states)
    finally:
        line.clear()


def _draw(
    scene: "Scene", patterns: Sequence[str], plot: Path | None, *, overlay: bool, sketch: bool
) -> None:
    """The pictures that are asked for."""
    from dpgcli.api import predict as face

    if sketch:
        width = shutil.get_terminal_size().columns
        put(f"\n{face.sketch(scene, tuple(patterns), width)}")
    if plot is not None:
        face.draw(scene, tuple(patterns), plot, overlay=overlay)


def _check_figure(plot: Path | None, n_states: int, *, overlay: bool) -> None:
    """Before any work: a figure that can be drawn; raises UsageError."""
    from dpgcli.api.predict import check_drawable
    from dpgcli.errors import UsageError

    if plot is not None:
        check_plot(plot)
        check_drawable(n_states)
    elif overlay:
        raise UsageError("--overlay draws all states in one picture: name its file with --plot")


def _check_sketch(printed_as: Format | None, n_states: int) -> None:
    """Before any work: sketches of so many states can be shown; raises UsageError."""
    from dpgcli.api.predict import check_drawable
    from dpgcli.errors import UsageError

    if not n_states:
        return
    check_drawable(n_states, "sketch")
    if printed_as in (Format.CSV, Format.JSON):
        raise UsageError(f"--sketch draws under a table: drop it, or --format {printed_as}")
    try:
        BRAILLE.encode(sys.stdout.encoding)
    except UnicodeEncodeError:
        raise UsageError(
            f"--sketch needs braille, which {sys.stdout.encoding} does not have: set a locale "
            "with UTF-8, or PYTHONIOENCODING=utf-8"
        ) from None


def _check_outputs(sources: Sequence[Path], output: Path | None, plot: Path | None) -> None:
    """Before any work: files that can be written, under names that are not taken."""
    from dpgcli.files.output import Mark, check_outputs, run_file

    beside = None if output is None else run_file(output)
    check_outputs(sources, (output, Mark.TABLE), (plot, Mark.FIGURE), (beside, Mark.FACTS))
    check_table_name(output)
    if output is not None:
        from dpgcli.files.prediction import check_facts

        check_facts(output)


def _meaning(status: "Status", plan: "Plan") -> str:
    """What a status means for a finger, and what may help where bars are in the way."""
    from dpgcli.states.certify import Status

    meaning = status.meaning_for(plan.scene.finger)
    if status is Status.NOT_CONVERGED and plan.request.formulation == "lattice":
        return f"{meaning} (node coordinates with very stiff bars: take the chain)"
    return meaning


def _summary(prediction: "Prediction") -> Iterator[str]:
    """States, error and time in one line, why some are not stable, and where values come from."""
    from dpgcli.states.certify import Status

    summary, plan = prediction.summary, prediction.plan
    counts = ", ".join(f"{n:,} {status.text}" for status, n in summary.statuses.items() if n)
    worst = (
        f"worst residual {summary.residual:.1e} N, worst tip error {summary.tip_error:.1e} mm "
        "(numerical; not the model's)"
    )
    if plan.accuracy_level is not None:
        yield _chosen(plan.accuracy_level, plan.error_bound, plan.request.target_error or 0.0)
    worst = worst if summary.statuses[Status.STABLE] else "no stable state"
    yield f"{counts} in {summary.seconds:.3g} s ({_rate(summary)}); {worst}"
    for status, n in summary.statuses.items():
        if n and status is not Status.STABLE:
            yield f"{status.text}: {_meaning(status, plan)}"
    origins = Counter(source.origin.value for source in plan.scene.sources)
    values = ", ".join(f"{n} {origin}" for origin, n in origins.items())
    yield f"values: {values} (dpg explain says which); {plan.scene.finger.law.description}"
    yield from _uncertainty(prediction)
    yield from _barriers(summary)
    yield from (f"warning: {warning}" for warning in plan.warnings)
    yield f"the model's own error: {plan.scene.model_error.text}"


def _uncertainty(prediction: "Prediction") -> Iterator[str]:
    """What uncertainties cover, and what the largest one is made of."""
    worst = prediction.summary.breakdown
    if worst is None:
        return
    yield f"uncertainties cover: {prediction.plan.covers}"
    largest_first = sorted(worst.shares.items(), key=lambda item: -item[1])
    causes = ", ".join(f"{share:.2g} by {cause}" for cause, share in largest_first)
    yield f"the least certain tip, of {worst.pattern}: ± {worst.total:.2g} mm; {causes} alone"


def _barriers(summary: "Summary") -> Iterator[str]:
    """The least robust unit of all states, and saddles that were not found."""
    if summary.least_robust is not None:
        least = summary.least_robust
        what = "units" if "," in least.unit else "unit"
        others = least.n_states - 1
        ties = f"; as little in {counted(others, 'other state')}" if others else ""
        yield f"least robust: {what} {least.unit} in {least.pattern}, {least.barrier:.5g} mJ{ties}"
    if summary.n_saddles_not_found:
        n = counted(summary.n_saddles_not_found, "barrier")
        yield f"{n} not found: no certified saddle parts the two states, though both exist"


def _chosen(level: "AccuracyLevel", bound: float, target: float) -> str:
    """The accuracy level that a target error chose, in words."""
    promise = f"bound on the tips' error {bound:.1e} mm (tips only)"
    if bound > target:
        promise = (
            "no accuracy level promises that before the work: "
            "numerical_error_mm says what was reached"
        )
    return f"chosen for the target error: {level.name}; {promise}"


def _rate(summary: "Summary") -> str:
    return f"{summary.n_states / max(summary.seconds, 1e-9):,.0f} states/s"
