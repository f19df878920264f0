"""The columns of tables: name, unit, meaning, type."""

from dataclasses import field
from enum import StrEnum

from dpgcli.design.outputs import Output
from dpgcli.records import dataclass


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
    BARRIERS = "barriers"
    GRIPPER = "gripper"
    GRASP = "grasp"
    UNCERTAINTY = "uncertainty"
    SHARES = "uncertainty_shares"
    NODES = "nodes"


@dataclass(frozen=True)
class Column:
    """One column; `unit` is empty for text, flags and pure numbers.

    `outputs` are the kinds of outputs that it shows, none where it shows none of the model's.
    """

    name: str
    unit: str
    description: str
    group: Group = Group.STATES
    kind: Kind = Kind.NUMBER
    outputs: tuple[Output, ...] = field(default=(), kw_only=True)


REACHABLE = Column(
    "reachable",
    "",
    "whether pulses lead to it from rest",
    kind=Kind.FLAG,
    outputs=(Output.PRESSURES,),
)  # of states under pressure
