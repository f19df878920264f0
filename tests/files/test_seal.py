"""No damaged byte of a table is believed: seals, flipped bits, and what reads table_writer."""

import random
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dpgcli.errors import UsageError
from dpgcli.files import table_writer
from dpgcli.files.record_batches import record_batch, schema
from dpgcli.files.seal import HEAD, KEY, UNSEALED, is_whole, is_whole_in
from dpgcli.files.table_reader import read_designs, read_undamaged
from dpgcli.files.table_writer import write_table
from dpgcli.states.columns import Column, Group, Kind

N_FLIPS = 1500
KINDS = {
    "design": Kind.COUNT,
    "height_mm": Kind.NUMBER,
    "calibration": Kind.TEXT,
    "status": Kind.TEXT,
    "reason": Kind.TEXT,
    "n_stable": Kind.COUNT,
    "fingers_overlap": Kind.FLAG,
}
COLUMNS = tuple(Column(name, "", "", Group.STATES, kind) for name, kind in KINDS.items())


def rows(**changes: list[Any]) -> dict[str, Any]:
    import numpy as np

    values: dict[str, list[Any]] = {
        "design": [0, 1, 2],
        "height_mm": [4.5, 6.0, 6.5],
        "calibration": ["given", "scaled", ""],
        "status": ["stable", "stable", "invalid"],
        "reason": ["", "", "too flat"],
        "n_stable": [8, 8, 0],
        "fingers_overlap": [True, False, False],
        **changes,
    }
    return {name: np.array(column) for name, column in values.items()}


def written(path: Path, **changes: list[Any]) -> bytes:
    write_table(path, schema(COLUMNS), [record_batch(COLUMNS, rows(**changes))], {"dpg.x": "y"})
    return path.read_bytes()


def flipped(content: bytes, bit: int) -> bytes:
    changed = bytearray(content)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "designs.parquet"
    written(path)
    return path


@pytest.mark.parametrize("length", [10, 2**14, 2**16, 10**6])
def test_metadata_may_be_long(tmp_path: Path, length: int) -> None:
    """As of a sweep over a list of values: sealed, known again and replaced, damage seen."""
    path, said = tmp_path / "designs.parquet", {"dpg.sweep": "v" * length, "dpg.z": "w"}
    for _ in range(2):
        write_table(path, schema(COLUMNS), [record_batch(COLUMNS, rows())], said)
    content = path.read_bytes()
    assert is_whole(path)
    for place in (content.index(b"vvv"), content.rindex(b"vvv"), len(content) - 9):
        path.write_bytes(flipped(content, 8 * place))
        assert not is_whole(path)


def test_a_table_is_sealed_and_reads_back(table: Path) -> None:
    assert is_whole(table)
    designs = read_designs(table).columns
    assert designs["height_mm"].tolist() == [4.5, 6.0, 6.5]
    said = pq.read_metadata(table).metadata[KEY.encode()].decode()
    assert said != UNSEALED
    assert table.read_bytes().count(said.encode()) == 1


def test_no_flipped_bit_is_believed(table: Path) -> None:
    """Anywhere in the file, and each bit of the seal and of what stands around it."""
    content = table.read_bytes()
    around = 8 * content.index(KEY.encode())
    bits = random.Random(5).sample(range(8 * len(content)), N_FLIPS)
    bits += range(around - 800, min(around + 1000, 8 * len(content)))
    for bit in bits:
        table.write_bytes(flipped(content, bit))
        assert not is_whole(table), bit
        with pytest.raises(UsageError, match=r"damaged|not a Parquet file|cannot read"):
            read_undamaged(table)
    table.write_bytes(content)
    assert is_whole(table)


