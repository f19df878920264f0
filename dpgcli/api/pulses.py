"""`pulses`: the pulses of pressure that lead a finger from one state to another."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dpgcli.actuation.alone import thresholds_alone
from dpgcli.actuation.directions import Directions
from dpgcli.actuation.hindrances import hindrances
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.pulses import ABOVE, Intervals, intervals
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.sequences import Sequence, sequence
from dpgcli.actuation.tables import numbered
from dpgcli.api.graded import Graded, graded_for
from dpgcli.api.inputs import Settings, SpecInput, check_texts
from dpgcli.api.pressure import PressedInput, pressed_input
from dpgcli.api.tables import Table
from dpgcli.api.transitions import pressure_lines
from dpgcli.arrays import Columns, keep_freed_memory
from dpgcli.design.outputs import Output
from dpgcli.errors import ActuationError, Field, UsageError
from dpgcli.states.certify import Status
from dpgcli.states.columns import Column, Kind
from dpgcli.states.patterns import inverted_units
from dpgcli.text import counted, enumerated

MOST_UNITS = 16  # minutes of work
PRESSURES = (Output.PRESSURES,)
PULSE_COLUMNS = (
    Column("pulse", "", "number of the pulse", kind=Kind.COUNT),
    Column("line", "", "pressure line that it is on", kind=Kind.TEXT),
    Column("peak_pressure_MPa", "MPa", "where it turns back to zero", outputs=PRESSURES),
    Column("margin_MPa", "MPa", "from there to the nearest threshold", outputs=PRESSURES),
    Column("pattern_before", "", "pattern before the pulse", kind=Kind.PATTERN),
    Column("pattern_at_peak", "", "pattern at its peak", kind=Kind.PATTERN),
    Column("pattern_after", "", "pattern after it, at rest", kind=Kind.PATTERN),
    Column(
        "tie",
        "",
        "units whose thresholds on the way are the same within 1e-6, group by group: the model "
        "does not say which goes first",
        kind=Kind.TEXT,
    ),
)
INTERVAL_COLUMNS = (
    Column("line", "", "pressure line of the pulse", kind=Kind.TEXT),
    Column("direction", "", "+ up from zero, - down", kind=Kind.TEXT),
    Column("from_MPa", "MPa", "peaks from here", outputs=PRESSURES),
    Column("to_MPa", "MPa", "up to, but not at, here", outputs=PRESSURES),
    Column("pattern_at_peak", "", "pattern at such a peak", kind=Kind.PATTERN),
    Column("pattern_after", "", "pattern after it, at rest; empty: no state", kind=Kind.PATTERN),
)


@dataclass(frozen=True)
class PulsesResult:
    """The shortest sequence of pulses from a state to another, or why there is none.

    `given` is the spec with its lines; `start` and `target` are patterns. `reasons` say why no
    sequence exists; `graded` is one of the finger with other dome heights, if some were found.
    """

    given: PressedInput
    start: str
    target: str
    sequence: Sequence
    reasons: tuple[str, ...] = ()
    graded: Graded | None = None

    @property
    def exists(self) -> bool:
        """Whether pulses lead there."""
        return self.sequence.pulses is not None

    @property
    def heights(self) -> tuple[float, ...]:
        """Dome heights, mm, with which pulses lead there where they do not now; none if unknown."""
        return self.graded.heights if self.graded is not None and self.graded.holds else ()

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of pulses."""
        return PULSE_COLUMNS

    @cached_property
    def rows(self) -> Columns:
        """Pulses by column."""
        pulses, replay = self.sequence.pulses or (), self.sequence.replay
        n_units = self.given.pressed.finger.n_units
        at_peak, after = (replay.at_peak, replay.after) if replay else ((), ())
        ties = replay.ties if replay else ()
        return {
            "pulse": np.arange(1, len(pulses) + 1),
            "line": _texts([self.given.pressure.lines[pulse.line] for pulse in pulses]),
            "peak_pressure_MPa": np.array([pulse.peak for pulse in pulses], float),
            "margin_MPa": np.array([pulse.margin for pulse in pulses], float),
            "pattern_before": _patterns([pulse.source for pulse in pulses], n_units),
            "pattern_at_peak": _patterns(at_peak, n_units),
            "pattern_after": _patterns(after, n_units),
            "tie": _texts(["; ".join(map(numbered, groups)) for groups in ties]),
        }

    @cached_property
    def table(self) -> Table:
        """A row for each pulse."""
        return Table.of(self.columns, self.rows)

    @property
    def summary(self) -> tuple[str, ...]:
        """How many pulses, what is in the way, what pressures rest on: lines."""
        return tuple(self._lines())

    def _lines(self) -> Iterator[str]:
        way, found = f"from {self.start} to {self.target}", self.sequence
        if found.pulses is None:
            n_reached = counted(len(found.graph.code), "state")
            yield f"no pulses up to {found.reach:.4g} MPa lead {way}: {n_reached} can be reached"
            yield from self.reasons
        elif not found.pulses:
            yield f"{self.start} is the state to start from: no pulse is needed"
        else:
            smallest = min(pulse.margin for pulse in found.pulses)
            yield (
                f"{counted(len(found.pulses), 'pulse')} {way}, the fewest there are; smallest "
                f"margin {smallest:.4g} MPa; replayed from {self.start}, it ends there"
            )
            yield from _notes(found)
        yield from pressure_lines(self.given)


