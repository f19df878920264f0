"""Metrics of designs: each with its name, unit, meaning and how the states come to it.

A metric is written here and nowhere else: tables, metadata and the manual follow.
"""

from collections.abc import Callable, Collection
from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Columns, Flags, Indices
from dpgcli.design.outputs import STIFFNESS, Output
from dpgcli.design.pressure import Pressure
from dpgcli.records import dataclass
from dpgcli.states.certify import UNDECIDED, Status
from dpgcli.states.columns import Column, Group, Kind
from dpgcli.states.units import UnitSolutions
from dpgcli.states.wells import barriers
from dpgcli.sweeps.tips import TIPS_PER_LENGTH, DistinctTips, hulls_of, joined

if TYPE_CHECKING:
    from dpgcli.sweeps.pressures import PressedDesigns


@dataclass(frozen=True)
class Metric(Column):
    """A column of designs: what `of` makes of all their states, (design,).

    Or, with a value `over` the states, the `extreme` of it among a design's stable ones. What
    `needs_pressure` is there for designs that have it. Where the count `unknown` is not 0 searches
    failed, and the metric is that of what was found: a bound, from above of a minimum, else from
    below.
    """

    of: Callable[["Metrics"], NDArray[Any]] = field(kw_only=True, compare=False)
    over: str = field(default="", kw_only=True)
    extreme: np.ufunc = field(default=np.maximum, kw_only=True)
    unknown: str = field(default="", kw_only=True)
    needs_pressure: bool = field(default=False, kw_only=True)

    @property
    def furthest(self) -> float:
        """How far the metric may be from what was found, where searches failed."""
        return -np.inf if self.extreme is np.minimum else np.inf


@dataclass
class Metrics:
    """The row of metrics of each of some designs, from blocks of their states.

    A block holds, design by design, equally many states of each. Its memory is that of a block
    and of the distinct tips, however many states there are. `pressure` is that of the designs,
    if they have any.
    """

    units: UnitSolutions
    n_designs: int
    pressure: Pressure | None = None
    n_stable: Indices = field(init=False)
    n_unknown_states: Indices = field(init=False)
    n_grasps: Indices | None = field(init=False, default=None)  # None without bodies
    n_unknown_grasps: Indices = field(init=False)
    extremes: dict[str, Array] = field(init=False, default_factory=dict)
    n_told: dict[str, Indices] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self.n_stable = np.zeros(self.n_designs, np.int64)
        self.n_unknown_states = np.zeros(self.n_designs, np.int64)
        self.n_unknown_grasps = np.zeros(self.n_designs, np.int64)
        self.length = np.broadcast_to(self.units.finger.straight_length, self.n_designs)
        self.hulls: list[tuple[Indices, Any]] = []
        self.tips = DistinctTips()

    def add(self, rows: Columns) -> None:
        """Count a block's states in."""
        block = {name: values.reshape(self.n_designs, -1) for name, values in rows.items()}
        block["reach"] = np.hypot(block["tip_x_mm"], block["tip_y_mm"])
        stable = block["status"] == Status.STABLE
        is_lost = np.isin(block["status"], UNDECIDED)
        self.n_stable += stable.sum(axis=1)
        self.n_unknown_states += is_lost.sum(axis=1)
        for metric in METRICS:
            if metric.over in block:
                is_told = stable & self._is_known(metric, block[metric.over])
                self._extend(metric, block[metric.over], is_told)
        if "n_contacts" in block:
            n_before = 0 if self.n_grasps is None else self.n_grasps
            self.n_grasps = n_before + (stable & (block["n_contacts"] > 0)).sum(axis=1)
            is_answer = np.isin(block["grasp_status"], (Status.STABLE, Status.NOT_HELD))
            if "payload_N" in block:  # whose search may fail where the grasp is found
                is_held = block["grasp_status"] == Status.STABLE
                is_answer &= ~(is_held & np.isnan(block["payload_N"]))
            self.n_unknown_grasps += (is_lost | stable & ~is_answer).sum(axis=1)
        self._add_tips(block["tip_x_mm"], block["tip_y_mm"], stable)

    def columns(self, only: Collection[str] | None = None) -> Columns:
        """One row per design; NaN where it has no stable state. Of all metrics, or `only` some."""
        told = (m for m in METRICS if only is None or m.name in only)
        known = (m for m in told if not m.over or m.name in self.extremes)
        has_pressure, has_bodies = self.pressure is not None, self.n_grasps is not None
        return {
            m.name: m.of(self)
            for m in known
            if (has_pressure or not m.needs_pressure) and (has_bodies or m.group is not Group.GRASP)
        }

    @cached_property
    def pressed(self) -> "PressedDesigns":
        """What pressure does to the designs, which have it."""
        from dpgcli.sweeps.pressures import PressedDesigns

        assert self.pressure is not None, "no metric that needs pressure is asked for"
        return PressedDesigns(self.units, self.pressure, self.n_designs)

    def extreme(self, name: str) -> Array:
        """The extreme of a metric that is one, (design,)."""
        return np.where(self.n_told[name] > 0, self.extremes[name], np.nan)

    def alike(self, value: int | Array) -> Array | Indices:
        """A value of each design, or one for all, as (design,)."""
        return np.broadcast_to(value, self.n_designs)

    def area(self) -> Array:
        """Area of the convex hull of each design's tips, mm²; 0 where it is below rounding."""
        import shapely

        area = np.zeros(self.n_designs)
        if self.hulls:
            designs, hulls = self.hulls[0] if len(self.hulls) == 1 else joined(self.hulls)
            found, around = shapely.area(hulls), shapely.length(hulls)
            rounding = 8.0 * np.finfo(float).eps * self.length[designs] * around
            area[designs] = np.where(found > rounding, found, 0.0)
        return area

    @staticmethod
    def _is_known(metric: Metric, values: Array) -> Flags:
        """Values that count: a state without a grasp has none of that group."""
        is_of_grasp = metric.group is Group.GRASP
        return ~np.isnan(values) if is_of_grasp else np.ones(values.shape, bool)

    def _extend(self, metric: Metric, values: Array, stable: Flags) -> None:
        n_before = self.n_told.get(metric.name, 0)
        self.n_told[metric.name] = n_before + stable.sum(axis=1)
        worst = np.inf if metric.extreme is np.minimum else -np.inf
        found = metric.extreme.reduce(np.where(stable, values, worst), axis=1)
        known = self.extremes.get(metric.name, found)
        self.extremes[metric.name] = metric.extreme(known, found)

    def _add_tips(self, x: Array, y: Array, stable: Flags) -> None:
        owner = np.nonzero(stable)[0]
        tips = np.column_stack((x[stable], y[stable]))
        self.tips.add(owner, tips * (TIPS_PER_LENGTH / self.length[owner])[:, None])
        if len(owner):
            self.hulls.append(hulls_of(owner, tips))


