"""A scene: the finger or gripper of a spec in the model's terms; origins of its numbers."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.mechanics.finger import Finger


class Origin(StrEnum):
    """How a lattice value came about, from the most to the least trusted."""

    GIVEN = "given"
    DERIVED = "derived"
    CALIBRATED = "calibrated"
    INTERPOLATED = "interpolated"
    SCALED = "scaled"
    EXTRAPOLATED = "extrapolated"


ORIGINS = tuple(Origin)


@dataclass(frozen=True)
class Source:
    """One lattice value, in its key's unit, of some units, written as in the spec ("1-5", "4").

    Its standard error, if it was fitted, is that of the calibration, scaled as the value.
    """

    key: str
    units: str
    value: float
    origin: Origin
    rule: str
    standard_error: float | None = None


@dataclass(frozen=True)
class Uncertainty:
    """Standard errors and correlations of fitted values.

    `covariance` (step, step) of steps along `directions`, which change the finger's arrays by the
    values given by name, each (1 or unit, 1).
    """

    directions: tuple[Mapping[str, Array], ...]
    covariance: Array


@dataclass(frozen=True)
class Gripper:
    """Two mirrored fingers: distance of their B_0 (mm) and outward tilt of each (rad).

    Numbers, or arrays by design or state where each has a gripper of its own.
    """

    base_spacing: float | Array
    mounting_angle: float | Array


@dataclass(frozen=True)
class Chambers:
    """Sizes (mm) of a finger's chambers that its lattice does not have, NaN where none is known.

    Each is (unit,), or (1,) for all: the gap to the next chamber, the inner width, the height of
    the dome. They are for pictures.
    """

    gap: Array
    width: Array
    dome_height: Array


@dataclass(frozen=True)
class Scene:
    """A finger, its gripper if any, and the thickness (mm) of its limiting layer if known.

    Of a batch of fingers gripper and thickness are arrays by design. `uncertainty` is that of
    fitted values, if any has an error; `chambers` are those of a finger given by its geometry.
    """

    finger: Finger
    sources: tuple[Source, ...]
    gripper: Gripper | None = None
    layer_thickness: float | Array | None = None
    uncertainty: Uncertainty | None = None
    chambers: Chambers | None = None

    def take_lanes(self, index: Indices) -> "Scene":
        """Some designs of a batch; sources, uncertainty and chambers are left out."""
        gripper, thickness = self.gripper, self.layer_thickness
        if gripper is not None:
            gripper = Gripper(*(np.take(values, index) for values in vars(gripper).values()))
        layer = None if thickness is None else np.take(thickness, index)
        return Scene(self.finger.take_lanes(index), (), gripper, layer)
