"""Memory of a sweep is that of its chunks, not of its space.

Read from the kernel's high-water mark of the program itself: what `getrusage` gives counts the
process that started it, too.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SWEEP = """base: three_unit.yaml
space:
  - sample:
      method: sobol
      count: 200000
      ranges:
        finger.geometry.dome_height_mm: {from: 4, to: 8}
        finger.geometry.unit_separation_mm: {from: 1, to: 3.5}
        finger.overrides.2.geometry.dome_height_mm: {from: 4, to: 8}
"""
PROGRAM = """
import atexit, sys
from pathlib import Path
from dpgcli.cli.main import main

def say():
    status = Path("/proc/self/status").read_text()
    print(status.partition("VmHWM:")[2].split()[0], file=sys.stderr, flush=True)

atexit.register(say)
main()
"""
LIMIT = 600 * 1024  # KiB


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs procfs")
def test_two_hundred_thousand_designs_stay_small(folder: Path) -> None:
    (folder / "sweep.yaml").write_text(SWEEP)
    command = [sys.executable, "-c", PROGRAM, "sweep", "sweep.yaml", "-o", "out", "-q"]
    jobs = ("-j", str(min(4, os.cpu_count() or 1)))
    done = subprocess.run(
        [*command, *jobs], cwd=folder, capture_output=True, text=True, timeout=900, check=True
    )
    assert int(done.stderr.split()[-1]) < LIMIT


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs procfs")
def test_a_design_of_many_states_stays_small(folder: Path) -> None:
    """2^18 states of one design, which all at once would take 4 GB."""
    axis = "space:\n  - {key: finger.units, values: [18]}\n"
    (folder / "sweep.yaml").write_text(f"base: three_unit.yaml\n{axis}")
    command = [sys.executable, "-c", PROGRAM, "sweep", "sweep.yaml", "-o", "out", "-q", "-j", "1"]
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=900, check=True
    )
    assert int(done.stderr.split()[-1]) < LIMIT
