"""What the graph of states costs: `pytest -m benchmark`. Nothing here asserts a time.

All states of a finger on two lines, up and down, and what is reached from rest; CPU time is beside
the wall time. Fingers whose units differ, and those whose units all go at once.
"""

from time import process_time
from typing import Any

import numpy as np
import pytest

from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.transitions import Outcome, state_graph
from dpgcli.arrays import keep_freed_memory
from dpgcli.mechanics.finger import STUDY, uniform_finger
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.states.units import UnitSolutions

pytestmark = pytest.mark.benchmark
AREA = np.array([[31.61]])  # mm²
ROUNDS = {8: 5, 12: 1}


@pytest.mark.parametrize("strokes", [(3.3, 4.4), (3.5, 3.5)], ids=["graded", "equal"])
@pytest.mark.parametrize("n_units", [8, 12])
def test_the_whole_graph_of_two_lines(
    benchmark: Any, n_units: int, strokes: tuple[float, float]
) -> None:
    keep_freed_memory()
    finger = uniform_finger(n_units, **STUDY, linear_stiffness=1e4)
    finger = finger.changed(stroke=np.linspace(*strokes, n_units)[:, None])
    pressed = Pressed(UnitSolutions.of(finger), DomeVolumes(AREA))
    line_of = (np.arange(n_units) >= n_units // 2).astype(np.int64)
    began = process_time()
    found = benchmark.pedantic(state_graph, (pressed, line_of), rounds=ROUNDS[n_units])
    benchmark.extra_info["cpu_seconds"] = (process_time() - began) / ROUNDS[n_units]
    assert len(found.transitions.code) == 4 << n_units
    n_stays = (found.transitions.outcome == Outcome.STAYS).sum()
    assert n_stays == 4 << n_units // 2
