"""What scatter does to transitions: thresholds of many draws of a finger, a lane each."""

from collections.abc import Iterable
from enum import IntEnum

import numpy as np

from dpgcli.actuation.directions import Directions, on_line
from dpgcli.actuation.pressed import Halt, Pressed
from dpgcli.actuation.rest import at_rest, is_certified
from dpgcli.actuation.staircase import MOST_EVENTS, UNKNOWN, Events, Journey, released
from dpgcli.actuation.transitions import Transitions
from dpgcli.arrays import Array, Codes, Columns, Flags, Indices
from dpgcli.design.outputs import Output
from dpgcli.states.certify import UNDECIDED, Status
from dpgcli.states.columns import Column
from dpgcli.states.patterns import codes_of, inverted_units
from dpgcli.states.settle import lanes_at_once

TAIL = 2.5  # % of draws on each side
PRESSURES = (Output.PRESSURES,)
SPREAD_COLUMNS = (
    Column("share_leaving", "", "share of all draws that leave the state at some pressure"),
    Column(
        "share_without_state",
        "",
        "share of all draws without a certified state of the pattern, or that are no fingers",
    ),
    Column(
        "share_unknown",
        "",
        "share of all draws of which no equilibrium is found, or not whether they have the state: "
        "they may leave as well",
    ),
    Column(
        "share_same_unit", "", "share of all draws in which the same unit leaves, or one of its tie"
    ),
    Column("pressure_mean_MPa", "MPa", "mean of the thresholds of draws", outputs=PRESSURES),
    Column("pressure_deviation_MPa", "MPa", "their standard deviation", outputs=PRESSURES),
    Column("pressure_low_MPa", "MPa", "2.5 % of them are below", outputs=PRESSURES),
    Column("pressure_high_MPa", "MPa", "2.5 % of them are above", outputs=PRESSURES),
)


class Fate(IntEnum):
    """What becomes of a draw in a direction."""

    STAYS = 0  # or folds onto itself before it leaves
    LEAVES = 1
    STATELESS = 2
    UNKNOWN = 3


def spread_rows(
    batches: Iterable[tuple[Indices, Pressed]],
    line_of: Indices,
    reach: float,
    rows: Transitions,
    n_draws: int,
) -> Columns:
    """How the thresholds of transitions scatter, by column; draws in no batch have no states."""
    pressure = np.full((len(rows.code), n_draws), np.nan)
    unit = np.full((len(rows.code), n_draws), -1)
    fate = np.full(unit.shape, Fate.STATELESS)
    for draws, pressed in batches:
        found = _first_flips(pressed, line_of, reach, rows)
        pressure[:, draws], unit[:, draws], fate[:, draws] = found
    leaves = fate == Fate.LEAVES
    alike = inverted_units(rows.tied, len(line_of))  # (unit, row)
    alike[np.maximum(rows.unit, 0), np.arange(len(rows.unit))] |= rows.unit >= 0
    is_same = (unit >= 0) & alike[unit, np.arange(len(unit))[:, None]]
    columns = np.array([_statistics(own[has]) for own, has in zip(pressure, leaves, strict=True)])
    each = leaves, fate == Fate.STATELESS, fate == Fate.UNKNOWN, is_same
    shares = np.stack([share.mean(axis=1) for share in each], axis=1)
    table = np.concatenate([shares, columns.reshape(len(shares), 4)], axis=1)
    return dict(zip((column.name for column in SPREAD_COLUMNS), table.T, strict=True))


def _statistics(pressures: Array) -> tuple[float, float, float, float]:
    """Mean, standard deviation, and what 95 % lie between; NaN for too few."""
    if not len(pressures):
        return (float("nan"),) * 4
    low, high = np.percentile(pressures, [TAIL, 100.0 - TAIL])
    deviation = pressures.std(ddof=1) if len(pressures) > 1 else float("nan")
    return float(pressures.mean()), float(deviation), float(low), float(high)


def _first_flips(
    pressed: Pressed, line_of: Indices, reach: float, rows: Transitions
) -> tuple[Array, Indices, Indices]:
    """Pressures at which draws first flip in the directions of rows, by which unit, and their fate.

    All (row, draw); NaN and −1 where they do not flip, or the state is none.
    """
    n_units, n_draws = pressed.finger.n_units, pressed.finger.n_designs
    n = len(rows.code) * n_draws
    directions = Directions(
        np.tile(np.arange(n_draws), len(rows.code)),
        rows.code.repeat(n_draws),
        rows.line.repeat(n_draws),
        rows.sign.repeat(n_draws),
    )
    pressure, unit, fate = np.full(n, np.nan), np.full(n, -1), np.full(n, Fate.STATELESS)
    size = lanes_at_once(n_units)
    for first in range(0, n, size):
        lanes = np.arange(first, min(first + size, n))
        few = directions.take(lanes)
        pressure[lanes], unit[lanes], fate[lanes] = _flips(pressed, line_of, reach, few)
    shape = len(rows.code), n_draws
    return pressure.reshape(shape), unit.reshape(shape), fate.reshape(shape)


def _flips(
    pressed: Pressed, line_of: Indices, reach: float, directions: Directions
) -> tuple[Array, Indices, Indices]:
    """The same of some directions, (lane,)."""
    pressure, unit = np.full(len(directions), np.nan), np.full(len(directions), -1)
    own = pressed.take_lanes(directions.design)
    shapes, settled = at_rest(own, inverted_units(directions.code, pressed.finger.n_units))
    states = np.flatnonzero(settled.status == Status.STABLE)
    line = directions.line[states]
    target = np.where(line_of[:, None] == line, directions.sign[states] * reach, 0.0)
    journey = Journey(own.take_lanes(states), shapes.take_lanes(states), target)
    for _ in range(MOST_EVENTS * pressed.finger.n_units):
        found = journey.next_events()
        if found is None:
            break
        now, events = found
        is_flip = _leaves(now, events, directions.code[states[events.lanes]]) & events.is_fine
        flips = np.flatnonzero(is_flip)
        which, halted = events.lanes[flips], events.halted.take_lanes(flips)
        pressure[states[which]] = on_line(halted.shapes, line_of, line[which])
        unit[states[which]] = halted.unit
        journey.go_on(~is_flip[events.is_fine])
    fate = np.where(np.isin(settled.status, UNDECIDED), Fate.UNKNOWN, Fate.STATELESS)
    fate[states] = np.where(np.isin(journey.reason, UNKNOWN), Fate.UNKNOWN, Fate.STAYS)
    fate[~np.isnan(pressure)] = Fate.LEAVES
    return pressure, unit, fate


def _leaves(pressed: Pressed, events: Events, code: Codes) -> Flags:
    """Whether events take draws out of states, codes (event,), as `transitions` has it.

    `pressed` are those to which they happen. Those that jump and flip no unit are let go.
    """
    leaves = np.array(events.flipped.any(axis=0))
    silent = np.flatnonzero(events.are_jumps & ~leaves & events.is_fine)
    if len(silent):
        own = pressed.take_lanes(silent)
        way = released(own, events.take(silent).after)
        is_back = codes_of(way.shapes.inverted) == code[silent]
        is_back &= (way.reason == Halt.ARRIVED) & is_certified(own, way.shapes)
        leaves[silent] = ~is_back
    return leaves
