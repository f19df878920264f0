"""Many designs at once: all states of each, and what they come to for a design."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dpgcli.arrays import Array, Flags, Indices
from dpgcli.mechanics.finger import ARRAYS, Finger
from dpgcli.mechanics.formulation import Formulation
from dpgcli.mechanics.scene import Gripper, Scene
from dpgcli.states.columns import Column, Group, Kind
from dpgcli.states.patterns import inverted_units
from dpgcli.states.rows import Columns, Wanted, solved_rows
from dpgcli.states.rungs import RUNGS, Rung, bar_flexibility, cheapest, error_bounds
from dpgcli.states.solve import Status, Units, lanes_at_once
from dpgcli.states.wells import barriers

SAME_TIP = 0.01  # mm: tips are told apart on a grid of this width

DESIGN_COLUMNS = (
    Column("n_units", "", "number of units", Group.STATES, Kind.COUNT),
    Column("n_states", "", "number of patterns", Group.STATES, Kind.COUNT),
    Column("n_stable", "", "number of certified states", Group.STATES, Kind.COUNT),
    Column("n_distinct_tips", "", "tips that differ by 0.01 mm", Group.STATES, Kind.COUNT),
    Column("workspace_area_mm2", "mm²", "area of the tips' convex hull", Group.STATES),
    Column("reach_min_mm", "mm", "smallest distance of a tip from the base", Group.STATES),
    Column("reach_max_mm", "mm", "largest distance of a tip from the base", Group.STATES),
    Column("aperture_min_mm", "mm", "smallest aperture of the gripper", Group.GRIPPER),
    Column("aperture_max_mm", "mm", "largest aperture of the gripper", Group.GRIPPER),
    Column("stiffness_min_N_per_mm", "N/mm", "softest tip direction of any state", Group.STATES),
    Column("stiffness_max_N_per_mm", "N/mm", "stiffest tip direction of any state", Group.STATES),
    Column(
        "min_barrier_mJ",
        "mJ",
        "smallest barrier of a unit to snap or reset, bars taken as rigid",
        Group.STATES,
    ),
    Column("max_residual_N", "N", "largest unbalanced force of any state", Group.STATES),
    Column("max_tip_error_mm", "mm", "largest numerical error of any tip", Group.STATES),
)


@dataclass(frozen=True)
class Choice:
    """Designs (by place) that take one rung, and the bound on their tips' error, mm."""

    rung: Rung
    places: Indices
    bounds: Array


def choices(scenes: Sequence[Scene], target_error: float) -> Iterator[Choice]:
    """The cheapest rung of each design that is bounded by the target error (mm), by rung.

    The scenes agree in the number of units and in having rigid bars.
    """
    bounds = error_bounds(Units.of(_stacked([scene.finger for scene in scenes])))
    chosen = cheapest(bounds, target_error)
    for index in np.unique(chosen):
        places = np.flatnonzero(chosen == index)
        yield Choice(RUNGS[index], places, bounds[index, places])


def design_states(
    scenes: Sequence[Scene],
    formulate: Callable[[Finger], Formulation],
    tolerance: float,
    groups: frozenset[Group],
    *,
    drops_bars: bool = False,
) -> tuple[Columns, Columns]:
    """All states of some designs, design by design, and one row of metrics for each design.

    The scenes agree in the number of units, in having rigid bars and in being grippers. If it
    drops the bars, the error of the tips includes what that costs.
    """
    units = Units.of(_stacked([scene.finger for scene in scenes]))
    dropped = np.zeros(len(scenes))
    if drops_bars:
        dropped = bar_flexibility(units)
        units = Units.of(units.finger.with_bars(np.inf))
    n_units = units.finger.n_units
    patterns = inverted_units(np.arange(2**n_units, dtype=np.uint64), n_units)
    blocks = []
    for designs in _design_batches(len(scenes), n_units):
        lanes = np.repeat(designs, patterns.shape[1])
        inverted = np.tile(patterns, len(designs))
        placement = _placement(scenes, lanes)
        wanted = Wanted(formulate, tolerance, groups, *placement, dropped[lanes])
        of_lanes = units.designs(lanes) if len(scenes) > 1 else units
        blocks.append(solved_rows(of_lanes, inverted, wanted))
    rows = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    if drops_bars:  # without them stiffness would be wrong
        rows |= {name: np.full_like(v, np.nan) for name, v in rows.items() if _is_stiffness(name)}
    return rows, _metrics(rows, units, len(scenes))


