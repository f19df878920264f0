"""States as Parquet: the only writer of tables.

Arrays become columns without a copy; `pyarrow.array` is avoided, since it imports pandas.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from dpgcli import __version__
from dpgcli.files.output import whole_file
from dpgcli.states.columns import Column, Kind
from dpgcli.states.plan import Plan
from dpgcli.states.predict import Prediction
from dpgcli.states.rows import Columns
from dpgcli.states.solve import Status

SCHEMA_VERSION = 1
ROWS_PER_GROUP = 2**17
TYPES = {
    Kind.PATTERN: pa.string(),
    Kind.STATUS: pa.string(),
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
    """Write all rows, as they come; the same input gives the same bytes.

    Raises OutputError, and leaves no half-written file whatever happens.
    """
    columns = prediction.plan.columns
    digest = hashlib.sha256()
    described = schema(columns).with_metadata(_metadata(prediction.plan, spec_json))
    with (
        whole_file(path) as temporary,
        pq.ParquetWriter(
            temporary,
            described,
            compression="zstd",
            compression_level=3,
            use_dictionary=[c.name for c in columns if c.kind is Kind.STATUS],
            use_byte_stream_split=[c.name for c in columns if c.kind is Kind.NUMBER],
        ) as writer,
    ):
        for rows in _row_groups(prediction.blocks() if blocks is None else blocks):
            for column in columns:
                digest.update(rows[column.name].tobytes())
            writer.write_batch(record_batch(columns, rows), row_group_size=ROWS_PER_GROUP)
        writer.add_key_value_metadata({"dpg.content_sha256": digest.hexdigest()})


def write_run(path: Path, facts: dict[str, Any]) -> None:
    """Write what differs between runs (times, host) beside a table."""
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")


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
        "dpg.law": "published: the spring pushes and pulls",
        "dpg.sources": json.dumps(
            [[s.key, s.units, s.value, s.origin, s.rule] for s in plan.scene.sources]
        ),
        "dpg.versions": json.dumps(
            {"dpg": __version__, "numpy": np.__version__, "pyarrow": pa.__version__}
        ),
    }


def _row_groups(blocks: Iterable[Columns]) -> Iterator[Columns]:
    """Blocks gathered to row groups; small groups cost time and space."""
    waiting: list[Columns] = []
    n_waiting = 0
    for block in blocks:
        waiting.append(block)
        n_waiting += len(block["pattern"])
        if n_waiting >= ROWS_PER_GROUP:
            yield _concatenated(waiting)
            waiting, n_waiting = [], 0
    if waiting:
        yield _concatenated(waiting)


def _concatenated(blocks: list[Columns]) -> Columns:
    if len(blocks) == 1:
        return blocks[0]
    return {name: np.concatenate([b[name] for b in blocks]) for name in blocks[0]}


def _array(column: Column, values: NDArray[Any]) -> Any:
    if column.kind is Kind.PATTERN:
        return _strings(values)
    if column.kind is Kind.STATUS:
        return _statuses(values)
    if column.kind is Kind.FLAG:
        bits = np.packbits(values, bitorder="little")
        return pa.Array.from_buffers(pa.bool_(), len(values), [None, pa.py_buffer(bits)])
    buffer = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(pa.float64(), len(values), [None, buffer])


def _strings(values: NDArray[Any]) -> Any:
    """Byte strings of one length as text."""
    ends = np.arange(len(values) + 1, dtype=np.int32) * np.int32(values.itemsize)
    buffers = [None, pa.py_buffer(ends), pa.py_buffer(np.ascontiguousarray(values))]
    return pa.Array.from_buffers(pa.string(), len(values), buffers)


def _statuses(codes: NDArray[Any]) -> Any:
    names = [status.text.encode() for status in Status]
    ends = np.cumsum([0, *map(len, names)], dtype=np.int32)
    buffers = [None, pa.py_buffer(ends), pa.py_buffer(b"".join(names))]
    texts = pa.Array.from_buffers(pa.string(), len(names), buffers)
    indices = pa.Array.from_buffers(
        pa.int8(), len(codes), [None, pa.py_buffer(codes.astype(np.int8))]
    )
    return pa.DictionaryArray.from_arrays(indices, texts).dictionary_decode()
