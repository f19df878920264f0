"""The finger as the model sees it: lattice dimensions and spring constants."""

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from dpgcli.arrays import Array, Flags, Indices, total
from dpgcli.equilibrium.contracts import Response, take_lanes
from dpgcli.mechanics.laws import HELD, PUBLISHED, Dome, DomeLaw
from dpgcli.records import dataclass

ARRAYS = (
    "segment_length",
    "segment_height",
    "stroke",
    "bistable_stiffness",
    "force_linearity",
    "hinge_stiffness",
    "linear_stiffness",
    "dome_travel",
    "wall_compliance",
    "hinge_coupling",
)
SHARED = ("segment_height", "linear_stiffness", "hinge_coupling")  # by all units of a finger
LOADS = ("end_moment", "tip_force_x", "tip_force_y", "unit_weight")
GRAVITY = ("gravity_x", "gravity_y")
OPTIONAL = ("hinge_stiffness", "wall_compliance", "hinge_coupling", *LOADS, *GRAVITY)  # if not zero

KEYS = {  # names with units, as files say them
    "segment_length_mm": "segment_length",
    "segment_height_mm": "segment_height",
    "stroke_mm": "stroke",
    "bistable_stiffness_N_per_mm": "bistable_stiffness",
    "force_linearity": "force_linearity",
    "hinge_stiffness_N_mm_per_rad": "hinge_stiffness",
    "linear_stiffness_N_per_mm": "linear_stiffness",
    "wall_compliance_mm_per_N": "wall_compliance",
    "hinge_coupling_N_mm_per_rad": "hinge_coupling",
}


