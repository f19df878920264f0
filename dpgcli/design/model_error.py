"""What is known of the model's own error, by law, lever and calibration.

The numbers are those of `dpg compare` on the shipped finite-element finger; see the manual.
"""

from collections.abc import Sequence

import numpy as np

from dpgcli.design.calibrations import Calibration
from dpgcli.design.dimensions import Design, agree
from dpgcli.design.rules import Value
from dpgcli.design.scene import ORIGINS, UNKNOWN, ModelError, Origin
from dpgcli.mechanics.finger import STUDY

GEOMETRIC_LEVER = (
    "shapes curl 13–24 % too far against finite elements{where}; calibrate: dpg help calibration"
)
COMPARED_LAWS = (None, "published", "push_only")
MOVED = [ORIGINS.index(origin) for origin in (Origin.SCALED, Origin.EXTRAPOLATED)]


def known_model_error(design: Design, lever: Value | None, values: Sequence[Value]) -> ModelError:
    """What is known: what the spec says, else a calibration, else of the law and its lever.

    `lever` is the segment height, `values` are all values of the lattice.
    """
    if isinstance(design.model_error, float):
        percent = 100.0 * design.model_error
        return ModelError(
            f"{percent:.3g} % of the deflection, as the spec says", design.model_error
        )
    for place, calibration in enumerate(design.calibrations):
        own = [value for value in values if value.file == place]
        if own and isinstance(calibration, Calibration) and calibration.leave_one_out is not None:
            return _left_out(calibration, own)
    if design.law in COMPARED_LAWS and lever is not None:
        return _of_lever(lever)
    return UNKNOWN


def _left_out(calibration: Calibration, own: Sequence[Value]) -> ModelError:
    """The errors of states that a fit has not seen, as its calibration says."""
    assert calibration.leave_one_out is not None, "the calibration has them"
    rms, largest = (f"{100.0 * error:.2g} %" for error in calibration.leave_one_out)
    text = (
        f"states that {calibration.file} was not fitted to are off by {rms} of the deflection "
        f"(rms), {largest} at most"
    )
    if np.isin([value.origin[0] for value in own], MOVED).any():
        text += ", at the geometry of the fit, which is another"
    return ModelError(text, calibration.leave_one_out[0])


def _of_lever(lever: Value) -> ModelError:
    """The finding about the geometric lever; it was made at the study's."""
    is_study_s = bool(agree(lever.numbers, np.array([STUDY["segment_height"]]))[0])
    is_derived = ORIGINS[int(lever.origin[0])] is Origin.DERIVED
    if is_study_s:
        return ModelError(GEOMETRIC_LEVER.format(where=""))
    if is_derived:
        return ModelError(GEOMETRIC_LEVER.format(where=" (at the study's dimensions)"))
    return UNKNOWN
