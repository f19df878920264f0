"""What is known of the model's own error, by law, segment height, walls and calibration.

The numbers are those of `dpg compare` on finite-element fingers; see the page trust of the manual.
"""

from collections.abc import Sequence

from dpgcli.design.calibrations import Calibration, KnownError
from dpgcli.design.dimensions import WALL_COMPLIANCE
from dpgcli.design.footing import ELSEWHERE, MOVED, DesignCase
from dpgcli.design.outputs import Basis
from dpgcli.design.problems import of_design
from dpgcli.design.rules import HINGE_STIFFNESS, SEGMENT_HEIGHT, Value
from dpgcli.design.scene import ORIGINS, UNKNOWN, ModelError

CURLED = "shapes curl 13–24 % too far against finite elements"
CALIBRATE = "calibrate: dpg help calibration"
WITH_HEIGHT = "shapes within 1–8 % of the deflection against finite elements"
WITH_WALLS = "shapes within 1–6 % of the deflection against finite elements"
WITH_BOTH = "shapes within 3–10 % of the deflection against finite elements"  # and a fitted height
THE_REST = (
    "pushes within about 10 %, inverted units' stiffness within 30 % (60 % if walls are fitted to "
    "shapes)"
)
FITTED_HEIGHT = "with a segment height fitted to them"
BESIDE_WALLS = ModelError(
    "unknown: the segment height was fitted beside walls that give way, which this finger lacks"
)
OTHER_WALLS = (
    "unknown for these walls; fitted ones bring shapes within 1–6 % of the deflection, pushes "
    "within about 10 % and inverted units' stiffness within 30 % of finite elements (60 % if they "
    "are fitted to shapes)"
)


def model_error_of(case: DesignCase) -> ModelError:
    """What is known: what the spec says, else a calibration, else of such fingers."""
    said = case.design.model_error
    if isinstance(said, float):
        return ModelError(f"{100.0 * said:.3g} % of the deflection, as the spec says", said)
    for place, file in enumerate(case.design.calibrations):
        own = [v for values in case.values.values() for v in values if v.file == place]
        if not own or not isinstance(file, Calibration) or not case.is_as_fitted(file):
            continue
        if file.leave_one_out is None and not case.is_pushed_by_curve:
            continue
        if file.shape_error is not None:
            return _left_out(file, file.shape_error, own, case.place)
    return _of_walls(case) if case.has_walls else _of_height(case)


def shapes_in(error: ModelError) -> str:
    """The part of what is known that is about shapes.

    >>> shapes_in(ModelError(f"{CURLED}; {CALIBRATE}")) == CURLED, shapes_in(UNKNOWN)
    (True, 'unknown')
    """
    if error.text.startswith("unknown"):
        return "unknown"
    text = error.text
    for rest in (CALIBRATE, THE_REST, FITTED_HEIGHT):
        text = text.removesuffix(f"; {rest}")
    return text


def _of_walls(case: DesignCase) -> ModelError:
    if case.pulls:
        return UNKNOWN
    if case.has_fitted_walls:
        shapes = WITH_WALLS if case.has_geometric_height else WITH_BOTH
        where = case.elsewhere(WALL_COMPLIANCE, HINGE_STIFFNESS.key, SEGMENT_HEIGHT.key)
        return ModelError(f"{shapes}{where}; {THE_REST}")
    return ModelError(OTHER_WALLS)


def _of_height(case: DesignCase) -> ModelError:
    """The finding about the geometric segment height was made at the study's."""
    height = case.footings[SEGMENT_HEIGHT.key]
    if case.pulls and case.domes.calibration is not None:
        return UNKNOWN
    if case.has_geometric_height:
        where = "" if case.is_study_s(SEGMENT_HEIGHT.key) else ELSEWHERE
        return ModelError(f"{CURLED}{where}; {CALIBRATE}")
    if height.basis is not Basis.FITTED:
        return UNKNOWN
    if height.calibration is not None and case.lacks_walls_of(height.calibration):
        return BESIDE_WALLS
    where = case.elsewhere(SEGMENT_HEIGHT.key)
    return ModelError(f"{WITH_HEIGHT}{where}; {FITTED_HEIGHT}")


def _left_out(file: Calibration, known: KnownError, own: Sequence[Value], place: int) -> ModelError:
    """The errors of states that a fit has not seen, or of others, as its calibration says."""
    rms = known.largest if known.rms is None else known.rms
    sizes = f"{100.0 * rms:.2g} % of the deflection (rms), {100.0 * known.largest:.2g} % at most"
    text = f"states that {file.source} was not fitted to are off by {sizes}"
    if known.against:
        text = f"shapes by {file.source} are off by {sizes}, against {known.against}"
    if any(ORIGINS[int(of_design(value.origin, place))] in MOVED for value in own):
        text += ", at the geometry of the fit, which is another"
    return ModelError(text, rms)
