"""`lookup`: what single pulses of all sizes do to a state."""

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from dpgcli.actuation.alone import thresholds_alone
from dpgcli.actuation.directions import Directions
from dpgcli.actuation.pulses import Intervals, intervals
from dpgcli.api.inputs import Settings, SpecInput
from dpgcli.api.pressed_states import begin_of, pattern_of, patterns_of
from dpgcli.api.pressure import PressedInput, pressed_input
from dpgcli.api.tables import Table, TableResult
from dpgcli.api.transitions import pressure_lines
from dpgcli.arrays import Columns
from dpgcli.design.outputs import Output
from dpgcli.records import dataclass
from dpgcli.states.columns import Column, Kind
from dpgcli.text import counted

PRESSURES = (Output.PRESSURES,)
INTERVAL_COLUMNS = (
    Column("line", "", "pressure line of the pulse", kind=Kind.TEXT),
    Column("direction", "", "+ up from zero, - down", kind=Kind.TEXT),
    Column("from_MPa", "MPa", "peaks from here", outputs=PRESSURES),
    Column("to_MPa", "MPa", "up to, but not at, here", outputs=PRESSURES),
    Column("pattern_at_peak", "", "pattern at such a peak; empty: not known", kind=Kind.PATTERN),
    Column("pattern_after", "", "pattern after it, at rest; empty: no state", kind=Kind.PATTERN),
)


@dataclass(frozen=True)
class LookupResult(TableResult):
    """The look-up table of a controller: what single pulses do to a state, line by line."""

    given: PressedInput
    start: str
    reach: float
    intervals: Intervals
    directions: Directions

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of intervals."""
        return INTERVAL_COLUMNS

    @cached_property
    def rows(self) -> Columns:
        """Intervals by column, those of a line up, then down."""
        found = self.intervals
        towards = self.directions.take(found.lane)
        return {
            "line": np.array([self.given.pressure.lines[line] for line in towards.line]),
            "direction": np.array(["+" if sign > 0 else "-" for sign in towards.sign]),
            "from_MPa": found.low,
            "to_MPa": found.high,
            "pattern_at_peak": patterns_of(self.given, found.at_peak.tolist()),
            "pattern_after": patterns_of(self.given, found.after.tolist()),
        }

    @cached_property
    def table(self) -> Table:
        """A row for each interval."""
        return Table.of(self.columns, self.rows)

    @property
    def summary(self) -> tuple[str, ...]:
        """How far pressures went, ties, what pressures rest on: lines."""
        return tuple(self._lines())

    def _lines(self) -> Iterator[str]:
        yield f"single pulses from {self.start}, up to {self.reach:.4g} MPa"
        if n_unknown := int((self.intervals.at_peak < 0).sum()):
            yield (
                f"{counted(n_unknown, 'interval')} without patterns: the finger folds onto itself "
                "before, or no equilibrium is found"
            )
        if n_tied := int(self.intervals.is_tie.sum()):
            yield (
                f"ties where {counted(n_tied, 'interval')} begin{'s' * (n_tied == 1)}: "
                "the model does not say which of these units goes first"
            )
        yield from pressure_lines(self.given)


def lookup(spec: SpecInput, *, start: str = "", settings: Settings = ()) -> LookupResult:
    """What single pulses of all sizes do to a state: the look-up table of a controller.

    Raises SpecError for a wrong spec, UsageError for a start that is no stable state.

    >>> found = lookup({"finger": {"units": 1, "lattice": {
    ...     "segment_length_mm": 13.5, "segment_height_mm": 10.75, "stroke_mm": 3.5,
    ...     "bistable_stiffness_N_per_mm": 12.84, "force_linearity": 0.043,
    ...     "hinge_stiffness_N_mm_per_rad": 24.2}}})
    >>> found.table["from_MPa"].round(4).tolist(), found.table["pattern_after"].tolist()
    ([0.0, 0.1495, 0.0], ['0', '1', '0'])
    """
    return lookup_of(pressed_input(spec, settings), start)


def lookup_of(given: PressedInput, start: str = "") -> LookupResult:
    """The same, of what was read before."""
    begin = begin_of(given, start)
    pressed, line_of = given.pressed, given.pressure.line_of
    reach = thresholds_alone(pressed).reach
    code = np.array([begin], np.uint64)
    directions = Directions.of(np.zeros(1, np.int64), code, len(given.pressure.lines))
    found = intervals(pressed, line_of, reach, directions)
    return LookupResult(given, pattern_of(given, begin), float(reach[0]), found, directions)
