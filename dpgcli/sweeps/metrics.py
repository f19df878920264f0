"""What the states of designs come to for each design, gathered block by block."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dpgcli.arrays import Array, Columns, Flags, Indices
from dpgcli.states.certify import Status
from dpgcli.states.columns import Column, Group, Kind
from dpgcli.states.units import UnitSolutions
from dpgcli.states.wells import barriers

TIPS_PER_LENGTH = 10_000  # tips are told apart on a grid of this many steps a finger's length
CELL_BITS = 25  # for each coordinate of the grid: 1,600 lengths either way
CELLS_AT_ONCE = 2**20  # gathered before what repeats is dropped

DESIGN_COLUMNS = (
    Column("n_units", "", "number of units", kind=Kind.COUNT),
    Column("n_states", "", "number of patterns", kind=Kind.COUNT),
    Column("n_stable", "", "number of certified states", kind=Kind.COUNT),
    Column(
        "n_distinct_tips",
        "",
        f"tips told apart on a grid of 1/{TIPS_PER_LENGTH:,} of the finger's length",
        kind=Kind.COUNT,
    ),
    Column("workspace_area_mm2", "mm²", "area of the tips' convex hull"),
    Column("reach_min_mm", "mm", "smallest distance of a tip from the base"),
    Column("reach_max_mm", "mm", "largest distance of a tip from the base"),
    Column("aperture_min_mm", "mm", "smallest aperture of the gripper", Group.GRIPPER),
    Column("aperture_max_mm", "mm", "largest aperture of the gripper", Group.GRIPPER),
    Column("stiffness_min_N_per_mm", "N/mm", "softest tip direction of any state"),
    Column("stiffness_max_N_per_mm", "N/mm", "stiffest tip direction of any state"),
    Column(
        "min_barrier_mJ", "mJ", "smallest barrier of a unit to snap or reset, bars taken as rigid"
    ),
    Column("max_residual_N", "N", "largest unbalanced force of any state"),
    Column("max_numerical_error_mm", "mm", "largest numerical error of any tip"),
)

LEAST = {  # metric: what of the states it is the least of
    "reach_min_mm": "reach",
    "stiffness_min_N_per_mm": "tip_stiffness_min_N_per_mm",
    "aperture_min_mm": "aperture_mm",
}
MOST = {
    "reach_max_mm": "reach",
    "stiffness_max_N_per_mm": "tip_stiffness_max_N_per_mm",
    "max_residual_N": "residual_N",
    "max_numerical_error_mm": "numerical_error_mm",
    "aperture_max_mm": "aperture_mm",
}


@dataclass
class Metrics:
    """The row of metrics of each of some designs, from blocks of their states.

    A block holds, design by design, equally many states of each. Its memory is that of a block
    and of the distinct tips, however many states there are.
    """

    units: UnitSolutions
    n_designs: int
    n_stable: Indices = field(init=False)
    extremes: dict[str, Array] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self.n_stable = np.zeros(self.n_designs, np.int64)
        self.length = np.broadcast_to(self.units.finger.straight_length, self.n_designs)
        self.hulls: list[tuple[Indices, Any]] = []
        self.tips = _Distinct()

    def add(self, rows: Columns) -> None:
        """Count a block's states in."""
        table = {
            name: rows[name].reshape(self.n_designs, -1)
            for name in ("status", "tip_x_mm", "tip_y_mm", *LEAST.values(), *MOST.values())
            if name in rows
        }
        table["reach"] = np.hypot(table["tip_x_mm"], table["tip_y_mm"])
        stable = table.pop("status") == Status.STABLE
        self.n_stable += stable.sum(axis=1)
        for names, extreme, sign in ((LEAST, np.minimum, 1.0), (MOST, np.maximum, -1.0)):
            for name, of in names.items():
                if of in table:
                    self._extend(name, extreme, np.where(stable, table[of], sign * np.inf))
        self._add_tips(table["tip_x_mm"], table["tip_y_mm"], stable)

    def columns(self) -> Columns:
        """One row per design; NaN where it has no stable state."""
        n_units = self.units.finger.n_units
        any_stable = self.n_stable > 0
        extremes = {n: np.where(any_stable, v, np.nan) for n, v in self.extremes.items()}
        barrier = barriers(self.units.finger, self.units.wells)
        return {
            "n_units": np.full(self.n_designs, n_units),
            "n_states": np.full(self.n_designs, 2**n_units),
            "n_stable": self.n_stable,
            "n_distinct_tips": self.tips.counts(self.n_designs),
            "workspace_area_mm2": self._area(),
            "min_barrier_mJ": np.broadcast_to(barrier, self.n_designs),
            **extremes,
        }

    def _extend(self, name: str, extreme: Callable[..., Array], values: Array) -> None:
        found = extreme.reduce(values, axis=1)  # type: ignore[attr-defined]
        self.extremes[name] = extreme(self.extremes.get(name, found), found)

    def _add_tips(self, x: Array, y: Array, stable: Flags) -> None:
        owner = np.nonzero(stable)[0]
        tips = np.column_stack((x[stable], y[stable]))
        self.tips.add(owner, tips * (TIPS_PER_LENGTH / self.length[owner])[:, None])
        if len(owner):
            self.hulls.append(hulls_of(owner, tips))

    def _area(self) -> Array:
        """Area of each design's hull; 0 where it is narrower than rounding."""
        import shapely

        area = np.zeros(self.n_designs)
        if self.hulls:
            designs, hulls = self.hulls[0] if len(self.hulls) == 1 else _joined(self.hulls)
            found, around = shapely.area(hulls), shapely.length(hulls)
            rounding = 8.0 * np.finfo(float).eps * self.length[designs] * around
            area[designs] = np.where(found > rounding, found, 0.0)
        return area


