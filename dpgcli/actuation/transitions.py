"""Transitions: what first happens to each stable state as the pressure of a line rises or falls."""

from enum import IntEnum

import numpy as np

from dpgcli.actuation.alone import thresholds_alone
from dpgcli.actuation.directions import Directions, SideBySide, on_line, raised
from dpgcli.actuation.graph import Reached, reached_from_rest, stable_states
from dpgcli.actuation.pressed import Halt, Pressed
from dpgcli.actuation.rest import is_certified
from dpgcli.actuation.staircase import Stair, Way
from dpgcli.arrays import Array, Codes, Flags, Indices
from dpgcli.records import dataclass
from dpgcli.states.patterns import codes_of


class Departure(IntEnum):
    """What comes of a state in a direction; `text` says so with the pressure that it is about."""

    LEAVES = 0
    STAYS = 1
    FOLDS = 2
    LOST = 3
    ASTRAY = 4

    def text(self, pressure: float) -> str:
        """The sentence in tables, empty where a state leaves for another.

        >>> Departure.STAYS.text(0.299)
        'no unit leaves up to 0.299 MPa'
        """
        return _TEXTS[self].format(pressure, "down" if pressure < 0.0 else "up")


_TEXTS = {
    Departure.LEAVES: "",
    Departure.STAYS: "no unit leaves {1} to {0:.4g} MPa",
    Departure.FOLDS: "folds onto itself at {:.4g} MPa",
    Departure.LOST: "no equilibrium beyond {:.4g} MPa",
    Departure.ASTRAY: "released from {:.4g} MPa it is in no certified state",
}


@dataclass(frozen=True)
class Transitions(SideBySide):
    """What first happens to states, (row,): by pattern, line and sign ±1.

    `pressure` (MPa) is where units flip, or else how far the state was followed, and `outcome` says
    which. `unit` is the first to leave, −1 where none does; `flipped` and `tied` are codes of all
    units that flip and of others whose threshold is that of `unit` within `pressed.TIE`: the model
    does not say which of these goes first, and `unit` is the one next to the base. `reached` is
    the code of the pattern at that pressure, `after` that of the pattern left at rest; both are
    the state's own where nothing happens, and what is left `ASTRAY` is no state.
    """

    code: Codes
    line: Indices
    sign: Indices
    pressure: Array
    outcome: Indices
    unit: Indices
    flipped: Codes
    tied: Codes
    reached: Codes
    after: Codes


@dataclass(frozen=True)
class StateGraph:
    """All stable states of a finger, and their transitions on its lines.

    `is_stable`, by code of the pattern, says which states there are; `reached`, of one design,
    which of them pulses of any height lead to; `reach` is how far pressures went, MPa.
    """

    transitions: Transitions
    is_stable: Flags
    reached: Reached
    reach: float

    @property
    def is_reached(self) -> Flags:
        """Which states pulses lead to from rest, by code of the pattern."""
        return np.asarray(self.reached.is_reached[0])

    @property
    def n_unknown(self) -> int:
        """In how many directions others may be, see `graph.Reached`."""
        return int(self.reached.n_unknown[0])

    @property
    def rest(self) -> int:
        """The code of the state that pulses begin at; −1 where it is not known."""
        return int(self.reached.rest[0])


