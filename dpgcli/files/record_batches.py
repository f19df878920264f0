"""Rows as Arrow's record batches, with types, units and descriptions.

Arrays become columns without a copy; `pyarrow.array` is avoided, since it imports pandas.
"""

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from dpgcli.arrays import Columns, distinct
from dpgcli.states.certify import Status
from dpgcli.states.columns import Column, Kind

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
                metadata=_said_of(column),
            )
            for column in columns
        ]
    )


def _said_of(column: Column) -> dict[str, str]:
    """Unit, description and, if it shows any, the kinds of outputs of a column."""
    outputs = ", ".join(column.outputs)
    said = {"unit": column.unit, "description": column.description}
    return {**said, "outputs": outputs} if outputs else said


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
    found = distinct(codes)
    texts = np.array(
        [list(Status)[code].text.encode() for code in found], "S"
    )  # as long as need be
    return _strings(texts[np.searchsorted(found, codes)])
