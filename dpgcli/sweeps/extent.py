"""Extent of a sweep before it begins: longest finger, states, time, disk; and its limits."""

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dpgcli.design.dimensions import MAX_UNITS, UNITS
from dpgcli.errors import UsageError
from dpgcli.records import dataclass
from dpgcli.states.costs import START_SECONDS, UNIT_STATE_SECONDS
from dpgcli.states.patterns import MOST_SELECTED
from dpgcli.sweeps.executors import chunked
from dpgcli.sweeps.space import Space

DESIGN_SECONDS = 2e-5  # of a design, its states aside; measured
BYTES_PER_STATE = 120  # in the tables and, while they are made, in the parts
FILE_BYTES, DESIGN_FILE_BYTES = 40 * 2**10, 14  # of empty tables and parts, of a design; measured
PROCESS_BYTES, DESIGN_BYTES, VALUE_BYTES = 400 * 2**20, 350, 24  # in memory; measured
PRESSED_SECONDS = 1.3e-4  # of a unit of a state under pressure; measured
MOST_PRESSED = 12  # units: longer fingers take minutes each
MOST_CHUNKS = 10**6  # days of work, and a file each
MOST_SENT = 2**22  # states of a design, about 250 MB
MOST_ASKED = 10**6  # designs that are held against constraints before the work
LONG = 15  # units, from which on the longest finger matters
ASKED_AT_ONCE = 2**14


@dataclass(frozen=True)
class Extent:
    """Extent of a sweep; constraints count where there are long fingers that they may exclude.

    `base_units` is the number of units where the space leaves it alone. `allowed` says, if there
    are constraints, which designs meet them, from their values by key. With `has_pressure` every
    state is followed under pressure, too. With a body a state takes `body_seconds` times the square
    of its units more.
    """

    space: Space
    base_units: int
    allowed: Callable[[Mapping[str, NDArray[Any]]], NDArray[np.bool_]] | None = None
    has_pressure: bool = False
    body_seconds: float = 0.0

    @cached_property
    def most_units(self) -> int:
        """Units of the longest finger."""
        longest = max(self._units, default=1)
        size = self.space.size
        if longest < LONG or self.allowed is None or size > MOST_ASKED:
            return longest
        return max(self._allowed_units(self.allowed), default=1)

    @property
    def n_states(self) -> int:
        """States of all designs up to the longest, had no constraint anything against them."""
        size, longest = self.space.size, self.most_units
        states = sum(count << n for n, count in self._units.items() if n <= longest)
        return states * size // len(self._axis)

    @property
    def bytes_needed(self) -> int:
        """Bytes on the disk, at most at once: parts, and the tables that are made of them."""
        return self.bytes_of(self.n_states)

    def bytes_of(self, n_states: int) -> int:
        """The same, with another number of states."""
        return FILE_BYTES + self.space.size * DESIGN_FILE_BYTES + 2 * n_states * BYTES_PER_STATE

    @property
    def bytes_in_memory(self) -> int:
        """Of the largest process: libraries and blocks, the axes, the table of designs at the end.

        Workers hold one block of states each, a third of that.
        """
        space = self.space
        numbers = sum(len(axis) * len(axis.values) for axis in space.axes)
        of_designs = space.size * (DESIGN_BYTES + VALUE_BYTES * len(space.keys))
        return PROCESS_BYTES + 8 * numbers + of_designs

    @property
    def seconds(self) -> float:
        """Seconds of one core, good to a factor of two either way."""
        return self.seconds_of(self.n_states)

    def seconds_of(self, n_states: int) -> float:
        """The same, with another number of states."""
        of_unit = UNIT_STATE_SECONDS["chain"] + (PRESSED_SECONDS if self.has_pressure else 0.0)
        of_states = n_states * (self.most_units * of_unit + self.most_units**2 * self.body_seconds)
        return START_SECONDS + self.space.size * DESIGN_SECONDS + of_states

    def check(self, chunk_size: int, *, is_sent: bool) -> None:
        """Refuse what no machine should begin; raises UsageError.

        `is_sent` says that workers send what they have done, each design in one piece.
        """
        size, n_chunks = self.space.size, self.space.size // chunk_size
        if n_chunks > MOST_CHUNKS:
            raise UsageError(
                f"{size:,} designs in {n_chunks:,} chunks of work: expected at most "
                f"{MOST_CHUNKS:,}; take fewer values or units"
            )
        if self.has_pressure and self.most_units > MOST_PRESSED:
            raise UsageError(
                f"a finger of {self.most_units} units under pressure: expected at most "
                f"{MOST_PRESSED}; take fewer units, or the section pressure out of the base"
            )
        n_states, most = 2**self.most_units, MOST_SENT if is_sent else MOST_SELECTED
        if n_states > most:
            what = "that a worker of a cluster can send" if is_sent else "that a design may have"
            raise UsageError(
                f"a finger of {self.most_units} units has {n_states:,} states, more than the "
                f"{most:,} {what}: take fewer units, or exclude long fingers by a constraint"
            )

    @property
    def _axis(self) -> NDArray[Any]:
        """The numbers of units at the points of their axis, or that of the base."""
        swept = (axis.values[UNITS] for axis in self.space.axes if UNITS in axis.values)
        return next(swept, np.array([self.base_units]))

    @cached_property
    def _units(self) -> dict[int, int]:
        return _counted(self._axis)

    def _allowed_units(
        self, are_allowed: Callable[[Mapping[str, NDArray[Any]]], NDArray[np.bool_]]
    ) -> Iterator[int]:
        """Numbers of units that some design has which no constraint excludes."""
        space = self.space
        for chunk in chunked([(0, space.size)], ASKED_AT_ONCE):
            values = space.designs(chunk.start, chunk.stop)
            allowed = are_allowed(values)
            units = values.get(UNITS, np.full(len(allowed), self.base_units))
            yield from _counted(units[allowed])


def size_text(n_bytes: float) -> str:
    """A number of bytes as people say it."""
    for unit in ("bytes", "KiB", "MiB", "GiB"):
        if n_bytes < 1024:
            return f"{n_bytes:.2g} {unit}" if n_bytes < 10 else f"{n_bytes:.0f} {unit}"
        n_bytes /= 1024
    return f"{n_bytes:,.4g} TiB"


def time_text(seconds: float) -> str:
    """A time as people say it.

    >>> time_text(0.42), time_text(90), time_text(1e6)
    ('0.42 s', '1.5 min', '11.6 days')
    """
    for unit, size in (("days", 86_400), ("h", 3600), ("min", 60)):
        if seconds >= size:
            return f"{seconds / size:,.1f} {unit}"
    return f"{seconds:.2g} s"


def _counted(units: NDArray[Any]) -> dict[int, int]:
    """Counts of each possible number of units among these."""
    possible = units[(units >= 1) & (units <= MAX_UNITS)]
    values, counts = np.unique(possible.astype(np.int64), return_counts=True)
    return dict(zip(values.tolist(), counts.tolist(), strict=True))
