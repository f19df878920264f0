"""`pulses`: the pulses of pressure that lead a finger from one state to another."""

from collections.abc import Iterable, Iterator
from functools import cached_property

import numpy as np

from dpgcli.actuation.hindrances import hindrances
from dpgcli.actuation.pulses import ABOVE, Pulse
from dpgcli.actuation.scatter import Reliability, reliability
from dpgcli.actuation.sequences import PulseSequence, pulse_sequence
from dpgcli.actuation.tables import numbered
from dpgcli.api.graded import Graded, graded_for
from dpgcli.api.inputs import Settings, SpecInput
from dpgcli.api.pressed_states import begin_of, code_of, pattern_of, patterns_of
from dpgcli.api.pressure import PressedInput, pressed_input
from dpgcli.api.scatter import (
    CONFIDENCE,
    SHARE,
    Draws,
    ScatterInput,
    drawn_by,
    share_interval,
)
from dpgcli.api.tables import Table, TableResult
from dpgcli.api.transitions import failed_searches, pressure_lines
from dpgcli.arrays import Columns, keep_freed_memory
from dpgcli.design.outputs import Output
from dpgcli.errors import ActuationError, UsageError
from dpgcli.records import dataclass
from dpgcli.states.columns import Column, Kind
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
SCATTER_COLUMNS = (
    Column("probability", "", "share of draws in this pattern after the pulses so far"),
    Column("probability_low", "", "its 95 % confidence interval, Clopper-Pearson: from"),
    Column("probability_high", "", "to"),
    Column(
        "window_from_MPa", "MPa", "peaks of which 95 % of draws do this pulse", outputs=PRESSURES
    ),
    Column(
        "window_to_MPa",
        "MPa",
        "up to here; infinite, by its sign, where nothing ends it",
        outputs=PRESSURES,
    ),
)


@dataclass(frozen=True)
class ScatteredPulses:
    """What scatter does to a sequence: the draws, and how reliably it leads each to its state.

    `from_rest`: each from where it rests itself, as no start is given.
    """

    draws: Draws
    found: Reliability
    from_rest: bool

    @property
    def probability(self) -> float:
        """The share of draws that end in the state; where no pulse is needed, that are in it."""
        return self.found.n_done / self.found.n_draws

    @property
    def interval(self) -> tuple[float, float]:
        """Its 95 % confidence interval."""
        return share_interval(self.found.n_done, self.found.n_draws)


