"""Parts of a sweep: whole or not there, whatever happens to who writes them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from dpgcli.files.parts import (
    FINGERPRINT,
    SAID,
    SHA256,
    PartStore,
    _sha256,
    fingerprint,
    write_part,
)
from dpgcli.files.record_batches import record_batch, schema
from dpgcli.states.columns import Column, Group, Kind


def test_what_a_killed_worker_left_of_a_part_goes_when_the_part_is_made(tmp_path: Path) -> None:
    (tmp_path / ".0000000000-0000000004.dpg0.tmp").write_bytes(b"half")
    with PartStore(tmp_path).part(0, 4) as file:
        file.write(b"whole")
    (part,) = tmp_path.iterdir()
    assert (part.suffix, part.read_bytes()) == (".part", b"whole")
    assert PartStore(tmp_path).damaged() == []


def test_a_part_that_is_interrupted_is_none(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), PartStore(tmp_path).part(0, 4) as file:
        file.write(b"half")
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_a_part_that_is_there_is_made_again(tmp_path: Path) -> None:
    """As after a worker that was killed between its last byte and its answer."""
    for _ in range(2):
        with PartStore(tmp_path).part(0, 4) as file:
            file.write(b"whole")
    (part,) = tmp_path.iterdir()
    assert part.read_bytes() == b"whole"


def test_a_part_within_another_is_not_needed(tmp_path: Path) -> None:
    """As of a chunk that was halved though a worker had stored it before it was killed."""
    store = PartStore(tmp_path)
    for start, stop in ((8, 12), (0, 4), (0, 8), (4, 8), (10, 14)):
        with store.part(start, stop) as file:
            file.write(b"whole")
    assert [(part.start, part.stop) for part in store.parts()] == [(0, 8), (8, 12), (10, 14)]
    assert store.missing([(0, 16)]) == [(14, 16)]


def test_a_part_is_an_arrow_file_whose_blocks_come_back_one_by_one(tmp_path: Path) -> None:
    """As few at a time in memory as when they were made, with units and descriptions."""
    states = (
        Column("x_mm", "mm", "place", Group.STATES, Kind.NUMBER),
        Column("pattern", "", "digits", Group.STATES, Kind.PATTERN),
    )
    designs = (Column("design", "", "number", Group.STATES, Kind.COUNT),)
    blocks: list[Any] = [
        ({"x_mm": np.arange(n) / 3, "pattern": np.full(n, b"01")}, {"design": np.arange(k)})
        for n, k in ((3, 1), (2, 0), (0, 2))
    ]
    with PartStore(tmp_path).part(0, 3) as file:
        assert write_part(file, states, designs, blocks) == 5
    (part,) = PartStore(tmp_path).parts()
    with part.path.open("rb") as stream:
        assert pa.ipc.open_file(stream).read_all().num_rows == len(blocks)
    assert part.schema(0).equals(schema(states), check_metadata=True)
    for which, columns in enumerate((states, designs)):
        found = list(part.batches(which))
        assert [batch.num_rows for batch in found] == [
            len(b[which][columns[0].name]) for b in blocks
        ]
        for batch, block in zip(found, blocks, strict=True):
            assert batch.equals(record_batch(columns, block[which]), check_metadata=True)


def test_a_part_of_other_designs_is_none(tmp_path: Path) -> None:
    """Its range is what says which designs are there, and which are missing."""
    store = PartStore(tmp_path)
    with store.part(0, 4) as file:
        file.write(b"whole")
    (part,) = store.parts()
    assert not part.is_damaged
    part.path.rename(part.path.with_name(part.path.name.replace("0000000000-", "0000000001-")))
    assert [part.start for part in store.damaged()] == [1]


def test_a_folder_with_the_name_of_a_part_is_none_and_stays(tmp_path: Path) -> None:
    store = PartStore(tmp_path / ".parts" / "0123")
    store.folder.mkdir(parents=True)
    (store.folder / f"{0:010}-{4:010}-{'0' * 16}.part").mkdir()
    with store.part(4, 8) as file:
        file.write(b"whole")
    assert [part.start for part in store.parts()] == [4]
    assert store.damaged() == []
    assert store.missing([(0, 8)]) == [(0, 4)]
    store.drop()
    assert [path.is_dir() for path in store.folder.iterdir()] == [True]


@pytest.mark.parametrize(
    "said", [{}, {"dpg.designs": "0"}, {"dpg.designs": 3}, {"dpg.designs": "3", "dpg.x": 1}, [1]]
)
def test_a_description_by_hand_is_none(tmp_path: Path, said: Any) -> None:
    """Also one whose fingerprint and sum are right."""
    if isinstance(said, dict):
        said = {**said, FINGERPRINT: fingerprint(said)}
        said = {**said, SHA256: _sha256(said)}
    (tmp_path / SAID).write_text(json.dumps(said))
    assert PartStore(tmp_path).said() == {}


def test_a_description_with_its_designs_is_one(tmp_path: Path) -> None:
    said = {"dpg.designs": "3"}
    said |= {FINGERPRINT: fingerprint(said)}
    (tmp_path / SAID).write_text(json.dumps({**said, SHA256: _sha256(said)}))
    assert PartStore(tmp_path).said() == said


def test_what_killed_workers_were_about_to_write_goes(tmp_path: Path) -> None:
    """And nothing that somebody still writes, nor anything else."""
    store = PartStore(tmp_path / ("0" * 16))
    store.drop_half_written()  # there is no folder yet
    store.folder.mkdir()
    orphan = store.folder / ".0000000000-0000000001.dpg0.tmp"
    orphan.touch()
    others = [store.folder / name for name in (".mine.tmp", "sweep.json", "a.dpg0.tmp")]
    for other in others:
        other.touch()
    with store.part(1, 2) as file:
        held = set(store.folder.iterdir()) - {orphan, *others}
        assert len(held) == 1
        store.drop_half_written()
        assert set(store.folder.iterdir()) == {*others, *held}
        file.write(b"")
