"""`fit_unit`: hinge, walls and lever of one unit from what it turns by under end moments."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dpgcli.api.arguments import as_texts, chosen, files_of
from dpgcli.api.data import check_resampling
from dpgcli.api.fits.finger import errors_of, targets_of
from dpgcli.api.fits.result import (
    FitResult,
    GeometryInput,
    check_loss,
    fit_result,
    geometry_from,
    sizes,
    warned,
)
from dpgcli.calibration.choices import HINGES, LEVER, WALLS, Loss, Target
from dpgcli.calibration.finger import FingerFit
from dpgcli.calibration.fits import Fit
from dpgcli.calibration.known import Frame, KnownStates
from dpgcli.calibration.unit import lever_of, study_unit, unit_finger
from dpgcli.design import geometry as rules
from dpgcli.design.dimensions import without_unit
from dpgcli.design.rules import HINGE_STIFFNESS
from dpgcli.files.calibration import DataFile
from dpgcli.files.calibration.results import finger_sections
from dpgcli.files.csv_file import Tabular, name_of
from dpgcli.files.known_states import read_states
from dpgcli.files.plausible_states import check_lever, check_loads, check_scale
from dpgcli.files.sections import Geometry
from dpgcli.mechanics.finger import STUDY, uniform_finger
from dpgcli.reports.fit_figures import draw_turns
from dpgcli.reports.fits import unit_summary, value_rows

ASSUMED_LEVER = (
    "the dome axis is assumed where the study has it, "
    f"{STUDY['segment_height']:g} mm above the layer's middle: give the geometry"
)


def fit_unit(
    curve: Tabular,
    *,
    free: str | Sequence[str] = (HINGES, WALLS, LEVER),
    target: str | Sequence[str] = (),
    error: str | Sequence[str] = (),
    geometry: GeometryInput = None,
    spec: str | Path | Mapping[str, Any] | None = None,
    loss: str = "linear",
    loss_scale: float | None = None,
    bootstrap: int = 0,
    seed: int = 0,
) -> FitResult[Fit]:
    """Fit k_θ (N mm/rad), c_w (mm/N) and the lever H (mm) to turns of a unit under end moments.

    `curve` has `unit` (ground or inverted), `moment_N_mm` (positive where it opens the gap),
    `chamber2_angle_rad`, and for inverted units `opening_mm` and `push_N`. Without inverted rows
    only the hinge is fitted. `target` and `error` are those of `fit_finger`, by default angles and
    openings, which the pushes are then held against; dimensions say where the values hold,
    and where the dome's axis is if `free` leaves the lever out.
    Raises SpecError for wrong data, UsageError for wrong choices, FitError for a fit that fails.

    >>> ground = {"unit": ["ground"] * 2, "moment_N_mm": [2.42, -2.42]}
    >>> fit = fit_unit(ground | {"chamber2_angle_rad": [-0.1, 0.1]})
    >>> round(fit.values["hinge_stiffness_N_mm_per_rad"], 6)
    24.2
    """
    check_resampling(bootstrap, seed)
    weighted = chosen(Loss, "loss", loss)
    check_loss(weighted, loss_scale)
    at = geometry_from(geometry, spec)
    known = read_states(curve, 1)
    has_pushes = bool(known.patterns.any())
    keys = as_texts("free", free) if has_pushes else (HINGES,)
    lever = _lever(at)
    if (seen := lever_of(known)) is not None:
        check_lever(curve, known, seen)
    size = lever or seen or STUDY["segment_height"]
    expected = uniform_finger(1, **study_unit(size) | {"hinge_stiffness": _hinge(at, size)})
    check_scale(curve, known, float(expected.straight_length[0]))
    check_loads(curve, known, expected)
    base = unit_finger(known, size if lever or LEVER in keys else STUDY["segment_height"])
    met = targets_of(known, as_texts("target", target) or _targets(known), with_walls=has_pushes)
    errors = errors_of(error, met)
    study = FingerFit(base, known, Frame(), keys, met, weighted, loss_scale, errors)
    found = study.fit(bootstrap, seed)
    columns, rows = value_rows(found)
    is_free = rows["status"] != "fixed"
    source = DataFile(file=name_of(curve), sha256=known.sha256, rows=known.patterns.shape[1])
    doubts = (ASSUMED_LEVER,) if lever is None and LEVER not in keys and has_pushes else ()
    return fit_result(
        found,
        {**finger_sections(study, found, source, bootstrap, seed), "geometry": at},
        (columns, {name: values[is_free] for name, values in rows.items()}),
        partial(unit_summary, study, found),
        warned((*found.warnings, *doubts), at, known.unused),
        partial(draw_turns, study, found, name_of(curve)),
        files=files_of(curve, spec),
    )


def _targets(known: KnownStates) -> tuple[Target, ...]:
    """Angles, and openings of inverted units where the data have them.

    What a unit at rest opens by says where its hinge is, and that is not fitted to it alone.
    """
    has_openings = np.isfinite(known.openings[known.patterns]).any()
    return (Target.ANGLES, Target.OPENINGS) if has_openings else (Target.ANGLES,)


def _hinge(at: Geometry | None, segment_height: float) -> float:
    """The hinge stiffness (N mm/rad) that the inferred rule expects.

    What the geometry lacks is the study's, lengths scaled to the segment height (mm).
    """
    given, needs = sizes(at), HINGE_STIFFNESS.needs
    scale = segment_height / STUDY["segment_height"]
    study = {need: getattr(rules.REFERENCE, without_unit(need)) for need in needs}
    usual = {k: v * scale if k.endswith("_mm") else v for k, v in study.items()}
    return float(rules.hinge_stiffness(*(given.get(need, usual[need]) for need in needs)))


def _lever(at: Geometry | None) -> float | None:
    """Where geometry has the dome's axis, above the layer's middle (mm); None where it is open."""
    if at is None or at.limiting_layer_thickness_mm is None:
        return None
    width = at.chamber_width_mm
    if width is None and at.unit_cell_mm is not None:
        width = rules.chamber_width(at.unit_cell_mm)
    return None if width is None else rules.segment_height(width, at.limiting_layer_thickness_mm)