@dataclass(frozen=True)
class PulsesResult(TableResult):
    """The shortest sequence of pulses from a state to another, or why there is none.

    `given` is the spec with its lines; `start` and `end` are patterns. `reasons` say why no
    sequence exists; `graded` is one of the finger with other dome heights, if some were found, and
    `scattered` what scatter does to it, if that was asked for.
    """

    given: PressedInput
    start: str
    end: str
    sequence: PulseSequence
    reasons: tuple[str, ...] = ()
    graded: Graded | None = None
    scattered: ScatteredPulses | None = None

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
        return (*PULSE_COLUMNS, *(SCATTER_COLUMNS if self.scattered is not None else ()))

    @cached_property
    def rows(self) -> Columns:
        """Pulses by column."""
        pulses, replay = self.sequence.pulses or (), self.sequence.replay
        at_peak, after = (replay.at_peak, replay.after) if replay else ((), ())
        ties = replay.ties if replay else ()
        rows: Columns = {
            "pulse": np.arange(1, len(pulses) + 1),
            "line": _texts([self.given.pressure.lines[pulse.line] for pulse in pulses]),
            "peak_pressure_MPa": np.array([pulse.peak for pulse in pulses], float),
            "margin_MPa": np.array([pulse.margin for pulse in pulses], float),
            "pattern_before": patterns_of(self.given, [pulse.source for pulse in pulses]),
            "pattern_at_peak": patterns_of(self.given, at_peak),
            "pattern_after": patterns_of(self.given, after),
            "tie": _texts(["; ".join(map(numbered, groups)) for groups in ties]),
        }
        return rows if self.scattered is None else rows | _scatter_rows(self.scattered, pulses)

    @cached_property
    def table(self) -> Table:
        """A row for each pulse."""
        return Table.of(self.columns, self.rows)

    @property
    def summary(self) -> tuple[str, ...]:
        """How many pulses, what is in the way, what pressures rest on: lines."""
        return tuple(self._lines())

    def _lines(self) -> Iterator[str]:
        way, found = f"from {self.start} to {self.end}", self.sequence
        if found.pulses is None:
            unknown, states = found.graph.n_unknown, counted(len(found.graph.code), "state")
            lead, can_be = ("are found", "found to be") if unknown else ("lead", "can be")
            yield f"no pulses up to {found.reach:.4g} MPa {lead} {way}: {states} {can_be} reached"
            if unknown:
                yield f"{failed_searches(unknown)}: more may be reached"
            yield from self.reasons
        elif not found.pulses:
            yield f"{self.start} is the state to start from: no pulse is needed"
        else:
            smallest, size = min((pulse.margin, abs(pulse.peak)) for pulse in found.pulses)
            unknown = found.graph.n_unknown
            yield (
                f"{counted(len(found.pulses), 'pulse')} {way}, the fewest "
                f"{'found' if unknown else 'there are'}; smallest "
                f"margin {smallest:.4g} MPa, {100.0 * smallest / size:.2g}% of its peak; "
                f"replayed from {self.start}, it ends there"
            )
            if unknown and len(found.pulses) > 1:
                yield f"{failed_searches(unknown)}: fewer pulses may do"
            yield from _notes(found)
        if self.scattered is not None:
            yield from self._scatter_lines(self.scattered)
        yield from pressure_lines(self.given)

    def _scatter_lines(self, scattered: ScatteredPulses) -> Iterator[str]:
        yield from scattered.draws.lines
        found, pulses = scattered.found, self.sequence.pulses
        begin = "rest" if scattered.from_rest else "begin"
        if pulses and found.n_begun < found.n_draws:
            yield f"{counted(found.n_begun, 'draw')} of {found.n_draws:,} {begin} in {self.start}"
        if n := found.n_unknown:
            none = "no certified state"
            why = (
                f"unknown: at rest in {none}; counted as failures"
                if scattered.from_rest
                else f"with {none} {self.start}: counted as failures"
            )
            yield f"{counted(n, 'draw')} {why}"
        low, high = scattered.interval
        yield (
            f"{scattered.probability:.1%} of draws {'end' if pulses else begin} in {self.end} "
            f"({CONFIDENCE:.0%} confidence: {low:.1%} to {high:.1%})"
        )
        empty = np.isnan(found.windows[:, 0])
        if narrow := [str(k) for k, is_empty in enumerate(empty, 1) if is_empty]:
            yield f"{_numbers(narrow)}: no peak leads {SHARE:.0%} of draws on"


def _scatter_rows(scattered: ScatteredPulses, pulses: Iterable[Pulse]) -> Columns:
    """What scatter does to each pulse, by column."""
    found = scattered.found
    ends = np.array([share_interval(int(n), found.n_draws) for n in found.n_led]).reshape(-1, 2)
    windows = found.windows * np.array([np.sign(pulse.peak) for pulse in pulses])[:, None]
    return {
        "probability": found.n_led / found.n_draws,
        "probability_low": ends[:, 0],
        "probability_high": ends[:, 1],
        "window_from_MPa": windows[:, 0],
        "window_to_MPa": windows[:, 1],
    }


