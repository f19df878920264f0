"""What a sweep takes is known, and too much is refused, before the work."""

import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from dpgcli.cli.options import LONG
from dpgcli.errors import UsageError
from dpgcli.studies import sweep as studies
from dpgcli.sweeps import designs, tips
from dpgcli.sweeps.executors import serial
from dpgcli.sweeps.extent import MOST_CHUNKS, PROCESS_BYTES

UNITS = "{key: finger.units, values: [2, 3, 30]}"
HEIGHTS = "{key: finger.geometry.dome_height_mm, values: [6.5, 7]}"


def axis(key: str, count: int) -> str:
    return f"{{key: finger.geometry.{key}, linear: {{from: 1, to: 2, count: {count}}}}}"


def peak(work: Callable[[], object]) -> int:
    """Bytes that are allocated at once while the work is done."""
    tracemalloc.start()
    work()
    (_, most) = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return most


def test_states_are_counted_by_the_number_of_units(study: Any) -> None:
    made = study(UNITS.replace("30", "3"), HEIGHTS)
    assert (made.extent.most_units, made.extent.n_states) == (3, 2 * (4 + 8 + 8))
    assert study(HEIGHTS).extent.n_states == 2 * 8


@pytest.mark.parametrize("states", [2**6, 2**15])
@pytest.mark.parametrize("n_units", [1, 3, 5, 9, 14])
def test_chunks_are_whole_batches_that_come_close_to_their_most(
    study: Any, monkeypatch: pytest.MonkeyPatch, n_units: int, states: int
) -> None:
    """A batch of the one design that would be left takes as long as one of a dozen."""
    monkeypatch.setattr(studies, "STATES_PER_CHUNK", states)
    made = study(f"{{key: finger.units, values: [{n_units}]}}", HEIGHTS)
    most = max(states >> n_units, 1)
    at_once = min(designs.designs_at_once(n_units), most)
    assert made.chunk_size % at_once == 0
    assert most - at_once < made.chunk_size <= most


def test_units_of_the_base_do_not_count_where_units_vary(study: Any) -> None:
    made = study("{key: finger.units, values: [2, 3]}", base="eight_unit")
    assert (made.extent.most_units, made.extent.n_states) == (3, 4 + 8)


def test_impossible_numbers_of_units_do_not_count(study: Any) -> None:
    made = study("{key: finger.units, values: [-1, 0, 65, 3]}")
    assert (made.extent.most_units, made.extent.n_states) == (3, 8)


def test_long_fingers_that_a_constraint_excludes_do_not_count(study: Any, tables: Any) -> None:
    made = study(UNITS, HEIGHTS, rules="[units < 9]")
    assert (made.extent.most_units, made.extent.n_states) == (3, 2 * (4 + 8))
    assert made.chunk_size == 64 >> 3
    made.extent.check(made.chunk_size, is_sent=True)
    _, found = tables(made)
    assert found["status"].tolist() == ["stable"] * 4 + ["excluded"] * 2


@pytest.mark.parametrize("rules", ["[]", "[units < 99]", "[dome_height_mm > 6]"])
def test_a_design_of_more_states_than_can_be_is_refused(study: Any, rules: str) -> None:
    made = study(UNITS, HEIGHTS, rules=rules)
    with pytest.raises(UsageError, match=r"30 units has 1,073,741,824 states.* 67,108,864"):
        made.extent.check(made.chunk_size, is_sent=False)


def test_what_a_cluster_would_have_to_send_at_once_is_refused(study: Any) -> None:
    made = study("{key: finger.units, values: [2, 23]}")
    made.extent.check(made.chunk_size, is_sent=False)
    with pytest.raises(UsageError, match=r"8,388,608 states, more than the 4,194,304 .* cluster"):
        made.extent.check(made.chunk_size, is_sent=True)


def test_more_designs_than_anybody_can_wait_for_are_refused(study: Any) -> None:
    keys = ("dome_height_mm", "dome_thickness_mm", "channel_width_mm")
    made = study(*(axis(key, 2000) for key in keys))
    with pytest.raises(UsageError, match="8,000,000,000 designs in"):
        made.extent.check(made.chunk_size, is_sent=False)


def test_many_small_chunks_are_refused_where_they_are_too_many(study: Any) -> None:
    made = study(axis("dome_height_mm", 10_000), axis("dome_thickness_mm", 9_000))
    made.extent.check(90, is_sent=False)
    with pytest.raises(UsageError, match=f"{MOST_CHUNKS:,}"):
        made.extent.check(89, is_sent=False)


def test_more_than_the_memory_of_the_machine_is_refused(
    study: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = study(axis("dome_height_mm", 1_000_000))
    needed = PROCESS_BYTES + (350 + 24 + 8) * 1_000_000
    assert made.extent.bytes_in_memory == needed
    for memory, is_enough in ((needed, True), (needed - 1, False)):
        pages = {"SC_PAGE_SIZE": 1, "SC_PHYS_PAGES": memory}
        monkeypatch.setattr(studies.os, "sysconf", pages.__getitem__)
        if is_enough:
            made.check_memory()
        else:
            with pytest.raises(UsageError, match="764 MiB"):
                made.check_memory()


def test_one_long_design_takes_the_memory_of_a_block(
    study: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four times the states in the same blocks: not even half as much again."""
    monkeypatch.setattr(designs, "ROWS_AT_ONCE", 2**9)
    monkeypatch.setattr(tips, "CELLS_AT_ONCE", 2**9)
    peaks = []
    for n_units in (11, 13):
        made = study(f"{{key: finger.units, values: [{n_units}]}}", folder=f"of_{n_units}")
        peaks.append(peak(lambda: made.compute(serial(), lambda _: None)))  # noqa: B023
    assert peaks[1] < 1.5 * peaks[0]


@pytest.mark.parametrize(
    "rows", [2**6, *(pytest.param(2**n, marks=pytest.mark.slow) for n in (3, 9))]
)
@pytest.mark.parametrize("base", ["three_unit", "gripper"])
def test_a_design_is_the_same_however_its_states_are_cut(
    study: Any, tables: Any, monkeypatch: pytest.MonkeyPatch, rows: int, base: str
) -> None:
    axes = (HEIGHTS, "{key: finger.units, values: [9]}")
    whole = tables(study(*axes, base=base, folder="whole"))
    monkeypatch.setattr(designs, "ROWS_AT_ONCE", rows)
    monkeypatch.setattr(tips, "CELLS_AT_ONCE", 50)
    made = study(*axes, base=base, folder="cut")
    made.compute(serial(), lambda _: None)
    batches = [batch.num_rows for part in made.store.parts() for batch in part.batches(0)]
    assert sum(batches) == 2 * 512
    assert max(batches) == rows
    for found, expected in zip(tables(made), whole, strict=True):
        area = found.pop("workspace_area_mm2") if "reason" in found else None
        if area is not None:
            np.testing.assert_allclose(area, expected.pop("workspace_area_mm2"), rtol=1e-13)
        pd.testing.assert_frame_equal(found, expected, check_exact=True)


def test_a_long_sweep_is_said_to_be_long(study: Any) -> None:
    short, long = study(HEIGHTS), study("{key: finger.units, values: [22]}")
    assert short.extent.seconds < LONG < long.extent.seconds
    assert long.extent.seconds == pytest.approx(2**22 * 22e-6, rel=0.01)
    assert not Path(long.folder).exists()
