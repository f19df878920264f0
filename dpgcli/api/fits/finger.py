"""`fit_finger`: lattice values from known states of a whole finger."""

from collections.abc import Sequence
from functools import partial

from dpgcli.api.fits.result import (
    NO_GEOMETRY,
    FitResult,
    GeometryInput,
    check_loss,
    fit_result,
    with_geometry,
)
from dpgcli.api.inputs import (
    Place,
    Settings,
    SpecInput,
    as_texts,
    check_resampling,
    chosen,
    files_of,
    frame_of,
    scene_input,
)
from dpgcli.calibration.choices import FITTED_BY_DEFAULT, Loss, Target
from dpgcli.calibration.finger import FingerFit
from dpgcli.calibration.fits import Fit
from dpgcli.errors import Field, UsageError
from dpgcli.files.calibration import DataFile
from dpgcli.files.calibration.results import finger_method, fitted, judged, quality_of
from dpgcli.files.csv_file import Tabular, name_of
from dpgcli.files.known_states import states_of
from dpgcli.reports.comparison import draw_fitted
from dpgcli.reports.fits import FINGER_UNITS, finger_summary, value_rows


def fit_finger(
    spec: SpecInput,
    states: Tabular,
    *,
    free: str | Sequence[str] = (FITTED_BY_DEFAULT,),
    target: str = "tips",
    settings: Settings = (),
    first_station: Place = None,
    tip_offset: Place = None,
    geometry: GeometryInput = None,
    loss: str = "linear",
    loss_scale: float | None = None,
    bootstrap: int = 0,
    seed: int = 0,
) -> FitResult[Fit]:
    """Fit lattice values, the same in all units, to "tips" or "angles" of known states.

    `states` has `pattern`, `tip_x_mm` and `tip_y_mm` or `tip_angle_rad`; see
    `files.known_states`. `first_station` is the lattice's first node in the data, `tip_offset`
    what the data call the tip, from the last node along the phalanx and to its left (mm), unless
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
    met = chosen(Target, "target", target)
    frame, _ = frame_of(given, known, first_station, tip_offset)
    keys = as_texts("free", free)
    if not keys:
        raise UsageError(Field("free"), ": expected one key or more")
    check_resampling(bootstrap, seed)
    study = FingerFit(base, known, frame, keys, met, weighted, loss_scale)
    found = study.fit(bootstrap, seed)
    name = name_of(states)
    source = DataFile(file=name, sha256=known.sha256, rows=known.patterns.shape[1])
    return fit_result(
        found,
        {
            **fitted(found, FINGER_UNITS[met], source, only_free=True),
            "quality": judged(study, quality_of(found, FINGER_UNITS[met])),
            "method": finger_method(study, found, bootstrap, seed),
            "geometry": where,
        },
        value_rows(found),
        partial(finger_summary, study, found),
        (*study.judgments(found), *(() if where else (NO_GEOMETRY,))),
        partial(draw_fitted, study, found, name),
        files=(*given.files, *files_of(states)),
    )
