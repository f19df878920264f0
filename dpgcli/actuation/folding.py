"""Shapes that no finger can take."""

import numpy as np

from dpgcli.arrays import Array, Flags
from dpgcli.mechanics.coordinates import FingerCoordinates
from dpgcli.states.crossing import crosses_itself, fewest_in_loop, outline

STRAIGHT = 1e-9  # rad: a unit that turns by less is in no loop


def folded(system: FingerCoordinates, coordinates: Array) -> Flags:
    """Which shapes are of impossible cells, or have parts in the same place, (batch,).

    >>> from dpgcli.mechanics.chain import Chain
    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> corners = np.array([[0.0, 0.1, 2.0]]) * np.ones((40, 1))  # rad, twenty units between bars
    >>> folded(Chain(uniform_finger(20, **STUDY)), corners).tolist()
    [False, False, True]
    """
    finger = system.finger
    near, far = (corner(coordinates).value for corner in system.corners)
    turn = np.maximum(np.abs(near + far), STRAIGHT)
    apart = fewest_in_loop(turn, finger.segment_length, finger.n_units)
    flags = system.springs(coordinates).is_folded
    if apart is not None:
        nodes = system.stations(coordinates)
        flags = flags | crosses_itself(outline(nodes, finger.segment_height), apart)
    return flags
