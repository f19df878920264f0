"""Estimates of run times by law: of graphs of states by direction, of histories by step."""

import numpy as np

from dpgcli.actuation.alone import REACH, thresholds_alone
from dpgcli.actuation.pressed import Pressed
from dpgcli.arrays import Array
from dpgcli.mechanics.finger import Finger

LONG = 30.0  # seconds: what may take longer is announced
PUBLISHED_SECONDS = (0.002, 0.02)  # of a direction: many units, where much is shared, or few
CURVE_SECONDS = (0.01, 0.5)  # with a curve: a smooth one, or one with a ripple at every place
PUBLISHED_STEP, CURVE_STEP = (0.003, 0.01), (0.006, 0.04)  # of a step of pressure that is short
PUBLISHED_WAY, CURVE_WAY = 0.08, 0.8  # to the largest threshold, with what snaps there
DIFFERENT_CYCLES = 3  # later ones begin as one before, as a rule, and take no time


def announced(finger: Finger, n_lines: int) -> str:
    """Words for how long all transitions of a finger may take; empty where that is not long.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> announced(uniform_finger(8, **STUDY), 1)
    ''
    >>> announced(uniform_finger(12, **STUDY), 1)
    '8,192 directions of 4,096 patterns: 16 to 164 s'
    """
    n_patterns = 2**finger.n_units
    n_directions = 2 * n_lines * n_patterns
    of_one = PUBLISHED_SECONDS if finger.law.curve is None else CURVE_SECONDS
    least, most = (n_directions * seconds for seconds in of_one)
    if most < LONG:
        return ""
    return f"{n_directions:,} directions of {n_patterns:,} patterns: {least:,.0f} to {most:,.0f} s"


def history_announced(pressed: Pressed, pressures: Array, n_cycles: int) -> str:
    """Words for how long a history of pressures (MPa), (step, line), may take; or empty.

    It takes its steps, and at most, besides, what is met on ways as long as the largest threshold
    of any unit by itself.

    >>> from dpgcli.mechanics.finger import STUDY, uniform_finger
    >>> from dpgcli.mechanics.pressure import DomeVolumes
    >>> from dpgcli.states.units import UnitSolutions
    >>> unit = UnitSolutions.of(uniform_finger(1, **STUDY))
    >>> pressed = Pressed(unit, DomeVolumes(np.array([[31.61]])))
    >>> history_announced(pressed, np.linspace(0.0, 0.16, 30_000)[:, None], 1)
    '30,000 steps of pressure: 90 to 300 s'
    >>> history_announced(pressed, np.array([[0.16], [0.0]]), 100)
    ''
    """
    n_different = min(n_cycles, DIFFERENT_CYCLES)
    n_steps = n_different * len(pressures)
    is_curved = pressed.finger.law.curve is not None
    of_step, of_way = (CURVE_STEP, CURVE_WAY) if is_curved else (PUBLISHED_STEP, PUBLISHED_WAY)
    least, most = (n_steps * seconds for seconds in of_step)
    if most + n_steps * of_way < LONG:  # if each went as far
        return ""
    largest = thresholds_alone(pressed).reach[0] / REACH
    way = np.abs(np.diff(pressures, axis=0, prepend=0.0)).max(axis=1).sum()
    most += n_different * way / largest * of_way
    if most < LONG:
        return ""
    return f"{n_steps:,} steps of pressure: {least:,.0f} to {most:,.0f} s"
