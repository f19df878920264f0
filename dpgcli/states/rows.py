"""Rows of a table of states: patterns solved, certified and told by the quantities asked for."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dpgcli.arrays import Array, Columns, Flags
from dpgcli.mechanics.terms import Formulate
from dpgcli.records import dataclass
from dpgcli.states.certify import Status
from dpgcli.states.columns import Column, Group, Kind
from dpgcli.states.quantities import Quantity, rows
from dpgcli.states.settle import settle
from dpgcli.states.solved import ALONE, SolvedFingers, Surroundings
from dpgcli.states.units import UnitSolutions


def as_text(column: Column, values: NDArray[Any]) -> NDArray[Any]:
    """Patterns and statuses as strings; all else unchanged.

    >>> codes = np.array([Status.STABLE, Status.FOLDED])
    >>> as_text(Column("status", "", "", kind=Kind.STATUS), codes).tolist()
    ['stable', 'folded']
    """
    if column.kind is Kind.PATTERN:
        return np.asarray(values.astype(str))
    if column.kind is Kind.STATUS:
        return np.asarray(np.array([status.text for status in Status])[values])
    return values


@dataclass(frozen=True)
class RowRequest:
    """The quantities of rows and their accuracy, which a plan decides for all batches.

    `around` and `dropped_error`, the error of the tip (mm) by what the units lack of the scene,
    are for all states, or by lane. Quantities that need the scene's bars are NaN without these.
    """

    formulate: Formulate
    tolerance: float
    quantities: tuple[Quantity, ...]
    around: Surroundings = ALONE
    dropped_error: float | Array = 0.0
    has_bars: bool = True


def solved_rows(units: UnitSolutions, inverted: Flags, request: RowRequest) -> Columns:
    """Rows of these patterns, (unit, state), each solved and certified as a whole finger.

    The units have one design, or one for each state.
    """
    settled = settle(units, request.formulate, inverted, request.tolerance)
    told = [q for q in request.quantities if request.has_bars or not q.needs_bars]
    has_stiffness = any(q.group is Group.STIFFNESS for q in told)
    over = None
    if any(q.group is Group.BARRIERS for q in told):
        from dpgcli.states.barriers import barriers

        over = barriers(units, request.formulate, settled, request.tolerance)
    solved = SolvedFingers.of(
        settled, request.around, request.dropped_error, with_compliance=has_stiffness, barriers=over
    )
    unknown = np.full(inverted.shape[1], np.nan)
    return dict.fromkeys((q.name for q in request.quantities), unknown) | rows(solved, told)
