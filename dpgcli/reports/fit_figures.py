"""Figures of fits: the data with the fitted law, the residuals below."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.bistable import UNITS, BistableFit, BistableOptions, law
from dpgcli.calibration.hinge import HingeFit
from dpgcli.files.measured import Moments
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
