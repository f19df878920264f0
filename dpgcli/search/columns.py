"""Columns that targets are about: of states, as `predict`, `grasp` and `transitions` have them.

And of designs, as sweeps have them.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from dpgcli.design.dimensions import Design
from dpgcli.design.lines import units_by_line
from dpgcli.design.outputs import Output
from dpgcli.mechanics.terms import LOAD
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.columns import REACHABLE, Column, Kind
from dpgcli.states.quantities import Quantity, declared
from dpgcli.sweeps.evaluation import DesignEvaluation
from dpgcli.sweeps.metrics import METRICS

KINDS = ("bistable", "wall", "hinge", "bar", LOAD)
NUMBERS = (Kind.COUNT, Kind.NUMBER)
STEPWISE = (Kind.COUNT, Kind.FLAG)  # change at once, so that no search can follow their slopes
WAYS = {"up": 1, "down": -1}


class Direction(NamedTuple):
    """A line of pressure, by its place among the lines, and a sign: ±1."""

    line: int
    sign: int


def free_columns(n_units: int, *, is_gripper: bool) -> dict[str, Quantity]:
    """Those of states by themselves, by name: numbers that show the model's."""
    every = declared(n_units, KINDS, is_gripper)
    return {q.name: q for q in every if q.kind is Kind.NUMBER and q.outputs}


def body_columns(base: Design) -> dict[str, Column]:
    """Those of states with the base's body in their way, by name; none without one."""
    if base.body is None:
        return {}
    from dpgcli.grasping.release import turns
    from dpgcli.sweeps.grasps import grasp_columns

    has_friction, may_turn = base.friction is not None, turns(base.body, base.held)
    is_pair = bool(base.gripper)
    every = grasp_columns(is_pair=is_pair, has_friction=has_friction, may_turn=may_turn)
    return {column.name: column for column in every if column.kind in NUMBERS}


def directions(base: Design) -> dict[str, Direction]:
    """The columns of pressures at which states are left, each with the way that is gone."""
    if base.pressure is None:
        return {}
    return {
        f"pressure_{line}_{way}_MPa": Direction(place, sign)
        for place, line in enumerate(units_by_line(base.pressure, base.units))
        for way, sign in WAYS.items()
    }


def pressed_columns(base: Design) -> dict[str, Column]:
    """Those of states under the base's pressure, by name; none without a section on it.

    >>> from dpgcli.design.dimensions import GivenPressure, GivenValues
    >>> [*pressed_columns(Design(2, GivenValues(), (), pressure=GivenPressure()))]
    ['reachable', 'pressure_A_up_MPa', 'pressure_A_down_MPa']
    """
    lines = [*units_by_line(base.pressure, base.units)] if base.pressure else []
    found = {REACHABLE.name: REACHABLE} if lines else {}
    for name, (line, sign) in directions(base).items():
        way = "rises" if sign > 0 else "falls"
        what = f"pressure at which the state is left as line {lines[line]} {way}"
        found[name] = Column(name, "MPa", what, outputs=(Output.PRESSURES,))
    return found


def state_columns(base: Design, n_units: int) -> dict[str, Column]:
    """All of states of so many units, by name."""
    free = free_columns(n_units, is_gripper=bool(base.gripper))
    return {**free, **body_columns(base), **pressed_columns(base)}


def design_columns(base: Design) -> dict[str, Column]:
    """Numbers of whole designs around a base, by name, as sweeps have them."""
    own = {column.name for column in evaluation_of(base, {}).design_columns}
    return {
        metric.name: plain(metric)
        for metric in METRICS
        if metric.name in own and metric.kind in NUMBERS
    }


def evaluation_of(base: Design, values: Mapping[str, Column]) -> DesignEvaluation:
    """That of a sweep around a base, over values that keys can have."""
    return DesignEvaluation(base, {}, _is_possible, values, (), DEFAULT_TOLERANCE)


def _is_possible(values: Mapping[str, float]) -> str:
    raise ValueError(f"ranges and lists have values that keys can have: {values}")


def plain(column: Column) -> Column:
    """A column without the way in which it is found."""
    kind = column.kind
    return Column(column.name, column.unit, column.description, kind=kind, outputs=column.outputs)


def renamed(column: Column, name: str) -> Column:
    """The same column by another name."""
    return replace(plain(column), name=name)