def _notes(found: Sequence) -> Iterator[str]:
    """Where no further threshold bounds a peak, and ties."""
    assert found.pulses is not None and found.replay is not None, "asked for pulses that exist"
    if opens := [str(k) for k, pulse in enumerate(found.pulses, 1) if pulse.is_open]:
        yield f"{_numbers(opens)}: no further threshold, the peak is {ABOVE:.0%} beyond the last"
    if tied := [str(k) for k, ties in enumerate(found.replay.ties, 1) if ties]:
        yield f"ties in {_numbers(tied)}: the model does not say which of these units goes first"


def _numbers(pulses: list[str]) -> str:
    return f"pulse{'s' * (len(pulses) > 1)} {enumerated(pulses)}"


@dataclass(frozen=True)
class LookupResult:
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
        found, n_units = self.intervals, self.given.pressed.finger.n_units
        towards = self.directions.take(found.lane)
        return {
            "line": _texts([self.given.pressure.lines[line] for line in towards.line]),
            "direction": _texts(["+" if sign > 0 else "-" for sign in towards.sign]),
            "from_MPa": found.low,
            "to_MPa": found.high,
            "pattern_at_peak": _patterns(found.at_peak.tolist(), n_units),
            "pattern_after": _patterns(found.after.tolist(), n_units),
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
        if n_tied := int(self.intervals.is_tie.sum()):
            yield (
                f"ties where {counted(n_tied, 'interval')} begin{'s' * (n_tied == 1)}: "
                "the model does not say which of these units goes first"
            )
        yield from pressure_lines(self.given)


def pulses(
    spec: SpecInput, *, target: str, start: str = "", settings: Settings = ()
) -> PulsesResult:
    """The shortest sequence of pulses of pressure that leads from a state to another.

    `target` and `start` are patterns such as "10110"; without a start all units are at rest.
    Each pulse raises or lowers one line and lets it go. The sequence is replayed by path following.
    Raises SpecError for a wrong spec, UsageError for patterns that are no stable states,
    ActuationError where the replay ends elsewhere.

    >>> found = pulses({"finger": {"units": 2, "overrides": {"2": {"lattice": {"stroke_mm": 4.5}}},
    ...     "lattice": {
    ...     "segment_length_mm": 13.5, "segment_height_mm": 10.75, "stroke_mm": 3.5,
    ...     "bistable_stiffness_N_per_mm": 12.84, "force_linearity": 0.043,
    ...     "hinge_stiffness_N_mm_per_rad": 24.2}}, "pressure": {"effective_area_mm2": 31.61}},
    ...     target="01")
    >>> found.table["pattern_after"].tolist(), found.table["peak_pressure_MPa"].round(4).tolist()
    (['11', '01'], [0.2115, -0.0742])
    """
    return pulses_of(pressed_input(spec, settings), target, start)


def pulses_of(given: PressedInput, target: str, start: str = "") -> PulsesResult:
    """The same, of what was read before."""
    begin, end = _code(given, "start", start), _code(given, "target", target)
    check_size(given)
    _check_state(given, "start", begin)
    keep_freed_memory()
    pressed, lines = given.pressed, given.pressure
    found = sequence(pressed, lines.line_of, begin, end)
    names = _pattern(begin, pressed), _pattern(end, pressed)
    if found.pulses is None:
        reasons = [*hindrances(pressed, lines.lines, lines.line_of, found)]
        graded = graded_for(given, found)
        return PulsesResult(given, *names, found, (*reasons, *graded.text), graded)
    if found.replay is not None and found.replay.problem:
        raise ActuationError(found, f"the sequence found does not hold: {found.replay.problem}")
    return PulsesResult(given, *names, found)


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
    begin = _code(given, "start", start)
    _check_state(given, "start", begin)
    pressed, line_of = given.pressed, given.pressure.line_of
    reach = thresholds_alone(pressed).reach
    code = np.array([begin], np.uint64)
    directions = Directions.of(np.zeros(1, np.int64), code, len(given.pressure.lines))
    found = intervals(pressed, line_of, reach, directions)
    return LookupResult(given, _pattern(begin, pressed), float(reach[0]), found, directions)


def check_size(given: PressedInput) -> None:
    """Raise UsageError for more states than there is time for."""
    n_units = given.pressed.finger.n_units
    if n_units > MOST_UNITS:
        raise UsageError(f"pulses of {n_units} units: expected at most {MOST_UNITS}")


def _code(given: PressedInput, field: str, pattern: str) -> int:
    """The code of a pattern; of none, that of rest. Raises UsageError for what is none."""
    check_texts(**{field: pattern})
    n_units = given.pressed.finger.n_units
    if not re.fullmatch(f"[01]{{{n_units}}}", pattern or "0" * n_units):
        raise UsageError(Field(field), f" {pattern}: expected {n_units} digits, 0 or 1")
    return int(pattern or "0", 2)


def _check_state(given: PressedInput, field: str, code: int) -> None:
    """Raise UsageError for a pattern that is no stable state."""
    status = _status(given.pressed, code)
    if status is not Status.STABLE:
        pattern = _pattern(code, given.pressed)
        raise UsageError(Field(field), f" {pattern}: expected a stable state, found {status.text}")


def _status(pressed: Pressed, code: int) -> Status:
    inverted = inverted_units(np.array([code], np.uint64), pressed.finger.n_units)
    return Status(at_rest(pressed, inverted)[1].status[0])


def _pattern(code: int, pressed: Pressed) -> str:
    return f"{code:0{pressed.finger.n_units}b}"


def _patterns(codes: Iterable[int], n_units: int) -> np.ndarray[tuple[int], np.dtype[np.bytes_]]:
    """Patterns by their codes, empty for −1."""
    return np.array([f"{c:0{n_units}b}" if c >= 0 else "" for c in codes], f"S{n_units}")


def _texts(words: Iterable[str]) -> np.ndarray[tuple[int], np.dtype[np.str_]]:
    return np.array([*words], np.str_)