@pytest.mark.parametrize(
    "change",
    [
        lambda content: content[:-1],
        lambda content: content + b"\0",
        lambda content: content[:40] + content[41:],
        lambda content: content.replace(KEY.encode(), b"DPG.file_sha256"),
        lambda content: content.replace(b"dpg.x", b"dpg.z"),
    ],
)
def test_no_other_damage_is_believed(table: Path, change: Callable[[bytes], bytes]) -> None:
    table.write_bytes(change(table.read_bytes()))
    assert not is_whole(table)
    with pytest.raises(UsageError):
        read_undamaged(table)


@pytest.mark.parametrize("content", [b"", b"PAR1", b"x" * 70000, KEY.encode() + b"\x18\x40" + b"0"])
def test_what_is_no_table_has_no_whole_seal(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "t").write_bytes(content)
    assert not is_whole(tmp_path / "t")
    assert is_whole(tmp_path / "missing") is None


def test_what_is_left_of_our_metadata_is_not_believed_without_a_seal(table: Path) -> None:
    """Pyarrow keeps a part of it: it would vouch for values that somebody changed."""
    kept = pq.read_table(table).slice(1, 1)
    assert b"dpg.x" in kept.schema.metadata
    pq.write_table(kept, table)
    assert is_whole(table) is None
    with pytest.raises(UsageError, match=r"it has none any more; .*take its dpg\.\* metadata away"):
        read_designs(table)


def test_tables_of_others_have_no_seal_and_are_read(table: Path) -> None:
    kept = pq.read_table(table).slice(1, 1)
    pq.write_table(kept.replace_schema_metadata(None), table)
    assert is_whole(table) is None
    assert read_designs(table)[0]["design"].tolist() == [1]


def test_checksums_in_tables_of_others_count(table: Path) -> None:
    values = [float(place) for place in range(2000)]
    plain = {"use_dictionary": False, "compression": "none", "write_page_checksum": True}
    pq.write_table(pa.table({"x": values}), table, **plain)
    assert read_undamaged(table).column("x").to_pylist() == values
    content = table.read_bytes()
    table.write_bytes(flipped(content, 8 * 4000))
    assert pq.read_table(table).num_rows == 2000, "pyarrow alone does not look"
    with pytest.raises(UsageError, match="cannot read"):
        read_undamaged(table)


def test_the_content_hash_tells_flags_apart(tmp_path: Path) -> None:
    """Of tables that differ in one flag, in its last row alone, and in no other value."""
    hashes = set()
    for last in (False, True):
        written(tmp_path / "t", fingers_overlap=[True, False, last])
        hashes.add(pq.read_metadata(tmp_path / "t").metadata[b"dpg.content_sha256"])
    assert len(hashes) == 2


def test_the_content_hash_of_flags_is_that_of_their_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However they are cut into batches: bits before and after a slice do not count."""
    monkeypatch.setattr(table_writer, "rows_at_once", lambda _: 2)
    hashes = set()
    for cuts in ((0, 3), (0, 1, 3), (0, 2, 3)):
        batches = [
            record_batch(COLUMNS, {name: column[a:b] for name, column in rows().items()})
            for a, b in pairwise(cuts)
        ]
        write_table(tmp_path / "t", schema(COLUMNS), batches, {})
        hashes.add((tmp_path / "t").read_bytes())
    assert len(hashes) == 1
    assert pa.types.is_boolean(pq.read_schema(tmp_path / "t").field("fingers_overlap").type)


class Endless:
    """What a seal seems to stand in, and no end."""

    def __init__(self) -> None:
        self.begin = HEAD + b"0" * len(UNSEALED)
        self.at = 0

    def seek(self, place: int, _: int = 0) -> int:
        self.at = place
        return place

    def tell(self) -> int:
        return self.at

    def read(self, size: int = -1) -> bytes:
        assert 0 <= size < 2**22
        assert self.at < 2**24
        self.at += size
        return self.begin[self.at - size : self.at].ljust(size, b"x")


def test_a_seal_is_not_looked_for_without_end() -> None:
    stream: Any = Endless()
    assert is_whole_in(stream) is False
    assert stream.at > 0
