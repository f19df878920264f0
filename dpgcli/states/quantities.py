"""Quantities of states: each with its name, unit, meaning and function.

A quantity is written here and nowhere else: tables, `--columns`, metadata and the manual follow.
"""

from collections.abc import Callable, Sequence
from dataclasses import field
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Columns
from dpgcli.design.dimensions import without_unit
from dpgcli.design.outputs import STIFFNESS, Output
from dpgcli.design.scene import Uncertainty
from dpgcli.errors import Field, UsageError
from dpgcli.mechanics.terms import LOAD
from dpgcli.records import dataclass
from dpgcli.states.columns import Column, Group, Kind
from dpgcli.states.patterns import texts
from dpgcli.states.solved import SolvedFingers, SolvedStates

Of = Callable[[SolvedFingers], NDArray[Any]]


@dataclass(frozen=True)
class Quantity(Column):
    """A column of states and the function that computes it.

    Without a state of the pattern it is NaN, or false, unless `is_always`. A quantity that
    `needs_bars` would be wrong if a plan dropped them.
    """

    of: Of = field(kw_only=True, compare=False)
    is_always: bool = field(default=False, kw_only=True)
    needs_bars: bool = field(default=False, kw_only=True)


def rows(solved: SolvedStates, quantities: Sequence[Quantity]) -> Columns:
    """The quantities of some states, by name.

    States that were not solved as whole fingers have those of the groups states and energies only.
    """
    fingers, is_state = cast("SolvedFingers", solved), solved.is_state
    are_all_states = is_state.all()
    columns: Columns = {}
    for quantity in quantities:
        values = quantity.of(fingers)
        if not (quantity.is_always or are_all_states):
            is_flag = values.dtype == bool
            values = values & is_state if is_flag else np.where(is_state, values, np.nan)
        columns[quantity.name] = values
    return columns


def declared(
    n_units: int,
    energy_kinds: Sequence[str],
    is_gripper: bool,
    *,
    uncertainty: Uncertainty | None = None,
) -> tuple[Quantity, ...]:
    """All quantities that a scene can have, in the order of every table.

    >>> [c.name for c in declared(3, ("bistable", "hinge"), False)][:4]
    ['pattern', 'status', 'tip_x_mm', 'tip_y_mm']
    """
    return (
        *_POSES,
        _EIGENVALUE,
        *_NUMERICS,
        *_STIFFNESS,
        *(_energy(kind) for kind in _ENERGY_KINDS if kind in energy_kinds),
        *(_opening(unit) for unit in range(n_units)),
        *(_barrier(unit) for unit in range(n_units)),
        *LEAST,
        *(_GRIPPER if is_gripper else ()),
        *(() if uncertainty is None else _uncertain(uncertainty, is_gripper)),
        *(_nodes(n_units, "upper_", "lower_") if is_gripper else _nodes(n_units, "")),
    )


def named(quantities: Sequence[Quantity], names: Sequence[str]) -> tuple[Quantity, ...]:
    """The declared quantities that are named, each by its name or its group's.

    Raises UsageError for names that are neither, with what there is.

    >>> [q.name for q in named(declared(3, ("bistable", "hinge"), False), ["energies"])]
    ['bistable_energy_mJ', 'hinge_energy_mJ']
    """
    known = {q.name for q in quantities} | {q.group for q in quantities}
    if unknown := [name for name in names if name not in known]:
        groups = ", ".join(dict.fromkeys(q.group for q in quantities))
        single = ", ".join(q.name for q in quantities if q.group is not Group.NODES)
        raise UsageError(
            Field("columns"),
            f": {', '.join(unknown)} unknown for this scene; "
            f"groups: default, all, {groups}; columns: {single}",
        )
    return tuple(q for q in quantities if q.name in names or q.group in names)


def _shape(name: str, unit: str, description: str, of: Of, group: Group = Group.STATES) -> Quantity:
    return Quantity(name, unit, description, group, outputs=(Output.SHAPES,), of=of)


