"""Run times: repeated, warm, as medians with their spread."""

from collections.abc import Callable
from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np

SHORTEST_ROUND = 5e-3  # s: shorter calls are repeated within a round
LONGEST_REPEATED = 1.0  # s: longer calls are timed once
KERNEL_SIZE = 20_000


class Times(NamedTuple):
    """Seconds of one call: median, smallest and largest of wall time, median of CPU time."""

    wall: float
    wall_min: float
    wall_max: float
    cpu: float


def measured(function: Callable[[], object], repeats: int) -> Times:
    """Time a call `repeats` times, once it is warm; a call longer than a second just once."""
    first = _round(function, 1)
    if first[0] > LONGEST_REPEATED:  # warmth makes no difference to it
        return Times(first[0], first[0], first[0], first[1])
    calls = max(1, round(SHORTEST_ROUND / max(_round(function, 1)[0], 1e-9)))
    rounds = np.array([_round(function, calls) for _ in range(repeats)]) / calls
    wall, cpu = rounds.T
    return Times(*(float(v) for v in (np.median(wall), wall.min(), wall.max(), np.median(cpu))))


def _round(function: Callable[[], object], calls: int) -> tuple[float, float]:
    wall, cpu = perf_counter(), process_time()
    for _ in range(calls):
        function()
    return perf_counter() - wall, process_time() - cpu


def numpy_kernel() -> Callable[[], object]:
    """Fixed work in plain NumPy, to whose time others are compared across machines."""
    angles = np.linspace(0.1, 1.0, KERNEL_SIZE)

    def work() -> float:
        values = angles
        for _ in range(8):
            values = np.sqrt(np.sin(values) ** 2 + np.cos(values) ** 2) * angles
        return float(values.sum())

    return work


def peak_bytes(function: Callable[[], object]) -> int:
    """Largest memory that a call allocates at a time, NumPy's arrays included."""
    import tracemalloc

    tracemalloc.start()
    try:
        function()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
