"""States as Parquet: the only writer of tables.

Arrays become columns without a copy; `pyarrow.array` is avoided, since it imports pandas.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from dpgcli import __version__
from dpgcli.arrays import Columns
from dpgcli.files.content import opened
from dpgcli.files.output import Mark, whole_file
from dpgcli.files.scene_file import spelled
from dpgcli.files.seal import KEY, UNSEALED, seal
from dpgcli.states.certify import Status
from dpgcli.states.columns import Column, Kind
from dpgcli.states.costs import rows_at_once
from dpgcli.states.plan import Plan
from dpgcli.states.predict import Prediction

SCHEMA_VERSION = 1
DISTINCT = ("pattern", "reached_pattern")  # text that a dictionary would not shorten
TYPES = {
    Kind.PATTERN: pa.string(),
    Kind.STATUS: pa.string(),
    Kind.TEXT: pa.string(),
    Kind.COUNT: pa.int64(),
    Kind.NUMBER: pa.float64(),
    Kind.FLAG: pa.bool_(),
}


def record_batch(columns: tuple[Column, ...], rows: Columns) -> Any:
    """Rows as a pyarrow RecordBatch."""
    arrays = [_array(column, rows[column.name]) for column in columns]
    return pa.RecordBatch.from_arrays(arrays, schema=schema(columns))


def schema(columns: tuple[Column, ...]) -> Any:
    """Names, types, units and descriptions."""
    return pa.schema(
        [
            pa.field(
                column.name,
                TYPES[column.kind],
                metadata={"unit": column.unit, "description": column.description},
            )
            for column in columns
        ]
    )


def write_states(
    prediction: Prediction, path: Path, spec_json: str, blocks: Iterable[Columns] | None = None
) -> None:
    """Write all states of a prediction, as they come; see `write_table`."""
    columns = prediction.plan.columns
    rows = prediction.blocks() if blocks is None else blocks
    batches = (record_batch(columns, block) for block in rows)
    write_table(path, schema(columns), batches, _metadata(prediction.plan, spec_json))


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
                stream, described.with_metadata(metadata), **_layout(described)
            ) as writer,
        ):
            for group in _ahead(groups) if in_thread else groups:
                writer.write_batch(group, row_group_size=rows_at_once(len(described)))
            content = {"dpg.content_sha256": digest.hexdigest()}
            writer.add_key_value_metadata({**content, KEY: UNSEALED})
        seal(temporary)


def _layout(described: Any) -> dict[str, Any]:
    """How the columns of a table are packed."""
    strings = [f.name for f in described if pa.types.is_string(f.type)]
    return {
        "compression": "zstd",
        "compression_level": 3,
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
    return json.dumps({"dpg": __version__, "numpy": np.__version__, "pyarrow": pa.__version__})


def write_run(path: Path, facts: dict[str, Any]) -> None:
    """Write what differs between runs (times, host) beside a table."""
    text = json.dumps({"written_by": f"dpg {__version__}", **facts}, indent=2)
    with whole_file(path, Mark.FACTS) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8", newline="\n")


def _metadata(plan: Plan, spec_json: str) -> dict[str, str]:
    request = plan.request
    return {
        "dpg.schema_version": str(SCHEMA_VERSION),
        "dpg.spec": spec_json,
        "dpg.spec_sha256": hashlib.sha256(spec_json.encode()).hexdigest(),
        "dpg.patterns": json.dumps(request.patterns),
        "dpg.formulation": request.formulation,
        "dpg.method": plan.method,
        "dpg.tolerance": repr(request.tolerance),
        "dpg.law": plan.scene.finger.law.description,
        "dpg.sources": json.dumps(
            [[s.key, s.units, spelled(s.value), s.origin, s.rule] for s in plan.scene.sources]
        ),
        "dpg.model_error": plan.scene.model_error.text,
        **({"dpg.uncertainty": plan.covers} if plan.covers else {}),
        "dpg.versions": versions(),
    }


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
        digest.update(np.diff(ends).tobytes())
        digest.update(memoryview(buffers[2])[ends[0] : ends[-1]] if len(column) else b"")
    elif pa.types.is_boolean(column.type):
        bits = np.unpackbits(np.frombuffer(buffers[1], np.uint8), bitorder="little")
        digest.update(bits[start:stop].tobytes())
    else:
        digest.update(np.frombuffer(buffers[1], np.uint64)[start:stop].tobytes())


def _array(column: Column, values: NDArray[Any]) -> Any:
    if column.kind in (Kind.PATTERN, Kind.TEXT):
        return _strings(values if values.dtype.kind == "S" else np.char.encode(values, "utf-8"))
    if column.kind is Kind.STATUS:
        return _statuses(values)
    if column.kind is Kind.FLAG:
        bits = np.packbits(values, bitorder="little")
        return pa.Array.from_buffers(pa.bool_(), len(values), [None, pa.py_buffer(bits)])
    dtype = np.int64 if column.kind is Kind.COUNT else np.float64
    buffer = pa.py_buffer(np.ascontiguousarray(values, dtype))
    return pa.Array.from_buffers(TYPES[column.kind], len(values), [None, buffer])


def _strings(values: NDArray[Any]) -> Any:
    """Byte strings, padded to one length in the array, as text."""
    content = np.ascontiguousarray(values).view(np.uint8).reshape(len(values), values.itemsize)
    ends = np.arange(len(values) + 1, dtype=np.int32) * np.int32(values.itemsize)
    if not content.all():  # the padding is zeros
        lengths = np.char.str_len(values)
        ends = np.concatenate(([0], np.cumsum(lengths))).astype(np.int32)
        content = content[np.arange(content.shape[1]) < lengths[:, None]]
    buffers = [None, pa.py_buffer(ends), pa.py_buffer(content)]
    return pa.Array.from_buffers(pa.string(), len(values), buffers)


def _statuses(codes: NDArray[Any]) -> Any:
    found = np.unique(codes)
    texts = np.array(
        [list(Status)[code].text.encode() for code in found], "S"
    )  # as long as need be
    return _strings(texts[np.searchsorted(found, codes)])
