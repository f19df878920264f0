"""The keys of a spec, their types and their meaning.

A section or value that is null counts as absent.
"""

import re
from typing import Annotated, Literal

from pydantic import ConfigDict, Field, JsonValue
from pydantic.json_schema import SkipJsonSchema

from dpgcli.files.calibration.models import Calibration
from dpgcli.files.sections import (
    BarStiffness,
    Geometry,
    Lattice,
    Positive,
    Section,
    UnitGeometry,
    UnitLattice,
)

BARS: list[JsonValue] = [{"required": ["linear_stiffness_N_per_mm"]}, {"required": ["calibration"]}]
Read = SkipJsonSchema[Calibration]  # in the place of a file's name once the file is read
MAX_UNITS = 64
UNIT_RANGE = re.compile(r"([0-9]{1,4})(?: *- *([0-9]{1,4}))?")


class UnitOverride(Section):
    """What is different in some units."""

    geometry: UnitGeometry | None = Field(default=None, description="Dimensions of these units.")
    lattice: UnitLattice | None = Field(default=None, description="Lattice values of these units.")


class FingerSpec(Section):
    """One finger."""

    model_config = ConfigDict(json_schema_extra={"anyOf": BARS})

    units: Annotated[int, Field(ge=1, le=MAX_UNITS)] = Field(
        description="Number of units, 1 to 64, counted from the base."
    )
    linear_stiffness_N_per_mm: BarStiffness | None = Field(
        default=None,
        description="Stiffness k_L of every bar, in N/mm; .inf makes the bars rigid.",
    )
    calibration: str | Read | list[str | Read] | None = Field(
        default=None,
        description="Where values come from that the lattice section leaves out: published, "
        "a file of dpg fit, or a list of these, the first that has a value giving it.",
    )
    law: Literal["published", "tabulated", "push_only"] | None = Field(
        default=None,
        description="How domes answer to their opening: published unless given otherwise.",
    )
    geometry: Geometry | None = Field(default=None, description="Dimensions of all units.")
    lattice: Lattice | None = Field(default=None, description="Lattice values of all units.")
    overrides: dict[str, UnitOverride | None] | None = Field(
        default=None,
        description='Differences by unit ("4") or range of units ("4-5"), counted from the base.',
        json_schema_extra={"propertyNames": {"pattern": f"^{UNIT_RANGE.pattern}$"}},
    )


class GripperSpec(Section):
    """Two mirrored fingers."""

    base_spacing_mm: Positive = Field(
        description="Distance between the base stations of the two fingers, in mm."
    )
    mounting_angle_deg: Annotated[float, Field(ge=-90, le=90)] = Field(
        default=0.0, description="Outward tilt of each finger at its base, in degrees."
    )


class Spec(Section):
    """A finger, and the gripper made of two of them."""

    finger: FingerSpec = Field(description="The finger.")
    gripper: GripperSpec | None = Field(default=None, description="The gripper, if there is one.")