SHAPES = (Output.SHAPES,)
UNKNOWN_STATES, UNKNOWN_GRASPS = "n_unknown_states", "n_unknown_grasps"
UNKNOWN_DIRECTIONS = "n_unknown_directions"


def _count(
    name: str,
    description: str,
    of: Callable[[Metrics], Array | Indices],
    outputs: tuple[Output, ...] = (),
    group: Group = Group.STATES,
    unknown: str = "",
) -> Metric:
    return Metric(name, "", description, group, Kind.COUNT, outputs=outputs, of=of, unknown=unknown)


def _least(
    name: str,
    unit: str,
    description: str,
    over: str,
    *outputs: Output,
    group: Group = Group.STATES,
) -> Metric:
    def extreme(metrics: Metrics) -> Array:
        return metrics.extreme(name)

    unknown = UNKNOWN_GRASPS if group is Group.GRASP else UNKNOWN_STATES
    return Metric(
        name,
        unit,
        description,
        group,
        outputs=outputs,
        of=extreme,
        over=over,
        extreme=np.minimum,
        unknown=unknown,
    )


def _most(
    name: str,
    unit: str,
    description: str,
    over: str,
    *outputs: Output,
    group: Group = Group.STATES,
) -> Metric:
    least = _least(name, unit, description, over, *outputs, group=group)
    return replace(least, extreme=np.maximum)


def _under_pressure(
    name: str,
    unit: str,
    description: str,
    of: Callable[["PressedDesigns"], NDArray[Any]],
    kind: Kind = Kind.NUMBER,
    unknown: str = "",
) -> Metric:
    def of_pressed(metrics: Metrics) -> NDArray[Any]:
        return of(metrics.pressed)

    outputs = (Output.PRESSURES,)
    return Metric(
        name,
        unit,
        description,
        kind=kind,
        outputs=outputs,
        of=of_pressed,
        needs_pressure=True,
        unknown=unknown,
    )


