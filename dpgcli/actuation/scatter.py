"""What scatter does to pulses and thresholds: of many draws of a finger, a lane each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dpgcli.actuation.directions import Directions, Rows
from dpgcli.actuation.pressed import Halt, Pressed
from dpgcli.actuation.pulses import WHOLE, Pulse, intervals
from dpgcli.actuation.rest import at_rest, is_certified
from dpgcli.actuation.staircase import driven, released
from dpgcli.arrays import Array, Flags, Indices
from dpgcli.states.certify import Status
from dpgcli.states.patterns import codes_of, inverted_units
from dpgcli.states.settle import lanes_at_once


@dataclass(frozen=True)
class Ranges(Rows):
    """Sizes of peaks, MPa, that lead a draw from the source of a pulse to its target, (range,).

    Up to below `high`, which is infinite where no event ends the range.
    """

    pulse: Indices
    draw: Indices
    low: Array
    high: Array


def ranges_of(pressed: Pressed, line_of: Indices, reach: float, pulses: Sequence[Pulse]) -> Ranges:
    """The ranges of draws for pulses; of those whose source is no stable state there are none."""
    n_units, n_draws = pressed.finger.n_units, pressed.finger.n_designs
    pulse = np.arange(len(pulses)).repeat(n_draws)
    columns = [(one.source, one.target, one.line, np.sign(one.peak)) for one in pulses]
    source, target, line, sign = np.array(columns, np.int64)[pulse].T
    draws = Directions(
        np.tile(np.arange(n_draws), len(pulses)), source.astype(np.uint64), line, sign
    )
    n_stairs = 1 + max((one.source ^ one.target).bit_count() for one in pulses)
    size, parts = lanes_at_once(n_units), []
    for first in range(0, len(pulse), size):
        lanes = np.arange(first, min(first + size, len(pulse)))
        lanes = lanes[_are_stable(pressed, draws.take(lanes))]
        found = intervals(pressed, line_of, np.full(n_draws, reach), draws.take(lanes), n_stairs)
        lane = lanes[found.lane]
        high = np.abs(found.high)
        high = np.where(high >= (1.0 - WHOLE) * reach, np.inf, high)
        own = Ranges(pulse[lane], draws.design[lane], np.abs(found.low), high)
        parts.append(own.take(np.flatnonzero(found.after == target[lane])))
    return Ranges.joined(parts)


def _are_stable(pressed: Pressed, draws: Directions) -> Flags:
    """Whether the states of draws are stable."""
    inverted = inverted_units(draws.code, pressed.finger.n_units)
    _, settled = at_rest(pressed.take_lanes(draws.design), inverted)
    return np.asarray(settled.status == Status.STABLE)


def window(low: Array, high: Array, n_needed: float) -> tuple[float, float]:
    """The widest interval that lies in so many ranges from low up to high; NaN if there is none.

    >>> low, high = np.array([1.0, 1.2, 1.1]), np.array([2.0, 1.9, np.inf])
    >>> window(low, high, 3), window(low, high, 2), window(low, high, 4)
    ((1.2, 1.9), (1.1, 2.0), (nan, nan))
    """
    ends = np.concatenate([low, high[np.isfinite(high)]])
    steps = np.concatenate([np.ones(len(low)), -np.ones(len(ends) - len(low))])
    order = np.lexsort((steps, ends))  # what ends somewhere does so before others begin
    ends, count = ends[order], np.cumsum(steps[order])
    is_inside = count >= n_needed
    begins = np.flatnonzero(is_inside & ~np.append(False, is_inside[:-1]))
    stops = np.flatnonzero(~is_inside & np.append(False, is_inside[:-1]))
    highs = np.append(ends[stops], np.inf)[: len(begins)]
    widths = highs - ends[begins]
    if not len(begins) or not (widths > 0.0).any():
        return float("nan"), float("nan")
    widest = int(widths.argmax())
    return float(ends[begins[widest]]), float(highs[widest])


def are_led(pressed: Pressed, line_of: Indices, pulses: Sequence[Pulse], ranges: Ranges) -> Flags:
    """Which draws end in the last target, (draw,).

    Those of which each pulse leads from its source to its target do, and those of which only the
    last does not do not. Others are followed: a later pulse may make up for it.
    """
    does = np.zeros((len(pulses), pressed.finger.n_designs), bool)
    peak = np.abs([pulse.peak for pulse in pulses])[ranges.pulse]
    is_inside = (ranges.low <= peak) & (peak < ranges.high)
    does[ranges.pulse[is_inside], ranges.draw[is_inside]] = True
    is_led = np.asarray(does.all(axis=0))
    others = np.flatnonzero(~does[:-1].all(axis=0))
    if len(others):
        is_led[others] = followed(pressed.take_lanes(others), line_of, pulses)
    return is_led


def followed(pressed: Pressed, line_of: Indices, pulses: Sequence[Pulse]) -> Flags:
    """Follow draws through pulses, there and back; which end in the last target, (draw,)."""
    n_units, n_draws = pressed.finger.n_units, pressed.finger.n_designs
    start = inverted_units(np.full(n_draws, pulses[0].source, np.uint64), n_units)
    shapes, settled = at_rest(pressed, start)
    draws = np.flatnonzero(settled.status == Status.STABLE)
    own, shapes = pressed.take_lanes(draws), shapes.take_lanes(draws)
    for pulse in pulses:
        peak = np.where(line_of[:, None] == pulse.line, pulse.peak, np.zeros(len(draws)))
        there = driven(own, shapes, peak)
        back = released(own, there.shapes)
        arrived = (there.reason == Halt.ARRIVED) & (back.reason == Halt.ARRIVED)
        kept = np.flatnonzero(arrived)
        own, shapes, draws = own.take_lanes(kept), back.shapes.take_lanes(kept), draws[kept]
    is_there = (codes_of(shapes.inverted) == pulses[-1].target) & is_certified(own, shapes)
    found = np.zeros(n_draws, bool)
    found[draws] = is_there
    return found
