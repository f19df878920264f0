"""What fingers against bodies cost: `pytest -m benchmark`. Nothing here asserts a time.

All states of the study's gripper against many discs at once, as a sweep has them, without files
and start-up, over the same states without a body. CPU time; both take turns, so that other work on
the machine meets both: compare the medians' ratio, which says how many free states a path takes.
"""

from statistics import median
from time import process_time
from typing import Any

import numpy as np
import pytest

from dpgcli.arrays import keep_freed_memory
from dpgcli.design.bodies import Disc
from dpgcli.design.scene import Gripper, Held
from dpgcli.mechanics.finger import STUDY, uniform_finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.accuracy import DEFAULT_TOLERANCE
from dpgcli.states.certify import Status
from dpgcli.states.patterns import inverted_units
from dpgcli.states.settle import settle
from dpgcli.states.units import UnitSolutions
from dpgcli.sweeps.grasps import Encounter, grasp_rows

pytestmark = pytest.mark.benchmark
DIAMETERS, PLACES = np.linspace(20.0, 50.0, 8), np.linspace(32.0, 62.0, 4)
N_UNITS, N_STATES = 5, 32
ROUNDS = 3


@pytest.mark.parametrize("bars", [np.inf, 1e4], ids=["rigid", "elastic"])
def test_many_discs_over_free_states(benchmark: Any, bars: float) -> None:
    keep_freed_memory()
    units = UnitSolutions.of(uniform_finger(N_UNITS, **STUDY, linear_stiffness=bars))
    diameter, x = (part.ravel() for part in np.meshgrid(DIAMETERS, PLACES))
    lanes = np.repeat(np.arange(len(x)), N_STATES)
    body = Disc(np.stack((x, 0.0 * x)), 0.5 * diameter).take_lanes(lanes)
    n = len(lanes)
    gripper = Gripper(np.full(n, 60.0), np.zeros(n))
    own = Encounter(units, np.full(n, 1.5), gripper, body, Held.FIXED)
    codes = np.tile(np.arange(N_STATES, dtype=np.uint64), len(x))
    paths, free = [], []

    def both() -> Any:
        began = process_time()
        found = grasp_rows(own, codes)
        paths.append(process_time() - began)
        began = process_time()
        settle(units, chain_potential, inverted_units(codes, N_UNITS), DEFAULT_TOLERANCE)
        free.append(process_time() - began)
        return found

    found = benchmark.pedantic(both, rounds=ROUNDS)
    benchmark.extra_info["cpu_seconds_per_path"] = median(paths) / n
    benchmark.extra_info["free_states_per_path"] = median(paths) / median(free)
    assert (found["grasp_status"] == Status.STABLE).mean() > 0.9