def _notes(found: PulseSequence) -> Iterator[str]:
    """Where no further threshold bounds a peak, and ties."""
    assert found.pulses is not None and found.replay is not None, "asked for pulses that exist"
    if opens := [str(k) for k, pulse in enumerate(found.pulses, 1) if pulse.is_open]:
        yield f"{_numbers(opens)}: no further threshold, the peak is {ABOVE:.0%} beyond the last"
    if tied := [str(k) for k, ties in enumerate(found.replay.ties, 1) if ties]:
        yield f"ties in {_numbers(tied)}: the model does not say which of these units goes first"


def _numbers(pulses: list[str]) -> str:
    return f"pulse{'s' * (len(pulses) > 1)} {enumerated(pulses)}"


def pulses(
    spec: SpecInput,
    *,
    end: str,
    start: str = "",
    scatter: ScatterInput | None = None,
    draws: int | None = None,
    seed: int | None = None,
    settings: Settings = (),
) -> PulsesResult:
    """The shortest sequence of pulses of pressure that leads from a state to another.

    `end` and `start` are patterns such as "10110"; without a start that in which the finger rests.
    Each pulse raises or lowers one line and lets it go. The sequence is replayed by path following.
    `scatter`, such as "dome_thickness_mm=2%,dome_height_mm=0.1mm", are standard deviations of
    values around those of the spec: so many `draws` of fingers, 1000 unless given, are followed,
    without a start each from where it rests itself.
    Raises SpecError for a wrong spec or scatter, UsageError for patterns that are no stable states
    and other wrong choices, ActuationError where the replay ends elsewhere.

    >>> found = pulses({"finger": {"units": 2, "overrides": {"2": {"lattice": {"stroke_mm": 4.5}}},
    ...     "lattice": {
    ...     "segment_length_mm": 13.5, "segment_height_mm": 10.75, "stroke_mm": 3.5,
    ...     "bistable_stiffness_N_per_mm": 12.84, "force_linearity": 0.043,
    ...     "hinge_stiffness_N_mm_per_rad": 24.2}}, "pressure": {"effective_area_mm2": 31.61}},
    ...     end="01", scatter="stroke_mm=1%", draws=100)
    >>> found.table["pattern_after"].tolist(), found.table["peak_pressure_MPa"].round(4).tolist()
    (['11', '01'], [0.2115, -0.0742])
    >>> found.scattered.probability
    1.0
    """
    given = pressed_input(spec, settings)
    drawn = drawn_by(given, scatter, draws, seed)
    return pulses_of(given, end, start, drawn)


def pulses_of(
    given: PressedInput, end: str, start: str = "", draws: Draws | None = None
) -> PulsesResult:
    """The same, of what was read before."""
    target = code_of(given, "end", end)
    check_size(given)
    begin = begin_of(given, start)
    keep_freed_memory()
    pressed, lines = given.pressed, given.pressure
    found = pulse_sequence(pressed, lines.line_of, begin, target)
    names = pattern_of(given, begin), pattern_of(given, target)
    if found.pulses is None:
        reasons = [*hindrances(pressed, lines.lines, lines.line_of, found)]
        graded = graded_for(given, found)
        said = () if draws is None else ("scatter: without pulses no draws are followed",)
        return PulsesResult(given, *names, found, (*reasons, *graded.text, *said), graded)
    if found.replay is not None and found.replay.problem:
        raise ActuationError(found, f"the sequence found does not hold: {found.replay.problem}")
    if draws is None:
        return PulsesResult(given, *names, found)
    from_rest, batches = not start, draws.batches()
    led = reliability(batches, lines.line_of, found, draws.n_draws, SHARE, from_rest=from_rest)
    return PulsesResult(given, *names, found, scattered=ScatteredPulses(draws, led, from_rest))


def check_size(given: PressedInput) -> None:
    """Raise UsageError for more states than there is time for."""
    n_units = given.pressed.finger.n_units
    if n_units > MOST_UNITS:
        raise UsageError(f"pulses of {n_units} units: expected at most {MOST_UNITS}")


def _texts(words: Iterable[str]) -> np.ndarray[tuple[int], np.dtype[np.str_]]:
    return np.array([*words], np.str_)
