"""Sections that specs and calibration files share: a finger's geometry and its lattice.

Units are part of each key's name.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from dpgcli.design.dimensions import LARGEST, SMALLEST, STIFFEST, check_widths
from dpgcli.design.problems import Issue, Problems

EXPECTED = {  # where it is not a length
    "linear_stiffness_N_per_mm": "a stiffness > 0 in N/mm, or .inf",
    "wall_compliance_mm_per_N": "a compliance >= 0 in mm/N",
    "hinge_coupling_N_mm_per_rad": "a number in N mm/rad, less than half the hinge stiffness",
    "force_linearity": "a number from 0 to 1",
    "hinge_stiffness_N_mm_per_rad": "a stiffness >= 0 in N mm/rad",
    "bistable_stiffness_N_per_mm": "a stiffness > 0 in N/mm",
    "elastic_modulus_MPa": "a modulus > 0 in MPa",
    "effective_area_mm2": "an area > 0 in mm2",
    "snap_pressure_MPa": "a pressure > 0 in MPa",
}


def wrong_width(sizes: Mapping[str, float]) -> Issue | None:
    """The problem, if unit_cell_mm contradicts chamber_width_mm."""
    problems = Problems()
    check_widths({key: np.array([size]) for key, size in sizes.items()}, problems)
    return next(iter(problems.of(0)), None)


def expected_of(key: str) -> str:
    """The values that a key of the geometry or the lattice can have, in words."""
    return EXPECTED.get(key, "a length > 0 in mm")


def _spelled_out(value: object) -> object:
    """Infinity where it is a text: JSON, in which tables keep their spec, has no number for it."""
    return math.inf if value == ".inf" else value


def _rigid_or_bounded(value: float) -> float:
    if value > STIFFEST and not math.isinf(value):
        raise ValueError("out of range")
    return value


Bounded = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(ge=SMALLEST, le=LARGEST)]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST)]
Fraction = Annotated[float, Field(ge=0, le=1)]
BarStiffness = Annotated[
    float,
    Field(ge=SMALLEST, allow_inf_nan=True),
    BeforeValidator(_spelled_out),
    AfterValidator(_rigid_or_bounded),
]


class Section(BaseModel):
    """A mapping whose keys are all known."""

    model_config = ConfigDict(
        strict=True, frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True
    )

    def given(self) -> dict[str, Any]:
        """The values that there are, by key."""
        fields = type(self).model_fields
        return {key: value for key in fields if (value := getattr(self, key)) is not None}


class UnitGeometry(Section):
    """Dimensions that may differ between the units of a finger."""

    dome_height_mm: Positive | None = Field(
        default=None, description="Height h of the dome at rest, in mm."
    )
    dome_thickness_mm: Positive | None = Field(
        default=None, description="Thickness t of the dome, in mm."
    )
    chamber_length_mm: Positive | None = Field(
        default=None, description="Inner length L_c of a chamber along the finger, in mm."
    )
    channel_width_mm: Positive | None = Field(
        default=None, description="Width W_ch of the strip that bends between chambers, in mm."
    )
    unit_separation_mm: Positive | None = Field(
        default=None, description="Gap s between neighboring chambers, in mm."
    )
    elastic_modulus_MPa: Positive | None = Field(
        default=None, description="Young's modulus E of the material, in MPa."
    )


class Geometry(UnitGeometry):
    """Dimensions of the molded finger."""

    unit_cell_mm: Positive | None = Field(
        default=None, description="Outer width UC of a unit in mm: chamber plus two 1 mm walls."
    )
    chamber_width_mm: Positive | None = Field(
        default=None, description="Inner width W_c of a chamber, in mm; unit_cell_mm less 2 mm."
    )
    limiting_layer_thickness_mm: Positive | None = Field(
        default=None, description="Thickness t_L of the limiting layer, in mm."
    )


class UnitLattice(Section):
    """Lattice values that may differ between the units of a finger."""

    segment_length_mm: Positive | None = Field(
        default=None, description="Length L of a segment, in mm."
    )
    stroke_mm: Positive | None = Field(
        default=None, description="Opening d of an inverted dome, in mm."
    )
    bistable_stiffness_N_per_mm: Positive | None = Field(
        default=None, description="Stiffness k_b of the bistable spring at rest, in N/mm."
    )
    force_linearity: Fraction | None = Field(
        default=None,
        description="Force linearity alpha, without unit: 0 symmetric wells, 1 a linear spring.",
    )
    hinge_stiffness_N_mm_per_rad: NotNegative | None = Field(
        default=None, description="Stiffness k_theta of the hinge of a unit, in N mm/rad."
    )


class Lattice(UnitLattice):
    """Lattice values given instead of derived; where geometry yields them too, they must agree."""

    segment_height_mm: Positive | None = Field(
        default=None, description="Height H of the struts in mm, shared by all units."
    )
