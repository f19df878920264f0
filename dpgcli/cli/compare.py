"""`dpg compare`: predictions beside finite elements or measurements."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dpgcli.cli.options import (
    FirstStation,
    Quiet,
    Settings,
    SpecPath,
    TipOffset,
    check_plot,
    frame_of,
)
from dpgcli.cli.printing import Format, printer_of
from dpgcli.cli.streams import say

if TYPE_CHECKING:
    from dpgcli.arrays import Array
    from dpgcli.calibration.comparison import Comparison
    from dpgcli.calibration.known import KnownStates
    from dpgcli.mechanics.finger import Finger

REPEATS = 5

Data = Annotated[Path, typer.Argument(metavar="DATA", help="CSV of known states")]
Shapes = Annotated[
    Path | None, typer.Option("--shapes", help="CSV of the layer's points: pattern, x_mm, y_mm")
]
CalibrationFile = Annotated[
    Path | None, typer.Option("--calibration", help="Compare with its values, too")
]


def compare(
    spec: SpecPath,
    data: Data,
    settings: Settings = None,
    calibration: CalibrationFile = None,
    shapes: Shapes = None,
    first_station: FirstStation = None,
    tip_offset: TipOffset = None,
    printed_as: Annotated[
        Format, typer.Option("--format", help="How to print the states")
    ] = Format.TABLE,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Draw shapes and known tips: a .svg or .png file")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Hold predictions against finite elements or measurements."""
    from dpgcli.calibration.comparison import columns, compare, rows
    from dpgcli.files.known_states import states_of
    from dpgcli.files.output import Mark, check_outputs
    from dpgcli.files.scene_file import checked, read_scene, recalibrated, scene_of

    document = read_scene(spec, settings or ())
    finger, frame = scene_of(checked(document)).finger, frame_of(first_station, tip_offset)
    known = states_of(finger, data, shapes)
    better = None
    if calibration is not None:
        better = scene_of(checked(recalibrated(document, calibration))).finger
    if plot is not None:
        check_plot(plot)
        sources = [path for path in (spec, data, shapes, calibration) if path is not None]
        check_outputs([*sources, *document.files], (plot, Mark.FIGURE))
    found = compare(finger, known, frame)
    calibrated = None if better is None else compare(better, known, frame)
    table = rows(known, found, calibrated)
    for _ in printer_of(printed_as)(columns(table), [table]):
        pass
    if plot is not None:
        from dpgcli.reports.comparison import draw_comparison

        draw_comparison(known, found, calibrated, data.name, plot)
    if not quiet:
        sys.stdout.flush()
        say("\n".join(_summary(finger, known, found, calibrated)))


def _summary(
    finger: "Finger",
    known: "KnownStates",
    found: "Comparison",
    calibrated: "Comparison | None",
) -> Iterator[str]:
    """Worst and mean errors of the states that are in both, and the ratio of run times."""
    import numpy as np

    if calibrated is None:
        yield from _errors(found, finger.law.description)
    else:
        yield from _errors(found, f"as in the spec, {finger.law.description}")
        yield from _errors(calibrated, f"calibrated, {finger.law.description}")
    if np.isfinite(known.seconds).any():
        yield _times(finger, known)
    if known.unused:
        yield f"columns not used: {', '.join(known.unused)}"


def _errors(found: "Comparison", what: str) -> Iterator[str]:
    import numpy as np

    is_state = np.isfinite(found.states.pose[0])
    if not is_state.any():
        yield f"none of the {len(is_state)} states exists in the lattice ({what})"
        return
    kinds = (
        ("tips", found.distance, "mm"),
        ("tips, of the deflection", 100.0 * found.relative, "%"),
        ("tip angles", found.tip_angle, "rad"),
        ("angles", found.angle, "rad"),
        ("openings", found.opening, "mm"),
        ("pushes", found.push, "N"),
        ("shapes", found.shape[0], "mm"),
    )
    said = [
        f"{name} {_worst_and_mean(errors[np.isfinite(errors)], unit)}"
        for name, errors, unit in kinds
        if np.isfinite(errors).any()
    ]
    yield f"{is_state.sum()} states, errors of the model ({what}):"
    yield from (f"  {line}" for line in said)
    if n_missing := int((~is_state).sum()):
        yield f"  {n_missing} states of the data do not exist in the lattice"


def _worst_and_mean(errors: "Array", unit: str) -> str:
    return f"{errors.max():.3g} {unit} at worst, {errors.mean():.3g} {unit} in the mean"


def _times(finger: "Finger", known: "KnownStates") -> str:
    import numpy as np

    from dpgcli.benchmark.timing import measured
    from dpgcli.calibration.known import Frame, lattice_states

    n_states = known.patterns.shape[1]
    own = measured(lambda: lattice_states(finger, known.patterns, Frame()), REPEATS).wall / n_states
    theirs = float(np.nanmean(known.seconds))
    ratio = f"{theirs / own:,.0f} times as long"
    return f"{theirs:.3g} s a state in the data, {own:.2g} s here: {ratio}"