_POSES = (
    Quantity(
        "pattern",
        "",
        "activation pattern, unit 1 first, 1 = inverted",
        kind=Kind.PATTERN,
        of=lambda s: texts(s.inverted),
        is_always=True,
    ),
    Quantity(
        "status",
        "",
        "stable where certified, else why not",
        kind=Kind.STATUS,
        outputs=(Output.SHAPES,),
        of=lambda s: s.status,
        is_always=True,
    ),
    _shape("tip_x_mm", "mm", "x of the tip, the last limiting-layer node", lambda s: s.pose[0]),
    _shape("tip_y_mm", "mm", "y of the tip; negative is the inner side", lambda s: s.pose[1]),
    _shape(
        "tip_angle_rad",
        "rad",
        "rotation of the last strut; negative = curled",
        lambda s: s.pose[2],
    ),
    _shape("tip_angle_deg", "deg", "the same in degrees", lambda s: np.degrees(s.pose[2])),
    Quantity(
        "energy_mJ",
        "mJ",
        "potential energy of the state",
        outputs=(Output.ENERGIES,),
        of=lambda s: s.energy,
    ),
)
_EIGENVALUE = Quantity(
    "min_eigenvalue_N_per_mm",
    "N/mm",
    "smallest eigenvalue of the Hessian in node coordinates",
    Group.EIGENVALUE,
    outputs=STIFFNESS,
    of=lambda s: s.eigenvalues,
)
_NUMERICS = (
    Quantity(
        "residual_N",
        "N",
        "largest unbalanced force; moments over the segment height H",
        of=lambda s: s.residual,
        is_always=True,
    ),
    Quantity(
        "numerical_error_mm",
        "mm",
        "estimated numerical error of the tip position",
        of=lambda s: s.tip_error,
    ),
    Quantity(
        "reached_pattern",
        "",
        "the pattern whose wells the units are in",
        kind=Kind.PATTERN,
        of=lambda s: texts(s.reached),
        is_always=True,
    ),
)
ALWAYS = (*_POSES, *_NUMERICS)  # in every table of states: pose, status and numerical errors


def _stiffness(name: str, unit: str, description: str, of: Of, *outputs: Output) -> Quantity:
    shown = (*outputs, *STIFFNESS)
    return Quantity(name, unit, description, Group.STIFFNESS, outputs=shown, of=of, needs_bars=True)


def _compliance(place: int, name: str, unit: str, description: str, *outputs: Output) -> Quantity:
    name = f"tip_compliance_{name}"
    return _stiffness(name, unit, description, lambda s: s.compliance[place], *outputs)


_STIFFNESS = (
    _stiffness(
        "tip_stiffness_min_N_per_mm",
        "N/mm",
        "tip force per travel, softest way",
        lambda s: s.stiffness[0],
    ),
    _stiffness(
        "tip_stiffness_max_N_per_mm",
        "N/mm",
        "the same, stiffest way",
        lambda s: s.stiffness[1],
        Output.AXIAL,
    ),
    _compliance(0, "xx_mm_per_N", "mm/N", "tip x by a force along x", Output.AXIAL),
    _compliance(1, "xy_mm_per_N", "mm/N", "tip y by a force along x"),
    _compliance(2, "yy_mm_per_N", "mm/N", "tip y by a force along y"),
    _compliance(3, "x_angle_rad_per_N", "rad/N", "tip angle by a force along x"),
    _compliance(4, "y_angle_rad_per_N", "rad/N", "tip angle by a force along y"),
    _compliance(5, "angle_rad_per_N_mm", "rad/(N mm)", "tip angle by a moment at the tip"),
)
_ENERGY_KINDS = {
    "bistable": "bistable springs",
    "wall": "walls",
    "hinge": "hinges",
    "bar": "bars",
    LOAD: "dead loads: minus force times place, weights and couples likewise",
}


def _energy(kind: str) -> Quantity:
    return Quantity(
        f"{kind}_energy_mJ",
        "mJ",
        f"energy of the {_ENERGY_KINDS[kind]}",
        Group.ENERGIES,
        outputs=(Output.AXIAL,) if kind == "bar" else (Output.ENERGIES,),
        of=lambda s: s.energies[kind],
    )


def _opening(unit: int) -> Quantity:
    return _shape(
        f"opening_{unit + 1}_mm",
        "mm",
        f"opening of unit {unit + 1} at its dome's axis, with what walls yield",
        lambda s: s.openings[unit],
        Group.OPENINGS,
    )


def _over(name: str, unit: str, description: str, of: Of, **more: Any) -> Quantity:
    about = {"outputs": (Output.BARRIERS,), "needs_bars": True, **more}
    return Quantity(name, unit, description, Group.BARRIERS, of=of, **about)


def _barrier(unit: int) -> Quantity:
    return _over(
        f"barrier_{unit + 1}_mJ",
        "mJ",
        f"energy that unit {unit + 1} needs to snap, or to reset where it is inverted",
        lambda s: s.barriers.energy[unit],
    )


LEAST = (
    _over(
        "least_barrier_mJ",
        "mJ",
        "the smallest of a state's barriers",
        lambda s: s.barriers.least,
    ),
    _over(
        "least_robust_unit",
        "",
        "the unit that it is of; all of them where they tie",
        lambda s: s.barriers.least_robust,
        kind=Kind.TEXT,
        is_always=True,
    ),
)
MISSED = _over(
    "n_saddles_not_found",
    "",
    "saddles of a state that exist and were not found",
    lambda s: s.barriers.n_not_found,
    kind=Kind.COUNT,
    is_always=True,
)  # no column: a sum of all states is said beside the table


