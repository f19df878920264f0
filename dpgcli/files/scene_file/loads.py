"""The keys of a spec's dead loads, their types and their meaning."""

from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, WithJsonSchema

from dpgcli.design.dimensions import LARGEST
from dpgcli.design.loads import DIRECTION, DIRECTIONS, DOWN, FORCES, MASS, MOMENT, GivenLoads
from dpgcli.files.sections import Bounded, Section
from dpgcli.text import is_number

TIP_FORCE = "tip_force_N"
EXPECTED = {
    TIP_FORCE: "two numbers in N, along x and along y, such as [0, -0.1]",
    **dict.fromkeys(FORCES, "a number in N"),
    MOMENT: "a number in N mm",
    MASS: "a mass >= 0 in g, or a list of one for each unit",
    DIRECTION: '"-x", "x", "-y", "y", or two numbers that are not both zero, such as [0.6, -0.8]',
}
TwoNumbers = Annotated[list[Bounded], Field(min_length=2, max_length=2)]
NUMBER = {"type": "number", "minimum": -LARGEST, "maximum": LARGEST}
MASS_SCHEMA = {"type": "number", "minimum": 0, "maximum": LARGEST}
NOTHING = {"type": "null"}


def _direction(said: Any) -> Any:
    """One of the words, or a vector with a direction."""
    if said is None or (isinstance(said, str) and said.removeprefix("+") in DIRECTIONS):
        return said
    are_two = isinstance(said, list) and len(said) == 2
    if not are_two or not all(_is_number(part) for part in said) or not any(said):
        raise ValueError("no direction")
    return [float(part) for part in said]


def _masses(said: Any) -> Any:
    parts = said if isinstance(said, list) else [said]
    if said is not None and (not parts or not all(_is_number(p) and p >= 0 for p in parts)):
        raise ValueError("no mass")
    return said


def _is_number(said: Any) -> bool:
    return is_number(said) and abs(said) <= LARGEST


Masses = Annotated[
    Any,
    AfterValidator(_masses),
    WithJsonSchema({"anyOf": [MASS_SCHEMA, {"type": "array", "items": MASS_SCHEMA}, NOTHING]}),
]
GravityDirection = Annotated[
    Any,
    AfterValidator(_direction),
    WithJsonSchema(
        {
            "anyOf": [
                {"enum": [sign + axis for axis in "xy" for sign in ("", "+", "-")]},
                {"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 2},
                NOTHING,
            ]
        }
    ),
]


class LoadsSpec(Section):
    """Dead loads, which keep their size and direction."""

    tip_force_N: TwoNumbers | None = Field(
        default=None,
        description="Force on the tip, along x and along y of the finger's frame, in N.",
    )
    tip_force_x_N: Bounded | None = Field(
        default=None, description="Its part along x, in N, instead of that in tip_force_N."
    )
    tip_force_y_N: Bounded | None = Field(
        default=None, description="Its part along y, in N, instead of that in tip_force_N."
    )
    tip_moment_N_mm: Bounded | None = Field(
        default=None, description="Couple on the end phalanx, in N mm; a negative one curls it."
    )
    unit_mass_g: Masses = Field(
        default=None,
        description="Mass of each unit in g, or a list of one for each: its weight acts on the "
        "middle of the unit's chamber.",
    )
    gravity_direction: GravityDirection = Field(
        default=None,
        description="Where gravity acts to, in the finger's frame or in the gripper's: -x unless "
        "given, x, y, -y, or a vector of any length.",
    )

    @property
    def known(self) -> GivenLoads:
        """The value that designs are resolved with."""
        given = self.given()
        masses, said = given.pop(MASS, 0.0), given.pop(DIRECTION, None)
        values = dict(zip(FORCES, given.pop(TIP_FORCE, ()), strict=False)) | given
        direction = DIRECTIONS[said.removeprefix("+")] if isinstance(said, str) else said
        arrays = {key: np.array([value], float) for key, value in values.items()}
        if not isinstance(masses, list):
            arrays[MASS] = np.array([masses], float)
            masses = ()
        return GivenLoads(arrays, tuple(masses), tuple(direction or DOWN))
