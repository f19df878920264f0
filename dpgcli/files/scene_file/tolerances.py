"""What the values of a spec, and the model, may be off by: keys, types and meaning."""

import math
import re
from typing import Annotated, Any

from pydantic import AfterValidator, WithJsonSchema

from dpgcli.design.dimensions import LARGEST, LEAVE_ONE_OUT, Tolerance
from dpgcli.files.sections import Section
from dpgcli.text import is_number

PERCENTAGE = re.compile(r"([0-9]{1,9}(?:\.[0-9]{1,9})?) ?%")
PERCENT: dict[str, Any] = {"type": "string", "pattern": f"^{PERCENTAGE.pattern}$"}
NOTHING: dict[str, Any] = {"type": "null"}


def share_of(value: object) -> float | None:
    """A percentage up to 100 % as a share; None for anything else.

    >>> share_of("10%"), share_of("101 %"), share_of(0.1)
    (0.1, None, None)
    """
    match = PERCENTAGE.fullmatch(value) if isinstance(value, str) else None
    if match is None or float(match[1]) > 100.0:
        return None
    return float(match[1]) / 100.0


def beyond(value: object) -> str:
    """The bound that a number, one of a list of them or a percentage is beyond, in words.

    >>> beyond("200%"), beyond([0, -1.1e16]), beyond(".nan")
    ('at most 100%', 'at most 1e+12 in size', '')
    """
    if isinstance(value, str):
        match = PERCENTAGE.fullmatch(value)
        return "at most 100%" if match is not None and float(match[1]) > 100.0 else ""
    numbers = value if isinstance(value, list) else [value]
    is_beyond = (
        isinstance(part, int | float) and LARGEST < abs(part) < math.inf for part in numbers
    )
    return f"at most {LARGEST:g} in size" if any(is_beyond) else ""


def _tolerance(value: object) -> object:
    is_size = is_number(value) and 0.0 <= value <= LARGEST
    if value is not None and not is_size and share_of(value) is None:
        raise ValueError("no standard uncertainty")
    return value


def _model_error(value: object) -> object:
    if value not in (None, LEAVE_ONE_OUT) and not share_of(value):
        raise ValueError("no model error")
    return value


Tolerated = Annotated[
    Any,
    AfterValidator(_tolerance),
    WithJsonSchema(
        {
            "description": "In the key's unit, or a percentage of its value such as 10%.",
            "anyOf": [{"type": "number", "minimum": 0}, PERCENT, NOTHING],
        }
    ),
]
ModelErrorSpec = Annotated[
    Any,
    AfterValidator(_model_error),
    WithJsonSchema({"anyOf": [{"const": LEAVE_ONE_OUT}, PERCENT, NOTHING]}),
]


class Tolerances(Section):
    """Standard uncertainties by key, each the same error in all units."""

    dome_height_mm: Tolerated = None
    dome_thickness_mm: Tolerated = None
    chamber_length_mm: Tolerated = None
    channel_width_mm: Tolerated = None
    unit_separation_mm: Tolerated = None
    elastic_modulus_MPa: Tolerated = None
    unit_cell_mm: Tolerated = None
    chamber_width_mm: Tolerated = None
    limiting_layer_thickness_mm: Tolerated = None
    segment_length_mm: Tolerated = None
    segment_height_mm: Tolerated = None
    stroke_mm: Tolerated = None
    bistable_stiffness_N_per_mm: Tolerated = None
    force_linearity: Tolerated = None
    hinge_stiffness_N_mm_per_rad: Tolerated = None
    linear_stiffness_N_per_mm: Tolerated = None
    wall_compliance_mm_per_N: Tolerated = None
    hinge_coupling_N_mm_per_rad: Tolerated = None
    base_spacing_mm: Tolerated = None
    mounting_angle_deg: Tolerated = None

    @property
    def by_key(self) -> dict[str, Tolerance]:
        """Those that are given."""
        return {key: _of(value) for key, value in self.given().items()}


def _of(value: Any) -> Tolerance:
    share = share_of(value)
    return Tolerance(float(value), False) if share is None else Tolerance(share, True)
