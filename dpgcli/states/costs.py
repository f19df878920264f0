"""Estimates of a plan's run time and memory, good to a factor of two either way."""

from typing import TYPE_CHECKING

from dpgcli.states.columns import Group
from dpgcli.states.settle import lanes_at_once

if TYPE_CHECKING:
    from dpgcli.states.pairs.halves import Split

# Measured on one core of a 2020s server, in seconds.
UNIT_STATE_SECONDS = {"chain": 1.0e-6, "lattice": 2.5e-6}
PAIR_SECONDS = 1.0e-6
EIGENVALUE_SECONDS = 4e-9  # times the cube of the number of unknowns
LOADED_SECONDS = 1.5e-5  # times the square of the number of units: loads are followed
BARRIER_SECONDS = 1.0e-5  # times the square of the number of units
START_SECONDS = 0.3
LIBRARY_BYTES = 96 * 2**20  # bytes
ROWS_WRITTEN, COPIES_WRITTEN = 2**17, 4  # of a table, at once; fewer rows of more columns
COLUMNS_WRITTEN = 32


def seconds(
    formulation: str,
    split: "Split | None",
    n: int,
    n_states: int,
    groups: set[Group],
    *,
    is_loaded: bool = False,
) -> float:
    """Run time of a plan, seconds: its states, once the program has started."""
    per_unit = UNIT_STATE_SECONDS[formulation]
    if split is not None:
        length = n // 2 + split.context
        return START_SECONDS + split.n_solves * length * per_unit + n_states * PAIR_SECONDS
    eigenvalue = EIGENVALUE_SECONDS * (4 * n) ** 3 if Group.EIGENVALUE in groups else 0.0
    barrier = BARRIER_SECONDS * n * n if Group.BARRIERS in groups else 0.0
    load = LOADED_SECONDS * n * n if is_loaded else 0.0
    return START_SECONDS + n_states * (n * per_unit + load + eigenvalue + barrier)


def rows_at_once(n_columns: int) -> int:
    """Rows of a table that are gathered before they are written: a wide one's are fewer."""
    return ROWS_WRITTEN * COLUMNS_WRITTEN // max(n_columns, COLUMNS_WRITTEN)


def peak_bytes(split: "Split | None", n: int, n_states: int, n_columns: int) -> int:
    """Interpreter and libraries, one batch with its temporaries, tables and rows to be written."""
    batch = min(lanes_at_once(n), n_states) * n * 8 * 150
    row = n_columns * 8 + 4 * n
    written = min(n_states, rows_at_once(n_columns)) * row * COPIES_WRITTEN
    halves = 0 if split is None else split.n_solves * 8 * 24
    return LIBRARY_BYTES + batch + written + halves