def _gripper(name: str, unit: str, description: str, of: Of, kind: Kind = Kind.NUMBER) -> Quantity:
    return Quantity(name, unit, description, Group.GRIPPER, kind, outputs=(Output.SHAPES,), of=of)


_GRIPPER = (
    _gripper(
        "aperture_mm",
        "mm",
        "gap of the inner faces at the tips; < 0: crossed",
        lambda s: s.in_gripper.aperture,
    ),
    _gripper(
        "fingers_overlap",
        "",
        "the predicted fingers overlap",
        lambda s: s.in_gripper.overlaps,
        Kind.FLAG,
    ),
    _gripper(
        "upper_tip_x_mm",
        "mm",
        "x of the upper finger's tip in the gripper",
        lambda s: s.in_gripper.upper.base_x[-1],
    ),
    _gripper(
        "upper_tip_y_mm",
        "mm",
        "y of the upper finger's tip in the gripper",
        lambda s: s.in_gripper.upper.base_y[-1],
    ),
    _gripper(
        "lower_tip_x_mm",
        "mm",
        "x of the lower finger's tip in the gripper",
        lambda s: s.in_gripper.upper.base_x[-1],
    ),
    _gripper(
        "lower_tip_y_mm",
        "mm",
        "y of the lower finger's tip in the gripper",
        lambda s: -s.in_gripper.upper.base_y[-1],
    ),
)


def _uncertain(known: Uncertainty, is_gripper: bool) -> tuple[Quantity, ...]:
    """Standard uncertainties, what they cover, and each cause's share."""
    covers = Quantity(
        "uncertainty_covers",
        "",
        "what the standard uncertainties count in",
        Group.UNCERTAINTY,
        Kind.TEXT,
        of=lambda s: np.full(s.status.shape, known.covers),
        is_always=True,
    )
    return (*_UNCERTAINTY, *((_APERTURE,) if is_gripper else ()), covers, *shares(known).values())


def _uncertainty(name: str, unit: str, what: str, of: Of) -> Quantity:
    description = (
        f"standard uncertainty of the {what}, to first order; uncertainty_covers says of what"
    )
    return Quantity(name, unit, description, Group.UNCERTAINTY, of=of)


_UNCERTAINTY = (
    _uncertainty("tip_x_uncertainty_mm", "mm", "tip's x", lambda s: s.spread.pose[0]),
    _uncertainty("tip_y_uncertainty_mm", "mm", "tip's y", lambda s: s.spread.pose[1]),
    _uncertainty("tip_angle_uncertainty_rad", "rad", "tip's angle", lambda s: s.spread.pose[2]),
)
_APERTURE = _uncertainty("aperture_uncertainty_mm", "mm", "aperture", lambda s: s.spread.aperture)


def shares(known: Uncertainty) -> dict[str, Quantity]:
    """The uncertainty of the tip's place by each cause alone; the squares of all add up.

    >>> from dpgcli.design.scene import Step
    >>> [q.name for q in shares(Uncertainty((Step("stroke_mm", {}),), np.eye(1))).values()]
    ['tip_uncertainty_by_stroke_mm']
    """
    return {cause: _share(cause) for cause in known.causes}


def _share(cause: str) -> Quantity:
    return Quantity(
        f"tip_uncertainty_by_{without_unit(cause)}_mm",
        "mm",
        f"standard uncertainty of the tip's place by {cause} alone",
        Group.SHARES,
        of=lambda s: s.spread.shares[cause],
    )


_FINGERS = {"": "", "upper_": "the upper finger's ", "lower_": "the lower finger's "}
_LAYERS = {"B": "limiting-layer node", "T": "dome-axis node"}


def _nodes(n_units: int, *fingers: str) -> tuple[Quantity, ...]:
    """Node positions of one finger, or of the two of a gripper."""
    return tuple(
        _node(finger, layer, station, axis)
        for finger in fingers
        for station in range(n_units + 1)
        for layer in _LAYERS
        for axis in "xy"
    )


def _node(finger: str, layer: str, station: int, axis: str) -> Quantity:
    coordinate = f"{'base' if layer == 'B' else 'top'}_{axis}"
    sign = -1.0 if finger == "lower_" and axis == "y" else 1.0  # the mirror image

    def position(solved: SolvedFingers) -> NDArray[Any]:
        nodes = solved.in_gripper.upper if finger else solved.nodes
        return np.asarray(sign * getattr(nodes, coordinate)[station])

    return _shape(
        f"{finger}{layer}{station}_{axis}_mm",
        "mm",
        f"{axis} of {_FINGERS[finger]}{_LAYERS[layer]} {station}",
        position,
        Group.NODES,
    )
