"""Record batches as Parquet: the only writer of tables."""

import hashlib
import json
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from dpgcli import __version__
from dpgcli.code import versions_of_libraries
from dpgcli.files.content import opened
from dpgcli.files.output import Mark, whole_file
from dpgcli.files.seal import KEY, UNSEALED, seal
from dpgcli.states.costs import rows_at_once

SCHEMA_VERSION = 1
DISTINCT = ("pattern", "reached_pattern")  # text that a dictionary would not shorten


def write_table(
    path: Path,
    described: Any,
    batches: Iterable[Any],
    metadata: dict[str, str],
    *,
    in_thread: bool = False,
) -> None:
    """Write record batches, as they come, to a Parquet file.

    The same rows give the same bytes, however they are cut into batches. Batches that may be
    made in another thread are made `in_thread` while those before are compressed. The file is
    sealed. Raises OutputError, and leaves no half-written file whatever happens.
    """
    digest = hashlib.sha256()
    groups = _hashed(_row_groups(batches, described), digest)
    with whole_file(path, Mark.TABLE) as temporary:
        with (
            temporary.open("wb") as stream,  # pyarrow takes no name that is not text
            pq.ParquetWriter(
                stream, described.with_metadata(metadata), **packing(described)
            ) as writer,
        ):
            for group in _ahead(groups) if in_thread else groups:
                writer.write_batch(group, row_group_size=rows_at_once(len(described)))
            content = {"dpg.content_sha256": digest.hexdigest()}
            writer.add_key_value_metadata({**content, KEY: UNSEALED})
        seal(temporary)


def packing(described: Any) -> dict[str, Any]:
    """How the columns of a table are packed.

    Rows can be skipped by the least and the greatest of what is given, design by design; what is
    computed is spread over all of its range in every group of rows.
    """
    strings = [f.name for f in described if pa.types.is_string(f.type)]
    return {
        "compression": "zstd",
        "compression_level": 1,  # higher ones save a thousandth
        "write_statistics": [f.name for f in described if b"outputs" not in (f.metadata or {})],
        "use_dictionary": [name for name in strings if name not in DISTINCT],
        "use_byte_stream_split": [f.name for f in described if pa.types.is_floating(f.type)],
    }


def read_metadata(path: Path) -> dict[str, str]:
    """The metadata of a table; empty if there is none to read."""
    try:
        with opened(path) as stream:  # pyarrow takes no name that is not text
            found = pq.read_metadata(stream).metadata or {}
    except (OSError, pa.ArrowException):
        return {}
    return {
        key.decode(errors="replace"): text.decode(errors="replace") for key, text in found.items()
    }


def versions() -> str:
    """Versions of what makes the numbers and the files, as JSON."""
    libraries = versions_of_libraries()
    return json.dumps({"dpg": __version__, **libraries, "pyarrow": pa.__version__})


def write_run(path: Path, facts: dict[str, Any]) -> None:
    """Write what differs between runs (times, host) beside a table."""
    text = json.dumps({"written_by": f"dpg {__version__}", **facts}, indent=2)
    with whole_file(path, Mark.FACTS) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8", newline="\n")


def _row_groups(batches: Iterable[Any], described: Any) -> Iterator[Any]:
    """Batches joined and cut to row groups of one size; small groups cost time and space."""
    waiting: list[Any] = []
    n_waiting, size = 0, rows_at_once(len(described))
    for batch in batches:
        waiting.append(batch)
        n_waiting += batch.num_rows
        while n_waiting >= size:
            joined = pa.Table.from_batches(waiting, described)
            yield _one_batch(joined.slice(0, size), described)
            waiting = joined.slice(size).to_batches()
            n_waiting -= size
    yield _one_batch(pa.Table.from_batches(waiting, described), described)


def _hashed(groups: Iterable[Any], digest: Any) -> Iterator[Any]:
    for group in groups:
        for column in group.columns:
            _hash(digest, column)
        yield group


def _ahead(items: Iterator[Any]) -> Iterator[Any]:
    """The items, each made in a thread while the caller still works on the one before."""
    with ThreadPoolExecutor(1) as thread:
        coming = thread.submit(next, items, None)
        while (item := coming.result()) is not None:
            coming = thread.submit(next, items, None)
            yield item


def _one_batch(table: Any, described: Any) -> Any:
    batches = table.combine_chunks().to_batches()
    return batches[0] if batches else pa.RecordBatch.from_pylist([], schema=described)


def _hash(digest: Any, column: Any) -> None:
    """Feed values, not their layout: what stands before a slice or after it does not count."""
    buffers, start, stop = column.buffers(), column.offset, column.offset + len(column)
    if pa.types.is_string(column.type):
        ends = np.frombuffer(buffers[1], np.int32)[start : stop + 1]
        digest.update(np.diff(ends))
        digest.update(memoryview(buffers[2])[ends[0] : ends[-1]] if len(column) else b"")
    elif pa.types.is_boolean(column.type):
        bits = np.unpackbits(np.frombuffer(buffers[1], np.uint8), bitorder="little")
        digest.update(bits[start:stop])
    else:
        digest.update(np.frombuffer(buffers[1], np.uint64)[start:stop])