def state_graph(pressed: Pressed, line_of: Indices) -> StateGraph:
    """The transitions of all stable states of one finger, and the states reached from rest.

    `line_of` (unit,) are the lines of the units, 0, 1, …

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.pressure import DomeVolumes
    >>> from dpgcli.states.units import UnitSolutions
    >>> finger = uniform_finger(1, **STUDY)
    >>> pressed = Pressed(UnitSolutions.of(finger), DomeVolumes(np.array([[31.61]])))
    >>> rows = state_graph(pressed, np.array([0])).transitions
    >>> rows.code.tolist(), rows.sign.tolist(), rows.after.tolist()
    ([0, 0, 1, 1], [1, -1, 1, -1], [1, 0, 1, 0])
    >>> [Departure(code).name for code in rows.outcome]
    ['LEAVES', 'STAYS', 'STAYS', 'LEAVES']
    """
    reach = thresholds_alone(pressed).reach
    is_stable = stable_states(pressed, 1)
    code = np.flatnonzero(is_stable[0]).astype(np.uint64)
    directions = Directions.of(np.zeros(len(code), np.int64), code, int(line_of.max()) + 1)
    transitions = first_flips(pressed, line_of, reach, directions)
    leads = transitions.take(np.flatnonzero(transitions.outcome == Departure.LEAVES))
    known = leads.code.astype(np.int64), leads.after.astype(np.int64)
    reached = reached_from_rest(pressed, line_of, reach, is_stable, known)
    return StateGraph(transitions, is_stable[0], reached, float(reach[0]))


def first_flips(
    pressed: Pressed, line_of: Indices, reach: Array, directions: Directions
) -> Transitions:
    """What first happens to states, all certified, in these directions, in their order.

    `reach` (design,) is how far pressures go, MPa.
    """
    parts = directions.chunks(pressed.finger.n_units)
    return Transitions.joined([_none(), *(_first(pressed, line_of, reach, p) for p in parts)])


def _none() -> Transitions:
    places, codes = np.zeros(0, np.int64), np.zeros(0, np.uint64)
    which = codes, places, places, np.zeros(0)
    return Transitions(*which, places, places, codes, codes, codes, codes)


def _first(pressed: Pressed, line_of: Indices, reach: Array, directions: Directions) -> Transitions:
    """What first happens in these directions."""
    own, stairs, way = raised(pressed, line_of, reach, directions, 1)
    n = len(directions)
    found = Transitions(
        directions.code,
        directions.line,
        directions.sign,
        on_line(way.shapes, line_of, directions.line),
        _ends(way),
        np.full(n, -1),
        np.zeros(n, np.uint64),
        np.zeros(n, np.uint64),
        directions.code.copy(),
        directions.code.copy(),
    )
    for stair in stairs:
        _put(found, own, stair, directions, line_of)
    return found


def _ends(way: Way) -> Indices:
    """Outcomes of ways without a flip."""
    ends = np.full(len(way.reason), Departure.LOST, np.int64)
    ends[way.reason == Halt.ARRIVED] = Departure.STAYS
    ends[way.reason == Halt.FOLDED] = Departure.FOLDS
    return ends


def _put(
    found: Transitions, own: Pressed, stair: Stair, directions: Directions, line_of: Indices
) -> None:
    """Write what a jump leads to into its rows, where the state has not been left before.

    One that flips no unit, and from which release leads back, does not leave it.
    """
    lanes = stair.events.lanes
    is_rest = stair.is_fine & is_certified(own.take_lanes(lanes), stair.rest)
    is_back = is_rest & (codes_of(stair.rest.inverted) == directions.code[lanes])
    leaves = (found.unit[lanes] < 0) & (stair.events.flipped.any(axis=0) | ~is_back)
    kept = np.flatnonzero(leaves)
    stair, is_rest = stair.take(kept), is_rest[kept]
    events = stair.events
    lanes, halted = events.lanes, events.halted
    found.pressure[lanes] = on_line(halted.shapes, line_of, directions.line[lanes])
    found.outcome[lanes] = np.where(is_rest, Departure.LEAVES, Departure.ASTRAY)
    units = np.arange(own.finger.n_units)[:, None]
    together = (units == halted.unit) | halted.tied
    found.unit[lanes] = (together & (events.flipped | ~events.flipped.any(axis=0))).argmax(axis=0)
    found.flipped[lanes] = codes_of(events.flipped)
    found.tied[lanes] = codes_of(together & (units != found.unit[lanes]))
    found.reached[lanes] = codes_of(events.after.inverted)
    found.after[lanes] = codes_of(stair.rest.inverted)
