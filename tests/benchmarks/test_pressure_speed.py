"""What the graph of states costs: `pytest -m benchmark`. Nothing here asserts a time.

All states of a finger on two lines, up and down, and what is reached from rest; CPU time is beside
the wall time. Fingers whose units differ, and those whose units all go at once.
"""

from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest

from dpgcli.actuation.pressed import Pressed
from dpgcli.actuation.scatter import Reliability, reliability
from dpgcli.actuation.sequences import pulse_sequence
from dpgcli.actuation.transitions import Departure, state_graph
from dpgcli.api.pressure import pressed_input
from dpgcli.api.scatter import SHARE, drawn_by
from dpgcli.arrays import keep_freed_memory
from dpgcli.mechanics.finger import STUDY, uniform_finger
from dpgcli.mechanics.pressure import DomeVolumes
from dpgcli.states.units import UnitSolutions

pytestmark = pytest.mark.benchmark
GRADED = Path(__file__).parents[2] / "configs" / "graded_five_unit.yaml"
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
    n_stays = (found.transitions.outcome == Departure.STAYS).sum()
    assert n_stays == 4 << n_units // 2


@pytest.mark.parametrize("end", ["11100", "00011"])
def test_a_thousand_scattered_fingers_through_one_sequence(benchmark: Any, end: str) -> None:
    keep_freed_memory()
    given = pressed_input(GRADED)
    line_of = given.pressure.line_of
    found = pulse_sequence(given.pressed, line_of, 0, int(end, 2))
    assert found.pulses is not None
    drawn = drawn_by(given, "dome_thickness_mm=1%,dome_height_mm=0.05mm", 1000, 1)
    assert drawn is not None
    arguments = (line_of, found, 1000, SHARE)

    def followed() -> Reliability:
        return reliability(drawn.batches(), *arguments, from_rest=True)

    began = process_time()
    led = benchmark.pedantic(followed, rounds=3)
    benchmark.extra_info["cpu_seconds"] = (process_time() - began) / 3
    assert led.n_led[-1] > 900
