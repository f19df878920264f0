"""How fast the kernels are: `pytest -m benchmark`. Nothing here asserts a time.

Compare ratios within one run: states a second, and a map's time over the time that pyarrow
alone takes to write such a table.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from dpgcli.arrays import keep_freed_memory
from dpgcli.design.scene import Scene
from dpgcli.files.prediction import write_states
from dpgcli.files.table_writer import packing
from dpgcli.mechanics.finger import STUDY, Finger, uniform_finger
from dpgcli.mechanics.laws import PUBLISHED, DomeLaw, PushOnly
from dpgcli.mechanics.terms import chain_potential, lattice_potential
from dpgcli.states.barriers import barriers
from dpgcli.states.certify import Status, certify
from dpgcli.states.patterns import inverted_units
from dpgcli.states.predict import predict
from dpgcli.states.settle import lanes_at_once, settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

pytestmark = pytest.mark.benchmark
REFERENCE = {**STUDY, "linear_stiffness": 1e4}


def varied_designs(n_units: int, n_designs: int) -> Finger:
    """Graded fingers, every value within 10 % of the reference."""
    random = np.random.default_rng(1)
    shared = ("segment_height", "linear_stiffness")
    shape = {key: (1 if key in shared else n_units, n_designs) for key in REFERENCE}
    arrays = {k: v * random.uniform(0.9, 1.1, shape[k]) for k, v in REFERENCE.items()}
    return Finger(n_units, **arrays)


def certified(units: UnitSolutions, inverted: Any, formulation: Any) -> None:
    batch = settle(units, formulation, inverted, 1e-12)
    status = certify(batch, units, 1e-12)
    tip(batch, with_compliance=True)
    assert (status == Status.STABLE).all()


def note_rate(benchmark: Any, n_states: int) -> None:
    benchmark.extra_info["states_per_second"] = round(n_states / benchmark.stats["median"])


@pytest.mark.parametrize("walls", [0.0, 0.05], ids=["rigid walls", "walls"])
@pytest.mark.parametrize("law", [PUBLISHED, PushOnly(PUBLISHED)], ids=["published", "push-only"])
def test_all_states_of_many_five_unit_designs(benchmark: Any, law: DomeLaw, walls: float) -> None:
    """Walls (0.05 mm/N, two thirds of 1/k_b) may cost half as much more."""
    keep_freed_memory()
    n_designs = lanes_at_once(5) // 32
    finger = varied_designs(5, n_designs)
    finger = replace(finger, law=law, wall_compliance=np.array([[walls]]))
    inverted = np.tile(inverted_units(np.arange(32, dtype=np.uint64), 5), n_designs)
    designs = np.repeat(np.arange(n_designs), 32)
    benchmark(
        lambda: certified(UnitSolutions.of(finger).take_lanes(designs), inverted, chain_potential)
    )
    note_rate(benchmark, inverted.shape[1])


@pytest.mark.parametrize("formulation", [chain_potential, lattice_potential])
def test_states_of_one_five_unit_finger(benchmark: Any, formulation: Any) -> None:
    keep_freed_memory()
    units = UnitSolutions.of(uniform_finger(5, **REFERENCE))
    inverted = np.tile(inverted_units(np.arange(32, dtype=np.uint64), 5), lanes_at_once(5) // 32)
    benchmark(lambda: certified(units, inverted, formulation))
    note_rate(benchmark, inverted.shape[1])


def test_map_of_a_twenty_unit_finger_to_parquet(benchmark: Any, tmp_path: Path) -> None:
    scene = Scene(uniform_finger(20, **REFERENCE), ())
    path = tmp_path / "states.parquet"
    benchmark.pedantic(lambda: write_states(predict(scene), path, "{}"), rounds=5, warmup_rounds=1)
    note_rate(benchmark, 2**20)


def test_floor_of_that_map_pyarrow_alone(benchmark: Any, tmp_path: Path) -> None:
    path = tmp_path / "states.parquet"
    write_states(predict(Scene(uniform_finger(20, **REFERENCE), ())), path, "{}")
    table = pq.read_table(path)
    layout = packing(table.schema)
    benchmark.pedantic(lambda: pq.write_table(table, path, **layout), rounds=5, warmup_rounds=1)
    note_rate(benchmark, 2**20)


def test_all_barriers_of_five_units(benchmark: Any) -> None:
    """160 barriers over 80 saddles, each certified."""
    units = UnitSolutions.of(uniform_finger(5, **REFERENCE))
    inverted = inverted_units(np.arange(32, dtype=np.uint64), 5)
    states = settle(units, chain_potential, inverted, 1e-12)
    found = benchmark(barriers, units, chain_potential, states, 1e-12)
    assert np.isfinite(found.energy).all()
    note_rate(benchmark, 32)
