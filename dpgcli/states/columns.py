"""The columns of a table of states, declared once: name, unit, type and meaning."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from dpgcli.errors import Field, UsageError


class Kind(StrEnum):
    """What a column holds; patterns are bytes, statuses codes, counts whole numbers."""

    PATTERN = "pattern"
    STATUS = "status"
    TEXT = "text"
    COUNT = "count"
    NUMBER = "number"
    FLAG = "flag"


class Group(StrEnum):
    """Columns that are asked for, and paid for, together."""

    STATES = "states"
    EIGENVALUE = "eigenvalue"
    STIFFNESS = "stiffness"
    ENERGIES = "energies"
    OPENINGS = "openings"
    GRIPPER = "gripper"
    UNCERTAINTY = "uncertainty"
    NODES = "nodes"


@dataclass(frozen=True)
class Column:
    """One column; `unit` is empty for text, flags and pure numbers."""

    name: str
    unit: str
    description: str
    group: Group
    kind: Kind = Kind.NUMBER


def declared(
    n_units: int, energy_kinds: Sequence[str], is_gripper: bool, *, is_fitted: bool = False
) -> tuple[Column, ...]:
    """All columns that a scene can have, in the order of every table.

    >>> [c.name for c in declared(3, ("bistable", "hinge"), False)][:4]
    ['pattern', 'status', 'tip_x_mm', 'tip_y_mm']
    """
    return (
        *_STATES[:6],
        *_EIGENVALUE,
        *_STATES[6:],
        *_STIFFNESS,
        *(
            Column(f"{kind}_energy_mJ", "mJ", f"energy of the {text}", Group.ENERGIES)
            for kind, text in _ENERGY_KINDS.items()
            if kind in energy_kinds
        ),
        *(
            Column(f"opening_{i}_mm", "mm", f"extension x of unit {i}'s spring", Group.OPENINGS)
            for i in range(1, n_units + 1)
        ),
        *(_GRIPPER if is_gripper else ()),
        *(_UNCERTAINTY if is_fitted else ()),
        *_node_columns(n_units, is_gripper),
    )


def named(columns: Sequence[Column], names: Sequence[str]) -> tuple[Column, ...]:
    """The declared columns that are named, each by its name or its group's.

    Raises UsageError for names that are neither, with what there is.
    """
    unknown = [n for n in names if n not in {c.name for c in columns} | {c.group for c in columns}]
    if unknown:
        groups = ", ".join(dict.fromkeys(c.group for c in columns))
        single = ", ".join(c.name for c in columns if c.group is not Group.NODES)
        raise UsageError(
            Field("columns"),
            f": {', '.join(unknown)} unknown for this scene; "
            f"groups: default, all, {groups}; columns: {single}",
        )
    return tuple(c for c in columns if c.name in names or c.group in names)


_STATES = (
    Column(
        "pattern", "", "activation pattern, unit 1 first, 1 = inverted", Group.STATES, Kind.PATTERN
    ),
    Column("status", "", "stable where certified, else why not", Group.STATES, Kind.STATUS),
    Column("tip_x_mm", "mm", "x of the tip, the last limiting-layer node", Group.STATES),
    Column("tip_y_mm", "mm", "y of the tip; negative is the inner side", Group.STATES),
    Column("tip_angle_rad", "rad", "rotation of the last strut; negative = curled", Group.STATES),
    Column("energy_mJ", "mJ", "potential energy of the state", Group.STATES),
    Column("residual_N", "N", "largest unbalanced force; moments over the lever H", Group.STATES),
    Column("tip_error_mm", "mm", "estimated numerical error of the tip position", Group.STATES),
    Column(
        "reached_pattern",
        "",
        "the pattern whose wells the units are in",
        Group.STATES,
        Kind.PATTERN,
    ),
)
_EIGENVALUE = (
    Column(
        "min_eigenvalue_N_per_mm",
        "N/mm",
        "smallest eigenvalue of the Hessian in node coordinates",
        Group.EIGENVALUE,
    ),
)
_STIFFNESS = (
    Column(
        "tip_stiffness_min_N_per_mm", "N/mm", "tip force per travel, softest way", Group.STIFFNESS
    ),
    Column("tip_stiffness_max_N_per_mm", "N/mm", "the same, stiffest way", Group.STIFFNESS),
    Column("tip_compliance_xx_mm_per_N", "mm/N", "tip x by a force along x", Group.STIFFNESS),
    Column("tip_compliance_xy_mm_per_N", "mm/N", "tip y by a force along x", Group.STIFFNESS),
    Column("tip_compliance_yy_mm_per_N", "mm/N", "tip y by a force along y", Group.STIFFNESS),
    Column(
        "tip_compliance_x_angle_rad_per_N", "rad/N", "tip angle by a force along x", Group.STIFFNESS
    ),
    Column(
        "tip_compliance_y_angle_rad_per_N", "rad/N", "tip angle by a force along y", Group.STIFFNESS
    ),
    Column(
        "tip_compliance_angle_rad_per_N_mm",
        "rad/(N mm)",
        "tip angle by a moment at the tip",
        Group.STIFFNESS,
    ),
)
_ENERGY_KINDS = {"bistable": "bistable springs", "hinge": "hinges", "bar": "bars"}
_GRIPPER = (
    Column("aperture_mm", "mm", "gap of the inner faces at the tips; < 0: crossed", Group.GRIPPER),
    Column("fingers_overlap", "", "the predicted fingers overlap", Group.GRIPPER, Kind.FLAG),
    Column("upper_tip_x_mm", "mm", "x of the upper finger's tip in the gripper", Group.GRIPPER),
    Column("upper_tip_y_mm", "mm", "y of the upper finger's tip in the gripper", Group.GRIPPER),
    Column("lower_tip_x_mm", "mm", "x of the lower finger's tip in the gripper", Group.GRIPPER),
    Column("lower_tip_y_mm", "mm", "y of the lower finger's tip in the gripper", Group.GRIPPER),
)


_UNCERTAINTY = tuple(
    Column(
        f"tip_{name}",
        unit,
        f"standard uncertainty of the tip's {what} by the errors of fitted values, to first order",
        Group.UNCERTAINTY,
    )
    for name, unit, what in (
        ("x_uncertainty_mm", "mm", "x"),
        ("y_uncertainty_mm", "mm", "y"),
        ("angle_uncertainty_rad", "rad", "angle"),
    )
)


def _node_columns(n_units: int, is_gripper: bool) -> tuple[Column, ...]:
    fingers = (("upper_", "the upper finger's "), ("lower_", "the lower finger's "))
    layers = (("B", "limiting-layer node"), ("T", "dome-axis node"))
    return tuple(
        Column(f"{finger}{node}{i}_{axis}_mm", "mm", f"{axis} of {whose}{what} {i}", Group.NODES)
        for finger, whose in (fingers if is_gripper else (("", ""),))
        for i in range(n_units + 1)
        for node, what in layers
        for axis in "xy"
    )
