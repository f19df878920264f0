"""What designs are searched for: what may vary, and what states should be like."""

from collections.abc import Iterator, Mapping
from dataclasses import field
from functools import cached_property
from itertools import pairwise, product
from math import prod

import numpy as np

from dpgcli.arrays import Array, Indices
from dpgcli.design.dimensions import Design
from dpgcli.records import dataclass
from dpgcli.sweeps.expressions import Expression

TIP = "tip"
OF_TIP = ("tip_x_mm", "tip_y_mm")
Choice = Mapping[str, float]  # a value for each key that has a list of them


def suffix_of(unit: str) -> str:
    """A unit at the end of a name.

    >>> suffix_of("mm"), suffix_of("rad/(N mm)"), suffix_of("")
    ('_mm', '_rad_per_N_mm', '')
    """
    spelled = unit.replace("(", "").replace(")", "").replace("/", "_per_").replace(" ", "_")
    return f"_{spelled}" if unit else ""


@dataclass(frozen=True)
class Range:
    """A key that may have any value between two."""

    key: str
    low: float
    high: float

    @property
    def width(self) -> float:
        return self.high - self.low


@dataclass(frozen=True)
class Target:
    """What a quantity of a state should be, to within a tolerance in the quantity's unit.

    One of the states that match the `pattern` has to meet it. `quantity` is a column of states, or
    the tip, whose place has two parts and is missed by its distance. Without a pattern it is a
    column of whole designs.
    """

    pattern: str
    quantity: str
    values: tuple[float, ...]
    tolerance: float

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns that it is about, one for each of its values."""
        return OF_TIP if self.quantity == TIP else (self.quantity,)

    @property
    def text(self) -> str:
        """What is asked for, in words."""
        return f"{self.quantity} of {self.pattern}" if self.pattern else self.quantity


@dataclass(frozen=True)
class Objective:
    """A column of designs, or a key, that should be as small as can be, or as large."""

    name: str
    is_maximized: bool = False


@dataclass(frozen=True)
class Goal:
    """A base, the keys that may vary around it, and what is asked of what results.

    `lists` are values by key: whole numbers of units, or any others, of which all combinations are
    tried. Designs (range, design) are in parts of the ranges' widths, from 0 to 1. Targets are for
    states; constraints and objectives are over columns of designs, keys, and numbers of the base
    by key, which are `known`.
    """

    base: Design
    ranges: tuple[Range, ...]
    lists: Mapping[str, tuple[float, ...]]
    targets: tuple[Target, ...] = ()
    constraints: tuple[Expression, ...] = ()
    objectives: tuple[Objective, ...] = ()
    known: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def of_states(self) -> tuple[Target, ...]:
        """The targets that are about states."""
        return tuple(target for target in self.targets if target.pattern)

    @cached_property
    def parts(self) -> tuple[slice, ...]:
        """The rows of each target among those of the numbers that all targets ask for."""
        ends = np.cumsum([0, *(len(target.values) for target in self.targets)]).tolist()
        return tuple(slice(*pair) for pair in pairwise(ends))

    @property
    def keys(self) -> tuple[str, ...]:
        """All keys that vary."""
        return (*self.lists, *(each.key for each in self.ranges))

    @property
    def has_maps(self) -> bool:
        """Whether whole maps matter, and not only states."""
        return bool(self.constraints or self.objectives)

    @property
    def n_parts(self) -> int:
        """How many numbers the targets ask for."""
        return sum(len(target.values) for target in self.targets)

    @property
    def n_choices(self) -> int:
        """How many combinations of listed values there are."""
        return prod(map(len, self.lists.values()))

    def choices(self) -> Iterator[Choice]:
        """Every combination of the listed values, the last list fastest."""
        for values in product(*self.lists.values()):
            yield dict(zip(self.lists, values, strict=True))

    def listed(self) -> dict[str, Array]:
        """The same, as values by key, (choice,)."""
        sizes = [len(values) for values in self.lists.values()]
        return self.choice_at(np.indices(sizes).reshape(len(sizes), self.n_choices))

    def choice_at(self, places: Indices) -> dict[str, Array]:
        """Values by key of choices at places in the lists, (list, choice)."""
        pairs = zip(self.lists.items(), places, strict=True)
        return {key: np.array(values)[place] for (key, values), place in pairs}

    def told(self, objectives: Array) -> dict[str, Array]:
        """Objectives (objective, design), all to be least, as they are, by name."""
        pairs = zip(self.objectives, objectives, strict=False)
        return {each.name: -row if each.is_maximized else row for each, row in pairs}

    def values(self, choice: Mapping[str, Array], points: Array) -> dict[str, Array]:
        """Values by key of designs at points (range, design), with listed ones by design."""
        spread = {
            each.key: np.clip(each.low + each.width * row, each.low, each.high)
            for each, row in zip(self.ranges, points, strict=True)
        }
        return {**choice, **spread}
