"""The keys of a spec, their types and their meaning.

A section or value that is null counts as absent.
"""

from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, PlainSerializer, SerializationInfo
from pydantic.json_schema import SkipJsonSchema

from dpgcli.design import dimensions
from dpgcli.design.calibrations import Calibration as Known
from dpgcli.design.dimensions import MAX_UNITS, UNIT_RANGE, WALL_COMPLIANCE, Design
from dpgcli.design.resolve import Resolution, resolve
from dpgcli.design.scene import Held
from dpgcli.files.scene_file.loads import LoadsSpec
from dpgcli.files.scene_file.objects import ObjectSpec
from dpgcli.files.scene_file.pressure import PressureSpec
from dpgcli.files.scene_file.tolerances import ModelErrorSpec, Tolerances, share_of
from dpgcli.files.sections import (
    BarStiffness,
    Bounded,
    Geometry,
    Lattice,
    NotNegative,
    Positive,
    Section,
    UnitGeometry,
    UnitLattice,
)

if TYPE_CHECKING:
    from dpgcli.files.calibration.models import Calibration


def _read(value: object) -> "Calibration | None":
    if value is None:
        return None
    from dpgcli.files.calibration.models import Calibration  # few specs name one

    return Calibration.model_validate(value)


def _written(value: "Calibration | None", info: SerializationInfo) -> dict[str, Any] | None:
    return None if value is None else value.model_dump(exclude_none=info.exclude_none)


# In the place of a file's name once the file is read.
Read = SkipJsonSchema[Annotated[Any, AfterValidator(_read), PlainSerializer(_written)]]

WallCompliance = NotNegative | None


class UnitOverride(Section):
    """Values of some units that differ from the finger's."""

    wall_compliance_mm_per_N: WallCompliance = Field(
        default=None, description="How far walls of these units give way, in mm/N."
    )
    geometry: UnitGeometry | None = Field(default=None, description="Dimensions of these units.")
    lattice: UnitLattice | None = Field(default=None, description="Lattice values of these units.")


class FingerSpec(Section):
    """One finger."""

    units: Annotated[int, Field(ge=1, le=MAX_UNITS)] = Field(
        description="Number of units, 1 to 64, counted from the base."
    )
    linear_stiffness_N_per_mm: BarStiffness | None = Field(
        default=None,
        description="Stiffness k_L of every bar, in N/mm: 1e4 unless given or calibrated; "
        ".inf makes the bars rigid.",
    )
    wall_compliance_mm_per_N: WallCompliance = Field(
        default=None,
        description="How far the wall that a dome pushes against gives way, c_w in mm/N: 0, rigid "
        "walls, unless given or calibrated.",
    )
    hinge_coupling_N_mm_per_rad: Bounded | None = Field(
        default=None,
        description="By how much hinges turn their neighbors, kappa in N mm/rad, less than half "
        "the hinge stiffness: 0 unless given or calibrated.",
    )
    calibration: str | list[str | Read] | Read | None = Field(
        default=None,
        description="Where values come from that the lattice section leaves out: published, "
        "finite_elements (with law: push_only, unless given), a file of dpg fit, or a list of "
        "these, the first that has a value giving it.",
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

    @property
    def calibrations(self) -> tuple[str | Known, ...]:
        """Its calibrations, in order."""
        said = self.calibration if isinstance(self.calibration, list) else [self.calibration]
        parts = (part for part in said if part is not None)
        return tuple(p if isinstance(p, str) else p.known for p in parts)


class GripperSpec(Section):
    """Two mirrored fingers."""

    base_spacing_mm: Positive = Field(
        description="Distance between the base stations of the two fingers, in mm."
    )
    mounting_angle_deg: Annotated[float, Field(ge=-90, le=90)] = Field(
        default=0.0, description="Outward tilt of each finger at its base, in degrees."
    )


Place = Annotated[list[Bounded], Field(min_length=2, max_length=2)]


class DataSpec(Section):
    """Where the lattice lies in known states: the frame of data about this finger."""

    first_station_mm: Place | None = Field(
        default=None, description="The lattice's first node in the data, x and y in mm."
    )
    tip_offset_mm: Place | None = Field(
        default=None,
        description="The data's tip from the last node: along the end phalanx and to its left, "
        "in mm.",
    )


class Spec(Section):
    """A finger, and the gripper made of two of them."""

    finger: FingerSpec = Field(description="The finger.")
    gripper: GripperSpec | None = Field(default=None, description="The gripper, if there is one.")
    pressure: PressureSpec | None = Field(
        default=None, description="The pressure lines and how domes answer to pressure."
    )
    loads: LoadsSpec | None = Field(default=None, description="Dead loads and gravity.")
    object: ObjectSpec | None = Field(
        default=None, description="A body between the fingers, for dpg grasp."
    )
    uncertainty: Tolerances | None = Field(
        default=None, description="Standard uncertainties of values, as tolerances of the mold."
    )
    model_error: ModelErrorSpec = Field(
        default=None,
        description="Standard uncertainty of the model itself: a percentage of the deflection, or "
        "leave_one_out, that of the calibration.",
    )
    data: DataSpec | None = Field(default=None, description="The frame of data about the finger.")

    @cached_property
    def resolution(self) -> Resolution:
        """The lattice behind it, and what is wrong between its keys; found once."""
        return resolve(self.design)

    @property
    def design(self) -> Design:
        """The spec as a batch of one design."""
        finger = self.finger
        bars = finger.linear_stiffness_N_per_mm
        coupling = finger.hinge_coupling_N_mm_per_rad
        said = self.model_error
        return Design(
            finger.units,
            _section(finger),
            {units: _section(own) for units, own in (finger.overrides or {}).items()},
            None if bars is None else np.array([bars], float),
            finger.calibrations,
            finger.law,
            _sizes(self.gripper),
            tolerances={} if self.uncertainty is None else self.uncertainty.by_key,
            model_error=said if (share := share_of(said)) is None else share,
            pressure=None if self.pressure is None else self.pressure.known,
            hinge_coupling=None if coupling is None else np.array([coupling], float),
            loads=None if self.loads is None else self.loads.known,
            body=None if self.object is None or self.object.issues else self.object.known,
            held=Held.FIXED if self.object is None else Held(self.object.held),
            friction=None if self.object is None else self.object.known_friction,
        )


def _section(part: UnitOverride | FingerSpec | None) -> dimensions.GivenValues:
    if part is None:
        return dimensions.GivenValues()
    lattice = _sizes(part.lattice)
    if part.wall_compliance_mm_per_N is not None:
        lattice[WALL_COMPLIANCE] = np.array([part.wall_compliance_mm_per_N], float)
    return dimensions.GivenValues(_sizes(part.geometry), lattice)


def _sizes(section: Section | None) -> dict[str, NDArray[np.float64]]:
    given = {} if section is None else section.given()
    return {key: np.array([value], float) for key, value in given.items()}
