"""Predicted states beside known ones: errors in words, shapes in figures."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.comparison import Comparison
from dpgcli.calibration.known import KnownStates
from dpgcli.reports.drawing import figure_to, titled
from dpgcli.reports.labels import Picture
from dpgcli.reports.overlay import draw_shades, shade
from dpgcli.reports.panels import NO_WINDOW, Window
from dpgcli.states.patterns import texts

if TYPE_CHECKING:  # SciPy is in the way of comparisons, which need none
    from dpgcli.calibration.finger import FingerFit
    from dpgcli.calibration.fits import Fit


FOOT, HEAD = 1.25, 0.35  # inches


def comparison_summary(
    found: Comparison, law: str, calibrated: Comparison | None, calibrated_law: str
) -> Iterator[str]:
    """Worst and mean errors of the states that are in both, before and after a calibration."""
    if calibrated is None:
        yield from _errors(found, law)
    else:
        yield from _errors(found, f"as in the spec, {law}")
        yield from _errors(calibrated, f"calibrated, {calibrated_law}")


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
        ("stiffness against end moments", 100.0 * np.abs(found.stiffness), "%"),
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
    names = [text.decode() for text in texts(known.patterns)]
    picture = _picture(known, found, calibrated, names)
    text = "\n".join(_tips(known, found, names))
    with figure_to(path, *picture.page, name, text, layout=None) as figure:
        axes = picture.axes(figure)
        axes.set_title(titled(name))
        for state, pattern in enumerate(names):
            color = shade(pattern)
            axes.plot(*found.states.layer[:, :, state], ".-", color=color)
            if calibrated is not None:
                axes.plot(*calibrated.states.layer[:, :, state], "--", color=color)
            if known.shapes:
                axes.plot(*known.shapes[state], "+", color=color, ms=4)
            axes.plot(*known.tip[:, state], "x", color=color, ms=8, mew=2)
        picture.write(axes, {pattern: shade(pattern) for pattern in names})
        is_calibrated, has_shapes = calibrated is not None, bool(known.shapes)
        _draw_keys(figure, names, is_calibrated=is_calibrated, has_shapes=has_shapes)


def _picture(
    known: KnownStates, found: Comparison, calibrated: Comparison | None, names: list[str]
) -> Picture:
    """A window around all that is known and predicted, with patterns beside the known tips."""
    layers = [found.states.layer] + ([] if calibrated is None else [calibrated.states.layer])
    parts = [known.tip, *(layer.reshape(2, -1) for layer in layers), *(known.shapes or ())]
    x, y = np.concatenate(parts, axis=1)
    is_there = np.isfinite(x) & np.isfinite(y)
    window = Window.of((x + 1j * y)[is_there]) if is_there.any() else NO_WINDOW
    tips = known.tip[0] + 1j * known.tip[1]
    labelled = np.flatnonzero(np.isfinite(tips))
    return Picture.of(window, [names[i] for i in labelled], tips[labelled], FOOT, HEAD)


def _draw_keys(figure: Any, names: list[str], *, is_calibrated: bool, has_shapes: bool) -> None:
    """What lines, marks and colors are."""
    from matplotlib.lines import Line2D

    kinds: dict[str, dict[str, Any]] = {"predicted, to its tip": {"ls": "-", "marker": "."}}
    if is_calibrated:
        kinds["predicted, calibrated"] = {"ls": "--"}
    if has_shapes:
        kinds["known shape"] = {"ls": "", "marker": "+"}
    kinds["known tip"] = {"ls": "", "marker": "x"}
    height = figure.get_size_inches()[1]
    handles = [Line2D([], [], color="black", label=label, **kind) for label, kind in kinds.items()]
    where = {"loc": "lower center", "bbox_to_anchor": (0.5, 0.44 / height), "borderaxespad": 0.0}
    figure.legend(handles=handles, ncols=len(handles), frameon=False, fontsize=8, **where)
    draw_shades(figure, names, 0.04 / height)


def _tips(known: KnownStates, found: Comparison, names: list[str]) -> Iterator[str]:
    """The tips in words, for those who do not see them."""
    for state, name in enumerate(names):
        (x, y), (near_x, near_y) = known.tip[:, state], found.states.pose[:2, state]
        yield f"{name}: known tip {x:.5g}, {y:.5g} mm, predicted {near_x:.5g}, {near_y:.5g} mm"


def draw_fitted(study: "FingerFit", found: "Fit", name: str, path: Path) -> None:
    """Draw the states of a finger as it was and as it was fitted beside the known ones."""
    draw_comparison(study.known, study.compared(None), study.compared(found), name, path)
