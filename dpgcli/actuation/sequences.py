"""The shortest sequence of pulses between two states of a finger: searched, then replayed."""

import numpy as np

from dpgcli.actuation.alone import Thresholds, thresholds_alone
from dpgcli.actuation.graph import Graph, reachable
from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.pulses import Pulse, Replay, replayed, shortest
from dpgcli.arrays import Indices
from dpgcli.records import dataclass


@dataclass(frozen=True)
class PulseSequence:
    """Pulses from the pattern with the code `start` to that of `target`, None where none lead.

    `alone` are thresholds of units by themselves, `graph` is what pulses reach from the start.
    """

    start: int
    target: int
    alone: Thresholds
    graph: Graph
    pulses: tuple[Pulse, ...] | None
    replay: Replay | None

    @property
    def reach(self) -> float:
        """How far pressures went, MPa."""
        return float(self.alone.reach[0])

    @property
    def holds(self) -> bool:
        """Whether there are pulses, and the finger that follows them ends where they say."""
        return self.replay is not None and not self.replay.problem


def pulse_sequence(pressed: Pressed, line_of: Indices, start: int, target: int) -> PulseSequence:
    """The fewest pulses on single lines that lead one finger from a state to another.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.pressure import DomeVolumes
    >>> from dpgcli.states.units import UnitSolutions
    >>> finger = uniform_finger(2, **STUDY).changed(stroke=np.array([[3.5], [4.5]]))
    >>> pressed = Pressed(UnitSolutions.of(finger), DomeVolumes(np.array([[31.61]])))
    >>> found = pulse_sequence(pressed, np.array([0, 0]), 0b00, 0b01)
    >>> found.holds, found.replay.after
    (True, (3, 1))
    """
    alone = thresholds_alone(pressed)
    graph = reachable(pressed, line_of, alone.reach, np.array([start], np.uint64))
    pulses = shortest(graph, float(alone.reach[0]), start, target)
    replay = None if pulses is None else replayed(pressed, line_of, start, pulses)
    return PulseSequence(start, target, alone, graph, pulses, replay)