@dataclass(frozen=True)
class Finger:
    """A batch of fingers with the same number of units.

    Each array has shape (unit, design); an axis of length 1 means "the same for all",
    so that a uniform finger carries, and computes with, one value instead of n.

    - `segment_length` L and `segment_height` H: mm; H is shared by all struts of a finger
    - `stroke` d: mm, the opening of the inverted dome
    - `bistable_stiffness` k_b: N/mm; `force_linearity` α: 1
    - `hinge_stiffness` k_θ: N mm/rad, of one hinge (two corners in series)
    - `linear_stiffness` k_L: N/mm of every bar, infinite where bars are rigid
    - `wall_compliance` c_w: mm/N, of the walls that a dome pushes against; 0 where they are rigid
    - `hinge_coupling` κ: N mm/rad, of neighboring hinges, by which one that opens turns the other;
      between −k_θ/2 and k_θ/2, shared by all units
    - `dome_travel` D: mm, of the pole of the inverted dome at rest, where the law is of its own
      travel; 0 where the opening stands for it

    `acting` (unit, design) is the state of the domes, given beside the energy: 1 where a dome acts
    on its neighbor, 0 where it does not, a dome that only pushes and stands in its ground state.
    So is `branch`, the stretch of its curve that a dome which only pushes is on; see `laws.Dome`.
    `law` says how the domes answer.

    Dead loads: `end_moment` (1, design), N mm, is a couple on the end phalanx, a positive one opens
    the gaps; `tip_force_x` and `tip_force_y` (1, design), N, act on the tip; `unit_weight` (unit,
    design), N, acts on each unit's chamber along `gravity_x` and `gravity_y` (1, design).

    `kept` are parts of the energy that the batch has which this finger is taken from; see `parts`.
    """

    n_units: int
    segment_length: Array
    segment_height: Array
    stroke: Array
    bistable_stiffness: Array
    force_linearity: Array
    hinge_stiffness: Array
    linear_stiffness: Array
    dome_travel: Array = field(default_factory=lambda: np.zeros((1, 1)))
    wall_compliance: Array = field(default_factory=lambda: np.zeros((1, 1)))
    hinge_coupling: Array = field(default_factory=lambda: np.zeros((1, 1)))
    acting: Array = field(default_factory=lambda: np.ones((1, 1)))
    branch: Array = field(default_factory=lambda: np.zeros((1, 1)))
    end_moment: Array = field(default_factory=lambda: np.zeros((1, 1)))
    tip_force_x: Array = field(default_factory=lambda: np.zeros((1, 1)))
    tip_force_y: Array = field(default_factory=lambda: np.zeros((1, 1)))
    unit_weight: Array = field(default_factory=lambda: np.zeros((1, 1)))
    gravity_x: Array = field(default_factory=lambda: np.zeros((1, 1)))
    gravity_y: Array = field(default_factory=lambda: np.zeros((1, 1)))
    law: DomeLaw = PUBLISHED
    kept: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        for name, values in self.arrays().items():
            if values.ndim != 2 or values.shape[0] not in (1, self.n_units):
                raise ValueError(f"{name} has shape {values.shape}, not (1 or n_units, designs)")
        if any(getattr(self, name).shape[0] != 1 for name in SHARED):
            raise ValueError(f"{', '.join(SHARED)} are shared by all units")
        rigid = np.isinf(self.linear_stiffness)
        if rigid.any() and not rigid.all():
            raise ValueError("rigid and flexible bars cannot share a batch")

    def arrays(self) -> dict[str, Array]:
        """Every array by name, in the order of the fields."""
        return {name: getattr(self, name) for name in ARRAYS}

    def conditions(self) -> dict[str, Array]:
        """What a finger of these arrays is under, by name."""
        names = ("acting", "branch", *LOADS, *GRAVITY)
        return {name: getattr(self, name) for name in names}

    @cached_property
    def parts(self) -> frozenset[str]:
        """Arrays whose part of the energy is there: not zero throughout, or bars not all rigid.

        Coordinates and terms are laid out by these. Designs and units taken from a batch keep what
        the batch has, though theirs be zero: their coordinates are those of the batch.

        >>> unit = uniform_finger(1, **STUDY)
        >>> both = unit.changed(wall_compliance=np.array([[0.1, 0.0]]))
        >>> sorted(both.take_lanes(np.array([1])).parts)
        ['hinge_stiffness', 'wall_compliance']
        """
        own = {name for name in OPTIONAL if getattr(self, name).any()}
        if np.isfinite(self.linear_stiffness).any():
            own.add("linear_stiffness")
        return self.kept | own

    @property
    def is_loaded(self) -> bool:
        """Whether any dead load acts."""
        return not self.parts.isdisjoint(LOADS)

    @property
    def unloaded(self) -> "Finger":
        """The finger without dead loads.

        >>> uniform_finger(1, **STUDY).changed(end_moment=np.ones((1, 1))).unloaded.is_loaded
        False
        """
        return self.changed(**dict.fromkeys(LOADS, np.zeros((1, 1)))) if self.is_loaded else self

    def with_share_of_loads(self, share: float) -> "Finger":
        """The finger under a share of its dead loads."""
        return self.changed(**{name: share * getattr(self, name) for name in LOADS})

    @property
    def n_designs(self) -> int:
        """Number of fingers in the batch."""
        return int(np.broadcast_shapes(*(v.shape for v in self.arrays().values()))[1])

    @property
    def is_rigid(self) -> bool:
        """Whether all bars are rigid, k_L infinite."""
        return "linear_stiffness" not in self.parts

    @property
    def has_walls(self) -> bool:
        """Whether any unit's walls give way."""
        return "wall_compliance" in self.parts

    @property
    def is_coupled(self) -> bool:
        """Whether any hinge turns its neighbors."""
        return self.n_units > 1 and "hinge_coupling" in self.parts

    @property
    def wall_ratio(self) -> Array:
        """How far a wall gives way per its coordinate, √(c_w k_b), (unit, design); see `walls`."""
        return np.asarray(np.sqrt(self.wall_compliance * self.bistable_stiffness))

    @property
    def is_uniform(self) -> bool:
        """Whether every array has one value for all units."""
        return all(values.shape[0] == 1 for values in self.arrays().values())

    @property
    def force_scale(self) -> Array:
        """The forces in play in each unit, (k_b + k_θ/H²) d, in N, shape (unit, design).

        Without k_b where a dome exerts no force, unless there is no hinge either.

        >>> unit = uniform_finger(1, segment_length=13.5, segment_height=10.0, stroke=2.0,
        ...     bistable_stiffness=1.0, force_linearity=0.0, hinge_stiffness=100.0)
        >>> float(unit.force_scale[0, 0])
        4.0
        """
        hinge = self.hinge_stiffness / self.segment_height**2
        stiffness = self.acting * self.bistable_stiffness + hinge
        return np.where(stiffness > 0.0, stiffness, self.bistable_stiffness) * self.stroke

    @property
    def straight_length(self) -> Array:
        """Length of the straight finger, Σ L, mm, shape (design,).

        >>> float(uniform_finger(3, **STUDY).straight_length[0])
        40.5
        """
        shape = (self.n_units, self.segment_length.shape[1])
        return total(np.broadcast_to(self.segment_length, shape))

    @property
    def domes(self) -> Dome:
        """The constants that the law needs; a dome touches its neighbor at c = D − d."""
        contact = 0.0 * self.dome_travel
        if self.dome_travel.any():
            contact = np.where(self.dome_travel > 0.0, self.dome_travel - self.stroke, 0.0)
        stiffness = self.acting * self.bistable_stiffness
        return Dome(stiffness, self.force_linearity, self.stroke, contact, self.branch)

    def springs(self, extension: Array) -> Response:
        """Energy, force and stiffness of the bistable springs at extensions (unit, batch)."""
        return self.law.response(extension, self.domes)

    def changed(self, **arrays: Array) -> "Finger":
        """The finger with other arrays, by the names of its fields, whose parts they decide.

        Raises ValueError for shapes that do not fit.
        """
        return replace(self, kept=self.kept - arrays.keys(), **arrays)  # type: ignore[arg-type]

    def with_values(self, values: Mapping[str, float]) -> "Finger":
        """The finger with other values, the same in all units, by the names in `KEYS`."""
        return self.changed(**{KEYS[key]: np.array([[value]]) for key, value in values.items()})

    def with_units(self, places: Sequence[int]) -> "Finger":
        """A finger of the units at these places, counted from 0; a unit may repeat.

        >>> uniform_finger(3, **STUDY).with_units([0, 0, 1, 2]).n_units
        4
        """
        arrays = {**self.arrays(), **self.conditions()}.items()
        picked = {k: v if len(v) == 1 else v[list(places)] for k, v in arrays}
        return replace(self, n_units=len(places), kept=self.parts, **picked)  # type: ignore[arg-type]

    def with_bars(self, stiffness: float) -> "Finger":
        """The finger with bars of another stiffness k_L (N/mm); infinite makes them rigid."""
        return self.changed(linear_stiffness=np.array([[stiffness]]))

    def with_domes(self, inverted: Flags) -> "Finger":
        """The finger with the springs that act in a pattern, (unit, batch).

        A push-only law has none in ground units; other laws have all in any pattern.
        """
        return self.changed(acting=self.law.acting(inverted))

    def with_branches(self, extension: Array) -> "Finger":
        """The finger whose inverted domes are where their springs have these extensions, mm."""
        return self.changed(branch=self.law.branch_at(extension, self.domes))

    def with_domes_held(self, inverted: Flags) -> "Finger":
        """The finger with inverted domes held at the rest of each alone; pattern (unit, batch)."""
        rest = self.law.rests(self.domes).well / self.stroke
        share = np.where(np.isnan(rest), 1.0, rest) * inverted
        held = self.with_domes(inverted).changed(force_linearity=share)
        return replace(held, law=HELD)

    def take_lanes(self, index: Indices) -> "Finger":
        """The designs at `index`, in its order; a design may repeat."""
        arrays = {**self.arrays(), **self.conditions()}.items()
        taken = {k: take_lanes(v, index) for k, v in arrays}
        return replace(self, kept=self.parts, **taken)  # type: ignore[arg-type]  # all arrays

    def section(self, first: int, stop: int) -> "Finger":
        """The finger cut down to units first+1 … stop, counted from the base."""
        return self.with_units(range(first, stop))


