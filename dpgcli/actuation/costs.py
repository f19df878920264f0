"""Estimates of the run time of graphs of states, from measured times of a direction by law."""

from dpgcli.mechanics.finger import Finger

LONG = 30.0  # seconds: what may take longer is announced
PUBLISHED_SECONDS = (0.002, 0.02)  # of a direction: many units, where much is shared, or few
CURVE_SECONDS = (0.01, 0.5)  # with a curve: a smooth one, or one with a ripple at every place


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
