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
    from dpgcli.accuracy.comparison import Comparison, KnownTips
    from dpgcli.arrays import Array
    from dpgcli.mechanics.finger import Finger

REPEATS = 5


def compare(
    spec: SpecPath,
    data: Annotated[Path, typer.Argument(metavar="DATA", help="CSV of known tips")],
    settings: Settings = None,
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
    """Hold predicted tips against finite elements or measurements."""
    from dpgcli.accuracy import comparison
    from dpgcli.files.output import check_outputs
    from dpgcli.files.reading import read_tips
    from dpgcli.files.spec import read_spec, scene_of

    scene = scene_of(read_spec(spec, settings or ()))
    finger, frame = scene.finger, frame_of(first_station, tip_offset)
    known = read_tips(data, finger.n_units)
    if plot is not None:
        check_plot(plot)
        check_outputs((spec, data), plot)
    found = comparison.compare(finger, known, frame)
    printer = printer_of(printed_as)
    for _ in printer(comparison.COLUMNS, [comparison.rows(known, found)]):
        pass
    if plot is not None:
        from dpgcli.report.comparison import draw_comparison

        draw_comparison(known, found, str(data), plot)
    if not quiet:
        sys.stdout.flush()
        for line in _summary(finger, known, found):
            say(line)


def _summary(finger: "Finger", known: "KnownTips", found: "Comparison") -> Iterator[str]:
    """Worst and mean errors of the states that are in both, and the ratio of run times."""
    import numpy as np

    is_state = np.isfinite(found.distance)
    if not is_state.any():
        yield f"none of the {len(is_state)} states exists in the lattice"
        return
    distance = found.distance[is_state]
    relative = found.relative[is_state & np.isfinite(found.relative)]
    text = f"{len(distance)} states: error {_worst_and_mean(distance, 'mm')}"
    if len(relative):
        text += f"; of the deflection {_worst_and_mean(100.0 * relative, '%')}"
    yield text + " (the model's error; published law, pushing and pulling)"
    if n_missing := int((~is_state).sum()):
        yield f"{n_missing} states of the data do not exist in the lattice"
    if np.isfinite(known.seconds).any():
        yield _times(finger, known)


def _worst_and_mean(errors: "Array", unit: str) -> str:
    return f"{errors.max():.3g} {unit} at worst, {errors.mean():.3g} {unit} in the mean"


def _times(finger: "Finger", known: "KnownTips") -> str:
    import numpy as np

    from dpgcli.accuracy.comparison import Frame, compare
    from dpgcli.accuracy.timing import measured

    own = measured(lambda: compare(finger, known, Frame()), REPEATS).wall / known.patterns.shape[1]
    theirs = float(np.nanmean(known.seconds))
    ratio = f"{theirs / own:,.0f} times as long"
    return f"{theirs:.3g} s a state in the data, {own:.2g} s here: {ratio}"
