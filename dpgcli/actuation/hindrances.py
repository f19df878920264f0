"""Why no pulses lead to a pattern, in words."""

from collections.abc import Iterator

import numpy as np

from dpgcli.actuation.orders import Obstacle, needed_order, obstacles
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.rest import at_rest
from dpgcli.actuation.sequences import PulseSequence
from dpgcli.arrays import Indices
from dpgcli.mechanics.finger import Finger
from dpgcli.states.certify import Status
from dpgcli.states.patterns import inverted_units
from dpgcli.text import counted

MOST_NAMED = 4  # pairs of units


def hindrances(
    pressed: Pressed, lines: tuple[str, ...], line_of: Indices, found: PulseSequence
) -> Iterator[str]:
    """What keeps the pulses of a finger from the target of a sequence that does not exist."""
    n_units = pressed.finger.n_units
    inverted = inverted_units(np.array([found.target], np.uint64), n_units)
    status = Status(at_rest(pressed, inverted)[1].status[0])
    if status is not Status.STABLE:
        yield _no_state(f"{found.target:0{n_units}b}", status, pressed.finger)
        return
    pairs = obstacles(found.alone, line_of, inverted[:, 0])
    if found.graph.n_lost:
        ranges = counted(found.graph.n_lost, "range")
        yield f"{ranges} of peaks led to no certified state, or the finger folds onto itself there"
    if not pairs:
        yield (
            "units by themselves (independent hysterons) could be brought there: bars, walls, "
            "hinges or contacts between them are in the way"
        )
        return
    for line in sorted({int(line_of[pair.inverted]) for pair in pairs}):
        units = np.flatnonzero(line_of == line)
        yield f"line {lines[line]}: {needed_order(inverted[:, 0], units)}"
    yield from (_statement(found, pair) for pair in pairs[:MOST_NAMED])
    if len(pairs) > MOST_NAMED:
        yield f"and {counted(len(pairs) - MOST_NAMED, 'pair')} of units more"


def _no_state(pattern: str, status: Status, finger: Finger) -> str:
    """That a pattern has no stable state, or that none is found, which proves nothing."""
    why = f"{status.text}, {status.meaning_for(finger)}"
    if status is Status.NOT_CONVERGED:
        return f"no stable state of {pattern} is found: {why}"
    return f"{pattern} is no stable state: {why}"


def _statement(found: PulseSequence, pair: Obstacle) -> str:
    """The thresholds of a pair of units that are in the wrong order."""
    one, other = pair.inverted, pair.other
    if pair.is_tie:
        at = f"snap at {_size(found.alone.snap, one)}, reset at {_size(found.alone.reset, one)}"
        return f"units {one + 1} and {other + 1} are a tie: both {at} by themselves"
    return (
        f"unit {one + 1} snaps at {_size(found.alone.snap, one)}, unit {other + 1} at "
        f"{_size(found.alone.snap, other)}; they reset at {_size(found.alone.reset, one)} and "
        f"{_size(found.alone.reset, other)}"
    )


def _size(thresholds: np.ndarray[tuple[int, ...], np.dtype[np.float64]], unit: int) -> str:
    pressure = float(thresholds[unit, 0])
    return "no pressure" if np.isnan(pressure) else f"{pressure:.5g} MPa"
