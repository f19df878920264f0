"""The columns of tables: name, unit, meaning, type."""

from dataclasses import dataclass
from enum import StrEnum


class Kind(StrEnum):
    """The type of a column: patterns are bytes, statuses codes, counts whole numbers."""

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
    SHARES = "uncertainty_shares"
    NODES = "nodes"


@dataclass(frozen=True)
class Column:
    """One column; `unit` is empty for text, flags and pure numbers."""

    name: str
    unit: str
    description: str
    group: Group = Group.STATES
    kind: Kind = Kind.NUMBER