UNDER_PRESSURE = (
    _under_pressure(
        "n_reachable",
        "",
        "states that pulses of pressure lead to from rest",
        lambda d: d.n_reachable,
        Kind.COUNT,
        UNKNOWN_DIRECTIONS,
    ),
    _under_pressure(
        "reachable_patterns",
        "",
        "the patterns of these states",
        lambda d: d.reachable_patterns,
        Kind.TEXT,
    ),
    _under_pressure(
        UNKNOWN_DIRECTIONS,
        "",
        "directions of pressure in which searches failed, or 1 where the state at rest is not "
        "known: more states may be reached",
        lambda d: d.n_unknown_directions,
        Kind.COUNT,
    ),
    _under_pressure(
        "snap_pressure_min_MPa",
        "MPa",
        "pressure at which the first unit snaps, each by itself",
        lambda d: d.snap_and_reset[0].min(axis=0),
    ),
    _under_pressure(
        "snap_pressure_max_MPa",
        "MPa",
        "pressure at which the last unit snaps, each by itself",
        lambda d: d.snap_and_reset[0].max(axis=0),
    ),
    _under_pressure(
        "reset_pressure_min_MPa",
        "MPa",
        "pressure at which the last unit resets, each by itself",
        lambda d: d.snap_and_reset[1].min(axis=0),
    ),
    _under_pressure(
        "reset_pressure_max_MPa",
        "MPa",
        "pressure at which the first unit resets, each by itself",
        lambda d: d.snap_and_reset[1].max(axis=0),
    ),
    _under_pressure(
        "smallest_threshold_gap_MPa",
        "MPa",
        "smallest difference of two units' snap, or reset, pressures on one line",
        lambda d: d.smallest_gap,
    ),
)

METRICS = (
    _count("n_units", "number of units", lambda m: m.alike(m.units.finger.n_units)),
    _count("n_states", "number of patterns", lambda m: m.alike(2**m.units.finger.n_units)),
    _count(
        "n_stable",
        "number of certified states",
        lambda m: m.n_stable,
        SHAPES,
        unknown=UNKNOWN_STATES,
    ),
    _count(
        UNKNOWN_STATES,
        "patterns that are marginal or not_converged: there may be more states",
        lambda m: m.n_unknown_states,
    ),
    _count(
        "n_distinct_tips",
        f"tips told apart on a grid of 1/{TIPS_PER_LENGTH:,} of the finger's length",
        lambda m: m.tips.counts(m.n_designs),
        SHAPES,
        unknown=UNKNOWN_STATES,
    ),
    Metric(
        "workspace_area_mm2",
        "mm²",
        "area of the tips' convex hull",
        outputs=SHAPES,
        of=Metrics.area,
        unknown=UNKNOWN_STATES,
    ),
    _least("reach_min_mm", "mm", "smallest distance of a tip from the base", "reach", *SHAPES),
    _most("reach_max_mm", "mm", "largest distance of a tip from the base", "reach", *SHAPES),
    _least(
        "aperture_min_mm",
        "mm",
        "smallest aperture of the gripper",
        "aperture_mm",
        *SHAPES,
        group=Group.GRIPPER,
    ),
    _most(
        "aperture_max_mm",
        "mm",
        "largest aperture of the gripper",
        "aperture_mm",
        *SHAPES,
        group=Group.GRIPPER,
    ),
    _least(
        "stiffness_min_N_per_mm",
        "N/mm",
        "softest tip direction of any state",
        "tip_stiffness_min_N_per_mm",
        *STIFFNESS,
    ),
    _most(
        "stiffness_max_N_per_mm",
        "N/mm",
        "stiffest tip direction of any state",
        "tip_stiffness_max_N_per_mm",
        Output.AXIAL,
        *STIFFNESS,
    ),
    Metric(
        "min_barrier_mJ",
        "mJ",
        "smallest barrier of a unit by itself to snap or reset: rigid bars, no loads",
        outputs=(Output.BARRIERS,),
        of=lambda m: m.alike(barriers(m.units.finger, m.units.wells)),
    ),
    *UNDER_PRESSURE,
    _count(
        "n_grasps",
        "states that touch the body, at rest",
        lambda m: m.alike(0) if m.n_grasps is None else m.n_grasps,
        (Output.SHAPES, Output.FORCES),
        Group.GRASP,
        UNKNOWN_GRASPS,
    ),
    _count(
        UNKNOWN_GRASPS,
        "states whose grasp or payload is not found: more may touch the body, with larger forces",
        lambda m: m.n_unknown_grasps,
        group=Group.GRASP,
    ),
    _most(
        "squeeze_max_N",
        "N",
        "largest closing force between the fingers of any state",
        "squeeze_N",
        Output.FORCES,
        group=Group.GRASP,
    ),
    _most(
        "contact_max_N",
        "N",
        "largest force at one place of any state",
        "max_contact_N",
        Output.FORCES,
        group=Group.GRASP,
    ),
    _most(
        "payload_max_N",
        "N",
        "largest pull on the body along gravity that any state bears",
        "payload_N",
        Output.FORCES,
        group=Group.GRASP,
    ),
    _most("max_residual_N", "N", "largest unbalanced force of any state", "residual_N"),
    _most(
        "max_numerical_error_mm", "mm", "largest numerical error of any tip", "numerical_error_mm"
    ),
)