@dataclass
class _Distinct:
    """Cells of a grid that tips lie in, by design, without what repeats."""

    known: Indices = field(default_factory=lambda: np.zeros(0, np.int64))

    def __post_init__(self) -> None:
        self.waiting: list[Indices] = []

    def add(self, owner: Indices, tips: Array) -> None:
        """Tips (tip, 2) in steps of the grid, and the design of each."""
        most = 2.0 ** (CELL_BITS - 1) - 1
        x, y = np.clip(np.rint(tips.T), -most, most).astype(np.int64) + int(most)
        self.waiting.append(_distinct((((owner << CELL_BITS) | x) << CELL_BITS) | y))
        if sum(map(len, self.waiting)) > max(CELLS_AT_ONCE, len(self.known)):
            self._join()

    def counts(self, n_designs: int) -> Indices:
        """How many cells each design's tips lie in."""
        self._join()
        return np.bincount(self.known >> (2 * CELL_BITS), minlength=n_designs)

    def _join(self) -> None:
        parts = [part for part in (self.known, *self.waiting) if len(part)]
        if parts:
            self.known = parts[0] if len(parts) == 1 else _distinct(np.concatenate(parts))
        self.waiting.clear()


def _distinct(cells: Indices) -> Indices:
    """Each cell once, in order; NumPy's own `unique` looks them up in a table, which is slower."""
    ordered = np.sort(cells)
    return ordered[np.diff(ordered, prepend=-1) > 0]


def hulls_of(owner: Indices, points: Array) -> tuple[Indices, Any]:
    """The owners and the convex hull of each one's points (point, 2), at least one point in all.

    Polygons, lines or points, whatever a hull comes to.

    >>> square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
    >>> owners, hulls = hulls_of(np.full(5, 7), square)
    >>> owners.tolist(), hulls[0].area, len(hulls[0].exterior.coords) - 1
    ([7], 1.0, 4)
    """
    import shapely

    order = np.arange(len(owner))
    if (owner[1:] < owner[:-1]).any():
        order = np.argsort(owner, kind="stable")
        owner = owner[order]
    is_first = np.concatenate(([True], owner[1:] != owner[:-1]))
    place = np.repeat(np.cumsum(is_first) - 1, 2)  # a line needs two points
    lines = shapely.linestrings(points[np.repeat(order, 2)], indices=place)
    return owner[is_first], shapely.convex_hull(lines)


def _joined(parts: Sequence[tuple[Indices, Any]]) -> tuple[Indices, Any]:
    """The hulls of what lies in hulls of the same owners."""
    import shapely

    owners, points = [], []
    for designs, hulls in parts:
        corners, index = shapely.get_coordinates(hulls, return_index=True)
        owners.append(designs[index])
        points.append(corners)
    return hulls_of(np.concatenate(owners), np.concatenate(points))
