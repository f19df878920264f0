"""Dead loads of a design: values by key, which way gravity goes, and what is wrong with them."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import partial

import numpy as np

from dpgcli.arrays import Array
from dpgcli.design.problems import Issue, Problems, number, of_design
from dpgcli.records import dataclass
from dpgcli.text import KeyPath

GRAVITY = 9.80665e-3  # N/g, the standard acceleration of free fall
LOADS: KeyPath = ("loads",)
FORCES = ("tip_force_x_N", "tip_force_y_N")
MOMENT, MASS, DIRECTION = "tip_moment_N_mm", "unit_mass_g", "gravity_direction"
DOWN = (-1.0, 0.0)  # of a finger that points up
DIRECTIONS = {"x": (1.0, 0.0), "-x": DOWN, "y": (0.0, 1.0), "-y": (0.0, -1.0)}
NEARLY_NONE = 1e-9  # of a direction: what rounding leaves of a right angle


@dataclass(frozen=True)
class GivenLoads:
    """What a spec says of dead loads: values by key, (design,) or (1,); masses (g) also by unit.

    `direction` is that of gravity, of any length: in the finger's frame, or in the gripper's.
    """

    values: Mapping[str, Array] = field(default_factory=dict)
    masses: Sequence[float] = ()
    direction: tuple[float, float] = DOWN

    def with_value(self, key: str, column: Array) -> "GivenLoads":
        """With values of designs at a key."""
        masses = () if key == MASS else self.masses
        return replace(self, values={**self.values, key: column}, masses=masses)

    @property
    def mass(self) -> Array:
        """The mass of each unit, g, (1 or unit, 1 or design)."""
        if self.masses:
            return np.array(self.masses, float)[:, None]
        return self.values.get(MASS, np.zeros(1))[None]

    def act(self, design: int) -> bool:
        """Whether one design bears any load."""
        mass = bool(np.any(self.mass[:, design if self.mass.shape[1] > 1 else 0]))
        return mass or any(of_design(self.values[key], design) for key in self.values)

    @property
    def along(self) -> tuple[float, float]:
        """The direction of gravity, of length 1.

        >>> GivenLoads(direction=(0.0, -2.0)).along
        (0.0, -1.0)
        """
        x, y = (part / math.hypot(*self.direction) for part in self.direction)
        return x if abs(x) > NEARLY_NONE else 0.0, y if abs(y) > NEARLY_NONE else 0.0

    def arrays(self, mounting_angle: Array) -> dict[str, Array]:
        """The loads of a finger by the names of its fields, (1 or unit, 1 or design).

        The angle (rad, (1 or design,)) is that by which the finger is turned in the frame of the
        direction: 0 of one without a gripper. A couple that turns the tip to the left closes gaps.

        >>> found = GivenLoads({MASS: np.array([100.0])}).arrays(np.array([0.5 * np.pi]))
        >>> print(found["unit_weight"].round(4), found["gravity_y"].round(4))  # N; turned up by 90°
        [[0.9807]] [[1.]]
        """
        none = np.zeros(1)
        x, y = self.along
        cos, sin = np.cos(mounting_angle), np.sin(mounting_angle)
        force_x, force_y = (self.values.get(key, none)[None] for key in FORCES)
        return {
            "tip_force_x": force_x,
            "tip_force_y": force_y,
            "end_moment": -self.values.get(MOMENT, none)[None],
            "unit_weight": GRAVITY * self.mass,
            "gravity_x": (cos * x + sin * y)[None],
            "gravity_y": (cos * y - sin * x)[None],
        }


def direction_text(along: tuple[float, float]) -> str:
    """A direction of length 1 as specs have it.

    >>> direction_text((-1.0, 0.0)), direction_text((0.6, -0.8))
    ('-x', '[0.6, -0.8]')
    """
    words = {way: word for word, way in DIRECTIONS.items()}
    return words.get(along, "[{:.4g}, {:.4g}]".format(*along))


def load_issues(given: GivenLoads, n_units: int) -> Iterator[Issue]:
    """What is wrong between loads and the number of units."""
    if given.masses and len(given.masses) != n_units:
        expected = f"one mass in g, or {n_units}: one for each unit"
        yield Issue((*LOADS, MASS), expected, f"{len(given.masses)} masses")


def check_across(given: GivenLoads, problems: Problems) -> None:
    """Note where gravity acts across a gripper: then its fingers are no mirror images."""
    if not given.along[1]:
        return
    mass = given.mass.max(axis=0)
    problems.add(np.asarray(mass > 0.0), partial(_across, mass))


def _across(mass: Array, design: int) -> Issue:
    return Issue(
        (*LOADS, DIRECTION),
        "-x or x: along the gripper, so that its fingers stay mirror images",
        f"a part across it, with {number(of_design(mass, design))} g a unit",
        "leave out gripper: and predict each finger by itself, gravity as that finger sees it",
    )