STUDY = {  # published; mm, N/mm, N mm/rad
    "segment_length": 13.5,
    "segment_height": 10.75,
    "stroke": 3.5,
    "bistable_stiffness": 12.84,
    "force_linearity": 0.043,
    "hinge_stiffness": 24.2,
}


MAY_BE_ZERO = ("force_linearity", "hinge_stiffness")


def uniform_finger(
    n_units: int,
    *,
    segment_length: float,
    segment_height: float,
    stroke: float,
    bistable_stiffness: float,
    force_linearity: float,
    hinge_stiffness: float,
    linear_stiffness: float = np.inf,
) -> Finger:
    """One finger of n equal units; mm, N/mm, N mm/rad.

    >>> finger = uniform_finger(
    ...     3, segment_length=13.5, segment_height=10.75, stroke=3.5,
    ...     bistable_stiffness=12.84, force_linearity=0.043, hinge_stiffness=24.2)
    >>> finger.is_rigid, finger.is_uniform, finger.n_designs
    (True, True, 1)
    >>> uniform_finger(3, **{**STUDY, "stroke": -3.5})
    Traceback (most recent call last):
        ...
    ValueError: stroke -3.5: expected a number > 0
    """
    values = {name: value for name, value in locals().items() if name != "n_units"}
    if n_units < 1:
        raise ValueError(f"n_units {n_units}: expected 1 or more")
    for name, value in values.items():
        if not (value > 0.0 or (value == 0.0 and name in MAY_BE_ZERO)):
            raise ValueError(f"{name} {value}: expected a number > 0")
    arrays = {name: np.array([[float(value)]]) for name, value in values.items()}
    return Finger(n_units, **arrays)  # type: ignore[arg-type]  # all arrays
