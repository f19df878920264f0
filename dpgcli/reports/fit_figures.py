"""Figures of fits: the data with the fitted law, the residuals below."""

from dataclasses import field
from pathlib import Path

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.bistable import UNITS, BistableFit, BistableOptions, law
from dpgcli.calibration.finger import FingerFit
from dpgcli.calibration.fits import Fit
from dpgcli.calibration.hinge import HingeFit
from dpgcli.calibration.known import Frame, lattice_states
from dpgcli.files.measured import Moments
from dpgcli.records import dataclass
from dpgcli.reports.drawing import figure_to, titled


@dataclass(frozen=True)
class FitFigure:
    """The content of a figure: `line` is the fitted law, x and y; labels name their units.

    `gaps` are stretches of x in which there are no data.
    """

    title: str
    x: Array
    observed: Array
    residuals: Array
    line: tuple[Array, Array]
    x_label: str
    y_label: str
    unit: str
    gaps: list[tuple[float, float]] = field(default_factory=list)


def draw_fit(figure: FitFigure, path: Path) -> None:
    """Draw a fit to an SVG or PNG file, the same bytes each time."""
    text = f"{figure.y_label} over {figure.x_label}: {len(figure.x)} points of data, the fitted law"
    with figure_to(path, 8.0, 6.5, figure.title, text) as drawn:
        above, below = drawn.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        above.plot(*figure.line, color="#440154", lw=1.5, label="fitted law", zorder=4)
        above.plot(figure.x, figure.observed, ".", color="#21918c", ms=5, label="data", zorder=3)
        above.set(title=titled(figure.title), ylabel=figure.y_label)
        below.axhline(0.0, color="#440154", lw=1.0)
        below.plot(figure.x, figure.residuals, ".", color="#21918c", ms=4)
        below.set(xlabel=figure.x_label, ylabel=f"law - data ({figure.unit})")
        for axes in (above, below):
            axes.grid(visible=True, alpha=0.25)
            for place, gap in enumerate(figure.gaps):
                label = "no data: extrapolated" if place == 0 else None
                axes.axvspan(*gap, color="0.9", zorder=0, label=label)
        above.legend()


def bistable_figure(found: BistableFit, choice: BistableOptions, name: str) -> FitFigure:
    """The dome's curve with the bistable law through it."""
    unit = UNITS[choice.quantity]
    along = np.linspace(min(0.0, float(found.travel.min())), float(found.travel.max()), 400)
    fitted = law(found.factor * along, found.fit.values, choice.quantity)
    return FitFigure(
        title=f"{name}: bistable law, opening = {found.factor:.4g} travel",
        x=found.travel,
        observed=found.observed,
        residuals=found.fit.residuals,
        line=(along, fitted if unit == "mJ" else found.factor * fitted),
        x_label="travel of the dome (mm)",
        y_label=f"{'energy' if unit == 'mJ' else 'force along the travel'} ({unit})",
        unit=unit,
        gaps=found.gaps,
    )


def hinge_figure(found: HingeFit, data: Moments, name: str) -> FitFigure:
    """Moments over rotations with the hinge's line."""
    ends = np.array([min(0.0, data.rotation.min()), max(0.0, data.rotation.max())])
    return FitFigure(
        title=f"{name}: hinge",
        x=data.rotation,
        observed=data.moment,
        residuals=found.fit.residuals,
        line=(ends, found.fit.values[0] * ends),
        x_label="rotation (rad)",
        y_label="moment (N mm)",
        unit="N mm",
    )


def draw_turns(study: FingerFit, found: Fit, name: str, path: Path) -> None:
    """Draw what moments turn a unit by, ground and inverted: the data and the fit."""
    known = study.known
    finger = study.finger.with_values(found.by_key)
    reach = 1.1 * (np.abs(known.moments).max() or 1.0)
    along = np.linspace(-reach, reach, 101)
    with figure_to(path, 7.0, 5.0, name, f"turn over end moment: {name}, the fit") as drawn:
        axes = drawn.subplots()
        for text, inverted, color, mark in (
            ("ground", False, "#21918c", "o"),
            ("inverted", True, "#440154", "^"),
        ):
            rows = known.patterns[0] == inverted
            if rows.any():
                patterns = np.full((1, len(along)), inverted)
                line = lattice_states(finger, patterns, Frame(), along).angles[0]
                axes.plot(along, -line, color=color, lw=1.5, label=f"{text}, fit")
                axes.plot(
                    known.moments[rows],
                    -known.angles[0, rows],
                    mark,
                    color=color,
                    label=f"{text}, data",
                )
        axes.set(
            title=titled(name),
            xlabel="end moment, positive where it opens the gap (N mm)",
            ylabel="turn of the second chamber, positive where it curls (rad)",
        )
        axes.grid(visible=True, alpha=0.25)
        axes.legend()
