"""A scene: the finger or gripper of a spec in the model's terms; origins of its numbers."""

from collections.abc import Mapping
from enum import StrEnum

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.design.bodies import Body, Friction
from dpgcli.design.loads import DOWN
from dpgcli.design.outputs import Trust
from dpgcli.design.pressure import Pressure
from dpgcli.mechanics.finger import Finger
from dpgcli.records import dataclass


class Origin(StrEnum):
    """How a lattice value came about, from the most to the least trusted."""

    GIVEN = "given"
    DERIVED = "derived"
    CALIBRATED = "calibrated"
    INTERPOLATED = "interpolated"
    SCALED = "scaled"
    EXTRAPOLATED = "extrapolated"
    ASSUMED = "assumed"


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


FITTED = "fitted_values"
MODEL = "model_error"


@dataclass(frozen=True)
class Step:
    """One standard uncertainty of one value, and by how much it changes what depends on it.

    `cause` is the value's key, or `FITTED` of a calibration's; `size` says how large it is.
    `finger` has the changes of the finger's arrays by name, each (1 or unit, 1 or design); the
    others are those of the gripper's base spacing (mm) and mounting angle (rad), and of the
    limiting layer's thickness (mm), numbers or (design,).
    """

    cause: str
    finger: Mapping[str, Array]
    base_spacing: float | Array = 0.0
    mounting_angle: float | Array = 0.0
    layer_thickness: float | Array = 0.0
    size: str = ""


@dataclass(frozen=True)
class Uncertainty:
    """What values may be off by, and the model.

    `covariance` (step, step) of multiples of the `steps`. `model_error` is the standard uncertainty
    of the model itself: of a tip's place as a share of its deflection, of its angle as a share of
    that angle; 0 where it is left out.
    """

    steps: tuple[Step, ...]
    covariance: Array
    model_error: float = 0.0

    @property
    def causes(self) -> tuple[str, ...]:
        """What it counts in, each once."""
        model = (MODEL,) if self.model_error else ()
        return (*dict.fromkeys(step.cause for step in self.steps), *model)

    @property
    def covers(self) -> str:
        """What it counts in, and what not, in words.

        >>> Uncertainty((Step("stroke_mm", {}), Step(FITTED, {})), np.eye(2)).covers
        'fitted values, tolerance of stroke_mm; without the model error'
        """
        keys = [cause for cause in self.causes if cause not in (FITTED, MODEL)]
        parts = ["fitted values"] if FITTED in self.causes else []
        listed = " and ".join([", ".join(keys[:-1]), keys[-1]] if keys[1:] else keys)
        parts += [f"tolerance{'s' * (len(keys) > 1)} of {listed}"] if keys else []
        if self.model_error:
            return f"{', '.join([*parts, ''])}model error of {100.0 * self.model_error:.3g} %"
        return f"{', '.join(parts)}; without the model error"


@dataclass(frozen=True)
class ModelError:
    """What is known of the model's own error, in words, and as a share of the deflection.

    The `share` is a root mean square, None where there is no number.
    """

    text: str
    share: float | None = None


UNKNOWN = ModelError(
    "unknown for this law and these values; dpg compare finds it: dpg help accuracy"
)


@dataclass(frozen=True)
class Gripper:
    """Two mirrored fingers: distance of their B_0 (mm) and outward tilt of each (rad).

    Numbers, or arrays by design or state where each has a gripper of its own.
    """

    base_spacing: float | Array
    mounting_angle: float | Array


class Held(StrEnum):
    """How a body is held while fingers meet it."""

    FIXED = "fixed"
    GUIDED = "guided"  # along x
    FREE = "free"


@dataclass(frozen=True)
class Chambers:
    """Sizes (mm) of a finger's chambers that its lattice does not have, NaN where none is known.

    Each is (1 or unit, design): the gap to the next chamber, the inner width, the height of the
    dome. They are for pictures.
    """

    gap: Array
    width: Array
    dome_height: Array


@dataclass(frozen=True)
class Scene:
    """A finger, its gripper if any, and the thickness (mm) of its limiting layer if known.

    Of a batch of fingers gripper and thickness are arrays by design. `uncertainty` is that of
    fitted values, of tolerances and of the model, as far as there are any; `model_error` is what
    is known of the last; `chambers` are those of a finger given by its geometry. `trusts` say what
    its outputs rest on, `warnings` are those of the calibrations in use; none of mere values.
    `pressure`, `body` and its `friction` are None where the spec says nothing of them; the body is
    `held` so. `gravity` is the direction in which it acts, of length 1.
    """

    finger: Finger
    sources: tuple[Source, ...]
    gripper: Gripper | None = None
    layer_thickness: float | Array | None = None
    uncertainty: Uncertainty | None = None
    model_error: ModelError = UNKNOWN
    chambers: Chambers | None = None
    trusts: tuple[Trust, ...] = ()
    warnings: tuple[str, ...] = ()
    pressure: Pressure | None = None
    body: Body | None = None
    held: Held = Held.FIXED
    friction: Friction | None = None
    gravity: tuple[float, float] = DOWN

    def take_lanes(self, index: Indices) -> "Scene":
        """Some designs of a batch, without what is said of a single one."""
        gripper, thickness = self.gripper, self.layer_thickness
        if gripper is not None:
            gripper = Gripper(*(np.take(values, index) for values in vars(gripper).values()))
        layer = None if thickness is None else np.take(thickness, index)
        pressure = self.pressure and self.pressure.take_lanes(index)
        body = self.body and self.body.take_lanes(index)
        return Scene(
            self.finger.take_lanes(index),
            (),
            gripper,
            layer,
            pressure=pressure,
            body=body,
            held=self.held,
            friction=self.friction and self.friction.take_lanes(index),
            gravity=self.gravity,
        )