def _is_stiffness(name: str) -> bool:
    return name.startswith(("tip_stiffness", "tip_compliance"))


def _stacked(fingers: Sequence[Finger]) -> Finger:
    """Fingers as the designs of one batch."""
    columns = {name: _side_by_side([getattr(f, name) for f in fingers]) for name in ARRAYS}
    return fingers[0].changed(**columns)


def _side_by_side(parts: list[Array]) -> Array:
    rows = max(len(part) for part in parts)
    repeated = (part if len(part) == rows else np.repeat(part, rows, axis=0) for part in parts)
    return np.concatenate(list(repeated), axis=1)


def _design_batches(n_designs: int, n_units: int) -> Iterator[Indices]:
    size = max(1, lanes_at_once(n_units) >> n_units)
    for first in range(0, n_designs, size):
        yield np.arange(first, min(first + size, n_designs))


def _placement(scenes: Sequence[Scene], lanes: Indices) -> tuple[Gripper | None, float | Array]:
    """The gripper and the layer's thickness of each lane's design."""
    grippers = [scene.gripper for scene in scenes if scene.gripper is not None]
    thickness = np.array([scene.layer_thickness or 0.0 for scene in scenes])[lanes]
    if not grippers:
        return None, thickness
    spacing = np.array([gripper.base_spacing for gripper in grippers])[lanes]
    angle = np.array([gripper.mounting_angle for gripper in grippers])[lanes]
    return Gripper(spacing, angle), thickness


def _metrics(rows: Columns, units: Units, n_designs: int) -> Columns:
    """One row per design from the rows of its states; NaN where it has no stable state."""
    table = {name: values.reshape(n_designs, -1) for name, values in rows.items()}
    stable = table["status"] == Status.STABLE
    x, y = table["tip_x_mm"], table["tip_y_mm"]
    reach = np.hypot(x, y)
    n_tips, area = _workspace(x, y, stable)
    metrics = {
        "n_units": np.full(n_designs, units.finger.n_units),
        "n_states": np.full(n_designs, stable.shape[1]),
        "n_stable": stable.sum(axis=1),
        "n_distinct_tips": n_tips,
        "workspace_area_mm2": area,
        "reach_min_mm": _least(reach, stable),
        "reach_max_mm": _most(reach, stable),
        "stiffness_min_N_per_mm": _least(table["tip_stiffness_min_N_per_mm"], stable),
        "stiffness_max_N_per_mm": _most(table["tip_stiffness_max_N_per_mm"], stable),
        "min_barrier_mJ": np.broadcast_to(barriers(units.finger, units.wells), n_designs),
        "max_residual_N": _most(table["residual_N"], stable),
        "max_tip_error_mm": _most(table["tip_error_mm"], stable),
    }
    if "aperture_mm" in table:
        metrics["aperture_min_mm"] = _least(table["aperture_mm"], stable)
        metrics["aperture_max_mm"] = _most(table["aperture_mm"], stable)
    return metrics


def _least(values: Array, stable: Flags) -> Array:
    least = np.where(stable, values, np.inf).min(axis=1)
    return np.where(stable.any(axis=1), least, np.nan)


def _most(values: Array, stable: Flags) -> Array:
    return -_least(-values, stable)


def _workspace(x: Array, y: Array, stable: Flags) -> tuple[Indices, Array]:
    """Number of tips told apart, and the area of their convex hull (mm²), of each design."""
    from scipy.spatial import ConvexHull, QhullError

    n_tips, area = np.zeros(len(x), np.int64), np.zeros(len(x))
    for design, is_stable in enumerate(stable):
        tips = np.column_stack((x[design, is_stable], y[design, is_stable]))
        n_tips[design] = len(set(map(tuple, np.rint(tips / SAME_TIP).tolist())))
        if n_tips[design] > 2:
            try:
                area[design] = ConvexHull(tips).volume  # of a plane figure: its area
            except QhullError:  # all in a line
                area[design] = 0.0
    return n_tips, area
