"""The keys of a spec's object, their types and their meaning."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from dpgcli.design.bodies import PLACES, Disc
from dpgcli.files.calibration.models import Bounded
from dpgcli.files.sections import Positive, Section

PLACE = "at_mm"
EXPECTED = {
    PLACE: "two numbers in mm, such as [40, 0]",
    **dict.fromkeys(PLACES, "a number in mm"),
    "held": '"fixed", "guided" (moves along x) or "free"',
}


class DiscSpec(Section):
    """A round body."""

    diameter_mm: Positive = Field(description="Its diameter, in mm.")


class ObjectSpec(Section):
    """A body between the fingers, for dpg grasp."""

    disc: DiscSpec = Field(description="A round body, such as a can.")
    at_mm: Annotated[list[Bounded], Field(min_length=2, max_length=2)] = Field(
        description="Where its center is in the gripper's frame, in mm: between the bases, x along "
        "the fingers; of a finger alone in its own frame."
    )
    at_x_mm: Bounded | None = Field(
        default=None, description="Its part along x, in mm, instead of that in at_mm."
    )
    at_y_mm: Bounded | None = Field(
        default=None, description="Its part along y, in mm, instead of that in at_mm."
    )
    held: Literal["fixed", "guided", "free"] = Field(
        default="fixed",
        description="How it is held: fixed, guided (it moves along x only), or free.",
    )

    @property
    def known(self) -> Disc:
        """The value that it stands for."""
        own = (self.at_x_mm, self.at_y_mm)
        at = [said if part is None else part for said, part in zip(self.at_mm, own, strict=True)]
        return Disc(np.array(at, float), 0.5 * self.disc.diameter_mm)
