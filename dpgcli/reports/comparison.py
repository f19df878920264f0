"""Predicted states beside known ones: errors in words, shapes in figures."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.comparison import Comparison
from dpgcli.calibration.known import KnownStates
from dpgcli.reports.drawing import drawn_to
from dpgcli.states.patterns import texts

if TYPE_CHECKING:  # SciPy is in the way of comparisons, which need none
    from dpgcli.calibration.finger import FingerFit
    from dpgcli.calibration.fits import Fit


def comparison_summary(found: Comparison, calibrated: Comparison | None, law: str) -> Iterator[str]:
    """Worst and mean errors of the states that are in both, before and after a calibration."""
    if calibrated is None:
        yield from _errors(found, law)
    else:
        yield from _errors(found, f"as in the spec, {law}")
        yield from _errors(calibrated, f"calibrated, {law}")


def _errors(found: "Comparison", what: str) -> Iterator[str]:
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


def draw_comparison(
    known: KnownStates, found: Comparison, calibrated: Comparison | None, name: str, path: Path
) -> None:
    """Draw each predicted limiting layer beside the known tip and shape, to SVG or PNG."""
    from matplotlib import colormaps

    names = [text.decode() for text in texts(known.patterns)]
    text = "\n".join(_tips(known, found, names))
    words = {"xlabel": "x (mm)", "ylabel": "y (mm)"}
    with drawn_to(path, 9.0, 6.0, name, text, aspect="equal", **words) as axes:
        for state, inverted in enumerate(known.patterns.T):
            color = colormaps["viridis"](0.85 * inverted.mean())
            axes.plot(*found.states.layer[:, :, state], ".-", color=color)
            if calibrated is not None:
                axes.plot(*calibrated.states.layer[:, :, state], "--", color=color)
            if known.shapes:
                axes.plot(*known.shapes[state], "+", color=color, ms=4)
            _draw_known(axes, known.tip[:, state], names[state], color)
        axes.plot([], [], "k.-", label="predicted, to its tip")
        if calibrated is not None:
            axes.plot([], [], "k--", label="predicted, calibrated")
        if known.shapes:
            axes.plot([], [], "k+", ms=4, label="known shape")
        axes.plot([], [], "kx", ms=9, mew=2, label="known tip")
        axes.legend(frameon=False)


def _tips(known: KnownStates, found: Comparison, names: list[str]) -> Iterator[str]:
    """The tips in words, for those who do not see them."""
    for state, name in enumerate(names):
        (x, y), (near_x, near_y) = known.tip[:, state], found.states.pose[:2, state]
        yield f"{name}: known tip {x:.5g}, {y:.5g} mm, predicted {near_x:.5g}, {near_y:.5g} mm"


def draw_fitted(study: "FingerFit", found: "Fit", name: str, path: Path) -> None:
    """Draw the states of a finger as it was and as it was fitted beside the known ones."""
    draw_comparison(study.known, study.compared(None), study.compared(found), name, path)


def _draw_known(axes: Any, tip: Array, pattern: str, color: Any) -> None:
    if np.isfinite(tip).all():
        axes.plot(*tip, "x", color=color, ms=9, mew=2)
        axes.annotate(pattern, tip, textcoords="offset points", xytext=(7, 4), fontsize=8)
