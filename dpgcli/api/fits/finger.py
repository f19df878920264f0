"""`fit_finger`: lattice values from known states of a whole finger."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from dpgcli.api.arguments import as_texts, chosen, files_of
from dpgcli.api.data import check_resampling, frame_of
from dpgcli.api.fits.result import (
    NO_GEOMETRY,
    FitResult,
    GeometryInput,
    check_loss,
    fit_result,
    with_geometry,
)
from dpgcli.api.inputs import Place, Settings, SpecInput, scene_input
from dpgcli.calibration.choices import FITTED_BY_DEFAULT, WALLS, Loss, Target
from dpgcli.calibration.finger import FingerFit
from dpgcli.calibration.fits import Fit
from dpgcli.calibration.known import KnownStates
from dpgcli.calibration.observations import targets_for
from dpgcli.errors import Field, UsageError
from dpgcli.files.calibration import DataFile
from dpgcli.files.calibration.results import finger_sections
from dpgcli.files.csv_file import Tabular, name_of
from dpgcli.files.plausible_states import states_of
from dpgcli.reports.comparison import draw_fitted
from dpgcli.reports.fits import finger_summary, value_rows
from dpgcli.text import number_in


def fit_finger(
    spec: SpecInput,
    states: Tabular,
    *,
    free: str | Sequence[str] = (FITTED_BY_DEFAULT,),
    target: str | Sequence[str] = (),
    error: str | Sequence[str] = (),
    settings: Settings = (),
    first_station: Place = None,
    tip_offset: Place = None,
    geometry: GeometryInput = None,
    loss: str = "linear",
    loss_scale: float | None = None,
    bootstrap: int = 0,
    seed: int = 0,
) -> FitResult[Fit]:
    """Fit lattice values, the same in all units, to quantities of known states.

    `states` has `pattern` and what is known: see `files.known_states`. `target` is one or more of
    "tips", "angles", "openings" and "pushes": by default tips (angles where there are none), with
    walls openings and pushes, too; `error`, "pushes=0.05", is what one is taken to be off by (mm,
    rad, N; estimated otherwise). `first_station` is the lattice's first node in the data,
    `tip_offset` the data's tip from the last node along the phalanx and to its left (mm), unless
    the data's header or the spec's section `data` says them.
    Raises SpecError for a wrong spec or data, UsageError for wrong choices, FitError for a fit
    that fails.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> finger = uniform_finger(1, **STUDY)  # struts of 10.75 mm: its tip turns by -0.30302 rad
    >>> states = {"pattern": ["1"], "tip_angle_rad": [-0.30302]}
    >>> round(fit_finger(finger, states, target="angles").values["segment_height_mm"], 3)
    10.75
    """
    given = scene_input(spec, settings)
    base = given.scene.finger
    where = with_geometry(geometry, given.spec.finger.geometry if given.spec else None)
    known = states_of(base, states)
    weighted = chosen(Loss, "loss", loss)
    check_loss(weighted, loss_scale)
    frame, _ = frame_of(given, known, first_station, tip_offset)
    if not (keys := as_texts("free", free)):
        raise UsageError(Field("free"), ": expected one key or more")
    met = targets_of(known, target, with_walls=WALLS in keys or base.has_walls)
    check_resampling(bootstrap, seed)
    study = FingerFit(base, known, frame, keys, met, weighted, loss_scale, errors_of(error, met))
    found = study.fit(bootstrap, seed)
    source = DataFile(file=name_of(states), sha256=known.sha256, rows=known.patterns.shape[1])
    return fit_result(
        found,
        {**finger_sections(study, found, source, bootstrap, seed), "geometry": where},
        value_rows(found),
        partial(finger_summary, study, found),
        (*study.judgments(found), *(() if where else (NO_GEOMETRY,))),
        partial(draw_fitted, study, found, name_of(states)),
        files=(*given.files, *files_of(states)),
    )


def targets_of(
    known: KnownStates, target: str | Sequence[str], *, with_walls: bool
) -> tuple[Target, ...]:
    """The quantities that are named, or else those that are fitted by default."""
    named = (chosen(Target, "target", text) for text in as_texts("target", target))
    return tuple(dict.fromkeys(named)) or targets_for(known, with_walls=with_walls)


def errors_of(error: str | Sequence[str], targets: Sequence[Target]) -> dict[Target, float]:
    """Errors by quantity, from texts such as "pushes=0.05".

    >>> errors_of("pushes=0.05", [Target.TIPS, Target.PUSHES])
    {<Target.PUSHES: 'pushes'>: 0.05}
    """
    errors = {}
    for text in as_texts("error", error):
        name, _, number = text.partition("=")
        target = chosen(Target, "error", name)
        errors[target] = number_in(number)
        if not 0.0 < errors[target] < np.inf:
            raise UsageError(Field("error"), f" {text!r}: expected a number > 0, as in pushes=0.05")
        if target not in targets:
            known = ", ".join(targets)
            raise UsageError(Field("error"), f" {text!r}: not fitted; {Field('target')} is {known}")
    return errors
