"""`dpg fit finger`: lattice values from known states of a whole finger."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dpgcli.calibration.choices import Loss, Target
from dpgcli.cli.fit.common import (
    NO_GEOMETRY,
    Bootstrap,
    GeometryValues,
    LossOption,
    LossScale,
    Output,
    Plot,
    Printed,
    Seed,
    check_files,
    method_of,
    print_fit,
    quality_line,
    scale_of,
    tell,
    write,
)
from dpgcli.cli.options import FirstStation, Quiet, Settings, SpecPath, TipOffset, frame_of
from dpgcli.cli.printing import Format

if TYPE_CHECKING:
    from dpgcli.calibration.finger import FingerFit
    from dpgcli.calibration.fits import Fit

LEVER = "segment_height_mm"
STILL_OFF = 0.3  # of the deflection
STILL_OFF_WARNING = (
    "tips are still off by more than 30 % of the deflection: look at --first-station, "
    "--tip-offset, units, and the sign of y (inverted units curl towards -y)"
)
UNITS = {Target.TIPS: "mm", Target.ANGLES: "rad"}


def finger(
    spec: SpecPath,
    data: Annotated[Path, typer.Argument(metavar="STATES", help="CSV of known states")],
    output: Output = None,
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free", metavar="KEY", help=f"Fit this value; repeatable  [default: {LEVER}]"
        ),
    ] = None,
    target: Annotated[Target, typer.Option(help="What of the states to meet")] = Target.TIPS,
    settings: Settings = None,
    first_station: FirstStation = None,
    tip_offset: TipOffset = None,
    geometry: GeometryValues = None,
    loss: LossOption = Loss.LINEAR,
    loss_scale: LossScale = None,
    bootstrap: Bootstrap = 0,
    seed: Seed = 0,
    printed_as: Printed = Format.TABLE,
    plot: Plot = None,
    quiet: Quiet = False,
) -> None:
    """Fit lattice values to tips or angles of known states."""
    from dpgcli.calibration.finger import FingerFit
    from dpgcli.files.calibration import DataFile, geometry_of
    from dpgcli.files.calibration.results import fitted
    from dpgcli.files.known_states import states_of
    from dpgcli.files.scene_file import read_scene, scene_of
    from dpgcli.files.scene_file.problems import checked as checked_spec

    document = read_scene(spec, settings or ())
    check_files((spec, data, *document.files), output, plot)
    checked = checked_spec(document)
    where = checked.finger.geometry
    where = geometry_of(geometry, where) if geometry else where
    base = scene_of(checked).finger
    known = states_of(base, data)
    frame = frame_of(first_station, tip_offset)
    size = scale_of(loss, loss_scale)
    study = FingerFit(base, known, frame, tuple(free or [LEVER]), target, loss, size)
    found = study.fit(bootstrap, seed)
    warnings = [*_warnings(study, found), *([] if where else [NO_GEOMETRY])]
    source = DataFile(file=data.name, sha256=known.sha256, rows=known.patterns.shape[1])
    content = {
        **fitted(found, UNITS[target], source, only_free=True),
        "method": _method(study, found, bootstrap, seed),
        "geometry": where,
        "warnings": warnings,
    }
    write(output, content)
    if plot is not None:
        _draw(study, found, data, plot)
    print_fit(found, printed_as)
    if not quiet:
        tell(_summary(study, found), warnings, output, plot)


def _warnings(study: "FingerFit", found: "Fit") -> list[str]:
    import numpy as np

    warnings = list(found.warnings)
    if np.nanmax(study.compared(found).relative, initial=0.0) > STILL_OFF:
        warnings.append(STILL_OFF_WARNING)
    if study.known.unused:
        warnings.append(f"columns not used: {', '.join(study.known.unused)}")
    return warnings


def _method(study: "FingerFit", found: "Fit", resamples: int, seed: int) -> str:
    """The method in one line, with the frame that was assumed."""
    frame = study.frame
    station, tip = ("{:g},{:g}".format(*point) for point in (frame.first_station, frame.tip))
    what = f"{study.target} through the equilibrium"
    held = ", ".join(f"{p.key} {p.start:g}" for p in found.parameters if not p.is_free)
    return (
        f"{method_of(what, found, resamples, seed)}, first station {station} mm, "
        f"tip offset {tip} mm, {study.finger.law.description}; held: {held}"
    )


def _summary(study: "FingerFit", found: "Fit") -> list[str]:
    """Quality, and errors of the tips before and after, and of each state from the others."""
    import numpy as np

    lines = [quality_line(found, UNITS[study.target])]
    for what, values in (("before", None), ("after", found)):
        relative = 100.0 * study.compared(values).relative
        if np.isfinite(relative).any():
            lines.append(
                f"tips {what}: {np.nanmax(relative):.3g} % of the deflection at worst, "
                f"{np.nanmean(relative):.3g} % in the mean"
            )
    left_out = 100.0 * study.left_out()
    if np.isfinite(left_out).any():
        lines.append(
            f"each state from the others alone: {np.nanmax(left_out):.3g} % at worst, "
            f"{np.nanmean(left_out):.3g} % in the mean"
        )
    return lines


def _draw(study: "FingerFit", found: "Fit", data: Path, plot: Path) -> None:
    from dpgcli.report.comparison import draw_comparison

    draw_comparison(study.known, study.compared(None), study.compared(found), data.name, plot)
