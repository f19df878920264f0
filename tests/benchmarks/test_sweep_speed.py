"""What a whole sweep costs beside its states: `pytest -m benchmark`. Nothing here asserts a time.

The sweep has 10,000 designs of five units, all different, thus 320,000 states. Its core is what
solves them: units, states, certificates, poses, energies and tip compliance, in one process and in
the batches of a sweep, without files and start-up; its time is CPU time. The sweep is the whole
program with all its processes, the server that workers are forked from included. Both take turns,
so that other work on the machine meets both; compare the medians' ratio.
"""

import compileall
import multiprocessing
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np
import pytest

import dpgcli
from dpgcli.arrays import keep_freed_memory
from dpgcli.design.resolve import resolve
from dpgcli.files.scene_file import read_spec
from dpgcli.mechanics.finger import Finger
from dpgcli.mechanics.terms import chain_potential
from dpgcli.states.certify import Status
from dpgcli.states.patterns import inverted_units
from dpgcli.states.settle import lanes_at_once, settle
from dpgcli.states.tip import tip
from dpgcli.states.units import UnitSolutions

pytestmark = [
    pytest.mark.benchmark,
    pytest.mark.skipif(sys.platform != "linux", reason="waits for orphans as Linux does"),
]
SPEC = Path(__file__).parents[2] / "configs" / "five_unit.yaml"
HEIGHTS, SEPARATIONS = np.linspace(5.0, 7.5, 100), np.linspace(2.0, 3.5, 100)
SWEEP = f"""base: {SPEC}
space:
  - {{key: finger.geometry.dome_height_mm, linear: {{from: 5.0, to: 7.5, count: 100}}}}
  - {{key: finger.geometry.unit_separation_mm, linear: {{from: 2.0, to: 3.5, count: 100}}}}
"""
# gives the CPU time of a command with all that it starts: orphans come to it, and it waits
TREE = """
import ctypes, os, resource, subprocess, sys
PR_SET_CHILD_SUBREAPER = 36
ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
try:
    while True:
        os.wait()
except ChildProcessError:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(used.ru_utime + used.ru_stime)
"""
ROUNDS = 5


def swept_finger() -> Finger:
    """The fingers of the sweep, resolved as it does."""
    height, separation = np.meshgrid(HEIGHTS, SEPARATIONS, indexing="ij")
    values = {
        "finger.geometry.dome_height_mm": height.ravel(),
        "finger.geometry.unit_separation_mm": separation.ravel(),
    }
    base = replace(read_spec(SPEC).design, n_designs=height.size)
    return resolve(base.with_values(values)).batch(np.arange(height.size)).finger


def core_seconds(finger: Finger, designs_of: Sequence[range]) -> float:
    """CPU time of all states of all designs, those of each range in a process of its own."""
    forked = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(len(designs_of), forked) as pool:
        return sum(pool.map(seconds_of, [finger] * len(designs_of), designs_of))


def seconds_of(finger: Finger, own: range) -> float:
    """CPU time of all states of a range of designs."""
    keep_freed_memory()
    began = process_time()
    patterns = inverted_units(np.arange(32, dtype=np.uint64), 5)
    units = UnitSolutions.of(finger)
    size = lanes_at_once(5) // 32
    for first in range(own.start, own.stop, size):
        designs = np.arange(first, min(first + size, own.stop))
        inverted = np.tile(patterns, len(designs))
        lanes = units.take_lanes(np.repeat(designs, 32))
        settled = settle(lanes, chain_potential, inverted, 1e-12)
        tip(settled, with_compliance=True)
        assert (settled.status == Status.STABLE).all()
    return process_time() - began


@pytest.mark.parametrize("jobs", [1, 2])
def test_cpu_of_a_whole_sweep_over_that_of_its_states(
    benchmark: Any, tmp_path: Path, jobs: int
) -> None:
    compileall.compile_dir(Path(dpgcli.__file__).parent, quiet=2)
    (tmp_path / "sweep.yaml").write_text(SWEEP)
    command = [sys.executable, "-c", TREE, sys.executable, "-m", "dpgcli", "sweep", "sweep.yaml"]
    finger = swept_finger()
    share = finger.n_designs // jobs
    designs_of = [range(first, first + share) for first in range(0, finger.n_designs, share)]
    outputs, core, whole = iter("abcdefgh"), [], []

    def sweep() -> None:
        options = ["-j", str(jobs), "-o", next(outputs)]
        whole.append(float(subprocess.check_output([*command, *options], cwd=tmp_path)))

    def of_states() -> None:
        core.append(core_seconds(finger, designs_of))

    benchmark.pedantic(sweep, setup=of_states, rounds=ROUNDS)
    benchmark.extra_info["core_cpu_seconds"] = round(median(core), 2)
    benchmark.extra_info["sweep_cpu_seconds"] = round(median(whole), 2)
    benchmark.extra_info["ratio"] = round(median(whole) / median(core), 2)
