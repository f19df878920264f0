"""What scatter does to pulses and thresholds: of many draws of a finger, a lane each."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from dpgcli.actuation.directions import Directions, SideBySide
from dpgcli.actuation.graph import are_states, rests
from dpgcli.actuation.pressed import Halt, Pressed
from dpgcli.actuation.pulses import WHOLE, Pulse, intervals
from dpgcli.actuation.rest import at_rest, is_certified
from dpgcli.actuation.sequences import PulseSequence
from dpgcli.actuation.staircase import driven, released
from dpgcli.arrays import Array, Flags, Indices
from dpgcli.records import dataclass
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of, inverted_units
from dpgcli.states.settle import lanes_at_once


@dataclass(frozen=True)
class Ranges(SideBySide):
    """Sizes of peaks, MPa, that lead a draw from the source of a pulse to `after`, (range,).

    Up to below `high`, which is infinite where no event ends the range. `after` are codes of
    certified states, −1 where there is none.
    """

    pulse: Indices
    draw: Indices
    low: Array
    high: Array
    after: Indices


def ranges_of(pressed: Pressed, line_of: Indices, reach: float, pulses: Sequence[Pulse]) -> Ranges:
    """The ranges of draws for pulses; of those whose source is no stable state there are none."""
    n_units, n_draws = pressed.finger.n_units, pressed.finger.n_designs
    pulse = np.arange(len(pulses)).repeat(n_draws)
    columns = [(one.source, one.line, np.sign(one.peak)) for one in pulses]
    source, line, sign = np.array(columns, np.int64)[pulse].T
    draws = Directions(
        np.tile(np.arange(n_draws), len(pulses)), source.astype(np.uint64), line, sign
    )
    size, parts = lanes_at_once(n_units), [_no_ranges()]
    for first in range(0, len(pulse), size):
        lanes = np.arange(first, min(first + size, len(pulse)))
        lanes = lanes[are_states(pressed, draws.design[lanes], draws.code[lanes])]
        if not len(lanes):
            continue
        found = intervals(pressed, line_of, np.full(n_draws, reach), draws.take(lanes))
        lane = lanes[found.lane]
        high = np.abs(found.high)
        high = np.where(high >= (1.0 - WHOLE) * reach, np.inf, high)
        size_low = np.abs(found.low)
        parts.append(Ranges(pulse[lane], draws.design[lane], size_low, high, found.after))
    return Ranges.joined(parts)


def _no_ranges() -> Ranges:
    places, free = np.zeros(0, np.int64), np.zeros(0)
    return Ranges(places, places, free, free, places)


def window(low: Array, high: Array, n_needed: float) -> tuple[float, float]:
    """The widest interval that lies in so many ranges from low up to high; NaN if there is none.

    >>> low, high = np.array([1.0, 1.2, 1.1]), np.array([2.0, 1.9, np.inf])
    >>> window(low, high, 3), window(low, high, 2), window(low, high, 4)
    ((1.2, 1.9), (1.1, 2.0), (nan, nan))
    """
    ends = np.concatenate([low, high[np.isfinite(high)]])
    steps = np.concatenate([np.ones(len(low)), -np.ones(len(ends) - len(low))])
    order = np.argsort(ends)
    is_last = np.append(np.diff(ends[order]) > 0.0, True)[: len(ends)]  # of those at one place
    ends, count = ends[order][is_last], np.cumsum(steps[order])[is_last]
    is_inside = count >= n_needed
    begins = np.flatnonzero(is_inside & ~np.append(False, is_inside[:-1]))
    stops = np.flatnonzero(~is_inside & np.append(False, is_inside[:-1]))
    highs = np.append(ends[stops], np.inf)[: len(begins)]
    widths = highs - ends[begins]
    if not len(begins) or not (widths > 0.0).any():
        return float("nan"), float("nan")
    widest = int(widths.argmax())
    return float(ends[begins[widest]]), float(highs[widest])


def are_led(
    pressed: Pressed, line_of: Indices, pulses: Sequence[Pulse], ranges: Ranges, begin: Indices
) -> Flags:
    """Which draws are in the target of each pulse after all up to it, (pulse, draw).

    Each begins in the state with the code `begin`, (draw,): in none of them where it is −1. Those
    that begin elsewhere than the first pulse are followed through all. Those in which a pulse
    before the last does not lead from its source to its target are followed from what it leads to:
    a later one may make up for it.
    """
    peak = np.abs([pulse.peak for pulse in pulses])[ranges.pulse]
    inside = ranges.take(np.flatnonzero((ranges.low <= peak) & (peak < ranges.high)))
    after = np.full((len(pulses), pressed.finger.n_designs), -1)
    after[inside.pulse, inside.draw] = inside.after
    is_planned = begin == pulses[0].source
    does = (after == np.array([[pulse.target] for pulse in pulses])) & is_planned
    elsewhere = np.flatnonzero(~is_planned & (begin >= 0))
    if len(elsewhere):
        own = pressed.take_lanes(elsewhere)
        does[:, elsewhere] = followed(own, line_of, pulses, begin[elsewhere])
    strays = ~does[:-1] & is_planned
    for place in np.flatnonzero(strays.any(axis=1)).tolist():
        draws = np.flatnonzero(strays[place] & ~strays[:place].any(axis=0))
        known = after[place, draws]
        for which, first in ((known < 0, place), (known >= 0, place + 1)):
            few = draws[which]
            if len(few):
                code = np.where(known < 0, pulses[place].source, known)[which]
                own = pressed.take_lanes(few)
                does[first:, few] = followed(own, line_of, pulses[first:], code)
    return np.asarray(does)


def followed(pressed: Pressed, line_of: Indices, pulses: Sequence[Pulse], start: Indices) -> Flags:
    """The same, by following draws from states, codes (draw,), through pulses, there and back."""
    n_units, n_draws = pressed.finger.n_units, pressed.finger.n_designs
    found = np.zeros((len(pulses), n_draws), bool)
    shapes, settled = at_rest(pressed, inverted_units(start.astype(np.uint64), n_units))
    draws = np.flatnonzero(settled.status == Status.STABLE)
    own, shapes = pressed.take_lanes(draws), shapes.take_lanes(draws)
    for place, pulse in enumerate(pulses if len(draws) else ()):
        peak = np.where(line_of[:, None] == pulse.line, pulse.peak, np.zeros(len(draws)))
        there = driven(own, shapes, peak)
        back = released(own, there.shapes)
        arrived = (there.reason == Halt.ARRIVED) & (back.reason == Halt.ARRIVED)
        kept = np.flatnonzero(arrived)
        own, shapes, draws = own.take_lanes(kept), back.shapes.take_lanes(kept), draws[kept]
        if len(draws):
            is_there = (codes_of(shapes.inverted) == pulse.target) & is_certified(own, shapes)
            found[place, draws] = is_there
    return found


@dataclass(frozen=True)
class Reliability:
    """What scatter does to a sequence of pulses, if any.

    Of `n_draws` draws `n_begun` begin in its first state, `n_unknown` in no certified one; `n_led`
    (pulse,) are in the pattern after each pulse; `windows` (pulse, 2) are the sizes of peaks, MPa,
    between which so many draws do it as are asked for: the second is infinite where no event ends
    them, both are NaN where there are none.
    """

    n_draws: int
    n_begun: int
    n_unknown: int
    n_led: Indices
    windows: Array

    @property
    def n_done(self) -> int:
        """How many draws are in the last state after all pulses."""
        return int(self.n_led[-1]) if len(self.n_led) else self.n_begun


def reliability(
    batches: Iterable[tuple[Indices, Pressed]],
    line_of: Indices,
    sequence: PulseSequence,
    n_draws: int,
    share: float,
    *,
    from_rest: bool,
) -> Reliability:
    """Follow draws through the pulses of a sequence, if any, from its start.

    `from_rest`: each from where it rests itself, which may be elsewhere. Those in no batch are no
    fingers, and do none of it.
    """
    pulses = sequence.pulses or ()
    does = np.zeros((len(pulses), n_draws), bool)
    parts, n_begun, n_unknown = [_no_ranges()], 0, 0
    for draws, pressed in batches:
        begin = begins(pressed, len(draws), None if from_rest else sequence.start)
        n_begun += int((begin == sequence.start).sum())
        n_unknown += int((begin < 0).sum())
        if pulses:
            found = ranges_of(pressed, line_of, sequence.reach, pulses)
            does[:, draws] = are_led(pressed, line_of, pulses, found, begin)
            parts.append(replace(found, draw=draws[found.draw]))
    ranges = Ranges.joined(parts)
    windows = []
    for place, pulse in enumerate(pulses):
        leads = (ranges.pulse == place) & (ranges.after == pulse.target)
        own = ranges.take(np.flatnonzero(leads))
        windows.append(window(own.low, own.high, share * n_draws))
    n_led = does.sum(axis=1)
    return Reliability(n_draws, n_begun, n_unknown, n_led, np.array(windows).reshape(-1, 2))


def begins(pressed: Pressed, n_draws: int, start: int | None) -> Indices:
    """The codes of the states that draws begin in, (draw,); −1 where that is no certified one.

    That with the code `start`, or of none where each rests under its own loads.
    """
    if start is None:
        code, is_certain = rests(pressed, n_draws)
    else:
        code = np.full(n_draws, start, np.uint64)
        is_certain = are_states(pressed, np.arange(n_draws), code)
    return np.where(is_certain, code.astype(np.int64), -1)
